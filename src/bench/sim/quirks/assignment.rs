//! Assignment of quirks to joints: `[[drive]]` in a scenario, `--quirks` on the command line.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

use crate::quirks::{Quirk, Quirks};
use units::numbering::Joint;

/// Quirks by joint. Drives of joints without an entry have none.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(transparent)]
pub struct QuirkAssignment(Vec<Entry>);

/// One `[[drive]]`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    joint: JointNumber,
    quirks: Vec<Quirk>,
    #[serde(default, rename = "personality", skip_serializing)]
    #[serde(deserialize_with = "refuse_former_key")]
    _former_quirks: (),
}

/// Joint by its number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "i64", into = "u8")]
struct JointNumber(Joint);

/// Joint number outside 1..=6.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("joint must be within 1..=6, got {0}")]
pub struct UnknownJoint(i64);

impl TryFrom<i64> for JointNumber {
    type Error = UnknownJoint;

    fn try_from(joint: i64) -> Result<Self, UnknownJoint> {
        Joint::new(joint).map(Self).ok_or(UnknownJoint(joint))
    }
}

impl From<JointNumber> for u8 {
    fn from(JointNumber(joint): JointNumber) -> Self {
        joint.number()
    }
}

impl QuirkAssignment {
    /// Returns whether no drive has a quirk.
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds `quirks` to those of the drive of `joint`.
    pub fn add(&mut self, joint: Joint, quirks: impl IntoIterator<Item = Quirk>) {
        let quirks = quirks.into_iter().collect();
        self.0.push(Entry { joint: JointNumber(joint), quirks, _former_quirks: () });
    }

    /// Returns the quirks of the drive of `joint`.
    pub fn for_joint(&self, joint: Joint) -> Quirks {
        let entries = self.0.iter().filter(|entry| entry.joint == JointNumber(joint));
        Quirks::new(entries.flat_map(|entry| entry.quirks.iter().copied()))
    }
}

fn refuse_former_key<'de, D: Deserializer<'de>>(_: D) -> Result<(), D::Error> {
    Err(D::Error::custom("key `personality` was renamed to `quirks`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct File {
        drive: QuirkAssignment,
    }

    fn read(text: &str) -> Result<QuirkAssignment, String> {
        toml::from_str(text).map(|file: File| file.drive).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn joints_have_the_quirks_of_their_entries_only() {
        let mut cast = read(
            "[[drive]]\njoint = 3\nquirks = [\"no-boot-up\", \"quiet-fault\"]\n\
             [[drive]]\njoint = 6\nquirks = []\n",
        )
        .unwrap();
        assert_eq!(
            cast.for_joint(Joint::of::<3>()),
            Quirks::new([Quirk::NoBootUp, Quirk::QuietFault])
        );
        cast.add(Joint::of::<3>(), [Quirk::KeepsTorque]);
        assert_eq!(cast.for_joint(Joint::of::<3>()).iter().count(), 3);
        assert!(
            Joint::ALL
                .into_iter()
                .filter(|joint| joint.number() != 3)
                .all(|joint| cast.for_joint(joint) == Quirks::default())
        );
    }

    #[test]
    fn invalid_entries_are_refused_in_one_line() {
        for (text, words) in [
            ("joint = 7\nquirks = []", "joint must be within 1..=6, got 7"),
            ("joint = 0\nquirks = []", "joint must be within 1..=6, got 0"),
            ("joint = 3\nquirks = [\"evil\"]", "unknown quirk `evil`; expected one of deaf"),
            ("joint = 3\nquirks = []\nseed = 1", "unknown field `seed`"),
            ("joint = 3", "missing field `quirks`"),
            ("joint = 3\npersonality = []", "key `personality` was renamed to `quirks`"),
        ] {
            let error = read(&format!("[[drive]]\n{text}\n")).unwrap_err();
            assert!(error.starts_with(words), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
