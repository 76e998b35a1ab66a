//! Which objects may be read and written, and why not (CiA 301, 7.2.4.3.17): the way an SDO server, or
//! the device's own code in its place, gets at the dictionary.
//!
//! What a write changes in the device is done by the [device](super::Device), from `written`.

use crate::abort::AbortCode;
use crate::device::Application;
use crate::device::Misbehaviour;
use crate::device::clock;
use crate::device::heartbeat;
use crate::device::history;
use crate::device::mapping::number;
use crate::device::parameter::Place;
use crate::device::parameter::may_change_cob_id;
use crate::device::sdo_server::Access;
use crate::device::store;
use crate::device::sync;
use crate::dictionary::Dictionary;
use crate::dictionary::Entry;
use crate::dictionary::OutOfRange;
use crate::object::Object;

/// The objects of a device, between two frames.
#[derive(Debug)]
pub(super) struct Objects<'a, A> {
    pub(super) dictionary: &'a mut Dictionary,
    pub(super) application: &'a mut A,
    pub(super) misbehaviour: &'a Misbehaviour,
    /// What was written.
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
        self.misbehaviour.check_write(object)?;
        Ok(entry.size())
    }

    fn write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        self.check_write(object, bytes)?;
        if self.misbehaviour.ignores(object) {
            return Ok(());
        }
        if !self.dictionary.set(object, bytes) {
            return Err(AbortCode::NOT_STORED);
        }
        self.application.written(self.dictionary, object);
        self.written = Some(object);
        Ok(())
    }

    fn tells_sizes(&self) -> bool {
        !self.misbehaviour.hides_sizes
    }

    fn reason(&self, code: AbortCode) -> AbortCode {
        self.misbehaviour.abort_code(code)
    }
}

impl<A: Application> Objects<'_, A> {
    fn entry(&self, object: Object) -> Result<&Entry, AbortCode> {
        self.dictionary.entry(object).ok_or_else(|| {
            let has_index = self.dictionary.has_index(object.index);
            if has_index { AbortCode::NO_SUB_INDEX } else { AbortCode::NO_OBJECT }
        })
    }

    /// Whether `object` may be written with `bytes` now, which have its size: by the rules of CiA 301, its
    /// limits, and the application.
    fn check_write(&mut self, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
        follows_rules(self.dictionary, object, bytes)?;
        self.entry(object)?.in_range(bytes).map_err(|outside| match outside {
            OutOfRange::Below => AbortCode::VALUE_TOO_LOW,
            OutOfRange::Above => AbortCode::VALUE_TOO_HIGH,
        })?;
        self.application.check_write(self.dictionary, object, bytes)
    }
}

/// What CiA 301 (7.5.2) says of the objects of the communication profile.
///
/// # Errors
/// When a value is not to be written, or not now.
fn follows_rules(dictionary: &Dictionary, object: Object, bytes: &[u8]) -> Result<(), AbortCode> {
    if let Some(place) = Place::of(object) {
        return place.check_write(dictionary, object, bytes);
    }
    let Ok(value) = u32::try_from(number(bytes)) else { return Ok(()) };
    match object {
        Object::ERROR_HISTORY if value > 0 => Err(AbortCode::VALUE_INVALID),
        Object::SYNC_COB_ID => sync::may_listen(value),
        Object::SYNC_OVERFLOW => sync::may_count(dictionary, value),
        Object::TIME_COB_ID => clock::may_listen(dictionary.unsigned(object), value),
        Object::EMCY_COB_ID => may_change_cob_id(dictionary.unsigned(object), value),
        Object::STORE_PARAMETERS | Object::RESTORE_DEFAULTS => store::check_write(object, value),
        Object { index, .. } if index == Object::CONSUMER_HEARTBEAT.index => {
            heartbeat::may_watch(dictionary, object, value)
        }
        _ => Ok(()),
    }
}
