//! Hands on the links of an unpowered arm, which guide its joints to a posture and hold them there.
//!
//! Before an arming after a boot an operator lays the arm down like that; at a second rest position one joint is moved.

use crate::arm::Joints;

/// Speed of the guided motion, in rad/s.
const ROTATION_SPEED: f64 = 2.0;

/// Speed of the guided motion of a prismatic joint, in m/s.
const TRANSLATION_SPEED: f64 = 0.4;

/// Natural frequency of the hands, in rad/s: much stiffer than an arm needs to follow.
const FREQUENCY: f64 = 100.0;

/// Guided motion of all joints.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Guide {
    target: Joints,
    /// Present set point; it moves towards the target.
    set_point: Joints,
}

impl Guide {
    /// Starts at the posture `q` towards `target`, in rad (m).
    pub(crate) const fn new(q: Joints, target: Joints) -> Self {
        Self { target, set_point: q }
    }

    /// Returns the joint accelerations of the hands on joints at `q` that move at `qd`, after `h` s, in rad/s² (m/s²).
    pub(crate) fn step(
        &mut self,
        h: f64,
        is_prismatic: &[bool; 6],
        q: &Joints,
        qd: &Joints,
    ) -> Joints {
        let places = self.set_point.iter_mut().zip(self.target.iter()).zip(is_prismatic);
        for ((set_point, target), is_prismatic) in places {
            let speed = if *is_prismatic { TRANSLATION_SPEED } else { ROTATION_SPEED };
            *set_point += (target - *set_point).clamp(-speed * h, speed * h);
        }
        (self.set_point - q) * FREQUENCY.powi(2) - qd * (2.0 * FREQUENCY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_arrive_at_the_target_and_stay() {
        let (mut q, mut qd) = (Joints::zeros(), Joints::zeros());
        let mut guide = Guide::new(q, Joints::repeat(0.5));
        let mut fastest = 0.0_f64;
        for _ in 0..20_000 {
            let h = 5e-5;
            qd += guide.step(h, &[false; 6], &q, &qd) * h;
            q += qd * h;
            fastest = fastest.max(qd.amax());
        }
        assert!((q - Joints::repeat(0.5)).amax() < 1e-6 && qd.amax() < 1e-6, "{q}");
        assert!(fastest < 1.2 * ROTATION_SPEED, "{fastest}");
    }
}
