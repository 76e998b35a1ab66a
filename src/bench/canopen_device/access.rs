//! Access rules of the objects (CiA 301, 7.2.4.3.17), between SDO server and dictionary.
//!
//! The [device](super::Device) applies the effect of a write, by `written`.

use crate::dictionary::{Dictionary, Entry, OutOfRange};
use crate::mapping::number;
use crate::parameter::{Place, check_cob_id_change, consumed};
use crate::sdo_server::Access;
use crate::{Application, Misbehaviour, clock, heartbeat, history, store, sync};
use canopen::abort::AbortCode;
use canopen::object::Object;

/// Objects of a device, during one request.
#[derive(Debug)]
pub(super) struct Objects<'a, A> {
    pub(super) dictionary: &'a mut Dictionary,
    pub(super) application: &'a mut A,
    pub(super) misbehaviour: &'a Misbehaviour,
    pub(super) is_operational: bool,
    /// Object written by the request.
    pub(super) written: Option<Object>,
}

impl<A: Application> Access for Objects<'_, A> {
    fn read(&self, object: Object, bytes: &mut Vec<u8>) -> Result<(), AbortCode> {
        if !self.entry(object)?.access.is_readable() {
            return Err(AbortCode::WRITE_ONLY);
        }
        if history::is_empty_at(self.dictionary, object) {
            return Err(AbortCode::NO_DATA);
        }
        bytes.extend_from_slice(self.dictionary.get(object).ok_or(AbortCode::NO_DATA)?);
        Ok(())
    }

    fn size(&self, object: Object) -> Result<Option<usize>, AbortCode> {
        let entry = self.entry(object)?;
        if !entry.access.is_writable() {
            return Err(AbortCode::READ_ONLY);
        }
        self.misbehaviour.check_write(object, self.is_operational)?;
        Ok(entry.size())
    }

    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        self.misbehaviour.check_value(object, bytes)?;
        self.check_write(object, bytes)?;
        if self.misbehaviour.ignores.contains(&object) {
            return Ok(());
        }
        if !self.dictionary.set(object, bytes) {
            return Err(AbortCode::NOT_STORED);
        }
        self.application.written(self.dictionary, object);
        self.written = Some(object);
        Ok(())
    }

    fn indicates_size(&self) -> bool {
        !self.misbehaviour.omits_sizes
    }

    fn reason(&self, code: AbortCode) -> AbortCode {
        self.misbehaviour.only_abort_code.unwrap_or(code)
    }
}

impl<A: Application> Objects<'_, A> {
    fn entry(&self, object: Object) -> Result<&Entry, AbortCode> {
        self.dictionary.entry(object).ok_or_else(|| {
            let has_index = self.dictionary.has_index(object.index);
            if has_index { AbortCode::NO_SUB_INDEX } else { AbortCode::NO_OBJECT }
        })
    }

    /// Checks a write of `bytes`, whose size matches, by the rules of CiA 301, the limits and the application.
    fn check_write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        follows_rules(self.dictionary, object, bytes)?;
        self.entry(object)?.in_range(bytes).map_err(|outside| match outside {
            OutOfRange::Below => AbortCode::VALUE_TOO_LOW,
            OutOfRange::Above => AbortCode::VALUE_TOO_HIGH,
        })?;
        self.application.check_write(self.dictionary, object, bytes)
    }
}

/// Checks a write by the rules of the communication profile (CiA 301, 7.5.2).
///
/// # Errors
/// Returns the abort code of a value that is invalid, or invalid in this state.
fn follows_rules(dictionary: &Dictionary, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
    if let Some(place) = Place::from_parameter(object) {
        return place.check_write(dictionary, object, bytes);
    }
    let Ok(value) = u32::try_from(number(bytes)) else { return Ok(()) };
    match object {
        Object::ERROR_HISTORY if value > 0 => Err(AbortCode::VALUE_INVALID),
        Object::SYNC_COB_ID => consumed(value).map(|_| ()),
        Object::SYNC_OVERFLOW => sync::check_overflow(dictionary, value),
        Object::TIME_COB_ID => clock::check_cob_id(dictionary.unsigned(object), value),
        Object::EMCY_COB_ID => check_cob_id_change(dictionary.unsigned(object), value),
        Object::STORE_PARAMETERS | Object::RESTORE_DEFAULTS => store::check_write(object, value),
        Object { index, .. } if index == Object::CONSUMER_HEARTBEAT.index => {
            heartbeat::check_entry(dictionary, object, value)
        }
        _ => Ok(()),
    }
}
