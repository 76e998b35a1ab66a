//! The power state machine of a drive (CiA 402-2, 6.1): statusword in, controlword out.
//!
//! Decides nothing: a [`Goal`] is given, and a fault is reset only when asked for. What the drive
//! does once enabled (its mode, its target) is not here.

use std::fmt;

/// The mode in which 6071h, target torque, is taken at every SYNC (6060h).
pub const CYCLIC_SYNCHRONOUS_TORQUE: i8 = 10;

/// What a drive says of itself (6041h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Statusword(pub u16);

impl Statusword {
    /// Bit 2: target values are acted upon.
    pub const OPERATION_ENABLED: u16 = 1 << 2;
    /// Bit 3: a fault is there.
    pub const FAULT: u16 = 1 << 3;
    /// Bit 4: the power stage has its voltage.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Bit 7: a warning is there; the state is as it was.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 9: controlwords are acted upon.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 11: a limit inside the drive is active, such as 6072h.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12 in cyclic modes: the target is followed.
    pub const TARGET_FOLLOWED: u16 = 1 << 12;

    /// Whether every one of `bits` is set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The state, `None` for a pattern CiA 402 does not know.
    pub const fn state(self) -> Option<State> {
        match (self.0 & 0x4F, self.0 & 0x6F) {
            (0x00, _) => Some(State::NotReadyToSwitchOn),
            (0x40, _) => Some(State::SwitchOnDisabled),
            (_, 0x21) => Some(State::ReadyToSwitchOn),
            (_, 0x23) => Some(State::SwitchedOn),
            (_, 0x27) => Some(State::OperationEnabled),
            (_, 0x07) => Some(State::QuickStopActive),
            (0x0F, _) => Some(State::FaultReactionActive),
            (0x08, _) => Some(State::Fault),
            _ => None,
        }
    }
}

/// The states of the power stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Initialising.
    NotReadyToSwitchOn,
    /// Ready for parameters, no voltage.
    SwitchOnDisabled,
    /// Voltage may be applied.
    ReadyToSwitchOn,
    /// Voltage is applied, no torque.
    SwitchedOn,
    /// Target values are acted upon.
    OperationEnabled,
    /// Stopping by itself.
    QuickStopActive,
    /// Stopping because of a fault.
    FaultReactionActive,
    /// Stopped because of a fault.
    Fault,
}

impl State {
    /// What CiA 402 calls it.
    pub const fn words(self) -> &'static str {
        match self {
            Self::NotReadyToSwitchOn => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
        }
    }
}

/// As CiA 402 calls it.
impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.words())
    }
}

/// What a drive is told to do (6040h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Power off, whatever the state: transitions 7, 9, 10, 12.
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// Stop as 605Ah says: transition 11.
    pub const QUICK_STOP: Self = Self(0x0002);
    /// To ready to switch on: transitions 2, 6, 8.
    pub const SHUTDOWN: Self = Self(0x0006);
    /// To switched on: transitions 3, 5.
    pub const SWITCH_ON: Self = Self(0x0007);
    /// To operation enabled: transition 4.
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// Out of fault, by the rising edge of bit 7: transition 15.
    pub const FAULT_RESET: Self = Self(0x0080);

    /// Returns whether it leads to operation enabled, or leaves a drive there (bits 0 to 3).
    pub const fn enables(self) -> bool {
        self.0 & 0x000F == 0x000F
    }
}

/// Where a drive is to be led.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Goal {
    /// Power stage off.
    #[default]
    VoltageDisabled,
    /// Target values acted upon.
    OperationEnabled,
}

impl Goal {
    /// Whether a drive in `state` is there.
    pub const fn is_reached(self, state: Option<State>) -> bool {
        let Some(state) = state else { return false };
        match self {
            Self::OperationEnabled => matches!(state, State::OperationEnabled),
            Self::VoltageDisabled => {
                matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault)
            }
        }
    }
}

/// The controlword for the next transition towards `goal`; no transition leads out of a fault here.
pub const fn next_controlword(state: Option<State>, goal: Goal) -> Controlword {
    let Some(state) = state else { return Controlword::DISABLE_VOLTAGE };
    match (goal, state) {
        (Goal::VoltageDisabled, _)
        | (
            Goal::OperationEnabled,
            State::NotReadyToSwitchOn
            | State::QuickStopActive
            | State::FaultReactionActive
            | State::Fault,
        ) => Controlword::DISABLE_VOLTAGE,
        (Goal::OperationEnabled, State::SwitchOnDisabled) => Controlword::SHUTDOWN,
        (Goal::OperationEnabled, State::ReadyToSwitchOn) => Controlword::SWITCH_ON,
        (Goal::OperationEnabled, State::SwitchedOn | State::OperationEnabled) => {
            Controlword::ENABLE_OPERATION
        }
    }
}

/// Leads one drive, and resets a fault once for each time it is asked to.
#[derive(Clone, Debug, Default)]
pub struct PowerStage {
    reset: Reset,
    last: Option<Controlword>,
}

/// A fault reset is an edge, so it takes a controlword without bit 7 before the one with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Reset {
    #[default]
    Idle,
    Asked,
    Raised,
}

impl PowerStage {
    /// Asks for one fault reset. Without a fault there is nothing to reset, and the request lapses.
    pub const fn reset_fault(&mut self) {
        self.reset = Reset::Asked;
    }

    /// The controlword to send now, to a drive last heard in `state`.
    pub fn controlword(&mut self, state: Option<State>, goal: Goal) -> Controlword {
        let bit_was_low = self.last.is_some_and(|last| last.0 & Controlword::FAULT_RESET.0 == 0);
        self.reset = match (self.reset, state) {
            (Reset::Asked, Some(State::Fault)) if bit_was_low => Reset::Raised,
            (Reset::Asked, Some(State::Fault | State::FaultReactionActive) | None) => Reset::Asked,
            (Reset::Raised, Some(State::Fault)) => Reset::Raised,
            (Reset::Idle | Reset::Asked | Reset::Raised, _) => Reset::Idle,
        };
        let controlword = match self.reset {
            Reset::Raised => Controlword::FAULT_RESET,
            Reset::Idle | Reset::Asked => next_controlword(state, goal),
        };
        self.last = Some(controlword);
        controlword
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// What a drive in `state` makes of a controlword.
    fn follow(state: State, word: Controlword, rose: bool) -> State {
        match (state, word) {
            (State::Fault, _) if rose => State::SwitchOnDisabled,
            (State::Fault, _) => State::Fault,
            (State::FaultReactionActive, _) => State::Fault,
            (State::NotReadyToSwitchOn, _) => State::SwitchOnDisabled,
            (State::SwitchOnDisabled, Controlword::SHUTDOWN) => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn, Controlword::SWITCH_ON) => State::SwitchedOn,
            (State::SwitchedOn, Controlword::ENABLE_OPERATION) => State::OperationEnabled,
            (_, Controlword::DISABLE_VOLTAGE) => State::SwitchOnDisabled,
            (state, _) => state,
        }
    }

    const STATES: [(u16, State); 8] = [
        (0x0000, State::NotReadyToSwitchOn),
        (0x0040, State::SwitchOnDisabled),
        (0x0021, State::ReadyToSwitchOn),
        (0x0023, State::SwitchedOn),
        (0x0027, State::OperationEnabled),
        (0x0007, State::QuickStopActive),
        (0x000F, State::FaultReactionActive),
        (0x0008, State::Fault),
    ];

    #[test]
    fn bits_outside_the_mask_do_not_change_the_state() {
        for (pattern, state) in STATES {
            for other in [0x0000, 0x0010, 0x0080, 0x1600, 0xFF90] {
                assert_eq!(Statusword(pattern | other).state(), Some(state), "{state}");
            }
        }
        assert_eq!(Statusword(0x0001).state(), None);
    }

    #[test]
    fn every_drive_without_a_fault_can_be_enabled_and_disabled() {
        for (_, start) in STATES {
            let mut stage = PowerStage::default();
            let mut state = start;
            for _ in 0..6 {
                state =
                    follow(state, stage.controlword(Some(state), Goal::OperationEnabled), false);
            }
            let faulty = matches!(start, State::Fault | State::FaultReactionActive);
            assert_eq!(state, if faulty { State::Fault } else { State::OperationEnabled });
            state = follow(state, stage.controlword(Some(state), Goal::VoltageDisabled), false);
            assert_eq!(state, if faulty { State::Fault } else { State::SwitchOnDisabled });
        }
    }

    #[test]
    fn a_drive_of_unknown_state_is_powered_off() {
        assert_eq!(next_controlword(None, Goal::OperationEnabled), Controlword::DISABLE_VOLTAGE);
    }

    #[test]
    fn a_reset_without_a_fault_does_not_wait_for_one() {
        let mut stage = PowerStage::default();
        stage.reset_fault();
        stage.controlword(Some(State::SwitchOnDisabled), Goal::OperationEnabled);
        for _ in 0..3 {
            let word = stage.controlword(Some(State::Fault), Goal::OperationEnabled);
            assert_eq!(word, Controlword::DISABLE_VOLTAGE);
        }
    }

    proptest! {
        #[test]
        fn the_reset_bit_rises_at_most_once_for_each_request(
            steps in proptest::collection::vec((0_usize..9, prop::bool::weighted(0.1), any::<bool>()), 0..200),
        ) {
            let mut stage = PowerStage::default();
            let (mut requests, mut edges, mut high) = (0, 0, true);
            for (state, asked, enable) in steps {
                if asked {
                    stage.reset_fault();
                    requests += 1;
                }
                let state = STATES.get(state).map(|(_, state)| *state);
                let goal = if enable { Goal::OperationEnabled } else { Goal::VoltageDisabled };
                let word = stage.controlword(state, goal);
                let raised = word == Controlword::FAULT_RESET;
                edges += u32::from(raised && !high);
                high = raised;
                prop_assert!(!raised || state == Some(State::Fault));
                prop_assert!(edges <= requests);
            }
        }
    }

    /// The words CiA 402 has a transition for in each state, when the drive is to be enabled.
    const fn is_legal(state: Option<State>, word: Controlword) -> bool {
        match word {
            Controlword::DISABLE_VOLTAGE => true,
            Controlword::SHUTDOWN => matches!(state, Some(State::SwitchOnDisabled)),
            Controlword::SWITCH_ON => matches!(state, Some(State::ReadyToSwitchOn)),
            Controlword::ENABLE_OPERATION => {
                matches!(state, Some(State::SwitchedOn | State::OperationEnabled))
            }
            Controlword::FAULT_RESET => matches!(state, Some(State::Fault)),
            _ => false,
        }
    }

    proptest! {
        #[test]
        fn property_11_whatever_statuswords_come_only_legal_transitions_are_asked_for(
            steps in prop::collection::vec((any::<u16>(), any::<bool>(), any::<bool>()), 0..100),
        ) {
            let mut stage = PowerStage::default();
            for (word, asked, enable) in steps {
                if asked {
                    stage.reset_fault();
                }
                let state = Statusword(word).state();
                let goal = if enable { Goal::OperationEnabled } else { Goal::VoltageDisabled };
                let told = stage.controlword(state, goal);
                prop_assert!(is_legal(state, told), "{told:?} in {state:?}");
                prop_assert!(enable || told.0 & 0x0F == 0, "nothing is enabled that is to be off");
            }
        }
    }

    #[test]
    fn a_fault_goes_away_by_one_edge_after_a_low_bit() {
        let mut stage = PowerStage::default();
        stage.reset_fault();
        let words: Vec<_> =
            (0..4).map(|_| stage.controlword(Some(State::Fault), Goal::OperationEnabled)).collect();
        assert_eq!(words[0], Controlword::DISABLE_VOLTAGE, "an edge needs a low bit first");
        assert!(
            words[1..].iter().all(|word| *word == Controlword::FAULT_RESET),
            "held, not pulsed"
        );
        let state = follow(State::Fault, words[1], true);
        let word = stage.controlword(Some(state), Goal::OperationEnabled);
        assert_eq!(word, Controlword::SHUTDOWN);
    }
}
