//! Readings of all sweep files by joint, converted to joint torques minus gravity.

use serde::Serialize;

use crate::rig;
use calibration::fit::posture::PostureReading;
use calibration::fit::sweep::Moving;
use calibration::torque_data::{JointSweep, SweepData, SweepReading};
use config::{Config, Invalid, JointParameters, Problem};
use controller::arm::JointKind;
use units::drive::PerMille;

/// Maximum number of reported problems.
const MAX_PROBLEMS: usize = 20;
/// Tolerance of positions outside of a joint's range, as a part of the range.
const OUTSIDE: f64 = 0.05;

/// Readings of one joint in all files.
pub(super) struct FrictionInput<'c> {
    pub(super) parameters: &'c JointParameters,
    /// Index of the joint, from 0.
    pub(super) place: usize,
    /// Readings at constant velocities, and their sources.
    pub(super) moving: Vec<Moving>,
    pub(super) moving_at: Vec<Source>,
    /// Readings at rest, and their sources.
    pub(super) held: Vec<PostureReading>,
    pub(super) held_at: Vec<Source>,
    /// Gravity was subtracted from the torques of moving readings.
    pub(super) has_gravity: bool,
}

/// File and line of a reading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Source {
    pub(super) file: String,
    pub(super) line: usize,
}

impl FrictionInput<'_> {
    /// Returns the names of the files, comma-separated, in the order of first use.
    pub(super) fn files(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for source in self.moving_at.iter().chain(&self.held_at) {
            if !names.contains(&source.file.as_str()) {
                names.push(&source.file);
            }
        }
        names.join(", ")
    }
}

/// Groups the readings of all files by joint, in the order of the configuration.
///
/// # Errors
/// Returns `problems` and those of the readings against the configuration.
pub(super) fn join<'c>(
    config: &'c Config,
    files: &[SweepData],
    mut problems: Vec<Problem>,
) -> Result<Vec<FrictionInput<'c>>, Invalid> {
    let mut joints: Vec<FrictionInput<'c>> = (0..)
        .zip(&config.joints)
        .map(|(place, parameters)| FrictionInput {
            parameters,
            place,
            moving: Vec::new(),
            moving_at: Vec::new(),
            held: Vec::new(),
            held_at: Vec::new(),
            has_gravity: false,
        })
        .collect();
    for data in files {
        for recorded in &data.joints {
            let name = config.joint(&recorded.joint).map(|joint| &joint.name);
            let found = joints.iter_mut().find(|joint| Some(&joint.parameters.name) == name);
            match found {
                Some(joint) => problems.extend(add(config, data, recorded, joint)),
                None => {
                    let reason = format!("{}: no joint {}", config.file.display(), recorded.joint);
                    problems.extend(first(data, recorded, "joint", reason));
                }
            }
        }
    }
    joints.retain(|joint| !(joint.moving.is_empty() && joint.held.is_empty()));
    problems.truncate(MAX_PROBLEMS);
    if problems.is_empty() { Ok(joints) } else { Err(Invalid(problems)) }
}

/// Adds the valid readings of one file, and returns the problems of the others.
fn add(
    config: &Config,
    data: &SweepData,
    recorded: &JointSweep,
    joint: &mut FrictionInput<'_>,
) -> Vec<Problem> {
    let mut problems: Vec<Problem> = of_joint(config, data, recorded, joint).into_iter().collect();
    if !problems.is_empty() {
        return problems;
    }
    let file = data.file.file_name().unwrap_or(data.file.as_os_str());
    let file = file.to_string_lossy().into_owned();
    for reading in &recorded.readings {
        let wrong = of_reading(config, data, reading, joint);
        if !wrong.is_empty() {
            problems.extend(wrong);
            continue;
        }
        let torque = torque(config, reading, joint.place);
        let source = Source { file: file.clone(), line: reading.line };
        if let Some(q) = reading.q.filter(|_| reading.is_held()) {
            joint.held.push(PostureReading { q, direction: reading.direction, torque });
            joint.held_at.push(source);
        } else {
            joint.moving.push(Moving { velocity: reading.velocity, torque });
            joint.moving_at.push(source);
        }
    }
    problems
}

/// Returns a problem that concerns all readings of a joint in a file.
fn of_joint(
    config: &Config,
    data: &SweepData,
    recorded: &JointSweep,
    joint: &mut FrictionInput<'_>,
) -> Option<Problem> {
    let name = &joint.parameters.name;
    let is_prismatic = joint.parameters.plant.link.kind == JointKind::Prismatic;
    if is_prismatic != data.is_linear {
        let (kind, column) = if is_prismatic {
            ("prismatic", "velocity_m_per_s")
        } else {
            ("revolute", "velocity_rad_per_s")
        };
        let reason = format!("{name} is {kind}; its velocities must be in a column {column}");
        return first(data, recorded, "joint", reason);
    }
    if rig::is_coupled(config, joint.place) {
        let reason = format!("{name} is coupled with others; no sweep moves it alone");
        return first(data, recorded, "joint", reason);
    }
    let has_gravity = recorded.readings.iter().all(|reading| reading.q.is_some());
    if !joint.moving.is_empty() && joint.has_gravity != has_gravity {
        let reason = format!("q1 to q6 of {name} must be in all files or in none");
        return first(data, recorded, "", reason);
    }
    joint.has_gravity = has_gravity;
    None
}

/// Returns the problems of one reading.
fn of_reading(
    config: &Config,
    data: &SweepData,
    reading: &SweepReading,
    joint: &FrictionInput<'_>,
) -> Vec<Problem> {
    let mut problems = Vec::new();
    let most = joint.parameters.calibration.max_target().0;
    if reading.per_mille.unsigned_abs() > most.unsigned_abs() {
        let found = reading.per_mille;
        let reason = format!("must be within the calibrated range of ±{most} ‰, got {found}");
        problems.push(problem(data, reading.line, "per_mille", reason));
    }
    let positions = reading.q.iter().flatten().zip(&config.joints).zip(1..);
    for ((position, other), number) in positions {
        let [low, high] = other.plant.link.range;
        let (unit, slip) = match other.plant.link.kind {
            JointKind::Revolute => ("rad", "degrees"),
            JointKind::Prismatic => ("m", "mm"),
        };
        let beyond = OUTSIDE * (high - low);
        if !(low - beyond..=high + beyond).contains(position) {
            let range = format!("{low:.4}..={high:.4} {unit} of {}", other.name);
            let reason = format!("must be within {range}, got {position}; {slip}?");
            problems.push(problem(data, reading.line, &format!("q{number}"), reason));
        }
    }
    problems
}

/// Returns the torque of the motor at the joint, minus that of gravity if the reading has a posture.
fn torque(config: &Config, reading: &SweepReading, place: usize) -> f64 {
    let mut actual = [PerMille(0); 6];
    if let Some(joint) = actual.get_mut(place) {
        *joint = PerMille(reading.per_mille);
    }
    let exerted = config.controller.calibration.torques(&actual);
    let gravity = reading.q.map(|q| {
        let arm = &config.controller.arm;
        arm.gravity(&arm.posture(&q.into()))
    });
    let at = |torques: &controller::JointVector| torques.get(place).copied().unwrap_or_default();
    at(&exerted) - gravity.as_ref().map_or(0.0, at)
}

fn first(data: &SweepData, recorded: &JointSweep, key: &str, reason: String) -> Option<Problem> {
    recorded.readings.first().map(|reading| problem(data, reading.line, key, reason))
}

fn problem(data: &SweepData, line: usize, key: &str, reason: String) -> Problem {
    Problem { file: data.file.clone(), line: Some(line), key: key.to_owned(), reason }
}
