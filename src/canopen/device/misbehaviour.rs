//! Misbehaviour of a device for tests of masters: deviations from its dictionary or from CiA 301.
//!
//! Only SDO replies and reactions change; by default a device behaves correctly.

use std::ops::RangeInclusive;

use crate::abort::AbortCode;
use crate::device::{Application, ConnectionLoss, Device};
use crate::object::Object;

/// Deviations of a device; none by default.
#[derive(Clone, Debug, Default)]
pub struct Misbehaviour {
    /// Writes by SDO to these objects are confirmed without effect.
    pub ignores: Vec<Object>,
    /// Writes by SDO to these indices are aborted with this code.
    pub refuses: Vec<(RangeInclusive<u16>, AbortCode)>,
    /// Replaces the code of every abort.
    pub only_abort_code: Option<AbortCode>,
    /// Omits the size in SDO upload responses: `42h` and `40h` instead of `4Bh` and `41h` (CiA 301,
    /// 7.2.4.3.6: bit s).
    pub omits_sizes: bool,
    /// Reports a lost master but does not react.
    pub ignores_connection_loss: bool,
}

impl Misbehaviour {
    /// Returns whether a write to `object` has no effect.
    pub(super) fn ignores(&self, object: Object) -> bool {
        self.ignores.contains(&object)
    }

    /// Checks a write to `object`.
    ///
    /// # Errors
    /// Returns the abort code of a refused write.
    pub(super) fn check_write(&self, object: Object) -> Result<(), AbortCode> {
        let refusal = self.refuses.iter().find(|(indices, _)| indices.contains(&object.index));
        refusal.map_or(Ok(()), |(_, code)| Err(*code))
    }

    /// Replaces an abort code.
    pub(super) fn abort_code(&self, code: AbortCode) -> AbortCode {
        self.only_abort_code.unwrap_or(code)
    }
}

impl<A: Application> Device<A> {
    /// Adds misbehaviour to the device.
    #[must_use]
    pub fn with_misbehaviour(self, misbehaviour: Misbehaviour) -> Self {
        Self { misbehaviour, ..self }
    }

    /// Reacts to a lost master; returns the manufacturer's bytes of the emergency.
    pub(super) fn react_to(&mut self, why: ConnectionLoss) -> [u8; 5] {
        if self.misbehaviour.ignores_connection_loss {
            return [0; 5];
        }
        self.application.on_connection_lost(&mut self.dictionary, why)
    }
}
