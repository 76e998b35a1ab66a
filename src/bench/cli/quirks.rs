//! Option `--quirks` of `frhc sim`.

use std::str::FromStr;

use clap::Args;

use config::Config;
use run::exit::{Failure, Kind};
use sim::quirks::{Quirk, QuirkAssignment};
use units::numbering::Joint;

/// Quirks of simulated drives.
#[derive(Debug, Args)]
pub(super) struct QuirkArgs {
    /// Quirks of the drive of one joint (name, number or `all`), as `elbow=slow-sdo,forgetful:6072h`, in addition to
    /// those of the scenario. Repeatable.
    #[arg(long = "quirks", value_name = "JOINT=QUIRK,…")]
    drives: Vec<DriveQuirks>,
    /// Former name of `--quirks`; refused.
    #[arg(long = "personality", hide = true, value_parser = refuse_personality)]
    personality: Option<String>,
}

/// Quirks of one joint.
#[derive(Clone, Debug)]
struct DriveQuirks {
    /// Name or number; `None` for all joints.
    joint: Option<String>,
    quirks: Vec<Quirk>,
}

impl FromStr for DriveQuirks {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((joint, quirks)) = text.split_once('=') else {
            return Err("must be JOINT=QUIRK, such as elbow=slow-sdo".to_owned());
        };
        let quirks = quirks.split(',').map(str::parse::<Quirk>).collect::<Result<_, _>>();
        let joint = (joint != "all").then(|| joint.to_owned());
        Ok(Self { joint, quirks: quirks.map_err(|unknown| unknown.to_string())? })
    }
}

impl QuirkArgs {
    /// Adds the quirks to `assignment`; joints are those of `config`.
    pub(super) fn assign(
        &self,
        config: &Config,
        assignment: &mut QuirkAssignment,
    ) -> Result<(), Failure> {
        for DriveQuirks { joint, quirks } in &self.drives {
            let is_selected = |number: Joint, name: &str| match joint {
                None => true,
                Some(wanted) => wanted == name || wanted.parse() == Ok(number.number()),
            };
            let joints = Joint::ALL.into_iter().zip(&config.joints);
            let selected: Vec<Joint> = joints
                .filter_map(|(number, joint)| is_selected(number, &joint.name).then_some(number))
                .collect();
            if selected.is_empty() {
                let (file, joint) = (config.file.display(), joint.as_deref().unwrap_or("all"));
                return Err(Failure::new(Kind::Usage, format_args!("{file}: no joint {joint}")));
            }
            for number in selected {
                assignment.add(number, quirks.iter().copied());
            }
        }
        Ok(())
    }
}

/// Names the new option.
fn refuse_personality(_: &str) -> Result<String, String> {
    Err("--personality was renamed to --quirks".to_owned())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser;

    use super::*;

    fn assign(parts: &[&str]) -> Result<QuirkAssignment, String> {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let parts = parts.iter().map(|part| part.parse()).collect::<Result<_, String>>()?;
        let mut assignment = QuirkAssignment::default();
        let given = QuirkArgs { drives: parts, personality: None }.assign(&config, &mut assignment);
        given.map(|()| assignment).map_err(|failure| failure.to_string())
    }

    #[test]
    fn joints_are_given_by_name_number_or_all() {
        let assigned =
            assign(&["elbow=slow-sdo,forgetful:1016h:1", "4=no-boot-up", "all=quiet-fault"]);
        let assigned = assigned.unwrap();
        let counts = Joint::ALL.map(|joint| assigned.for_joint(joint).iter().count());
        assert_eq!(counts, [1, 1, 3, 2, 1, 1]);
    }

    #[test]
    fn value_for_an_absent_object_is_refused() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let checked = |part| {
            demo::quirks::check(&config, &assign(&[part]).unwrap()).map_err(|f| f.to_string())
        };
        assert_eq!(checked("all=stored:6091h:1=2,polarity-reversed,slow-sdo"), Ok(()));
        for (part, words) in [
            (
                "elbow=stored:3001h:2=1",
                "its EDS has no integer at 3001h:2; choose an object of the drive",
            ),
            (
                "elbow=stored:1008h=1",
                "its EDS has no integer at 1008h; choose an object of the drive",
            ),
            ("elbow=stored:607Eh=256", "607Eh has 8 bits, got 256"),
        ] {
            let quirk = &part["elbow=".len()..];
            let whole = format!("config/kraft_like.toml: joint 3 (elbow), quirk {quirk}: {words}");
            assert_eq!(checked(part), Err(whole));
        }
    }

    #[test]
    fn former_option_is_refused_with_its_new_name() {
        #[derive(Debug, Parser)]
        struct Command {
            #[command(flatten)]
            quirks: QuirkArgs,
        }
        let args = ["sim", "--personality", "elbow=slow-sdo"];
        let error = Command::try_parse_from(args).unwrap_err().to_string();
        assert!(error.contains("--personality was renamed to --quirks"), "{error}");
        let command = Command::try_parse_from(["sim", "--quirks", "elbow=slow-sdo"]).unwrap();
        assert_eq!(command.quirks.drives.len(), 1);
    }

    #[test]
    fn unknown_joints_and_quirks_are_refused() {
        for (part, words) in [
            ("knee=slow-sdo", "config/kraft_like.toml: no joint knee"),
            ("7=slow-sdo", "config/kraft_like.toml: no joint 7"),
            ("elbow", "must be JOINT=QUIRK, such as elbow=slow-sdo"),
            ("elbow=", "unknown quirk ``; expected one of deaf-to-master"),
            ("elbow=slow-sdo,evil", "unknown quirk `evil`; expected one of deaf-to-master"),
        ] {
            let error = assign(&[part]).unwrap_err();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
