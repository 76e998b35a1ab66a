//! Measurement of a run over a link: rest at the wall, energy of the layer, and torques beyond gravity compensation.

use derive_more::Display;
use nalgebra::Vector3;
use serde::Serialize;

use crate::delay::script::JUDGED_S;
use config::Config;
use controller::JointVector;
use controller::torque_delay::TorqueDelay;
use node::cause::{Cause, CauseKind};
use node::record::{Mode, Record};
use telemetry::contact::Contact;
use telemetry::shaking::Shaking;
use testbench::bench::Bench;
use units::time::Instant;

/// Speed of the grip in m/s, RMS, below which a hand rests.
const CALM: f64 = 2e-3;

/// Force in N that the wall must bear while the hand is judged.
const MIN_FORCE: f64 = 0.5;

/// Torque in N·m that counts as reflection.
const MIN_TORQUE: f64 = 1e-9;

/// Outcome of a run over a link.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Hand at rest at the wall.
    #[display("calm")]
    Calm,
    /// Hand that moves at the wall with more than 2 mm/s RMS.
    #[display("swings")]
    Swings,
    /// Reflection ended or drives stopped by the node.
    #[display("stopped")]
    Stopped,
    /// Lost link, or no sample within the maximum age.
    #[display("link lost")]
    LinkLost,
    /// Hand at rest, but less than 0.5 N on the wall.
    #[display("wall not met")]
    WallNotMet,
}

/// Measurement of a run, one cycle at a time.
pub(super) struct Measurement {
    /// Energy and reversals in contact.
    pub(super) contact: Contact,
    /// Shaking of the arm in free motion.
    pub(super) shaking: Shaking,
    /// Energy that the passivity layer took from the hand, in J.
    pub(super) taken: f64,
    /// Largest torque beyond gravity compensation, in N·m.
    pub(super) largest: f64,
    /// Time from the start of the outage until the last torque beyond gravity compensation, in s.
    pub(super) reflected_for: Option<f64>,
    /// Cause of a stop.
    pub(super) cause: Option<Cause>,
    outage: Option<f64>,
    was_engaged: bool,
    layer: TorqueDelay<JointVector>,
    q_before: Option<JointVector>,
    x_before: Option<Vector3<f64>>,
    dt: f64,
    rest: Rest,
}

/// Sums over the judged part of the script.
#[derive(Clone, Copy, Debug, Default)]
struct Rest {
    cycles: f64,
    in_contact: f64,
    squares: f64,
    reflected: f64,
}

impl Measurement {
    /// Starts a measurement; `outage` is the start of an outage since the start of the node, in s.
    pub(super) fn new(config: &Config, outage: Option<f64>) -> Self {
        Self {
            contact: Contact::default(),
            shaking: Shaking::default(),
            taken: 0.0,
            largest: 0.0,
            reflected_for: None,
            cause: None,
            outage,
            was_engaged: false,
            layer: TorqueDelay::new(JointVector::zeros()),
            q_before: None,
            x_before: None,
            dt: config.controller.period.seconds(),
            rest: Rest::default(),
        }
    }

    /// Adds the cycle that `bench` has just run.
    pub(super) fn add(&mut self, bench: &Bench<()>, record: &Record) {
        let t = record.at.since(bench.begun()).as_secs_f64();
        self.contact.add(record);
        self.shaking.add(&record.f_s, self.dt);
        self.cause = record.cause;
        self.was_engaged |= record.mode == Mode::Engaged;
        self.add_layer(record);
        self.add_torque(record);
        let x = bench.world().plant().x_0_g().translation.vector;
        let speed = self.x_before.replace(x).map_or(0.0, |before| (x - before).norm() / self.dt);
        if (JUDGED_S[0]..JUDGED_S[1]).contains(&t) {
            self.rest.cycles += 1.0;
            self.rest.in_contact += f64::from(record.f_s.force.norm() >= MIN_FORCE);
            self.rest.squares += speed * speed;
            self.rest.reflected += record.output.f_g_task.force.norm();
        }
    }

    /// Adds the work of the layer: its torque of two cycles ago times the last motion.
    fn add_layer(&mut self, record: &Record) {
        let output = &record.output;
        let acted = self.layer.acted();
        let ledger = &output.ledger;
        self.layer.push(ledger.passivity * (ledger.rest_scale * ledger.share));
        let q_before = self.q_before.replace(output.q).unwrap_or(output.q);
        self.taken -= acted.dot(&(output.q - q_before));
    }

    fn add_torque(&mut self, record: &Record) {
        if !record.mode.allows_torque() {
            return;
        }
        let output = &record.output;
        let beyond = (output.tau - output.ledger.gravity).amax();
        self.largest = self.largest.max(beyond);
        let running = record.at.since(Instant::ZERO).as_secs_f64();
        let since = self.outage.map(|start| running - start).filter(|since| *since >= 0.0);
        if let Some(since) = since.filter(|_| beyond > MIN_TORQUE) {
            self.reflected_for = Some(since);
        }
    }

    /// Returns the RMS speed of the grip in the judged part, in m/s.
    pub(super) fn unrest(&self) -> f64 {
        (self.rest.squares / self.rest.cycles.max(1.0)).sqrt()
    }

    /// Returns the mean reflected force in the judged part, in N.
    pub(super) fn reflected(&self) -> f64 {
        self.rest.reflected / self.rest.cycles.max(1.0)
    }

    /// Returns the outcome: a stop first, then unrest, then a wall that was not met.
    pub(super) fn outcome(&self) -> Outcome {
        match self.cause.map(|cause| cause.kind()) {
            Some(CauseKind::LinkLost) => Outcome::LinkLost,
            Some(_) => Outcome::Stopped,
            None if !self.was_engaged => Outcome::LinkLost,
            None if self.unrest() > CALM => Outcome::Swings,
            None if self.rest.in_contact < self.rest.cycles => Outcome::WallNotMet,
            None => Outcome::Calm,
        }
    }
}
