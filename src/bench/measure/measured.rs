//! What has been measured of an arm: `MY.measured.toml` beside `MY.toml`. It is void once a key that it depends on has changed.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use config::Config;
use run::exit::{Failure, Kind};
use units::drive::Counts;

/// Counts whose positions tell zero, sign and scale of each joint apart.
const TOLD_BY: [i32; 3] = [0, 1_000, -70_000];

const HEAD: &str = "# What `frhc measure` has found of this arm. A part is void once its `facts` differ from those of the configuration.\n\n";

/// Part of the measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Directions of torques and positions.
    Sign,
    /// Directions of joints and grip.
    Direction,
}

/// File of measurements.
#[derive(Debug)]
pub struct Measured {
    path: PathBuf,
    parts: Parts,
    /// Facts of the configuration, on which each part depends.
    sign_facts: String,
    direction_facts: String,
}

#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    #[serde(default)]
    sign: Part,
    #[serde(default)]
    direction: Part,
}

/// Steps whose result is as the configuration says.
#[derive(Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Part {
    facts: String,
    right: BTreeSet<String>,
}

impl Measured {
    /// Reads the file beside a configuration; without one nothing is measured.
    ///
    /// # Errors
    /// When it cannot be read (exit 4), or is no file of measurements (exit 3).
    pub fn read(config: &Config) -> Result<Self, Failure> {
        let path = beside(&config.file);
        let parts = match fs::read_to_string(&path) {
            Ok(text) => toml::from_str(&text).map_err(|error| {
                let place = error.span().map_or(1, |span| {
                    1 + text.bytes().take(span.start).filter(|byte| *byte == b'\n').count()
                });
                let reason = format!(
                    "{}:{place}: {}; delete the file to measure all again",
                    path.display(),
                    error.message()
                );
                Failure::new(Kind::Configuration, reason)
            })?,
            Err(error) if error.kind() == ErrorKind::NotFound => Parts::default(),
            Err(error) => return Err(unusable(&path, &error)),
        };
        Ok(Self {
            path,
            parts,
            sign_facts: sign_facts(config),
            direction_facts: direction_facts(config),
        })
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns whether steps were right by other facts than those of the configuration.
    pub fn is_void(&self, task: Task) -> bool {
        let (part, facts) = self.part(task);
        !part.right.is_empty() && part.facts != facts
    }

    /// Returns whether a step was right.
    pub fn is_right(&self, task: Task, step: &str) -> bool {
        let (part, facts) = self.part(task);
        part.facts == facts && part.right.contains(step)
    }

    /// Forgets all steps of a part.
    pub fn forget(&mut self, task: Task) {
        *self.part_mut(task).0 = Part::default();
    }

    /// Adds a step that was right, and writes the file: as a whole or not at all.
    ///
    /// # Errors
    /// When it cannot be written (exit 4).
    pub fn add(&mut self, task: Task, step: String) -> Result<(), Failure> {
        let (part, facts) = self.part_mut(task);
        if part.facts != facts {
            *part = Part { facts: facts.to_owned(), right: BTreeSet::default() };
        }
        part.right.insert(step);
        let text = toml::to_string(&self.parts).map_err(|error| {
            Failure::new(Kind::File, format!("{}: {error}", self.path.display()))
        })?;
        let new = self.path.with_extension("toml.new");
        fs::write(&new, format!("{HEAD}{text}"))
            .and_then(|()| fs::rename(&new, &self.path))
            .map_err(|error| unusable(&self.path, &error))
    }

    fn part(&self, task: Task) -> (&Part, &str) {
        match task {
            Task::Sign => (&self.parts.sign, &self.sign_facts),
            Task::Direction => (&self.parts.direction, &self.direction_facts),
        }
    }

    fn part_mut(&mut self, task: Task) -> (&mut Part, &str) {
        match task {
            Task::Sign => (&mut self.parts.sign, &self.sign_facts),
            Task::Direction => (&mut self.parts.direction, &self.direction_facts),
        }
    }
}

fn unusable(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(Kind::File, format!("{}: {error}", path.display()))
}

/// Returns the path beside a configuration.
fn beside(config: &Path) -> PathBuf {
    config.with_extension("measured.toml")
}

/// Returns a digest of what a direction depends on: frames, node-ids, and the positions that counts have.
fn direction_facts(config: &Config) -> String {
    let mut digest = drives(config);
    for joint in &config.joints {
        let link = &joint.plant.link;
        for number in [link.alpha, link.a, link.d, link.theta] {
            digest.update(number.to_le_bytes());
        }
        digest.update(format!("{:?}", link.kind));
    }
    digest.update(format!("{:?}", config.x_6_g));
    in_words(digest)
}

/// Returns a digest of what a sign depends on: node-ids, torque curves, and the positions that counts have.
fn sign_facts(config: &Config) -> String {
    let mut digest = drives(config);
    for joint in &config.joints {
        digest.update(format!("{:?}", joint.calibration.curve().coefficients()));
    }
    in_words(digest)
}

/// Returns a digest of the drives with their node-ids, and of the positions that their counts have.
fn drives(config: &Config) -> Sha256 {
    let mut digest = Sha256::new();
    for counts in TOLD_BY {
        let positions = config.controller.calibration.positions(&[Counts(counts); 6]);
        positions.iter().for_each(|position| digest.update(position.to_le_bytes()));
    }
    for joint in &config.joints {
        digest.update(format!("{} {:?} {:?}", joint.name, joint.channel, joint.node));
    }
    digest
}

fn in_words(digest: Sha256) -> String {
    digest.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIRECTION: Task = Task::Direction;

    /// Copies an arm into a folder, with one text replaced.
    fn arm(folder: &Path, [from, to]: [&str; 2]) -> Config {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3).unwrap();
        let text = fs::read_to_string(root.join("config/kraft_like.toml")).unwrap();
        assert!(from.is_empty() || text.contains(from), "{from}");
        let text =
            text.replacen(from, to, 1).replace("\"../eds/", &format!("\"{}/eds/", root.display()));
        let file = folder.join("my_arm.toml");
        fs::write(&file, text).unwrap();
        Config::load(&file).unwrap()
    }

    #[test]
    fn motions_are_kept_until_a_fact_changes() {
        let folder = tempfile::tempdir().unwrap();
        let config = arm(folder.path(), ["", ""]);
        let mut measured = Measured::read(&config).unwrap();
        assert!(!measured.is_right(DIRECTION, "joint 1") && !measured.is_void(DIRECTION));
        measured.add(DIRECTION, "joint 1".to_owned()).unwrap();
        measured.add(DIRECTION, "push +x".to_owned()).unwrap();
        assert_eq!(measured.path(), folder.path().join("my_arm.measured.toml"));
        let again = Measured::read(&config).unwrap();
        assert!(
            again.is_right(DIRECTION, "joint 1")
                && again.is_right(DIRECTION, "push +x")
                && !again.is_right(DIRECTION, "joint 2")
        );
        let same = arm(folder.path(), ["coulomb_friction_nm = 0.", "coulomb_friction_nm = 0.0"]);
        assert!(
            Measured::read(&same).unwrap().is_right(DIRECTION, "joint 1"),
            "friction is no direction"
        );
        let other = arm(folder.path(), ["zero_counts = ", "zero_counts = 1"]);
        let mut void = Measured::read(&other).unwrap();
        assert!(void.is_void(DIRECTION) && !void.is_right(DIRECTION, "joint 1"));
        void.add(DIRECTION, "joint 2".to_owned()).unwrap();
        let mut void = Measured::read(&other).unwrap();
        void.add(Task::Sign, "joint 4".to_owned()).unwrap();
        assert!(void.is_right(Task::Sign, "joint 4") && !void.is_right(Task::Sign, "joint 2"));
        assert!(
            !void.is_void(DIRECTION)
                && !void.is_right(DIRECTION, "joint 1")
                && void.is_right(DIRECTION, "joint 2")
        );
    }

    #[test]
    fn file_that_is_none_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let config = arm(folder.path(), ["", ""]);
        fs::write(folder.path().join("my_arm.measured.toml"), "# mine\n[direction]\nleft = 3\n")
            .unwrap();
        let refused = Measured::read(&config).unwrap_err().to_string();
        assert!(refused.contains("my_arm.measured.toml:3: unknown field `left`"), "{refused}");
        assert!(refused.ends_with("delete the file to measure all again"), "{refused}");
    }
}
