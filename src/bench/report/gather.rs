//! One pass over the cycles of a session, in constant memory.

use std::io::BufRead;

use crate::figures::Figures;
use crate::modes::Modes;
use crate::series::Series;
use crate::timing::Timing;
use crate::words::counted;
use controller::Ledger;
use node::record::{Mode, Record};
use signals::{Cycle, Cycles, Findings, ReplayVerdict, WireCycles};
use units::spatial::Motion;
use units::time::Instant;

/// Number of cycles between two reports of progress.
const PROGRESS: u64 = 2_000;

/// Components of the ledger, in the order of [`ledger`].
pub(crate) const LEDGER: [&str; 8] =
    ["task", "gravity", "centring", "damping", "passivity", "friction", "soft stops", "hold"];

/// Source of cycles.
pub(crate) trait Source {
    /// Reads or computes the next cycle; `None` at the end.
    fn next_cycle(&mut self) -> Option<Cycle<'_>>;

    /// Returns the findings of the pass.
    fn findings(&self) -> Findings;
}

impl Source for Cycles {
    fn next_cycle(&mut self) -> Option<Cycle<'_>> {
        self.next()
    }

    fn findings(&self) -> Findings {
        Self::findings(self).clone()
    }
}

/// Cycles from the log alone, without a replay.
#[derive(Debug)]
pub(crate) struct LogAlone<R> {
    log: WireCycles<R>,
    /// Reason why there is no replay.
    reason: String,
    failure: Option<String>,
}

impl<R: BufRead> LogAlone<R> {
    pub(crate) fn new(log: WireCycles<R>, reason: impl Into<String>) -> Self {
        Self { log, reason: reason.into(), failure: None }
    }
}

impl<R: BufRead> Source for LogAlone<R> {
    fn next_cycle(&mut self) -> Option<Cycle<'_>> {
        let ending = match self.log.read() {
            Ok(ending) => ending?,
            Err(error) => {
                self.failure = Some(error.to_string());
                return None;
            }
        };
        let signals::Ending { number, at, mode, inputs, sampled, f_s } = ending;
        let (wire, record, sample_age) = (Some(self.log.wire()), None, None);
        Some(Cycle { number, at, mode, inputs, sampled, f_s, wire, record, sample_age })
    }

    fn findings(&self) -> Findings {
        let verdict = Some(ReplayVerdict::Missing(self.reason.clone()));
        Findings { remarks: self.failure.iter().cloned().collect(), verdict }
    }
}

/// Curves, modes and figures of a session.
#[derive(Clone, Debug)]
pub(crate) struct SessionData {
    /// Time of the first and the last cycle, in s since time zero.
    pub(crate) ends: Option<[f64; 2]>,
    pub(crate) modes: Modes,
    pub(crate) figures: Figures,
    pub(crate) timing: Option<Timing>,
    pub(crate) findings: Findings,
    /// Joints: positions, torques, and the ledger of each joint after another.
    pub(crate) q: Series,
    pub(crate) tau: Series,
    pub(crate) ledger: Series,
    /// Wrenches: sensed, reflected, and the magnitudes of the forces that act at the grip.
    pub(crate) f_s: Series,
    pub(crate) f_g_task: Series,
    pub(crate) grip: Series,
    /// Magnitudes of the sensed force and of the force on the hand.
    pub(crate) forces: Series,
    /// Displacement, rate command, commanded and actual position of the object.
    pub(crate) dx: Series,
    pub(crate) rate: Series,
    pub(crate) pose: Series,
    pub(crate) object: Series,
    /// Energy and tank, in J; activity of the passivity layer.
    pub(crate) energy: Series,
    pub(crate) activity: Series,
    pub(crate) sample_age: Series,
    pub(crate) loads: Series,
    pub(crate) missing: Series,
    /// Cycles of the replay that the log does not have, and cycles of the log that the replay does not have.
    without_log: u64,
    without_replay: u64,
}

impl SessionData {
    fn new(buses: usize) -> Self {
        let six = || Series::new(6);
        Self {
            ends: None,
            modes: Modes::default(),
            figures: Figures::default(),
            timing: Timing::new(),
            findings: Findings::default(),
            q: six(),
            tau: six(),
            ledger: Series::new(6 * LEDGER.len()),
            f_s: six(),
            f_g_task: six(),
            grip: Series::new(4),
            forces: Series::new(2),
            dx: six(),
            rate: six(),
            pose: Series::new(3),
            object: Series::new(3),
            energy: Series::new(2),
            activity: Series::new(1),
            sample_age: Series::new(1),
            loads: Series::new(buses),
            missing: Series::new(1),
            without_log: 0,
            without_replay: 0,
        }
    }

    /// Returns the result for a subject without a cycle: only a remark.
    pub(crate) fn without(remark: String) -> Self {
        let verdict = Some(ReplayVerdict::Missing("no cycle can be read".to_owned()));
        Self { findings: Findings { remarks: vec![remark], verdict }, ..Self::new(0) }
    }

    /// Reads all cycles. `None` if `on_progress`, which gets the number of cycles since its last call, returns false.
    pub(crate) fn read(
        source: &mut dyn Source,
        buses: usize,
        mut on_progress: impl FnMut(u64) -> bool,
    ) -> Option<Self> {
        let mut gathered = Self::new(buses);
        while let Some(cycle) = source.next_cycle() {
            gathered.add(&cycle);
            if gathered.figures.cycles.is_multiple_of(PROGRESS) && !on_progress(PROGRESS) {
                return None;
            }
        }
        gathered.findings = source.findings();
        let Self { without_log, without_replay, findings, .. } = &mut gathered;
        if *without_log > 0 {
            let cycles = counted(*without_log, "cycle");
            findings.remarks.push(format!("bus.log does not have {cycles} of the inputs"));
        }
        // The inputs may end between two calls of the node, as at the end of a complete session.
        if *without_replay > 0 && findings.verdict == Some(ReplayVerdict::Equal) {
            let cycles = counted(*without_replay, "cycle");
            findings.remarks.push(format!("inputs.bin ends before {cycles} that bus.log has"));
        }
        Some(gathered)
    }

    fn add(&mut self, cycle: &Cycle<'_>) {
        let at = cycle.at.since(Instant::ZERO).as_secs_f64();
        let [first, _] = self.ends.unwrap_or([at; 2]);
        self.ends = Some([first, at]);
        self.modes.add(at, cycle);
        self.figures.add(cycle);
        self.q.add(at, cycle.q().as_ref().map(|q| &q[..]));
        self.tau.add(at, cycle.tau().as_ref().map(|tau| &tau[..]));
        self.f_s.add(at, Some(&cycle.f_s.components()));
        let missing = cycle.sampled.iter().filter(|sampled| !**sampled).count();
        self.missing.add(at, Some(&[u32::try_from(missing).map_or(0.0, f64::from)]));
        let age = cycle.sample_age.map(|age| [age.as_secs_f64()]);
        self.sample_age.add(at, age.as_ref().map(|age| &age[..]));
        self.loads.add(at, cycle.wire.map(|wire| &wire.load_percent[..]));
        self.without_log += u64::from(cycle.wire.is_none());
        self.without_replay += u64::from(cycle.record.is_none());
        self.add_record(at, cycle);
    }

    fn add_record(&mut self, at: f64, cycle: &Cycle<'_>) {
        let record = cycle.record;
        let output = record.map(|record| &record.output);
        let force = cycle.f_s.force.norm();
        let felt = output.map(|output| (output.f_g_task + output.port.f_g_passivity).force.norm());
        self.forces.add(at, Some(&[force, felt.unwrap_or(f64::NAN)]));
        let books = output.map(|output| ledger(&output.ledger));
        self.ledger.add(at, books.as_ref().map(|books| &books[..]));
        let task = output.map(|output| output.f_g_task.components());
        self.f_g_task.add(at, task.as_ref().map(|task| &task[..]));
        let grip = record.map(grip);
        self.grip.add(at, grip.as_ref().map(|grip| &grip[..]));
        let dx = output.map(|output| output.dx.components());
        self.dx.add(at, dx.as_ref().map(|dx| &dx[..]));
        let [rate, pose] = output.map_or([None, None], |output| command(&output.command));
        self.rate.add(at, rate.as_ref().map(|rate| &rate[..]));
        self.pose.add(at, pose.as_ref().map(|pose| &pose[..3]));
        let object = record.map(|record| <[f64; 3]>::from(record.x_b_m.translation.vector));
        self.object.add(at, object.as_ref().map(|object| &object[..]));
        let energy = output.map(|output| {
            [output.port.energy, output.port.tank].map(|joules| joules.unwrap_or(f64::NAN))
        });
        self.energy.add(at, energy.as_ref().map(|energy| &energy[..]));
        let activity = output.map(|output| [output.port.activity]);
        self.activity.add(at, activity.as_ref().map(|activity| &activity[..]));
        if let (Some(record), Some(timing)) = (record, &mut self.timing) {
            timing.add(&record.times);
        }
    }

    /// Returns the time of the first engagement.
    pub(crate) fn first_engaged(&self) -> Option<f64> {
        self.modes.first(Mode::Engaged)
    }

    /// Returns whether the replay has computed any cycle.
    pub(crate) fn has_replay(&self) -> bool {
        !self.ledger.is_empty()
    }
}

/// Returns the torques of each joint after another, in the order of [`LEDGER`].
fn ledger(ledger: &Ledger) -> Vec<f64> {
    let Ledger { task, gravity, centring, damping, passivity, friction, soft_stops, hold, .. } =
        ledger;
    let parts = [task, gravity, centring, damping, passivity, friction, soft_stops, hold];
    let parts = parts.map(|part| <[f64; 6]>::from(*part));
    (0..6)
        .flat_map(|joint| parts.map(|part| part.get(joint).copied().unwrap_or(f64::NAN)))
        .collect()
}

/// Returns the magnitudes of the forces at the grip before any limit: task, passivity, return to centre, damping.
fn grip(record: &Record) -> [f64; 4] {
    let output = &record.output;
    let wrenches =
        [output.f_g_task, output.port.f_g_passivity, output.f_g_centring, output.f_g_damping];
    wrenches.map(|wrench| wrench.force.norm())
}

/// Returns a command: a rate, or the position of a pose.
fn command(command: &Motion) -> [Option<[f64; 6]>; 2] {
    match command {
        Motion::Hold => [None, None],
        Motion::Rate(v_m) => [Some(v_m.components()), None],
        Motion::Pose(x_b_d) => {
            let [x, y, z] = x_b_d.translation.vector.into();
            [None, Some([x, y, z, 0.0, 0.0, 0.0])]
        }
    }
}
