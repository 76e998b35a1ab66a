//! Script of the delay experiment: the hand leads the object to the wall, rests against it, and withdraws.
//!
//! ```text
//!  3 … 5 s     pose mode: approach; rate mode: deflection within 0.5 s, and the object follows
//!  … 11 s      the hand rests; the last second is judged
//!  11 … 12 s   the hand withdraws to its start
//! ```
//!
//! The hand is that of the gain check: no reaction, and no tremor, which would excite the oscillation that is measured.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use crate::displacement;
use crate::opening;
use config::Config;
use remote::scene::HALF_CUBE;
use sim::operator_settings::OperatorSettings;
use sim::scenario::operator::{Move, Switch};
use sim::scenario::{ConsoleRequest, Entry, Scenario};

/// Part of the script in which the hand is judged, in s.
pub const JUDGED_S: [f64; 2] = [10.0, 11.0];

/// Length of the script, in s.
pub const SECONDS: f64 = 12.5;

/// Force on the hand at rest, in N, within the limits of depth and wall force.
const FELT: f64 = 9.0;

/// Maximum depth in the wall in pose mode, in m.
const MAX_DEPTH: f64 = 0.02;

/// Maximum force on the wall in rate mode, in N.
const MAX_FORCE: f64 = 7.0;

/// Smallest component of a direction that needs a deflection beyond the deadband.
const MIN_COMPONENT: f64 = 1e-6;

/// Command mode of a trial, as figures and files name it.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandMode {
    /// Pose mode: the displacement commands a displacement.
    #[display("pose")]
    Pose,
    /// Rate mode: the displacement commands a velocity.
    #[display("rate")]
    Rate,
}

impl From<CommandMode> for controller::switches::CommandMode {
    fn from(commanded: CommandMode) -> Self {
        match commanded {
            CommandMode::Pose => Self::Pose,
            CommandMode::Rate => Self::Rate,
        }
    }
}

/// Returns the script for the wall and gains of `config`; `None` without a wall, or where a rate would rest at no force.
pub fn script(config: &Config, commanded: CommandMode) -> Option<Scenario> {
    let operator = OperatorSettings::STEADY.without_tremor();
    let (dx, seconds) = match commanded {
        CommandMode::Pose => (into_the_wall(config, &operator)?, 2.0),
        CommandMode::Rate => (beyond_the_deadband(config, &operator)?, 0.5),
    };
    let to = displacement::in_base(config, &dx);
    let moves = [
        Entry::Move(Move::new(3.0, seconds, to.into())),
        Entry::Move(Move::new(JUDGED_S[1], 1.0, [0.0; 3])),
        Entry::Switch(Switch::deadman(12.2, false)),
    ];
    let mode = match commanded {
        CommandMode::Pose => ConsoleRequest::Pose,
        CommandMode::Rate => ConsoleRequest::Rate,
    };
    let entries = opening::referenced(mode).chain(moves);
    let scenario = Scenario::new(SECONDS, entries).ok()?;
    Some(scenario.with_operator(operator))
}

/// Returns the direction of ΔX in which the object meets the wall.
fn towards_the_wall(config: &Config) -> Option<Vector3<f64>> {
    let (_, normal, _) = config.remote.wall?;
    Some(config.remote.x_b_m.rotation.inverse() * -normal.into_inner())
}

/// Returns ΔX of the hand in pose mode, in m.
fn into_the_wall(config: &Config, operator: &OperatorSettings) -> Option<Vector3<f64>> {
    let (point, normal, wall) = config.remote.wall?;
    let along = towards_the_wall(config)?;
    let [k_t, ..] = *config.controller.reflection.gain().values();
    let k_p = translations(config.controller.command.pose_gain.values());
    let away = (point - config.remote.x_b_m.translation.vector).dot(&-normal.into_inner());
    let depth = (FELT / (k_t * wall.stiffness)).min(MAX_DEPTH);
    let felt = k_t * wall.stiffness * depth;
    let way = along.component_div(&k_p) * (away - HALF_CUBE + depth);
    (k_p.min() > 0.0).then_some(way + along * operator.deflection(felt))
}

/// Returns ΔX of the hand in rate mode, in m: the wall's force at rest is K_FA⁻¹ K_V ΔX_db.
fn beyond_the_deadband(config: &Config, operator: &OperatorSettings) -> Option<Vector3<f64>> {
    let along = towards_the_wall(config)?;
    let [k_t, ..] = *config.controller.reflection.gain().values();
    let k_v = translations(config.controller.command.rate_gain.values());
    let k_fa = translations(config.remote.interaction.accommodation.gain());
    let deadband = translations(&config.controller.channels.deadbands());
    let [plateau, ..] = config.controller.channels.plateaus();
    let force = (FELT / k_t).min(MAX_FORCE);
    let commanded = along.component_mul(&k_fa).component_div(&k_v) * force;
    let edge = along.zip_map(&deadband, |along, edge| {
        if along.abs() > MIN_COMPONENT { edge.copysign(along) } else { 0.0 }
    });
    let deflection = along * operator.deflection(k_t * force + plateau);
    (k_fa.min() > 0.0 && k_v.min() > 0.0).then_some(edge + commanded + deflection)
}

/// Returns the first three of six numbers.
const fn translations([x, y, z, ..]: &[f64; 6]) -> Vector3<f64> {
    Vector3::new(*x, *y, *z)
}
