//! Reads the sections of a configuration file, key by key. Every key that is missing, unknown or of the wrong type is
//! noted as a problem; none suppresses others.

use std::fmt;
use std::ops::Deref;

use serde::de::{DeserializeOwned, IgnoredAny, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

use crate::problem::Problems;
use crate::value::{HasPlace, Place, Value};

/// Former keys and their present names.
const RENAMED: [(&str, &str); 4] = [
    ("controller.engagement.calm_n", "wait_below_n"),
    ("controller.engagement.calm_nm", "wait_below_nm"),
    ("controller.passivity.calm_n", "contact_threshold_n"),
    ("controller.passivity.calm_s", "contact_release_s"),
];

/// Declares one struct per section, with one field per key.
#[macro_export]
macro_rules! sections {
    ($($(#[$about:meta])* $name:ident { $($key:ident: $of:ty,)* })*) => { $(
        $(#[$about])*
        #[derive(Debug)]
        pub(super) struct $name {
            place: $crate::value::Place,
            $(pub(super) $key: $of,)*
        }

        impl $crate::section::Section for $name {
            const NAME: &'static str = concat!("struct ", stringify!($name));

            fn from_table(
                table: &$crate::section::Table<'_>,
                problems: &mut $crate::problem::Problems<'_>,
            ) -> Self {
                table.note_unknown(&[$(stringify!($key)),*], problems);
                Self {
                    place: $crate::value::HasPlace::place(table).clone(),
                    $($key: $crate::section::Entry::read(table, stringify!($key), problems),)*
                }
            }
        }

        impl $crate::section::Entry for $name {
            fn read(
                table: &$crate::section::Table<'_>,
                key: &str,
                problems: &mut $crate::problem::Problems<'_>,
            ) -> Self {
                table.section(key, problems)
            }
        }

        impl $crate::value::HasPlace for $name {
            fn place(&self) -> &$crate::value::Place {
                &self.place
            }
        }
    )* };
}
pub use sections;

/// Keys of one table.
pub trait Section: HasPlace + Sized {
    /// Expected type in the message about a value that is not a table.
    const NAME: &'static str;

    /// Reads all keys of the table.
    fn from_table(table: &Table<'_>, problems: &mut Problems<'_>) -> Self;
}

/// Value or section at a key.
pub trait Entry: Sized {
    /// Reads `key` of `table`. Notes an entry that is missing or of another type.
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self;
}

/// Table of the file; without entries if the table was noted as a problem.
#[derive(Debug)]
pub struct Table<'d> {
    place: Place,
    /// First line of the table, at which missing keys are reported.
    line: Option<usize>,
    entries: Option<&'d DeTable<'d>>,
}

impl<'d> Table<'d> {
    /// Returns the table at the root of a document, whose key is empty.
    pub fn root(document: &'d Spanned<DeTable<'d>>, problems: &Problems<'_>) -> Self {
        let line = problems.line_at(document.span().start);
        let place = Place::new(String::new(), None);
        Self { place, line, entries: Some(document.get_ref()) }
    }

    /// Returns a table without entries, for a value that was noted as a problem.
    const fn noted(place: Place) -> Self {
        Self { line: place.line(), place, entries: None }
    }

    /// Returns `value` as a table. A value of another type is noted as a problem.
    fn at<T: Section>(
        place: Place,
        value: &'d Spanned<DeValue<'d>>,
        problems: &mut Problems<'_>,
    ) -> Self {
        if let DeValue::Table(entries) = value.get_ref() {
            return Self { line: place.line(), place, entries: Some(entries) };
        }
        let value = ValueDeserializer::from(value.clone());
        if let Err(error) = value.deserialize_struct("", &[], TableVisitor(T::NAME)) {
            problems.add_error_at(&place, &error);
        }
        Self::noted(place)
    }

    fn find(&self, key: &str) -> Option<&'d Spanned<DeValue<'d>>> {
        self.entries?.get(bare(key))
    }

    /// Returns the place of `key`, or of its table if `key` is absent.
    fn place_of(&self, key: &str, problems: &Problems<'_>) -> Place {
        let found = self.find(key).map(|value| problems.line_at(value.span().start));
        let dot = if self.place.key().is_empty() { "" } else { "." };
        let key = format!("{}{dot}{}", self.place.key(), bare(key));
        Place::new(key, found.unwrap_or_else(|| self.place.line()))
    }

    fn note_missing(&self, key: &str, problems: &mut Problems<'_>) {
        if self.entries.is_some() && !self.has_former_name_of(key) {
            // A missing key is reported at the first line of its table.
            let table = Place::new(String::new(), self.line);
            problems.add(&table, format_args!("missing field `{}`", bare(key)));
        }
    }

    /// Returns whether the table has `key` under its former name, which `note_unknown` reports.
    fn has_former_name_of(&self, key: &str) -> bool {
        RENAMED.iter().filter(|(_, now)| *now == bare(key)).any(|(before, _)| {
            let before =
                before.strip_prefix(self.place.key()).and_then(|rest| rest.strip_prefix('.'));
            before.is_some_and(|before| self.find(before).is_some())
        })
    }

    /// Reports every key that is not in `known`; a renamed one with its new name.
    pub fn note_unknown(&self, known: &[&str], problems: &mut Problems<'_>) {
        for key in self.entries.into_iter().flat_map(DeTable::keys) {
            let key = key.get_ref();
            if !known.iter().any(|known| bare(known) == key) {
                let place = self.place_of(key, problems);
                match RENAMED.iter().find(|(before, _)| *before == place.key()) {
                    Some((_, now)) => problems.add(&place, format_args!("was renamed to {now}")),
                    None => problems.add(&place, "unknown key"),
                }
            }
        }
    }

    /// Reads the required section at `key`.
    pub fn section<T: Section>(&self, key: &str, problems: &mut Problems<'_>) -> T {
        self.optional(key, problems).unwrap_or_else(|| {
            self.note_missing(key, problems);
            T::from_table(&Self::noted(self.place_of(key, problems)), problems)
        })
    }

    fn optional<T: Section>(&self, key: &str, problems: &mut Problems<'_>) -> Option<T> {
        let value = self.find(key)?;
        let table = Table::at::<T>(self.place_of(key, problems), value, problems);
        Some(T::from_table(&table, problems))
    }
}

impl HasPlace for Table<'_> {
    fn place(&self) -> &Place {
        &self.place
    }
}

/// Returns the key of a field name, without the prefix of raw identifiers.
fn bare(key: &str) -> &str {
    key.strip_prefix("r#").unwrap_or(key)
}

impl<T: DeserializeOwned, const NEEDED: bool> Entry for Value<T, NEEDED> {
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self {
        let place = table.place_of(key, problems);
        let Some(value) = table.find(key) else {
            if NEEDED {
                table.note_missing(key, problems);
            }
            return if NEEDED || table.entries.is_none() {
                Self::noted(place)
            } else {
                Self::absent(place)
            };
        };
        match T::deserialize(ValueDeserializer::from(value.clone())) {
            Ok(value) => Self::new(place, value),
            Err(error) => {
                problems.add_error_at(&place, &error);
                Self::noted(place)
            }
        }
    }
}

/// Optional section.
impl<T: Section> Entry for Option<T> {
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self {
        table.optional(key, problems)
    }
}

/// Optional section, read as an empty table if absent.
#[derive(Debug)]
pub struct OrEmpty<T>(T);

impl<T> Deref for OrEmpty<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T: Section> Entry for OrEmpty<T> {
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self {
        Self(table.optional(key, problems).unwrap_or_else(|| {
            let (place, empty) = (table.place_of(key, problems), DeTable::new());
            let entries = table.entries.map(|_| &empty);
            T::from_table(&Table { line: place.line(), place, entries }, problems)
        }))
    }
}

/// Required array of tables, such as `[[joint]]`.
#[derive(Debug)]
pub struct Sections<T> {
    place: Place,
    /// Tables in the order of the file; `None` if missing or not an array.
    all: Option<Vec<T>>,
}

impl<T> Sections<T> {
    /// Returns the tables in the order of the file; empty if the array was noted as a problem.
    pub fn all(&self) -> &[T] {
        self.all.as_deref().unwrap_or_default()
    }

    /// Returns whether the array was noted as missing or of another type.
    pub const fn is_noted(&self) -> bool {
        self.all.is_none()
    }
}

impl<T> HasPlace for Sections<T> {
    fn place(&self) -> &Place {
        &self.place
    }
}

impl<T: Section> Entry for Sections<T> {
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self {
        let place = table.place_of(key, problems);
        let Some(found) = table.find(key) else {
            table.note_missing(key, problems);
            return Self { place, all: None };
        };
        let DeValue::Array(list) = found.get_ref() else {
            if let Err(error) =
                Vec::<IgnoredAny>::deserialize(ValueDeserializer::from(found.clone()))
            {
                problems.add_error_at(&place, &error);
            }
            return Self { place, all: None };
        };
        let one = |(number, value): (usize, &Spanned<DeValue<'_>>)| {
            let line = problems.line_at(value.span().start);
            let place = Place::new(format!("{}[{number}]", place.key()), line);
            T::from_table(&Table::at::<T>(place, value, problems), problems)
        };
        Self { all: Some(list.iter().enumerate().map(one).collect()), place }
    }
}

/// Optional array of tables.
impl<T: Section> Entry for Option<Sections<T>> {
    fn read(table: &Table<'_>, key: &str, problems: &mut Problems<'_>) -> Self {
        table.find(key).map(|_| Sections::read(table, key, problems))
    }
}

/// Visitor that accepts no value; `serde` words the error about its type.
struct TableVisitor(&'static str);

impl Visitor<'_> for TableVisitor {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use toml_input::List;

    use super::*;
    use crate::files::Files;
    use crate::trust::Trust;
    use crate::value::Optional;

    sections! {
        Whole {
            node: Node,
            joint: Sections<Joint>,
            r#box: Option<Node>,
            hand: OrEmpty<Hand>,
        }

        Node {
            a: Value<u8>,
            b: Optional<f64>,
        }

        Joint {
            list: Value<List<f64, 2>>,
            name: Optional<String>,
        }

        Hand {
            stiffness: Optional<f64>,
        }
    }

    const TEXT: &str = "[node]\na = 1\n\n[[joint]]\nlist = [1, 2]\n\n[[joint]]\nname = \"b\"\nlist = [\n 3,\n 4]\n";

    /// Returns the parsed file, and all problems, one per line.
    fn read(text: &str) -> (Whole, String) {
        let mut problems = Problems::new(Path::new("a.toml"), text, &Files::on_disk(Trust::Any));
        let document = DeTable::parse(text).unwrap();
        let whole = Whole::from_table(&Table::root(&document, &problems), &mut problems);
        (whole, problems.finish().map_or_else(|invalid| invalid.to_string(), |()| String::new()))
    }

    /// Returns key and line.
    fn place(of: &impl HasPlace) -> (&str, Option<usize>) {
        (of.place().key(), of.place().line())
    }

    #[test]
    fn values_know_their_key_and_their_line() {
        let (whole, problems) = read(TEXT);
        assert_eq!(problems, "");
        let [first, second] = whole.joint.all() else { panic!("two joints") };
        assert_eq!((whole.node.a.get(), place(&whole.node.a)), (Some(1), ("node.a", Some(2))));
        assert_eq!(place(&first.list), ("joint[0].list", Some(5)));
        assert_eq!(place(&second.list), ("joint[1].list", Some(9)));
        assert_eq!(second.list.get(), Some(List([3.0, 4.0])));
        assert_eq!((place(second), second.list.place().name()), (("joint[1]", Some(7)), "list"));
    }

    #[test]
    fn absent_keys_stand_in_their_table() {
        let (whole, _) = read(TEXT);
        let first = whole.joint.all().first().unwrap();
        assert_eq!(place(&first.name), ("joint[0].name", Some(4)));
        assert_eq!(place(&whole.hand.stiffness), ("hand.stiffness", None));
        assert!(
            first.name.is_absent() && whole.hand.stiffness.is_absent() && whole.r#box.is_none()
        );
        let usual = whole.hand.stiffness.or(2.0);
        assert_eq!((usual.get(), place(&usual)), (Some(2.0), ("hand.stiffness", None)));
    }

    #[test]
    fn keys_missing_unknown_or_of_another_type_are_noted_together() {
        let text = "bax = 1\n[node]\nb = \"x\"\n[[joint]]\nlist = [1, \"y\"]\nname = 3\nnom = 4\n[[joint]]\n\
            [box]\na = 256\n[hand]\nstiffness = 0.5\n";
        let (whole, problems) = read(text);
        let expected = "a.toml:1: bax: unknown key\n\
            a.toml:2: missing field `a`\n\
            a.toml:3: node.b: invalid type: string \"x\", expected a number\n\
            a.toml:5: joint[0].list: invalid type: string \"y\", expected a number\n\
            a.toml:6: joint[0].name: invalid type: integer `3`, expected a string\n\
            a.toml:7: joint[0].nom: unknown key\n\
            a.toml:8: missing field `list`\n\
            a.toml:10: box.a: invalid value: integer `256`, expected a whole number from 0 to 255";
        assert_eq!(problems, expected);
        assert_eq!((whole.node.a.get(), whole.node.b.get()), (None, None));
        assert!(!whole.node.b.is_absent() && whole.node.b.or(1.0).get().is_none());
        assert_eq!(whole.hand.stiffness.get(), Some(0.5));
    }

    #[test]
    fn sections_that_are_no_tables_are_noted_once() {
        let (whole, problems) = read("node = 1\njoint = [[], {}]\nhand = \"h\"");
        let expected = "a.toml:1: node: invalid type: integer `1`, expected a table\n\
            a.toml:2: joint[0]: invalid type: sequence, expected a table\n\
            a.toml:2: missing field `list`\n\
            a.toml:3: hand: invalid type: string \"h\", expected a table";
        assert_eq!(problems, expected);
        assert!(!whole.hand.stiffness.is_absent(), "its keys are not known to be absent");
        let (whole, problems) = read("joint = 7");
        let expected = "a.toml:1: missing field `node`\n\
            a.toml:1: joint: invalid type: integer `7`, expected a list";
        assert_eq!((problems.as_str(), whole.joint.is_noted()), (expected, true));
    }
}
