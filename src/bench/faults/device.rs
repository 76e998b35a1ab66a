//! Faults of devices: connection, device itself, sensors, contacts of switches.

use std::fmt;

/// A device without its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disconnection {
    /// The connector with bus and supply is unplugged. The device boots when it is plugged in again.
    Unplugged,
    /// The bus is cut before the device: it and all behind it on the same bus are disconnected.
    WireCut,
    /// The device's CAN controller is bus-off. It reports its recovery by an emergency message (8140h).
    BusOff,
}

/// A fault of a device itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceFault {
    /// The device reboots by itself.
    Reboot,
    /// The device sends an emergency message and goes on.
    Emergency {
        /// The error code.
        code: u16,
        /// The error register (1001h).
        register: u8,
    },
    /// The drive enters the state Fault (CiA 402) and sends this error code; 0 for no emergency message.
    DriveFault(u16),
    /// Safe torque off is requested at the drive's input.
    SafeTorqueOff,
    /// The drive accepts its controlword (6040h), by PDO and by SDO, without an effect.
    ControlwordIgnored,
    /// The torque offset (60B2h) is written at the drive's service port, unseen by the bus, in ‰ of rated torque.
    TorqueOffset(i16),
}

/// A wrong measurement of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorFault {
    /// The position is off by this much, in rad (m) of the joint.
    PositionOffset(f64),
    /// The position does not change.
    PositionFrozen,
    /// The torque is multiplied by this factor.
    TorqueScaled(f64),
}

/// A fault of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactFault {
    /// The input is always high.
    StuckHigh,
    /// The input is always low.
    StuckLow,
    /// The input is inverted at random.
    Bouncing,
}

/// An input of the switch box. Its bits are stated here apart from those the node reads, so that a mistake in one
/// does not cancel itself out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// High while the deadman is closed.
    DeadmanA,
    /// Low while the deadman is closed.
    DeadmanB,
    /// High while the reference button is pressed.
    Reference,
    /// High while the reflection button is pressed.
    Reflection,
}

impl DeviceFault {
    /// Returns whether it is over as soon as it has happened.
    pub const fn is_momentary(self) -> bool {
        match self {
            Self::Reboot | Self::Emergency { .. } | Self::DriveFault(_) | Self::TorqueOffset(_) => {
                true
            }
            Self::SafeTorqueOff | Self::ControlwordIgnored => false,
        }
    }
}

impl Input {
    /// All inputs with their words in a scenario.
    pub const ALL: [(&'static str, Self); 4] = [
        ("deadman_a", Self::DeadmanA),
        ("deadman_b", Self::DeadmanB),
        ("reference", Self::Reference),
        ("reflection", Self::Reflection),
    ];

    /// Returns its bit among the inputs.
    pub const fn bit(self) -> u8 {
        match self {
            Self::DeadmanA => 1,
            Self::DeadmanB => 1 << 1,
            Self::Reference => 1 << 2,
            Self::Reflection => 1 << 3,
        }
    }
}

impl fmt::Display for Disconnection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unplugged => "unplugged",
            Self::WireCut => "wire cut before it",
            Self::BusOff => "bus-off",
        })
    }
}

impl fmt::Display for DeviceFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reboot => f.write_str("reboots by itself"),
            Self::Emergency { code, .. } => write!(f, "emergency {code:04X}h"),
            Self::DriveFault(code) => write!(f, "fault {code:04X}h"),
            Self::SafeTorqueOff => f.write_str("safe torque off"),
            Self::ControlwordIgnored => f.write_str("controlword ignored"),
            Self::TorqueOffset(per_mille) => write!(f, "torque offset of {per_mille} ‰"),
        }
    }
}

impl fmt::Display for SensorFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PositionOffset(by) => write!(f, "encoder off by {by} rad (m)"),
            Self::PositionFrozen => f.write_str("encoder frozen"),
            Self::TorqueScaled(factor) => write!(f, "torque actual multiplied by {factor}"),
        }
    }
}

impl fmt::Display for ContactFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::StuckHigh => "stuck high",
            Self::StuckLow => "stuck low",
            Self::Bouncing => "bounces",
        })
    }
}

/// The word for it in a scenario.
impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, input)| input == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}
