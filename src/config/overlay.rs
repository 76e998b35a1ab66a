//! Values in place of those of a file, as `--set controller.assist_fraction=0.2` gives them on the command line.

use std::borrow::Cow;
use std::str::FromStr;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Value of one key in place of the file's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Key as messages name it, `joint[2].max_torque_nm`.
    key: String,
    path: Vec<Step>,
    /// TOML document with the value at [`VALUE`].
    document: String,
}

/// Key of the value in a setting's own document.
const VALUE: &str = "value";

/// Step from a table or list to a value in it.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

/// Error of a key that a file cannot have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct KeyError<'s> {
    pub(super) key: &'s str,
    pub(super) reason: String,
}

impl FromStr for Setting {
    type Err = String;

    /// Parses `KEY=VALUE`. The value is TOML; a word alone is a string.
    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "expected KEY=VALUE, as controller.assist_fraction=0.2";
        let (key, value) = text.split_once('=').ok_or(expected)?;
        let (key, value) = (key.trim().to_owned(), value.trim());
        let path = path(&key).ok_or(expected)?;
        let is_word = value.chars().all(|part| part.is_alphanumeric() || "_-./".contains(part));
        let as_written = format!("{VALUE} = {value}");
        let is_one_value =
            |document: &str| DeTable::parse(document).is_ok_and(|it| it.get_ref().len() == 1);
        let document = match is_one_value(&as_written) {
            true => as_written,
            false if is_word && !value.is_empty() => format!("{VALUE} = \"{value}\""),
            false => return Err(format!("the value of {key} is not TOML; {expected}")),
        };
        Ok(Self { key, path, document })
    }
}

/// Returns the steps of a key; `None` if it is not one.
fn path(key: &str) -> Option<Vec<Step>> {
    let mut steps = Vec::new();
    for part in key.split('.') {
        let (name, indices) =
            part.split_once('[').map_or((part, None), |(name, rest)| (name, Some(rest)));
        if name.is_empty() {
            return None;
        }
        steps.push(Step::Key(name.to_owned()));
        for index in indices.into_iter().flat_map(|rest| rest.split('[')) {
            steps.push(Step::Index(index.strip_suffix(']')?.parse().ok()?));
        }
    }
    Some(steps)
}

/// Documents of settings whose positions lie behind a file of `length` bytes: such a value has no line in it.
pub(super) fn documents(settings: &[Setting], length: usize) -> Vec<String> {
    let behind = " ".repeat(length + 1);
    settings.iter().map(|setting| format!("{behind}{}", setting.document)).collect()
}

/// Puts values into a file. `documents` are the settings as [`documents`] returns them.
///
/// # Errors
/// Returns the first setting whose key leads through a value that is neither table nor list, or beyond the end of a list.
pub(super) fn apply<'d, 's>(
    file: &mut DeTable<'d>,
    settings: &'s [Setting],
    documents: &'d [String],
) -> Result<(), KeyError<'s>> {
    for (setting, document) in settings.iter().zip(documents) {
        // `Setting::from_str` has parsed it before.
        let value = DeTable::parse(document)
            .ok()
            .and_then(|parsed| parsed.into_inner().remove(VALUE))
            .ok_or_else(|| KeyError { key: &setting.key, reason: "is not TOML".to_owned() })?;
        insert_into_table(file, &setting.path, value)
            .map_err(|reason| KeyError { key: &setting.key, reason })?;
    }
    Ok(())
}

fn insert_into_table<'d>(
    table: &mut DeTable<'d>,
    path: &[Step],
    value: Spanned<DeValue<'d>>,
) -> Result<(), String> {
    let (Some(Step::Key(key)), rest) = (path.first(), path.get(1..).unwrap_or_default()) else {
        return Err("must name a key".to_owned());
    };
    if !table.contains_key(key.as_str()) {
        let absent =
            if rest.is_empty() { DeValue::Boolean(false) } else { DeValue::Table(DeTable::new()) };
        table.insert(
            Spanned::new(value.span(), Cow::Owned(key.clone())),
            Spanned::new(value.span(), absent),
        );
    }
    match table.get_mut(key.as_str()) {
        Some(found) => replace(found, rest, value),
        None => Ok(()),
    }
}

fn replace<'d>(
    found: &mut Spanned<DeValue<'d>>,
    path: &[Step],
    value: Spanned<DeValue<'d>>,
) -> Result<(), String> {
    let Some(step) = path.first() else {
        *found = value;
        return Ok(());
    };
    match (step, found.get_mut()) {
        (Step::Key(_), DeValue::Table(table)) => insert_into_table(table, path, value),
        (Step::Index(index), DeValue::Array(list)) => {
            let count = list.len();
            let element = list.get_mut(*index);
            let element = element.ok_or_else(|| format!("has {count} elements, counted from 0"))?;
            replace(element, path.get(1..).unwrap_or_default(), value)
        }
        (Step::Key(key), _) => Err(format!("is no table, so it has no {key}")),
        (Step::Index(_), _) => Err("is no list".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Config;

    const FILE: &str = "config/kraft_like.toml";

    fn load(settings: &[&str]) -> Result<Config, String> {
        let settings: Vec<Setting> = settings.iter().map(|text| text.parse().unwrap()).collect();
        Config::load_with(Path::new(FILE), &settings).map_err(|invalid| invalid.to_string())
    }

    #[test]
    fn settings_replace_values_of_the_file() {
        let config = load(&[
            "controller.wrench_gain=[0.1, 0.1, 0.1, 0.05, 0.05, 0.05]",
            "controller.mode = pose",
            "joint[2].max_torque_nm=3.5",
            "remote.gripper.stroke_m=0.08",
            "remote.gripper.max_speed_m_per_s=0.2",
        ])
        .unwrap();
        assert_eq!(config.controller.reflection.gain().values()[0].to_bits(), 0.1_f64.to_bits());
        assert_eq!(config.command_mode, controller::switches::CommandMode::Pose);
        assert_eq!(config.joints[2].calibration.curve().max_torque().to_bits(), 3.5_f64.to_bits());
        assert!(config.remote.gripper.is_some(), "a section that the file lacks");
    }

    #[test]
    fn invalid_settings_are_refused_by_their_key_without_a_line() {
        for (setting, reason) in [
            (
                "controller.assist_fraction=1.4",
                "config/kraft_like.toml: controller.assist_fraction: the assist fraction must be within 0..=1",
            ),
            (
                "controller.assist_fraction=x",
                "controller.assist_fraction: invalid type: string \"x\"",
            ),
            (
                "controller.assist_fracton=0.2",
                "config/kraft_like.toml: controller.assist_fracton: unknown key",
            ),
            (
                "joint[9].max_torque_nm=1.0",
                "joint[9].max_torque_nm: has 6 elements, counted from 0",
            ),
            ("controller.mode.x=1", "controller.mode.x: is no table, so it has no x"),
            ("controller.mode[0]=1", "controller.mode[0]: is no list"),
        ] {
            let refused = load(&[setting]).unwrap_err();
            assert!(refused.contains(reason), "{setting}: {refused}");
        }
    }

    #[test]
    fn text_that_is_not_a_setting_is_refused() {
        for text in [
            "",
            "x",
            "=1",
            "a.=1",
            ".a=1",
            "a[x]=1",
            "a[1=1",
            "a=",
            "a=[1",
            "a=1\nb=2",
            "a=two words",
        ] {
            assert!(text.parse::<Setting>().is_err(), "{text:?}");
        }
        assert!(
            "remote.robot=robots/puma560.toml".parse::<Setting>().is_ok(),
            "a word is a string"
        );
    }
}
