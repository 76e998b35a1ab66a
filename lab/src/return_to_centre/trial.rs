//! One run of the return to centre: the hand moves along one axis and lets go.

use serde::Serialize;

use crate::no_trial::NoTrial;
use crate::return_to_centre::curve::{Bins, ForceSample, Point};
use crate::return_to_centre::figures::{Figures, Law};
use crate::return_to_centre::script::Sweep;
use config::Config;
use controller::channels::Channels;
use controller::reference::Displacement;
use node::record::Record;
use remote::site::Virtual;
use telemetry::fidelity::Sample;
use testbench::bench::Bench;
use testbench::truth::Truth;
use units::spatial::Wrench;

/// Motion of the grip after the hand has let go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct GripReturn {
    /// Displacement at the release, in m or rad.
    pub from: f64,
    /// Displacement at the end of the run, in m or rad.
    pub rests_at: f64,
    /// Largest displacement beyond the reference, in m or rad.
    pub overshoot: f64,
    /// Time from the release until the deadband was entered for good, in s; absent where the grip rests outside.
    pub after_s: Option<f64>,
}

impl GripReturn {
    fn add(&mut self, since_s: f64, x: f64, deadband: f64) {
        if self.from.abs() <= 0.0 {
            self.from = x;
        }
        self.rests_at = x;
        self.overshoot = self.overshoot.max(-x * self.from.signum());
        let is_inside = x.abs() <= deadband;
        self.after_s = if is_inside { self.after_s.or(Some(since_s)) } else { None };
    }
}

/// Result of the sweep of one axis, with one configuration.
#[derive(Clone, Debug, Serialize)]
pub struct SweepResult {
    /// Name of the configuration.
    pub config: String,
    /// Name of the axis of ΔX.
    pub axis: &'static str,
    /// Units are rad and N·m instead of m and N.
    pub is_rotation: bool,
    /// Configured return to centre.
    pub law: Law,
    /// Figures of the curve; absent where the reflection ended early.
    pub figures: Option<Figures>,
    /// Smallest displacement with a command, in m or rad.
    pub command_from: Option<f64>,
    /// Motion after the release.
    pub returned: GripReturn,
    /// Cycles in which a joint was at its capacity or at a soft stop.
    pub limited_cycles: u64,
    /// Cause of a stop.
    pub stopped_by: Option<String>,
    /// Points of the curve.
    #[serde(skip)]
    pub points: Vec<Point>,
}

impl SweepResult {
    /// Plays the sweep of one axis; the object touches nothing.
    ///
    /// # Errors
    /// Returns an error if the hand cannot reach the ends of the sweep, or the drives cannot be enabled.
    pub fn play(name: &str, config: &Config, sweep: &Sweep, seed: u64) -> Result<Self, NoTrial> {
        let (axis, reach) = (sweep.name(), sweep.reach);
        let scenario = sweep.script(config).ok_or(NoTrial::OutOfReach { axis, reach })?;
        let config = &in_free_space(config);
        let mut bench = Bench::new(config, scenario, seed, ());
        bench.bring_up()?;
        let mut measured = Measurement::new(name, config, sweep);
        for _ in 0..config.controller.period.cycles(sweep.seconds()) {
            let record = bench.cycle();
            let t = record.at.since(bench.begun()).as_secs_f64();
            let sample = measured.truth.sample(&bench, &record);
            measured.add(t, &record, sample.as_ref());
        }
        let Measurement { bins, row, .. } = measured;
        let points = bins.points(|x| along(&config.controller.channels, sweep.axis, x));
        Ok(Self { figures: Figures::from_curve(&points, &row.law, reach), points, ..row })
    }
}

/// Returns the configuration with a commanded side that touches nothing.
fn in_free_space(config: &Config) -> Config {
    let remote = Virtual { wall: None, block: None, sphere: None, ..config.remote.clone() };
    config.clone().with_remote(remote)
}

/// Returns the law's return to centre at displacement `x` along one axis alone.
fn along(channels: &Channels, axis: usize, x: f64) -> f64 {
    let mut dx = [0.0; 6];
    dx.iter_mut().skip(axis).take(1).for_each(|component| *component = x);
    component(&channels.centring(&Displacement::from_components(dx)), axis)
}

fn component(components: &[f64; 6], axis: usize) -> f64 {
    components.get(axis).copied().unwrap_or(0.0)
}

/// Measurement of a running sweep.
struct Measurement {
    sweep: Sweep,
    truth: Truth,
    bins: Bins,
    row: SweepResult,
    /// Displacement in the last cycle, in m or rad.
    before: Option<f64>,
    dt: f64,
    config: Config,
}

impl Measurement {
    fn new(name: &str, config: &Config, sweep: &Sweep) -> Self {
        let channels = &config.controller.channels;
        let law = Law {
            deadband: component(&channels.deadbands(), sweep.axis),
            plateau: component(&channels.plateaus(), sweep.axis),
            wall: channels.walls().get(sweep.axis).copied().flatten(),
        };
        Self {
            sweep: *sweep,
            truth: Truth::new(config),
            bins: Bins::new(sweep.reach),
            row: SweepResult {
                config: name.to_owned(),
                axis: sweep.name(),
                is_rotation: sweep.axis >= 3,
                law,
                figures: None,
                command_from: None,
                returned: GripReturn::default(),
                limited_cycles: 0,
                stopped_by: None,
                points: Vec::new(),
            },
            before: None,
            dt: config.controller.period.seconds(),
            config: config.clone(),
        }
    }

    /// Adds a cycle at `t` s after the start of the script.
    fn add(&mut self, t: f64, record: &Record, sample: Option<&Sample>) {
        let axis = self.sweep.axis;
        let x = component(&record.output.dx.components(), axis);
        let speed = self.before.replace(x).map_or(0.0, |before| (x - before) / self.dt);
        let row = &mut self.row;
        row.stopped_by = record.cause.map(|cause| cause.to_string());
        if t >= self.sweep.release_s() {
            return row.returned.add(t - self.sweep.release_s(), x, row.law.deadband);
        }
        let Some(sample) = sample.filter(|_| t >= self.sweep.crossing_s()) else { return };
        let is_commanded = component(&record.output.dx_db.components(), axis).abs() > 0.0;
        if is_commanded {
            row.command_from = Some(row.command_from.map_or(x.abs(), |least| least.min(x.abs())));
        }
        let is_pushed = record.output.ledger.soft_stops.amax() > 0.0;
        row.limited_cycles += u64::from(record.output.is_saturated() || is_pushed);
        let of = |wrench: &Wrench| self.along_axis(record, wrench);
        let felt = ForceSample {
            total: of(&sample.felt),
            centring: of(&sample.parts.centring),
            damping: of(&sample.parts.damping),
        };
        self.bins.add(x, speed, &felt);
    }

    /// Returns the component along the axis of ΔX of a wrench at {G}.
    fn along_axis(&self, record: &Record, wrench: &Wrench) -> f64 {
        let displaced = self.config.controller.interpretation.displacement;
        let x_0_g = &record.output.x_0_g;
        let r_g_dx = record.output.reference.turn_to_grip(displaced, x_0_g);
        let force = r_g_dx.inverse() * wrench.force;
        let written = Wrench { force, moment: wrench.moment };
        component(&written.components(), self.sweep.axis)
    }
}
