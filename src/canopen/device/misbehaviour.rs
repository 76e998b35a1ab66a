//! Bad misbehaviour of a device, for masters to be tried on: where it does otherwise than it says, or than
//! CiA 301 has it.
//!
//! What it says is unchanged by them but for its SDO replies; a device without any is a good one.

use std::ops::RangeInclusive;

use crate::abort::AbortCode;
use crate::device::Application;
use crate::device::ConnectionLoss;
use crate::device::Device;
use crate::object::Object;

/// What a device does badly. By default nothing.
#[derive(Clone, Debug, Default)]
pub struct Misbehaviour {
    /// Writes by SDO to these are confirmed, and forgotten.
    pub ignores: Vec<Object>,
    /// Writes by SDO to these indices are refused, and why.
    pub refuses: Vec<(RangeInclusive<u16>, AbortCode)>,
    /// Whatever it refuses, for whatever reason, it gives this one.
    pub only_abort: Option<AbortCode>,
    /// It does not say how many bytes an SDO reply holds: `42h` and `40h` where others say `4Bh` and
    /// `41h` (CiA 301, 7.2.4.3.6: bit s).
    pub hides_sizes: bool,
    /// It tells of a lost master, and goes on as before.
    pub ignores_connection_loss: bool,
}

impl Misbehaviour {
    /// Whether a write to `object` is forgotten.
    pub(super) fn ignores(&self, object: Object) -> bool {
        self.ignores.contains(&object)
    }

    /// Why a write to `object` is refused, if it is.
    ///
    /// # Errors
    /// When it is.
    pub(super) fn check_write(&self, object: Object) -> Result<(), AbortCode> {
        let refusal = self.refuses.iter().find(|(indices, _)| indices.contains(&object.index));
        refusal.map_or(Ok(()), |(_, code)| Err(*code))
    }

    /// The reason that is given for `code`.
    pub(super) fn abort_code(&self, code: AbortCode) -> AbortCode {
        self.only_abort.unwrap_or(code)
    }
}

impl<A: Application> Device<A> {
    /// The same device with bad misbehaviour.
    #[must_use]
    pub fn with_misbehaviour(self, misbehaviour: Misbehaviour) -> Self {
        Self { misbehaviour, ..self }
    }

    /// What the application does about a lost master; the manufacturer's bytes of the emergency.
    pub(super) fn react_to(&mut self, why: ConnectionLoss) -> [u8; 5] {
        if self.misbehaviour.ignores_connection_loss {
            return [0; 5];
        }
        self.application.on_connection_lost(&mut self.dictionary, why)
    }
}
