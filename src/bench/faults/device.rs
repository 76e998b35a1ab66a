//! Faults of devices: connection, device itself, sensors, contacts of switches.

use std::fmt;

use crate::described::described;

described! {
    /// A device without its bus.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Disconnection {
        /// The connector with bus and supply is unplugged. The device boots when it is plugged in again.
        Unplugged => "unplugged";
        /// The bus is cut before the device: it and all behind it on the same bus are disconnected.
        WireCut => "wire cut before it";
        /// The device's CAN controller is bus-off. It reports its recovery by an emergency message (8140h).
        BusOff => "bus-off";
    }

    /// A fault of a device itself.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum DeviceFault {
        /// The device reboots by itself.
        Reboot => "reboots by itself";
        /// The device sends an emergency message and goes on.
        Emergency {
            /// The error code.
            code: u16,
            /// The error register (1001h).
            register: u8,
        } => "emergency {code:04X}h";
        /// The drive enters the state Fault (CiA 402) and sends this error code; 0 for no emergency message.
        DriveFault(code: u16) => "fault {code:04X}h";
        /// Safe torque off is requested at the drive's input.
        SafeTorqueOff => "safe torque off";
        /// The drive accepts its controlword (6040h), by PDO and by SDO, without an effect.
        ControlwordIgnored => "controlword ignored";
        /// The torque offset (60B2h) is written at the drive's service port, unseen by the bus, in ‰ of rated torque.
        TorqueOffset(per_mille: i16) => "torque offset of {per_mille} ‰";
    }

    /// A wrong measurement of a drive.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub enum SensorFault {
        /// The position is off by this much, in rad (m) of the joint.
        PositionOffset(by: f64) => "encoder off by {by} rad (m)";
        /// The position does not change.
        PositionFrozen => "encoder frozen";
        /// The torque is multiplied by this factor.
        TorqueScaled(factor: f64) => "torque actual multiplied by {factor}";
    }

    /// A fault of a contact.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum ContactFault {
        /// The input is always high.
        StuckHigh => "stuck high";
        /// The input is always low.
        StuckLow => "stuck low";
        /// The input is inverted at random.
        Bouncing => "bounces";
    }
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

/// The word for it in a scenario.
impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, input)| input == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}
