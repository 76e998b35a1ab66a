//! All inequalities of one axis of the grip, judged.
//!
//! Each loop alone: what they add up to is not judged, nor what one axis does to another. Both modes are
//! judged, as the console may change from one to the other.
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
    /// Part of these delays that is a link's, from command to wrench, in s; zero without one.
    pub link_delay: f64,
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
            self.rate_in_hand(),
            self.accommodation(),
            self.accommodation_damper(),
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
        (stiffness > 0.0)
            .then(|| self.passive("friction compensation", left, right, Culprit::Friction))
    }

    /// The plateau must overcome friction, or the hand rests wherever it is let go.
    fn centring_plateau(&self) -> Option<Finding> {
        let AxisGains { plateau, deadband, .. } = self.gains;
        let Device { friction, full_friction, .. } = self.device;
        let rest = bounds::rest_offset(plateau, deadband, full_friction);
        let unit = if self.is_rotation { "rad" } else { "m" };
        let (verdict, friction, reason) = if friction >= plateau {
            (
                Verdict::Refuses,
                friction,
                "a hand that is let go stays outside the deadband".to_owned(),
            )
        } else if full_friction >= plateau {
            let reason =
                "a hand displaced along several axes at once may stay outside the deadband";
            (Verdict::Warns, full_friction, reason.to_owned())
        } else {
            let reason = format!("a hand that is let go rests within {} {unit}", Digits(rest));
            (Verdict::Holds, full_friction, reason)
        };
        let unit = self.units().force;
        let left = Side { symbols: "f_c".to_owned(), value: friction, unit };
        let right = Side { symbols: "F0".to_owned(), value: plateau, unit };
        (plateau > 0.0).then(|| {
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

    /// Judges a loop by the damping it asks for: the device and the law may have it, or the hand must.
    pub(super) fn passive(
        &self,
        name: &'static str,
        left: Side,
        right: Side,
        culprit: Culprit,
    ) -> Finding {
        let hand = self.hand.damping;
        let (verdict, reason) = if left.value < right.value {
            (Verdict::Holds, "passive whatever holds the grip".to_owned())
        } else if left.value < right.value + hand {
            let by = if self.is_watched { "the passivity layer and the hand" } else { "the hand" };
            let (hand, unit) = (Digits(hand), self.units().damping);
            (Verdict::Warns, format!("left to {by}, b_h = {hand} {unit}"))
        } else {
            let (hand, unit) = (Digits(hand), self.units().damping);
            (Verdict::Refuses, format!("more than the hand can add, b_h = {hand} {unit}"))
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const AXIS: Axis = Axis {
        name: "x",
        is_rotation: false,
        device: Device {
            mass: 0.6,
            damping: 0.1,
            friction: 0.2,
            full_friction: 0.4,
            compensated_stiffness: 0.0,
            quantum: 1e-5,
        },
        hand: Impedance { stiffness: 500.0, damping: 15.0 },
        environment: Impedance { stiffness: 2_000.0, damping: 20.0 },
        coupling: None,
        yielded_inertia: 0.0,
        tank_damping: 0.0,
        gains: AxisGains {
            rate: 2.0,
            pose: 1.0,
            wrench: 0.3,
            damping: 8.0,
            deadband: 0.01,
            plateau: 2.0,
            accommodation: 0.01,
        },
        timing: Timing {
            period: 1e-3,
            torque_delay: 1,
            pose_delay: 3,
            rate_delay: 2,
            accommodation_delay: 0,
            link_delay: 0.0,
            servo_lag: 0.01,
            velocity_filter: 0.0,
        },
        is_watched: false,
    };

    fn axis() -> impl Strategy<Value = Axis> {
        let gains = (0.0..4.0_f64, 0.0..2.0_f64, 0.0..2.0_f64, 0.0..40.0_f64, 0.0..2.0_f64);
        (gains, 1e-3..0.1_f64, 0.0..5.0_f64, 1.0..1e5_f64).prop_map(
            |((rate, pose, wrench, damping, accommodation), deadband, plateau, stiffness)| Axis {
                gains: AxisGains { rate, pose, wrench, damping, deadband, plateau, accommodation },
                environment: Impedance { stiffness, damping: 20.0 },
                ..AXIS
            },
        )
    }

    fn verdict(axis: &Axis, name: &str) -> Verdict {
        axis.findings().iter().find(|finding| finding.name == name).unwrap().verdict
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn what_holds_has_its_left_side_below_its_right(axis in axis()) {
            for finding in axis.findings() {
                let Finding { left, right, verdict, .. } = &finding;
                prop_assert_eq!(left.value < right.value, *verdict == Verdict::Holds, "{}", finding);
            }
        }

        #[test]
        fn a_hand_that_damps_more_is_refused_no_more(axis in axis(), more in 0.0..50.0_f64) {
            let damping = axis.hand.damping + more;
            let calmer = Axis { hand: Impedance { damping, ..axis.hand }, ..axis };
            for (calmer, finding) in calmer.findings().iter().zip(axis.findings()) {
                prop_assert!(calmer.verdict <= finding.verdict, "{}, {}", calmer, finding);
            }
        }

        #[test]
        fn a_stiffer_surface_is_felt_no_better_in_pose_mode(axis in axis(), by in 1.0..10.0_f64) {
            let stiffness = axis.environment.stiffness * by;
            let harder = Axis { environment: Impedance { stiffness, ..axis.environment }, ..axis };
            let name = "pose reflection";
            prop_assert!(verdict(&harder, name) >= verdict(&axis, name));
        }
    }

    #[test]
    fn where_nothing_is_felt_there_is_nothing_to_say() {
        assert!(Axis { gains: AxisGains::default(), ..AXIS }.findings().is_empty());
    }

    #[test]
    fn without_a_surface_there_is_no_reflection_to_judge() {
        let free = Axis { environment: Impedance::default(), ..AXIS };
        let names: Vec<&str> = free.findings().iter().map(|finding| finding.name).collect();
        assert_eq!(names, ["damping", "return to centre, plateau", "return to centre, slope"]);
    }

    #[test]
    fn return_to_centre_below_friction_is_refused() {
        for (plateau, expected) in
            [(0.2, Verdict::Refuses), (0.3, Verdict::Warns), (0.5, Verdict::Holds)]
        {
            let axis = Axis { gains: AxisGains { plateau, ..AXIS.gains }, ..AXIS };
            assert_eq!(verdict(&axis, "return to centre, plateau"), expected);
        }
    }

    #[test]
    fn reflected_rate_without_accommodation_needs_the_hand() {
        let gains = AxisGains { accommodation: 0.0, ..AXIS.gains };
        let stiff = Axis { gains, ..AXIS };
        assert_eq!(verdict(&stiff, "rate reflection"), Verdict::Warns);
        assert_eq!(verdict(&stiff, "rate reflection, held"), Verdict::Holds);
        let weak = Axis { hand: Impedance { stiffness: 20.0, damping: 15.0 }, ..stiff };
        assert_eq!(verdict(&weak, "rate reflection, held"), Verdict::Refuses);
    }

    fn found(axis: &Axis, name: &str) -> Finding {
        axis.findings().into_iter().find(|finding| finding.name == name).unwrap()
    }

    #[test]
    fn virtual_coupling_is_a_spring_and_a_damper_as_felt() {
        let gains = AxisGains { pose: 2.0, ..AXIS.gains };
        // Felt at 0.3 times 2 of itself: K (T/2 + n T) of the spring, B of the damper.
        for (delay, stiffness, damping, required) in
            [(1, 400.0, 0.0, 0.36), (0, 400.0, 4.0, 2.52), (0, 0.0, 4.0, 2.4)]
        {
            let timing = Timing { torque_delay: delay, ..AXIS.timing };
            let coupling = Some(Impedance { stiffness, damping });
            let tied = Axis { coupling, gains, timing, ..AXIS };
            let Side { value, .. } = found(&tied, "virtual coupling").left;
            assert!((value - required).abs() < 1e-6 * required, "{value}");
            let names: Vec<&str> = tied.findings().iter().map(|finding| finding.name).collect();
            assert!(!names.contains(&"pose reflection"), "the surface is not felt");
        }
    }

    #[test]
    fn tank_damper_is_judged_together_with_damping() {
        let tank = |tank_damping| found(&Axis { tank_damping, ..AXIS }, "tank, damper");
        // 2 tan(π/8) M/T = 497.06 N·s/m, of which K_D takes 8.
        let Finding { left, right, verdict, .. } = tank(485.0);
        assert!((left.value - 493.0).abs() < 1e-9 && (right.value - 497.06).abs() < 0.01);
        assert_eq!((verdict, tank(490.0).verdict), (Verdict::Holds, Verdict::Refuses));
        assert!(AXIS.findings().iter().all(|finding| finding.name != "tank, damper"));
    }

    #[test]
    fn quantum_is_borne_by_all_damping_or_by_friction() {
        // Felt: 0.3 times 2,000 N/m. All damping: 0.1 + 8 + 15 N·s/m.
        let Finding { left, right, .. } = found(&AXIS, "pose reflection, quantum");
        assert!((left.value - 600.0).abs() < 1e-9, "{}", left.value);
        assert!((right.value - 2.0 * 0.2 / 1e-5).abs() < 1e-6, "{}", right.value);
        let fine = Axis { device: Device { quantum: 1e-6, ..AXIS.device }, ..AXIS };
        let most = found(&fine, "pose reflection, quantum").right.value;
        assert!((most - 2.0 * 23.1 / 1e-3).abs() < 1e-6, "{most}");
    }

    #[test]
    fn a_warning_says_what_it_is_left_to() {
        let warning = |axis: &Axis| axis.findings().first().map(ToString::to_string).unwrap();
        assert!(warning(&AXIS).ends_with("; left to the hand, b_h = 15.0 N·s/m"));
        let watched = warning(&Axis { is_watched: true, ..AXIS });
        assert!(watched.contains("left to the passivity layer and the hand"), "{watched}");
    }
}
