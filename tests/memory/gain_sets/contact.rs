//! Simulated contact of 20 s with one hand, in pose or rate mode, and the energy and speed it ends with.

use std::fmt;

use nalgebra::{Unit, Vector3};

use crate::common::prelude::*;
use node::cause::CauseKind;
use remote::site::Virtual;
use telemetry::contact::Contact;
use testbench::comparison::without_passivity;

/// Time of the contact that is judged, in s, and its last part, in which a swing would be large.
const SECONDS: f64 = 20.0;
const LAST_SECONDS: f64 = 4.0;

/// Time of the first impact, in s, which is judged apart.
const IMPACT_SECONDS: f64 = 1.0;

/// Tap that moves the hand further in and back: its start and end, until when its own energy counts as that of an
/// impact, and the time after it in which a swing is measured.
const TAP: [f64; 2] = [10.0, 11.0];
const TAP_OVER: f64 = 12.0;
const AFTER_TAP: std::ops::Range<f64> = 11.5..15.0;

/// Distance of the object from the wall, in m.
const GAP: f64 = 0.01;

/// Half the edge of the object, in m.
const HALF_EDGE: f64 = 0.02;

/// Maximum energy that a stable contact gives to the hand after the first impact, in mJ.
const MAX_ENERGY_MJ: f64 = 100.0;

/// Speed of a swing, in m/s.
const SWING: f64 = 0.01;

/// Operator presets with minimal tremor and no reaction: a linear loop with the impedance of the preset. Without any
/// tremor, a grip at rest would be detected as released, or its encoder as frozen.
pub(super) const HANDS: [&str; 4] = [
    "preset = \"steady\"\ntremor_mm = 0.05",
    "preset = \"relaxed\"\ntremor_mm = 0.05\nreaction_s = 0.0\nyielding = 0.0",
    "preset = \"firm\"\ntremor_mm = 0.05\nreaction_s = 0.0\nstiffening = 0.0",
    "preset = \"nervous\"\ntremor_mm = 0.05\nreaction_s = 0.0\nstiffening = 0.0\nstartle_n = 500.0",
];

/// Command mode of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CommandMode {
    Rate,
    Pose,
}

/// A contact to play.
#[derive(Clone, Copy, Debug)]
pub(super) struct Play<'a> {
    pub(super) config: &'a Config,
    pub(super) mode: CommandMode,
    /// Number of the hand in [`HANDS`].
    pub(super) hand: usize,
    /// Axis along which the object touches the wall, from 0.
    pub(super) axis: usize,
    /// Share of the arm's dry friction that it really has.
    pub(super) friction: f64,
}

/// Outcome of a contact.
#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    /// Energy given to the hand at the first impact, after it, and in the last seconds, in mJ.
    pub(super) energy_mj: [f64; 3],
    /// Maximum speed of the grip in m/s: after the tap, in the last seconds, and over the complete run.
    speeds: [f64; 3],
    /// Time with contact, in s.
    pub(super) contact_s: f64,
    /// Cause for which the drives stopped.
    stop: Option<Cause>,
}

/// Part of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// First second, or that of the tap.
    Impact,
    Later,
    /// Last seconds, in which a swing would be large.
    Last,
}

impl Part {
    /// Returns the part at `t`, in s, `since` the first contact.
    fn at(t: f64, since: f64) -> Self {
        let [tap, _] = TAP;
        if since <= IMPACT_SECONDS || (tap..TAP_OVER).contains(&t) {
            Self::Impact
        } else if since <= SECONDS - LAST_SECONDS {
            Self::Later
        } else {
            Self::Last
        }
    }
}

impl Play<'_> {
    /// Returns the outcome of 20 s of contact.
    pub(super) fn outcome(&self) -> Outcome {
        let config = self.with_wall();
        let world = config.clone().with_friction(self.friction);
        let scenario = Scenario::parse(&self.script(&config)).unwrap();
        let mut bench = Bench::in_world_of(&world, &config, scenario, 1, ());
        bench.bring_up().unwrap();
        let (mut outcome, mut contact, mut touched) =
            (Outcome::default(), Contact::default(), None);
        let mut before = Part::Impact;
        loop {
            let record = bench.cycle();
            let t = bench.elapsed().as_secs_f64();
            if record.mode != Mode::Engaged && t > 5.0 {
                outcome.stop = record.cause;
                return outcome;
            }
            let touches = record.f_s.force.norm() > 0.5 && t > 4.0;
            if touches && touched.is_none() {
                touched = Some(t);
            }
            let Some(start) = touched else {
                if t > 30.0 {
                    return outcome;
                }
                continue;
            };
            let part = Part::at(t, t - start);
            if part != std::mem::replace(&mut before, part) {
                contact = Contact::default();
            }
            contact.add(&record);
            if touches {
                outcome.contact_s += config.period.as_secs_f64();
            }
            let plant = bench.world().plant();
            let speed = plant.jacobian().twist(plant.qd()).linear.norm();
            let parts = [AFTER_TAP.contains(&t), part == Part::Last, true];
            for (most, _) in outcome.speeds.iter_mut().zip(parts).filter(|(_, is_in)| *is_in) {
                *most = most.max(speed);
            }
            let energy = &mut outcome.energy_mj[match part {
                Part::Impact => 0,
                Part::Later => 1,
                Part::Last => 2,
            }];
            *energy = energy.max(-1e3 * contact.lowest_energy_j);
            if t - start > SECONDS {
                return outcome;
            }
        }
    }

    /// Returns the configuration without a passivity layer, and with one wall across the axis.
    fn with_wall(&self) -> Config {
        let config = without_passivity(self.config);
        let Virtual { x_b_m, wall, .. } = config.remote.clone();
        let outwards = x_b_m.rotation * -self.along();
        let point = x_b_m.translation.vector - outwards * (HALF_EDGE + GAP);
        let wall = Some((point, Unit::new_normalize(outwards), wall.unwrap().2));
        config.clone().with_remote(Virtual { wall, block: None, ..config.remote })
    }

    fn along(&self) -> Vector3<f64> {
        let mut along = Vector3::zeros();
        along[self.axis] = 1.0;
        along
    }

    fn script(&self, config: &Config) -> String {
        let start = config.joints.each_ref().map(|joint| joint.plant.start);
        let way = config.controller.arm.forward(&start.into()).rotation * self.along();
        let place = |distance: f64| {
            let moved = way * distance;
            format!("[{:?}, {:?}, {:?}]", moved.x, moved.y, moved.z)
        };
        let (request, to, over) = match self.mode {
            CommandMode::Pose => {
                let gain = config.controller.command.pose_gain.values()[self.axis];
                ("mode pose", GAP / gain + 0.015, 1.0)
            }
            CommandMode::Rate => ("mode rate", 0.03, 0.5),
        };
        let ([tap, back], hand) = (TAP, HANDS[self.hand]);
        let (deeper, to) = (place(to + 0.015), place(to));
        format!(
            "seconds = 60.0\n[hand]\n{hand}\n\
            [[console]]\nat_s = 0.3\nrequest = \"{request}\"\n[[console]]\nat_s = 0.4\nrequest = \"arm\"\n\
            [[switch]]\nat_s = 2.2\ndeadman = true\n[[switch]]\nat_s = 2.5\nreflection = true\n\
            [[switch]]\nat_s = 2.6\nreflection = false\n[[switch]]\nat_s = 2.8\nreference = true\n\
            [[switch]]\nat_s = 2.9\nreference = false\n\
            [[move]]\nat_s = 4.0\nduration_s = {over}\nto_m = {to}\n\
            [[move]]\nat_s = {tap}\nduration_s = 0.1\nto_m = {deeper}\n\
            [[move]]\nat_s = {back}\nduration_s = 0.1\nto_m = {to}\n"
        )
    }
}

impl Outcome {
    /// Returns whether the oscillation after the tap has not decayed, or has stopped the drives. Stops due to a released
    /// grip or a frozen encoder do not count: a hand that hardly moves also causes them.
    pub(super) fn is_growing(&self) -> bool {
        let [after, last, _] = self.speeds;
        let has_swung = self.stop.is_some_and(|cause| {
            !matches!(cause.kind(), CauseKind::UncommandedMotion | CauseKind::PositionFrozen)
        });
        self.contact_s > 0.0 && has_swung || last > SWING && last > 0.8 * after
    }

    /// Returns whether the oscillation does not grow and the contact supplies little energy after its first second.
    pub(super) fn is_calm(&self) -> bool {
        let [_, later, last] = self.energy_mj;
        !self.is_growing() && later <= MAX_ENERGY_MJ && last <= MAX_ENERGY_MJ
    }

    /// Returns whether the first impact exceeds the maximum energy.
    pub(super) fn has_hard_impact(&self) -> bool {
        self.energy_mj[0] > MAX_ENERGY_MJ
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { energy_mj, speeds, contact_s, stop } = self;
        let word = if self.is_calm() { "calm" } else { "wild" };
        let [first, later, last] = energy_mj;
        let [after_tap, at_the_end, most] = speeds.map(|speed| 1e3 * speed);
        write!(
            f,
            "{word}, {first:.0}, {later:.0}, {last:.0} mJ, {after_tap:.2}, {at_the_end:.2}, {most:.0} mm/s, {contact_s:.0} s {}",
            stop.map(|cause| cause.to_string()).unwrap_or_default()
        )
    }
}
