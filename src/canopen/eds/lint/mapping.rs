//! PDOs after power-up, or as a DCF configures them: free COB-IDs and valid mappings (CiA 301, 7.3.5, 7.5.2.35 to
//! 7.5.2.38).

use crate::data_type;
use crate::eds::eds_object::EdsObject;
use crate::eds::lint::Lint;
use crate::eds::value::{self, Number};
use crate::layout::Direction;
use crate::object::Object;

pub(super) fn check(lint: &mut Lint<'_>) {
    for described in lint.eds.objects() {
        if is_cob_id(described.object) {
            cob_id(lint, described);
        }
        if let Some(direction) = direction(described.object) {
            mapping(lint, described, direction);
        }
    }
}

/// Effective value of an object, from the DCF or its default, with its key.
fn effective(described: &EdsObject) -> Option<(Number, &'static str)> {
    let set = described
        .setting
        .value
        .as_ref()
        .and_then(|text| value::number(text, &data_type::find(described.data_type)?).ok());
    let default = || described.number.map(|number| (number, "DefaultValue"));
    set.map(|number| (number, "ParameterValue")).or_else(default)
}

const fn is_within(index: u16, first: u16) -> bool {
    first <= index && index < first + 512
}

/// Returns whether an object holds the COB-ID of a PDO, SYNC, TIME or EMCY.
fn is_cob_id(object: Object) -> bool {
    let is_pdo = is_within(object.index, Object::rpdo_communication(1, 1).index)
        || is_within(object.index, Object::tpdo_communication(1, 1).index);
    let others = [Object::SYNC_COB_ID, Object::TIME_COB_ID, Object::EMCY_COB_ID];
    (is_pdo && object.sub == 1) || others.contains(&object)
}

/// Restricted COB-IDs of NMT, SDO, heartbeat and LSS (CiA 301, 7.3.5).
const RESTRICTED: [(i128, i128); 8] = [
    (0x000, 0x000),
    (0x001, 0x07F),
    (0x101, 0x180),
    (0x581, 0x5FF),
    (0x601, 0x67F),
    (0x6E0, 0x6FF),
    (0x701, 0x77F),
    (0x780, 0x7FF),
];

/// Bit 31 of a COB-ID: the service is disabled. Bit 29: the identifier has 29 bits.
const INVALID: i128 = 1 << 31;
const EXTENDED: i128 = 1 << 29;

fn cob_id(lint: &mut Lint<'_>, described: &EdsObject) {
    let Some((number, key)) = effective(described) else { return };
    if number.value & (INVALID | EXTENDED) != 0 {
        return;
    }
    let spot = lint.spot(described.object, key);
    let identifier = number.value & 0x1FFF_FFFF;
    let (least, most) = if number.plus_node_id { (1, 127) } else { (0, 0) };
    let (first, last) = (identifier + least, identifier + most);
    let overlaps = |(low, high): &&(i128, i128)| first <= *high && *low <= last;
    if last > 0x7FF {
        lint.error(spot, format_args!("{last:X}h has more than 11 bits"));
    } else if let Some((low, high)) = RESTRICTED.iter().find(overlaps) {
        let first = first.max(*low);
        let range = format_args!("{low:03X}h to {high:03X}h (CiA 301, 7.3.5)");
        lint.error(spot, format_args!("{first:X}h is restricted: {range}"));
    }
}

/// Direction of the PDO with this mapping parameter.
fn direction(object: Object) -> Option<Direction> {
    let is = |first: Object| object.sub == 0 && is_within(object.index, first.index);
    if is(Object::rpdo_mapping(1, 0)) {
        Some(Direction::Receive)
    } else if is(Object::tpdo_mapping(1, 0)) {
        Some(Direction::Transmit)
    } else {
        None
    }
}

/// First index after the data types.
const FIRST_NO_TYPE: u16 = 0x20;

/// Maximum bits and entries of a PDO.
const BITS: u32 = 64;
const MAX_ENTRIES: u8 = 64;

fn mapping(lint: &mut Lint<'_>, count: &EdsObject, direction: Direction) {
    let Some((number, key)) = effective(count) else { return };
    let spot = lint.spot(count.object, key);
    let number = match u8::try_from(number.value) {
        Ok(number @ 0..=MAX_ENTRIES) => number,
        // FEh and FFh mark multiplexed PDOs.
        Ok(0xFE..) => return,
        Ok(_) | Err(_) => {
            lint.error(spot, format_args!("{} objects; a PDO holds at most 64", number.value));
            return;
        }
    };
    let mut bits = 0;
    for sub in 1..=number {
        let object = Object { sub, ..count.object };
        let Some(entry) = lint.eds.object(object) else {
            lint.error(spot, format_args!("{number} objects, but there is no {object}"));
            return;
        };
        let Some((entry, key)) = effective(entry) else { continue };
        let Ok(raw) = u32::try_from(entry.value) else { continue };
        let [length, ..] = raw.to_le_bytes();
        bits += u32::from(length);
        if let Err(reason) = is_mappable(lint, raw, direction) {
            lint.error(lint.spot(object, key), reason);
        }
    }
    if bits > BITS {
        lint.error(spot, format_args!("the mapped objects have {bits} bits; a PDO has 64"));
    }
}

/// Checks that a mapping entry names a mappable object with its length.
fn is_mappable(lint: &Lint<'_>, raw: u32, direction: Direction) -> Result<(), String> {
    let [length, sub, low, high] = raw.to_le_bytes();
    let object = Object { index: u16::from_le_bytes([low, high]), sub };
    if raw == 0 {
        return Err("maps nothing, but is counted".to_owned());
    }
    if object.index < FIRST_NO_TYPE {
        let is_dummy = direction == Direction::Receive && sub == 0 && lint.eds.dummy(object.index);
        if !is_dummy {
            return Err(format!(
                "maps dummy {:04X}h, which [DummyUsage] does not allow here",
                object.index
            ));
        }
    } else {
        let described = lint.eds.object(object);
        let described =
            described.ok_or_else(|| format!("maps {object}, which is not described"))?;
        let (suits, kind) = match direction {
            Direction::Receive => (described.access.is_output(), "an RPDO"),
            Direction::Transmit => (described.access.is_input(), "a TPDO"),
        };
        if !described.is_mappable {
            return Err(format!("maps {object}, whose PDOMapping is not 1"));
        }
        if !suits {
            return Err(format!("maps {object}, which by its AccessType cannot be in {kind}"));
        }
    }
    match lint.eds.bits_in_pdo(object) {
        Some(bits) if bits != length => {
            Err(format!("maps {length} bits of {object}, which has {bits}"))
        }
        Some(_) | None => Ok(()),
    }
}
