//! Objects by index, sub-index and name. Index numbers appear in this file only.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// Entry of an object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Object {
    /// Index, 1000h to 9FFFh (CiA 301, 7.4.1).
    pub index: u16,
    /// Sub-index.
    pub sub: u8,
}

/// `1018h:1`, and `6071h` for sub-index 0.
impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.sub {
            0 => write!(f, "{:04X}h", self.index),
            sub => write!(f, "{:04X}h:{sub}", self.index),
        }
    }
}

/// Error of a text that names no object.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("\"{0}\" is no object; write index and sub-index as 3001h:2, and 6071h for sub-index 0")]
pub struct NoObject(String);

/// Parses `1018h:1`, `6071h` and `0x6071:0`; the index is hexadecimal.
impl FromStr for Object {
    type Err = NoObject;

    fn from_str(text: &str) -> Result<Self, NoObject> {
        let parsed = || {
            let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
            let digits = index.strip_suffix('h').or_else(|| index.strip_prefix("0x"))?;
            let is_index = digits.len() == 4 && digits.bytes().all(|it| it.is_ascii_hexdigit());
            let index = u16::from_str_radix(digits, 16).ok().filter(|_| is_index)?;
            Some(Self { index, sub: sub.parse().ok()? })
        };
        parsed().ok_or_else(|| NoObject(text.to_owned()))
    }
}

/// Returns an object with sub-index 0.
const fn var(index: u16) -> Object {
    Object { index, sub: 0 }
}

impl Object {
    /// INTEGER16 as a dummy: 16 bits of an RPDO that this node skips (CiA 301, 7.4.7.1).
    pub const DUMMY_INTEGER16: Self = var(0x0003);

    // CiA 301, 7.5: communication profile.
    pub const DEVICE_TYPE: Self = var(0x1000);
    pub const ERROR_REGISTER: Self = var(0x1001);
    pub const ERROR_HISTORY: Self = var(0x1003);
    pub const SYNC_COB_ID: Self = var(0x1005);
    pub const CYCLE_PERIOD: Self = var(0x1006);
    pub const SYNC_WINDOW: Self = var(0x1007);
    pub const DEVICE_NAME: Self = var(0x1008);
    pub const HARDWARE_VERSION: Self = var(0x1009);
    pub const SOFTWARE_VERSION: Self = var(0x100A);
    pub const GUARD_TIME: Self = var(0x100C);
    pub const LIFE_TIME_FACTOR: Self = var(0x100D);
    pub const STORE_PARAMETERS: Self = Self { index: 0x1010, sub: 1 };
    pub const RESTORE_DEFAULTS: Self = Self { index: 0x1011, sub: 1 };
    pub const TIME_COB_ID: Self = var(0x1012);
    pub const HIGH_RESOLUTION_TIME: Self = var(0x1013);
    pub const EMCY_COB_ID: Self = var(0x1014);
    pub const EMCY_INHIBIT_TIME: Self = var(0x1015);
    pub const CONSUMER_HEARTBEAT: Self = Self { index: 0x1016, sub: 1 };
    pub const PRODUCER_HEARTBEAT: Self = var(0x1017);
    pub const VENDOR_ID: Self = Self { index: 0x1018, sub: 1 };
    pub const PRODUCT_CODE: Self = Self { index: 0x1018, sub: 2 };
    pub const REVISION: Self = Self { index: 0x1018, sub: 3 };
    pub const SERIAL: Self = Self { index: 0x1018, sub: 4 };
    pub const CONFIGURATION_DATE: Self = Self { index: 0x1020, sub: 1 };
    pub const CONFIGURATION_TIME: Self = Self { index: 0x1020, sub: 2 };
    pub const SYNC_OVERFLOW: Self = var(0x1019);
    pub const STORED_EDS: Self = var(0x1021);
    pub const STORE_FORMAT: Self = var(0x1022);
    pub const ERROR_BEHAVIOUR: Self = Self { index: 0x1029, sub: 1 };
    // CiA 302-3: programs.
    pub const PROGRAM_IDENTIFICATION: Self = Self { index: 0x1F56, sub: 1 };

    // Manufacturer-specific: the simulated drive.
    pub const SAMPLE_BUFFER: Self = var(0x2000);
    pub const WINDING_TEMPERATURE: Self = var(0x2001);

    // CiA 402: drives.
    pub const ABORT_CONNECTION: Self = var(0x6007);
    pub const ERROR_CODE: Self = var(0x603F);
    pub const CONTROLWORD: Self = var(0x6040);
    /// Controlword of the second axis of a node: 800h further.
    pub const SECOND_CONTROLWORD: Self = var(0x6840);
    pub const STATUSWORD: Self = var(0x6041);
    pub const QUICK_STOP_OPTION: Self = var(0x605A);
    pub const SHUTDOWN_OPTION: Self = var(0x605B);
    pub const DISABLE_OPERATION_OPTION: Self = var(0x605C);
    pub const HALT_OPTION: Self = var(0x605D);
    pub const FAULT_REACTION: Self = var(0x605E);
    pub const MODE_OF_OPERATION: Self = var(0x6060);
    pub const MODE_DISPLAY: Self = var(0x6061);
    pub const POSITION_DEMAND: Self = var(0x6062);
    pub const POSITION_INTERNAL: Self = var(0x6063);
    pub const POSITION_ACTUAL: Self = var(0x6064);
    pub const FOLLOWING_ERROR_WINDOW: Self = var(0x6065);
    pub const FOLLOWING_ERROR_TIME: Self = var(0x6066);
    pub const POSITION_WINDOW: Self = var(0x6067);
    pub const POSITION_WINDOW_TIME: Self = var(0x6068);
    pub const VELOCITY_DEMAND: Self = var(0x606B);
    pub const VELOCITY_ACTUAL: Self = var(0x606C);
    pub const VELOCITY_WINDOW: Self = var(0x606D);
    pub const VELOCITY_WINDOW_TIME: Self = var(0x606E);
    pub const VELOCITY_THRESHOLD: Self = var(0x606F);
    pub const VELOCITY_THRESHOLD_TIME: Self = var(0x6070);
    pub const TARGET_TORQUE: Self = var(0x6071);
    pub const MAX_TORQUE: Self = var(0x6072);
    pub const MAX_CURRENT: Self = var(0x6073);
    pub const TORQUE_DEMAND: Self = var(0x6074);
    pub const RATED_CURRENT: Self = var(0x6075);
    pub const RATED_TORQUE: Self = var(0x6076);
    pub const TORQUE_ACTUAL: Self = var(0x6077);
    pub const CURRENT_ACTUAL: Self = var(0x6078);
    pub const LINK_VOLTAGE: Self = var(0x6079);
    pub const TARGET_POSITION: Self = var(0x607A);
    pub const MIN_POSITION_RANGE: Self = Self { index: 0x607B, sub: 1 };
    pub const MAX_POSITION_RANGE: Self = Self { index: 0x607B, sub: 2 };
    pub const HOME_OFFSET: Self = var(0x607C);
    pub const MIN_POSITION_LIMIT: Self = Self { index: 0x607D, sub: 1 };
    pub const MAX_POSITION_LIMIT: Self = Self { index: 0x607D, sub: 2 };
    pub const POLARITY: Self = var(0x607E);
    pub const MAX_PROFILE_VELOCITY: Self = var(0x607F);
    pub const MAX_MOTOR_SPEED: Self = var(0x6080);
    pub const PROFILE_VELOCITY: Self = var(0x6081);
    pub const PROFILE_ACCELERATION: Self = var(0x6083);
    pub const PROFILE_DECELERATION: Self = var(0x6084);
    pub const QUICK_STOP_DECELERATION: Self = var(0x6085);
    pub const TORQUE_SLOPE: Self = var(0x6087);
    pub const ENCODER_INCREMENTS: Self = Self { index: 0x608F, sub: 1 };
    pub const ENCODER_REVOLUTIONS: Self = Self { index: 0x608F, sub: 2 };
    pub const VELOCITY_INCREMENTS: Self = Self { index: 0x6090, sub: 1 };
    pub const VELOCITY_REVOLUTIONS: Self = Self { index: 0x6090, sub: 2 };
    pub const GEAR_MOTOR_REVOLUTIONS: Self = Self { index: 0x6091, sub: 1 };
    pub const GEAR_SHAFT_REVOLUTIONS: Self = Self { index: 0x6091, sub: 2 };
    pub const FEED: Self = Self { index: 0x6092, sub: 1 };
    pub const FEED_REVOLUTIONS: Self = Self { index: 0x6092, sub: 2 };
    pub const POSITION_FACTOR: Self = Self { index: 0x6093, sub: 1 };
    pub const POSITION_FACTOR_DIVISOR: Self = Self { index: 0x6093, sub: 2 };
    pub const VELOCITY_FACTOR: Self = Self { index: 0x6094, sub: 1 };
    pub const VELOCITY_FACTOR_DIVISOR: Self = Self { index: 0x6094, sub: 2 };
    pub const HOMING_METHOD: Self = var(0x6098);
    pub const HOMING_SPEED_ZERO: Self = Self { index: 0x6099, sub: 2 };
    pub const HOMING_ACCELERATION: Self = var(0x609A);
    pub const POSITION_UNIT: Self = var(0x60A8);
    pub const VELOCITY_UNIT: Self = var(0x60A9);
    pub const ACCELERATION_UNIT: Self = var(0x60AA);
    pub const POSITION_OFFSET: Self = var(0x60B0);
    pub const VELOCITY_OFFSET: Self = var(0x60B1);
    pub const TORQUE_OFFSET: Self = var(0x60B2);
    pub const INTERPOLATION_TIME: Self = Self { index: 0x60C2, sub: 1 };
    pub const INTERPOLATION_TIME_INDEX: Self = Self { index: 0x60C2, sub: 2 };
    pub const MAX_ACCELERATION: Self = var(0x60C5);
    pub const MAX_DECELERATION: Self = var(0x60C6);
    pub const POSITIVE_TORQUE_LIMIT: Self = var(0x60E0);
    pub const NEGATIVE_TORQUE_LIMIT: Self = var(0x60E1);
    pub const SUPPORTED_HOMING_METHODS: Self = var(0x60E3);
    pub const FOLLOWING_ERROR: Self = var(0x60F4);
    pub const POSITION_DEMAND_INTERNAL: Self = var(0x60FC);
    pub const DRIVE_INPUTS: Self = var(0x60FD);
    pub const TARGET_VELOCITY: Self = var(0x60FF);
    pub const SUPPORTED_MODES: Self = var(0x6502);

    // CiA 401: the switch box.
    pub const DIGITAL_INPUTS: Self = Self { index: 0x6000, sub: 1 };

    /// Returns analogue input `number`, from 1, as INTEGER16 (CiA 401, 6401h).
    pub const fn analogue_input(number: u8) -> Self {
        Self { index: 0x6401, sub: number }
    }

    /// Returns whether the object is one of the 16-bit analogue inputs (CiA 401, 6401h), not their number (sub-index
    /// 0).
    pub const fn is_analogue_input(self) -> bool {
        self.index == Self::analogue_input(1).index && self.sub != 0
    }

    /// Returns whether this is a data type, used as a dummy mapping.
    pub const fn is_dummy(self) -> bool {
        self.index < 0x0020
    }

    /// RPDO communication parameter of RPDO `number` (1 to 512), sub-index `sub`.
    pub const fn rpdo_communication(number: u16, sub: u8) -> Self {
        Self { index: 0x1400 + number - 1, sub }
    }

    /// RPDO mapping of RPDO `number` (1 to 512), sub-index `sub`.
    pub const fn rpdo_mapping(number: u16, sub: u8) -> Self {
        Self { index: 0x1600 + number - 1, sub }
    }

    /// TPDO communication parameter of TPDO `number` (1 to 512), sub-index `sub`.
    pub const fn tpdo_communication(number: u16, sub: u8) -> Self {
        Self { index: 0x1800 + number - 1, sub }
    }

    /// TPDO mapping of TPDO `number` (1 to 512), sub-index `sub`.
    pub const fn tpdo_mapping(number: u16, sub: u8) -> Self {
        Self { index: 0x1A00 + number - 1, sub }
    }

    /// Returns whether the object is manufacturer-specific, by its index: 2000h to 5FFFh (CiA 301, 7.4.1).
    pub const fn is_of_maker(self) -> bool {
        matches!(self.index, 0x2000..=0x5FFF)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn object_is_parsed_as_it_is_printed() {
        for object in [Object::VENDOR_ID, Object::TARGET_TORQUE, Object { index: 0x3001, sub: 12 }]
        {
            assert_eq!(object.to_string().parse(), Ok(object));
        }
        assert_eq!("0x6071:0".parse(), Ok(Object::TARGET_TORQUE));
        for wrong in ["", "h", "6071", "607h", "+071h", "6071h:", "6071h:256", "6071h:-1", "16071h"]
        {
            assert!(wrong.parse::<Object>().is_err(), "{wrong}");
        }
    }
}
