//! Option codes 605Ah to 605Eh and 6007h: the reaction to stop commands, faults and connection loss (CiA 402-2, 8.3.1
//! to 8.3.6 and 7.3.1).
//!
//! Decoding only; the [modes](crate::motion) evaluate 605Dh (halt). Stops at the voltage limit are stops at the current
//! limit: this drive has no voltage limit.

use crate::motion::Ramp;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Option codes of one drive, with the values of their objects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Options {
    /// Abort connection option code, 6007h.
    pub(super) abort_connection: i16,
    /// Quick stop option code, 605Ah.
    pub(super) quick_stop: i16,
    /// Shutdown option code, 605Bh.
    pub(super) shutdown: i16,
    /// Disable operation option code, 605Ch.
    pub(super) disable_operation: i16,
    /// Fault reaction option code, 605Eh.
    pub(super) fault_reaction: i16,
}

/// Reaction to a connection loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Abort {
    /// No action.
    Nothing,
    /// Fault signal.
    Fault,
    /// Command disable voltage.
    DisableVoltage,
    /// Command quick stop.
    QuickStop,
}

impl Options {
    /// Reads the option codes from `dictionary`. An absent object counts as 0: immediate; without 6007h a connection
    /// loss is a fault.
    pub(super) fn from_dictionary(dictionary: &Dictionary) -> Self {
        let has_abort = dictionary.entry(Object::ABORT_CONNECTION).is_some();
        Self {
            abort_connection: if has_abort { dictionary.i16(Object::ABORT_CONNECTION) } else { 1 },
            quick_stop: dictionary.i16(Object::QUICK_STOP_OPTION),
            shutdown: dictionary.i16(Object::SHUTDOWN_OPTION),
            disable_operation: dictionary.i16(Object::DISABLE_OPERATION_OPTION),
            fault_reaction: dictionary.i16(Object::FAULT_REACTION),
        }
    }

    /// Returns whether `bytes` is a valid value of `object`; true for objects that are not option codes.
    pub(super) fn accepts(object: Object, bytes: &[u8]) -> bool {
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

    /// Returns the reaction to a connection loss (6007h).
    pub(super) const fn on_connection_loss(&self) -> Abort {
        match self.abort_connection {
            1 => Abort::Fault,
            2 => Abort::DisableVoltage,
            3 => Abort::QuickStop,
            _ => Abort::Nothing,
        }
    }

    /// Returns the ramp of a quick stop (605Ah); `None` if it disables the drive at once.
    pub(super) const fn quick_stop_ramp(&self) -> Option<Ramp> {
        match self.quick_stop {
            1 | 5 => Some(Ramp::SlowDown),
            2 | 6 => Some(Ramp::QuickStop),
            3 | 4 | 7 | 8 => Some(Ramp::CurrentLimit),
            _ => None,
        }
    }

    /// Returns whether a quick stop ends in quick stop active (605Ah).
    pub(super) const fn stays_in_quick_stop(&self) -> bool {
        matches!(self.quick_stop, 5..=8)
    }

    /// Returns the ramp from operation enabled to ready to switch on (605Bh); `None` if immediate.
    pub(super) fn shutdown_ramp(&self) -> Option<Ramp> {
        (self.shutdown == 1).then_some(Ramp::SlowDown)
    }

    /// Returns the ramp from operation enabled to switched on (605Ch); `None` if immediate.
    pub(super) fn disable_operation_ramp(&self) -> Option<Ramp> {
        (self.disable_operation == 1).then_some(Ramp::SlowDown)
    }

    /// Returns the ramp of the fault reaction (605Eh); `None` if it disables the drive at once.
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
    use canopen::NodeId;
    use canopen::eds::Eds;

    #[test]
    fn drive_without_option_codes_faults_and_disables_at_once() {
        let eds = Eds::parse(include_bytes!("../../../../eds/drives/schunk-lwa4p.eds")).unwrap();
        let options = Options::from_dictionary(&Dictionary::new(&eds, NodeId::new(1).unwrap()));
        assert_eq!(options.on_connection_loss(), Abort::Fault);
        assert_eq!((options.fault_ramp(), options.shutdown_ramp()), (None, None));
    }

    #[test]
    fn accepted_codes_are_those_of_cia_402() {
        for (object, low, high) in [
            (Object::ABORT_CONNECTION, 0, 3),
            (Object::QUICK_STOP_OPTION, 0, 8),
            (Object::SHUTDOWN_OPTION, 0, 1),
            (Object::DISABLE_OPERATION_OPTION, 0, 1),
            (Object::HALT_OPTION, 1, 4),
            (Object::FAULT_REACTION, 0, 4),
        ] {
            for code in -10..20_i16 {
                let taken = Options::accepts(object, &code.to_le_bytes());
                assert_eq!(taken, (low..=high).contains(&code), "{object} = {code}");
            }
        }
        assert!(Options::accepts(Object::TARGET_TORQUE, &[0xFF, 0xFF]));
    }

    #[test]
    fn codes_have_the_ramps_of_cia_402() {
        use Ramp::{CurrentLimit, QuickStop, SlowDown};
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
