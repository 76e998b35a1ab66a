//! Diagnostics: node, buses and drives, once a second and at each change of mode or cause.

use std::time::Duration;

use crate::messages::{DiagnosticArray, DiagnosticStatus, Header, KeyValue, Level, Time};
use canopen::drive::{State, Statusword};
use config::Config;
use node::cause::Cause;
use node::record::Mode;
use signals::{Cycle, Wire};
use units::time::Instant;

/// Maximum time between two messages.
const INTERVAL: Duration = Duration::from_secs(1);

/// Device that all statuses belong to.
const HARDWARE_ID: &str = "frhc";

/// Statistics since the last message.
#[derive(Clone, Debug, Default)]
pub(crate) struct Diagnostics {
    /// Time, mode and cause of the last message.
    last: Option<(Instant, Mode, Option<Cause>)>,
    cycles: u64,
    /// Number of cycles that the log has.
    logged: f64,
    overruns: u64,
    /// Maximum times of the steps.
    wake_up: Duration,
    step: Duration,
    /// Maximum age of a sample of the commanded side.
    sample_age: Option<Duration>,
    /// Cycles without a sample of each joint in time.
    missing: [u64; 6],
    /// Sum of the loads of each bus in all cycles, in percent.
    load_sums: Vec<f64>,
}

impl Diagnostics {
    /// Takes a cycle. Returns the message that is due with it.
    pub(crate) fn take(
        &mut self,
        cycle: &Cycle<'_>,
        config: &Config,
        names: &[String],
        stamp: Time,
    ) -> Option<DiagnosticArray> {
        self.add(cycle);
        let change = (cycle.mode, cycle.cause());
        let is_due = self.last.is_none_or(|(at, mode, cause)| {
            (mode, cause) != change || cycle.at.since(at) >= INTERVAL
        });
        if !is_due {
            return None;
        }
        let mut status = vec![self.node(cycle, names)];
        if let Some(wire) = cycle.wire {
            let loads = self.load_sums.iter().map(|sum| sum / self.logged.max(1.0));
            let buses = config.buses.iter().zip(loads);
            status.extend(buses.map(|(bus, load)| self::bus(&bus.name, load)));
            status
                .extend(names.iter().zip(self.joints(wire)).map(|(name, joint)| joint.named(name)));
        }
        let overruns = cycle.record.map_or(self.overruns, |record| record.overruns);
        *self = Self { last: Some((cycle.at, change.0, change.1)), overruns, ..Self::default() };
        Some(DiagnosticArray { header: Header { stamp, frame_id: "" }, status })
    }

    fn add(&mut self, cycle: &Cycle<'_>) {
        self.cycles += 1;
        for (missing, is_sampled) in self.missing.iter_mut().zip(cycle.sampled) {
            *missing += u64::from(!is_sampled);
        }
        if let Some(record) = cycle.record {
            self.wake_up = self.wake_up.max(record.times.wake_up);
            self.step = self.step.max(record.times.step);
        }
        self.sample_age = self.sample_age.max(cycle.sample_age);
        if let Some(wire) = cycle.wire {
            self.logged += 1.0;
            self.load_sums.resize(wire.load_percent.len(), 0.0);
            let loads = self.load_sums.iter_mut().zip(&wire.load_percent);
            loads.for_each(|(sum, load)| *sum += load);
        }
    }

    /// Returns mode, cause, overruns and wake-up delay of the node.
    fn node(&self, cycle: &Cycle<'_>, names: &[String]) -> DiagnosticStatus {
        let cause = cycle.cause().map(|cause| cause.with_name(names));
        let mut values = vec![value("mode", &cycle.mode.name()), value("cycle", &cycle.number)];
        values.extend(cause.clone().map(|cause| value("stopped_by", &cause)));
        let mut has_new_overruns = false;
        if let Some(record) = cycle.record {
            has_new_overruns = record.overruns > self.overruns;
            values.push(value("overruns", &record.overruns));
            values.push(value("max_wake_up_us", &self.wake_up.as_micros()));
            values.push(value("max_step_us", &self.step.as_micros()));
        }
        let age = self.sample_age.map(|age| value("max_sample_age_us", &age.as_micros()));
        values.extend(age);
        let level = match cycle.mode {
            Mode::ZeroTorque | Mode::DrivesOff => Level::Error,
            Mode::ReflectionOff => Level::Warn,
            Mode::Boot | Mode::Ready | Mode::Armed | Mode::Engaged | Mode::Measuring => {
                if has_new_overruns {
                    Level::Warn
                } else {
                    Level::Ok
                }
            }
        };
        let message = cause.unwrap_or_else(|| cycle.mode.name().to_owned());
        status(level, "node".to_owned(), message, values)
    }

    /// Returns the statuses of the drives, base first.
    fn joints<'a>(&'a self, wire: &'a Wire) -> impl Iterator<Item = JointStatus> + 'a {
        let targets = wire.targets.map_or([None; 6], |targets| targets.map(Some));
        let joints = wire.statuswords.iter().zip(targets).zip(&self.missing);
        joints.map(|((word, target), missing)| JointStatus {
            word: *word,
            target,
            missing: *missing,
            cycles: self.cycles,
        })
    }
}

/// State of one drive.
struct JointStatus {
    word: Option<Statusword>,
    target: Option<i16>,
    missing: u64,
    cycles: u64,
}

impl JointStatus {
    fn named(&self, name: &str) -> DiagnosticStatus {
        let state = self.word.and_then(Statusword::state);
        let is_fault = self.word.is_some_and(|word| word.has(Statusword::FAULT));
        let level = match (is_fault, self.missing) {
            (true, _) => Level::Error,
            (false, 0) => Level::Ok,
            (false, _) => Level::Warn,
        };
        let mut values =
            vec![value("missing_samples", &self.missing), value("cycles", &self.cycles)];
        values.extend(self.word.map(|word| value("statusword", &format!("{:04X}h", word.0))));
        values.extend(self.target.map(|target| value("target_per_mille", &target)));
        let message = state.map_or("unknown state", State::description).to_owned();
        status(level, format!("joint {name}"), message, values)
    }
}

/// Returns the status of a bus, with its mean load.
fn bus(name: &str, load_percent: f64) -> DiagnosticStatus {
    let values = vec![value("load_percent", &format!("{load_percent:.1}"))];
    status(Level::Ok, format!("bus {name}"), String::new(), values)
}

fn status(level: Level, name: String, message: String, values: Vec<KeyValue>) -> DiagnosticStatus {
    DiagnosticStatus { level, name, message, hardware_id: HARDWARE_ID, values }
}

fn value(key: &'static str, value: &impl ToString) -> KeyValue {
    KeyValue { key, value: value.to_string() }
}
