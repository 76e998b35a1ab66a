//! What a device does, as the slave that carries it sees it.

use crate::abort::AbortCode;
use crate::device::condition;
use crate::dictionary::Dictionary;
use crate::error_codes;
use crate::object::Object;
use units::time::Instant;

/// What a device does, apart from communicating.
pub trait Application {
    /// Whether an object may be written; type, access, range and the rules of CiA 301 are checked before.
    ///
    /// # Errors
    /// When it may not, and why.
    fn check_write(
        &mut self,
        _dictionary: &Dictionary,
        _object: Object,
        _bytes: &[u8],
    ) -> Result<(), AbortCode> {
        Ok(())
    }

    /// An object has been written, by SDO or by an RPDO, all of whose objects are there by then.
    fn written(&mut self, _dictionary: &mut Dictionary, _object: Object) {}

    /// A SYNC in operational: the RPDOs have acted, the TPDOs are sampled next.
    fn on_sync(&mut self, _dictionary: &mut Dictionary) {}

    /// Nothing is heard of the master any more; gives the manufacturer's bytes of the emergency.
    fn on_connection_lost(
        &mut self,
        _dictionary: &mut Dictionary,
        _why: ConnectionLoss,
    ) -> [u8; 5] {
        [0; 5]
    }

    /// The dictionary, or its communication part, has its defaults again.
    fn on_reset(&mut self, _dictionary: &mut Dictionary, _reset: Reset) {}

    /// Does what is due at `now`, whether or not anybody listens to the device.
    fn on_time(&mut self, _now: Instant, _dictionary: &mut Dictionary) {}

    /// When [`on_time`](Self::on_time) must next be called.
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// The error the application has now, as an emergency's code; 0 for none.
    fn error_code(&self) -> u16 {
        0
    }
}

/// How the master was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConnectionLoss {
    /// Its heartbeat stays away (1016h).
    Heartbeat,
    /// An RPDO stays away (sub-index 5 of its communication parameter).
    RpdoTimeout,
    /// It has stopped or reset the node in operation.
    Stopped,
}

impl ConnectionLoss {
    /// The error code of the emergency (CiA 301, table 26): 8130h, 8250h, 8100h.
    pub const fn error_code(self) -> u16 {
        match self {
            Self::Heartbeat => condition::HEARTBEAT_LOST,
            Self::RpdoTimeout => error_codes::RPDO_TIMEOUT,
            Self::Stopped => condition::COMMUNICATION_LOST,
        }
    }
}

/// What has its defaults again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// 1000h to 1FFFh.
    Communication,
    /// Everything, as after power-up.
    Node,
}
