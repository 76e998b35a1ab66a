//! The operator's hand: a spring and a damper between the grip and where the hand wants it.

use nalgebra::Isometry3;
use nalgebra::Vector3;

use units::spatial::Twist;
use units::spatial::Wrench;

/// A hand's impedance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hand {
    /// In N/m.
    pub stiffness: f64,
    /// In N·s/m.
    pub damping: f64,
    /// In N·m/rad.
    pub turning_stiffness: f64,
    /// In N·m·s/rad.
    pub turning_damping: f64,
    /// The most it pulls, in N.
    pub max_force: f64,
    /// The most it turns, in N·m.
    pub max_moment: f64,
}

impl Default for Hand {
    fn default() -> Self {
        Self::FIRM_NOT_STIFF
    }
}

impl Hand {
    /// A hand that holds firmly but not stiffly.
    pub const FIRM_NOT_STIFF: Self = Self {
        stiffness: 500.0,
        damping: 15.0,
        turning_stiffness: 6.0,
        turning_damping: 0.12,
        max_force: 40.0,
        max_moment: 2.0,
    };

    /// The wrench on the grip, at {G} in {G}, when it is at `x_0_g` with twist `v_g` and wanted at
    /// `x_0_d`.
    pub fn wrench(&self, x_0_g: &Isometry3<f64>, v_g: &Twist, x_0_d: &Isometry3<f64>) -> Wrench {
        let away = x_0_d.translation.vector - x_0_g.translation.vector;
        let turned = (x_0_g.rotation.inverse() * x_0_d.rotation).scaled_axis();
        let pull = x_0_g.rotation.inverse() * away * self.stiffness;
        let turn = turned * self.turning_stiffness;
        Wrench {
            force: limited(pull, self.max_force) - v_g.linear * self.damping,
            moment: limited(turn, self.max_moment) - v_g.angular * self.turning_damping,
        }
    }

    /// The same hand `times` as stiff and as well damped as before; not stronger.
    #[must_use]
    pub fn stiffened(&self, times: f64) -> Self {
        // A given mass on a spring and a damper keeps its damping ratio.
        let root = times.sqrt();
        Self {
            stiffness: self.stiffness * times,
            damping: self.damping * root,
            turning_stiffness: self.turning_stiffness * times,
            turning_damping: self.turning_damping * root,
            ..*self
        }
    }

    /// Its six stiffnesses, in N/m and N·m/rad.
    pub const fn stiffnesses(&self) -> [f64; 6] {
        let (k, c) = (self.stiffness, self.turning_stiffness);
        [k, k, k, c, c, c]
    }

    /// Its six dampings, in N·s/m and N·m·s/rad.
    pub const fn dampings(&self) -> [f64; 6] {
        let (d, c) = (self.damping, self.turning_damping);
        [d, d, d, c, c, c]
    }
}

/// The same direction, no longer than `most`.
fn limited(vector: Vector3<f64>, most: f64) -> Vector3<f64> {
    vector.cap_magnitude(most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_that_is_where_it_wants_to_be_does_nothing() {
        let x = Isometry3::translation(0.3, 0.1, -0.2);
        assert_eq!(Hand::default().wrench(&x, &Twist::ZERO, &x), Wrench::ZERO);
    }

    #[test]
    fn it_pulls_towards_its_aim_and_no_harder_than_it_can() {
        let hand = Hand::default();
        let pull = |away| {
            let x_0_d = Isometry3::translation(away, 0.0, 0.0);
            hand.wrench(&Isometry3::identity(), &Twist::ZERO, &x_0_d).force.x
        };
        assert!((pull(0.01) - 5.0).abs() < 1e-12);
        assert!((pull(-1.0) + hand.max_force).abs() < 1e-12);
    }

    #[test]
    fn a_stiffened_hand_is_damped_as_well_and_no_stronger() {
        let hand = Hand::default();
        let expected = Hand {
            stiffness: 4.0 * hand.stiffness,
            damping: 2.0 * hand.damping,
            turning_stiffness: 4.0 * hand.turning_stiffness,
            turning_damping: 2.0 * hand.turning_damping,
            ..hand
        };
        assert_eq!(hand.stiffened(4.0), expected);
        assert_eq!(hand.stiffened(1.0), hand);
    }

    #[test]
    fn its_damping_takes_power() {
        let v_g = Twist::from_components([0.1, -0.2, 0.3, 1.0, -2.0, 0.5]);
        let x = Isometry3::identity();
        assert!(Hand::default().wrench(&x, &v_g, &x).power(&v_g) < 0.0);
    }
}
