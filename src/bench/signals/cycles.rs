//! Cycles of a session: the contents of its log together with the results of its replay.

use std::io::BufRead;
use std::time::Duration;

use crate::wire::{Ending, Wire, WireCycles};
use config::Config;
use node::cause::Cause;
use node::record::{Mode, Record};
use replay::{End, Replay, Session, SessionError};
use units::spatial::Wrench;
use units::time::Instant;

/// Recorded session, and the configuration of its node.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    session: &'a Session,
    config: &'a Config,
}

/// One cycle of a session.
#[derive(Clone, Copy, Debug)]
pub struct Cycle<'a> {
    /// Number in `bus.log`, from 1, those of boots included.
    pub number: u64,
    /// Time of the SYNC, since time zero of the session.
    pub at: Instant,
    /// Mode at the end of the cycle.
    pub mode: Mode,
    /// Inputs of the switch box; `None` where they are missing.
    pub inputs: Option<u8>,
    /// Joints with a sample in time.
    pub sampled: [bool; 6],
    /// Wrench of the environment on the object at {S}, in N and N·m.
    pub f_s: Wrench,
    /// Drives and buses according to the log; `None` if the log lacks this cycle.
    pub wire: Option<&'a Wire>,
    /// Record of the replay; `None` without a replay, or after its first difference.
    pub record: Option<&'a Record>,
    /// Age of the newest sample of the commanded side at SYNC, according to the replay.
    pub sample_age: Option<Duration>,
}

impl Cycle<'_> {
    /// Returns the joint positions, in rad or m.
    pub fn q(&self) -> Option<[f64; 6]> {
        let replayed = self.record.map(|record| record.output.q.into());
        replayed.or(self.wire.and_then(|wire| wire.q))
    }

    /// Returns the commanded joint torques, in N·m or N.
    pub fn tau(&self) -> Option<[f64; 6]> {
        let replayed = self.record.map(|record| record.output.tau.into());
        replayed.or(self.wire.and_then(|wire| wire.tau))
    }

    /// Returns the target torques (6071h), in ‰ of rated torque.
    pub fn targets(&self) -> Option<[i16; 6]> {
        let replayed = self.record.map(|record| record.targets);
        replayed.or(self.wire.and_then(|wire| wire.targets))
    }

    /// Returns the cause of a stop, while stopped. Only a replay has it.
    pub fn cause(&self) -> Option<Cause> {
        self.record.and_then(|record| record.cause)
    }
}

impl<'a> Recording<'a> {
    /// Returns a session with the configuration that its node had.
    pub const fn new(session: &'a Session, config: &'a Config) -> Self {
        Self { session, config }
    }

    /// Returns the folder, manifest and inputs of the recording.
    pub const fn session(&self) -> &'a Session {
        self.session
    }

    /// Returns the configuration of its node.
    pub const fn config(&self) -> &'a Config {
        self.config
    }

    /// Starts a pass over all cycles. If the log or the inputs cannot be read, only the other is used.
    ///
    /// # Errors
    /// Returns an error if neither can be read.
    pub fn cycles(&self) -> Result<Cycles, SessionError> {
        let manifest = self.session.manifest();
        let mut remarks = self.session.remarks();
        let log = self.session.bus_log().map(|log| {
            let log: Box<dyn BufRead> = Box::new(log);
            WireCycles::new(log, &manifest.interfaces, manifest.origin_us, Some(self.config))
        });
        let (log, replay) = match (log, self.session.replay(self.config)) {
            (Err(error), Err(_)) => return Err(error),
            (log, replay) => {
                let log = log.inspect_err(|error| remarks.push(error.to_string())).ok();
                let replay = replay.map_err(|error| error.to_string());
                (log, replay)
            }
        };
        let (replay, verdict) = match replay {
            Ok(replay) => (Some(replay), None),
            Err(reason) => (None, Some(ReplayVerdict::Missing(reason))),
        };
        let findings = Findings { remarks, verdict };
        Ok(Cycles { log, replay, ending: None, replayed: None, findings })
    }
}

/// One pass over the cycles of a session, in constant memory.
#[derive(Debug)]
pub struct Cycles {
    log: Option<WireCycles<Box<dyn BufRead>>>,
    replay: Option<Replay>,
    /// End of the log's next cycle.
    ending: Option<Ending>,
    replayed: Option<ReplayedCycle>,
    findings: Findings,
}

/// Replay's next cycle.
#[derive(Debug)]
struct ReplayedCycle {
    record: Record,
    /// Set if the cycle was returned already.
    is_used: bool,
}

/// Findings of a pass.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// Reasons for missing parts, one sentence each.
    pub remarks: Vec<String>,
    /// Result of the replay; `None` until it ends.
    pub verdict: Option<ReplayVerdict>,
}

/// Result of a replay.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReplayVerdict {
    /// All frames equal the recorded ones, up to the end of the recording.
    Equal,
    /// All frames equal the recorded ones, but the recording ends early: the reason.
    EndsEarly(String),
    /// Difference between replay and recording.
    Differs {
        /// Number of the cycle.
        cycle: u64,
        /// Difference in words.
        difference: String,
    },
    /// There is no replay: the reason.
    Missing(String),
}

impl Cycles {
    /// Returns the next cycle; `None` at the end.
    #[expect(clippy::should_implement_trait, reason = "a cycle is borrowed until the next one")]
    pub fn next(&mut self) -> Option<Cycle<'_>> {
        self.read_log();
        self.step_replay();
        let logged = self.ending.map(|ending| ending.number);
        let replayed = self.replayed.as_ref().map(|replayed| replayed.record.cycle);
        let number = logged.into_iter().chain(replayed).min()?;
        let ending = self.ending.take_if(|ending| ending.number == number);
        let wire = self.log.as_ref().filter(|_| ending.is_some()).map(WireCycles::wire);
        let replayed = self.replayed.as_mut().filter(|replayed| replayed.record.cycle == number);
        match (replayed, ending) {
            (Some(ReplayedCycle { record, is_used }), _) => {
                *is_used = true;
                let &mut Record { at, mode, inputs, sampled, f_s, sample_age, .. } = record;
                let record = Some(&*record);
                Some(Cycle { number, at, mode, inputs, sampled, f_s, wire, record, sample_age })
            }
            (None, Some(Ending { at, mode, inputs, sampled, f_s, .. })) => {
                let (record, sample_age) = (None, None);
                Some(Cycle { number, at, mode, inputs, sampled, f_s, wire, record, sample_age })
            }
            (None, None) => None,
        }
    }

    /// Returns the findings so far; complete after the last cycle.
    pub const fn findings(&self) -> &Findings {
        &self.findings
    }

    /// Reads on to the end of the log's next cycle, unless it waits already.
    fn read_log(&mut self) {
        let Some(log) = self.log.as_mut().filter(|_| self.ending.is_none()) else { return };
        match log.read() {
            Ok(ending) => self.ending = ending,
            Err(error) => self.findings.remarks.push(error.to_string()),
        }
        if self.ending.is_none() {
            self.log = None;
        }
    }

    /// Replays the next cycle, unless it waits already.
    fn step_replay(&mut self) {
        if self.replayed.as_ref().is_some_and(|replayed| !replayed.is_used) {
            return;
        }
        self.replayed = None;
        while let Some(replay) = &mut self.replay {
            if let Some(record) = replay.step() {
                self.replayed = Some(ReplayedCycle { record, is_used: false });
                return;
            }
            if let Some(verdict) = verdict(replay) {
                self.findings.verdict = Some(verdict);
                self.replay = None;
            }
        }
    }
}

/// Returns the result of a replay that has ended.
fn verdict(replay: &Replay) -> Option<ReplayVerdict> {
    let outcome = replay.outcome();
    Some(match outcome.end.as_ref()? {
        End::Complete => ReplayVerdict::Equal,
        End::Cut(place) => ReplayVerdict::EndsEarly(format!("the inputs end {place}")),
        End::Lost(place, inputs) => {
            ReplayVerdict::EndsEarly(format!("{inputs} inputs are missing {place}"))
        }
        End::Unreadable(place, error) => ReplayVerdict::EndsEarly(format!("{error}, {place}")),
        End::Differs(found) => {
            let law = outcome.intermediate.map_or_else(String::new, |(cycle, name)| {
                format!("; {name} is the first intermediate that differs, in cycle {cycle}")
            });
            ReplayVerdict::Differs { cycle: found.place.cycle, difference: format!("{found}{law}") }
        }
    })
}
