//! Torque curve and encoder of an actuator.
//!
//! Independent of `controller::calibration`, which has the inverse equations:
//! per mille `p = sign(gear) (c1 t + c3 t³ + c5 t⁵)` for a joint torque `t` in N·m, and
//! counts `n = round(q · counts per revolution · gear / 2π) + zero`.

use std::f64::consts::TAU;

/// Parameters of a motor with its gear and encoder.
#[derive(Clone, Copy, Debug)]
pub struct ActuatorSettings {
    /// Encoder increments per motor revolution.
    pub counts_per_rev: f64,
    /// Motor revolutions per joint revolution; negative if the directions differ.
    pub gear_ratio: f64,
    /// Encoder counts at joint position zero; for a drive 6064h, in its position units.
    pub zero_counts: i32,
    /// Rated torque of the motor, in N·m.
    pub rated_torque: f64,
    /// `c1`, `c3`, `c5` in per mille per N·m, (N·m)³ and (N·m)⁵; the curve rises up to `max_torque`. One that falls is that of a
    /// drive that turns against its torque.
    pub torque_curve: [f64; 3],
    /// Maximum joint torque, in N·m.
    pub max_torque: f64,
}

impl ActuatorSettings {
    /// Returns the rated torque in mN·m (6076h).
    pub fn rated_millis(&self) -> u32 {
        saturated((self.rated_torque * 1e3).round()).unsigned_abs()
    }
}

/// Joint torque for a target torque, in both directions.
#[derive(Clone, Copy, Debug)]
pub struct TorqueCurve {
    forward: Rise,
    /// Curve of negative joint torque.
    reverse: Rise,
    gear_sign: f64,
}

impl TorqueCurve {
    /// Creates the curve of an actuator, equal in both directions.
    pub const fn new(settings: &ActuatorSettings) -> Self {
        let [c1, c3, c5] = settings.torque_curve;
        let sign = c1.signum();
        let rise = Rise::new([c1 * sign, c3 * sign, c5 * sign], settings.max_torque.abs());
        Self { forward: rise, reverse: rise, gear_sign: settings.gear_ratio.signum() * sign }
    }

    /// Replaces `c1`, `c3`, `c5` for negative joint torque.
    #[must_use]
    pub const fn reverse(self, coefficients: [f64; 3]) -> Self {
        Self { reverse: Rise::new(coefficients, self.reverse.max), ..self }
    }

    /// Returns the target, in per mille, for `torque` in N·m; not rounded and not limited.
    pub fn target(&self, torque: f64) -> f64 {
        self.gear_sign * torque.signum() * self.towards(torque).at(torque.abs())
    }

    /// Returns the joint torque in N·m for `target`, in per mille.
    pub fn torque(&self, target: f64) -> f64 {
        let direction = target.signum() * self.gear_sign;
        direction * self.towards(direction).inverse(target.abs())
    }

    const fn towards(&self, direction: f64) -> &Rise {
        if direction < 0.0 { &self.reverse } else { &self.forward }
    }
}

/// Polynomial `c1 t + c3 t³ + c5 t⁵`, which rises from 0 to its end.
#[derive(Clone, Copy, Debug)]
struct Rise {
    coefficients: [f64; 3],
    max: f64,
    /// Value at `max`.
    full: f64,
}

impl Rise {
    const fn new(coefficients: [f64; 3], max: f64) -> Self {
        let mut rise = Self { coefficients, max, full: 0.0 };
        rise.full = rise.at(max);
        rise
    }

    const fn at(&self, torque: f64) -> f64 {
        let [c1, c3, c5] = self.coefficients;
        let square = torque * torque;
        torque * (c1 + square * (c3 + square * c5))
    }

    const fn slope(&self, torque: f64) -> f64 {
        let [c1, c3, c5] = self.coefficients;
        let square = torque * torque;
        c1 + square * (3.0 * c3 + square * 5.0 * c5)
    }

    /// Returns the argument for `wanted`, which is not negative; `max` beyond the range. Newton's method, with
    /// bisection where a step would leave the bracket.
    fn inverse(&self, wanted: f64) -> f64 {
        if self.full <= wanted {
            return self.max;
        }
        let (mut low, mut high) = (0.0, self.max);
        let mut torque = self.max * wanted / self.full;
        for _ in 0..MAX_ITERATIONS {
            let error = self.at(torque) - wanted;
            if error > 0.0 {
                high = torque;
            } else {
                low = torque;
            }
            let newton = torque - error / self.slope(torque);
            let is_inside = newton >= low && newton <= high;
            let next = if is_inside { newton } else { f64::midpoint(low, high) };
            let step = (next - torque).abs();
            torque = next;
            if step <= f64::EPSILON * self.max {
                break;
            }
        }
        torque
    }
}

/// Maximum iterations: enough for bisection alone to reach the precision of an `f64`.
const MAX_ITERATIONS: u32 = 60;

/// Encoder of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    /// Counts per joint revolution, with the sign of the gear.
    counts_per_turn: f64,
    zero: i32,
}

impl Encoder {
    /// Creates the encoder of an actuator.
    pub const fn new(settings: &ActuatorSettings) -> Self {
        let counts_per_turn = settings.counts_per_rev * settings.gear_ratio;
        Self { counts_per_turn, zero: settings.zero_counts }
    }

    /// Returns the increments at `position` in rad: whole, and without a wrap. NaN counts as joint position zero.
    pub fn increments(&self, position: f64) -> f64 {
        let increments = (position * self.counts_per_turn / TAU).round();
        f64::from(self.zero) + if increments.is_nan() { 0.0 } else { increments }
    }

    /// Returns the counts per second at `velocity` in rad/s.
    pub fn rate(&self, velocity: f64) -> i32 {
        saturated((velocity * self.counts_per_turn / TAU).round())
    }
}

/// Converts to i32; saturates.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "a float-to-integer cast saturates; NaN becomes 0"
)]
const fn saturated(rate: f64) -> i32 {
    rate as i32
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn settings(gear_ratio: f64) -> ActuatorSettings {
        ActuatorSettings {
            counts_per_rev: 4_096.0,
            gear_ratio,
            zero_counts: 0,
            rated_torque: 0.2,
            torque_curve: [30.0, 0.0, 0.0],
            max_torque: 10.0,
        }
    }

    fn curve(torque_curve: [f64; 3], gear_ratio: f64, max_torque: f64) -> TorqueCurve {
        TorqueCurve::new(&ActuatorSettings { torque_curve, max_torque, ..settings(gear_ratio) })
    }

    fn encoder(counts_per_rev: f64, gear_ratio: f64, zero_counts: i32) -> Encoder {
        Encoder::new(&ActuatorSettings { counts_per_rev, zero_counts, ..settings(gear_ratio) })
    }

    proptest! {
        #[test]
        fn torque_of_a_target_inverts_the_curve(
            share in -1.0..1.0_f64, max in 0.1..40.0_f64, gear in prop::sample::select(vec![-80.0, 50.0]),
            full in 100.0..2000.0_f64, third in 0.0..1.0_f64, fifth in 0.0..1.0_f64,
        ) {
            let scale = full / (1.0 + third + fifth);
            let coefficients = [scale / max, scale * third / max.powi(3), scale * fifth / max.powi(5)];
            let curve = curve(coefficients, gear, max);
            let torque = share * max;
            let back = curve.torque(curve.target(torque));
            prop_assert!((back - torque).abs() <= 1e-9 * max, "{torque} became {back}");
        }

        #[test]
        fn each_direction_inverts_its_own_curve(torque in -10.0..10.0_f64, third in -0.1..1.0_f64) {
            let curve = curve([30.0, 0.1, 0.0], -80.0, 10.0).reverse([40.0, third / 3.0, 0.002]);
            let back = curve.torque(curve.target(torque));
            prop_assert!((back - torque).abs() <= 1e-12, "{torque} became {back}");
            let other = curve.torque(-curve.target(torque));
            prop_assert!(torque == 0.0 || (other + torque).abs() > 1e-6 * torque.abs());
        }

        #[test]
        fn torque_stays_within_the_joint_maximum(target in any::<i16>()) {
            let curve = curve([30.0, 0.1, 0.0], -80.0, 12.0);
            let torque = curve.torque(f64::from(target));
            prop_assert!(torque.abs() <= 12.0);
            prop_assert!(torque * f64::from(target) <= 0.0, "the gear inverts it");
        }
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "whole numbers are exact")]
    fn joint_revolution_has_the_increments_of_the_gear() {
        let encoder = encoder(4_096.0, -80.0, 1_000);
        assert_eq!(encoder.increments(0.0), 1_000.0);
        assert_eq!(encoder.increments(TAU), 1_000.0 - 4_096.0 * 80.0);
        assert_eq!(encoder.increments(f64::NAN), 1_000.0);
        assert_eq!(encoder.rate(TAU), -4_096 * 80);
    }
}
