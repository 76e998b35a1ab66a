//! Error conditions of a device and their error codes (CiA 301, 7.2.7.1, table 26).

use canopen::error_codes;

/// Present error that the device reports by EMCY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Condition {
    /// Lost heartbeat (1016h).
    HeartbeatLost,
    /// Lost guarding master (100Ch, 100Dh).
    GuardLost,
    /// Event timer of an RPDO that ran out (sub-index 5 of its communication parameter).
    RpdoTimeout,
    /// RPDO with fewer bytes than its mapping.
    RpdoTooShort,
    /// RPDO with more bytes than its mapping.
    RpdoTooLong,
    /// SYNC with a counter although none is configured, or without a configured one (1019h).
    SyncLength,
    /// Synchronous PDO after the synchronous window (1007h).
    SyncWindow,
    /// Error of the application.
    Application,
}

impl Condition {
    /// Error code of its emergency; the application has codes of its own.
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

/// Communication error, generic.
pub(super) const COMMUNICATION_LOST: u16 = 0x8100;
/// Life guard or heartbeat error.
pub(super) const HEARTBEAT_LOST: u16 = 0x8130;

/// Present error conditions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Conditions(u8);

impl Conditions {
    /// Returns whether no error is present.
    pub(super) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns whether the condition is present.
    pub(super) const fn has(self, condition: Condition) -> bool {
        self.0 & condition.bit() != 0
    }

    /// Sets or clears a condition.
    pub(super) const fn set(&mut self, condition: Condition, is_present: bool) {
        self.0 = if is_present { self.0 | condition.bit() } else { self.0 & !condition.bit() };
    }

    /// Returns whether a condition other than the application's is present.
    pub(super) const fn is_of_communication(self) -> bool {
        self.0 & !Condition::Application.bit() != 0
    }
}
