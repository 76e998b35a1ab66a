//! Gate of the gains: stability of each loop of one axis, in every hand and at every posture of a sample.
//!
//! The gate computes the gain margin for each hand and posture: the multiple of the gain at which the spectral radius ρ of
//! the [`sampled_loop`](crate::stability::sampled_loop) reaches 1. The smallest margin counts. A loop that is not passive
//! may be stable in every hand; [`axis`](crate::stability::axis) warns of it.

use crate::stability::axis::{Axis, Impedance, is_used};
use crate::stability::finding::{Culprit, Digits, Finding, Side, Verdict};
use crate::stability::gain_margin::{margin, refined_margin};
use crate::stability::grip_dynamics::{GripDynamics, ReducedGrip, Restraint};
use crate::stability::sampled_loop::{Loop, SampledLoop};

/// Fraction of its bound above which a gain is a warning.
const MARGIN: f64 = 0.8;

/// Hands in addition to the configured one: relaxed, nervous and firm, along and about an axis. Ranges and sources are
/// those of the simulation's impedance presets.
const HANDS: [[Impedance; 2]; 3] = [
    [Impedance { stiffness: 150.0, damping: 8.0 }, Impedance { stiffness: 2.0, damping: 0.06 }],
    [Impedance { stiffness: 600.0, damping: 12.0 }, Impedance { stiffness: 8.0, damping: 0.1 }],
    [Impedance { stiffness: 800.0, damping: 30.0 }, Impedance { stiffness: 10.0, damping: 0.2 }],
];

/// Hands in which every loop must be stable.
const ALL_HANDS: [Hand; 4] = {
    let [relaxed, nervous, firm] = HANDS;
    [Hand::Configured, Hand::Preset(relaxed), Hand::Preset(nervous), Hand::Preset(firm)]
};

/// Loops, in the order of their findings.
const LOOPS: [Loop; 6] =
    [Loop::Damping, Loop::PassivityDamper, Loop::Centring, Loop::Pose, Loop::Coupling, Loop::Rate];

/// Bisection steps from a refused surface stiffness to an accepted one.
const STIFFNESS_HALVINGS: u32 = 40;

/// Initial angle ωT for the reduction of the grip, in rad.
const FIRST_ANGLE: f64 = 0.05;

/// Six axes of the grip, and the postures at which the gate evaluates them.
#[derive(Clone, Copy, Debug)]
pub struct StabilityGate<'a> {
    /// Axes; `postures` replace their `device`.
    pub axes: &'a [Axis; 6],
    /// Grip dynamics at each posture.
    pub postures: &'a [GripDynamics],
}

/// Smallest gain margin of a loop over postures, hands and link delays.
#[derive(Clone, Copy, Debug)]
struct GainMargin<'a> {
    /// Multiple of the gain at which the loop becomes unstable.
    multiple: f64,
    /// Frequency of the oscillation at that gain, in rad/s.
    omega: f64,
    /// Posture and hand with this margin; `None` if no bound is in the range searched.
    worst: Option<(&'a GripDynamics, Impedance)>,
}

/// Hand on the grip.
#[derive(Clone, Copy, Debug)]
enum Hand {
    /// Released grip.
    None,
    /// Hand of the configuration.
    Configured,
    /// Impedances along and about an axis.
    Preset([Impedance; 2]),
}

/// One axis of the gate, by index.
#[derive(Clone, Copy, Debug)]
struct AxisGate<'a> {
    gate: &'a StabilityGate<'a>,
    axis: &'a Axis,
    index: usize,
}

/// Gain that closes a loop, with its unit and the key to change.
struct LoopGain {
    closed: Loop,
    value: f64,
    unit: &'static str,
    culprit: Culprit,
}

impl StabilityGate<'_> {
    /// Evaluates every loop of axis `index`, from 0, in hands and with the grip let go. Empty for another index.
    pub fn findings(&self, index: usize) -> Vec<Finding> {
        let Some(axis) = self.axes.get(index) else { return Vec::new() };
        AxisGate { gate: self, axis, index }.findings()
    }
}

impl<'a> AxisGate<'a> {
    fn findings(&self) -> Vec<Finding> {
        let gains = LOOPS.into_iter().map(|closed| self.loop_gain(closed));
        let used = gains.filter(|gain| is_used(gain.value));
        let in_hands = used.flat_map(|gain| [self.held(&gain), self.let_go(&gain)]);
        in_hands.chain(self.object()).collect()
    }

    /// Evaluates stability in every hand. A gain beyond its bound is refused, except the passivity layer's damper.
    fn held(&self, gain: &LoopGain) -> Finding {
        let margin = self.least(gain.closed, &ALL_HANDS);
        let verdict = match margin.multiple {
            multiple if multiple * MARGIN > 1.0 => Verdict::Holds,
            multiple if multiple > 1.0 => Verdict::Warns,
            // This loop closes only in contact, while energy is missing.
            multiple if gain.closed == Loop::PassivityDamper && multiple >= 0.0 => Verdict::Warns,
            _ => Verdict::Refuses,
        };
        let swings = match verdict {
            Verdict::Refuses if margin.multiple.is_nan() => "has values that are not finite",
            Verdict::Refuses => "swings more and more",
            _ if margin.multiple <= 1.0 => {
                "would swing while the layer's damper is at its strongest"
            }
            Verdict::Warns | Verdict::Holds => "is near its bound",
        };
        let place = margin.place(self.axis);
        let is_surface = verdict == Verdict::Refuses && gain.closed == Loop::Pose;
        let remedy = if is_surface { self.remedy(gain.closed) } else { String::new() };
        let reason = format!("the loop {swings} {place}{remedy}");
        self.finding(gain, 0, margin.multiple, verdict, reason)
    }

    /// Returns the text that names the stiffest surface on which these gains are stable.
    fn remedy(&self, closed: Loop) -> String {
        let (stiffness, unit) = (self.max_stable_stiffness(closed), self.axis.units().stiffness);
        if stiffness > 0.0 {
            format!("; with these gains a surface holds up to {} {unit}", Digits(stiffness))
        } else {
            "; with these gains and this damper no surface holds".to_owned()
        }
    }

    /// Returns the maximum surface stiffness, below the configured one, with a stable loop in every hand. The surface's damper
    /// is the configured one. Zero if no stiffness is stable.
    fn max_stable_stiffness(&self, closed: Loop) -> f64 {
        let environment = self.axis.environment;
        let holds = |stiffness| {
            let axis = Axis { environment: Impedance { stiffness, ..environment }, ..*self.axis };
            AxisGate { axis: &axis, ..*self }.least(closed, &ALL_HANDS).multiple > 1.0
        };
        let (mut low, mut high) = (0.0, environment.stiffness);
        for _ in 0..STIFFNESS_HALVINGS {
            let middle = f64::midpoint(low, high);
            if holds(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// Evaluates stability with the grip let go: at most a warning, unless the loop has NaN.
    fn let_go(&self, gain: &LoopGain) -> Finding {
        let margin = self.least(gain.closed, &[Hand::None]);
        let verdict = match margin.multiple {
            multiple if multiple > 1.0 => Verdict::Holds,
            multiple if multiple.is_nan() => Verdict::Refuses,
            _ => Verdict::Warns,
        };
        let by = if self.axis.is_watched { "the passivity layer and a hand" } else { "a hand" };
        let reason =
            format!("left to {by}: a grip that is let go swings {}", margin.place(self.axis));
        self.finding(gain, 1, margin.multiple, verdict, reason)
    }

    /// Evaluates accommodation of the object to the surface, without its damper (first touch) and with it.
    fn object(&self) -> impl Iterator<Item = Finding> {
        let Axis { gains, environment, timing, .. } = *self.axis;
        let cases = [(0.0, "accommodation"), (environment.damping, "accommodation, damper")];
        let cases = cases.into_iter().filter(move |(damping, name)| {
            let is_felt = *name == "accommodation" || is_used(*damping);
            is_felt && is_used(gains.accommodation * environment.stiffness)
        });
        cases.map(move |(damping, name)| {
            let environment = Impedance { damping, ..environment };
            let axis = Axis { environment, ..*self.axis };
            let object = SampledLoop {
                axis: &axis,
                grip: ReducedGrip { mass: 1.0, damping: 0.0, stiffness: 0.0, sampled_damping: 0.0 },
                link_cycles: 0,
            };
            let multiple = margin(&object.accommodation(), f64::INFINITY);
            let value = gains.accommodation * environment.stiffness * timing.period;
            let left = Side { symbols: "K_FA k_e T".to_owned(), value, unit: "" };
            let right = Side { symbols: "K_FA k_e T at ρ = 1".to_owned(), value: value * multiple, unit: "" };
            let verdict = if multiple > 1.0 { Verdict::Holds } else { Verdict::Refuses };
            let reason = "the object would swing on the surface, whatever the hand does: lower K_FA, or soften the surface".to_owned();
            Finding { name, axis: axis.name, left, right, verdict, reason, culprit: Culprit::Accommodation }
        })
    }

    fn finding(
        &self,
        gain: &LoopGain,
        name: usize,
        multiple: f64,
        verdict: Verdict,
        reason: String,
    ) -> Finding {
        let LoopGain { closed, value, unit, culprit } = gain;
        let (names, symbol) = names(*closed);
        let left = Side { symbols: symbol.to_owned(), value: *value, unit };
        let right = Side { symbols: format!("{symbol} at ρ = 1"), value: value * multiple, unit };
        let name = names.get(name).copied().unwrap_or_default();
        Finding { name, axis: self.axis.name, left, right, verdict, reason, culprit: *culprit }
    }

    /// Returns the smallest gain margin over all postures, `hands` and link delays.
    fn least(&self, closed: Loop, hands: &[Hand]) -> GainMargin<'a> {
        let timing = self.axis.timing;
        let link = timing.link_cycles;
        let delays: &[u32] = if link == 0 { &[0] } else { &[0, link / 2, link] };
        let mut least =
            GainMargin { multiple: f64::INFINITY, omega: FIRST_ANGLE / timing.period, worst: None };
        for posture in self.gate.postures {
            for hand in hands {
                let held = self.held_by(*hand);
                for link_cycles in delays {
                    let reduced = |omega| SampledLoop {
                        axis: self.axis,
                        grip: posture.reduced(self.index, &held, omega),
                        link_cycles: *link_cycles,
                    };
                    let found =
                        refined_margin(reduced, closed, least.multiple, least.omega, timing.period);
                    if let Some((multiple, omega)) = found {
                        let hand = held.hand.get(self.index).copied().unwrap_or_default();
                        least = GainMargin { multiple, omega, worst: Some((posture, hand)) };
                        if multiple.is_nan() {
                            return least;
                        }
                    }
                }
            }
        }
        least
    }

    fn held_by(&self, hand: Hand) -> Restraint {
        let hand = self.gate.axes.each_ref().map(|axis| match hand {
            Hand::None => Impedance::default(),
            Hand::Configured => axis.hand,
            Hand::Preset([linear, angular]) => {
                if axis.is_rotation {
                    angular
                } else {
                    linear
                }
            }
        });
        Restraint { hand, damping: self.gate.axes.each_ref().map(|axis| axis.gains.damping) }
    }

    /// Returns `closed` with its gain on this axis; zero if the loop is not configured.
    fn loop_gain(&self, closed: Loop) -> LoopGain {
        let axis = self.axis;
        let units = axis.units();
        let (value, unit, culprit) = match closed {
            Loop::Damping => (axis.gains.damping, units.damping, Culprit::Damping),
            Loop::PassivityDamper => {
                (axis.passivity_damping, units.damping, Culprit::PassivityDamper)
            }
            Loop::Centring => (axis.centring(), units.stiffness, Culprit::Centring),
            // The coupling replaces the sensed wrench.
            Loop::Pose if axis.coupling.is_some() => (0.0, units.stiffness, Culprit::Wrench),
            Loop::Pose => {
                let felt = axis.pose_reflection_gain() * axis.environment.stiffness;
                (felt, units.stiffness, Culprit::Wrench)
            }
            Loop::Coupling => {
                let coupling =
                    axis.coupling.map_or(0.0, |coupling| coupling.stiffness + coupling.damping);
                (axis.pose_reflection_gain() * coupling, units.stiffness, Culprit::Coupling)
            }
            Loop::Rate => {
                let felt = axis.rate_reflection_gain() * axis.environment.stiffness;
                let accommodates = axis.gains.accommodation > 0.0;
                let culprit = if accommodates { Culprit::Wrench } else { Culprit::Accommodation };
                (felt, units.rate_gain, culprit)
            }
        };
        LoopGain { closed, value, unit, culprit }
    }
}

/// Returns the names of a loop's findings, in hands and let go, and the symbol of its gain.
const fn names(closed: Loop) -> ([&'static str; 2], &'static str) {
    match closed {
        Loop::Damping => (["damping, held", "damping, let go"], "K_D"),
        Loop::PassivityDamper => (["passivity damper, held", "passivity damper, let go"], "d"),
        Loop::Centring => (["return to centre, held", "return to centre, let go"], "2 F0/DB"),
        Loop::Pose => (["pose reflection, held", "pose reflection, let go"], "K_T K_P k_e"),
        Loop::Coupling => {
            (["virtual coupling, held", "virtual coupling, let go"], "K_T K_P (K_vc + B_vc/T)")
        }
        Loop::Rate => (["rate reflection, held", "rate reflection, let go"], "K_T K_V k_e"),
    }
}

impl GainMargin<'_> {
    /// Describes the hand and the posture of this margin.
    fn place(&self, axis: &Axis) -> String {
        let Some((placed, hand)) = self.worst else {
            return "nowhere in the range searched".to_owned();
        };
        let units = axis.units();
        let hand = if hand == Impedance::default() {
            String::new()
        } else {
            let (stiffness, damping) = (Digits(hand.stiffness), Digits(hand.damping));
            format!(
                "in a hand of {stiffness} {} and {damping} {}, ",
                units.stiffness, units.damping
            )
        };
        format!("{hand}{}", placed.posture)
    }
}

#[cfg(test)]
mod tests;
