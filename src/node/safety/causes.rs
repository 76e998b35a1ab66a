//! Mapping of network events, bus errors and invalid values to causes.

use crate::cause::Cause;
use bus::BusError;
use canopen::NmtState;
use canopen::frame::Channel;
use canopen::master::event::Event;
use canopen::master::read_back::ReadBack;
use controller::InvalidValue;

/// Returns the cause of a network event, if the event is a fault.
pub const fn of_event(event: &Event) -> Option<Cause> {
    match event {
        Event::Emergency { node, emergency } if !emergency.is_reset() => {
            Some(Cause::Emergency { node: *node, code: emergency.code })
        }
        Event::HeartbeatLost { node } => Some(Cause::HeartbeatLost { node: *node }),
        Event::Rebooted { node } => Some(Cause::Rebooted { node: *node }),
        Event::Duplicate { node, .. } => Some(Cause::Duplicate { node: *node }),
        Event::StateChanged { state: NmtState::Operational, .. } => None,
        Event::StateChanged { node, state } => {
            Some(Cause::LeftOperational { node: *node, state: *state })
        }
        Event::ReadBack { node, object, read: ReadBack::Changed { expected, found } } => {
            let (node, object, expected, found) = (*node, *object, *expected, *found);
            Some(Cause::SettingChanged { node, object, expected, found })
        }
        Event::ForeignMaster { .. } => Some(Cause::ForeignMaster),
        Event::Emergency { .. }
        | Event::EmergencyWarning { .. }
        | Event::LimitsRaised { .. }
        | Event::HomingPrepared { .. }
        | Event::HomingLeft { .. }
        | Event::TorqueLimited { .. }
        | Event::Tested { .. }
        | Event::Booted
        | Event::BootFailed(_)
        | Event::FoundEnabled { .. }
        | Event::Configured { .. }
        | Event::ValueRefused { .. }
        | Event::Absent { .. }
        | Event::Joined { .. }
        | Event::ErrorHistory { .. }
        | Event::Statusword { .. }
        | Event::MonitoringEnded { .. }
        | Event::MonitoringKept { .. }
        | Event::ReadByAnother { .. }
        | Event::ReadBack {
            read: ReadBack::Unchanged | ReadBack::Value(_) | ReadBack::Unread(_),
            ..
        }
        | Event::StillOn { .. }
        | Event::PowerOffConfirmed { .. }
        | Event::UnknownNode { .. } => None,
    }
}

/// Returns the cause of a bus error. A receive overrun has none: the frames it loses show as missing samples.
pub const fn of_bus(Channel(channel): Channel, error: BusError) -> Option<Cause> {
    match error {
        BusError::Warning | BusError::Overrun => None,
        BusError::Passive => Some(Cause::BusPassive { channel }),
        BusError::Off => Some(Cause::BusOff { channel }),
        BusError::Down => Some(Cause::BusDown { channel }),
    }
}

/// Returns the cause of an invalid value. A hand turned too far has none: the controller holds the command.
pub const fn of_controller(invalid: &InvalidValue) -> Option<Cause> {
    match invalid {
        InvalidValue::TurnedTooFar => None,
        InvalidValue::TorqueNotFinite
        | InvalidValue::WrenchNotFinite
        | InvalidValue::WrenchTooLarge
        | InvalidValue::ObjectPoseNotFinite
        | InvalidValue::ShareOutOfRange => Some(Cause::ControllerFault { invalid: *invalid }),
    }
}
