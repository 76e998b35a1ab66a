//! One pass over a session: the messages of each cycle.

use std::collections::BTreeMap;
use std::io::Write;

use nalgebra::Isometry3;

use crate::ExportError;
use crate::diagnostics::Diagnostics;
use crate::frames;
use crate::json::{Status, Torques};
use crate::messages::{Header, JointState, PoseStamped, ScrewStamped, Time};
use crate::pace::{Decimation, Pace};
use crate::topics::{ARM_BASE, GRIP, OBJECT, OBJECT_BASE, SENSOR, Topic};
use crate::writer::Messages;
use contract::{Command, Echo, Head, Order};
use controller::JointVector;
use node::record::Record;
use remote::messages::order;
use replay::Session;
use signals::{Cycle, Findings, Recording, ReplayVerdict};
use telemetry::fidelity::command::AtGrip;
use units::spatial::{Motion, Twist};

/// Treatment of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Leave it out.
    Skip,
    /// Write its messages.
    Export,
    /// End before it.
    End,
}

/// Topics of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// ROS types, and JSON for the rest.
    All,
    /// Those of ROS types. Some readers refuse a file that has others.
    RosTypes,
}

/// Part of a session that a file has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Topics of the file.
    pub content: Content,
    /// Rate of `/tf`, status and torques.
    pub pace: Pace,
}

/// Result of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportSummary {
    /// Number of exported cycles.
    pub cycles: u64,
    /// Number of messages by topic, those without any left out.
    pub messages: Vec<(&'static str, u32)>,
    /// Reasons why parts of the session are not in the file, a sentence each.
    pub warnings: Vec<String>,
}

/// Exports the cycles of a session that `choose` wants.
///
/// # Errors
/// Returns an error if the session cannot be read, or the file cannot be written.
pub fn export(
    recording: &Recording<'_>,
    extent: Extent,
    out: impl Write,
    mut choose: impl FnMut(&Cycle<'_>) -> Choice,
) -> Result<ExportSummary, ExportError> {
    let mut cycles = recording.cycles()?;
    let mut exporter = Exporter::start(recording, extent, out)?;
    while let Some(cycle) = cycles.next() {
        match choose(&cycle) {
            Choice::Skip => {}
            Choice::Export => exporter.cycle(&cycle)?,
            Choice::End => break,
        }
    }
    exporter.finish(cycles.findings())
}

/// Export in progress.
struct Exporter<'a, W: Write> {
    out: Messages<W>,
    recording: Recording<'a>,
    /// Time zero of the session, in ns since 1970.
    origin_ns: u64,
    diagnostics: Diagnostics,
    decimation: Decimation,
    cycles: u64,
    /// Cycles without a record, and the first of them.
    unreplayed: u64,
    first_unreplayed: Option<u64>,
    /// Cycles that `bus.log` does not have.
    unlogged: u64,
}

impl<'a, W: Write> Exporter<'a, W> {
    /// Starts a file with what the session is a recording of.
    fn start(recording: &Recording<'a>, extent: Extent, out: W) -> Result<Self, ExportError> {
        let is_in_it = |topic: &Topic| extent.content == Content::All || topic.encoding().is_ros();
        let mut out = Messages::new(out, Topic::ALL.into_iter().filter(is_in_it))?;
        let session = recording.session();
        let origin_ns = session.manifest().origin_us.saturating_mul(1_000);
        out.put_metadata("frhc.session", &facts(session))?;
        let files = session.manifest().files.iter();
        let hashes = files.clone().map(|file| (file.copy.clone(), file.sha256.clone())).collect();
        out.put_metadata("frhc.sha256", &hashes)?;
        for file in files {
            let content = session.copies().get(std::path::Path::new(&file.path));
            if let Some(content) = content {
                out.attach(&file.copy, origin_ns, content)?;
            }
        }
        Ok(Self {
            out,
            recording: *recording,
            origin_ns,
            diagnostics: Diagnostics::default(),
            decimation: Decimation::new(extent.pace),
            cycles: 0,
            unreplayed: 0,
            first_unreplayed: None,
            unlogged: 0,
        })
    }

    /// Writes the messages of a cycle.
    fn cycle(&mut self, cycle: &Cycle<'_>) -> Result<(), ExportError> {
        let nanos = self.origin_ns.saturating_add(cycle.at.as_micros().saturating_mul(1_000));
        let stamp = Time::from_nanos(nanos);
        let config = self.recording.config();
        let names = &self.recording.session().manifest().joints;
        let q = cycle.wire.and_then(|wire| wire.q);
        let q = q.or(cycle.record.map(|record| record.output.q.into()));
        let q = q.filter(|q| q.iter().all(|position| position.is_finite()));

        if self.cycles == 0 {
            let x_m_s = config.controller.reflection.sensor();
            self.out.put(Topic::TfStatic, nanos, &frames::fixed(stamp, *x_m_s))?;
        }
        self.cycles += 1;
        self.unlogged += u64::from(cycle.wire.is_none());
        if let Some(message) = self.diagnostics.take(cycle, config, names, stamp) {
            self.out.put(Topic::Diagnostics, nanos, &message)?;
        }
        let is_due = self.decimation.is_due(cycle.at, (cycle.mode, cycle.cause()));
        if is_due {
            self.out.put(Topic::Status, nanos, &Status::new(cycle, q, names))?;
        }
        let sensed = ScrewStamped { header: header(stamp, SENSOR), screw: cycle.f_s.into() };
        self.out.put(Topic::ObjectMeasuredCf, nanos, &sensed)?;
        if let Some(q) = &q {
            self.joints(nanos, stamp, q, cycle.tau().as_ref())?;
        }
        let posture = q.map(|q| config.controller.arm.posture(&JointVector::from(q)));
        if is_due {
            let arm = posture.as_ref().map(|posture| (&config.controller.arm, posture));
            let x_b_m = cycle.record.map(|record| record.x_b_m);
            self.out.put(Topic::Tf, nanos, &frames::moving(stamp, arm, x_b_m))?;
        }
        if let Some(posture) = &posture {
            self.pose(Topic::MeasuredCp, nanos, stamp, ARM_BASE, posture.x_0_g)?;
        }
        match cycle.record {
            Some(record) => {
                if is_due {
                    self.out.put(Topic::Torques, nanos, &Torques::new(record))?;
                }
                self.replayed(nanos, stamp, record)
            }
            None => {
                self.unreplayed += 1;
                self.first_unreplayed.get_or_insert(cycle.number);
                Ok(())
            }
        }
    }

    fn joints(
        &mut self,
        nanos: u64,
        stamp: Time,
        q: &[f64; 6],
        tau: Option<&[f64; 6]>,
    ) -> Result<(), ExportError> {
        let state = JointState {
            header: header(stamp, ""),
            name: &self.recording.session().manifest().joints,
            position: q,
            velocity: &[],
            effort: tau.map_or(&[], |tau| tau),
        };
        self.out.put(Topic::MeasuredJs, nanos, &state)
    }

    /// Writes what only the replay has.
    fn replayed(&mut self, nanos: u64, stamp: Time, record: &Record) -> Result<(), ExportError> {
        let output = &record.output;
        let v_g = ScrewStamped { header: header(stamp, GRIP), screw: output.twist.v_g.into() };
        self.out.put(Topic::MeasuredCv, nanos, &v_g)?;
        let task = ScrewStamped { header: header(stamp, GRIP), screw: output.f_g_task.into() };
        self.out.put(Topic::TaskCf, nanos, &task)?;
        // Near a singularity torques say little about the wrench.
        if let Some(at_grip) = AtGrip::new(&output.j_g) {
            let f_g = at_grip.wrench(&(output.tau - output.ledger.carried()));
            let f_g = ScrewStamped { header: header(stamp, GRIP), screw: f_g.into() };
            self.out.put(Topic::SetpointCf, nanos, &f_g)?;
        }
        self.pose(Topic::ObjectMeasuredCp, nanos, stamp, OBJECT_BASE, record.x_b_m)?;
        let rate = match &output.command {
            Motion::Hold => Some(Twist::ZERO),
            Motion::Rate(v_m) => Some(*v_m),
            Motion::Pose(x_b_d) => {
                self.pose(Topic::ObjectSetpointCp, nanos, stamp, OBJECT_BASE, *x_b_d)?;
                None
            }
        };
        if let Some(v_m) = rate {
            let v_m = ScrewStamped { header: header(stamp, OBJECT), screw: v_m.into() };
            self.out.put(Topic::ObjectSetpointCv, nanos, &v_m)?;
        }
        let command = self.command(record);
        self.out.put_bytes(Topic::Command, nanos, &command)
    }

    /// Returns the command of a cycle as a message of the link, outside of any session: its number is that of the cycle.
    fn command(&self, record: &Record) -> [u8; Command::LENGTH] {
        let gripper = record.gripper.and_then(|gripper| gripper.command);
        let Order { motion, is_engaged, gripper } =
            order(&remote::Command { motion: record.output.command, gripper });
        let own = Echo { session: 0, sequence: record.cycle };
        let arm = self.recording.config().far_side.arm;
        let head = Head { arm, epoch: 0, own, echo: Echo::NONE };
        Command { head, motion, is_engaged, asks_capability: false, gripper }.encode()
    }

    fn pose(
        &mut self,
        topic: Topic,
        nanos: u64,
        stamp: Time,
        frame_id: &'static str,
        x: Isometry3<f64>,
    ) -> Result<(), ExportError> {
        let message = PoseStamped { header: header(stamp, frame_id), pose: x.into() };
        self.out.put(topic, nanos, &message)
    }

    /// Writes what was found, and the end of the file.
    fn finish(mut self, findings: &Findings) -> Result<ExportSummary, ExportError> {
        let warnings = self.warnings(findings);
        let verdict = verdict(findings.verdict.as_ref());
        let mut texts = BTreeMap::from([
            ("replay".to_owned(), verdict),
            ("cycles".to_owned(), self.cycles.to_string()),
            ("cycles_without_replay".to_owned(), self.unreplayed.to_string()),
            ("cycles_without_log".to_owned(), self.unlogged.to_string()),
        ]);
        for (number, warning) in (1..).zip(&warnings) {
            texts.insert(format!("warning_{number}"), warning.clone());
        }
        self.out.put_metadata("frhc.findings", &texts)?;
        let counts = Topic::ALL.map(|topic| (topic.name(), self.out.count(topic)));
        let messages = counts.into_iter().filter(|(_, count)| *count > 0).collect();
        let cycles = self.cycles;
        self.out.finish()?;
        Ok(ExportSummary { cycles, messages, warnings })
    }

    /// Returns the reasons why parts are missing.
    fn warnings(&self, findings: &Findings) -> Vec<String> {
        let mut warnings = findings.remarks.clone();
        if self.cycles == 0 {
            warnings.push("no cycle of the session is exported".to_owned());
        }
        if self.unlogged > 0 {
            let cycles = counted(self.unlogged);
            warnings.push(format!(
                "bus.log does not have {cycles}: statuswords and loads are left out there"
            ));
        }
        if let Some(first) = self.first_unreplayed {
            let reason = verdict(findings.verdict.as_ref());
            let cycles = counted(self.unreplayed);
            warnings.push(format!(
                "no replay of {cycles} from cycle {first} on ({reason}): poses of the object, commands, twists, felt \
                 wrenches and torques are left out there"
            ));
        }
        warnings
    }
}

fn counted(cycles: u64) -> String {
    format!("{cycles} {}", if cycles == 1 { "cycle" } else { "cycles" })
}

fn verdict(verdict: Option<&ReplayVerdict>) -> String {
    match verdict {
        None => "not to the end".to_owned(),
        Some(ReplayVerdict::Equal) => "all frames as recorded".to_owned(),
        Some(ReplayVerdict::EndsEarly(reason) | ReplayVerdict::Missing(reason)) => reason.clone(),
        Some(ReplayVerdict::Differs { difference, .. }) => difference.clone(),
    }
}

/// Returns the description of a session as texts.
fn facts(session: &Session) -> BTreeMap<String, String> {
    let manifest = session.manifest();
    let kind = match manifest.kind {
        telemetry::manifest::SessionKind::Run => "run",
        telemetry::manifest::SessionKind::Demo => "demo",
        telemetry::manifest::SessionKind::Campaign => "campaign",
    };
    let list = |names: &[String]| serde_json::Value::from(names).to_string();
    let mut texts = BTreeMap::from([
        ("program", manifest.program.clone()),
        ("kind", kind.to_owned()),
        ("format", manifest.format.to_string()),
        ("origin_us", manifest.origin_us.to_string()),
        ("configuration", manifest.configuration.clone()),
        ("interfaces", list(&manifest.interfaces)),
        ("joints", list(&manifest.joints)),
        ("without_passivity", manifest.without_passivity.to_string()),
        ("kernel", manifest.host.kernel.clone()),
        ("machine", manifest.host.machine.clone()),
        ("processor", manifest.host.processor.clone()),
    ]);
    texts.extend(manifest.robot.clone().map(|robot| ("robot", robot)));
    texts.extend(manifest.scenario.clone().map(|scenario| ("scenario", scenario)));
    texts.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
}

const fn header(stamp: Time, frame_id: &'static str) -> Header {
    Header { stamp, frame_id }
}
