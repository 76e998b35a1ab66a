//! One value put into a parsed configuration: replaced where its key is, or added at the end of its table.

use thiserror::Error;
use toml_edit::{InlineTable, Item, Key, RawString, Table, TableLike, Value};

use crate::config::fragment::{NAME, Step};
use crate::config::kind::{self, Kind};
use units::wording::listed;

/// Reason that a value has no place in the configuration.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(super) enum Misfit {
    #[error("must be {expected}, as in the configuration, got {got}")]
    OtherKind { expected: Kind, got: Kind },
    #[error("the configuration has no [[{list}]] named \"{name}\"; {}", described(.known))]
    NoSuchEntry { list: String, name: String, known: Vec<String> },
    #[error("the configuration has {count} [[{list}]] named \"{name}\"")]
    Ambiguous { list: String, name: String, count: usize },
}

impl Misfit {
    /// Returns whether an entry of the path is wrong, not the value.
    pub(super) const fn is_of_entry(&self) -> bool {
        match self {
            Self::OtherKind { .. } => false,
            Self::NoSuchEntry { .. } | Self::Ambiguous { .. } => true,
        }
    }
}

fn described(known: &[String]) -> String {
    if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", listed(known)) }
}

/// Table under a header or of dotted keys, or in braces.
enum TableMut<'t> {
    Headed(&'t mut Table),
    Inline(&'t mut InlineTable),
}

/// Puts a value at a path below `root`. Tables that are missing are added, entries of lists are not.
///
/// # Errors
/// Returns an error if the path leads to a value of another kind, or to an entry that is not there. `root` may then have new
/// empty tables.
pub(super) fn put(root: &mut Table, path: &[Step], value: &Value) -> Result<(), Misfit> {
    descend(TableMut::Headed(root), path, value)
}

fn descend(table: TableMut<'_>, path: &[Step], value: &Value) -> Result<(), Misfit> {
    match path {
        [] => Ok(()),
        [Step::Key(key)] => table.put(key, value),
        [Step::Key(key), below @ ..] => descend(table.nested(key)?, below, value),
        [Step::Entry { list, name }, below @ ..] => {
            descend(TableMut::Headed(table.entry(list, name)?), below, value)
        }
    }
}

impl<'t> TableMut<'t> {
    fn into_like(self) -> &'t mut dyn TableLike {
        match self {
            Self::Headed(table) => table,
            Self::Inline(table) => table,
        }
    }

    /// Replaces a value but not the space and the comment around it. A value that is the same stays as it is written.
    fn put(self, key: &str, value: &Value) -> Result<(), Misfit> {
        let got = Kind::from_value(value);
        match self {
            Self::Headed(table) if !table.contains_key(key) => {
                table.insert(key, Item::Value(value.clone()));
                return Ok(());
            }
            Self::Inline(table) if !table.contains_key(key) => {
                add_inline(table, key, value);
                return Ok(());
            }
            Self::Headed(_) | Self::Inline(_) => {}
        }
        let found = self.into_like().get_mut(key);
        match found {
            Some(Item::Value(old)) if kind::is_same(old, value) => Ok(()),
            Some(Item::Value(old)) if Kind::from_value(old) == got => {
                let around = old.decor().clone();
                *old = value.clone();
                *old.decor_mut() = around;
                Ok(())
            }
            Some(other) => Err(other_kind(other, got)),
            None => Ok(()),
        }
    }

    /// Returns the table of a key, which is added if it is missing. Tables in an inline table are inline, too.
    fn nested(self, key: &str) -> Result<Self, Misfit> {
        let missing = match &self {
            Self::Inline(_) => Item::Value(Value::InlineTable(InlineTable::new())),
            Self::Headed(_) => {
                let mut headed = Table::new();
                headed.set_implicit(true);
                Item::Table(headed)
            }
        };
        match self.into_like().entry(key).or_insert(missing) {
            Item::Table(table) => Ok(Self::Headed(table)),
            Item::Value(Value::InlineTable(table)) => Ok(Self::Inline(table)),
            other @ (Item::None | Item::Value(_) | Item::ArrayOfTables(_)) => {
                Err(other_kind(other, Kind::Table))
            }
        }
    }

    /// Returns the only entry of a list of tables with this name.
    fn entry(self, list: &str, name: &str) -> Result<&'t mut Table, Misfit> {
        let missing =
            |known| Misfit::NoSuchEntry { list: list.to_owned(), name: name.to_owned(), known };
        let entries = match self.into_like().get_mut(list) {
            Some(Item::ArrayOfTables(entries)) => entries,
            None | Some(Item::None) => {
                return Err(missing(Vec::new()));
            }
            Some(other) => return Err(other_kind(other, Kind::Tables)),
        };
        let has_name = |entry: &Table| entry.get(NAME).and_then(Item::as_str) == Some(name);
        let count = entries.iter().filter(|entry| has_name(entry)).count();
        if count > 1 {
            let (list, name) = (list.to_owned(), name.to_owned());
            return Err(Misfit::Ambiguous { list, name, count });
        }
        let names = entries.iter().filter_map(|entry| entry.get(NAME)?.as_str());
        let known = names.map(|name| format!("\"{name}\"")).collect();
        let found = entries.iter_mut().find(|entry| has_name(entry));
        found.ok_or_else(|| missing(known))
    }
}

fn other_kind(found: &Item, got: Kind) -> Misfit {
    Misfit::OtherKind { expected: Kind::from_item(found).unwrap_or(got), got }
}

/// Adds a key after the last one, written as that is: `{ a = 1 }` becomes `{ a = 1, b = 2 }`, and a key on its own line gets a
/// neighbour on its own line.
fn add_inline(table: &mut InlineTable, key: &str, value: &Value) {
    let (mut key, mut value) = (Key::new(key), value.clone());
    let has_comma = table.trailing_comma();
    let last = table.iter().last().map(|(last, _)| last.to_owned());
    let last = last.and_then(|last| table.get_key_value_mut(&last));
    if let Some((last_key, Item::Value(last_value))) = last {
        let prefix = last_key.leaf_decor().prefix().and_then(RawString::as_str).unwrap_or(" ");
        // A comment before the last key is not of the new one.
        let indent = prefix.rfind('\n').and_then(|end| prefix.get(end..)).unwrap_or(prefix);
        key.leaf_decor_mut().set_prefix(indent);
        let suffix = last_value.decor().suffix().and_then(RawString::as_str).unwrap_or_default();
        if has_comma {
            value.decor_mut().set_suffix("");
        } else if suffix.trim().is_empty() {
            value.decor_mut().set_suffix(suffix.to_owned());
            last_value.decor_mut().set_suffix("");
        }
    }
    table.insert_formatted(&key, value);
}

#[cfg(test)]
mod tests {
    use toml_edit::DocumentMut;

    use super::*;

    /// Puts a value at a path of keys; `joint:elbow` is an entry.
    fn with(text: &str, path: &str, value: &str) -> Result<String, String> {
        let mut document: DocumentMut = text.parse().unwrap();
        let steps: Vec<_> = path
            .split(' ')
            .map(|step| match step.split_once(':') {
                Some((list, name)) => Step::Entry { list: list.to_owned(), name: name.to_owned() },
                None => Step::Key(step.to_owned()),
            })
            .collect();
        let mut value: Value = value.parse().unwrap();
        value.decor_mut().clear();
        put(&mut document, &steps, &value).map_err(|misfit| misfit.to_string())?;
        Ok(document.to_string())
    }

    #[track_caller]
    fn gives(text: &str, path: &str, value: &str, wanted: &str) {
        assert_eq!(with(text, path, value).unwrap(), wanted);
    }

    const JOINTS: &str = "[[joint]]\nname = \"a\"\nmax = 6.0    # end\n\n# of b\n[[joint]]\nname = \"b\"\nmax = 4.0\n\n[switches]\n";

    #[test]
    fn value_is_replaced_between_its_space_and_comment() {
        let wanted = JOINTS.replace("6.0 ", "5.25 ");
        gives(JOINTS, "joint:a max", "5.25", &wanted);
        gives("[x]\na  =  [1,\n  2]  # c\n", "x a", "[3]", "[x]\na  =  [3]  # c\n");
    }

    #[test]
    fn same_value_stays_as_it_is_written() {
        gives("a = 0x10 # c\n", "a", "16", "a = 0x10 # c\n");
        gives(JOINTS, "joint:a max", "6", JOINTS);
    }

    #[test]
    fn new_key_is_the_last_of_its_table() {
        let wanted = JOINTS.replace("# end\n", "# end\ncoulomb = 0.05\n");
        gives(JOINTS, "joint:a coulomb", "0.05", &wanted);
        let wanted = JOINTS.replace("4.0\n", "4.0\ncoulomb = 0.05\n");
        gives(JOINTS, "joint:b coulomb", "0.05", &wanted);
        gives("[a.b]\nx = 1\n", "a y", "2", "[a]\ny = 2\n[a.b]\nx = 1\n");
    }

    #[test]
    fn new_table_comes_after_its_siblings() {
        let text = "[a]\nx = 1\n\n[a.b]\ny = 1\n\n# of c\n[c]\nz = 1\n";
        let wanted = text.replace("y = 1\n", "y = 1\n\n[a.n]\nshare = 0.5\n");
        gives(text, "a n share", "0.5", &wanted);
        let wanted = JOINTS.replace("# end\n", "# end\n\n[joint.boot]\ntimeout_s = 2\n");
        gives(JOINTS, "joint:a boot timeout_s", "2", &wanted);
    }

    #[test]
    fn dotted_and_inline_tables_stay_so() {
        gives("a.x = 1\nb = 2\n", "a y", "2", "a.x = 1\na.y = 2\nb = 2\n");
        gives("a = { x = 1 } # c\n", "a y", "2", "a = { x = 1, y = 2 } # c\n");
        gives("a = {x=1}\n", "a y", "2", "a = {x=1,y = 2}\n");
        gives("a = {}\n", "a n y", "2", "a = { n = { y = 2 } }\n");
        let lines = "a = {\n  x = 1, # of x\n  y = 2,\n}\n";
        gives(lines, "a z", "3", "a = {\n  x = 1, # of x\n  y = 2,\n  z = 3,\n}\n");
    }

    #[test]
    fn value_of_another_kind_is_refused() {
        for (path, value, reason) in [
            ("joint:a max", "'6'", "must be a number, as in the configuration, got a string"),
            ("joint:a max", "[6]", "must be a number, as in the configuration, got a list"),
            ("joint:a", "1", ""),
            ("joint", "1", "must be a list of tables, as in the configuration, got a number"),
            ("joint x", "1", "must be a list of tables, as in the configuration, got a table"),
            ("switches", "1", "must be a table, as in the configuration, got a number"),
            ("switches:a x", "1", "must be a table, as in the configuration, got a list of tables"),
            ("joint:a max end", "1", "must be a number, as in the configuration, got a table"),
        ] {
            match with(JOINTS, path, value) {
                Ok(text) => assert_eq!((text.as_str(), reason), (JOINTS, ""), "{path}"),
                Err(refused) => assert_eq!(refused, reason, "{path} = {value}"),
            }
        }
    }

    #[test]
    fn entry_that_is_unknown_or_ambiguous_is_refused() {
        let refused = with(JOINTS, "joint:knee max", "1").unwrap_err();
        let known = "the configuration has no [[joint]] named \"knee\"; it has \"a\" and \"b\"";
        assert_eq!(refused, known);
        let refused = with("x = 1\n", "joint:knee max", "1").unwrap_err();
        assert_eq!(refused, "the configuration has no [[joint]] named \"knee\"; it has none");
        let twice = JOINTS.replace("\"b\"", "\"a\"");
        let refused = with(&twice, "joint:a max", "1").unwrap_err();
        assert_eq!(refused, "the configuration has 2 [[joint]] named \"a\"");
    }
}
