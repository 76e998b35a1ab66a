//! Keys of one `[[fault]]`: read one by one, each checked, none left over.

use std::collections::BTreeMap;
use std::ops::{Range, RangeInclusive};

use toml::{Spanned, Value};

use crate::scenario::problem::{Misplaced, Problem, within};

/// A table of a file.
pub(super) type Entry = BTreeMap<String, Spanned<Value>>;

/// Keys of a table not read yet.
#[derive(Debug)]
pub(super) struct Keys {
    kind: String,
    span: Range<usize>,
    left: Entry,
}

impl Keys {
    /// Reads `kind`; returns it with the other keys.
    pub(super) fn of(entry: Spanned<Entry>) -> Result<(String, Self), Misplaced> {
        let span = entry.span();
        let mut keys = Self { kind: "fault".to_owned(), span, left: entry.into_inner() };
        let kind = keys.word("kind", "a word", |word| Some(word.to_owned()))?;
        keys.kind = keys.needed("kind", kind)?;
        Ok((keys.kind.clone(), keys))
    }

    /// Returns a problem with the span of the table.
    pub(super) fn misplaced(&self, problem: Problem) -> Misplaced {
        (self.span.clone(), problem)
    }

    /// Reads a key if it is present; `read` decodes its value, and `wanted` names the values allowed.
    pub(super) fn value<T>(
        &mut self,
        key: &'static str,
        wanted: &'static str,
        read: impl Fn(&Value) -> Option<T>,
    ) -> Result<Option<T>, Misplaced> {
        let Some(value) = self.left.remove(key) else { return Ok(None) };
        let decoded = read(value.get_ref()).map(Some);
        decoded.ok_or_else(|| {
            let given = value.get_ref().to_string().replace('\n', " ");
            (value.span(), Problem::Value { key, value: given, wanted })
        })
    }

    /// Reads a number within bounds, if the key is present.
    pub(super) fn number(
        &mut self,
        key: &'static str,
        bounds: RangeInclusive<f64>,
    ) -> Result<Option<f64>, Misplaced> {
        let span = self.left.get(key).map(Spanned::span).unwrap_or_default();
        let Some(number) = self.value(key, "a number", number)? else { return Ok(None) };
        within(key, number, *bounds.start(), *bounds.end()).map_err(|problem| (span, problem))?;
        Ok(Some(number))
    }

    /// Reads any number, NaN and infinities among them; the key is required.
    pub(super) fn any_number(&mut self, key: &'static str) -> Result<f64, Misplaced> {
        let value = self.value(key, "a number", number)?;
        self.needed(key, value)
    }

    /// Reads an integer in the range of `T`, if the key is present.
    pub(super) fn whole<T: TryFrom<i64>>(
        &mut self,
        key: &'static str,
        wanted: &'static str,
        is_wanted: impl Fn(&T) -> bool,
    ) -> Result<Option<T>, Misplaced> {
        self.value(key, wanted, |value| {
            T::try_from(value.as_integer()?).ok().filter(|number| is_wanted(number))
        })
    }

    /// Reads a word, if the key is present.
    pub(super) fn word<T>(
        &mut self,
        key: &'static str,
        wanted: &'static str,
        read: impl Fn(&str) -> Option<T>,
    ) -> Result<Option<T>, Misplaced> {
        self.value(key, wanted, |value| read(value.as_str()?))
    }

    /// Reads up to eight bytes in hexadecimal, if the key is present.
    pub(super) fn bytes(&mut self, key: &'static str) -> Result<Option<Vec<u8>>, Misplaced> {
        self.word(key, "up to 8 bytes as two hexadecimal digits each", bytes)
    }

    /// Checks that a required key is present.
    pub(super) fn needed<T>(&self, key: &'static str, value: Option<T>) -> Result<T, Misplaced> {
        let missing = || self.misplaced(Problem::Missing { kind: self.kind.clone(), key });
        value.ok_or_else(missing)
    }

    /// Checks that no other key is present.
    pub(super) fn end(self) -> Result<(), Misplaced> {
        let Self { kind, mut left, .. } = self;
        match left.pop_first() {
            Some((key, value)) => Err((value.span(), Problem::Unrelated { kind, key })),
            None => Ok(()),
        }
    }
}

fn number(value: &Value) -> Option<f64> {
    let whole = || i32::try_from(value.as_integer()?).ok().map(f64::from);
    value.as_float().or_else(whole)
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let is_whole = digits.is_ascii() && digits.len().is_multiple_of(2) && digits.len() <= 16;
    let byte = |place: usize| {
        let two = digits.get(place..place + 2)?;
        let is_hexadecimal = two.bytes().all(|digit| digit.is_ascii_hexdigit());
        u8::from_str_radix(two, 16).ok().filter(|_| is_hexadecimal)
    };
    is_whole.then(|| (0..digits.len()).step_by(2).map(byte).collect())?
}
