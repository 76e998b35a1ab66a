//! Power state machine of a drive (CiA 402-2, 6.1): controlword in, statusword out.
//!
//! ```text
//!  start ─0→ not ready ─1→ switch on ─2→ ready to ─3→ switched ─4→ operation ─11→ quick stop
//!                           disabled ←7─ switch on ←6─   on     ←5─  enabled  ←16─   active
//!                            ↑ 9, 10, 12                    8: from operation enabled
//!                            └──15── fault ←14─ fault reaction active ←13─ any state
//! ```
//!
//! Holds the states and the stop that must end before the next one. [`stop`](super::stop) and
//! [`motion`](crate::motion) execute stops.

use crate::drive::options::Options;
use crate::motion::Ramp;
use canopen::drive::{Controlword, State, Statusword};

/// Power state machine of one drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    state: State,
    last: Controlword,
    stop: Option<Stop>,
}

/// Ramp of a stop in progress, and the state after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stop {
    ramp: Ramp,
    /// State after the stop.
    end: State,
}

impl Default for Power {
    /// Returns the state after power-up (transition 0).
    fn default() -> Self {
        Self { state: State::NotReadyToSwitchOn, last: Controlword::default(), stop: None }
    }
}

/// Command of a controlword (CiA 402-2, table 29), except a fault reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    DisableVoltage,
    QuickStop,
    Shutdown,
    /// In operation enabled the same bits disable operation.
    SwitchOn,
    EnableOperation,
}

impl Command {
    /// Decodes the command; `None` for a fault reset (bit 7).
    const fn decode(word: Controlword) -> Option<Self> {
        match word.0 & 0x8F {
            command if command & 0x82 == 0x00 => Some(Self::DisableVoltage),
            command if command & 0x86 == 0x02 => Some(Self::QuickStop),
            command if command & 0x87 == 0x06 => Some(Self::Shutdown),
            0x07 => Some(Self::SwitchOn),
            0x0F => Some(Self::EnableOperation),
            _ => None,
        }
    }
}

impl Power {
    /// Returns the state of the power drive system, as the statusword shows it.
    pub(super) const fn state(&self) -> State {
        self.state
    }

    /// Returns whether the power stage can apply torque in this state.
    pub(super) const fn has_torque(&self) -> bool {
        matches!(
            self.state,
            State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
        )
    }

    /// Returns the ramp of the stop in progress.
    pub(super) fn ramp(&self) -> Option<Ramp> {
        self.stop.map(|stop| stop.ramp)
    }

    /// Returns the last controlword.
    pub(super) const fn controlword(&self) -> Controlword {
        self.last
    }

    /// Ends the self-test (transition 1).
    pub(super) const fn initialise(&mut self) {
        if matches!(self.state, State::NotReadyToSwitchOn) {
            self.enter(State::SwitchOnDisabled);
        }
    }

    /// Applies a controlword; `options` select the stops.
    ///
    /// Resets a fault at a *rising edge* of bit 7 if its cause is gone (`may_reset`). A bit that stays set has no effect.
    pub(super) fn on_controlword(&mut self, word: Controlword, options: &Options, may_reset: bool) {
        let reset = Controlword::FAULT_RESET.0;
        let is_rising_edge = word.0 & reset != 0 && self.last.0 & reset == 0;
        self.last = word;
        if self.state == State::Fault {
            if is_rising_edge && may_reset {
                self.enter(State::SwitchOnDisabled);
            }
        } else if let Some(command) = Command::decode(word) {
            self.execute(command, options);
        }
    }

    fn execute(&mut self, command: Command, options: &Options) {
        match (self.state, command) {
            (
                State::ReadyToSwitchOn
                | State::SwitchedOn
                | State::OperationEnabled
                | State::QuickStopActive,
                Command::DisableVoltage,
            )
            | (State::ReadyToSwitchOn | State::SwitchedOn, Command::QuickStop) => {
                self.enter(State::SwitchOnDisabled);
            }
            (
                State::SwitchOnDisabled | State::ReadyToSwitchOn | State::SwitchedOn,
                Command::Shutdown,
            ) => self.enter(State::ReadyToSwitchOn),
            (State::ReadyToSwitchOn | State::SwitchedOn, Command::SwitchOn) => {
                self.enter(State::SwitchedOn);
            }
            (State::ReadyToSwitchOn | State::SwitchedOn, Command::EnableOperation) => {
                self.enter(State::OperationEnabled);
            }
            (State::OperationEnabled, Command::QuickStop) => self.quick_stop(options),
            (State::OperationEnabled, Command::Shutdown) => {
                self.leave(options.shutdown_ramp(), State::ReadyToSwitchOn);
            }
            (State::OperationEnabled, Command::SwitchOn) => {
                self.leave(options.disable_operation_ramp(), State::SwitchedOn);
            }
            (State::OperationEnabled, Command::EnableOperation) => self.stop = None,
            (State::QuickStopActive, Command::EnableOperation) if self.remains_in_quick_stop() => {
                self.enter(State::OperationEnabled);
            }
            (
                State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::QuickStopActive
                | State::FaultReactionActive
                | State::Fault,
                _,
            ) => {}
        }
    }

    /// Returns whether the quick stop ends in quick stop active.
    fn remains_in_quick_stop(&self) -> bool {
        self.stop.is_none_or(|stop| stop.end == State::QuickStopActive)
    }

    /// Enters the fault reaction on `ramp` while the drive has torque, else Fault at once (transitions 13 and 14).
    pub(super) fn fail(&mut self, ramp: Option<Ramp>) {
        match ramp {
            Some(_) if self.state == State::FaultReactionActive => {}
            Some(ramp) if self.has_torque() => {
                self.state = State::FaultReactionActive;
                self.stop = Some(Stop { ramp, end: State::Fault });
            }
            Some(_) | None => self.enter(State::Fault),
        }
    }

    /// Acts as the command disable voltage. Fault stays.
    pub(super) fn disable_voltage(&mut self) {
        self.execute(Command::DisableVoltage, &Options::default());
    }

    /// Acts as the command quick stop.
    pub(super) fn quick_stop(&mut self, options: &Options) {
        match (self.state, options.quick_stop_ramp()) {
            (State::OperationEnabled, Some(ramp)) => {
                let stays = options.stays_in_quick_stop();
                let end = if stays { State::QuickStopActive } else { State::SwitchOnDisabled };
                self.state = State::QuickStopActive;
                self.stop = Some(Stop { ramp, end });
            }
            (State::OperationEnabled, None) | (State::ReadyToSwitchOn | State::SwitchedOn, _) => {
                self.enter(State::SwitchOnDisabled);
            }
            (
                State::NotReadyToSwitchOn
                | State::SwitchOnDisabled
                | State::QuickStopActive
                | State::FaultReactionActive
                | State::Fault,
                _,
            ) => {}
        }
    }

    /// Completes a stop, at standstill of the motor or after the timeout.
    pub(super) fn on_stopped(&mut self) {
        if let Some(stop) = self.stop {
            self.enter(stop.end);
        }
    }

    /// Leaves operation enabled: after `ramp`, or at once.
    fn leave(&mut self, ramp: Option<Ramp>, end: State) {
        match ramp {
            Some(ramp) => self.stop = Some(Stop { ramp, end }),
            None => self.enter(end),
        }
    }

    const fn enter(&mut self, state: State) {
        self.state = state;
        self.stop = None;
    }

    /// Returns the statusword bits of the state.
    pub(super) const fn statusword(&self) -> Statusword {
        Statusword(match self.state {
            State::NotReadyToSwitchOn => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReactionActive => 0x0F,
            State::Fault => 0x08,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use canopen::drive::{Goal, PowerStage};

    /// All stops immediate; the quick stop is a ramp that ends in quick stop active.
    const OPTIONS: Options = Options {
        abort_connection: 0,
        quick_stop: 6,
        shutdown: 0,
        disable_operation: 0,
        fault_reaction: 0,
    };
    /// All stops on a ramp; the quick stop ends in switch on disabled.
    const RAMPS: Options =
        Options { quick_stop: 2, shutdown: 1, disable_operation: 1, fault_reaction: 2, ..OPTIONS };

    const NOT_READY: State = State::NotReadyToSwitchOn;
    const DISABLED: State = State::SwitchOnDisabled;
    const READY: State = State::ReadyToSwitchOn;
    const ON: State = State::SwitchedOn;
    const ENABLED: State = State::OperationEnabled;
    const QUICK_STOP: State = State::QuickStopActive;
    const REACTION: State = State::FaultReactionActive;
    const FAULT: State = State::Fault;

    /// Bits 7 to 0 of each command, "x" for any (CiA 402-2, command coding).
    const COMMANDS: [&str; 5] = [
        "0xxxxx0x", // disable voltage
        "0xxxx01x", // quick stop
        "0xxxx110", // shutdown
        "0xxx0111", // switch on; disable operation
        "0xxx1111", // enable operation
    ];

    /// State after each of these commands, and after the rising edge of bit 7 (CiA 402-2, transitions;
    /// 605Ah is 5 to 8).
    #[rustfmt::skip]
    const TRANSITIONS: [(State, [State; 6]); 8] = [
        //           disable     quick       shutdown   switch on  enable     fault reset
        (NOT_READY,  [NOT_READY,  NOT_READY,  NOT_READY,  NOT_READY,  NOT_READY,  NOT_READY]),
        (DISABLED,   [DISABLED,   DISABLED,   READY,      DISABLED,   DISABLED,   DISABLED]),
        (READY,      [DISABLED,   DISABLED,   READY,      ON,         ENABLED,    READY]),
        (ON,         [DISABLED,   DISABLED,   READY,      ON,         ENABLED,    ON]),
        (ENABLED,    [DISABLED,   QUICK_STOP, READY,      ON,         ENABLED,    ENABLED]),
        (QUICK_STOP, [DISABLED,   QUICK_STOP, QUICK_STOP, QUICK_STOP, ENABLED,    QUICK_STOP]),
        (REACTION,   [REACTION,   REACTION,   REACTION,   REACTION,   REACTION,   REACTION]),
        (FAULT,      [FAULT,      FAULT,      FAULT,      FAULT,      FAULT,      DISABLED]),
    ];

    fn is_like(word: u16, pattern: &str) -> bool {
        pattern.bytes().rev().enumerate().all(|(bit, wanted)| match wanted {
            b'x' => true,
            digit => word >> bit & 1 == u16::from(digit - b'0'),
        })
    }

    fn in_state(state: State) -> Power {
        Power { state, ..Power::default() }
    }

    fn after_words(mut power: Power, words: &[u16], options: &Options) -> Power {
        words.iter().for_each(|word| power.on_controlword(Controlword(*word), options, true));
        power
    }

    #[test]
    fn controlwords_cause_the_transitions_of_cia_402() {
        for (state, ends) in TRANSITIONS {
            for word in 0..=0x0FFF_u16 {
                let command = COMMANDS.iter().position(|pattern| is_like(word, pattern));
                let end = ends[command.unwrap_or(5)];
                let after = after_words(in_state(state), &[word], &OPTIONS).state();
                assert_eq!(after, end, "{word:04X}h in {state}");
            }
        }
    }

    #[test]
    fn initialise_acts_in_not_ready_to_switch_on_only() {
        for (state, _) in TRANSITIONS {
            let mut power = in_state(state);
            power.initialise();
            assert_eq!(power.state(), if state == NOT_READY { DISABLED } else { state });
        }
    }

    #[test]
    fn fault_uses_its_ramp_in_states_with_torque_only() {
        for (state, _) in TRANSITIONS {
            for ramp in [None, Some(Ramp::SlowDown)] {
                let mut power = in_state(state);
                power.fail(ramp);
                let reacts = ramp.is_some() && matches!(state, ENABLED | QUICK_STOP | REACTION);
                assert_eq!(power.state(), if reacts { REACTION } else { FAULT }, "{state}");
            }
        }
    }

    #[test]
    fn fault_reaction_ignores_controlwords_and_ends_in_fault() {
        let mut power = in_state(ENABLED);
        power.fail(Some(Ramp::QuickStop));
        power = after_words(power, &[0x00, 0x80, 0x06, 0x07, 0x0F, 0x02], &RAMPS);
        assert_eq!((power.state(), power.ramp()), (REACTION, Some(Ramp::QuickStop)));
        power.on_stopped();
        assert_eq!((power.state(), power.ramp()), (FAULT, None));
    }

    #[test]
    fn leaving_operation_completes_at_standstill() {
        for (word, end) in [(0x06, READY), (0x07, ON)] {
            let mut power = after_words(in_state(ENABLED), &[word], &RAMPS);
            assert_eq!((power.state(), power.ramp()), (ENABLED, Some(Ramp::SlowDown)));
            assert_eq!(
                after_words(power, &[0x00], &RAMPS).state(),
                DISABLED,
                "disable voltage ends the ramp"
            );
            let resumed = after_words(power, &[0x0F], &RAMPS);
            assert_eq!((resumed.state(), resumed.ramp()), (ENABLED, None));
            power.on_stopped();
            assert_eq!((power.state(), power.ramp()), (end, None));
        }
    }

    #[test]
    fn quick_stop_end_state_follows_605ah() {
        for quick_stop in 0..=8 {
            let options = Options { quick_stop, ..OPTIONS };
            let mut power = after_words(in_state(ENABLED), &[0x02], &options);
            let has_ramp = quick_stop > 0;
            assert_eq!(power.state(), if has_ramp { QUICK_STOP } else { DISABLED });
            let stays = quick_stop >= 5;
            let back = after_words(power, &[0x0F], &options).state();
            let on_its_way = if has_ramp { QUICK_STOP } else { DISABLED };
            assert_eq!(back, if stays { ENABLED } else { on_its_way }, "605Ah = {quick_stop}");
            power.on_stopped();
            assert_eq!(power.state(), if stays { QUICK_STOP } else { DISABLED });
            power = after_words(power, &[0x0F], &options);
            assert_eq!(power.state(), if stays { ENABLED } else { DISABLED });
        }
    }

    #[test]
    fn enabling_passes_each_state_in_order() {
        let ways: [(&[u16], State); 6] = [
            (&[0x06], READY),
            (&[0x06, 0x07], ON),
            (&[0x06, 0x07, 0x0F], ENABLED),
            (&[0x06, 0x0F], ENABLED),
            (&[0x07], DISABLED),
            (&[0x0F], DISABLED),
        ];
        for (words, state) in ways {
            let after = after_words(in_state(DISABLED), words, &OPTIONS);
            assert_eq!(after.state(), state, "{words:02X?}");
        }
    }

    #[test]
    fn fault_reset_needs_a_rising_edge() {
        let mut power = after_words(in_state(DISABLED), &[0x06, 0x07, 0x80], &OPTIONS);
        power.fail(None);
        for word in [0x80, 0x8F, 0x80] {
            power = after_words(power, &[word], &OPTIONS);
            assert_eq!(power.state(), FAULT, "the bit was set all the time");
        }
        power = after_words(power, &[0x0F], &OPTIONS);
        assert_eq!(power.state(), FAULT, "no other command leaves Fault");
        power = after_words(power, &[0x80], &OPTIONS);
        assert_eq!(power.state(), DISABLED);
    }

    #[test]
    fn refused_fault_reset_needs_a_new_edge() {
        let mut power = in_state(FAULT);
        power.on_controlword(Controlword::FAULT_RESET, &OPTIONS, false);
        power.on_controlword(Controlword::FAULT_RESET, &OPTIONS, true);
        assert_eq!(power.state(), FAULT);
        assert_eq!(after_words(power, &[0x00, 0x80], &OPTIONS).state(), DISABLED);
    }

    #[test]
    fn master_power_stage_reaches_both_goals() {
        let (mut stage, mut power) = (PowerStage::default(), in_state(FAULT));
        stage.reset_fault();
        for (goal, end) in [
            (Goal::OperationEnabled, State::OperationEnabled),
            (Goal::VoltageDisabled, State::SwitchOnDisabled),
        ] {
            for _ in 0..6 {
                let word = stage.controlword(power.statusword().state(), goal);
                power.on_controlword(word, &OPTIONS, true);
            }
            assert_eq!(power.state(), end);
        }
    }

    proptest! {
        #[test]
        fn statusword_encodes_the_state(words in proptest::collection::vec(any::<u16>(), 0..50)) {
            let mut power = in_state(DISABLED);
            for word in words {
                power.on_controlword(Controlword(word), &RAMPS, true);
                prop_assert_eq!(power.statusword().state(), Some(power.state()));
                let must_stop = matches!(power.state(), QUICK_STOP | REACTION);
                prop_assert!(!must_stop || power.ramp().is_some(), "a state that waits for a stop has a ramp");
            }
        }
    }
}
