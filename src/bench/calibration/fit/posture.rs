//! Gravity from held postures: dry friction holds a joint on either side of its load, so the mean of a posture that
//! was approached from below and from above is the load alone.

use crate::fit::sample::Direction;

/// Largest difference of positions in one posture, in rad or m.
const SAME: f64 = 0.01;

/// A joint at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Positions of all joints, in rad or m.
    pub q: [f64; 6],
    /// Direction in which the joint came there.
    pub direction: Direction,
    /// Torque of the motor at the joint less that of gravity, in N·m or N.
    pub torque: f64,
}

/// One posture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    /// Positions of all joints, in rad or m.
    pub q: [f64; 6],
    /// Load less gravity, in N·m or N; `None` where the joint came from one side only.
    pub error: Option<f64>,
    /// Half of the distance of the two sides, in N·m or N: friction at rest.
    pub friction: Option<f64>,
    /// Place of its first reading, from 0.
    pub place: usize,
}

/// Returns the postures of readings, in the order of their first readings.
pub fn postures(readings: &[Held]) -> Vec<Posture> {
    let mut postures: Vec<Posture> = Vec::new();
    for (place, reading) in readings.iter().enumerate() {
        let is_here = |other: &[f64; 6]| {
            other.iter().zip(&reading.q).all(|(other, here)| (other - here).abs() <= SAME)
        };
        if postures.iter().any(|posture| is_here(&posture.q)) {
            continue;
        }
        let mean = |way: Direction| {
            let side = readings.iter().filter(|r| r.direction == way && is_here(&r.q));
            let torques: Vec<f64> = side.map(|reading| reading.torque).collect();
            let count = u32::try_from(torques.len()).ok().filter(|count| *count > 0)?;
            Some(torques.iter().sum::<f64>() / f64::from(count))
        };
        let sides = mean(Direction::Up).zip(mean(Direction::Down));
        postures.push(Posture {
            q: reading.q,
            error: sides.map(|(up, down)| f64::midpoint(up, down)),
            friction: sides.map(|(up, down)| (up - down) / 2.0),
            place,
        });
    }
    postures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_of_both_sides_is_the_load() {
        let held = |at: f64, direction, torque| Held {
            q: [0.0, at, 0.0, 0.0, 0.0, 0.0],
            direction,
            torque,
        };
        let (up, down) = (Direction::Up, Direction::Down);
        let readings = [
            held(0.5, up, 0.07),
            held(0.504, down, -0.05),
            held(1.0, up, 0.06),
            held(0.498, up, 0.07),
            held(1.2, down, -0.06),
            held(1.0, down, -0.06),
        ];
        let found = postures(&readings);
        assert_eq!(found.iter().map(|p| p.place).collect::<Vec<_>>(), [0, 2, 4]);
        assert!((found[0].error.unwrap() - 0.01).abs() < 1e-12);
        assert!((found[0].friction.unwrap() - 0.06).abs() < 1e-12);
        assert!(found[1].error.unwrap().abs() < 1e-12);
        assert_eq!(found[2].error, None);
    }
}
