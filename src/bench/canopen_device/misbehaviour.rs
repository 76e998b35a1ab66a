//! Misbehaviour of a device for tests of masters: deviations from its dictionary or from CiA 301.
//!
//! Only SDO replies and reactions change; by default a device behaves correctly.

use std::ops::RangeInclusive;

use crate::mapping::number;
use crate::parameter::{NO_REMOTE, Place};
use crate::{Application, ConnectionLoss, Device};
use canopen::abort::AbortCode;
use canopen::layout::Direction;
use canopen::object::Object;

/// Deviations of a device; none by default.
#[derive(Clone, Debug, Default)]
pub struct Misbehaviour {
    /// Writes by SDO to these objects are confirmed without effect.
    pub ignores: Vec<Object>,
    /// Writes by SDO to these indices are aborted with this code.
    pub refuses: Vec<(RangeInclusive<u16>, AbortCode)>,
    /// Writes by SDO to these objects are aborted with 0800 0022h unless the device is operational.
    pub needs_operational: Vec<Object>,
    /// Aborts a write of a TPDO's COB-ID without bit 30 (no remote frames) with 0609 0030h.
    pub refuses_remote_tpdos: bool,
    /// Replaces the code of every abort.
    pub only_abort_code: Option<AbortCode>,
    /// Omits the size in SDO upload responses: `42h` and `40h` instead of `4Bh` and `41h` (CiA 301,
    /// 7.2.4.3.6: bit s).
    pub omits_sizes: bool,
    /// Reports a lost master but does not react.
    pub ignores_connection_loss: bool,
}

impl Misbehaviour {
    /// Checks a write to `object`.
    ///
    /// # Errors
    /// Returns the abort code of a refused write.
    pub(super) fn check_write(
        &self,
        object: Object,
        is_operational: bool,
    ) -> Result<(), AbortCode> {
        if !is_operational && self.needs_operational.contains(&object) {
            return Err(AbortCode::DEVICE_STATE);
        }
        let refusal = self.refuses.iter().find(|(indices, _)| indices.contains(&object.index));
        refusal.map_or(Ok(()), |(_, code)| Err(*code))
    }

    /// Checks the value of a write to `object`.
    ///
    /// # Errors
    /// Returns the abort code of a refused value.
    pub(super) fn check_value(&self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        let is_cob_id = Place::from_parameter(object).is_some_and(|place| {
            place.direction == Direction::Transmit && place.communication(1) == object
        });
        let has_bit = number(bytes) & u64::from(NO_REMOTE) != 0;
        if self.refuses_remote_tpdos && is_cob_id && !has_bit {
            return Err(AbortCode::VALUE_INVALID);
        }
        Ok(())
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
