//! Passivity and closed forms of one axis of the grip, judged at the start.
//!
//! Not stability in hands, which is the [`gate`](crate::stability::gate)'s. Each loop alone: what they add up to is not
//! judged, nor what one axis does to another. Both modes are judged, as the console may change from one to the other.
//!
//! | symbol      | what it is                     | symbol     | what it is                           |
//! |-------------|--------------------------------|------------|--------------------------------------|
//! | b, M, f_c   | damping, mass, dry friction of | K_V, K_P   | gains of a commanded rate, pose      |
//! |             | the device at the grip         | K_T, K_D   | of the wrench felt, of damping       |
//! | b_h, K_h    | the operator's hand            | F0, DB     | plateau of the return, deadband      |
//! | Σb          | b + K_D + b_h                  | K_FA, a    | accommodation, K_FA k_e              |
//! | k_e, d_e    | spring, damper of the surface  | T, τ_s, Δ  | period, lag of the servo, one count  |
//! | K_vc, B_vc  | virtual coupling of pose mode  | τ_v        | filter of the grip's velocity        |
//! | s, x_s      | share, presliding distance of  | m          | payload of an arm                    |
//! |             | friction compensation          |            |                                      |

use crate::stability::bounds;
use crate::stability::device::Device;
use crate::stability::finding::{Culprit, Digits, Finding, Side, Verdict};
use crate::stability::passivity::{Law, SampledLaw};

/// A spring and a damper, in N/m and N·s/m or in N·m/rad and N·m·s/rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impedance {
    /// K.
    pub stiffness: f64,
    /// B.
    pub damping: f64,
}

/// The gains of one axis, in m and N or in rad and N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisGains {
    /// K_V, in 1/s.
    pub rate: f64,
    /// K_P.
    pub pose: f64,
    /// K_T.
    pub wrench: f64,
    /// K_D.
    pub damping: f64,
    /// DB.
    pub deadband: f64,
    /// F0, the plateau of the return to centre.
    pub plateau: f64,
    /// K_FA.
    pub accommodation: f64,
}

/// Period, delays and time constants of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// T, in s.
    pub period: f64,
    /// Cycles from a sample of the joints to the torque computed from it.
    pub torque_delay: u32,
    /// Cycles from a sample of the joints to the torque of the wrench that the pose commanded from it
    /// meets, without the servo's lag.
    pub pose_delay: u32,
    /// The same for a commanded rate, which moves the object one cycle later.
    pub rate_delay: u32,
    /// Cycles by which the wrench is late that the object gives way to.
    pub accommodation_delay: u32,
    /// Part of these delays that is a link's, from command to wrench; zero without one.
    pub link_cycles: u32,
    /// An arm is commanded: its sensor reads the mean of a cycle, and its computer commands the joints a cycle later.
    pub is_robot: bool,
    /// τ_s of the object's servo, in s.
    pub servo_lag: f64,
    /// τ of the low pass on the grip's velocity, in s; zero for none.
    pub velocity_filter: f64,
}

/// One axis of the grip with everything that closes a loop over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Name of the axis.
    pub name: &'static str,
    /// Rotation: the units are then those of moments.
    pub is_rotation: bool,
    /// The device at the grip.
    pub device: Device,
    /// The operator's hand.
    pub hand: Impedance,
    /// Impedance of the environment.
    pub environment: Impedance,
    /// Virtual coupling in pose mode, if there is one.
    pub coupling: Option<Impedance>,
    /// Inertia of the payload that an arm yields to, in kg or kg·m²; zero without an arm.
    pub yielded_inertia: f64,
    /// The strongest damper that refills a tank, in N·s/m; zero without one.
    pub tank_damping: f64,
    /// The strongest damper of the passivity layer, in N·s/m or N·m·s/rad; zero without one.
    pub passivity_damping: f64,
    /// The gains.
    pub gains: AxisGains,
    /// Period, delays and time constants of the loop.
    pub timing: Timing,
    /// A passivity layer watches the energy at run time.
    pub is_watched: bool,
}

/// Units of an axis.
pub(super) struct Units {
    pub(super) stiffness: &'static str,
    pub(super) damping: &'static str,
    pub(super) force: &'static str,
    pub(super) rate_gain: &'static str,
}

impl Axis {
    /// Checks every loop that its gains close.
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

    /// K_D of a difference that is `n` cycles late asks for as much damping as it gives; of a filtered
    /// one, for less.
    fn damping(&self) -> Option<Finding> {
        let gain = self.gains.damping;
        let Timing { torque_delay: delay, velocity_filter: filter, .. } = self.timing;
        let law = Law::Impedance { stiffness: 0.0, damping: gain, filter };
        let law = SampledLaw { law, delay, ..self.impedance(0.0, gain) };
        let right = self.damping_side("b", self.device.damping);
        let left = self.damping_side("K_D", law.required_damping());
        (gain > 0.0).then(|| self.passive("damping", left, right, Culprit::Damping))
    }

    /// Friction compensation helps a motion like a spring that pushes away, `s f_c/x_s`, sampled and a cycle late.
    /// That friction itself takes the energy is not counted: it may be less than identified.
    fn friction_compensation(&self) -> Option<Finding> {
        let stiffness = self.device.compensated_stiffness;
        let law = SampledLaw { delay: self.timing.torque_delay, ..self.impedance(-stiffness, 0.0) };
        let left = self.damping_side("-s f_c/x_s, sampled", law.required_damping());
        let right = self.damped_side();
        // No linear model has the friction that takes its energy: what the hand cannot cover is refused.
        let is_held = left.value < right.value + self.hand.damping;
        is_used(stiffness).then(|| {
            let finding = self.passive("friction compensation", left, right, Culprit::Friction);
            if is_held { finding } else { Finding { verdict: Verdict::Refuses, ..finding } }
        })
    }

    /// The plateau must overcome friction, or the hand rests wherever it is let go.
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

    /// At the edge of the deadband the return to centre is a spring of `2 F0/DB`.
    fn centring_slope(&self) -> Option<Finding> {
        let AxisGains { plateau, deadband, .. } = self.gains;
        let delay = self.timing.torque_delay;
        let stiffness = bounds::steepest_centring(plateau, deadband);
        let law = SampledLaw { delay, ..self.impedance(stiffness, 0.0) };
        let symbols = format!("2 F0/DB (T/2 + {delay} T)");
        let name = "return to centre, slope";
        (plateau > 0.0).then(|| {
            let left = self.damping_side(&symbols, law.required_damping());
            self.passive(name, left, self.damped_side(), Culprit::Centring)
        })
    }

    /// The damper that refills the tank, with K_D: stronger than this, it swings the bare grip by itself.
    fn tank_damper(&self) -> Option<Finding> {
        let Timing { period, torque_delay: delay, .. } = self.timing;
        let damping = self.gains.damping + self.tank_damping;
        let most = bounds::strongest_damper(self.device.mass, period, delay);
        let left = self.damping_side("K_D + d_tank", damping);
        let right = self.damping_side(&format!("2 tan(π/{}) M/T", 4 * (delay + 1)), most);
        let verdict = if damping < most { Verdict::Holds } else { Verdict::Refuses };
        let reason = "the damper would swing the grip to and fro".to_owned();
        (self.tank_damping > 0.0)
            .then(|| self.finding("tank, damper", left, right, verdict, reason, Culprit::Tank))
    }

    /// Judges a loop by the damping it asks for: the device and the law may have it, or the hand must. Not passive is no
    /// reason to refuse: stability in hands is judged by the [`gate`](crate::stability::gate).
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

    /// K_T K_P.
    pub(super) const fn felt_pose(&self) -> f64 {
        self.gains.wrench * self.gains.pose
    }

    /// K_T K_V, in 1/s.
    pub(super) const fn felt_rate(&self) -> f64 {
        self.gains.wrench * self.gains.rate
    }

    /// The steepest slope of the return to centre; zero without one.
    pub(super) fn centring(&self) -> f64 {
        let AxisGains { plateau, deadband, .. } = self.gains;
        if plateau <= 0.0 { 0.0 } else { bounds::steepest_centring(plateau, deadband) }
    }

    /// Damping of device and law, without a hand.
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

/// Returns whether a gain closes a loop: it is positive. NaN counts, and is refused.
pub(super) fn is_used(gain: f64) -> bool {
    gain > 0.0 || gain.is_nan()
}

#[cfg(test)]
pub(in crate::stability) mod tests;
