//! Loops of one axis that contact closes: the surface felt in pose or rate mode, and the object that gives way to it.
//!
//! Symbols as in [`axis`](crate::stability::axis).

use crate::stability::axis::{Axis, AxisGains, Impedance, Timing};
use crate::stability::bounds::{self, RateReflection};
use crate::stability::device::Device;
use crate::stability::finding::{Culprit, Finding, Side, Verdict};
use crate::stability::passivity::{Law, SampledLaw};

impl Axis {
    /// In pose mode the hand feels the surface as a spring `K_T K_P k_e`, late and through the servo;
    /// with the surface's own damper or, at the touch, without. The symbols are the worst of slow
    /// motion, with the servo's lag as it is sampled, `T/(exp(T/τ_s) - 1)`; the value is that of any.
    pub(super) fn pose_reflection(&self) -> Option<Finding> {
        let AxisGains { wrench, pose, .. } = self.gains;
        let Timing { pose_delay: delay, servo_lag: lag, .. } = self.timing;
        let scale = wrench * pose;
        let Impedance { stiffness, damping } = self.environment;
        let required = |damping| {
            let law = self.impedance(scale * stiffness, damping);
            SampledLaw { lag, delay, ..law }.required_damping()
        };
        let left = required(0.0).max(required(scale * damping));
        let left = self.damping_side(&format!("K_T K_P k_e (T/2 + {delay} T + τ_s)"), left);
        (scale * stiffness > 0.0 && self.coupling.is_none())
            .then(|| self.passive("pose reflection", left, self.damped_side(), Culprit::Wrench))
    }

    /// Tied to the object, the hand feels the tie and not the surface: no later than any torque.
    pub(super) fn pose_coupling(&self) -> Option<Finding> {
        let coupling = self.coupling?;
        let scale = self.gains.wrench * self.gains.pose;
        let delay = self.timing.torque_delay;
        let law = self.impedance(scale * coupling.stiffness, scale * coupling.damping);
        let required = SampledLaw { delay, ..law }.required_damping();
        let left = self.damping_side("K_T K_P (K_vc, B_vc), sampled", required);
        let name = "virtual coupling";
        (scale * (coupling.stiffness + coupling.damping) > 0.0)
            .then(|| self.passive(name, left, self.damped_side(), Culprit::Coupling))
    }

    /// The same spring must not turn an encoder step into more than friction holds.
    pub(super) fn pose_quantum(&self) -> Option<Finding> {
        let AxisGains { wrench, pose, damping, .. } = self.gains;
        let felt = self.coupling.unwrap_or(self.environment);
        let stiffness = wrench * pose * felt.stiffness;
        let Device { friction, quantum, .. } = self.device;
        let damping = self.device.damping + damping + self.hand.damping;
        let most = bounds::stiffest_spring(damping, self.timing.period, friction, quantum);
        let unit = self.units().stiffness;
        let left = Side { symbols: "K_T K_P k_e".to_owned(), value: stiffness, unit };
        let symbols = "min(2 Σb/T, 2 f_c/Δ)".to_owned();
        let right = Side { symbols, value: most, unit };
        let verdict = if stiffness < most { Verdict::Holds } else { Verdict::Warns };
        let reason = "the grip may buzz by single encoder steps in contact".to_owned();
        (stiffness > 0.0).then(|| {
            self.finding("pose reflection, quantum", left, right, verdict, reason, Culprit::Wrench)
        })
    }

    /// In rate mode reflection is active at every frequency: damping must cover all of it.
    pub(super) fn rate_reflection(&self) -> Option<Finding> {
        let RateReflection { gain, giving_way } = self.reflected();
        let Timing { period, rate_delay: delay, servo_lag: lag, .. } = self.timing;
        let law = SampledLaw { law: Law::Rate { gain, giving_way }, period, lag, delay };
        let symbols = format!("K_T K_V/K_FA (1/(K_FA k_e) + T/2 + {delay} T)");
        (gain > 0.0).then(|| {
            let left = self.damping_side(&symbols, law.required_damping());
            self.passive("rate reflection", left, self.damped_side(), Culprit::Wrench)
        })
    }

    /// Nor may it overtake its servo, or it bounces before it rests.
    pub(super) fn accommodation_servo(&self) -> Option<Finding> {
        let lag = self.timing.servo_lag;
        let giving_way = self.reflected().giving_way;
        let left = Side { symbols: "K_FA k_e τ_s".to_owned(), value: giving_way * lag, unit: "" };
        let most = bounds::fastest_without_swinging(lag) * lag;
        let right = Side { symbols: "1/4".to_owned(), value: most, unit: "" };
        let verdict = if left.value <= right.value { Verdict::Holds } else { Verdict::Warns };
        let reason = "the object bounces on the surface before it rests".to_owned();
        let culprit = Culprit::Accommodation;
        (left.value > 0.0)
            .then(|| self.finding("accommodation, servo", left, right, verdict, reason, culprit))
    }

    /// Nor may an arm yield to the inertia of its payload faster than its servo follows, or it shakes in free space.
    pub(super) fn accommodation_payload(&self) -> Option<Finding> {
        let Timing { period, servo_lag, .. } = self.timing;
        let yielded = self.gains.accommodation * self.yielded_inertia;
        let left = Side { symbols: "K_FA m".to_owned(), value: yielded, unit: "s" };
        let most = bounds::most_yielded_inertia(period, servo_lag);
        let right = Side { symbols: "T/2 coth(T/2τ_s)".to_owned(), value: most, unit: "s" };
        let verdict = if yielded < most { Verdict::Holds } else { Verdict::Warns };
        let reason = "an arm may shake by the inertia of its payload: lower K_FA or the payload";
        let culprit = Culprit::Accommodation;
        (yielded > 0.0).then(|| {
            let name = "accommodation, payload";
            self.finding(name, left, right, verdict, reason.to_owned(), culprit)
        })
    }

    /// Contact felt through a rate command.
    fn reflected(&self) -> RateReflection {
        let AxisGains { rate, wrench, accommodation, .. } = self.gains;
        let stiffness = self.environment.stiffness;
        RateReflection { gain: wrench * rate * stiffness, giving_way: accommodation * stiffness }
    }
}
