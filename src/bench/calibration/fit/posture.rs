//! Gravity from held postures. Dry friction adds to the load or subtracts from it, by the direction of approach, so the
//! mean of both directions is the load alone.

use crate::fit::sample::Direction;

/// Maximum difference of joint positions in one posture, in rad or m.
const SAME: f64 = 0.01;

/// Reading of a joint at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PostureReading {
    /// Positions of all joints, in rad or m.
    pub q: [f64; 6],
    /// Direction of the approach.
    pub direction: Direction,
    /// Torque of the motor at the joint minus that of the gravity model, in N·m or N.
    pub torque: f64,
}

/// Error of the gravity model and friction in one posture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    /// Positions of all joints, in rad or m.
    pub q: [f64; 6],
    /// Load minus gravity model, in N·m or N; `None` with readings of one direction only.
    pub error: Option<f64>,
    /// Friction at rest, in N·m or N: half the difference of both directions.
    pub friction: Option<f64>,
    /// Index of the first reading of the posture, from 0.
    pub place: usize,
}

/// Groups readings by posture, in the order of their first readings.
pub fn postures(readings: &[PostureReading]) -> Vec<Posture> {
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
        let held = |at: f64, direction, torque| PostureReading {
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
