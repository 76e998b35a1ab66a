//! Parts of a JSON object from a node. A part that is absent or of another type is `None`, not an error.

use serde_json::Value;

use super::text::clean;

/// Maximum length of a text that is shown, in characters.
const MAX_TEXT: usize = 600;

/// Replaces an absent value.
static ABSENT: Value = Value::Null;

/// Returns the value at a path of keys; `Null` if it is absent.
pub(super) fn at<'a>(value: &'a Value, path: &[&str]) -> &'a Value {
    path.iter().try_fold(value, |value, key| value.get(key)).unwrap_or(&ABSENT)
}

/// Returns the element at a place of a list; `Null` if it is absent.
pub(super) fn nth(list: &Value, place: usize) -> &Value {
    list.get(place).unwrap_or(&ABSENT)
}

/// Returns the elements of a list; empty for any other value.
pub(super) fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

/// Returns the value as a finite number; `None` for any other value.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.is_finite())
}

/// Returns the numbers at places of a list.
pub(super) fn numbers<const N: usize>(list: &Value) -> [Option<f64>; N] {
    std::array::from_fn(|place| number(nth(list, place)))
}

/// Returns the value as a text without control characters of terminals; `None` if empty or not a text.
pub(super) fn text(value: &Value) -> Option<String> {
    let text = clean(value.as_str()?, MAX_TEXT);
    Some(text).filter(|text| !text.is_empty())
}

/// Returns the length of a vector; `None` if one of its components is absent.
pub(super) fn magnitude(vector: &[Option<f64>]) -> Option<f64> {
    let squares = vector.iter().map(|component| component.map(|it| it * it));
    squares.sum::<Option<f64>>().map(f64::sqrt).filter(|length| length.is_finite())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn value_of_another_type_is_absent() {
        let value = json!({ "a": { "b": [1.5, null, "x"] }, "c": 7, "d": "\u{1b}" });
        assert_eq!(numbers(at(&value, &["a", "b"])), [Some(1.5), None, None, None]);
        for path in [&["a", "b", "c"][..], &["c", "d"], &["x"]] {
            assert!(at(&value, path).is_null(), "{path:?}");
        }
        assert!(list(at(&value, &["c"])).is_empty());
        assert_eq!(text(at(&value, &["c"])), None);
        assert_eq!(text(at(&value, &["d"])), Some("\u{fffd}".to_owned()));
    }

    #[test]
    fn magnitude_needs_every_component() {
        assert_eq!(magnitude(&[Some(3.0), Some(4.0)]), Some(5.0));
        assert_eq!(magnitude(&[Some(3.0), None]), None);
        assert_eq!(magnitude(&[Some(1e300), Some(1.0)]), None);
    }
}
