//! Servo and friction of one joint over one step.
//!
//! The servo follows a rate that lags the commanded one by its time constant. It has a feed-forward of the torques that
//! this rate needs, and a proportional-integral law around it, five times as fast. Its torque is limited; at the limit
//! the integrator is frozen.
//!
//! Servo and friction act on the rate at the end of the step, which is stable for any gain. A joint that dry friction can
//! hold does not move at all (Stewart and Trinkle 1996):
//!
//! ```text
//!  m v + Σ m_j v_j + h (b v + c sgn v) = p + h clamp(u - k v, ±max)
//! ```

/// Bandwidth of the servo against disturbances, relative to that of its lag.
const STIFFER: f64 = 5.0;

/// Maximum bandwidth, in 1/s: the integrator takes a step of 250 µs at a time.
const MAX_BANDWIDTH: f64 = 1_000.0;

/// Gains of all servos.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gains {
    time_constant: f64,
    /// Per inertia, in 1/s.
    proportional: f64,
    /// Per inertia, in 1/s².
    integral: f64,
}

impl Gains {
    /// Creates gains with two equal poles, for a lag of `time_constant` s.
    pub(super) fn new(time_constant: f64) -> Self {
        let bandwidth = (STIFFER / time_constant).min(MAX_BANDWIDTH);
        Self { time_constant, proportional: 2.0 * bandwidth, integral: bandwidth * bandwidth }
    }
}

/// Friction and torque of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) coulomb: f64,
    pub(super) viscous: f64,
    pub(super) max_torque: f64,
}

/// Servo of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Servo {
    /// Reference rate, in rad/s or m/s.
    rate: f64,
    /// Integral of the rate error, in rad or m.
    integral: f64,
}

impl Servo {
    /// Moves the reference rate towards `commanded` over `h` s; returns its acceleration. A command that is not finite
    /// counts as zero.
    pub(super) fn follow(&mut self, h: f64, gains: &Gains, commanded: f64) -> f64 {
        let commanded = if commanded.is_finite() { commanded } else { 0.0 };
        let change = (commanded - self.rate) * -(-h / gains.time_constant).exp_m1();
        self.rate += change;
        change / h
    }

    /// Returns the joint's law over `h` s with `inertia`, and the torque `carried` by feed-forward.
    pub(super) fn law(
        &self,
        h: f64,
        gains: &Gains,
        limits: &Limits,
        [inertia, carried]: [f64; 2],
    ) -> Law {
        let wanted = gains.proportional * self.rate + gains.integral * self.integral;
        Law {
            dry: h * limits.coulomb,
            viscous: h * limits.viscous,
            offset: h * (carried + inertia * wanted),
            slope: h * inertia * gains.proportional,
            limit: h * limits.max_torque,
        }
    }

    /// Integrates the difference to `rate` over `h` s, unless the torque is at its limit.
    pub(super) fn integrate(&mut self, h: f64, rate: f64, law: &Law) {
        if !law.is_limited(rate) {
            self.integral += h * (self.rate - rate);
        }
    }
}

/// Impulses on one joint over a step, by its rate at the end.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Law {
    dry: f64,
    viscous: f64,
    offset: f64,
    slope: f64,
    limit: f64,
}

impl Law {
    /// Returns the rate of a joint with inertia `own` and all other impulse `left`.
    pub(super) fn rate(&self, own: f64, left: f64) -> f64 {
        let free = beyond(left + self.offset, self.dry) / (own + self.viscous + self.slope);
        let servo = self.offset - self.slope * free;
        if servo.abs() <= self.limit {
            return free;
        }
        beyond(left + self.limit.copysign(servo), self.dry) / (own + self.viscous)
    }

    /// Returns whether the servo is at its limit at `rate`.
    fn is_limited(&self, rate: f64) -> bool {
        (self.offset - self.slope * rate).abs() > self.limit
    }

    /// Returns the impulse of the servo at `rate`.
    pub(super) fn servo(&self, rate: f64) -> f64 {
        (self.offset - self.slope * rate).clamp(-self.limit, self.limit)
    }

    /// Returns the line that the impulses follow near `rate`, as offset and slope; `None` if the joint rests.
    pub(super) fn line(&self, rate: f64) -> Option<[f64; 2]> {
        if rate.abs() <= 0.0 && self.dry > 0.0 {
            return None;
        }
        let dry = if rate.abs() > 0.0 { self.dry.copysign(rate) } else { 0.0 };
        Some(if self.is_limited(rate) {
            [self.servo(rate) - dry, self.viscous]
        } else {
            [self.offset - dry, self.viscous + self.slope]
        })
    }
}

/// Returns the part of `value` outside ±`dry`: dry friction takes the rest.
fn beyond(value: f64, dry: f64) -> f64 {
    value - value.clamp(-dry, dry)
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 250e-6;
    const LIMITS: Limits = Limits { coulomb: 5.0, viscous: 1.0, max_torque: 50.0 };

    #[test]
    fn servo_lags_by_its_time_constant() {
        let (mut servo, gains, mut rate) = (Servo::default(), Gains::new(0.02), 0.0);
        for step in 1..=400_u16 {
            let carried = 2.0 * servo.follow(H, &gains, 0.5);
            let law = servo.law(H, &gains, &Limits { coulomb: 0.0, ..LIMITS }, [2.0, carried]);
            rate = law.rate(2.0, 2.0 * rate);
            servo.integrate(H, rate, &law);
            let ideal = 0.5 * -(-f64::from(step) * H / 0.02).exp_m1();
            assert!((rate - ideal).abs() < 0.01, "{rate} is not {ideal}");
        }
        assert!((rate - 0.5).abs() < 5e-3, "{rate}");
    }

    #[test]
    fn joint_rests_while_friction_holds_and_its_torque_is_limited() {
        let law = Law { dry: H * 5.0, viscous: H, offset: 0.0, slope: 0.0, limit: H * 50.0 };
        assert!(law.rate(1.0, H * 4.9).abs() <= 0.0);
        assert!(law.rate(1.0, H * 5.1) > 0.0);
        let strong = Law { offset: H * 1e3, slope: H * 1e3, ..law };
        let rate = strong.rate(1.0, 0.0);
        assert!((rate * (1.0 + H) - H * 45.0).abs() < 1e-12, "{rate}");
        assert!((strong.servo(rate) - H * 50.0).abs() < 1e-12);
    }

    #[test]
    fn command_that_is_not_finite_is_zero() {
        let mut servo = Servo::default();
        assert!(servo.follow(H, &Gains::new(0.02), f64::NAN).abs() <= 0.0);
        let law = servo.law(H, &Gains::new(0.02), &LIMITS, [1.0, 0.0]);
        assert!(law.rate(1.0, 0.0).abs() <= 0.0);
    }
}
