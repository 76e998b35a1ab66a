//! Cradle: the support of an unpowered arm, until its drives carry it.
//!
//! It only lifts joints, yields slightly under the weight, and is removed once the drives carry most of the weight. Without
//! it an operator would have to hold the arm, in an unknown posture.

use crate::arm::Joints;

/// Deflection of a joint under its full gravity torque, in rad (m): a tenth of a degree, less than that of a hand at rest.
const DEFLECTION: f64 = 0.002;

/// Ratio of damping to stiffness, in s.
const DAMPING_TIME: f64 = 0.02;

/// Share of the weight on the cradle below which it is removed.
const LEFT_BELOW: f64 = 0.2;

/// Cradle of an arm.
#[derive(Clone, Copy, Debug)]
pub struct Cradle {
    /// Rest positions, in rad (m).
    rest: Joints,
    /// Torques that carry the supported joints at rest, in N·m (N); zero for joints that the cradle does not support.
    weight: Joints,
    is_left: bool,
}

impl Cradle {
    /// Creates an absent cradle, which exerts no torque.
    pub fn none() -> Self {
        Self { rest: Joints::zeros(), weight: Joints::zeros(), is_left: true }
    }

    /// Creates a cradle at `rest`, in rad (m), for joints that need these torques there, in N·m (N).
    pub const fn new(rest: Joints, weight: Joints) -> Self {
        Self { rest, weight, is_left: false }
    }

    /// Returns the torques on the joints at `q`, in rad (m), moving at `qd`, in N·m (N).
    pub fn step(&mut self, q: &Joints, qd: &Joints) -> Joints {
        if self.is_left {
            return Joints::zeros();
        }
        let lift = self.weight.map(f64::signum);
        let sunk = (self.rest - q - qd * DAMPING_TIME).component_mul(&lift) / DEFLECTION;
        let tau = sunk.zip_map(&self.weight, |sunk, weight| (1.0 + sunk).max(0.0) * weight);
        self.is_left = tau.abs().sum() < LEFT_BELOW * self.weight.abs().sum();
        tau
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(second: f64) -> Joints {
        Joints::from([0.0, second, 0.0, 0.0, 0.0, 0.0])
    }

    #[test]
    fn weight_is_carried_at_rest_and_nothing_above() {
        let mut cradle = Cradle::new(joints(-0.8), joints(-5.0));
        let still = Joints::zeros();
        assert!((cradle.step(&joints(-0.8), &still)[1] + 5.0).abs() < 1e-9);
        // Negative torque lifts this joint: it sinks towards positive positions.
        assert!((cradle.step(&joints(-0.8 + DEFLECTION), &still)[1] + 10.0).abs() < 1e-9);
        assert!(cradle.step(&joints(-0.8 - 0.5 * DEFLECTION), &still)[1] < 0.0);
    }

    #[test]
    fn lifted_arm_is_not_supported_again() {
        let (mut cradle, still) = (Cradle::new(joints(-0.8), joints(-5.0)), Joints::zeros());
        assert_eq!(cradle.step(&joints(-0.9), &still), still);
        assert_eq!(cradle.step(&joints(-0.7), &still), still);
    }

    #[test]
    fn no_cradle_supports_nothing() {
        assert_eq!(Cradle::none().step(&joints(1.0), &joints(1.0)), joints(0.0));
    }
}
