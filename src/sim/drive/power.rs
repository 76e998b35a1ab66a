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
//! business of [`stop`](super::stop) and [`motion`](crate::sim::motion).

use crate::canopen::drive::Controlword;
use crate::canopen::drive::State;
use crate::canopen::drive::Statusword;
use crate::sim::drive::options::Options;
use crate::sim::motion::Ramp;

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

    /// Whether bit 8 of the last controlword asks for a halt.
    pub(super) const fn is_halted(&self) -> bool {
        self.last.0 & HALT != 0
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
        match self.state {
            State::NotReadyToSwitchOn | State::FaultReactionActive | State::Fault => {}
            State::SwitchOnDisabled => {
                if command == Command::Shutdown {
                    self.enter(State::ReadyToSwitchOn);
                }
            }
            State::ReadyToSwitchOn | State::SwitchedOn => self.enter(match command {
                Command::DisableVoltage | Command::QuickStop => State::SwitchOnDisabled,
                Command::Shutdown => State::ReadyToSwitchOn,
                Command::SwitchOn => State::SwitchedOn,
                Command::EnableOperation => State::OperationEnabled,
            }),
            State::OperationEnabled => match command {
                Command::DisableVoltage => self.enter(State::SwitchOnDisabled),
                Command::QuickStop => self.quick_stop(options),
                Command::Shutdown => self.leave(options.shutdown_ramp(), State::ReadyToSwitchOn),
                Command::SwitchOn => {
                    self.leave(options.disable_operation_ramp(), State::SwitchedOn)
                }
                Command::EnableOperation => self.stop = None,
            },
            State::QuickStopActive => {
                let stays = self.stop.is_none_or(|stop| stop.end == State::QuickStopActive);
                match command {
                    Command::DisableVoltage => self.enter(State::SwitchOnDisabled),
                    Command::EnableOperation if stays => self.enter(State::OperationEnabled),
                    Command::QuickStop
                    | Command::Shutdown
                    | Command::SwitchOn
                    | Command::EnableOperation => {}
                }
            }
        }
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

/// Bit 8 of a controlword: stop, but stay enabled.
const HALT: u16 = 1 << 8;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::drive::Goal;
    use crate::canopen::drive::PowerStage;
    use proptest::prelude::*;

    const SLOW_DOWN_AND_DISABLE: i16 = 1;
    const SLOW_DOWN_AND_STAY: i16 = 5;

    fn after(words: &[u16]) -> Power {
        let mut power = Power::default();
        words.iter().for_each(|word| power.obey(Controlword(*word), SLOW_DOWN_AND_DISABLE));
        power
    }

    #[test]
    fn the_way_up_is_taken_step_by_step() {
        let ways: [(&[u16], State); 6] = [
            (&[0x06], State::ReadyToSwitchOn),
            (&[0x06, 0x07], State::SwitchedOn),
            (&[0x06, 0x07, 0x0F], State::OperationEnabled),
            (&[0x06, 0x0F], State::OperationEnabled),
            (&[0x07], State::SwitchOnDisabled),
            (&[0x0F], State::SwitchOnDisabled),
        ];
        for (words, state) in ways {
            assert_eq!(after(words).state(), state, "{words:02X?}");
        }
    }

    #[test]
    fn every_way_down_leaves_operation() {
        for (word, state) in [
            (0x07, State::SwitchedOn),
            (0x06, State::ReadyToSwitchOn),
            (0x00, State::SwitchOnDisabled),
            (0x02, State::SwitchOnDisabled),
        ] {
            assert_eq!(after(&[0x06, 0x07, 0x0F, word]).state(), state, "{word:02X}h");
        }
    }

    #[test]
    fn a_quick_stop_that_stays_is_left_by_enabling_or_by_disabling() {
        for (word, state) in [(0x0F, State::OperationEnabled), (0x00, State::SwitchOnDisabled)] {
            let mut power = after(&[0x06, 0x07, 0x0F]);
            power.obey(Controlword::QUICK_STOP, SLOW_DOWN_AND_STAY);
            assert_eq!(power.state(), State::QuickStopActive);
            power.obey(Controlword(word), SLOW_DOWN_AND_STAY);
            assert_eq!(power.state(), state);
        }
    }

    #[test]
    fn fault_reset_needs_an_edge() {
        let mut power = after(&[0x06, 0x07, 0x80]);
        power.fail();
        for word in [0x80, 0x8F, 0x80] {
            power.obey(Controlword(word), 0);
            assert_eq!(power.state(), State::Fault, "the bit was high all the time");
        }
        power.obey(Controlword(0x0F), 0);
        assert_eq!(power.state(), State::Fault, "nothing else leads out");
        power.obey(Controlword(0x80), 0);
        assert_eq!(power.state(), State::SwitchOnDisabled);
    }

    #[test]
    fn the_masters_power_stage_leads_it_anywhere() {
        let (mut stage, mut power) = (PowerStage::default(), Power::default());
        power.fail();
        stage.reset_fault();
        for (goal, end) in [
            (Goal::OperationEnabled, State::OperationEnabled),
            (Goal::VoltageDisabled, State::SwitchOnDisabled),
        ] {
            for _ in 0..6 {
                power.obey(stage.controlword(power.statusword().state(), goal), 0);
            }
            assert_eq!(power.state(), end);
        }
    }

    proptest! {
        #[test]
        fn the_statusword_always_tells_the_state(words in proptest::collection::vec(any::<u16>(), 0..50)) {
            let mut power = Power::default();
            for word in words {
                power.obey(Controlword(word), SLOW_DOWN_AND_STAY);
                prop_assert_eq!(power.statusword().state(), Some(power.state()));
            }
        }
    }
}
