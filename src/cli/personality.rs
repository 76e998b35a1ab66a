//! `frhc sim --personality`: which drives are dangerous, and how.

use std::str::FromStr;

use clap::Args;

use config::Config;
use run::exit::Failure;
use run::exit::Kind;
use sim::personality::Cast;
use sim::personality::Quirk;
use units::numbering::Joint;

/// What the drives are like.
#[derive(Debug, Args)]
pub(super) struct Personalities {
    /// A drive at its worst: a joint by name or number, or `all`, and what is bad about its drive, as
    /// `elbow=slow-sdo,forgetful:6072h`. Repeatable; besides those of the scenario.
    #[arg(long = "personality", value_name = "JOINT=QUIRK,…")]
    personalities: Vec<Part>,
}

/// One joint and its quirks.
#[derive(Clone, Debug)]
struct Part {
    /// `None` for all.
    joint: Option<String>,
    quirks: Vec<Quirk>,
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((joint, quirks)) = text.split_once('=') else {
            return Err("not JOINT=QUIRK, as elbow=slow-sdo".to_owned());
        };
        let quirks = quirks.split(',').map(str::parse::<Quirk>).collect::<Result<_, _>>();
        let joint = (joint != "all").then(|| joint.to_owned());
        Ok(Self { joint, quirks: quirks.map_err(|unknown| unknown.to_string())? })
    }
}

impl Personalities {
    /// Gives the drives of `config` theirs.
    pub(super) fn cast(&self, config: &Config, cast: &mut Cast) -> Result<(), Failure> {
        for Part { joint, quirks } in &self.personalities {
            let is_meant = |number: Joint, name: &str| match joint {
                None => true,
                Some(wanted) => wanted == name || wanted.parse() == Ok(number.number()),
            };
            let joints = Joint::ALL.into_iter().zip(&config.joints);
            let meant: Vec<Joint> = joints
                .filter_map(|(number, joint)| is_meant(number, &joint.name).then_some(number))
                .collect();
            if meant.is_empty() {
                let (file, joint) = (config.file.display(), joint.as_deref().unwrap_or("all"));
                return Err(Failure::new(Kind::Usage, format_args!("{file}: no joint {joint}")));
            }
            for number in meant {
                cast.add(number, quirks.iter().copied());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn cast(parts: &[&str]) -> Result<Cast, String> {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let parts = parts.iter().map(|part| part.parse()).collect::<Result<_, String>>()?;
        let mut cast = Cast::default();
        let given = Personalities { personalities: parts }.cast(&config, &mut cast);
        given.map(|()| cast).map_err(|failure| failure.to_string())
    }

    #[test]
    fn joints_are_named_numbered_or_all_of_them() {
        let cast = cast(&["elbow=slow-sdo,forgetful:1016h:1", "4=no-boot-up", "all=quiet-fault"]);
        let cast = cast.unwrap();
        let counts = Joint::ALL.map(|joint| cast.of(joint).quirks().count());
        assert_eq!(counts, [1, 1, 3, 2, 1, 1]);
    }

    #[test]
    fn whoever_or_whatever_there_is_not_is_named() {
        for (part, words) in [
            ("knee=slow-sdo", "config/kraft_like.toml: no joint knee"),
            ("7=slow-sdo", "config/kraft_like.toml: no joint 7"),
            ("elbow", "not JOINT=QUIRK, as elbow=slow-sdo"),
            ("elbow=", "`` is no personality; there are deaf-to-master"),
            ("elbow=slow-sdo,evil", "`evil` is no personality; there are deaf-to-master"),
        ] {
            let error = cast(&[part]).unwrap_err();
            assert!(error.starts_with(words), "{error}");
        }
    }
}
