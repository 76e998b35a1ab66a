//! The sampled loop of one axis: device and hand, law, object and surface, with every delay between them.
//!
//! Exact for a linear loop. The mass in the hand moves under a torque held for a period (zero-order hold); everything else
//! is a difference equation of the cycle. `w = z⁻¹` is one cycle; cycle `k` samples the grip at `x`, the object is at `o`:
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
//! A link adds its cycles to the way from command to wrench. An arm's sensor reads the mean of a cycle, `(1 + w)/2`, and its
//! computer commands the joints a cycle later.

use nalgebra::{Matrix3, Vector3};

use crate::stability::axis::{Axis, Impedance, Timing};
use crate::stability::grip_dynamics::ReducedGrip;
use crate::stability::polynomial::Polynomial;
use units::math;

/// Halvings of the period before the exponential's series, and terms of the series.
const HALVINGS: i32 = 6;
const TERMS: u32 = 12;

/// A loop that gains close over one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loop {
    /// K_D alone, in free motion.
    Damping,
    /// K_D and the strongest damper of the passivity layer.
    PassivityDamper,
    /// K_D and the steepest slope of the return to centre, in free motion.
    Centring,
    /// K_D and contact in pose mode.
    Pose,
    /// K_D and the virtual coupling of pose mode.
    Coupling,
    /// K_D and contact in rate mode.
    Rate,
}

/// One axis, with device and hand as they are at one posture.
#[derive(Clone, Copy, Debug)]
pub struct SampledLoop<'a> {
    /// Gains, surface, period and delays.
    pub axis: &'a Axis,
    /// The grip in a hand, K_D counted in.
    pub grip: ReducedGrip,
    /// Cycles of a link from command to wrench.
    pub link_cycles: u32,
}

impl SampledLoop<'_> {
    /// Returns the characteristic polynomial of the loop in two parts: without the gain that it is named for (K_D, the layer's
    /// damper, F0, K_T or K_vc), and what that gain adds. The roots of their sum are those of the state matrix.
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
                let felt = spring(stiffness, damping, period) * self.axis.felt_pose();
                [base, (&moved * &felt).later(torque_delay)]
            }
            Loop::Pose => {
                let felt = self.surface() * (self.axis.felt_pose() * self.part());
                [&base * &self.servo(), self.way_back(&moved * &felt)]
            }
            Loop::Rate => {
                let felt = self.surface() * (self.axis.felt_rate() * self.part() * period);
                let [object, given_way] = self.accommodation();
                [&base * &(object + given_way), self.way_back(&moved * &felt)]
            }
        }
    }

    /// Returns the characteristic polynomial of the object that gives way to the surface, in two parts: without K_FA, and
    /// what K_FA adds.
    pub fn accommodation(&self) -> [Polynomial; 2] {
        let timing = self.axis.timing;
        let gain = self.axis.gains.accommodation * self.part() * timing.period;
        let given = (self.surface() * gain).later(1 + timing.accommodation_delay);
        [&Polynomial::new(&[1.0, -1.0]) * &self.servo(), self.read(given)]
    }

    /// From the object's command to the torque of its wrench: commanded, sensed, reflected.
    fn way_back(&self, felt: Polynomial) -> Polynomial {
        self.read(felt).later(3 + self.link_cycles)
    }

    /// A robot's sensor reads the mean of the cycle, and its computer commands a cycle later.
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

    /// `1 - (1 - p) w`.
    fn servo(&self) -> Polynomial {
        Polynomial::new(&[1.0, self.part() - 1.0])
    }

    /// p, the part of its way that the servo goes in a period.
    fn part(&self) -> f64 {
        let timing = self.axis.timing;
        if timing.servo_lag <= 0.0 { 1.0 } else { -math::exp_m1(-timing.period / timing.servo_lag) }
    }

    /// `(T + τ) - τ w`.
    fn velocity(&self) -> Polynomial {
        let timing = self.axis.timing;
        Polynomial::new(&[timing.period + timing.velocity_filter, -timing.velocity_filter])
    }

    /// Numerator and denominator of the grip's displacement by a force held for a period.
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

/// `K + B (1 - w)/T`.
fn spring(stiffness: f64, damping: f64, period: f64) -> Polynomial {
    Polynomial::new(&[stiffness + damping / period, -damping / period])
}

/// The exponential of a matrix: its series at a small part of it, squared again and again.
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

    /// `exp` of a rotation by a quarter turn, and of a double integrator.
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
