//! Passivity conditions and closed-form bounds of one axis of the grip, evaluated at the start.
//!
//! The [`gate`](crate::stability::gate) evaluates stability in hands. Each loop is evaluated alone: sums of loops and the
//! coupling of axes are not covered. Both modes are evaluated, since the console may switch between them.
//!
//! | symbol      | quantity                       | symbol     | quantity                             |
//! |-------------|--------------------------------|------------|--------------------------------------|
//! | b, M, f_c   | damping, mass, dry friction of | K_V, K_P   | gains of a commanded rate, pose      |
//! |             | the device at the grip         | K_T, K_D   | of the wrench felt, of damping       |
//! | b_h, K_h    | the operator's hand            | F0, DB     | plateau of the return, deadband      |
//! | Σb          | b + K_D + b_h                  | K_FA, a    | accommodation, K_FA k_e              |
//! | k_e, d_e    | spring, damper of the surface  | T, τ_s, Δ  | period, servo lag, position quantum  |
//! | K_vc, B_vc  | virtual coupling of pose mode  | τ_v        | filter of the grip's velocity        |
//! | s, x_s      | share, presliding distance of  | m          | payload of an arm                    |
//! |             | friction compensation          |            |                                      |

use crate::stability::bounds;
use crate::stability::device::Device;
use crate::stability::finding::{Culprit, Digits, Finding, Side, Verdict};
use crate::stability::passivity::{Law, SampledLaw};

/// Impedance of a spring and a damper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// K, in N/m or N·m/rad.
    pub stiffness: f64,
    /// B, in N·s/m or N·m·s/rad.
    pub damping: f64,
}

/// Gains of one Cartesian axis; lengths in m or rad, forces in N or N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisGains {
    /// K_V of Eq. 5, in 1/s.
    pub rate: f64,
    /// K_P: displacement of the object per displacement of the hand.
    pub pose: f64,
    /// K_T: wrench at the grip per wrench on the object.
    pub wrench: f64,
    /// K_D of Eq. 9, in N·s/m or N·m·s/rad.
    pub damping: f64,
    /// DB, half-width of the deadband, in m or rad.
    pub deadband: f64,
    /// F0, plateau of the return to centre, in N or N·m.
    pub plateau: f64,
    /// K_FA, in m/s per N or rad/s per N·m.
    pub accommodation: f64,
}

/// Period, delays and time constants of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// T, in s.
    pub period: f64,
    /// Delay from a joint sample to the torque computed from it, in cycles.
    pub torque_delay: u32,
    /// Delay from a joint sample through the commanded pose and the wrench to the reflected torque, in cycles, without the
    /// servo lag.
    pub pose_delay: u32,
    /// Delay of the same path for a commanded rate, which moves the object one cycle later.
    pub rate_delay: u32,
    /// Delay of the wrench to which the object yields, in cycles.
    pub accommodation_delay: u32,
    /// Part of these delays that a link causes, from command to wrench, in cycles; zero without a link.
    pub link_cycles: u32,
    /// Set if a robot arm is commanded: its sensor reads the mean of a cycle, and its computer commands the joints a
    /// cycle later.
    pub is_robot: bool,
    /// τ_s, time constant of the object's servo, in s.
    pub servo_lag: f64,
    /// τ_v, time constant of the grip's velocity filter, in s; zero without a filter.
    pub velocity_filter: f64,
}

/// One Cartesian axis of the grip: device, hand, environment, gains and timing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// `x`, `y`, `z`, `about x`, `about y` or `about z`: an entry of [`AXES`](crate::gains::AXES).
    pub name: &'static str,
    /// Rotation axis; units are then rad and N·m.
    pub is_rotation: bool,
    /// Hand controller at the grip.
    pub device: Device,
    /// K_h and b_h of the operator's hand.
    pub hand: Impedance,
    /// k_e and d_e of the surface.
    pub environment: Impedance,
    /// Virtual coupling of pose mode; `None` without one.
    pub coupling: Option<Impedance>,
    /// Inertia of the payload that an arm yields to, in kg or kg·m²; zero without an arm.
    pub yielded_inertia: f64,
    /// Maximum damping that refills a tank, in N·s/m; zero without one.
    pub tank_damping: f64,
    /// Maximum damping of the passivity layer, in N·s/m or N·m·s/rad; zero without one.
    pub passivity_damping: f64,
    /// Gains of the law and the object.
    pub gains: AxisGains,
    /// Period, delays and time constants of the loop.
    pub timing: Timing,
    /// Set if a passivity layer observes the energy at run time.
    pub is_watched: bool,
}

/// Unit symbols of an axis.
pub(super) struct Units {
    pub(super) stiffness: &'static str,
    pub(super) damping: &'static str,
    pub(super) force: &'static str,
    pub(super) rate_gain: &'static str,
}

impl Axis {
    /// Evaluates every loop that the gains close.
    pub fn findings(&self) -> Vec<Finding> {
        let loops = [
            self.damping(),
            self.friction_compensation(),
            self.centring_plateau(),
            self.centring_slope(),
            self.pose_reflection(),
            self.pose_coupling(),
            self.pose_quantum(),
            self.rate_reflection(),
            self.accommodation_servo(),
            self.accommodation_payload(),
            self.tank_damper(),
        ];
        loops.into_iter().flatten().collect()
    }

    /// Passivity of K_D: on a difference `n` cycles late it requires as much damping as it adds; filtered, less.
    fn damping(&self) -> Option<Finding> {
        let gain = self.gains.damping;
        let Timing { torque_delay: delay, velocity_filter: filter, .. } = self.timing;
        let law = Law::Impedance { stiffness: 0.0, damping: gain, filter };
        let law = SampledLaw { law, delay, ..self.impedance(0.0, gain) };
        let right = self.damping_side("b", self.device.damping);
        let left = self.damping_side("K_D", law.required_damping());
        (gain > 0.0).then(|| self.passive("damping", left, right, Culprit::Damping))
    }

    /// Passivity of friction compensation: a spring of negative stiffness `-s f_c/x_s`, sampled and a cycle late. The
    /// friction that dissipates its energy is not counted, since it may be less than identified.
    fn friction_compensation(&self) -> Option<Finding> {
        let stiffness = self.device.compensated_stiffness;
        let law = SampledLaw { delay: self.timing.torque_delay, ..self.impedance(-stiffness, 0.0) };
        let left = self.damping_side("-s f_c/x_s, sampled", law.required_damping());
        let right = self.damped_side();
        // The linear model lacks the friction that dissipates the energy, so only the hand's damping may cover a deficit.
        let is_held = left.value < right.value + self.hand.damping;
        is_used(stiffness).then(|| {
            let finding = self.passive("friction compensation", left, right, Culprit::Friction);
            if is_held { finding } else { Finding { verdict: Verdict::Refuses, ..finding } }
        })
    }

    /// Compares dry friction with the plateau of the return to centre: above it, a released grip does not return.
    fn centring_plateau(&self) -> Option<Finding> {
        let AxisGains { plateau, deadband, .. } = self.gains;
        let Device { friction, full_friction, .. } = self.device;
        let rest = bounds::rest_offset(plateau, deadband, full_friction);
        let unit = if self.is_rotation { "rad" } else { "m" };
        let (verdict, friction, reason) = if full_friction < plateau {
            let reason = format!("a hand that is let go rests within {} {unit}", Digits(rest));
            (Verdict::Holds, full_friction, reason)
        } else if friction < plateau {
            let reason =
                "a hand displaced along several axes at once may stay outside the deadband";
            (Verdict::Warns, full_friction, reason.to_owned())
        } else {
            let reason = "a hand that is let go stays outside the deadband";
            (Verdict::Refuses, friction, reason.to_owned())
        };
        let unit = self.units().force;
        let left = Side { symbols: "f_c".to_owned(), value: friction, unit };
        let right = Side { symbols: "F0".to_owned(), value: plateau, unit };
        is_used(plateau).then(|| {
            self.finding(
                "return to centre, plateau",
                left,
                right,
                verdict,
                reason,
                Culprit::Centring,
            )
        })
    }

    /// Passivity of the return to centre: a spring of `2 F0/DB` at the edge of the deadband.
    fn centring_slope(&self) -> Option<Finding> {
        let AxisGains { plateau, deadband, .. } = self.gains;
        let delay = self.timing.torque_delay;
        let stiffness = bounds::max_centring_stiffness(plateau, deadband);
        let law = SampledLaw { delay, ..self.impedance(stiffness, 0.0) };
        let symbols = format!("2 F0/DB (T/2 + {delay} T)");
        let name = "return to centre, slope";
        (plateau > 0.0).then(|| {
            let left = self.damping_side(&symbols, law.required_damping());
            self.passive(name, left, self.damped_side(), Culprit::Centring)
        })
    }

    /// Stability of the tank's damper with K_D on the bare mass of the grip.
    fn tank_damper(&self) -> Option<Finding> {
        let Timing { period, torque_delay: delay, .. } = self.timing;
        let damping = self.gains.damping + self.tank_damping;
        let most = bounds::max_sampled_damping(self.device.mass, period, delay);
        let left = self.damping_side("K_D + d_tank", damping);
        let right = self.damping_side(&format!("2 tan(π/{}) M/T", 4 * (delay + 1)), most);
        let verdict = if damping < most { Verdict::Holds } else { Verdict::Refuses };
        let reason = "the damper would swing the grip to and fro".to_owned();
        (self.tank_damping > 0.0)
            .then(|| self.finding("tank, damper", left, right, verdict, reason, Culprit::Tank))
    }

    /// Compares the damping that a loop requires with that of device and law, then with the hand's. A loop that is not
    /// passive is a warning only: the [`gate`](crate::stability::gate) evaluates stability in hands.
    pub(super) fn passive(
        &self,
        name: &'static str,
        left: Side,
        right: Side,
        culprit: Culprit,
    ) -> Finding {
        let hand = self.hand.damping;
        let (digits, unit) = (Digits(hand), self.units().damping);
        let (verdict, reason) = if left.value < right.value {
            (Verdict::Holds, "passive whatever holds the grip".to_owned())
        } else if left.value < right.value + hand {
            let by = if self.is_watched { "the passivity layer and the hand" } else { "the hand" };
            (Verdict::Warns, format!("left to {by}, b_h = {digits} {unit}"))
        } else {
            let reason = format!(
                "more than the hand adds, b_h = {digits} {unit}: stability in hands is judged apart"
            );
            (Verdict::Warns, reason)
        };
        self.finding(name, left, right, verdict, reason, culprit)
    }

    pub(super) fn finding(
        &self,
        name: &'static str,
        left: Side,
        right: Side,
        verdict: Verdict,
        reason: String,
        culprit: Culprit,
    ) -> Finding {
        Finding { name, axis: self.name, left, right, verdict, reason, culprit }
    }

    pub(super) const fn impedance(&self, stiffness: f64, damping: f64) -> SampledLaw {
        SampledLaw::impedance(stiffness, damping, self.timing.period)
    }

    pub(super) fn damping_side(&self, symbols: &str, value: f64) -> Side {
        Side { symbols: symbols.to_owned(), value, unit: self.units().damping }
    }

    /// Gain of reflection in pose mode, K_T K_P.
    pub(super) const fn pose_reflection_gain(&self) -> f64 {
        self.gains.wrench * self.gains.pose
    }

    /// Gain of reflection in rate mode, K_T K_V, in 1/s.
    pub(super) const fn rate_reflection_gain(&self) -> f64 {
        self.gains.wrench * self.gains.rate
    }

    /// Maximum stiffness of the return to centre, in N/m or N·m/rad; zero without one.
    pub(super) fn centring(&self) -> f64 {
        let AxisGains { plateau, deadband, .. } = self.gains;
        if plateau <= 0.0 { 0.0 } else { bounds::max_centring_stiffness(plateau, deadband) }
    }

    /// Damping of device and law, without a hand: b + K_D.
    pub(super) fn damped_side(&self) -> Side {
        self.damping_side("b + K_D", self.device.damping + self.gains.damping)
    }

    pub(super) const fn units(&self) -> Units {
        if self.is_rotation {
            Units {
                stiffness: "N·m/rad",
                damping: "N·m·s/rad",
                force: "N·m",
                rate_gain: "N·m/(rad·s)",
            }
        } else {
            Units { stiffness: "N/m", damping: "N·s/m", force: "N", rate_gain: "N/(m·s)" }
        }
    }
}

/// Returns whether a gain closes a loop: it is positive, or NaN, which is refused later.
pub(super) fn is_used(gain: f64) -> bool {
    gain > 0.0 || gain.is_nan()
}

#[cfg(test)]
pub(in crate::stability) mod tests;
