//! Reading of a joint against a load cell.

use derive_more::Display;

/// Driving direction of a joint at a sample.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum Direction {
    /// Rising torque.
    #[display("up")]
    Up,
    /// Falling torque.
    #[display("down")]
    Down,
}

impl Direction {
    /// Returns +1 for up, -1 for down.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Up => 1.0,
            Self::Down => -1.0,
        }
    }
}

/// Reading of a joint at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Load cell reading, in N·m at the joint (N for a prismatic joint).
    pub torque: f64,
    /// Target torque (6071h), in ‰ of rated torque.
    pub per_mille: f64,
    /// Driving direction.
    pub direction: Direction,
}

/// Sample excluded from a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Index among the samples, from 0.
    pub place: usize,
    /// Distance of the reading from the fit, in N·m or N.
    pub distance: f64,
}

/// Returns the largest torque with samples of both directions on both sides of zero, in N·m.
pub(super) fn range(samples: &[Sample]) -> f64 {
    let reach = |direction, sign: f64| {
        let of = samples.iter().filter(|sample| sample.direction == direction);
        of.map(|sample| sign * sample.torque).reduce(f64::max)
    };
    let ways = [Direction::Up, Direction::Down];
    let reaches = ways.into_iter().flat_map(|way| [reach(way, 1.0), reach(way, -1.0)]);
    reaches.flatten().reduce(f64::min).unwrap_or(0.0)
}
