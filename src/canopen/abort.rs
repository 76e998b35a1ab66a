//! SDO abort codes (CiA 301, 7.2.4.3.17), by name.

use derive_more::Display;

/// 32-bit reason in an SDO abort. Devices may use manufacturer-specific codes, so any value is possible.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[display("{:08X}h {}", self.0, self.description().unwrap_or("unknown reason"))]
pub struct AbortCode(pub u32);

/// Defines each code by its name, number and text.
macro_rules! codes {
    ($($name:ident = $number:literal, $text:literal;)*) => {
        impl AbortCode {
            $(#[doc = concat!("`", stringify!($number), "`: ", $text, ".")]
            pub const $name: Self = Self($number);)*

            /// Text of the code; `None` for a code that CiA 301 does not define.
            pub const fn description(self) -> Option<&'static str> {
                match self {
                    $(Self::$name => Some($text),)*
                    Self(_) => None,
                }
            }

            /// All codes of CiA 301.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];
        }
    };
}

codes! {
    TOGGLE_NOT_ALTERNATED = 0x0503_0000, "toggle bit not alternated";
    TIMED_OUT = 0x0504_0000, "SDO protocol timed out";
    COMMAND_UNKNOWN = 0x0504_0001, "command specifier not valid or unknown";
    BLOCK_SIZE_INVALID = 0x0504_0002, "block size invalid";
    SEQUENCE_NUMBER_INVALID = 0x0504_0003, "sequence number invalid";
    CRC_ERROR = 0x0504_0004, "CRC error";
    OUT_OF_MEMORY = 0x0504_0005, "out of memory";
    ACCESS_UNSUPPORTED = 0x0601_0000, "access to the object is not supported";
    WRITE_ONLY = 0x0601_0001, "object is write only";
    READ_ONLY = 0x0601_0002, "object is read only";
    NO_OBJECT = 0x0602_0000, "object does not exist";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped";
    PDO_TOO_LONG = 0x0604_0042, "mapped objects would exceed the PDO";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "parameter is incompatible";
    DEVICE_INCOMPATIBLE = 0x0604_0047, "incompatibility inside the device";
    HARDWARE_ERROR = 0x0606_0000, "hardware error";
    LENGTH_MISMATCH = 0x0607_0010, "length does not match the data type";
    LENGTH_TOO_HIGH = 0x0607_0012, "length is too high for the data type";
    LENGTH_TOO_LOW = 0x0607_0013, "length is too low for the data type";
    NO_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    VALUE_INVALID = 0x0609_0030, "value is invalid";
    VALUE_TOO_HIGH = 0x0609_0031, "value is too high";
    VALUE_TOO_LOW = 0x0609_0032, "value is too low";
    MAXIMUM_BELOW_MINIMUM = 0x0609_0036, "maximum is below minimum";
    NO_CONNECTION = 0x060A_0023, "SDO connection not available";
    GENERAL_ERROR = 0x0800_0000, "general error";
    NOT_STORED = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be stored in the present device state";
    NO_DICTIONARY = 0x0800_0023, "no object dictionary";
    NO_DATA = 0x0800_0024, "no data available";
}

impl AbortCode {
    /// Returns whether the node has the object, but refuses this value of it.
    pub const fn refuses_value(self) -> bool {
        matches!(
            self,
            Self::READ_ONLY
                | Self::PARAMETER_INCOMPATIBLE
                | Self::VALUE_INVALID
                | Self::VALUE_TOO_HIGH
                | Self::VALUE_TOO_LOW
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_reads_as_the_standard_prints_it() {
        assert_eq!(AbortCode::NO_SUB_INDEX.to_string(), "06090011h sub-index does not exist");
        assert_eq!(AbortCode(0x0800_FFFF).to_string(), "0800FFFFh unknown reason");
    }

    #[test]
    fn codes_are_those_of_the_standard_in_its_order() {
        assert_eq!(AbortCode::ALL.len(), 31);
        assert!(AbortCode::ALL.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
