//! Newest record and timing of all cycles, shared with the console. A status is computed when a client requests it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::recording_state::RecordingState;
use config::Config;
use config::zeroing::Zeroing;
use node::record::Record;
use remote::link::LatestLink;
use telemetry::feed::Scarce;
use telemetry::link_report::LinkReport;
use telemetry::losses::Losses;
use telemetry::status::{self, JointLabel, Status};
use telemetry::timing::{LateCycle, Timing, TimingReport};
use telemetry::way_out::Situation;
use units::time::Instant;

/// Newest record and timing, for the console.
#[derive(Clone, Debug, Default)]
pub(super) struct LatestStatus {
    latest: Arc<Mutex<Latest>>,
    /// Names of the joints with their units, base first.
    joints: Arc<[JointLabel]>,
    /// Rest posture of the arm; `None` in tests.
    zeroing: Option<Arc<Zeroing>>,
    /// Report on the session, if one is recorded.
    recording: Option<RecordingState>,
    /// Link to a robot in another process.
    link: Option<LatestLink>,
}

#[derive(Debug, Default)]
struct Latest {
    /// Newest record, with the missed samples and losses up to its cycle.
    newest: Option<(Record, u64, Losses)>,
    timing: Timing,
}

impl LatestStatus {
    /// Creates the state before the first cycle.
    pub(super) fn new(joints: Vec<JointLabel>, recording: Option<RecordingState>) -> Self {
        Self { latest: Arc::default(), joints: joints.into(), zeroing: None, recording, link: None }
    }

    /// Creates the state before the first cycle of a node of `config`.
    pub(super) fn from_config(config: &Config, recording: Option<RecordingState>) -> Self {
        let zeroing = Some(Arc::new(Zeroing::new(config)));
        Self { zeroing, ..Self::new(status::labels(config), recording) }
    }

    /// Adds the link to a robot in another process.
    pub(super) fn with_link(self, link: Option<LatestLink>) -> Self {
        Self { link, ..self }
    }

    /// Returns the newest status; `None` before the first cycle.
    pub(super) fn get(&self) -> Option<Status> {
        let (record, missing_samples, lost) = self.lock().newest?;
        let status = Status::from_record(&record, missing_samples, lost).with_joints(&self.joints);
        let status = match &self.zeroing {
            Some(zeroing) => status.with_zeroing(zeroing),
            None => status,
        };
        let Scarce { recording, timing, link, .. } = self.scarce();
        Some(Status { way_out: self.way_out(&record), recording, timing, link, ..status })
    }

    /// Returns the steps that lead on from the mode of a record.
    fn way_out(&self, record: &Record) -> Vec<String> {
        let Record { mode, cause, not_off, zeros, has_switch_box, .. } = record;
        let situation = Situation {
            mode: *mode,
            cause: *cause,
            not_off,
            zeros,
            has_switch_box: *has_switch_box,
        };
        let names: Vec<_> = self.joints.iter().map(|label| label.name.as_str()).collect();
        situation.steps(&names)
    }

    /// Returns the newest record; `None` before the first cycle.
    pub(super) fn record(&self) -> Option<Record> {
        self.lock().newest.map(|(record, ..)| record)
    }

    /// Returns the slowly changing values of the telemetry.
    pub(super) fn scarce(&self) -> Scarce {
        let newest = self.lock().newest;
        let (missing_samples, lost) =
            newest.map(|(_, missing, lost)| (missing, lost)).unwrap_or_default();
        Scarce {
            missing_samples,
            lost,
            recording: self.recording.as_ref().map(RecordingState::get),
            timing: Some(self.timing()),
            link: self.link.as_ref().map(|link| LinkReport::from_status(&link.get())),
        }
    }

    /// Returns the time of the SYNC of the newest status.
    pub(super) fn at(&self) -> Option<Instant> {
        self.lock().newest.as_ref().map(|(record, ..)| record.at)
    }

    /// Returns the timing of all cycles since the boot.
    pub(super) fn timing(&self) -> TimingReport {
        self.lock().timing.report()
    }

    /// Returns the histograms of these times.
    pub(super) fn histograms(&self) -> Timing {
        self.lock().timing.clone()
    }

    /// Sets the newest record.
    pub(super) fn set(&self, record: &Record, missing_samples: u64, lost: Losses) {
        self.lock().newest = Some((*record, missing_samples, lost));
    }

    /// Adds the times of the next cycle; returns it if it was late.
    pub(super) fn add_times(&self, record: &Record) -> Option<LateCycle> {
        self.lock().timing.add(record)
    }

    fn lock(&self) -> MutexGuard<'_, Latest> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
