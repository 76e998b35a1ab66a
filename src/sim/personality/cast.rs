//! Which joint's drive has which personality: `[[drive]]` in a scenario, `--personality` on the command
//! line.

use serde::Deserialize;
use thiserror::Error;

use crate::personality::Personality;
use crate::personality::Quirk;
use units::numbering::Joint;

/// Who has which personality. Whoever is not named has none.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(transparent)]
pub struct Cast(Vec<Part>);

/// One `[[drive]]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    joint: Known,
    personality: Vec<Quirk>,
}

/// A joint by the number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "i64")]
struct Known(Joint);

/// A joint there is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("joint {0}: there are 1 to 6")]
pub struct UnknownJoint(i64);

impl TryFrom<i64> for Known {
    type Error = UnknownJoint;

    fn try_from(joint: i64) -> Result<Self, UnknownJoint> {
        Joint::new(joint).map(Self).ok_or(UnknownJoint(joint))
    }
}

impl Cast {
    /// The drive of `joint` has these quirks besides those it has.
    pub fn add(&mut self, joint: Joint, quirks: impl IntoIterator<Item = Quirk>) {
        self.0.push(Part { joint: Known(joint), personality: quirks.into_iter().collect() });
    }

    /// The personality of the drive of `joint`.
    pub fn of(&self, joint: Joint) -> Personality {
        let its = self.0.iter().filter(|part| part.joint == Known(joint));
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
        assert_eq!(
            cast.of(Joint::of::<3>()),
            Personality::new([Quirk::NoBootUp, Quirk::QuietFault])
        );
        cast.add(Joint::of::<3>(), [Quirk::KeepsTorque]);
        assert_eq!(cast.of(Joint::of::<3>()).quirks().count(), 3);
        assert!(
            Joint::ALL
                .into_iter()
                .filter(|joint| joint.number() != 3)
                .all(|joint| cast.of(joint) == Personality::default())
        );
    }

    #[test]
    fn whoever_and_whatever_there_is_not_is_refused_in_one_line() {
        for (text, words) in [
            ("joint = 7\npersonality = []", "joint 7: there are 1 to 6"),
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
