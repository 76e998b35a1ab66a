//! The power state machine of a drive, seen from inside (CiA 402-2, 6.1): controlword in, statusword out.
//!
//! ```text
//!  start ─0→ not ready ─1→ switch on ─2→ ready to ─3→ switched ─4→ operation ─11→ quick stop
//!                           disabled ←7─ switch on ←6─   on     ←5─  enabled  ←16─   active
//!                            ↑ 9, 10, 12                    8: from operation enabled
//!                            └──15── fault ←14─ fault reaction active ←13─ any state
//! ```
//!
//! Only the states, and which stop must be over before the next one. How a motor is stopped is the
//! business of [`stop`](super::stop) and [`motion`](crate::motion).

use crate::drive::options::Options;
use crate::motion::Ramp;
use canopen::drive::Controlword;
use canopen::drive::State;
use canopen::drive::Statusword;

/// The power stage of one drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    state: State,
    last: Controlword,
    stop: Option<Stop>,
}

/// A stop that has to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stop {
    ramp: Ramp,
    /// The state it leads to.
    end: State,
}

impl Default for Power {
    /// As after power-up (transition 0).
    fn default() -> Self {
        Self { state: State::NotReadyToSwitchOn, last: Controlword::default(), stop: None }
    }
}

/// What a controlword asks for (CiA 402-2, table 29), a fault reset apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    DisableVoltage,
    QuickStop,
    Shutdown,
    /// In operation the same bits disable the operation.
    SwitchOn,
    EnableOperation,
}

impl Command {
    /// What it asks for; `None` if bit 7 claims it for a fault reset.
    const fn of(word: Controlword) -> Option<Self> {
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
    /// The state it is in.
    pub(super) const fn state(&self) -> State {
        self.state
    }

    /// Whether the power stage may give torque.
    pub(super) const fn may_push(&self) -> bool {
        matches!(
            self.state,
            State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
        )
    }

    /// The stop that has to be made now.
    pub(super) fn ramp(&self) -> Option<Ramp> {
        self.stop.map(|stop| stop.ramp)
    }

    /// The last controlword.
    pub(super) const fn controlword(&self) -> Controlword {
        self.last
    }

    /// The drive has tested itself (transition 1).
    pub(super) const fn initialise(&mut self) {
        if matches!(self.state, State::NotReadyToSwitchOn) {
            self.enter(State::SwitchOnDisabled);
        }
    }

    /// Follows a controlword; stops are made as `options` say.
    ///
    /// A fault is reset by the *rising edge* of bit 7, so a bit that is held resets nothing more; and
    /// only if it `may_reset`, its cause being gone.
    pub(super) fn obey(&mut self, word: Controlword, options: &Options, may_reset: bool) {
        let reset = Controlword::FAULT_RESET.0;
        let has_risen = word.0 & reset != 0 && self.last.0 & reset == 0;
        self.last = word;
        if self.state == State::Fault {
            if has_risen && may_reset {
                self.enter(State::SwitchOnDisabled);
            }
        } else if let Some(command) = Command::of(word) {
            self.follow(command, options);
        }
    }

    fn follow(&mut self, command: Command, options: &Options) {
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
            (State::QuickStopActive, Command::EnableOperation) if self.stays() => {
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

    /// Whether a quick stop leads nowhere by itself.
    fn stays(&self) -> bool {
        self.stop.is_none_or(|stop| stop.end == State::QuickStopActive)
    }

    /// A fault, which ends on `ramp` if there is torque to be taken off, and else at once
    /// (transitions 13 and 14).
    pub(super) fn fail(&mut self, ramp: Option<Ramp>) {
        match ramp {
            Some(_) if self.state == State::FaultReactionActive => {}
            Some(ramp) if self.may_push() => {
                self.state = State::FaultReactionActive;
                self.stop = Some(Stop { ramp, end: State::Fault });
            }
            Some(_) | None => self.enter(State::Fault),
        }
    }

    /// As a controlword that disables the voltage would; a fault stays one.
    pub(super) fn disable_voltage(&mut self) {
        self.follow(Command::DisableVoltage, &Options::default());
    }

    /// As a controlword that asks for a quick stop would.
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

    /// The stop is over: the motor stands still, or has had its time.
    pub(super) fn on_stopped(&mut self) {
        if let Some(stop) = self.stop {
            self.enter(stop.end);
        }
    }

    /// Leaves operation on `ramp`, enabled until it stands still, or at once.
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

    /// The bits of the statusword that tell the state.
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
    use canopen::drive::Goal;
    use canopen::drive::PowerStage;

    /// Every stop at once, but for a quick stop, which is a ramp that stays.
    const OPTIONS: Options = Options {
        abort_connection: 0,
        quick_stop: 6,
        shutdown: 0,
        disable_operation: 0,
        fault_reaction: 0,
    };
    /// Every stop on a ramp; a quick stop does not stay.
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

    /// Bits 7 to 0 of the commands, "x" for any (CiA 402-2, command coding).
    const COMMANDS: [&str; 5] = [
        "0xxxxx0x", // disable voltage
        "0xxxx01x", // quick stop
        "0xxxx110", // shutdown
        "0xxx0111", // switch on; disable operation
        "0xxx1111", // enable operation
    ];

    /// The state after each of those commands, and after the rising edge of bit 7 (CiA 402-2, transitions;
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

    fn being(state: State) -> Power {
        Power { state, ..Power::default() }
    }

    fn obeying(mut power: Power, words: &[u16], options: &Options) -> Power {
        words.iter().for_each(|word| power.obey(Controlword(*word), options, true));
        power
    }

    #[test]
    fn every_controlword_in_every_state_does_what_the_standard_says() {
        for (state, ends) in TRANSITIONS {
            for word in 0..=0x0FFF_u16 {
                let command = COMMANDS.iter().position(|pattern| is_like(word, pattern));
                let end = ends[command.unwrap_or(5)];
                let after = obeying(being(state), &[word], &OPTIONS).state();
                assert_eq!(after, end, "{word:04X}h in {state}");
            }
        }
    }

    #[test]
    fn a_self_test_ends_in_switch_on_disabled_and_ends_nothing_else() {
        for (state, _) in TRANSITIONS {
            let mut power = being(state);
            power.initialise();
            assert_eq!(power.state(), if state == NOT_READY { DISABLED } else { state });
        }
    }

    #[test]
    fn a_fault_is_taken_from_every_state_and_its_ramp_where_there_is_torque() {
        for (state, _) in TRANSITIONS {
            for ramp in [None, Some(Ramp::SlowDown)] {
                let mut power = being(state);
                power.fail(ramp);
                let reacts = ramp.is_some() && matches!(state, ENABLED | QUICK_STOP | REACTION);
                assert_eq!(power.state(), if reacts { REACTION } else { FAULT }, "{state}");
            }
        }
    }

    #[test]
    fn a_fault_reaction_ends_in_fault_and_no_controlword_ends_it_sooner() {
        let mut power = being(ENABLED);
        power.fail(Some(Ramp::QuickStop));
        power = obeying(power, &[0x00, 0x80, 0x06, 0x07, 0x0F, 0x02], &RAMPS);
        assert_eq!((power.state(), power.ramp()), (REACTION, Some(Ramp::QuickStop)));
        power.on_stopped();
        assert_eq!((power.state(), power.ramp()), (FAULT, None));
    }

    #[test]
    fn operation_is_left_for_good_only_at_a_standstill() {
        for (word, end) in [(0x06, READY), (0x07, ON)] {
            let mut power = obeying(being(ENABLED), &[word], &RAMPS);
            assert_eq!((power.state(), power.ramp()), (ENABLED, Some(Ramp::SlowDown)));
            assert_eq!(obeying(power, &[0x00], &RAMPS).state(), DISABLED, "the ramp is cut short");
            let resumed = obeying(power, &[0x0F], &RAMPS);
            assert_eq!((resumed.state(), resumed.ramp()), (ENABLED, None));
            power.on_stopped();
            assert_eq!((power.state(), power.ramp()), (end, None));
        }
    }

    #[test]
    fn a_quick_stop_stays_as_605ah_says_and_only_then_leads_back() {
        for quick_stop in 0..=8 {
            let options = Options { quick_stop, ..OPTIONS };
            let mut power = obeying(being(ENABLED), &[0x02], &options);
            let has_ramp = quick_stop > 0;
            assert_eq!(power.state(), if has_ramp { QUICK_STOP } else { DISABLED });
            let stays = quick_stop >= 5;
            let back = obeying(power, &[0x0F], &options).state();
            let on_its_way = if has_ramp { QUICK_STOP } else { DISABLED };
            assert_eq!(back, if stays { ENABLED } else { on_its_way }, "605Ah = {quick_stop}");
            power.on_stopped();
            assert_eq!(power.state(), if stays { QUICK_STOP } else { DISABLED });
            power = obeying(power, &[0x0F], &options);
            assert_eq!(power.state(), if stays { ENABLED } else { DISABLED });
        }
    }

    #[test]
    fn the_way_up_is_taken_step_by_step() {
        let ways: [(&[u16], State); 6] = [
            (&[0x06], READY),
            (&[0x06, 0x07], ON),
            (&[0x06, 0x07, 0x0F], ENABLED),
            (&[0x06, 0x0F], ENABLED),
            (&[0x07], DISABLED),
            (&[0x0F], DISABLED),
        ];
        for (words, state) in ways {
            let after = obeying(being(DISABLED), words, &OPTIONS);
            assert_eq!(after.state(), state, "{words:02X?}");
        }
    }

    #[test]
    fn fault_reset_needs_an_edge() {
        let mut power = obeying(being(DISABLED), &[0x06, 0x07, 0x80], &OPTIONS);
        power.fail(None);
        for word in [0x80, 0x8F, 0x80] {
            power = obeying(power, &[word], &OPTIONS);
            assert_eq!(power.state(), FAULT, "the bit was high all the time");
        }
        power = obeying(power, &[0x0F], &OPTIONS);
        assert_eq!(power.state(), FAULT, "nothing else leads out");
        power = obeying(power, &[0x80], &OPTIONS);
        assert_eq!(power.state(), DISABLED);
    }

    #[test]
    fn an_edge_that_is_refused_is_used_up() {
        let mut power = being(FAULT);
        power.obey(Controlword::FAULT_RESET, &OPTIONS, false);
        power.obey(Controlword::FAULT_RESET, &OPTIONS, true);
        assert_eq!(power.state(), FAULT);
        assert_eq!(obeying(power, &[0x00, 0x80], &OPTIONS).state(), DISABLED);
    }

    #[test]
    fn the_masters_power_stage_leads_it_anywhere() {
        let (mut stage, mut power) = (PowerStage::default(), being(FAULT));
        stage.reset_fault();
        for (goal, end) in [
            (Goal::OperationEnabled, State::OperationEnabled),
            (Goal::VoltageDisabled, State::SwitchOnDisabled),
        ] {
            for _ in 0..6 {
                let word = stage.controlword(power.statusword().state(), goal);
                power.obey(word, &OPTIONS, true);
            }
            assert_eq!(power.state(), end);
        }
    }

    proptest! {
        #[test]
        fn the_statusword_always_tells_the_state(words in proptest::collection::vec(any::<u16>(), 0..50)) {
            let mut power = being(DISABLED);
            for word in words {
                power.obey(Controlword(word), &RAMPS, true);
                prop_assert_eq!(power.statusword().state(), Some(power.state()));
                let must_stop = matches!(power.state(), QUICK_STOP | REACTION);
                prop_assert!(!must_stop || power.ramp().is_some(), "a stop nobody makes never ends");
            }
        }
    }
}
