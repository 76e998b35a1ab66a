//! One run over a link: unrest of the hand at the wall, energy taken by the passivity layer, and reflected force.

use std::fmt;

use serde::Serialize;

use crate::delay::link::{self, LinkConditions};
use crate::delay::measurement::{Measurement, Outcome};
use crate::delay::script::{self, CommandMode};
use crate::no_trial::NoTrial;
use config::Config;
use config::robots::RobotArm;
use telemetry::shaking::Shaking;
use testbench::bench::Bench;
use testbench::comparison;
use testbench::robot_site::{Equipment, NoRobot, RobotSite};
use testbench::side::Side;

/// Object or arm that the hand leads.
#[derive(Clone, Copy, Debug)]
pub enum Follower<'a> {
    /// Free object.
    Object,
    /// Arm of a robot file, simulated with masses, servos and wrist sensor.
    Arm(&'a RobotArm),
}

impl Follower<'_> {
    /// Returns the configuration with this object or arm.
    #[must_use]
    pub fn configure(&self, config: &Config) -> Config {
        match self {
            Self::Object => config.clone(),
            Self::Arm(arm) => config.clone().with_robot((*arm).clone()),
        }
    }
}

impl fmt::Display for Follower<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Object => f.write_str("free object"),
            Self::Arm(arm) => f.write_str(&arm.name),
        }
    }
}

/// Settings of one run over a link.
#[derive(Clone, Copy, Debug)]
pub struct Trial<'a> {
    /// Object or arm that the hand leads.
    pub led: Follower<'a>,
    /// Link between node and object.
    pub link: LinkConditions,
    /// Rate or pose commands, as the script requests.
    pub commanded: CommandMode,
    /// K_T along x; the others in proportion.
    pub k_t: f64,
    /// Set if the passivity layer is on.
    pub has_layer: bool,
    /// Seed of the link, the sensor and the simulation.
    pub seed: u64,
}

/// Run in figures.
#[derive(Clone, Debug, Serialize)]
pub struct TrialResult {
    /// Object or arm that the hand led.
    pub led: String,
    /// Link between node and object.
    #[serde(flatten)]
    pub link: LinkConditions,
    /// Rate or pose commands.
    pub commanded: CommandMode,
    /// K_T along x.
    pub k_t: f64,
    /// K_T k_e, in N/m.
    #[serde(rename = "felt_stiffness_n_per_m")]
    pub displayed_stiffness_n_per_m: f64,
    /// Set if the passivity layer was on.
    pub has_layer: bool,
    /// Set if a sample can arrive within the maximum age.
    pub is_usable: bool,
    /// Set if the gain check accepts gains and link.
    pub is_accepted: bool,
    /// Outcome: rest, swing, stop or loss of the link.
    pub outcome: Outcome,
    /// RMS speed of the grip in the last second at the wall, in m/s.
    pub unrest_m_per_s: f64,
    /// Mean reflected force in the last second at the wall, in N.
    pub reflected_n: f64,
    /// Energy with which contact drove the hand, in J.
    pub driven_j: f64,
    /// Energy that the passivity layer took from the hand, in J.
    pub taken_j: f64,
    /// Largest torque beyond gravity compensation that was commanded, in N·m.
    pub largest_nm: f64,
    /// Time from the start of an outage until the last torque beyond gravity compensation, in s.
    pub reflected_for_s: Option<f64>,
    /// Cause of a stop by the node.
    pub stopped_by: Option<String>,
    /// Shaking of the arm in free motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaking: Option<Shaking>,
}

/// Refuses a configuration with which no run can be played.
///
/// # Errors
/// Returns an error without a wall or reflection along x, or if the command does not come to rest at the wall.
pub fn ensure_playable(config: &Config) -> Result<(), NoTrial> {
    config.remote.wall.ok_or(NoTrial::NoWall)?;
    let [k_t, ..] = *config.controller.reflection.gain().values();
    if k_t <= 0.0 {
        return Err(NoTrial::NoReflection);
    }
    let mut commands = [CommandMode::Pose, CommandMode::Rate].into_iter();
    let found = commands.find(|commanded| script::script(config, *commanded).is_none());
    found.map_or(Ok(()), |commanded| Err(restless(commanded)))
}

fn restless(commanded: CommandMode) -> NoTrial {
    NoTrial::NoRest { commanded: commanded.to_string() }
}

impl Trial<'_> {
    /// Plays the run.
    ///
    /// # Errors
    /// Returns an error if the configuration has no wall, or the drives or the arm cannot be simulated.
    pub fn play(&self, config: &Config) -> Result<TrialResult, NoTrial> {
        let config = &self.configured(config);
        let wall = config.remote.wall.ok_or(NoTrial::NoWall)?.2;
        let commanded = self.commanded;
        let scenario = script::script(config, commanded).ok_or_else(|| restless(commanded))?;
        let mut bench = Bench::with_side(config, self.side(config)?, scenario, self.seed, ());
        bench.bring_up()?;
        let mut measured = Measurement::new(config, self.link.outage_s.map(|[start, _]| start));
        for _ in 0..config.controller.period.cycles(script::SECONDS) {
            let record = bench.cycle();
            measured.add(&bench, &record);
        }
        Ok(TrialResult {
            led: self.led.to_string(),
            link: self.link,
            commanded,
            k_t: self.k_t,
            displayed_stiffness_n_per_m: self.k_t * wall.stiffness,
            has_layer: self.has_layer,
            is_usable: self.link.is_usable(config),
            is_accepted: link::is_accepted(config),
            outcome: measured.outcome(),
            unrest_m_per_s: measured.unrest(),
            reflected_n: measured.reflected(),
            driven_j: (-measured.contact.lowest_energy_j).max(0.0),
            taken_j: measured.taken,
            largest_nm: measured.largest,
            reflected_for_s: measured.reflected_for,
            stopped_by: measured.cause.map(|cause| cause.to_string()),
            shaking: measured.shaking.reported(),
        })
    }

    /// Returns the configuration with this link, gain, layer and arm.
    fn configured(&self, config: &Config) -> Config {
        let config =
            link::with_wrench_gain(config, self.k_t).with_link(self.link.settings(self.seed));
        let config = if self.has_layer { config } else { comparison::without_passivity(&config) };
        self.led.configure(&config)
    }

    fn side(&self, config: &Config) -> Result<Side, NoRobot> {
        match self.led {
            Follower::Object => Ok(Side::from_config(config)),
            Follower::Arm(_) => {
                Ok(RobotSite::new(config, &Equipment::from_remote(&config.remote), self.seed)?
                    .into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const RATE: CommandMode = CommandMode::Rate;
    const POSE: CommandMode = CommandMode::Pose;

    fn config() -> Config {
        Config::load(Path::new("config/kraft_like.toml")).unwrap()
    }

    fn played(
        delay_ms: f64,
        max_age_ms: f64,
        k_t: f64,
        has_layer: bool,
        commanded: CommandMode,
    ) -> TrialResult {
        let link = LinkConditions { delay_ms, max_age_ms, ..LinkConditions::default() };
        let trial = Trial { led: Follower::Object, link, commanded, k_t, has_layer, seed: 1 };
        trial.play(&config()).unwrap()
    }

    #[test]
    fn accepted_gains_rest_at_the_wall_on_an_arm() {
        let arm = RobotArm::load(Path::new("config/robots/puma560.toml")).unwrap();
        for (delay_ms, max_age_ms) in [(8.0, 20.0), (40.0, 100.0)] {
            let link = LinkConditions { delay_ms, max_age_ms, ..LinkConditions::default() };
            let led = Follower::Arm(&arm);
            let k_t = 0.999
                * link::largest_accepted(&led.configure(&config().with_link(link.settings(1))));
            for commanded in [POSE, RATE] {
                let trial = Trial { led, link, commanded, k_t, has_layer: true, seed: 1 };
                let row = trial.play(&config()).unwrap();
                assert!(row.is_accepted && row.outcome == Outcome::Calm, "{row:?}");
                assert!(row.reflected_n > 0.5, "{row:?}");
            }
        }
    }

    #[test]
    fn delay_swings_the_hand_and_the_layer_calms_it() {
        for (k_t, commanded) in [(0.6, POSE), (6.0, RATE)] {
            let [without, with] =
                [false, true].map(|has_layer| played(20.0, 100.0, k_t, has_layer, commanded));
            assert!(!with.is_accepted && with.outcome == Outcome::Calm, "{with:?}");
            assert!(matches!(without.outcome, Outcome::Swings | Outcome::Stopped), "{without:?}");
            assert!(with.taken_j > 0.0 && with.driven_j < without.driven_j, "{with:?}");
        }
    }

    #[test]
    fn link_above_the_maximum_age_is_lost_and_silent() {
        let row = played(12.0, 20.0, 0.1, true, POSE);
        assert_eq!((row.outcome, row.is_usable), (Outcome::LinkLost, false));
        assert!(row.largest_nm <= 0.0, "{row:?}");
    }

    #[test]
    fn outage_ends_reflection_within_age_and_ramp() {
        let outage_s = Some([8.0, 8.5]);
        let link = LinkConditions {
            delay_ms: 5.0,
            max_age_ms: 20.0,
            outage_s,
            ..LinkConditions::default()
        };
        let led = Follower::Object;
        let trial = Trial { led, link, commanded: POSE, k_t: 0.3, has_layer: true, seed: 1 };
        let row = trial.play(&config()).unwrap();
        let reflected = row.reflected_for_s.unwrap();
        assert!((0.005..0.072).contains(&reflected) && row.outcome == Outcome::LinkLost, "{row:?}");
    }

    #[test]
    fn accepted_gain_falls_with_the_delay() {
        let most = [0.0, 2.0, 5.0, 8.0, 20.0, 40.0].map(|delay_ms| {
            let link = LinkConditions { delay_ms, max_age_ms: 100.0, ..LinkConditions::default() };
            link::largest_accepted(&config().with_link(link.settings(1)))
        });
        assert!(most.is_sorted_by(|a, b| a > b) && most[5] > 0.1, "{most:?}");
    }
}
