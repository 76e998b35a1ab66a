//! The power state machine of a drive, seen from inside (CiA 402-2, 6.1): controlword in, statusword out.
//!
//! Only the states. What a stop means to the torque is the [drive](crate::sim::drive)'s business: here
//! a stop is over as soon as it has begun, since in cyclic torque mode no ramp applies.

use crate::canopen::drive::Controlword;
use crate::canopen::drive::State;
use crate::canopen::drive::Statusword;

/// The power stage of one drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    state: State,
    last: Controlword,
}

impl Default for Power {
    /// As after power-up: no voltage.
    fn default() -> Self {
        Self { state: State::SwitchOnDisabled, last: Controlword::default() }
    }
}

/// What a controlword asks for (CiA 402-2, table 29), a fault reset apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Command {
    DisableVoltage,
    QuickStop,
    Shutdown,
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

    /// Whether bit 8 of the last controlword asks for a halt.
    pub(super) const fn is_halted(&self) -> bool {
        self.last.0 & HALT != 0
    }

    /// Follows a controlword; a quick stop does as `quick_stop_option` (605Ah) says.
    ///
    /// A fault is reset by the *rising edge* of bit 7, so a bit that is held resets nothing more.
    pub(super) const fn obey(&mut self, word: Controlword, quick_stop_option: i16) {
        let reset = Controlword::FAULT_RESET.0;
        let has_risen = word.0 & reset != 0 && self.last.0 & reset == 0;
        self.last = word;
        if matches!(self.state, State::Fault) {
            if has_risen {
                self.state = State::SwitchOnDisabled;
            }
            return;
        }
        let Some(command) = Command::of(word) else { return };
        self.state = match (self.state, command) {
            (State::ReadyToSwitchOn | State::SwitchedOn, Command::QuickStop)
            | (_, Command::DisableVoltage) => State::SwitchOnDisabled,
            (State::OperationEnabled, Command::QuickStop) => quick_stop(quick_stop_option),
            (
                State::SwitchOnDisabled | State::SwitchedOn | State::OperationEnabled,
                Command::Shutdown,
            ) => State::ReadyToSwitchOn,
            (State::ReadyToSwitchOn | State::OperationEnabled, Command::SwitchOn) => {
                State::SwitchedOn
            }
            (
                State::ReadyToSwitchOn | State::SwitchedOn | State::QuickStopActive,
                Command::EnableOperation,
            ) => State::OperationEnabled,
            (state, _) => state,
        };
    }

    /// A fault, and what 605Eh wants done about it, which is done at once.
    pub(super) const fn fail(&mut self) {
        self.state = State::Fault;
    }

    /// As a controlword that disables the voltage would; a fault stays one.
    pub(super) const fn disable_voltage(&mut self) {
        if !matches!(self.state, State::Fault) {
            self.state = State::SwitchOnDisabled;
        }
    }

    /// As a controlword that asks for a quick stop would.
    pub(super) const fn quick_stop(&mut self, option: i16) {
        self.state = match self.state {
            State::OperationEnabled => quick_stop(option),
            State::ReadyToSwitchOn | State::SwitchedOn => State::SwitchOnDisabled,
            State::NotReadyToSwitchOn
            | State::SwitchOnDisabled
            | State::QuickStopActive
            | State::FaultReactionActive
            | State::Fault => self.state,
        };
    }

    /// The statusword, without what is not of the power stage. The mains are always on (bit 4).
    pub(super) const fn statusword(&self) -> Statusword {
        let state = match self.state {
            State::NotReadyToSwitchOn => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReactionActive => 0x0F,
            State::Fault => 0x08,
        };
        Statusword(state | Statusword::VOLTAGE_ENABLED)
    }
}

/// Where a quick stop ends (605Ah): 5 to 8 stay in it, all others end without voltage.
const fn quick_stop(option: i16) -> State {
    match option {
        5..=8 => State::QuickStopActive,
        _ => State::SwitchOnDisabled,
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
