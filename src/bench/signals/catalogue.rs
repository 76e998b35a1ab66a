//! All signals of a session. Names are those of STYLE.md: a wrench `f_g_task` on the hand at {G}, a pose `x_0_g` of {G} in {0}.

use std::time::Duration;

use crate::cycles::{Cycle, Recording};
use crate::reading::JointUnit::{Fixed, Position, Torque};
use crate::reading::Reading::{self, Buses, Displacement, Joints, Number, Pose, Twist, Wrench};
use crate::signal::Signal;
use crate::signal::Source::{self, Both, Log, Replay};
use controller::arm::JointKind;
use controller::{Ledger, Output};
use node::cycle_times::CycleTimes;
use node::record::GripperRecord;
use units::spatial::Motion;

/// Quantity: name, frame, source, reading, description.
type Quantity = (&'static str, &'static str, Source, Reading, &'static str);

/// All quantities: state, inputs of the node, the law from Eq. 1 to Fig. 6, outputs, timing.
const QUANTITIES: &[Quantity] = &[
    (
        "mode",
        "",
        Both,
        Number("", |cycle| Some(f64::from(cycle.mode.code()))),
        "mode: boot 0, ready 1, armed 2, engaged 3, reflection-off 4, zero-torque 5, drives-off 6",
    ),
    (
        "inputs",
        "",
        Both,
        Number("", |cycle| cycle.inputs.map(f64::from)),
        "inputs of the switch box, as bits (6000h)",
    ),
    ("samples", "", Both, Number("", samples), "joints with a sample in time"),
    ("q", "", Both, Joints(Position, |cycle| cycle.q()), "position"),
    (
        "f_s",
        "{S}",
        Both,
        Wrench(|cycle| Some(cycle.f_s)),
        "wrench of the environment on the object, payload removed",
    ),
    (
        "sample_age",
        "",
        Replay,
        Number("s", |cycle| cycle.sample_age.map(|age| age.as_secs_f64())),
        "age of the newest sample of the commanded side",
    ),
    (
        "x_b_m",
        "{b}",
        Replay,
        Pose(|cycle| Some(cycle.record?.x_b_m)),
        "pose of the object under control, {MRF}",
    ),
    (
        "model_distance",
        "",
        Replay,
        Number("m", |cycle| Some(cycle.record?.model?.distance)),
        "distance of the robot to its predicted pose",
    ),
    (
        "model_angle",
        "",
        Replay,
        Number("rad", |cycle| Some(cycle.record?.model?.angle)),
        "angle of the robot to its predicted orientation",
    ),
    ("x_0_g", "{0}", Replay, Pose(|cycle| Some(output(cycle)?.x_0_g)), "pose of the grip (Eq. 1)"),
    (
        "v_g",
        "{G}",
        Replay,
        Twist(|cycle| Some(output(cycle)?.twist.v_g)),
        "twist of the grip, filtered",
    ),
    (
        "dx",
        "{G0}",
        Replay,
        Displacement(|cycle| Some(output(cycle)?.dx)),
        "displacement of the grip from its reference (Eq. 4)",
    ),
    (
        "dx_db",
        "{G0}",
        Replay,
        Displacement(|cycle| Some(output(cycle)?.dx_db)),
        "displacement less the deadband",
    ),
    ("v_m", "{MRF}", Replay, Twist(rate), "rate command (Eq. 5)"),
    ("x_b_d", "{b}", Replay, Pose(desired), "pose command (3.5)"),
    (
        "gripper_d",
        "",
        Replay,
        Number("m", |cycle| Some(gripper(cycle)?.command?.position)),
        "commanded opening of the gripper",
    ),
    (
        "gripper",
        "",
        Replay,
        Number("m", |cycle| Some(gripper(cycle)?.measured?.position)),
        "opening of the gripper, as the commanded side reports it",
    ),
    (
        "gripper_force",
        "",
        Replay,
        Number("N", |cycle| Some(gripper(cycle)?.measured?.force)),
        "force of the gripper, as the commanded side reports it",
    ),
    (
        "f_m_task",
        "{MRF}",
        Replay,
        Wrench(|cycle| Some(output(cycle)?.f_m_task)),
        "wrench on the object, felt or not (Eq. 6)",
    ),
    (
        "f_g_task",
        "{G}",
        Replay,
        Wrench(|cycle| Some(output(cycle)?.f_g_task)),
        "wrench of the task on the hand",
    ),
    (
        "f_g_passivity",
        "{G}",
        Replay,
        Wrench(|cycle| Some(output(cycle)?.port.f_g_passivity)),
        "wrench of the dampers that keep the port passive",
    ),
    (
        "f_g_centring",
        "{G}",
        Replay,
        Wrench(|cycle| Some(output(cycle)?.f_g_centring)),
        "return to centre (Eq. 8)",
    ),
    (
        "f_g_damping",
        "{G}",
        Replay,
        Wrench(|cycle| Some(output(cycle)?.f_g_damping)),
        "damping (Eq. 9)",
    ),
    (
        "energy",
        "",
        Replay,
        Number("J", |cycle| output(cycle)?.port.energy),
        "energy from the hand into the port, less energy out of it",
    ),
    ("tank", "", Replay, Number("J", |cycle| output(cycle)?.port.tank), "level of the tank"),
    (
        "activity",
        "",
        Replay,
        Number("", |cycle| Some(output(cycle)?.port.activity)),
        "activity of the passivity layer, 0 to 1",
    ),
    (
        "task",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.task.into())),
        "torque of the task (Eq. 7)",
    ),
    (
        "gravity",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.gravity.into())),
        "torque of gravity compensation, with its share",
    ),
    (
        "centring",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.centring.into())),
        "torque of the return to centre, before its scale",
    ),
    (
        "damping",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.damping.into())),
        "torque of the damping, before its scale",
    ),
    (
        "passivity",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.passivity.into())),
        "torque of the passivity layer",
    ),
    (
        "soft_stops",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.soft_stops.into())),
        "torque of the soft stops",
    ),
    (
        "hold",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.hold.into())),
        "torque of the hold, by which the arm moves itself",
    ),
    (
        "friction",
        "",
        Replay,
        Joints(Torque, |cycle| Some(ledger(cycle)?.friction.into())),
        "torque of friction compensation",
    ),
    (
        "assist_scale",
        "",
        Replay,
        Number("", |cycle| Some(ledger(cycle)?.assist_scale)),
        "scale of return to centre and damping, 0 to 1 (Eq. 10)",
    ),
    (
        "rest_scale",
        "",
        Replay,
        Number("", |cycle| Some(ledger(cycle)?.rest_scale)),
        "scale of task and assist together, 0 to 1 (Eq. 10)",
    ),
    (
        "share",
        "",
        Replay,
        Number("", |cycle| Some(ledger(cycle)?.share)),
        "share of task and assist that is reflected, 0 to 1",
    ),
    (
        "tau",
        "",
        Both,
        Joints(Torque, |cycle| cycle.tau()),
        "commanded torque (Eq. 10); by the log that of the target",
    ),
    (
        "target",
        "",
        Both,
        Joints(Fixed("‰"), |cycle| Some(cycle.targets()?.map(f64::from))),
        "target torque (6071h), in ‰ of rated torque",
    ),
    (
        "statusword",
        "",
        Log,
        Joints(Fixed(""), statuswords),
        "statusword (6041h); NaN until all drives have sent theirs",
    ),
    (
        "load",
        "",
        Log,
        Buses("%", |cycle, bus| cycle.wire?.load_percent.get(bus).copied()),
        "load of the bus between its last two SYNCs",
    ),
    (
        "wake_up",
        "",
        Replay,
        Number("s", |cycle| seconds(times(cycle)?.wake_up)),
        "time from SYNC due to the wake-up",
    ),
    (
        "sample_time",
        "",
        Replay,
        Joints(Fixed("s"), sample_times),
        "time from SYNC to the sample; NaN where it is missing",
    ),
    (
        "window",
        "",
        Replay,
        Number("s", |cycle| seconds(times(cycle)?.window)),
        "time from SYNC to the end of its window",
    ),
    (
        "step",
        "",
        Replay,
        Number("s", |cycle| seconds(times(cycle)?.step)),
        "time of watches and controller",
    ),
    (
        "last_target",
        "",
        Replay,
        Number("s", |cycle| seconds(times(cycle)?.targets)),
        "time from SYNC to the last target accepted by its bus",
    ),
    (
        "confirmed",
        "",
        Replay,
        Number("s", |cycle| seconds(times(cycle)?.confirmed?)),
        "time from SYNC to its transmit confirmation",
    ),
    (
        "overruns",
        "",
        Replay,
        Number("", |cycle| Some(count(cycle.record?.overruns))),
        "cycles over time so far",
    ),
];

/// Returns all signals of a session.
pub fn catalogue(recording: &Recording<'_>) -> Vec<Signal> {
    let joints = &recording.config().joints;
    let joints = joints.iter().map(|joint| (joint.name.clone(), joint.plant.link.kind));
    signals(&joints.collect::<Vec<_>>(), &recording.session().manifest().interfaces)
}

/// Returns the signals of any session: `<joint>` and `<bus>` are placeholders for the names of joints and interfaces.
pub fn placeholders() -> Vec<Signal> {
    signals(&[("<joint>".to_owned(), JointKind::Revolute)], &["<bus>".to_owned()])
}

fn signals(joints: &[(String, JointKind)], buses: &[String]) -> Vec<Signal> {
    let mut signals = Vec::new();
    for (quantity, frame, source, reading, about) in QUANTITIES {
        let components = reading.components(joints, buses).into_iter().enumerate();
        signals.extend(components.map(|(place, (component, unit))| {
            let lead = if component.is_empty() { "" } else { "." };
            let name = format!("{quantity}{lead}{component}");
            Signal { name, unit, frame, about, source: *source, place, reading: *reading }
        }));
    }
    signals
}

fn output<'c>(cycle: &Cycle<'c>) -> Option<&'c Output> {
    Some(&cycle.record?.output)
}

fn ledger<'c>(cycle: &Cycle<'c>) -> Option<&'c Ledger> {
    Some(&cycle.record?.output.ledger)
}

fn times<'c>(cycle: &Cycle<'c>) -> Option<&'c CycleTimes> {
    Some(&cycle.record?.times)
}

fn gripper(cycle: &Cycle<'_>) -> Option<GripperRecord> {
    cycle.record?.gripper
}

fn samples(cycle: &Cycle<'_>) -> Option<f64> {
    Some(cycle.sampled.iter().map(|is_sampled| f64::from(u8::from(*is_sampled))).sum())
}

fn rate(cycle: &Cycle<'_>) -> Option<units::spatial::Twist> {
    match output(cycle)?.command {
        Motion::Rate(v_m) => Some(v_m),
        Motion::Hold | Motion::Pose(_) => None,
    }
}

fn desired(cycle: &Cycle<'_>) -> Option<nalgebra::Isometry3<f64>> {
    match output(cycle)?.command {
        Motion::Pose(x_b_d) => Some(x_b_d),
        Motion::Hold | Motion::Rate(_) => None,
    }
}

fn statuswords(cycle: &Cycle<'_>) -> Option<[f64; 6]> {
    let words = cycle.wire?.statuswords;
    Some(words.map(|word| word.map_or(f64::NAN, |word| f64::from(word.0))))
}

fn sample_times(cycle: &Cycle<'_>) -> Option<[f64; 6]> {
    let samples = times(cycle)?.samples;
    Some(samples.map(|time| time.map_or(f64::NAN, |time| time.as_secs_f64())))
}

#[expect(clippy::unnecessary_wraps, reason = "a reading has no value where it is absent")]
const fn seconds(time: Duration) -> Option<f64> {
    Some(time.as_secs_f64())
}

/// Converts a count to a number: exact up to 2⁵³.
#[expect(clippy::as_conversions, clippy::cast_precision_loss, reason = "shown, not computed with")]
const fn count(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn names_are_distinct_and_described() {
        let signals = placeholders();
        let names: HashSet<&str> = signals.iter().map(|signal| &*signal.name).collect();
        assert_eq!(names.len(), signals.len());
        assert!(signals.iter().all(|signal| !signal.about.is_empty()));
        for quantity in ["q.<joint>", "f_s.mz", "x_0_g.qw", "load.<bus>", "energy"] {
            assert!(names.contains(quantity), "{quantity}");
        }
    }

    #[test]
    fn units_follow_kind_and_component() {
        let signals = signals(&[("slide".to_owned(), JointKind::Prismatic)], &[]);
        let unit = |name: &str| signals.iter().find(|signal| signal.name == name).unwrap().unit;
        for (name, expected) in [
            ("q.slide", "m"),
            ("tau.slide", "N"),
            ("target.slide", "‰"),
            ("f_s.fz", "N"),
            ("f_s.mx", "N·m"),
            ("x_b_m.pz", "m"),
            ("x_b_m.qi", ""),
            ("dx.alpha", "rad"),
            ("v_g.wx", "rad/s"),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }
}
