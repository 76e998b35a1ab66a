//! Which joint's drive has which personality: `[[drive]]` in a scenario, `--personality` on the command
//! line.

use serde::Deserialize;
use thiserror::Error;

use crate::personality::Personality;
use crate::personality::Quirk;

/// Joints there are.
const JOINTS: u8 = 6;

/// Who has which personality. Whoever is not named has none.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Cast(Vec<Part>);

/// One `[[drive]]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    joint: Joint,
    personality: Vec<Quirk>,
}

/// A joint, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "i64")]
struct Joint(u8);

/// A joint there is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("joint {0}: there are 1 to {JOINTS}")]
pub struct UnknownJoint(i64);

impl TryFrom<i64> for Joint {
    type Error = UnknownJoint;

    fn try_from(joint: i64) -> Result<Self, UnknownJoint> {
        let known = u8::try_from(joint).ok().filter(|joint| (1..=JOINTS).contains(joint));
        known.map(Self).ok_or(UnknownJoint(joint))
    }
}

impl Cast {
    /// The drive of `joint`, from 1, has these quirks besides those it has.
    ///
    /// # Errors
    /// When there is no such joint.
    pub fn add(
        &mut self,
        joint: usize,
        quirks: impl IntoIterator<Item = Quirk>,
    ) -> Result<(), UnknownJoint> {
        let joint = Joint::try_from(i64::try_from(joint).unwrap_or(i64::MAX))?;
        self.0.push(Part { joint, personality: quirks.into_iter().collect() });
        Ok(())
    }

    /// The personality of the drive of `joint`, from 1.
    pub fn of(&self, joint: usize) -> Personality {
        let its = self.0.iter().filter(|part| usize::from(part.joint.0) == joint);
        Personality::new(its.flat_map(|part| part.personality.iter().copied()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct File {
        drive: Cast,
    }

    fn read(text: &str) -> Result<Cast, String> {
        toml::from_str(text).map(|file: File| file.drive).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn every_joint_has_what_is_said_of_it_and_no_more() {
        let mut cast = read(
            "[[drive]]\njoint = 3\npersonality = [\"no-boot-up\", \"quiet-fault\"]\n\
             [[drive]]\njoint = 6\npersonality = []\n",
        )
        .unwrap();
        assert_eq!(cast.of(3), Personality::new([Quirk::NoBootUp, Quirk::QuietFault]));
        cast.add(3, [Quirk::KeepsTorque]).unwrap();
        assert_eq!(cast.of(3).quirks().count(), 3);
        assert!(
            (1..=6)
                .filter(|joint| *joint != 3)
                .all(|joint| cast.of(joint) == Personality::default())
        );
        assert_eq!(cast.add(7, []).unwrap_err().to_string(), "joint 7: there are 1 to 6");
    }

    #[test]
    fn whoever_and_whatever_there_is_not_is_refused_in_one_line() {
        for (text, words) in [
            ("joint = 0\npersonality = []", "joint 0: there are 1 to 6"),
            ("joint = 3\npersonality = [\"evil\"]", "`evil` is no personality; there are deaf"),
            ("joint = 3\npersonality = []\nseed = 1", "unknown field `seed`"),
            ("joint = 3", "missing field `personality`"),
        ] {
            let error = read(&format!("[[drive]]\n{text}\n")).unwrap_err();
            assert!(error.starts_with(words), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }
}
