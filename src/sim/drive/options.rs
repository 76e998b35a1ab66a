//! What a drive does when it is to stop: the option codes 605Ah to 605Eh, and 6007h for a lost master
//! (CiA 402-2, 8.3.1 to 8.3.6 and 7.3.1).
//!
//! Only what the codes mean; what 605Dh means to a halt is the [mode's](crate::motion) business. A voltage limit is taken for a current limit: this drive knows no other.

use crate::motion::Ramp;
use canopen::dictionary::Dictionary;
use canopen::object::Object;

/// The option codes of one drive; each is what its object holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Options {
    /// 6007h.
    pub(super) abort_connection: i16,
    /// 605Ah.
    pub(super) quick_stop: i16,
    /// 605Bh.
    pub(super) shutdown: i16,
    /// 605Ch.
    pub(super) disable_operation: i16,
    /// 605Eh.
    pub(super) fault_reaction: i16,
}

/// What a drive does without its master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Abort {
    /// It goes on.
    Nothing,
    /// As for a fault.
    Fault,
    /// As a controlword that disables the voltage.
    DisableVoltage,
    /// As a controlword that asks for a quick stop.
    QuickStop,
}

impl Options {
    /// What they are in `dictionary`. An object that is not there is 0: everything at once.
    pub(super) fn of(dictionary: &Dictionary) -> Self {
        Self {
            abort_connection: dictionary.i16(Object::ABORT_CONNECTION),
            quick_stop: dictionary.i16(Object::QUICK_STOP_OPTION),
            shutdown: dictionary.i16(Object::SHUTDOWN_OPTION),
            disable_operation: dictionary.i16(Object::DISABLE_OPERATION_OPTION),
            fault_reaction: dictionary.i16(Object::FAULT_REACTION),
        }
    }

    /// Whether a master may give `object` the value `bytes`; true for what is no option code.
    pub(super) fn may_be(object: Object, bytes: &[u8]) -> bool {
        let codes = match object {
            Object::ABORT_CONNECTION => 0..=3,
            Object::QUICK_STOP_OPTION => 0..=8,
            Object::SHUTDOWN_OPTION | Object::DISABLE_OPERATION_OPTION => 0..=1,
            Object::HALT_OPTION => 1..=4,
            Object::FAULT_REACTION => 0..=4,
            _ => return true,
        };
        bytes.try_into().is_ok_and(|bytes| codes.contains(&i16::from_le_bytes(bytes)))
    }

    /// What is done without a master (6007h).
    pub(super) const fn on_lost_master(&self) -> Abort {
        match self.abort_connection {
            1 => Abort::Fault,
            2 => Abort::DisableVoltage,
            3 => Abort::QuickStop,
            _ => Abort::Nothing,
        }
    }

    /// How a quick stop is made (605Ah); `None` without any, by taking off the torque.
    pub(super) const fn quick_stop_ramp(&self) -> Option<Ramp> {
        match self.quick_stop {
            1 | 5 => Some(Ramp::SlowDown),
            2 | 6 => Some(Ramp::QuickStop),
            3 | 4 | 7 | 8 => Some(Ramp::CurrentLimit),
            _ => None,
        }
    }

    /// Whether a drive stays in quick stop active once it stands still (605Ah).
    pub(super) const fn stays_in_quick_stop(&self) -> bool {
        matches!(self.quick_stop, 5..=8)
    }

    /// How operation is left for ready to switch on (605Bh); `None` at once.
    pub(super) fn shutdown_ramp(&self) -> Option<Ramp> {
        (self.shutdown == 1).then_some(Ramp::SlowDown)
    }

    /// How operation is left for switched on (605Ch); `None` at once.
    pub(super) fn disable_operation_ramp(&self) -> Option<Ramp> {
        (self.disable_operation == 1).then_some(Ramp::SlowDown)
    }

    /// How a drive stops for a fault (605Eh); `None` without any, by taking off the torque.
    pub(super) const fn fault_ramp(&self) -> Option<Ramp> {
        match self.fault_reaction {
            1 => Some(Ramp::SlowDown),
            2 => Some(Ramp::QuickStop),
            3 | 4 => Some(Ramp::CurrentLimit),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_those_of_the_standard_and_no_others() {
        for (object, low, high) in [
            (Object::ABORT_CONNECTION, 0, 3),
            (Object::QUICK_STOP_OPTION, 0, 8),
            (Object::SHUTDOWN_OPTION, 0, 1),
            (Object::DISABLE_OPERATION_OPTION, 0, 1),
            (Object::HALT_OPTION, 1, 4),
            (Object::FAULT_REACTION, 0, 4),
        ] {
            for code in -10..20_i16 {
                let taken = Options::may_be(object, &code.to_le_bytes());
                assert_eq!(taken, (low..=high).contains(&code), "{object} = {code}");
            }
        }
        assert!(Options::may_be(Object::TARGET_TORQUE, &[0xFF, 0xFF]));
    }

    #[test]
    fn every_code_has_the_ramp_the_standard_gives_it() {
        use Ramp::CurrentLimit;
        use Ramp::QuickStop;
        use Ramp::SlowDown;
        let none = None;
        let quick_stops = [
            none,
            Some(SlowDown),
            Some(QuickStop),
            Some(CurrentLimit),
            Some(CurrentLimit),
            Some(SlowDown),
            Some(QuickStop),
            Some(CurrentLimit),
            Some(CurrentLimit),
        ];
        for (quick_stop, ramp) in (0..).zip(quick_stops) {
            let options = Options { quick_stop, ..Options::default() };
            assert_eq!(options.quick_stop_ramp(), ramp, "605Ah = {quick_stop}");
            assert_eq!(options.stays_in_quick_stop(), quick_stop >= 5, "605Ah = {quick_stop}");
        }
        for (code, ramp) in (0..).zip(&quick_stops[..5]) {
            let options = Options { fault_reaction: code, ..Options::default() };
            assert_eq!(options.fault_ramp(), *ramp, "605Eh = {code}");
        }
    }
}
