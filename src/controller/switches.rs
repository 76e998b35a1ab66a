//! Logic of the three switches of a hand controller (4.1): from levels to permissions and requests.
//!
//! The two antivalent deadman contacts are one level here. Decisions 27, 28 and 29:
//!
//! | deadman | reflection | command | task wrench | return to centre | damping | gravity |
//! |---------|------------|---------|-------------|------------------|---------|---------|
//! | up      | any        | –       | –           | –                | –       | yes     |
//! | held    | off        | yes     | –           | –                | –       | yes     |
//! | held    | on         | yes     | yes         | rate mode        | yes     | yes     |
//!
//! Each press of the reflection switch toggles reflection. The reference switch acts once per press in rate mode. In pose
//! mode it is a clutch while held: it sets the reference in every cycle (the index button of the paper). A switch
//! that is closed in the first cycle is ignored until it is released.

pub use units::spatial::CommandMode;

/// Levels of the switches; `true` is closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Switches {
    /// Enabling device: permits commands and reflection.
    pub deadman: bool,
    /// Sets the reference; index button in pose mode.
    pub reference: bool,
    /// Turns reflection, return to centre and damping on and off.
    pub reflection: bool,
}

/// Permissions and requests of the switches in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Permissions {
    /// Permits commands to the object.
    pub commands: bool,
    /// Permits the task wrench.
    pub task: bool,
    /// Permits the return to centre.
    pub centring: bool,
    /// Permits damping of the hand's motion.
    pub damping: bool,
    /// Requests a new reference at the present poses.
    pub reference: bool,
    /// First cycle of commanding: the deadman has closed, or the mode has changed with it closed.
    pub engaged: bool,
    /// Commanding starts with a new reference in this mode, so that the object does not jump.
    pub latches: bool,
    /// Reflection is switched on, with the deadman held or not.
    pub reflects: bool,
}

impl Permissions {
    /// No permissions and no requests.
    pub const NOTHING: Self = Self {
        commands: false,
        task: false,
        centring: false,
        damping: false,
        reference: false,
        engaged: false,
        latches: false,
        reflects: false,
    };
}

/// Edge detection of the switches, with the state of deadman and reflection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwitchLogic {
    before: Switches,
    mode: CommandMode,
    latches: bool,
    held: bool,
    reflecting: bool,
}

impl SwitchLogic {
    /// Creates the logic with every switch assumed closed and reflection off. `latches`: closing the deadman in pose mode
    /// sets the reference (decision 29).
    pub const fn new(mode: CommandMode, latches: bool) -> Self {
        let closed = Switches { deadman: true, reference: true, reflection: true };
        Self { before: closed, mode, latches, held: false, reflecting: false }
    }

    /// Evaluates the levels of this cycle.
    pub fn read(&mut self, now: Switches, mode: CommandMode) -> Permissions {
        let Self { before, mode: mode_before, latches, held: held_before, reflecting } = *self;
        let held = now.deadman && (held_before || !before.deadman);
        let reflecting = reflecting != (now.reflection && !before.reflection);
        *self = Self { before: now, mode, latches, held, reflecting };
        Permissions {
            commands: held,
            task: held && reflecting,
            centring: held && reflecting && mode == CommandMode::Rate,
            damping: held && reflecting,
            reference: now.reference && (mode == CommandMode::Pose || !before.reference),
            engaged: held && (!held_before || mode != mode_before),
            latches: mode == CommandMode::Pose && (latches || mode != mode_before),
            reflects: reflecting,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const UP: Switches = Switches { deadman: false, reference: false, reflection: false };
    const DEADMAN: Switches = Switches { deadman: true, ..UP };
    const REFERENCE: Switches = Switches { reference: true, ..DEADMAN };
    const REFLECTION: Switches = Switches { reflection: true, ..DEADMAN };

    fn released(mode: CommandMode) -> SwitchLogic {
        let mut switches = SwitchLogic::new(mode, true);
        switches.read(UP, mode);
        switches
    }

    proptest! {
        #[test]
        fn without_the_deadman_nothing_is_permitted(
            presses in prop::collection::vec(any::<[bool; 3]>(), 0..20)
        ) {
            let mut switches = SwitchLogic::new(CommandMode::Rate, true);
            for [deadman, reference, reflection] in presses {
                let pressed = switches.read(Switches { deadman, reference, reflection }, CommandMode::Rate);
                if !deadman {
                    let Permissions { commands, task, centring, damping, engaged, .. } = pressed;
                    prop_assert!(!(commands || task || centring || damping || engaged));
                }
            }
        }
    }

    #[test]
    fn a_switch_closed_from_the_start_counts_after_its_release() {
        let all = Switches { deadman: true, reference: true, reflection: true };
        let mut switches = SwitchLogic::new(CommandMode::Rate, true);
        for _ in 0..3 {
            assert_eq!(switches.read(all, CommandMode::Rate), Permissions::NOTHING);
        }
        switches.read(UP, CommandMode::Rate);
        let pressed = switches.read(all, CommandMode::Rate);
        assert!(pressed.commands && pressed.engaged && pressed.reference && pressed.task);
    }

    #[test]
    fn reflection_is_turned_by_a_press_and_stays() {
        let mut switches = released(CommandMode::Rate);
        let felt = [DEADMAN, REFLECTION, REFLECTION, DEADMAN, UP, DEADMAN, REFLECTION, DEADMAN]
            .map(|levels| switches.read(levels, CommandMode::Rate).task);
        assert_eq!(felt, [false, true, true, true, false, true, false, false]);
    }

    #[test]
    fn reference_is_edge_in_rate_mode_and_clutch_in_pose_mode() {
        for (mode, expected) in
            [(CommandMode::Rate, [true, false, false]), (CommandMode::Pose, [true, true, false])]
        {
            let mut switches = released(mode);
            let asked =
                [REFERENCE, REFERENCE, DEADMAN].map(|now| switches.read(now, mode).reference);
            assert_eq!(asked, expected);
        }
    }

    #[test]
    fn commanding_begins_with_the_deadman_and_with_a_change_of_mode() {
        let mut switches = released(CommandMode::Rate);
        assert!(switches.read(DEADMAN, CommandMode::Rate).engaged);
        assert!(!switches.read(DEADMAN, CommandMode::Rate).engaged);
        let changed = switches.read(DEADMAN, CommandMode::Pose);
        assert!(changed.engaged && changed.latches && !changed.centring);
    }
}
