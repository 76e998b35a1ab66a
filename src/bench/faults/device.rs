//! Faults of devices: connection, device itself, sensors, contacts of switches.

use std::fmt;

use derive_more::Display;

/// Disconnection of a device from its bus.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Disconnection {
    /// Unplugged connector of bus and supply. The device boots when it is plugged in again.
    #[display("unplugged")]
    Unplugged,
    /// Cut of the bus before the device: it and all behind it on the same bus are disconnected.
    #[display("wire cut before it")]
    WireCut,
    /// Bus-off of the device's CAN controller. The device reports its recovery by an emergency message (8140h).
    #[display("bus-off")]
    BusOff,
}

/// Fault inside a device.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum DeviceFault {
    /// Reboot without an NMT command.
    #[display("reboots by itself")]
    Reboot,
    /// EMCY of a device that continues.
    #[display("emergency {code:04X}h")]
    Emergency {
        /// Error code.
        code: u16,
        /// Error register (1001h).
        register: u8,
    },
    /// State Fault (CiA 402) of a drive, which sends this error code; 0 for no emergency message.
    #[display("fault {_0:04X}h")]
    DriveFault(u16),
    /// Safe torque off is requested at the drive's input.
    #[display("safe torque off")]
    SafeTorqueOff,
    /// Controlword (6040h) that the drive accepts, by PDO and by SDO, without an effect.
    #[display("controlword ignored")]
    ControlwordIgnored,
    /// Torque offset (60B2h) in ‰ of rated torque, written at the drive's service port, unseen by the bus.
    #[display("torque offset of {_0} ‰")]
    TorqueOffset(i16),
}

/// Wrong measurement of a drive.
#[derive(Clone, Copy, Debug, Display, PartialEq)]
pub enum SensorFault {
    /// Offset of the position, in rad (m) of the joint.
    #[display("encoder off by {_0} rad (m)")]
    PositionOffset(f64),
    /// Position that does not change.
    #[display("encoder frozen")]
    PositionFrozen,
    /// Factor on the reported torque.
    #[display("torque actual multiplied by {_0}")]
    TorqueScaled(f64),
}

/// Fault of one input of the switch box.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum ContactFault {
    /// Input that is always high.
    #[display("stuck high")]
    StuckHigh,
    /// Input that is always low.
    #[display("stuck low")]
    StuckLow,
    /// Input that is inverted at random.
    #[display("bounces")]
    Bouncing,
}

/// Input of the switch box. Its bits are defined independently of those that the node reads, so that an error in one cannot
/// cancel in the other.
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
    /// Returns whether the fault has no duration.
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

    /// Returns its bit in the first byte of digital inputs (6000h:1).
    pub const fn bit(self) -> u8 {
        match self {
            Self::DeadmanA => 1,
            Self::DeadmanB => 1 << 1,
            Self::Reference => 1 << 2,
            Self::Reflection => 1 << 3,
        }
    }
}

/// Writes the word of a scenario.
impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, input)| input == self);
        f.write_str(name.map_or("", |(name, _)| name))
    }
}
