//! Cradle: the support of an unpowered arm, until its operator lifts it out.
//!
//! It only lifts joints, yields slightly under the weight, and is gone once the drives push: the operator has lifted the arm out, and holds
//! what they do not carry. Without it an operator would have to hold the arm, in an unknown posture.

use crate::arm::Joints;

/// Deflection of a joint under its full gravity torque, in rad (m): a tenth of a degree, less than that of a hand at rest.
const DEFLECTION: f64 = 0.002;

/// Ratio of damping to stiffness, in s.
const DAMPING_TIME: f64 = 0.02;

/// Cradle of an arm.
#[derive(Clone, Copy, Debug)]
pub struct Cradle {
    /// Rest positions, in rad (m).
    rest: Joints,
    /// Torques that carry the supported joints at rest, in N·m (N); zero for joints that the cradle does not support.
    weight: Joints,
    is_left: bool,
    /// Stays in its place when the arm has left it.
    is_fixed: bool,
}

impl Cradle {
    /// Creates an absent cradle, which exerts no torque.
    pub fn none() -> Self {
        Self { rest: Joints::zeros(), weight: Joints::zeros(), is_left: true, is_fixed: false }
    }

    /// Creates a cradle at `rest`, in rad (m), for joints that need these torques there, in N·m (N).
    pub const fn new(rest: Joints, weight: Joints) -> Self {
        Self { rest, weight, is_left: false, is_fixed: false }
    }

    /// Returns the rest positions of a cradle that supports any joint, in rad (m).
    pub fn rest(&self) -> Option<&Joints> {
        (self.weight.amax() > 0.0).then_some(&self.rest)
    }

    /// Returns whether the arm was lifted out.
    pub const fn is_left(&self) -> bool {
        self.is_left
    }

    /// Returns the same cradle that stays in its place, where an arm may return to it, with other rest positions, in rad (m).
    #[must_use]
    pub const fn fixed(self, rest: Joints) -> Self {
        Self { rest, is_fixed: true, is_left: false, ..self }
    }

    /// Supports the arm again, which was laid down.
    pub const fn renew(&mut self) {
        self.is_left = false;
    }

    /// Returns the torques on the joints at `q`, in rad (m), moving at `qd`, in N·m (N). `is_pushed` while drives push.
    pub fn step(&mut self, is_pushed: bool, q: &Joints, qd: &Joints) -> Joints {
        self.is_left |= is_pushed && !self.is_fixed;
        if self.is_left {
            return Joints::zeros();
        }
        let lift = self.weight.map(f64::signum);
        let sunk = (self.rest - q - qd * DAMPING_TIME).component_mul(&lift) / DEFLECTION;
        sunk.zip_map(&self.weight, |sunk, weight| (1.0 + sunk).max(0.0) * weight)
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
        assert!((cradle.step(false, &joints(-0.8), &still)[1] + 5.0).abs() < 1e-9);
        // Negative torque lifts this joint: it sinks towards positive positions.
        assert!((cradle.step(false, &joints(-0.8 + DEFLECTION), &still)[1] + 10.0).abs() < 1e-9);
        assert!(cradle.step(false, &joints(-0.8 - 0.5 * DEFLECTION), &still)[1] < 0.0);
    }

    #[test]
    fn arm_is_lifted_out_once_drives_push() {
        let (mut cradle, still) = (Cradle::new(joints(-0.8), joints(-5.0)), Joints::zeros());
        assert_eq!(cradle.step(true, &joints(-0.8), &still), still);
        assert_eq!(cradle.step(false, &joints(-0.7), &still), still);
        cradle.renew();
        assert!((cradle.step(false, &joints(-0.8), &still)[1] + 5.0).abs() < 1e-9);
    }

    #[test]
    fn no_cradle_supports_nothing() {
        assert_eq!(Cradle::none().step(false, &joints(1.0), &joints(1.0)), joints(0.0));
    }
}
