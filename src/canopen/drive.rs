//! Power state machine of a drive (CiA 402-2, 6.1): statusword in, controlword out.
//!
//! The [`Goal`] comes from the caller, and a fault is reset only on request. Mode and target values of the
//! enabled drive are not handled here.

use std::fmt;

/// Mode (6060h) in which the target torque (6071h) acts at every SYNC.
pub const CYCLIC_SYNCHRONOUS_TORQUE: i8 = 10;

/// Homing mode (6060h).
pub const HOMING: i8 = 6;

/// Statusword (6041h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Statusword(pub u16);

impl Statusword {
    /// Bit 2: target values act.
    pub const OPERATION_ENABLED: u16 = 1 << 2;
    /// Bit 3: a fault is present.
    pub const FAULT: u16 = 1 << 3;
    /// Bit 4: high voltage is applied to the power stage.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Bit 7: a warning is present; the state is unchanged.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 9: controlwords act.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 12 in homing mode: homing attained.
    pub const HOMING_ATTAINED: u16 = 1 << 12;
    /// Bit 13 in homing mode: homing error.
    pub const HOMING_ERROR: u16 = 1 << 13;
    /// Bit 11: a limit inside the drive is active, such as 6072h.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12 in cyclic modes: the drive follows the target.
    pub const TARGET_FOLLOWED: u16 = 1 << 12;

    /// Returns whether all of `bits` are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// Decodes the state; `None` for a pattern that CiA 402 does not define.
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

/// States of the power state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// Initialising.
    NotReadyToSwitchOn,
    /// No voltage; parameters may be set.
    SwitchOnDisabled,
    /// Voltage may be applied.
    ReadyToSwitchOn,
    /// Voltage is applied, no torque.
    SwitchedOn,
    /// Target values act.
    OperationEnabled,
    /// Quick stop in progress.
    QuickStopActive,
    /// Fault reaction in progress.
    FaultReactionActive,
    /// Stopped after a fault.
    Fault,
}

impl State {
    /// Name in CiA 402.
    pub const fn description(self) -> &'static str {
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

/// Name in CiA 402.
impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.description())
    }
}

/// Controlword (6040h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Disables voltage in any state: transitions 7, 9, 10, 12.
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// Quick stop as 605Ah defines it: transition 11.
    pub const QUICK_STOP: Self = Self(0x0002);
    /// Enters ready to switch on: transitions 2, 6, 8.
    pub const SHUTDOWN: Self = Self(0x0006);
    /// Enters switched on: transitions 3, 5.
    pub const SWITCH_ON: Self = Self(0x0007);
    /// Enters operation enabled: transition 4.
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// Starts a homing in operation enabled: bit 4 (CiA 402-2, 11).
    pub const START_HOMING: Self = Self(0x001F);
    /// Resets a fault by the rising edge of bit 7: transition 15.
    pub const FAULT_RESET: Self = Self(0x0080);

    /// Returns whether the word enters or keeps operation enabled (bits 0 to 3).
    pub const fn enables(self) -> bool {
        self.0 & 0x000F == 0x000F
    }
}

/// Target state of a drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Goal {
    /// Power stage disabled.
    #[default]
    VoltageDisabled,
    /// Power stage enabled, target values acting.
    OperationEnabled,
}

impl Goal {
    /// Returns whether a drive in `state` has reached the goal.
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

/// Returns the controlword of the next transition towards `goal`. It never resets a fault.
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

/// Controlwords for which bit 7 stays high at an edge, and low between two: some drives take a fault back only then.
const EDGE_LENGTH: u8 = 50;

/// Edges of one request. Some drives only acknowledge the fault at the first, or still have its cause then.
const MAX_EDGES: u8 = 2;

/// Controlwords of one drive; one fault reset per request, of at most two edges.
#[derive(Clone, Debug, Default)]
pub struct PowerStage {
    reset: Reset,
    last: Option<Controlword>,
}

/// Progress of a fault reset. It is an edge: a controlword without bit 7 comes before the one with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Reset {
    #[default]
    Idle,
    Requested,
    /// Bit 7 is high.
    Raised {
        edges: u8,
        words: u8,
    },
    /// Bit 7 is low before the next edge.
    Lowered {
        edges: u8,
        words: u8,
    },
}

impl PowerStage {
    /// Requests one fault reset. The request lapses if there is no fault.
    pub const fn reset_fault(&mut self) {
        self.reset = Reset::Requested;
    }

    /// Returns the controlword to send to a drive whose last reported state is `state`.
    pub fn controlword(&mut self, state: Option<State>, goal: Goal) -> Controlword {
        let bit_was_low = self.last.is_some_and(|last| last.0 & Controlword::FAULT_RESET.0 == 0);
        self.reset = match (self.reset, state) {
            (Reset::Requested, Some(State::Fault)) if bit_was_low => {
                Reset::Raised { edges: 1, words: 1 }
            }
            (Reset::Requested, Some(State::Fault | State::FaultReactionActive) | None) => {
                Reset::Requested
            }
            (Reset::Raised { edges, words }, Some(State::Fault))
                if words < EDGE_LENGTH || edges >= MAX_EDGES =>
            {
                Reset::Raised { edges, words: words.saturating_add(1) }
            }
            (Reset::Raised { edges, .. }, Some(State::Fault)) => Reset::Lowered { edges, words: 1 },
            (Reset::Lowered { edges, words }, Some(State::Fault)) if words < EDGE_LENGTH => {
                Reset::Lowered { edges, words: words + 1 }
            }
            (Reset::Lowered { edges, .. }, Some(State::Fault)) => {
                Reset::Raised { edges: edges + 1, words: 1 }
            }
            (Reset::Idle | Reset::Requested | Reset::Raised { .. } | Reset::Lowered { .. }, _) => {
                Reset::Idle
            }
        };
        let controlword = match self.reset {
            Reset::Raised { .. } => Controlword::FAULT_RESET,
            Reset::Idle | Reset::Requested | Reset::Lowered { .. } => next_controlword(state, goal),
        };
        self.last = Some(controlword);
        controlword
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the state of a drive after a controlword.
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
    fn drive_without_a_fault_can_be_enabled_and_disabled() {
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
    fn drive_in_unknown_state_is_disabled() {
        assert_eq!(next_controlword(None, Goal::OperationEnabled), Controlword::DISABLE_VOLTAGE);
    }

    #[test]
    fn reset_request_without_a_fault_lapses() {
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
        fn reset_bit_rises_at_most_twice_per_request(
            steps in proptest::collection::vec((0_usize..9, prop::bool::weighted(0.02), any::<bool>()), 0..400),
            stays_in_fault: bool,
        ) {
            let mut stage = PowerStage::default();
            let (mut requests, mut edges, mut high) = (0, 0, true);
            for (state, requested, enable) in steps {
                if requested {
                    stage.reset_fault();
                    requests += 1;
                }
                let state = if stays_in_fault { 7 } else { state };
                let state = STATES.get(state).map(|(_, state)| *state);
                let goal = if enable { Goal::OperationEnabled } else { Goal::VoltageDisabled };
                let word = stage.controlword(state, goal);
                let raised = word == Controlword::FAULT_RESET;
                edges += u32::from(raised && !high);
                high = raised;
                prop_assert!(!raised || state == Some(State::Fault));
                prop_assert!(edges <= 2 * requests);
            }
        }
    }

    /// Controlwords with a transition in each state of CiA 402, while the drive is being enabled.
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
        fn property_11_any_statuswords_lead_to_legal_transitions_only(
            steps in prop::collection::vec((any::<u16>(), any::<bool>(), any::<bool>()), 0..100),
        ) {
            let mut stage = PowerStage::default();
            for (word, requested, enable) in steps {
                if requested {
                    stage.reset_fault();
                }
                let state = Statusword(word).state();
                let goal = if enable { Goal::OperationEnabled } else { Goal::VoltageDisabled };
                let sent = stage.controlword(state, goal);
                prop_assert!(is_legal(state, sent), "{sent:?} in {state:?}");
                prop_assert!(enable || sent.0 & 0x0F == 0, "no enable while voltage is to be disabled");
            }
        }
    }

    #[test]
    fn fault_that_stays_gets_a_second_edge_and_no_third() {
        let mut stage = PowerStage::default();
        stage.reset_fault();
        let is_high = |word: Controlword| word == Controlword::FAULT_RESET;
        let words: Vec<bool> = (0..1_000)
            .map(|_| is_high(stage.controlword(Some(State::Fault), Goal::OperationEnabled)))
            .collect();
        let edges: Vec<usize> =
            (1..words.len()).filter(|at| words[*at] && !words[at - 1]).collect();
        assert_eq!(edges, [1, 101], "after a low bit, then after 50 high and 50 low ones");
        let word = stage.controlword(Some(State::SwitchOnDisabled), Goal::OperationEnabled);
        assert_eq!(word, Controlword::SHUTDOWN);
    }

    #[test]
    fn fault_reset_is_one_edge_after_a_low_bit() {
        let mut stage = PowerStage::default();
        stage.reset_fault();
        let words: Vec<_> =
            (0..4).map(|_| stage.controlword(Some(State::Fault), Goal::OperationEnabled)).collect();
        assert_eq!(words[0], Controlword::DISABLE_VOLTAGE, "an edge needs a low bit first");
        assert!(words[1..].iter().all(|word| *word == Controlword::FAULT_RESET), "the bit is held");
        let state = follow(State::Fault, words[1], true);
        let word = stage.controlword(Some(state), Goal::OperationEnabled);
        assert_eq!(word, Controlword::SHUTDOWN);
    }
}
