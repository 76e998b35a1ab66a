//! Configuration of a recorded session, from the copies in its folder.

use std::path::Path;

use ::replay::Session;
use config::Config;
use config::files::Files;
use config::problem;
use config::robots::RobotArm;
use run::exit::{Failure, Kind, OrFail};
use sim::scenario::Scenario;
use testbench::comparison;

/// Returns the configuration of a session's node.
pub(super) fn configuration(session: &Session) -> Result<Config, Failure> {
    let files = Files::copied(session.copies().clone());
    let config = Config::load_from(&files, Path::new(&session.manifest().configuration));
    equipped(session, config.or_fail(Kind::Configuration)?)
}

/// Returns a configuration with the robot and the surroundings of a session.
pub(super) fn equipped(session: &Session, config: Config) -> Result<Config, Failure> {
    let (manifest, files) = (session.manifest(), Files::copied(session.copies().clone()));
    let config = match &manifest.robot {
        Some(robot) => {
            let robot = RobotArm::load_from(&files, Path::new(robot));
            config.with_robot(robot.or_fail(Kind::Configuration)?)
        }
        None => config,
    };
    let config = match &manifest.scenario {
        Some(path) => {
            let text = problem::text(&files, Path::new(path)).or_fail(Kind::Configuration)?;
            let scenario = Scenario::parse(&text)
                .map_err(|error| Failure::new(Kind::Configuration, format!("{path}:{error}")));
            comparison::surrounded(&config, &scenario?)
        }
        None => config,
    };
    let is_without = manifest.without_passivity;
    Ok(if is_without { comparison::without_passivity(&config) } else { config })
}
