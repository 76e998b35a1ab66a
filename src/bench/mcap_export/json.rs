//! Status and torque budget of a cycle in JSON. Values that are unknown or not finite are left out; `json_schemas/` describes the rest.

use serde::Serialize;

use controller::JointVector;
use node::cause::Cause;
use node::record::{Mode, Record};
use signals::Cycle;
use units::drive::PerMille;
use units::numbering::Joint;

/// Mode, samples, timing and link of a cycle.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Status<'a> {
    cycle: u64,
    mode: &'static str,
    /// Place of the mode in the mode graph, for plots.
    mode_number: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    stopped_by: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    inputs: Option<u8>,
    sampled: [bool; 6],
    #[serde(skip_serializing_if = "Option::is_none")]
    q: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    statuswords: Option<[u16; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    load_percent: Option<&'a [f64]>,
    #[serde(flatten)]
    replayed: Option<ReplayStatus>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sample_age_us: Option<f64>,
}

/// Part of a status that only the replay has.
#[derive(Clone, Debug, Serialize)]
struct ReplayStatus {
    overruns: u64,
    rest_us: f64,
    wake_up_us: f64,
    window_us: f64,
    step_us: f64,
    targets_us: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    confirmed_us: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    energy_j: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tank_j: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    passivity_activity: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gripper_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gripper_n: Option<f64>,
}

impl<'a> Status<'a> {
    /// Returns the status of a cycle, with joint positions `q` and the names of the joints.
    pub(crate) fn new(cycle: &Cycle<'a>, q: Option<[f64; 6]>, names: &[String]) -> Self {
        let words = cycle.wire.and_then(|wire| {
            let words = wire.statuswords.iter().flatten().map(|word| word.0);
            words.collect::<Vec<_>>().try_into().ok()
        });
        Self {
            cycle: cycle.number,
            mode: cycle.mode.name(),
            mode_number: number(cycle.mode),
            stopped_by: cycle.cause().map(|cause| Cause::with_name(&cause, names)),
            inputs: cycle.inputs,
            sampled: cycle.sampled,
            q: q.filter(|q| q.iter().all(|position| position.is_finite())),
            statuswords: words,
            load_percent: cycle.wire.map(|wire| &*wire.load_percent),
            replayed: cycle.record.map(ReplayStatus::new),
            sample_age_us: cycle.sample_age.map(micros),
        }
    }
}

impl ReplayStatus {
    fn new(record: &Record) -> Self {
        let (times, port) = (&record.times, &record.output.port);
        let gripper = record.gripper.and_then(|gripper| gripper.measured);
        Self {
            overruns: record.overruns,
            rest_us: micros(times.rest),
            wake_up_us: micros(times.wake_up),
            window_us: micros(times.window),
            step_us: micros(times.step),
            targets_us: micros(times.targets),
            confirmed_us: times.confirmed.map(micros),
            energy_j: port.energy.filter(|energy| energy.is_finite()),
            tank_j: port.tank.filter(|tank| tank.is_finite()),
            passivity_activity: Some(port.activity).filter(|activity| activity.is_finite()),
            gripper_m: gripper.map(|gripper| gripper.position),
            gripper_n: gripper.map(|gripper| gripper.force),
        }
    }
}

/// Torque budget of a cycle, in N·m (N).
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Torques {
    cycle: u64,
    targets_per_mille: [i16; 6],
    #[serde(skip_serializing_if = "Option::is_none")]
    tau: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    task: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gravity: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    centring: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    damping: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    passivity: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    soft_stops: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    friction: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    hold: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    assist_scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rest_scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    share: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    limiting_joint: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slewing_joint: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    self_driven_joint: Option<u8>,
}

impl Torques {
    /// Takes targets, torques and ledger of a cycle. A list with a number that is not finite is left out.
    pub(crate) fn new(record: &Record) -> Self {
        let ledger = &record.output.ledger;
        let scale = |scale: f64| Some(scale).filter(|scale| scale.is_finite());
        Self {
            cycle: record.cycle,
            targets_per_mille: record.output.targets.map(|PerMille(target)| target),
            tau: finite(&record.output.tau),
            task: finite(&ledger.task),
            gravity: finite(&ledger.gravity),
            centring: finite(&ledger.centring),
            damping: finite(&ledger.damping),
            passivity: finite(&ledger.passivity),
            soft_stops: finite(&ledger.soft_stops),
            friction: finite(&ledger.friction),
            hold: finite(&ledger.hold),
            assist_scale: scale(ledger.assist_scale),
            rest_scale: scale(ledger.rest_scale),
            share: scale(ledger.share),
            limiting_joint: ledger.limiting_joint.map(Joint::number),
            slewing_joint: ledger.slewing_joint.map(Joint::number),
            self_driven_joint: ledger.self_driven.map(Joint::number),
        }
    }
}

/// Returns the values of the joints, if all are numbers: JSON has no others.
fn finite(values: &JointVector) -> Option<[f64; 6]> {
    values.iter().all(|value| value.is_finite()).then(|| (*values).into())
}

/// Returns the place of a mode in the mode graph, from 0.
fn number(mode: Mode) -> usize {
    Mode::ALL.iter().position(|it| *it == mode).unwrap_or_default()
}

fn micros(duration: std::time::Duration) -> f64 {
    duration.as_secs_f64() * 1e6
}
