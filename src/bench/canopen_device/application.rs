//! Function of a device behind its CANopen interface.

use crate::condition;
use crate::dictionary::Dictionary;
use canopen::abort::AbortCode;
use canopen::error_codes;
use canopen::object::Object;
use units::time::Instant;

/// Function of a device.
pub trait Application {
    /// Checks a write. Type, access, range and the rules of CiA 301 are checked before.
    ///
    /// # Errors
    /// Returns the abort code of a refused write.
    fn check_write(
        &mut self,
        _dictionary: &Dictionary,
        _object: Object,
        _bytes: &[u8],
    ) -> Result<(), AbortCode> {
        Ok(())
    }

    /// Handles a write by SDO, or by an RPDO after all its objects are set.
    fn written(&mut self, _dictionary: &mut Dictionary, _object: Object) {}

    /// Handles a SYNC in operational: the RPDOs have acted, the TPDOs are sampled next.
    fn on_sync(&mut self, _dictionary: &mut Dictionary) {}

    /// Handles the loss of the master. Returns the manufacturer's bytes of the emergency.
    fn on_connection_lost(
        &mut self,
        _dictionary: &mut Dictionary,
        _why: ConnectionLoss,
    ) -> [u8; 5] {
        [0; 5]
    }

    /// Handles a reset, after the defaults are restored.
    fn on_reset(&mut self, _dictionary: &mut Dictionary, _reset: Reset) {}

    /// Performs the actions due at `now`, in every NMT state.
    fn on_time(&mut self, _now: Instant, _dictionary: &mut Dictionary) {}

    /// Time of the next call of [`on_time`](Self::on_time).
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Error code of the present error; 0 for none.
    fn error_code(&self) -> u16 {
        0
    }
}

/// Reason of a lost master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConnectionLoss {
    /// Lost heartbeat of the master (1016h).
    Heartbeat,
    /// Event timer of an RPDO that ran out (sub-index 5 of its communication parameter).
    RpdoTimeout,
    /// NMT command of the master that stopped or reset the operational node.
    Stopped,
}

impl ConnectionLoss {
    /// Error code of the emergency (CiA 301, table 26): 8130h, 8250h, 8100h.
    pub const fn error_code(self) -> u16 {
        match self {
            Self::Heartbeat => condition::HEARTBEAT_LOST,
            Self::RpdoTimeout => error_codes::RPDO_TIMEOUT,
            Self::Stopped => condition::COMMUNICATION_LOST,
        }
    }
}

/// Scope of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Communication profile, 1000h to 1FFFh.
    Communication,
    /// All objects, as after power-up.
    Node,
}
