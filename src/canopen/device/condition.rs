//! What may be wrong with a device, and the code its emergency has (CiA 301, 7.2.7.1, table 26).

use crate::error_codes;

/// What may be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Condition {
    /// A heartbeat stays away (1016h).
    HeartbeatLost,
    /// Nobody guards the node any more (100Ch, 100Dh).
    GuardLost,
    /// An RPDO stays away (sub-index 5 of its communication parameter).
    RpdoTimeout,
    /// An RPDO is shorter than its mapping.
    RpdoTooShort,
    /// An RPDO is longer than its mapping.
    RpdoTooLong,
    /// A SYNC has a counter where none is expected, or none where one is (1019h).
    SyncLength,
    /// A synchronous PDO came, or was ready, after the window (1007h).
    SyncWindow,
    /// An error of the application.
    Application,
}

impl Condition {
    /// The error code of its emergency; the application has codes of its own.
    pub(super) const fn code(self) -> u16 {
        match self {
            Self::HeartbeatLost | Self::GuardLost => HEARTBEAT_LOST,
            Self::RpdoTimeout => error_codes::RPDO_TIMEOUT,
            Self::RpdoTooShort => 0x8210,
            Self::RpdoTooLong => 0x8220,
            Self::SyncLength => 0x8240,
            Self::SyncWindow => 0x8200,
            Self::Application => 0,
        }
    }

    const fn bit(self) -> u8 {
        match self {
            Self::HeartbeatLost => 1,
            Self::GuardLost => 1 << 1,
            Self::RpdoTimeout => 1 << 2,
            Self::RpdoTooShort => 1 << 3,
            Self::RpdoTooLong => 1 << 4,
            Self::SyncLength => 1 << 5,
            Self::SyncWindow => 1 << 6,
            Self::Application => 1 << 7,
        }
    }
}

/// The master does not communicate any more.
pub(super) const COMMUNICATION_LOST: u16 = 0x8100;
/// No heartbeat, or no guard, for too long.
pub(super) const HEARTBEAT_LOST: u16 = 0x8130;

/// Everything that is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Conditions(u8);

impl Conditions {
    /// Nothing is wrong.
    pub(super) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether that is wrong.
    pub(super) const fn has(self, condition: Condition) -> bool {
        self.0 & condition.bit() != 0
    }

    /// That is, or is not, wrong from now on.
    pub(super) const fn set(&mut self, condition: Condition, is_wrong: bool) {
        self.0 = if is_wrong { self.0 | condition.bit() } else { self.0 & !condition.bit() };
    }

    /// Whether anything but the application is wrong.
    pub(super) const fn is_of_communication(self) -> bool {
        self.0 & !Condition::Application.bit() != 0
    }
}
