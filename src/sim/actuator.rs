//! Motor, gear and encoder of one joint: what a target torque really exerts, and what is counted.
//!
//! The torque curve of the paper's Fig. 6, `p = sign(N) (c1 t + c3 t³ + c5 t⁵)` in per mille of rated
//! torque for a joint torque t, is inverted here: the drive is given p and exerts t.

use std::f64::consts::TAU;

/// What one joint's drive moves.
#[derive(Clone, Copy, Debug)]
pub struct ActuatorSettings {
    /// Encoder counts per revolution of the motor.
    pub counts_per_rev: f64,
    /// Motor revolutions per joint revolution; negative where they turn against each other.
    pub gear_ratio: f64,
    /// Counts at joint position zero.
    pub zero_counts: i32,
    /// Rated torque of the motor, in N·m.
    pub rated_torque: f64,
    /// c1, c3, c5.
    pub torque_curve: [f64; 3],
    /// Where the curve ends, in N·m at the joint.
    pub max_torque: f64,
}

/// A motor with gear and encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Actuator {
    settings: ActuatorSettings,
    per_mille: i16,
    torque: f64,
}

/// Halvings that find a torque to the last bit.
const HALVINGS: u32 = 60;

impl Actuator {
    pub(super) const fn new(settings: ActuatorSettings) -> Self {
        Self { settings, per_mille: 0, torque: 0.0 }
    }

    /// The joint torque of `per_mille` of rated torque, in N·m.
    pub(super) fn exert(&mut self, per_mille: i16) -> f64 {
        if per_mille != self.per_mille {
            self.per_mille = per_mille;
            self.torque = self.settings.torque(f64::from(per_mille));
        }
        self.torque
    }

    /// What the encoder counts at a joint position in rad. Counts wrap.
    pub(super) fn counts(&self, position: f64) -> i32 {
        let turns = position / TAU * self.settings.gear_ratio;
        wrapped(turns * self.settings.counts_per_rev).wrapping_add(self.settings.zero_counts)
    }

    /// Counts per second at a joint velocity in rad/s.
    pub(super) fn count_rate(&self, velocity: f64) -> i32 {
        wrapped(velocity / TAU * self.settings.gear_ratio * self.settings.counts_per_rev)
    }

    /// Rated torque as 6076h has it, in mN·m.
    pub(super) fn rated_torque(&self) -> u32 {
        wrapped(self.settings.rated_torque * 1e3).unsigned_abs()
    }
}

impl ActuatorSettings {
    /// By halving: the curve rises all the way to its end.
    fn torque(&self, per_mille: f64) -> f64 {
        let [c1, c3, c5] = self.torque_curve;
        let curve = |t: f64| t * (c1 + t * t * (c3 + t * t * c5));
        let (mut low, mut high) = (0.0, self.max_torque);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if curve(middle) < per_mille.abs() { low = middle } else { high = middle }
        }
        if per_mille.abs() > 0.0 {
            high.copysign(per_mille * self.gear_ratio.signum())
        } else {
            0.0
        }
    }
}

/// The nearest whole number, wrapped into 32 bits as a counter is.
fn wrapped(value: f64) -> i32 {
    let span = 2_f64.powi(32);
    let folded = (value.round() + span / 2.0).rem_euclid(span) - span / 2.0;
    #[expect(
        clippy::as_conversions,
        clippy::cast_possible_truncation,
        reason = "folded into the range of i32; NaN becomes 0"
    )]
    let whole = folded as i32;
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINT: ActuatorSettings = ActuatorSettings {
        counts_per_rev: 16_384.0,
        gear_ratio: -40.0,
        zero_counts: 1_200,
        rated_torque: 0.1765,
        torque_curve: [133.144, -0.393_453, 0.019_672_6],
        max_torque: 6.0,
    };

    #[test]
    fn the_torque_of_a_target_inverts_the_curve() {
        let [c1, c3, c5] = JOINT.torque_curve;
        for per_mille in [-850_i16, -100, -1, 0, 1, 7, 500, 860] {
            let t = Actuator::new(JOINT).exert(per_mille);
            let back = -(c1 * t + c3 * t.powi(3) + c5 * t.powi(5));
            assert!((back - f64::from(per_mille)).abs() < 1e-9, "{per_mille}: {t} N·m");
        }
    }

    #[test]
    fn beyond_its_end_the_curve_gives_no_more() {
        assert!((Actuator::new(JOINT).exert(-3_000) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn counts_turn_with_the_motor_and_wrap() {
        let actuator = Actuator::new(JOINT);
        assert_eq!(actuator.counts(0.0), 1_200);
        assert_eq!(actuator.counts(TAU), 1_200 - 40 * 16_384);
        assert_eq!(wrapped(2_f64.powi(31)), i32::MIN);
    }
}
