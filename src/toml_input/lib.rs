//! TOML files: lists of an exact length, and the key at a position in the text.
//!
//! serde stops reading an array of fixed size after its last element, and `toml` does not check for more:
//! `[1, 2, 3, "x"]` would pass for three numbers. Sections use [`List`] instead of arrays.
//!
//! ```
//! use serde::Deserialize;
//! use toml_input::List;
//!
//! #[derive(Deserialize)]
//! struct Wall { point_m: List<f64, 3> }
//!
//! let wall: Wall = toml::from_str("point_m = [0.1, 0.2, 0.3]").unwrap();
//! assert_eq!(wall.point_m.0[2], 0.3);
//! assert!(toml::from_str::<Wall>("point_m = [0.1, 0.2, 0.3, 0.4]").is_err());
//! ```
#![forbid(unsafe_code)]

use std::fmt;
use std::marker::PhantomData;
use std::ops::Range;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use toml::Value;
use toml::de::{DeArray, DeTable, DeValue};

/// A list of exactly `N` elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct List<T, const N: usize>(pub [T; N]);

impl<T: Copy + Default, const N: usize> Default for List<T, N> {
    fn default() -> Self {
        Self([T::default(); N])
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for List<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Elements(PhantomData))
    }
}

impl<T: Serialize, const N: usize> Serialize for List<T, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(&self.0)
    }
}

struct Elements<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for Elements<T, N> {
    type Value = List<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {N}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut elements = Vec::with_capacity(N);
        while elements.len() < N
            && let Some(element) = list.next_element()?
        {
            elements.push(element);
        }
        let mut found = elements.len();
        while list.next_element::<Value>()?.is_some() {
            found += 1;
        }
        let wrong = || A::Error::custom(format_args!("must be a list of {N}, got {found}"));
        if found > N {
            return Err(wrong());
        }
        elements.try_into().map(List).map_err(|_| wrong())
    }
}

/// Returns the message of an error, in one line and without names of Rust types. That of a key written twice names the
/// key.
pub fn message(text: &str, error: &toml::de::Error) -> String {
    one_line(text, error.message(), error.span())
}

/// As [`message`], of an error of the same parser by another crate: its message, and its place in the text.
pub fn one_line(text: &str, message: &str, place: Option<Range<usize>>) -> String {
    let message = in_words(message.replace('\n', " "));
    let key = place.and_then(|place| text.get(place)).filter(|key| !key.is_empty());
    match key.filter(|_| message == DUPLICATE) {
        Some(key) => format!("{message} `{key}`"),
        None => message,
    }
}

/// Message of the `toml` crate for a key written twice.
const DUPLICATE: &str = "duplicate key";

/// Replaces the name of a type at the end of a message.
fn in_words(message: String) -> String {
    let Some((before, wanted)) = message.rsplit_once(EXPECTED) else { return message };
    let words = match wanted {
        "f64" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" => "a whole number from 0 to 65535",
        "u32" => "a whole number from 0 to 4294967295",
        "u64" | "usize" => "a whole number, 0 or above",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "a map" => "a table",
        _ if wanted.starts_with("struct ") => "a table",
        _ => return message,
    };
    format!("{before}{EXPECTED}{words}")
}

/// Part of a message before what is expected.
const EXPECTED: &str = ", expected ";

/// Returns the key, as `joint[2].torque_curve`, of the innermost value at a byte offset; empty outside all values.
pub fn key_at(text: &str, offset: usize) -> String {
    let mut key = String::new();
    if let Ok(document) = DeTable::parse(text) {
        in_table(document.get_ref(), offset, &mut key);
    }
    key
}

fn in_table(table: &DeTable<'_>, offset: usize, key: &mut String) {
    // A table under a header spans its header alone, so the nested values are searched first.
    for (name, value) in table {
        let before = key.len();
        let dot = if key.is_empty() { "" } else { "." };
        key.push_str(&format!("{dot}{}", name.get_ref()));
        if in_value(value.get_ref(), offset, key) || value.span().contains(&offset) {
            return;
        }
        key.truncate(before);
    }
}

/// Returns whether the offset is in a nested value.
fn in_value(value: &DeValue<'_>, offset: usize, key: &mut String) -> bool {
    let before = key.len();
    match value {
        DeValue::Table(table) => in_table(table, offset, key),
        DeValue::Array(array) => in_array(array, offset, key),
        DeValue::String(_)
        | DeValue::Integer(_)
        | DeValue::Float(_)
        | DeValue::Boolean(_)
        | DeValue::Datetime(_) => {}
    }
    key.len() > before
}

/// Tables and lists in a list have keys of their own; other elements have that of the list.
fn in_array(array: &DeArray<'_>, offset: usize, key: &mut String) {
    for (place, value) in array.iter().enumerate() {
        let before = key.len();
        let is_nested = matches!(value.get_ref(), DeValue::Table(_) | DeValue::Array(_));
        key.push_str(&format!("[{place}]"));
        if in_value(value.get_ref(), offset, key) || is_nested && value.span().contains(&offset) {
            return;
        }
        key.truncate(before);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Section {
        three: List<f64, 3>,
        rows: Option<List<List<f64, 2>, 2>>,
    }

    fn read(text: &str) -> Result<Section, String> {
        toml::from_str(text).map_err(|error: toml::de::Error| error.message().to_owned())
    }

    #[test]
    fn list_of_its_length_is_read() {
        let section = read("three = [1, 2.5, -3]\nrows = [[1, 2], [3, 4]]").unwrap();
        assert_eq!(section.three, List([1.0, 2.5, -3.0]));
        assert_eq!(section.rows.unwrap().0[1], List([3.0, 4.0]));
    }

    #[test]
    fn list_of_another_length_is_refused_with_both() {
        for (list, found) in
            [("[]", 0), ("[1, 2]", 2), ("[1, 2, 3, 4]", 4), ("[1, 2, 3, \"x\", nan, [1]]", 6)]
        {
            let refused = read(&format!("three = {list}")).unwrap_err();
            assert_eq!(refused, format!("must be a list of 3, got {found}"));
        }
        let refused = read("three = [1, 2, 3]\nrows = [[1, 2], [3, 4, 5]]").unwrap_err();
        assert_eq!(refused, "must be a list of 2, got 3");
        assert!(read("three = [1, \"x\", 3]").unwrap_err().contains("invalid type"));
        assert!(read("three = 1").unwrap_err().contains("a list of 3"));
    }

    #[test]
    fn key_written_twice_is_named() {
        for (text, key) in [("a = 1\nb = 2\na = 3", "a"), ("[x]\n\"y z\" = 1\n'y z' = 2", "'y z'")]
        {
            let error = DeTable::parse(text).unwrap_err();
            assert_eq!(message(text, &error), format!("duplicate key `{key}`"));
        }
        let text = "[x]\n[x]";
        assert!(message(text, &DeTable::parse(text).unwrap_err()).contains('x'));
    }

    #[test]
    fn types_are_named_in_words() {
        for (text, words) in [
            ("three = [1, \"x\", 3]", "invalid type: string \"x\", expected a number"),
            ("three = [1, 2, 3]\nrows = 7", "invalid type: integer `7`, expected a list of 2"),
        ] {
            let error = toml::from_str::<Section>(text).unwrap_err();
            assert_eq!(message(text, &error), words);
        }
        let of = |wanted: &str| in_words(format!("invalid type: a, expected b, expected {wanted}"));
        assert_eq!(of("struct Node"), of("a map"));
        assert!(of("u8").ends_with(", expected b, expected a whole number from 0 to 255"));
        assert_eq!(of("a string"), "invalid type: a, expected b, expected a string");
    }

    #[test]
    fn key_of_a_place_is_that_of_the_innermost_value() {
        let text = "[node]\na = 1\n\n[[joint]]\nb = 2\n[[joint]]\nc = [1,\n 2]\nd = [[1], [2]]\n";
        let at = |part: &str| key_at(text, text.find(part).unwrap());
        assert_eq!((at("1\n\n").as_str(), at("2\n[[").as_str()), ("node.a", "joint[0].b"));
        assert_eq!((at("2]").as_str(), at("[2]").as_str()), ("joint[1].c", "joint[1].d[1]"));
        assert_eq!((key_at(text, 9_999), key_at("[", 0)), (String::new(), String::new()));
    }
}
