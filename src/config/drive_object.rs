//! Objects of a drive that keys of the configuration name, with values of their data types in the EDS.

use crate::problem::Problems;
use crate::value::Value;
use canopen::data_type;
use canopen::eds::Eds;
use canopen::object::Object;

/// Value of an SDO download.
pub(crate) type Content = canopen::Value;

/// Object and value of one SDO download.
pub(crate) type ObjectWrite = (Object, Content);

/// Reads an object, which must be writable by the EDS, and a value, which must fit its data type.
pub(super) fn read<const NEEDED: bool>(
    object: &Value<String, NEEDED>,
    value: &Value<i64, NEEDED>,
    eds: Option<&Eds>,
    problems: &mut Problems<'_>,
) -> Option<ObjectWrite> {
    let named = object.as_ref().map(|text| text.parse::<Object>());
    let named = named.and_then(|named| problems.take(object, named))?;
    let (eds, number) = (eds?, value.get()?);
    let Some(described) = eds.object(named) else {
        problems.add(object, format_args!("{named} is not in its EDS"));
        return None;
    };
    if !described.access.is_writable() {
        problems.add(object, format_args!("{named} cannot be written, by its EDS"));
        return None;
    }
    let Some(content) = content(described.data_type, number) else {
        let name = data_type::find(described.data_type).map_or("of an unknown type", |it| it.name);
        problems.add(value, format_args!("{named} is {name} in its EDS, got {number}"));
        return None;
    };
    Some((named, content))
}

/// Returns a number as a value of a data type; `None` if the type cannot hold it.
fn content(data_type: u16, number: i64) -> Option<Content> {
    Some(match data_type {
        0x01 => Content::Boolean(matches!(u8::try_from(number).ok()?, 1)),
        0x02 => Content::Integer8(number.try_into().ok()?),
        0x03 => Content::Integer16(number.try_into().ok()?),
        0x04 => Content::Integer32(number.try_into().ok()?),
        0x05 => Content::Unsigned8(number.try_into().ok()?),
        0x06 => Content::Unsigned16(number.try_into().ok()?),
        0x07 => Content::Unsigned32(number.try_into().ok()?),
        0x15 => Content::Integer64(number),
        0x1B => Content::Unsigned64(number.try_into().ok()?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_is_a_value_of_the_type_or_none() {
        assert_eq!(content(0x06, 65_535), Some(Content::Unsigned16(65_535)));
        assert_eq!(content(0x06, 65_536), None);
        assert_eq!(content(0x03, -2), Some(Content::Integer16(-2)));
        assert_eq!(content(0x05, -1), None);
        assert_eq!(content(0x08, 1), None, "REAL32");
        assert_eq!(content(0x07, 4_294_967_295), Some(Content::Unsigned32(u32::MAX)));
    }
}
