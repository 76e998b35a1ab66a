//! Keys of one `[[fault]]`, each described once for reading and writing; unknown keys are errors.

use std::collections::BTreeMap;
use std::ops::{Range, RangeInclusive};

use toml::{Spanned, Value};

use crate::scenario::problem::{LocatedProblem, Problem, within};

/// Table of a file.
pub(super) type Entry = BTreeMap<String, Spanned<Value>>;

/// Keys as they are written, in order.
pub(super) type KeyList = Vec<(&'static str, Value)>;

/// Key of a fault, read and written. It is required unless it has a default, or another key in its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key<T: 'static> {
    name: &'static str,
    form: Form<T>,
    default: Option<T>,
    other: Option<&'static Self>,
}

/// Form of a value.
#[derive(Clone, Copy, Debug)]
enum Form<T: 'static> {
    /// One of these words; the first field names them.
    Words(&'static str, &'static [(&'static str, T)]),
    /// Functions that read it, and write it if this key can have it.
    Value(fn(&KeyValue<'_>) -> Result<T, Problem>, fn(T) -> Option<Value>),
}

/// Keys of a table not read yet.
#[derive(Debug)]
pub(super) struct Keys {
    kind: String,
    span: Range<usize>,
    left: Entry,
}

impl<T: Copy + PartialEq> Key<T> {
    /// Returns a key with functions that read and write its value.
    pub(super) const fn new(
        name: &'static str,
        decode: fn(&KeyValue<'_>) -> Result<T, Problem>,
        encode: fn(T) -> Option<Value>,
    ) -> Self {
        Self { name, form: Form::Value(decode, encode), default: None, other: None }
    }

    /// Returns a key whose value is a word; `wanted` names the words.
    pub(super) const fn words(
        name: &'static str,
        wanted: &'static str,
        words: &'static [(&'static str, T)],
    ) -> Self {
        Self { name, form: Form::Words(wanted, words), default: None, other: None }
    }

    /// Makes the key optional: absent, it has this value.
    pub(super) const fn or(self, default: T) -> Self {
        Self { default: Some(default), ..self }
    }

    /// Returns the key with another one that is read if it is absent.
    pub(super) const fn or_else(self, other: &'static Self) -> Self {
        Self { other: Some(other), ..self }
    }

    /// Reads the value.
    pub(super) fn read(&self, keys: &mut Keys) -> Result<T, LocatedProblem> {
        let value = keys.value(self.name, |it| match self.form {
            Form::Value(decode, _) => decode(it),
            Form::Words(wanted, words) => it.word(wanted, |word| {
                words.iter().find(|(name, _)| *name == word).map(|(_, value)| *value)
            }),
        })?;
        match (value, self.other) {
            (None, Some(other)) => other.read(keys),
            _ => keys.needed(self.name, value.or(self.default)),
        }
    }

    /// Writes the value.
    pub(super) fn write(&self, value: T, to: &mut KeyList) {
        let encoded = match self.form {
            Form::Value(_, encode) => encode(value),
            Form::Words(_, words) => {
                words.iter().find(|(_, one)| *one == value).map(|(name, _)| (*name).into())
            }
        };
        to.extend(encoded.map(|encoded| (self.name, encoded)));
        self.other.iter().for_each(|other| other.write(value, to));
    }
}

impl Keys {
    /// Reads `kind`; returns it with the other keys.
    pub(super) fn from_entry(entry: Spanned<Entry>) -> Result<(String, Self), LocatedProblem> {
        let span = entry.span();
        let mut keys = Self { kind: "fault".to_owned(), span, left: entry.into_inner() };
        let kind = keys.value("kind", |it| it.word("a word", |word| Some(word.to_owned())))?;
        keys.kind = keys.needed("kind", kind)?;
        Ok((keys.kind.clone(), keys))
    }

    /// Returns a problem with the span of the table.
    pub(super) fn misplaced(&self, problem: Problem) -> LocatedProblem {
        (self.span.clone(), problem)
    }

    /// Reads a key if it is present.
    pub(super) fn value<T>(
        &mut self,
        key: &'static str,
        decode: impl Fn(&KeyValue<'_>) -> Result<T, Problem>,
    ) -> Result<Option<T>, LocatedProblem> {
        let Some(value) = self.left.remove(key) else { return Ok(None) };
        let decoded = decode(&KeyValue { key, value: value.get_ref() });
        decoded.map(Some).map_err(|problem| (value.span(), problem))
    }

    /// Checks that a required key is present.
    pub(super) fn needed<T>(
        &self,
        key: &'static str,
        value: Option<T>,
    ) -> Result<T, LocatedProblem> {
        let missing = || self.misplaced(Problem::Missing { kind: self.kind.clone(), key });
        value.ok_or_else(missing)
    }

    /// Checks that no other key is present.
    pub(super) fn end(self) -> Result<(), LocatedProblem> {
        let Self { kind, mut left, .. } = self;
        match left.pop_first() {
            Some((key, value)) => Err((value.span(), Problem::Unrelated { kind, key })),
            None => Ok(()),
        }
    }
}

/// Key as given, with its value.
#[derive(Debug)]
pub(super) struct KeyValue<'a> {
    key: &'static str,
    value: &'a Value,
}

impl KeyValue<'_> {
    /// Reads any value by `decode`; `wanted` names the values allowed.
    pub(super) fn any<T>(
        &self,
        wanted: &'static str,
        decode: impl Fn(&Value) -> Option<T>,
    ) -> Result<T, Problem> {
        let given = || self.value.to_string().replace('\n', " ");
        let invalid = || Problem::Value { key: self.key, value: given(), wanted };
        decode(self.value).ok_or_else(invalid)
    }

    /// Reads a number within bounds.
    pub(super) fn number(&self, bounds: RangeInclusive<f64>) -> Result<f64, Problem> {
        let number = self.any_number()?;
        within(self.key, number, *bounds.start(), *bounds.end()).map(|()| number)
    }

    /// Reads any number, NaN and infinities among them.
    pub(super) fn any_number(&self) -> Result<f64, Problem> {
        self.any("a number", |value| {
            let whole = || i32::try_from(value.as_integer()?).ok().map(f64::from);
            value.as_float().or_else(whole)
        })
    }

    /// Reads an integer within bounds.
    pub(super) fn whole<T: TryFrom<i64> + PartialOrd>(
        &self,
        wanted: &'static str,
        bounds: RangeInclusive<T>,
    ) -> Result<T, Problem> {
        let whole = |value: &Value| T::try_from(value.as_integer()?).ok();
        self.any(wanted, |value| whole(value).filter(|whole| bounds.contains(whole)))
    }

    /// Reads a word.
    pub(super) fn word<T>(
        &self,
        wanted: &'static str,
        decode: impl Fn(&str) -> Option<T>,
    ) -> Result<T, Problem> {
        self.any(wanted, |value| decode(value.as_str()?))
    }

    /// Reads up to eight bytes in hexadecimal.
    pub(super) fn bytes(&self) -> Result<Vec<u8>, Problem> {
        self.word("up to 8 bytes as two hexadecimal digits each", bytes)
    }
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
