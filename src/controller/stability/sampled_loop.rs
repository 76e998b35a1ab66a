//! Sampled loop of one axis: device and hand, law, object and surface, with all delays.
//!
//! The model is exact for a linear loop. The mass in the hand moves under a force held for a period (zero-order hold);
//! the rest is a difference equation per cycle. `w = z⁻¹` delays by one cycle, `x` is the sampled position of the grip, and
//! `o` that of the object:
//!
//! ```text
//!  M ẍ = F - (b + b_h) ẋ - K_h x      F held for a period
//!  damping   F = -w K_D v,            v ((T + τ) - τ w) = (1 - w) x
//!  layer     F = -w d (1 - w) x/T
//!  pose      o = p w/(1 - (1 - p) w) K_P x,   p = 1 - exp(-T/τ_s),   F = -w² K_T S o
//!  rate      o = p w T K_V x / ((1 - w)(1 - (1 - p) w) + p w T K_FA S),   F = -w² K_T S o
//!  surface   S = k_e + d_e (1 - w)/T
//! ```
//!
//! A link adds its cycles to the path from command to wrench. The sensor of a robot arm reads the mean of a cycle,
//! `(1 + w)/2`, and its computer commands the joints a cycle later.

use nalgebra::{Matrix3, Vector3};

use crate::stability::axis::{Axis, Impedance, Timing};
use crate::stability::grip_dynamics::ReducedGrip;
use crate::stability::polynomial::Polynomial;
use units::math;

/// Halvings of the matrix before the exponential series, and terms of the series.
const HALVINGS: i32 = 6;
const TERMS: u32 = 12;

/// Loop that gains close over one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loop {
    /// K_D alone, in free motion.
    Damping,
    /// K_D and the maximum damping of the passivity layer.
    PassivityDamper,
    /// K_D and the maximum stiffness of the return to centre, in free motion.
    Centring,
    /// K_D and contact in pose mode.
    Pose,
    /// K_D and the virtual coupling of pose mode.
    Coupling,
    /// K_D and contact in rate mode.
    Rate,
}

/// Loop of one axis, with device and hand at one posture.
#[derive(Clone, Copy, Debug)]
pub struct SampledLoop<'a> {
    /// Gains, surface, period and delays.
    pub axis: &'a Axis,
    /// Grip in a hand, K_D included.
    pub grip: ReducedGrip,
    /// Delay of a link from command to wrench, in cycles.
    pub link_cycles: u32,
}

impl SampledLoop<'_> {
    /// Returns the characteristic polynomial of the loop in two parts: without the loop's gain, and the contribution of that
    /// gain. It is K_D, the layer's damper, F0, K_T or K_vc. The roots of the sum are the eigenvalues of the state matrix.
    pub fn characteristic(&self, closed: Loop) -> [Polynomial; 2] {
        let (moved, den) = self.plant();
        let velocity = self.velocity();
        let Timing { period, torque_delay, .. } = self.axis.timing;
        let change = Polynomial::new(&[1.0, -1.0]);
        let open = &den * &velocity;
        let damped = (&change * &moved * self.grip.sampled_damping).later(torque_delay);
        if closed == Loop::Damping {
            return [open, damped];
        }
        let base = open + damped;
        let moved = &moved * &velocity;
        match closed {
            Loop::Damping => [base, Polynomial::new(&[])],
            Loop::PassivityDamper => {
                let damping = self.axis.passivity_damping / period;
                [base, (&change * &moved * damping).later(torque_delay)]
            }
            Loop::Centring => [base, (moved * self.axis.centring()).later(torque_delay)],
            Loop::Coupling => {
                let Impedance { stiffness, damping } = self.axis.coupling.unwrap_or_default();
                let felt = spring(stiffness, damping, period) * self.axis.pose_reflection_gain();
                [base, (&moved * &felt).later(torque_delay)]
            }
            Loop::Pose => {
                let felt = self.surface() * (self.axis.pose_reflection_gain() * self.part());
                [&base * &self.servo(), self.way_back(&moved * &felt)]
            }
            Loop::Rate => {
                let felt =
                    self.surface() * (self.axis.rate_reflection_gain() * self.part() * period);
                let [object, given_way] = self.accommodation();
                [&base * &(object + given_way), self.way_back(&moved * &felt)]
            }
        }
    }

    /// Returns the characteristic polynomial of the object that yields to the surface, in two parts: without K_FA, and the
    /// contribution of K_FA.
    pub fn accommodation(&self) -> [Polynomial; 2] {
        let timing = self.axis.timing;
        let gain = self.axis.gains.accommodation * self.part() * timing.period;
        let given = (self.surface() * gain).later(1 + timing.accommodation_delay);
        [&Polynomial::new(&[1.0, -1.0]) * &self.servo(), self.read(given)]
    }

    /// Applies the delay from the object's command through the sensed wrench to the reflected torque.
    fn way_back(&self, felt: Polynomial) -> Polynomial {
        self.read(felt).later(3 + self.link_cycles)
    }

    /// Applies a robot's sensor, which reads the mean of a cycle, and its computer, a cycle later.
    fn read(&self, wrench: Polynomial) -> Polynomial {
        if self.axis.timing.is_robot {
            (&wrench * &Polynomial::new(&[0.5, 0.5])).later(1)
        } else {
            wrench
        }
    }

    fn surface(&self) -> Polynomial {
        let Impedance { stiffness, damping } = self.axis.environment;
        spring(stiffness, damping, self.axis.timing.period)
    }

    /// Returns the denominator of the servo, `1 - (1 - p) w`.
    fn servo(&self) -> Polynomial {
        Polynomial::new(&[1.0, self.part() - 1.0])
    }

    /// Returns p, the step response of the servo after one period.
    fn part(&self) -> f64 {
        let timing = self.axis.timing;
        if timing.servo_lag <= 0.0 { 1.0 } else { -math::exp_m1(-timing.period / timing.servo_lag) }
    }

    /// Returns the denominator of the velocity filter, `(T + τ) - τ w`.
    fn velocity(&self) -> Polynomial {
        let timing = self.axis.timing;
        Polynomial::new(&[timing.period + timing.velocity_filter, -timing.velocity_filter])
    }

    /// Returns numerator and denominator of the grip's displacement per force held for a period.
    fn plant(&self) -> (Polynomial, Polynomial) {
        let ReducedGrip { mass, damping: b, stiffness: k, .. } = self.grip;
        let period = self.axis.timing.period;
        let rate = Matrix3::new(0.0, 1.0, 0.0, -k / mass, -b / mass, mass.recip(), 0.0, 0.0, 0.0);
        let step = exponential(&(rate * period));
        let [xx, xv, vx, vv] = [step.m11, step.m12, step.m21, step.m22];
        let forced = Vector3::new(step.m13, step.m23, 0.0);
        let moved = Polynomial::new(&[0.0, forced.x, xv * forced.y - vv * forced.x]);
        (moved, Polynomial::new(&[1.0, -xx - vv, xx * vv - xv * vx]))
    }
}

/// Returns `K + B (1 - w)/T`.
fn spring(stiffness: f64, damping: f64, period: f64) -> Polynomial {
    Polynomial::new(&[stiffness + damping / period, -damping / period])
}

/// Returns the exponential of a matrix, by scaling and squaring of its series.
fn exponential(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let small = matrix / f64::from(1 << HALVINGS);
    let (mut sum, mut term) = (Matrix3::identity(), Matrix3::identity());
    for number in 1..=TERMS {
        term = term * small / f64::from(number);
        sum += term;
    }
    (0..HALVINGS).fold(sum, |power, _| power * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the exponential of a quarter turn and of a double integrator.
    #[test]
    fn exponential_agrees_with_closed_forms() {
        let turn = std::f64::consts::FRAC_PI_2;
        let turned = exponential(&Matrix3::new(0.0, -turn, 0.0, turn, 0.0, 0.0, 0.0, 0.0, 0.0));
        let expected = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
        assert!((turned - expected).norm() < 1e-12, "{turned}");
        let moved = exponential(&Matrix3::new(0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0));
        assert!((moved - Matrix3::new(1.0, 2.0, 2.0, 0.0, 1.0, 2.0, 0.0, 0.0, 1.0)).norm() < 1e-12);
    }
}
