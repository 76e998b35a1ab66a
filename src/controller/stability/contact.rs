//! Loops of one axis that contact closes: reflection in pose and rate mode, and accommodation of the object.
//!
//! Symbols are those of [`axis`](crate::stability::axis).

use crate::stability::axis::{Axis, AxisGains, Impedance, Timing};
use crate::stability::bounds::{self, RateReflection};
use crate::stability::device::Device;
use crate::stability::finding::{Culprit, Finding, Side, Verdict};
use crate::stability::passivity::{Law, SampledLaw};

impl Axis {
    /// Passivity of reflection in pose mode: a spring `K_T K_P k_e` behind delay and servo. The damper of
    /// the surface is included and, for the first touch, excluded. The symbols show the low-frequency limit; the value is
    /// the maximum over all frequencies.
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

    /// Passivity of the virtual coupling, which replaces the sensed wrench and has the delay of a torque only.
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

    /// Quantisation in pose mode: the reflected stiffness must not turn one encoder count into more than dry friction.
    pub(super) fn pose_quantum(&self) -> Option<Finding> {
        let AxisGains { wrench, pose, damping, .. } = self.gains;
        let felt = self.coupling.unwrap_or(self.environment);
        let stiffness = wrench * pose * felt.stiffness;
        let Device { friction, quantum, .. } = self.device;
        let damping = self.device.damping + damping + self.hand.damping;
        let most = bounds::max_passive_stiffness(damping, self.timing.period, friction, quantum);
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

    /// Passivity of reflection in rate mode, which is active at every frequency without damping.
    pub(super) fn rate_reflection(&self) -> Option<Finding> {
        let RateReflection { gain, yield_rate } = self.reflected();
        let Timing { period, rate_delay: delay, servo_lag: lag, .. } = self.timing;
        let law = SampledLaw { law: Law::Rate { gain, yield_rate }, period, lag, delay };
        let symbols = format!("K_T K_V/K_FA (1/(K_FA k_e) + T/2 + {delay} T)");
        (gain > 0.0).then(|| {
            let left = self.damping_side(&symbols, law.required_damping());
            self.passive("rate reflection", left, self.damped_side(), Culprit::Wrench)
        })
    }

    /// Accommodation against the servo lag: faster, the object bounces before it rests.
    pub(super) fn accommodation_servo(&self) -> Option<Finding> {
        let lag = self.timing.servo_lag;
        let yield_rate = self.reflected().yield_rate;
        let left = Side { symbols: "K_FA k_e τ_s".to_owned(), value: yield_rate * lag, unit: "" };
        let most = bounds::max_yield_rate_without_oscillation(lag) * lag;
        let right = Side { symbols: "1/4".to_owned(), value: most, unit: "" };
        let verdict = if left.value <= right.value { Verdict::Holds } else { Verdict::Warns };
        let reason = "the object bounces on the surface before it rests".to_owned();
        let culprit = Culprit::Accommodation;
        (left.value > 0.0)
            .then(|| self.finding("accommodation, servo", left, right, verdict, reason, culprit))
    }

    /// Accommodation to the payload's inertia against the servo lag: faster, an arm shakes in free space.
    pub(super) fn accommodation_payload(&self) -> Option<Finding> {
        let Timing { period, servo_lag, .. } = self.timing;
        let yielded = self.gains.accommodation * self.yielded_inertia;
        let left = Side { symbols: "K_FA m".to_owned(), value: yielded, unit: "s" };
        let most = bounds::max_yielded_inertia(period, servo_lag);
        let right = Side { symbols: "T/2 coth(T/2τ_s)".to_owned(), value: most, unit: "s" };
        let verdict = if yielded < most { Verdict::Holds } else { Verdict::Warns };
        let reason = "an arm may shake by the inertia of its payload: lower K_FA or the payload";
        let culprit = Culprit::Accommodation;
        (yielded > 0.0).then(|| {
            let name = "accommodation, payload";
            self.finding(name, left, right, verdict, reason.to_owned(), culprit)
        })
    }

    /// Returns the impedance of contact in rate mode.
    fn reflected(&self) -> RateReflection {
        let AxisGains { rate, wrench, accommodation, .. } = self.gains;
        let stiffness = self.environment.stiffness;
        RateReflection { gain: wrench * rate * stiffness, yield_rate: accommodation * stiffness }
    }
}
