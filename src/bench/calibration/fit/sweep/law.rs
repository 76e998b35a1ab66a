//! Fit of Coulomb and viscous friction: a line per direction through torques over velocities.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use thiserror::Error;

use crate::fit::robust::{self, chosen};
use crate::fit::sample::{Direction, Outlier};
use crate::least_squares::{self, Solution};

/// Minimum number of readings in each direction.
const LEAST: usize = 6;
/// Minimum number of different speeds in each direction.
const SPEEDS: usize = 3;
/// Minimum difference of two speeds, relative to the largest.
const APART: f64 = 0.1;

/// Reading of a joint at a constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// Velocity of the joint in rad/s or m/s, not zero.
    pub velocity: f64,
    /// Torque of the motor at the joint minus that of gravity, in N·m or N.
    pub torque: f64,
}

/// Fitted parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Value by least squares.
    pub value: f64,
    /// Standard deviation, if the residuals are independent noise.
    pub deviation: f64,
}

/// Friction in one direction, or in both.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Law {
    /// Coulomb friction, in N·m or N.
    pub coulomb: Estimate,
    /// Viscous friction, in N·m·s/rad or N·s/m.
    pub viscous: Estimate,
    /// RMS residual, in N·m or N.
    pub rms: f64,
    /// Number of readings.
    pub readings: usize,
}

/// Fitted friction of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointFriction {
    /// Friction at positive velocities.
    pub up: Law,
    /// Friction at negative velocities.
    pub down: Law,
    /// Friction of both directions together, for the configuration.
    pub both: Law,
    /// Constant torque in addition to friction, in N·m or N.
    pub load: Estimate,
    /// Fastest speed, in rad/s or m/s.
    pub fastest: f64,
    /// Readings excluded from the fit.
    pub outliers: Vec<Outlier>,
}

/// Reason why readings give no friction.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum NoFriction {
    /// No reading in one direction.
    #[error("no reading moves {0}; friction needs both directions")]
    DirectionMissing(Direction),
    /// Too few readings in one direction.
    #[error("{found} readings move {direction}, and at least {LEAST} are needed")]
    TooFew {
        /// Direction of the motion.
        direction: Direction,
        /// Number of readings.
        found: usize,
    },
    /// Too few speeds in one direction.
    #[error(
        "the readings that move {direction} have {found} different speeds, and at least {SPEEDS} are needed, \
         10 % of the largest apart"
    )]
    TooFewSpeeds {
        /// Direction of the motion.
        direction: Direction,
        /// Number of speeds.
        found: usize,
    },
}

impl JointFriction {
    /// Fits the readings of one joint; `resolution` is the torque of one step of the target, in N·m or N. Unless
    /// `has_gravity`, gravity was not subtracted: the fitted load is then subtracted from each direction.
    ///
    /// # Errors
    /// Returns an error if the readings do not determine friction in both directions.
    pub fn fit(
        readings: &[Moving],
        resolution: f64,
        has_gravity: bool,
    ) -> Result<Self, NoFriction> {
        let ways = [Direction::Up, Direction::Down];
        for direction in ways {
            check(&driven(readings, direction), direction)?;
        }
        let (is_kept, outliers) = select(readings, resolution);
        let kept = chosen(readings, &is_kept);
        for direction in ways {
            check(&driven(&kept, direction), direction)?;
        }
        let undetermined = NoFriction::TooFewSpeeds { direction: Direction::Up, found: 1 };
        let (both, load) = pooled(&kept).ok_or(undetermined)?;
        let known = if has_gravity { 0.0 } else { load.value };
        let [up, down] = ways.map(|direction| {
            let undetermined = NoFriction::TooFewSpeeds { direction, found: 1 };
            one_way(&driven(&kept, direction), direction, known).ok_or(undetermined)
        });
        let speeds = kept.iter().map(|reading| reading.velocity.abs());
        let fastest = speeds.fold(0.0, f64::max);
        Ok(Self { up: up?, down: down?, both, load, fastest, outliers })
    }
}

fn direction(reading: &Moving) -> Direction {
    if reading.velocity > 0.0 { Direction::Up } else { Direction::Down }
}

fn driven(readings: &[Moving], way: Direction) -> Vec<Moving> {
    readings.iter().filter(|reading| direction(reading) == way).copied().collect()
}

/// Checks that the readings of one direction are many enough, and of different speeds.
fn check(readings: &[Moving], direction: Direction) -> Result<(), NoFriction> {
    if readings.is_empty() {
        return Err(NoFriction::DirectionMissing(direction));
    }
    if readings.len() < LEAST {
        return Err(NoFriction::TooFew { direction, found: readings.len() });
    }
    let mut speeds: Vec<f64> = readings.iter().map(|reading| reading.velocity.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    let apart = APART * speeds.last().copied().unwrap_or_default();
    let (mut found, mut last) = (0, f64::NEG_INFINITY);
    for speed in speeds {
        if speed > last + apart {
            (found, last) = (found + 1, speed);
        }
    }
    if found < SPEEDS { Err(NoFriction::TooFewSpeeds { direction, found }) } else { Ok(()) }
}

/// Returns a flag per reading, set for those near the line of their direction, and the outliers.
fn select(readings: &[Moving], resolution: f64) -> (Vec<bool>, Vec<Outlier>) {
    let mut is_kept = vec![true; readings.len()];
    let mut outliers = Vec::new();
    for way in [Direction::Up, Direction::Down] {
        let (places, driven): (Vec<usize>, Vec<&Moving>) =
            readings.iter().enumerate().filter(|(_, reading)| direction(reading) == way).unzip();
        let a = DMatrix::from_fn(driven.len(), 2, |row, column| {
            let speed = driven.get(row).map_or(0.0, |reading| reading.velocity.abs());
            if column == 0 { 1.0 } else { speed }
        });
        let b = DVector::from_iterator(driven.len(), driven.iter().map(|reading| reading.torque));
        let Some(unknowns) = robust::least_absolute(&a, &b) else { continue };
        let distances = &b - a * unknowns;
        let flags = robust::inliers(distances.as_slice(), resolution);
        for ((place, distance), is_inlier) in places.into_iter().zip(distances.iter()).zip(flags) {
            if let Some(flag) = is_kept.get_mut(place).filter(|_| !is_inlier) {
                *flag = false;
                outliers.push(Outlier { place, distance: *distance });
            }
        }
    }
    outliers.sort_by_key(|outlier| outlier.place);
    (is_kept, outliers)
}

/// Returns friction and load of both directions together.
fn pooled(readings: &[Moving]) -> Option<(Law, Estimate)> {
    let rows =
        readings.iter().flat_map(|reading| [1.0, reading.velocity.signum(), reading.velocity]);
    let (solution, [load, coulomb, viscous]) = solve(readings, rows)?;
    Some((law(&solution, coulomb, viscous), load))
}

/// Returns friction in one direction, in addition to a known load.
fn one_way(readings: &[Moving], direction: Direction, load: f64) -> Option<Law> {
    let loaded: Vec<Moving> =
        readings.iter().map(|r| Moving { torque: r.torque - load, ..*r }).collect();
    let rows = readings.iter().flat_map(|reading| [direction.sign(), reading.velocity]);
    let (solution, [coulomb, viscous]) = solve(&loaded, rows)?;
    Some(law(&solution, coulomb, viscous))
}

fn law(solution: &Solution, coulomb: Estimate, viscous: Estimate) -> Law {
    let residuals = &solution.residuals;
    let rms = residuals.map(|residual| residual * residual).mean().sqrt();
    Law { coulomb, viscous, rms, readings: residuals.len() }
}

/// Solves for the torques of readings; `None` if the rows do not determine the unknowns.
fn solve<const P: usize>(
    readings: &[Moving],
    rows: impl Iterator<Item = f64>,
) -> Option<(Solution, [Estimate; P])> {
    let a = DMatrix::from_row_iterator(readings.len(), P, rows);
    let b = DVector::from_iterator(readings.len(), readings.iter().map(|reading| reading.torque));
    let solution = least_squares::solve(&a, &b)?;
    let found = solution.unknowns.iter().zip(solution.deviations.iter());
    let found = found.map(|(value, deviation)| Estimate { value: *value, deviation: *deviation });
    let found = found.collect::<Vec<_>>().try_into().ok()?;
    Some((solution, found))
}
