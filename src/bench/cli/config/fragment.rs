//! A fragment of a configuration as values with their paths: `calib` writes one, a person may, too.

use std::ops::Range;

use thiserror::Error;
use toml_edit::{ArrayOfTables, Item, TableLike, Value};

use crate::config::kind::Kind;
use crate::config::source::Source;
use config::Problem;

/// Key by which entries of a list of tables are found.
pub(super) const NAME: &str = "name";

/// Step from a table to a value in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Value of a key.
    Key(String),
    /// Entry of a list of tables, by its name: a joint.
    Entry { list: String, name: String },
}

/// One value of a fragment.
#[derive(Clone, Debug)]
pub(super) struct Given {
    /// Steps from the root; the last one is a key.
    pub(super) path: Vec<Step>,
    /// Value without the space and comments around it.
    pub(super) value: Value,
    /// Line of the key in the fragment, from 1.
    pub(super) line: usize,
    /// Key in the fragment, for messages.
    pub(super) key: String,
    /// Line and key of the name of the innermost entry around it.
    pub(super) entry: Option<(usize, String)>,
}

/// Reason to refuse a fragment.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
enum Reason {
    #[error("has no key to merge; frhc calib writes none for a joint that it rejects")]
    Empty,
    #[error("must have a name, by which it is found in the configuration")]
    NameMissing,
    #[error("must be a string, got {0}")]
    NameIsNotText(Kind),
    #[error(
        "\"{name}\" is the name of an earlier [[{list}]], in line {line}; one entry has all keys"
    )]
    NamedTwice { list: String, name: String, line: usize },
}

/// Returns the values of a fragment, at least one.
///
/// # Errors
/// Returns every problem of the fragment.
pub(super) fn values(source: &Source) -> Result<Vec<Given>, Vec<Problem>> {
    let document = source.parse().map_err(|problem| vec![problem])?;
    let mut reader = Reader { source, values: Vec::new(), problems: Vec::new() };
    reader.table(document.as_table(), &[], None);
    if reader.values.is_empty() && reader.problems.is_empty() {
        reader.problems.push(source.problem(None, String::new(), &Reason::Empty.to_string()));
    }
    if reader.problems.is_empty() { Ok(reader.values) } else { Err(reader.problems) }
}

/// Values and problems of a fragment so far.
struct Reader<'s> {
    source: &'s Source,
    values: Vec<Given>,
    problems: Vec<Problem>,
}

impl Reader<'_> {
    /// Reads the values of a table and of the tables in it. The name of an entry is part of its path.
    fn table(&mut self, table: &dyn TableLike, path: &[Step], entry: Option<&(usize, String)>) {
        let is_entry = matches!(path.last(), Some(Step::Entry { .. }));
        for (key, item) in table.iter().filter(|(key, _)| !(is_entry && *key == NAME)) {
            let below = [path, &[Step::Key(key.to_owned())]].concat();
            match item {
                Item::None => {}
                Item::Table(nested) => self.table(nested, &below, entry),
                Item::Value(Value::InlineTable(nested)) => self.table(nested, &below, entry),
                Item::ArrayOfTables(entries) => self.entries(entries, key, path),
                Item::Value(value) => {
                    let place = table.key(key).and_then(|key| key.span()).or_else(|| value.span());
                    self.value(value, below, place, entry);
                }
            }
        }
    }

    fn value(
        &mut self,
        value: &Value,
        path: Vec<Step>,
        place: Option<Range<usize>>,
        entry: Option<&(usize, String)>,
    ) {
        let value_place = value.span().or(place.clone()).map_or(0, |place| place.start);
        let line = self.source.line(place.map_or(value_place, |place| place.start));
        let key = toml_input::key_at(&self.source.text, value_place);
        // The document knows a value's text by its place only, and would write 1e-05 as 0.00001.
        let text = value.span().and_then(|place| self.source.text.get(place));
        let as_written = text.and_then(|text| text.parse().ok());
        let mut value: Value = as_written.unwrap_or_else(|| value.clone());
        value.decor_mut().clear();
        self.values.push(Given { path, value, line, key, entry: entry.cloned() });
    }

    fn entries(&mut self, entries: &ArrayOfTables, list: &str, path: &[Step]) {
        let mut seen: Vec<(&str, usize)> = Vec::new();
        for entry in entries {
            let place = entry.span();
            let Some(name) = entry.get(NAME) else {
                self.refuse(place, &Reason::NameMissing);
                continue;
            };
            let Some(text) = name.as_str() else {
                let kind = Kind::from_item(name).unwrap_or(Kind::Table);
                self.refuse(name.span(), &Reason::NameIsNotText(kind));
                continue;
            };
            if let Some((_, line)) = seen.iter().find(|(name, _)| *name == text) {
                let (list, line) = (list.to_owned(), *line);
                let reason = Reason::NamedTwice { list, name: text.to_owned(), line };
                self.refuse(name.span(), &reason);
                continue;
            }
            let place = name.span().map_or(0, |place| place.start);
            let line = self.source.line(place);
            seen.push((text, line));
            let step = Step::Entry { list: list.to_owned(), name: text.to_owned() };
            let named = (line, toml_input::key_at(&self.source.text, place));
            self.table(entry, &[path, &[step]].concat(), Some(&named));
        }
    }

    fn refuse(&mut self, place: Option<Range<usize>>, reason: &Reason) {
        self.problems.push(self.source.problem_at(place, &reason.to_string()));
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn read(text: &str) -> Result<Vec<Given>, String> {
        let source = Source { file: PathBuf::from("f.toml"), text: text.to_owned() };
        values(&source).map_err(|problems| {
            problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        })
    }

    fn shown(step: &Step) -> String {
        match step {
            Step::Key(key) => key.clone(),
            Step::Entry { list, name } => format!("{list}:{name}"),
        }
    }

    #[test]
    fn values_have_their_path_line_and_key() {
        let text = "# by calib\n[[joint]]\nname = \"elbow\"\n# origin\nmax_torque_nm = 4.1    # end\n\n\
                    [joint.boot]\ntimeout_s = 2\n\n[controller]\nfriction = { share = 0.5 }\nmode = 'pose'\n";
        let values = read(text).unwrap();
        let seen: Vec<_> = values
            .iter()
            .map(|given| {
                let path: Vec<_> = given.path.iter().map(shown).collect();
                (
                    path.join(" "),
                    given.value.to_string().trim().to_owned(),
                    given.line,
                    given.key.as_str(),
                )
            })
            .collect();
        let row =
            |path: &str, value: &str, line, key| (path.to_owned(), value.to_owned(), line, key);
        assert_eq!(
            seen,
            [
                row("joint:elbow max_torque_nm", "4.1", 5, "joint[0].max_torque_nm"),
                row("joint:elbow boot timeout_s", "2", 8, "joint[0].boot.timeout_s"),
                row("controller friction share", "0.5", 11, "controller.friction.share"),
                row("controller mode", "'pose'", 12, "controller.mode"),
            ]
        );
    }

    #[test]
    fn fragment_without_a_value_is_refused() {
        let empty =
            "f.toml: has no key to merge; frhc calib writes none for a joint that it rejects";
        for text in
            ["", "\n", "# elbow: rejected: flat\n", "[controller]\n", "[[joint]]\nname = 'a'\n"]
        {
            assert_eq!(read(text).unwrap_err(), empty, "{text:?}");
        }
    }

    #[test]
    fn text_that_is_not_toml_is_refused_by_line() {
        for (text, reason) in [
            ("a = 1\nb = [1,\n", "f.toml:2: unclosed array, expected `]`"),
            ("[node]\na = 1\na = 2\n", "f.toml:3: duplicate key `a`"),
            ("joint,direction\n", "f.toml:1: "),
        ] {
            let refused = read(text).unwrap_err();
            assert!(refused.starts_with(reason), "{refused}");
        }
    }

    #[test]
    fn every_entry_without_a_name_of_its_own_is_refused_by_line_and_key() {
        let text = "[[joint]]\na = 1\n[[joint]]\nname = 3\n[[joint]]\nname = 'x'\n[[joint]]\nname = \"x\"\n";
        let refused = read(text).unwrap_err();
        let lines: Vec<_> = refused.lines().collect();
        assert_eq!(
            lines,
            [
                "f.toml:1: joint[0]: must have a name, by which it is found in the configuration",
                "f.toml:4: joint[1].name: must be a string, got a number",
                "f.toml:8: joint[3].name: \"x\" is the name of an earlier [[joint]], in line 6; one entry has all keys",
            ]
        );
    }
}
