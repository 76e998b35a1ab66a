//! One measurement of a joint against a load cell.

use derive_more::Display;

/// Which way a joint was driven when a sample was taken.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Direction {
    /// Its torque rose.
    #[display("up")]
    Up,
    /// Its torque fell.
    #[display("down")]
    Down,
}

impl Direction {
    /// +1 up, -1 down.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Up => 1.0,
            Self::Down => -1.0,
        }
    }
}

/// One measurement at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Load cell reading, in N·m at the joint (N for a sliding joint).
    pub torque: f64,
    /// Target torque (6071h), in ‰ of rated torque.
    pub per_mille: f64,
    /// Which way the joint was driven.
    pub direction: Direction,
}

/// A sample that belongs to no curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Its place among the samples, from 0.
    pub place: usize,
    /// Its reading less that of the curve, in N·m.
    pub distance: f64,
}

/// Range within which both directions were measured on both sides of zero, in N·m.
pub(super) fn range(samples: &[Sample]) -> f64 {
    let reach = |direction, sign: f64| {
        let of = samples.iter().filter(|sample| sample.direction == direction);
        of.map(|sample| sign * sample.torque).reduce(f64::max)
    };
    let ways = [Direction::Up, Direction::Down];
    let reaches = ways.into_iter().flat_map(|way| [reach(way, 1.0), reach(way, -1.0)]);
    reaches.flatten().reduce(f64::min).unwrap_or(0.0)
}
