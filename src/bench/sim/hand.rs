//! Impedance of the operator's hand: spring and damper between the grip and its desired pose.

use nalgebra::{Isometry3, Vector3};

use units::spatial::{Twist, Wrench};

/// Impedance of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// Translational stiffness, in N/m.
    pub stiffness: f64,
    /// Translational damping, in N·s/m.
    pub damping: f64,
    /// Rotational stiffness, in N·m/rad.
    pub rotational_stiffness: f64,
    /// Rotational damping, in N·m·s/rad.
    pub rotational_damping: f64,
    /// Maximum force of the spring, in N.
    pub max_force: f64,
    /// Maximum moment of the spring, in N·m.
    pub max_moment: f64,
}

impl Default for Hand {
    fn default() -> Self {
        Self::FIRM_NOT_STIFF
    }
}

impl Hand {
    /// Default impedance: firm, not stiff.
    pub const FIRM_NOT_STIFF: Self = Self {
        stiffness: 500.0,
        damping: 15.0,
        rotational_stiffness: 6.0,
        rotational_damping: 0.12,
        max_force: 40.0,
        max_moment: 2.0,
    };

    /// Returns the wrench on the grip, at {G} in {G}, for pose `x_0_g`, twist `v_g` and desired pose `x_0_d`.
    pub fn wrench(&self, x_0_g: &Isometry3<f64>, v_g: &Twist, x_0_d: &Isometry3<f64>) -> Wrench {
        let away = x_0_d.translation.vector - x_0_g.translation.vector;
        let turned = (x_0_g.rotation.inverse() * x_0_d.rotation).scaled_axis();
        let pull = x_0_g.rotation.inverse() * away * self.stiffness;
        let turn = turned * self.rotational_stiffness;
        Wrench {
            force: limited(pull, self.max_force) - v_g.linear * self.damping,
            moment: limited(turn, self.max_moment) - v_g.angular * self.rotational_damping,
        }
    }

    /// Returns the hand with `times` the stiffness and the same damping ratio; its maxima do not change.
    #[must_use]
    pub fn stiffened(&self, times: f64) -> Self {
        // The damping ratio of a given mass is constant if damping grows with the root of the stiffness.
        let root = times.sqrt();
        Self {
            stiffness: self.stiffness * times,
            damping: self.damping * root,
            rotational_stiffness: self.rotational_stiffness * times,
            rotational_damping: self.rotational_damping * root,
            ..*self
        }
    }

    /// Returns the six stiffnesses, in N/m and N·m/rad.
    pub const fn stiffnesses(&self) -> [f64; 6] {
        let (k, c) = (self.stiffness, self.rotational_stiffness);
        [k, k, k, c, c, c]
    }

    /// Returns the six dampings, in N·s/m and N·m·s/rad.
    pub const fn dampings(&self) -> [f64; 6] {
        let (d, c) = (self.damping, self.rotational_damping);
        [d, d, d, c, c, c]
    }
}

/// Returns the vector with at most this magnitude.
fn limited(vector: Vector3<f64>, most: f64) -> Vector3<f64> {
    vector.cap_magnitude(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hand_at_its_desired_pose_has_zero_wrench() {
        let x = Isometry3::translation(0.3, 0.1, -0.2);
        assert_eq!(Hand::default().wrench(&x, &Twist::ZERO, &x), Wrench::ZERO);
    }

    #[test]
    fn force_points_to_the_desired_pose_within_the_maximum() {
        let hand = Hand::default();
        let pull = |away| {
            let x_0_d = Isometry3::translation(away, 0.0, 0.0);
            hand.wrench(&Isometry3::identity(), &Twist::ZERO, &x_0_d).force.x
        };
        assert!((pull(0.01) - 5.0).abs() < 1e-12);
        assert!((pull(-1.0) + hand.max_force).abs() < 1e-12);
    }

    #[test]
    fn stiffened_hand_keeps_damping_ratio_and_maxima() {
        let hand = Hand::default();
        let expected = Hand {
            stiffness: 4.0 * hand.stiffness,
            damping: 2.0 * hand.damping,
            rotational_stiffness: 4.0 * hand.rotational_stiffness,
            rotational_damping: 2.0 * hand.rotational_damping,
            ..hand
        };
        assert_eq!(hand.stiffened(4.0), expected);
        assert_eq!(hand.stiffened(1.0), hand);
    }

    #[test]
    fn damping_dissipates_power() {
        let v_g = Twist::from_components([0.1, -0.2, 0.3, 1.0, -2.0, 0.5]);
        let x = Isometry3::identity();
        assert!(Hand::default().wrench(&x, &v_g, &x).power(&v_g) < 0.0);
    }
}
