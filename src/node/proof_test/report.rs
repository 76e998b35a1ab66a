//! Results of the proof test: for each watchdog of each drive, the time until the power stage was off.

use std::fmt;
use std::time::Duration;

use derive_more::Display;
use thiserror::Error;

use canopen::NodeId;
use canopen::nameplate::StoredValue;
use canopen::object::Object;
use canopen::watchdog::Watchdog;

/// Expiry of a drive's watchdog in the test, after which the drive's power stage was off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchdogExpiry {
    /// Watchdog as written to the drive and read back.
    pub watchdog: Watchdog,
    /// Time from the last frame of the master to the first report of the drive, transmission included.
    pub measured: Duration,
    /// Maximum of this time by the plan, as `frhc check` computes it.
    pub planned: Duration,
}

impl WatchdogExpiry {
    /// Returns the maximum time for which the drive applies torque without its master, as limited by this watchdog. It is
    /// the longer one of planned and measured time.
    pub fn reaction_time(&self) -> Duration {
        self.measured.max(self.planned)
    }
}

/// Results of one drive: expiry of its watchdogs, and what its boot has read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveResult {
    /// Displayed name: `joint 3 (elbow)`.
    pub name: String,
    /// Its node-id.
    pub node: NodeId,
    /// Result without RPDOs; `None` if it has no RPDO timer.
    pub rpdo: Option<WatchdogExpiry>,
    /// Result without the master's heartbeat; `None` if it has no heartbeat consumer.
    pub heartbeat: Option<WatchdogExpiry>,
    /// Result without node guarding; `None` if it is not guarded.
    pub guarding: Option<WatchdogExpiry>,
    /// Planned objects that it does not have.
    pub missing: Vec<Object>,
    /// Sign, scale, units and ratings as its boot has read them.
    pub held: Vec<StoredValue>,
}

impl DriveResult {
    /// Returns the failure of this drive.
    pub(super) fn failure(&self, reason: NoExpiry) -> ProofTestFailure {
        ProofTestFailure { name: self.name.clone(), node: self.node, reason }
    }

    /// Returns the maximum time for which it applies torque without its master; `None` if no watchdog expired. RPDOs and
    /// heartbeat end together with the master, so the faster watchdog counts.
    pub fn reaction_time(&self) -> Option<Duration> {
        self.expiries().map(WatchdogExpiry::reaction_time).min()
    }

    /// Returns the expiries of its watchdogs.
    pub fn expiries(&self) -> impl Iterator<Item = &WatchdogExpiry> {
        [&self.rpdo, &self.heartbeat, &self.guarding].into_iter().flatten()
    }
}

/// Results of all drives, in the order of their joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProofTestReport {
    /// Results of each drive.
    pub drives: Vec<DriveResult>,
}

impl ProofTestReport {
    /// Returns the maximum time for which any drive applies torque without its master; `None` if one was not tested.
    pub fn reaction_time(&self) -> Option<Duration> {
        let mut each = self.drives.iter().map(DriveResult::reaction_time);
        each.try_fold(Duration::ZERO, |longest, reaction_time| Some(longest.max(reaction_time?)))
            .filter(|longest| !longest.is_zero())
    }
}

/// Drive that failed the proof test, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {reason}", node.raw())]
pub struct ProofTestFailure {
    /// Displayed name.
    pub name: String,
    /// Its node-id.
    pub node: NodeId,
    /// Reason of the failure.
    pub reason: NoExpiry,
}

/// Reason why a drive failed the proof test: the text behind the drive's name.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
pub enum NoExpiry {
    /// The watchdog did not expire, or its power stage stayed on: `kept its power stage on for 40 ms without RPDOs (1400h:5 is 5 ms)`.
    #[display(
        "kept its power stage on for {} ms without {} ({} is {} ms)",
        duration.as_millis(),
        watchdog.awaited,
        watchdog.object,
        watchdog.millis
    )]
    KeptPower {
        /// The tested watchdog.
        watchdog: Watchdog,
        /// Time since the last frame of the master.
        duration: Duration,
    },
    /// No answer showed in time whether its power stage was off: `did not answer 6041h in time without RPDOs (1400h:5 is 5 ms),
    /// in two tests`.
    #[display(
        "did not answer 6041h in time without {} ({} is {} ms), in two tests: {}; look for lost or late SDO frames, then start again",
        watchdog.awaited,
        watchdog.object,
        watchdog.millis,
        Report(*reported)
    )]
    Unanswered {
        /// The tested watchdog.
        watchdog: Watchdog,
        /// Time from the last frame of the master to the drive's emergency message; `None` without one.
        reported: Option<Duration>,
    },
    /// It has no watchdog.
    #[display(
        "has no RPDO timer (1400h:5), no heartbeat consumer (1016h) and is not guarded (100Ch, 100Dh): \
         nothing stops it without its master"
    )]
    NoTimer,
}

impl NoExpiry {
    /// Returns whether the test has shown nothing, and another one may.
    pub(super) const fn is_unanswered(self) -> bool {
        matches!(self, Self::Unanswered { .. })
    }
}

/// Words for what a drive without an answer has reported.
#[derive(Clone, Copy, Debug)]
struct Report(Option<Duration>);

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(after) => {
                let millis = after.as_millis();
                write!(
                    f,
                    "its emergency after {millis} ms does not show that its power stage is off"
                )
            }
            None => f.write_str("nothing shows that its power stage is off"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::watchdog::LifeSign;
    use config::timer_tolerance;

    fn expiry(awaited: LifeSign, millis: u16, measured: u64) -> Option<WatchdogExpiry> {
        let object = match awaited {
            LifeSign::Rpdo => Object::rpdo_communication(1, 5),
            LifeSign::Heartbeat => Object::CONSUMER_HEARTBEAT,
            LifeSign::Guarding => Object::LIFE_TIME_FACTOR,
        };
        let watchdog = Watchdog { awaited, object, millis };
        let planned = Duration::from_millis(millis.into()) + timer_tolerance(awaited);
        Some(WatchdogExpiry { watchdog, measured: Duration::from_micros(measured), planned })
    }

    fn drive(rpdo: Option<WatchdogExpiry>, heartbeat: Option<WatchdogExpiry>) -> DriveResult {
        let node = NodeId::new(3).unwrap();
        let name = "joint 3 (elbow)".into();
        let (missing, held) = (Vec::new(), Vec::new());
        DriveResult { name, node, rpdo, heartbeat, guarding: None, missing, held }
    }

    #[test]
    fn reaction_time_is_the_faster_watchdog_of_the_slowest_drive() {
        let (rpdo, heartbeat) =
            (expiry(LifeSign::Rpdo, 5, 5_400), expiry(LifeSign::Heartbeat, 22, 22_900));
        let both = drive(rpdo, heartbeat);
        assert_eq!(both.reaction_time(), Some(Duration::from_millis(6)));
        assert_eq!(
            drive(expiry(LifeSign::Rpdo, 5, 7_300), None).reaction_time().unwrap().as_micros(),
            7_300
        );
        let report =
            ProofTestReport { drives: vec![both.clone(), drive(None, heartbeat), both.clone()] };
        assert_eq!(report.reaction_time(), Some(Duration::from_millis(25)));
        let report = ProofTestReport { drives: vec![both, drive(None, None)] };
        assert_eq!(report.reaction_time(), None, "one that nothing stops");
        assert_eq!(ProofTestReport::default().reaction_time(), None);
    }

    #[test]
    fn failure_names_drive_duration_and_watchdog() {
        let watchdog = expiry(LifeSign::Rpdo, 5, 0).unwrap().watchdog;
        let reason = NoExpiry::KeptPower { watchdog, duration: Duration::from_millis(40) };
        let DriveResult { name, node, .. } = drive(None, None);
        assert_eq!(
            ProofTestFailure { name, node, reason }.to_string(),
            "joint 3 (elbow), node 3: kept its power stage on for 40 ms without RPDOs (1400h:5 is 5 ms)"
        );
    }

    #[test]
    fn unanswered_failure_names_object_and_emergency() {
        let watchdog = expiry(LifeSign::Rpdo, 8, 0).unwrap().watchdog;
        let text = |reported| NoExpiry::Unanswered { watchdog, reported }.to_string();
        let [silent, reported] = [None, Some(Duration::from_micros(8_300))].map(text);
        let opening =
            "did not answer 6041h in time without RPDOs (1400h:5 is 8 ms), in two tests: ";
        assert!(silent.starts_with(&format!("{opening}nothing shows that")), "{silent}");
        assert!(reported.starts_with(&format!("{opening}its emergency after 8 ms")), "{reported}");
    }
}
