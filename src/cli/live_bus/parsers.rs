//! Parsers of node-ids, objects and numbers on the command line.

use canopen::NodeId;
use canopen::object::Object;
use canopen::value::numeral::{hexadecimal, whole};

/// Parses a node-id: `3`, `0x10`, `10h`.
pub(crate) fn node(text: &str) -> Result<NodeId, String> {
    let raw = whole(text).and_then(|number| u8::try_from(number).ok());
    let node = raw.and_then(|raw| NodeId::new(raw).ok());
    node.ok_or_else(|| "node-id must be within 1..=127".to_owned())
}

/// Parses a node-id; `None` for `all`.
pub(crate) fn node_or_all(text: &str) -> Result<Option<NodeId>, String> {
    if text == "all" { Ok(None) } else { node(text).map(Some) }
}

/// Parses a node-id; `None` for `none` and 255.
pub(crate) fn node_or_none(text: &str) -> Result<Option<NodeId>, String> {
    if text == "none" || whole(text) == Some(255) { Ok(None) } else { node(text).map(Some) }
}

/// Parses node-ids such as `1-16,32`; returns them sorted without duplicates.
pub(crate) fn nodes(text: &str) -> Result<Vec<NodeId>, String> {
    let mut nodes = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (node(first)?, node(last)?);
        if first > last {
            return Err("the first node-id of a range must not exceed the last, as 1-16".to_owned());
        }
        nodes.extend((first.raw()..=last.raw()).filter_map(|raw| NodeId::new(raw).ok()));
    }
    nodes.sort();
    nodes.dedup();
    Ok(nodes)
}

/// Parses an object. The index is hexadecimal: `6041`, `0x6041`, `6041h`. The sub-index defaults to 0; it is decimal
/// or as `0x1F` in `6041:0`, hexadecimal in the EDS notation `1A00sub1`.
pub(crate) fn object(text: &str) -> Result<Object, String> {
    let wrong = || "expected INDEX or INDEX:SUB, as 6041 or 1018:4".to_owned();
    let lower = text.to_ascii_lowercase();
    let (index, sub) = match (lower.split_once(':'), lower.split_once("sub")) {
        (Some((index, sub)), _) => (index, whole(sub).ok_or_else(wrong)?),
        (None, Some((index, sub))) => (index, hexadecimal(sub).ok_or_else(wrong)?),
        (None, None) => (lower.as_str(), 0),
    };
    let bare = index.strip_prefix("0x").unwrap_or(index.strip_suffix('h').unwrap_or(index));
    let index = hexadecimal(bare).and_then(|index| u16::try_from(index).ok());
    let index = index.ok_or_else(wrong)?;
    Ok(Object { index, sub: u8::try_from(sub).map_err(|_| wrong())? })
}

/// Parses a duration in s, above 0 and at most a day.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && *seconds <= 86_400.0);
    seconds.ok_or_else(|| "must be a number above 0 and at most 86400".to_owned())
}

/// Parses an unsigned 32-bit number: `7`, `0x402`, `402h`.
pub(crate) fn number(text: &str) -> Result<u32, String> {
    let number = whole(text).and_then(|number| u32::try_from(number).ok());
    number.ok_or_else(|| "must be an unsigned 32-bit number".to_owned())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn object_notations_are_equivalent() {
        for (text, index, sub) in [
            ("6041", 0x6041, 0),
            ("0x6041", 0x6041, 0),
            ("6041h", 0x6041, 0),
            ("6041H:0", 0x6041, 0),
            ("1018:4", 0x1018, 4),
            ("1018h:4", 0x1018, 4),
            ("0x1A00:0x1F", 0x1A00, 31),
            ("1a00:10", 0x1A00, 10),
            ("1A00sub1", 0x1A00, 1),
            ("1A00subA", 0x1A00, 10),
            ("1003:1Fh", 0x1003, 31),
        ] {
            assert_eq!(object(text), Ok(Object { index, sub }), "{text}");
        }
        for text in [
            "",
            ":",
            "6041:",
            "6041:256",
            "16041",
            "604G",
            "+6041",
            "1A00sub",
            "1A00sub1FF",
            "6041:-1",
        ] {
            assert!(object(text).is_err(), "{text}");
        }
    }

    #[test]
    fn node_ids_are_1_to_127() {
        assert_eq!(node("0x10"), node("16"));
        for text in ["0", "128", "-1", "", "x", "all"] {
            assert!(node(text).is_err(), "{text}");
        }
        assert_eq!((node_or_all("all"), node_or_none("none")), (Ok(None), Ok(None)));
        let raw = |text| nodes(text).map(|nodes| nodes.into_iter().map(NodeId::raw).collect());
        assert_eq!(raw("5,1-3,2"), Ok(vec![1, 2, 3, 5]));
        assert!(nodes("3-1").is_err() && nodes("").is_err() && nodes("0-5").is_err());
    }

    #[test]
    fn seconds_are_above_zero_and_at_most_a_day() {
        assert_eq!([seconds("0.5"), seconds("86400")], [Ok(0.5), Ok(86_400.0)]);
        for text in ["-1", "0", "-0.0", "nan", "inf", "-inf", "1e300", "86400.1", "", "x"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn any_text_parses_or_fails_and_objects_round_trip(text in "\\PC{0,12}|[0-9a-fhxsub:]{0,12}") {
            if let Ok(found) = object(&text) {
                prop_assert_eq!(object(&found.to_string()), Ok(found));
            }
            node(&text).ok();
            nodes(&text).ok();
        }
    }
}
