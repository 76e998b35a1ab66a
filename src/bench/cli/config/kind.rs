//! Kinds of TOML values that a merge does not exchange, and values that are the same although they are written differently.

use derive_more::Display;
use toml_edit::{InlineTable, Item, Value};

/// Kind of a value. Numbers are one kind: a configuration reads `6` as `6.0`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
pub(super) enum Kind {
    #[display("a number")]
    Number,
    #[display("a string")]
    Text,
    #[display("true or false")]
    Boolean,
    #[display("a date")]
    Date,
    #[display("a list")]
    List,
    #[display("a table")]
    Table,
    #[display("a list of tables")]
    Tables,
}

impl Kind {
    pub(super) const fn from_value(value: &Value) -> Self {
        match value {
            Value::String(_) => Self::Text,
            Value::Integer(_) | Value::Float(_) => Self::Number,
            Value::Boolean(_) => Self::Boolean,
            Value::Datetime(_) => Self::Date,
            Value::Array(_) => Self::List,
            Value::InlineTable(_) => Self::Table,
        }
    }

    pub(super) const fn from_item(item: &Item) -> Option<Self> {
        match item {
            Item::None => None,
            Item::Value(value) => Some(Self::from_value(value)),
            Item::Table(_) => Some(Self::Table),
            Item::ArrayOfTables(_) => Some(Self::Tables),
        }
    }
}

/// Returns whether two values are the same, however they are written: `6` and `6.0`, `0x10` and `16`.
pub(super) fn is_same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Integer(one), Value::Integer(other)) => one.value() == other.value(),
        (Value::Float(one), Value::Float(other)) => is_same_float(*one.value(), *other.value()),
        (Value::Integer(whole), Value::Float(float))
        | (Value::Float(float), Value::Integer(whole)) => i32::try_from(*whole.value())
            .is_ok_and(|whole| is_same_float(f64::from(whole), *float.value())),
        (Value::String(one), Value::String(other)) => one.value() == other.value(),
        (Value::Boolean(one), Value::Boolean(other)) => one.value() == other.value(),
        (Value::Datetime(one), Value::Datetime(other)) => one.value() == other.value(),
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len()
                && one.iter().zip(other.iter()).all(|(one, other)| is_same(one, other))
        }
        (Value::InlineTable(one), Value::InlineTable(other)) => is_same_table(one, other),
        (
            Value::String(_)
            | Value::Integer(_)
            | Value::Float(_)
            | Value::Boolean(_)
            | Value::Datetime(_)
            | Value::Array(_)
            | Value::InlineTable(_),
            _,
        ) => false,
    }
}

/// Compares bits: NaN is the same as NaN, 0.0 is not the same as -0.0.
fn is_same_float(one: f64, other: f64) -> bool {
    one.total_cmp(&other).is_eq()
}

fn is_same_table(one: &InlineTable, other: &InlineTable) -> bool {
    let has_same = |key: &str, value| other.get(key).is_some_and(|other| is_same(value, other));
    one.len() == other.len() && one.iter().all(|(key, value)| has_same(key, value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Value {
        text.parse().unwrap()
    }

    #[test]
    fn values_written_differently_are_the_same() {
        for (one, other) in [
            ("6", "6.0"),
            ("6.0", "6"),
            ("0x10", "16"),
            ("1_000", "1000"),
            ("'a'", "\"a\""),
            ("[1, 2.50]", "[ 1.0,2.5 ]"),
            ("{ a = 1, b = 2 }", "{b=2, a=1}"),
            ("nan", "nan"),
            ("true", "true"),
            ("2026-11-22", "2026-11-22"),
        ] {
            assert!(is_same(&value(one), &value(other)), "{one} {other}");
        }
        for (one, other) in [
            ("6", "6.1"),
            ("6", "'6'"),
            ("[1]", "[1, 2]"),
            ("[1]", "1"),
            ("{ a = 1 }", "{ b = 1 }"),
            ("0.0", "-0.0"),
            ("9007199254740993", "9007199254740992.0"),
            ("true", "false"),
        ] {
            assert!(!is_same(&value(one), &value(other)), "{one} {other}");
        }
    }

    #[test]
    fn whole_and_broken_numbers_are_one_kind() {
        let kind = |text: &str| Kind::from_value(&value(text));
        assert_eq!(kind("6"), kind("6.5"));
        assert_ne!(kind("6"), kind("'6'"));
        assert_eq!(kind("{}").to_string(), "a table");
    }
}
