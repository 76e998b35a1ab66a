//! Gate of the gains: each loop of one axis with its exact model, in every hand and at every posture of a sample.
//!
//! The largest gain at which the spectral radius ρ of the [`sampled_loop`](crate::stability::sampled_loop) reaches 1 is
//! found for each hand and posture; the least counts. Not passivity, which is a warning of [`axis`](crate::stability::axis):
//! a loop that is not passive may be stable in every hand.

use crate::stability::axis::{Axis, Impedance, is_used};
use crate::stability::finding::{Culprit, Digits, Finding, Side, Verdict};
use crate::stability::grip_dynamics::{GripDynamics, ReducedGrip, Restraint};
use crate::stability::least_multiple::{bound, refined};
use crate::stability::sampled_loop::{Loop, SampledLoop};

/// Share of the bound from which a gain warns.
const MARGIN: f64 = 0.8;

/// Hands beside the configured one: relaxed, nervous and firm, along and about an axis. The ranges and their sources are
/// those of the simulation's operator presets.
const HANDS: [[Impedance; 2]; 3] = [
    [Impedance { stiffness: 150.0, damping: 8.0 }, Impedance { stiffness: 2.0, damping: 0.06 }],
    [Impedance { stiffness: 600.0, damping: 12.0 }, Impedance { stiffness: 8.0, damping: 0.1 }],
    [Impedance { stiffness: 800.0, damping: 30.0 }, Impedance { stiffness: 10.0, damping: 0.2 }],
];

/// Hands in which no gain may swing.
const HANDS_JUDGED: [Hand; 4] = {
    let [relaxed, nervous, firm] = HANDS;
    [Hand::Configured, Hand::Stated(relaxed), Hand::Stated(nervous), Hand::Stated(firm)]
};

/// Loops in the order of their findings.
const LOOPS: [Loop; 6] =
    [Loop::Damping, Loop::PassivityDamper, Loop::Centring, Loop::Pose, Loop::Coupling, Loop::Rate];

/// Halvings of a refused stiffness on the way to one that holds.
const STIFFNESS_HALVINGS: u32 = 40;

/// Angle ωT at which the grip is reduced first.
const FIRST_ANGLE: f64 = 0.05;

/// The six axes of the grip with the postures at which they are judged.
#[derive(Clone, Copy, Debug)]
pub struct Gate<'a> {
    /// The axes; their own devices are not judged.
    pub axes: &'a [Axis; 6],
    /// The device at each posture.
    pub postures: &'a [GripDynamics],
}

/// Least bound of a gain, as a multiple of it.
#[derive(Clone, Copy, Debug)]
struct Bound<'a> {
    multiple: f64,
    /// Frequency of the swing at the bound, in rad/s.
    omega: f64,
    worst: Option<(&'a GripDynamics, Impedance)>,
}

/// A hand on the grip.
#[derive(Clone, Copy, Debug)]
enum Hand {
    None,
    /// That of the configuration.
    Configured,
    /// With these impedances along and about an axis.
    Stated([Impedance; 2]),
}

/// One of the axes, under judgement.
#[derive(Clone, Copy, Debug)]
struct Bench<'a> {
    gate: &'a Gate<'a>,
    axis: &'a Axis,
    index: usize,
}

/// A loop with the gain that is judged.
struct Judged {
    closed: Loop,
    value: f64,
    unit: &'static str,
    culprit: Culprit,
}

impl Gate<'_> {
    /// Judges every loop of the axis with this index, from 0: in hands, and let go.
    pub fn findings(&self, index: usize) -> Vec<Finding> {
        let Some(axis) = self.axes.get(index) else { return Vec::new() };
        Bench { gate: self, axis, index }.findings()
    }
}

impl<'a> Bench<'a> {
    fn findings(&self) -> Vec<Finding> {
        let judged = LOOPS.into_iter().map(|closed| self.judged(closed));
        let used = judged.filter(|judged| is_used(judged.value));
        let in_hands = used.flat_map(|judged| [self.held(&judged), self.let_go(&judged)]);
        in_hands.chain(self.object()).collect()
    }

    /// Stability in every hand. Beyond the bound the gain is refused, unless it is that of the passivity layer's damper.
    fn held(&self, judged: &Judged) -> Finding {
        let bound = self.least(judged.closed, &HANDS_JUDGED);
        let verdict = match bound.multiple {
            multiple if multiple * MARGIN > 1.0 => Verdict::Holds,
            multiple if multiple > 1.0 => Verdict::Warns,
            // It acts in contact only, as long as energy is missing: not a loop that is always closed.
            multiple if judged.closed == Loop::PassivityDamper && multiple >= 0.0 => Verdict::Warns,
            _ => Verdict::Refuses,
        };
        let swings = match verdict {
            Verdict::Refuses if bound.multiple.is_nan() => "has values that are not finite",
            Verdict::Refuses => "swings more and more",
            _ if bound.multiple <= 1.0 => {
                "would swing while the layer's damper is at its strongest"
            }
            Verdict::Warns | Verdict::Holds => "is near its bound",
        };
        let place = bound.place(self.axis);
        let is_surface = verdict == Verdict::Refuses && judged.closed == Loop::Pose;
        let remedy = if is_surface { self.remedy(judged.closed) } else { String::new() };
        let reason = format!("the loop {swings} {place}{remedy}");
        self.finding(judged, 0, bound.multiple, verdict, reason)
    }

    /// Says which surface these gains hold.
    fn remedy(&self, closed: Loop) -> String {
        let (stiffness, unit) = (self.stiffest_held(closed), self.axis.units().stiffness);
        if stiffness > 0.0 {
            format!("; with these gains a surface holds up to {} {unit}", Digits(stiffness))
        } else {
            "; with these gains and this damper no surface holds".to_owned()
        }
    }

    /// Returns the stiffest surface, with the configured one's damper, on which the loop is stable in every hand; zero if it
    /// is on no surface.
    fn stiffest_held(&self, closed: Loop) -> f64 {
        let environment = self.axis.environment;
        let holds = |stiffness| {
            let axis = Axis { environment: Impedance { stiffness, ..environment }, ..*self.axis };
            Bench { axis: &axis, ..*self }.least(closed, &HANDS_JUDGED).multiple > 1.0
        };
        let (mut low, mut high) = (0.0, environment.stiffness);
        for _ in 0..STIFFNESS_HALVINGS {
            let middle = f64::midpoint(low, high);
            if holds(middle) { low = middle } else { high = middle }
        }
        low
    }

    /// Stability without a hand, which is a warning only.
    fn let_go(&self, judged: &Judged) -> Finding {
        let bound = self.least(judged.closed, &[Hand::None]);
        let verdict = match bound.multiple {
            multiple if multiple > 1.0 => Verdict::Holds,
            multiple if multiple.is_nan() => Verdict::Refuses,
            _ => Verdict::Warns,
        };
        let by = if self.axis.is_watched { "the passivity layer and a hand" } else { "a hand" };
        let reason =
            format!("left to {by}: a grip that is let go swings {}", bound.place(self.axis));
        self.finding(judged, 1, bound.multiple, verdict, reason)
    }

    /// Accommodation of the object to the surface, at the touch and within.
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
            let multiple = bound(&object.accommodation(), f64::INFINITY);
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
        judged: &Judged,
        name: usize,
        multiple: f64,
        verdict: Verdict,
        reason: String,
    ) -> Finding {
        let Judged { closed, value, unit, culprit } = judged;
        let (names, symbol) = names(*closed);
        let left = Side { symbols: symbol.to_owned(), value: *value, unit };
        let right = Side { symbols: format!("{symbol} at ρ = 1"), value: value * multiple, unit };
        let name = names.get(name).copied().unwrap_or_default();
        Finding { name, axis: self.axis.name, left, right, verdict, reason, culprit: *culprit }
    }

    /// Returns the least bound of all postures, `hands` and link delays.
    fn least(&self, closed: Loop, hands: &[Hand]) -> Bound<'a> {
        let timing = self.axis.timing;
        let link = timing.link_cycles;
        let delays: &[u32] = if link == 0 { &[0] } else { &[0, link / 2, link] };
        let mut least =
            Bound { multiple: f64::INFINITY, omega: FIRST_ANGLE / timing.period, worst: None };
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
                        refined(reduced, closed, least.multiple, least.omega, timing.period);
                    if let Some((multiple, omega)) = found {
                        let hand = held.hand.get(self.index).copied().unwrap_or_default();
                        least = Bound { multiple, omega, worst: Some((posture, hand)) };
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
            Hand::Stated([linear, angular]) => {
                if axis.is_rotation {
                    angular
                } else {
                    linear
                }
            }
        });
        Restraint { hand, damping: self.gate.axes.each_ref().map(|axis| axis.gains.damping) }
    }

    /// Returns a loop with its gain on this axis.
    fn judged(&self, closed: Loop) -> Judged {
        let axis = self.axis;
        let units = axis.units();
        let (value, unit, culprit) = match closed {
            Loop::Damping => (axis.gains.damping, units.damping, Culprit::Damping),
            Loop::PassivityDamper => {
                (axis.passivity_damping, units.damping, Culprit::PassivityDamper)
            }
            Loop::Centring => (axis.centring(), units.stiffness, Culprit::Centring),
            // The coupling takes the place of the sensed wrench.
            Loop::Pose if axis.coupling.is_some() => (0.0, units.stiffness, Culprit::Wrench),
            Loop::Pose => {
                let felt = axis.felt_pose() * axis.environment.stiffness;
                (felt, units.stiffness, Culprit::Wrench)
            }
            Loop::Coupling => {
                let coupling =
                    axis.coupling.map_or(0.0, |coupling| coupling.stiffness + coupling.damping);
                (axis.felt_pose() * coupling, units.stiffness, Culprit::Coupling)
            }
            Loop::Rate => {
                let felt = axis.felt_rate() * axis.environment.stiffness;
                let accommodates = axis.gains.accommodation > 0.0;
                let culprit = if accommodates { Culprit::Wrench } else { Culprit::Accommodation };
                (felt, units.rate_gain, culprit)
            }
        };
        Judged { closed, value, unit, culprit }
    }
}

/// Names of the findings of a loop, in hands and let go, and symbols of its gain.
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

impl Bound<'_> {
    /// Returns the hand and the posture of the least bound, in words.
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
