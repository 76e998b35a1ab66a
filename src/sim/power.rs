//! The power state machine inside a drive (CiA 402-2, 6.1): controlword in, statusword out.
//!
//! Written from the drive's side of the standard; the master's side is `canopen::drive`.

use crate::canopen::drive::State;

/// What a drive does with its power stage when something ends its operation (605Ah to 605Eh). Torque
/// drives have no ramp: every option but "stay" takes the torque off at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// To `Switch on disabled`.
    Disable,
    /// To `Quick stop active`, without torque.
    Stay,
}

/// The power stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    state: State,
    before: u16,
}

impl Power {
    /// As after power-up, when the drive has tested itself.
    pub(super) const fn new() -> Self {
        Self { state: State::SwitchOnDisabled, before: 0 }
    }

    /// The state.
    pub(super) const fn state(&self) -> State {
        self.state
    }

    /// Whether a target torque acts.
    pub(super) fn is_enabled(&self) -> bool {
        self.state == State::OperationEnabled
    }

    /// Takes a controlword (6040h). `quick_stop` is what 605Ah asks for.
    pub(super) fn command(&mut self, controlword: u16, quick_stop: Stop) {
        let rose = controlword & !self.before;
        self.before = controlword;
        let has = |bits: u16| controlword & bits == bits;
        let (switch_on, voltage, no_quick_stop, enable) = (has(1), has(2), has(4), has(8));
        self.state = match self.state {
            State::Fault if rose & 0x80 != 0 => State::SwitchOnDisabled,
            State::Fault => State::Fault,
            State::FaultReactionActive => State::Fault,
            State::NotReadyToSwitchOn => State::SwitchOnDisabled,
            _ if !voltage => State::SwitchOnDisabled,
            State::OperationEnabled if !no_quick_stop => match quick_stop {
                Stop::Disable => State::SwitchOnDisabled,
                Stop::Stay => State::QuickStopActive,
            },
            State::QuickStopActive => State::QuickStopActive,
            _ if !no_quick_stop => State::SwitchOnDisabled,
            State::SwitchOnDisabled if !switch_on => State::ReadyToSwitchOn,
            State::SwitchOnDisabled => State::SwitchOnDisabled,
            _ if !switch_on => State::ReadyToSwitchOn,
            State::ReadyToSwitchOn if enable => State::OperationEnabled,
            State::SwitchedOn if enable => State::OperationEnabled,
            State::OperationEnabled if enable => State::OperationEnabled,
            State::ReadyToSwitchOn | State::SwitchedOn | State::OperationEnabled => {
                State::SwitchedOn
            }
        };
    }

    /// A fault: torque off at once, until it is reset.
    pub(super) fn fail(&mut self) {
        self.state = State::Fault;
    }

    /// Voltage off, as by a controlword.
    pub(super) fn disable_voltage(&mut self) {
        if self.state != State::Fault {
            self.state = State::SwitchOnDisabled;
        }
    }

    /// Stops as by a quick stop, if it is in operation.
    pub(super) fn quick_stop(&mut self, stop: Stop) {
        if self.is_enabled() {
            self.state = match stop {
                Stop::Disable => State::SwitchOnDisabled,
                Stop::Stay => State::QuickStopActive,
            };
        }
    }

    /// The statusword (6041h): the state, voltage present, remote.
    pub(super) const fn statusword(&self) -> u16 {
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
        let voltage_and_remote = 0x0210;
        state | voltage_and_remote
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn led(words: &[u16]) -> Power {
        let mut power = Power::new();
        words.iter().for_each(|word| power.command(*word, Stop::Disable));
        power
    }

    #[test]
    fn three_words_lead_to_operation() {
        assert_eq!(led(&[6, 7, 15]).state(), State::OperationEnabled);
        assert_eq!(led(&[6]).state(), State::ReadyToSwitchOn);
        assert_eq!(led(&[15]).state(), State::SwitchOnDisabled, "no state is skipped from here");
    }

    #[test]
    fn no_voltage_ends_every_state_but_a_fault() {
        for words in [&[6][..], &[6, 7], &[6, 7, 15]] {
            let mut power = led(words);
            power.command(0, Stop::Disable);
            assert_eq!(power.state(), State::SwitchOnDisabled);
        }
        let mut power = led(&[6, 7, 15]);
        power.fail();
        power.command(0, Stop::Disable);
        assert_eq!(power.state(), State::Fault);
    }

    #[test]
    fn a_fault_reset_needs_an_edge() {
        let mut power = led(&[6, 7, 0x8F]);
        power.fail();
        power.command(0x80, Stop::Disable);
        assert_eq!(power.state(), State::Fault, "bit 7 was high before");
        power.command(0x00, Stop::Disable);
        power.command(0x80, Stop::Disable);
        assert_eq!(power.state(), State::SwitchOnDisabled);
    }
}
