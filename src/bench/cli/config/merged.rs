//! A configuration with the values of fragments: text to text. Reads and writes no file.

use std::path::PathBuf;

use thiserror::Error;
use toml_edit::DocumentMut;

use crate::config::fragment::{self, Given};
use crate::config::kind;
use crate::config::line_ends;
use crate::config::put;
use crate::config::source::Source;
use config::file_kind::FileKind;
use config::{Invalid, Problem};

/// Reason that a file cannot be merged into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
enum NotEditable {
    #[error("is {0}")]
    OtherFile(FileKind),
    #[error(
        "has no [node], so it is not the configuration of a hand controller; name that first, then the fragments"
    )]
    NotConfiguration,
    #[error("would move: write the dotted keys of each table, as a.b = 1, one after the other")]
    Scattered,
}

/// Value that an earlier fragment gives differently.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("is {got}, but {earlier} in {}:{line}", .file.display())]
struct Contradiction {
    got: String,
    earlier: String,
    file: PathBuf,
    line: usize,
}

/// Returns the text of `base` with the values of all fragments. What they do not change stays byte for byte.
///
/// # Errors
/// Returns every problem of the fragments, with file, line and key; or that `base` cannot be edited.
pub(super) fn merge(base: &Source, fragments: &[Source]) -> Result<String, Invalid> {
    let mut document = editable(base).map_err(|problem| Invalid(vec![problem]))?;
    let mut problems = Vec::new();
    let mut read: Vec<(&Source, Vec<Given>)> = Vec::new();
    for source in fragments {
        match fragment::values(source) {
            Ok(values) => read.push((source, values)),
            Err(found) => problems.extend(found),
        }
    }
    problems.extend(contradictions(&read));
    for (source, values) in &read {
        problems.extend(values.iter().filter_map(|given| put_one(&mut document, source, given)));
    }
    if problems.is_empty() {
        Ok(line_ends::restored(&base.text, &document.to_string()))
    } else {
        // The keys of an unknown joint are one problem.
        problems.dedup();
        Err(Invalid(problems))
    }
}

/// Puts a value into the configuration, or returns why it has no place there.
fn put_one(document: &mut DocumentMut, source: &Source, given: &Given) -> Option<Problem> {
    let misfit = put::put(document, &given.path, &given.value).err()?;
    let (line, key) = match given.entry.as_ref().filter(|_| misfit.is_of_entry()) {
        Some((line, key)) => (*line, key),
        None => (given.line, &given.key),
    };
    Some(source.problem(Some(line), key.clone(), &misfit.to_string()))
}

/// Parses the configuration, whose text must come back when nothing is changed.
fn editable(base: &Source) -> Result<DocumentMut, Problem> {
    let document = base.parse()?.into_mut();
    let refused = |reason: NotEditable| Err(base.problem(None, String::new(), &reason.to_string()));
    match FileKind::from_text(&base.text) {
        Some(FileKind::HandController) => {}
        Some(other) => return refused(NotEditable::OtherFile(other)),
        None => return refused(NotEditable::NotConfiguration),
    }
    let unchanged = document.to_string();
    let (lines, written) = (line_ends::contents(&base.text), line_ends::contents(&unchanged));
    let moved = lines.iter().zip(&written).position(|(line, written)| line != written);
    match moved {
        None => Ok(document),
        Some(index) => {
            let reason = NotEditable::Scattered.to_string();
            Err(base.problem(Some(index + 1), String::new(), &reason))
        }
    }
}

/// Returns a problem for each value that an earlier fragment gives differently.
fn contradictions(read: &[(&Source, Vec<Given>)]) -> Vec<Problem> {
    let all =
        || read.iter().flat_map(|(source, values)| values.iter().map(|given| (*source, given)));
    let mut problems = Vec::new();
    for (number, (source, given)) in all().enumerate() {
        let Some((other, earlier)) = all().take(number).find(|(_, other)| other.path == given.path)
        else {
            continue;
        };
        if !kind::is_same(&earlier.value, &given.value) {
            let contradiction = Contradiction {
                got: given.value.to_string().trim().to_owned(),
                earlier: earlier.value.to_string().trim().to_owned(),
                file: other.file.clone(),
                line: earlier.line,
            };
            let key = given.key.clone();
            problems.push(source.problem(Some(given.line), key, &contradiction.to_string()));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::collection::vec;
    use proptest::prelude::*;
    use toml::{Table, Value};

    use super::*;
    use config::{files, shipped};

    fn source(file: &str, text: &str) -> Source {
        Source { file: PathBuf::from(file), text: text.to_owned() }
    }

    fn shipped(file: &str) -> Source {
        source(file, &String::from_utf8(files::read(Path::new(file)).unwrap()).unwrap())
    }

    fn kraft() -> Source {
        shipped("config/kraft_like.toml")
    }

    fn merged(base: &Source, fragments: &[(&str, &str)]) -> Result<String, String> {
        let fragments: Vec<_> = fragments.iter().map(|(file, text)| source(file, text)).collect();
        merge(base, &fragments).map_err(|invalid| invalid.to_string())
    }

    #[test]
    fn fragment_of_calib_changes_its_joint_alone() {
        let fragment = "# Torque curves\n\n[[joint]]\nname = \"elbow\"\n# elbow.csv\nmax_torque_nm = 4.1\n\
                        torque_curve = [242.542, -1.60177, 0.267152]    # slope at least 238 ‰/N·m\n";
        let kraft = kraft();
        let text = merged(&kraft, &[("f.toml", fragment)]).unwrap();
        let (old, new): (Vec<_>, Vec<_>) =
            kraft.text.lines().zip(text.lines()).filter(|(old, new)| old != new).unzip();
        assert_eq!(kraft.text.lines().count(), text.lines().count());
        assert_eq!(old.len(), 2);
        assert_eq!(
            new[0],
            "max_torque_nm = 4.1    # of the joint: the end of the calibrated range"
        );
        assert!(
            new[1].starts_with("torque_curve = [242.542, -1.60177, 0.267152]    # per mille of")
        );
    }

    #[test]
    fn fragments_may_agree_but_not_contradict() {
        let (one, other) =
            ("[controller.friction]\nshare = 0.5\n", "[controller]\nfriction.share = 0.50\n");
        let kraft = kraft();
        let both = merged(&kraft, &[("a.toml", one), ("b.toml", other)]).unwrap();
        assert_eq!(both, merged(&kraft, &[("a.toml", one)]).unwrap());
        let third = "controller = { friction = { share = 0.6 } }\n";
        let refused = merged(&kraft, &[("a.toml", one), ("b.toml", other), ("c.toml", third)]);
        let reason = "c.toml:1: controller.friction.share: is 0.6, but 0.5 in a.toml:2";
        assert_eq!(refused.unwrap_err(), reason);
    }

    #[test]
    fn every_problem_of_every_fragment_is_named() {
        let fragments = [
            (
                "a.toml",
                "[[joint]]\nname = 'knee'\nx = 1\ny = 2\n\n[[joint]]\nname = 'elbow'\na_m = '0'\n",
            ),
            ("b.toml", "a = [\n"),
            ("c.toml", "# elbow: rejected: flat\n"),
            ("d.toml", "[safety]\nrpdo_timer_ms = [5]\n"),
        ];
        let refused = merged(&kraft(), &fragments).unwrap_err();
        let lines: Vec<_> = refused.lines().collect();
        assert!(lines[0].starts_with("b.toml:"), "{refused}");
        assert_eq!(
            lines[1],
            "c.toml: has no key to merge; frhc calib writes none for a joint that it rejects"
        );
        assert_eq!(
            lines[2],
            "a.toml:2: joint[0].name: the configuration has no [[joint]] named \"knee\"; it has \"azimuth\", \"elevation\", \
             \"elbow\", \"pitch\", \"yaw\" and \"roll\""
        );
        assert_eq!(
            lines[3],
            "a.toml:8: joint[1].a_m: must be a number, as in the configuration, got a string"
        );
        assert_eq!(
            lines[4],
            "d.toml:2: safety.rpdo_timer_ms: must be a number, as in the configuration, got a list"
        );
        assert_eq!(lines.len(), 5, "{refused}");
    }

    #[test]
    fn file_that_is_no_configuration_is_refused() {
        let fragment = [("f.toml", "[node]\nheartbeat_ms = 6\n")];
        for (text, reason) in [
            (
                "[[joint]]\nname = 'elbow'\n",
                "my.toml: has no [node], so it is not the configuration",
            ),
            ("tool_m = 1\n", "my.toml: is the file of a robot"),
            ("seconds = 1\n", "my.toml: is a scenario"),
            ("[node]\na = 1\na = 2\n", "my.toml:3: duplicate key `a`"),
            (
                "[node]\na.x = 1\nb = 2\na.y = 3\n",
                "my.toml:3: would move: write the dotted keys of each",
            ),
        ] {
            let refused = merged(&source("my.toml", text), &fragment).unwrap_err();
            assert!(refused.starts_with(reason), "{refused}");
        }
    }

    #[test]
    fn line_ends_and_missing_last_end_stay() {
        let fragment = [(
            "f.toml",
            "[[joint]]\nname = \"roll\"\nmax_torque_nm = 0.7\nnew = 1\n[new]\nkey = 2\n",
        )];
        let unix = kraft();
        let merged_unix = merged(&unix, &fragment).unwrap();
        assert!(merged_unix.ends_with("\n\n[new]\nkey = 2\n"));
        let dos = source("my.toml", &unix.text.replace('\n', "\r\n"));
        assert_eq!(merged(&dos, &fragment).unwrap(), merged_unix.replace('\n', "\r\n"));
        let open = source("my.toml", unix.text.trim_end());
        assert_eq!(merged(&open, &fragment).unwrap(), merged_unix.trim_end());
        let marked = source("my.toml", &format!("\u{feff}{}", unix.text));
        assert_eq!(merged(&marked, &fragment).unwrap(), format!("\u{feff}{merged_unix}"));
    }

    /// Keys that joints of the shipped files have or lack, with numbers or lists.
    const KEYS: [&str; 5] =
        ["max_torque_nm", "coulomb_friction_nm", "torque_curve", "new_number", "new_list"];

    /// Generates values by joint and key, and the fragment that has them.
    fn values() -> impl Strategy<Value = Vec<(usize, usize, Vec<f64>)>> {
        let numbers = vec(prop_oneof![-1e6..1e6_f64, Just(0.1), Just(-0.0), Just(1e-9)], 3);
        vec((0..6_usize, 0..KEYS.len(), numbers), 1..12).prop_map(|mut values| {
            values.sort_by_key(|(joint, key, _)| (*joint, *key));
            values.dedup_by_key(|(joint, key, _)| (*joint, *key));
            values
        })
    }

    fn toml_value(key: usize, numbers: &[f64]) -> String {
        let list = KEYS[key].ends_with("list") || KEYS[key].ends_with("curve");
        if list { format!("{numbers:?}") } else { format!("{:?}", numbers[0]) }
    }

    fn joints(text: &str) -> Vec<Table> {
        let table: Table = text.parse().unwrap();
        let joints = table["joint"].as_array().unwrap();
        joints.iter().map(|joint| joint.as_table().unwrap().clone()).collect()
    }

    fn fragment_of(base: &Source, values: &[(usize, usize, Vec<f64>)]) -> String {
        let names = joints(&base.text);
        let mut text = String::new();
        for (number, joint) in names.iter().enumerate() {
            let own: Vec<_> = values.iter().filter(|(of, ..)| *of == number).collect();
            if !own.is_empty() {
                text += &format!("[[joint]]\nname = {}\n", joint["name"]);
            }
            for (_, key, numbers) in own {
                text +=
                    &format!("{} = {} # of the fragment\n", KEYS[*key], toml_value(*key, numbers));
            }
        }
        text
    }

    /// Comments in the order of the text. No string of a shipped file has a `#`.
    fn comments(text: &str) -> Vec<&str> {
        text.lines().filter_map(|line| line.find('#').map(|at| &line[at..])).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn merged_text_is_base_plus_fragment(
            file in prop::sample::select(shipped::HAND_CONTROLLERS.to_vec()),
            values in values(),
            is_dos: bool,
        ) {
            let mut base = shipped(file);
            if is_dos {
                base.text = base.text.replace('\n', "\r\n");
            }
            let fragment = fragment_of(&base, &values);
            let text = merged(&base, &[("f.toml", &fragment)]).unwrap();

            let mut wanted: Table = base.text.parse().unwrap();
            for (joint, key, numbers) in &values {
                let value: Table = format!("it = {}", toml_value(*key, numbers)).parse().unwrap();
                let joint = wanted["joint"].as_array_mut().unwrap()[*joint].as_table_mut().unwrap();
                joint.insert(KEYS[*key].to_owned(), value["it"].clone());
            }
            prop_assert_eq!(text.parse::<Table>().unwrap(), wanted);
            prop_assert_eq!(comments(&text), comments(&base.text));
            let order = |text: &str| -> Vec<Vec<String>> {
                let kept = |joint: &Table| joint.keys().cloned().collect();
                joints(text).iter().map(kept).collect()
            };
            for (new, old) in order(&text).iter().zip(order(&base.text)) {
                prop_assert!(old.iter().all(|key| new.contains(key)));
            }

            let again = merged(&source(file, &text), &[("f.toml", &fragment)]).unwrap();
            prop_assert_eq!(again, text);
        }

        #[test]
        fn own_values_change_nothing(file in prop::sample::select(shipped::HAND_CONTROLLERS.to_vec())) {
            let base = shipped(file);
            let own: Table = base.text.parse().unwrap();
            let text = merged(&base, &[("f.toml", &own.to_string())]).unwrap();
            prop_assert_eq!(text, base.text);
        }

        #[test]
        fn any_fragment_is_merged_or_refused(fragment in "([a-c.]{1,3} = [0-9]|\\[\\[?[a-c.]{1,3}\\]?\\]|name = 'x'|# c|\n){0,9}") {
            let base = source("my.toml", "[node]\n[a]\nb = 1\n[[c]]\nname = 'x'\nb = 2\n");
            if let Ok(text) = merged(&base, &[("f.toml", &fragment)]) {
                let table: Result<Table, _> = text.parse();
                prop_assert!(table.is_ok(), "{fragment:?} {text}");
                prop_assert_eq!(merged(&source("my.toml", &text), &[("f.toml", &fragment)]).unwrap(), text);
            }
        }
    }

    #[test]
    fn numbers_stay_readable() {
        let text =
            merged(&kraft(), &[("f.toml", "[safety]\nnode_lost_ms = 0x19\nnew_n = 1e-05\n")]);
        let text = text.unwrap();
        assert!(text.contains("node_lost_ms = 0x19    ") && text.contains("\nnew_n = 1e-05\n"));
        assert!(matches!(text.parse::<Table>().unwrap()["safety"]["new_n"], Value::Float(_)));
    }
}
