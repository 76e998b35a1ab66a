//! Tags of the entries in a file of inputs. docs/sessions.md has the table with their bytes; a test compares both.

/// Version of the format.
pub const FORMAT: u16 = 2;

/// Version of files without a part number, which are first parts.
pub const FORMAT_OF_ONE_PART: u16 = 1;

/// First bytes of each file, before the version.
pub const MAGIC: [u8; 6] = *b"frhcin";

/// Declares tags by name and value, and a list of both.
macro_rules! tags {
    ($($name:ident = $tag:literal;)+) => {
        $(#[doc = concat!("Tag ", stringify!($tag), ".")] pub const $name: u8 = $tag;)+

        /// All tags, with their names.
        pub const ALL: &[(u8, &str)] = &[$(($tag, stringify!($name))),+];
    };
}

tags! {
    NEW = 0x01;
    BRING_UP = 0x02;
    BRING_UP_UNPOWERED = 0x03;
    ARM = 0x04;
    DISARM = 0x05;
    RESET = 0x06;
    COMMAND_RATE = 0x07;
    COMMAND_POSE = 0x08;
    CYCLE = 0x09;
    STOP = 0x0A;
    ADJUST = 0x0B;
    ZERO = 0x0C;
    PARK = 0x0D;
    TRIAL = 0x0E;
    RETURNED = 0x10;
    INTERMEDIATES = 0x11;
    NOW_AGAIN = 0x20;
    NOW = 0x21;
    WALL = 0x22;
    SUSPENDED_AGAIN = 0x23;
    SUSPENDED = 0x24;
    UNCONFIRMED = 0x25;
    CONFIRMED = 0x26;
    QUEUE_FULL = 0x31;
    BUS_DOWN = 0x32;
    WOKEN = 0x40;
    FRAME = 0x41;
    BUS_FAULT = 0x42;
    REOPENED = 0x50;
    NOT_REOPENED_GONE = 0x51;
    NOT_REOPENED_UNFIT = 0x52;
    NOT_SENSED = 0x60;
    SENSED_AGAIN = 0x61;
    SENSED = 0x62;
    NO_SIDE_FAULT = 0x70;
    SIDE_HOLDS = 0x71;
    SIDE_SLOW = 0x72;
    MISFITS = 0x73;
    GO_ON = 0x80;
    END = 0x81;
    LOST = 0xF0;
}
