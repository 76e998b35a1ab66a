//! What the proof found: which timer of which drive took its power off, and after how long.

use std::fmt;
use std::time::Duration;

use thiserror::Error;

use canopen::NodeId;
use canopen::object::Object;
use canopen::watchdog::Watchdog;
use config::grain;

/// One timer that ran out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trip {
    /// What the drive was told, and reads back.
    pub said: Watchdog,
    /// From the last frame of the master to the first word of the drive: what is on the way counts.
    pub measured: Duration,
}

impl Trip {
    /// How long the drive may push without its master, as far as this timer goes: what it says and its
    /// grain, or what it took, whichever is longer.
    pub fn lasting(&self) -> Duration {
        let said = Duration::from_millis(u64::from(self.said.millis));
        self.measured.max(said + grain(self.said.awaited))
    }
}

/// What one drive has shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DriveProof {
    /// What people call it: `joint 3 (elbow)`.
    pub name: String,
    /// Where it is.
    pub node: NodeId,
    /// Without RPDOs; `None` where it has no such timer.
    pub rpdo: Option<Trip>,
    /// Without the master's heartbeat; `None` where it waits for none.
    pub heartbeat: Option<Trip>,
    /// What it was to be told and does not have.
    pub missing: Vec<Object>,
}

impl DriveProof {
    /// It does not stop by itself.
    pub(super) fn refused(&self, fault: NoTrip) -> NotProven {
        NotProven { name: self.name.clone(), node: self.node, fault }
    }

    /// How long it may push without its master; `None` where nothing is known to stop it. A master that
    /// dies takes RPDOs and heartbeat with it, so the quicker timer counts.
    pub fn lasting(&self) -> Option<Duration> {
        self.rpdo.iter().chain(&self.heartbeat).map(Trip::lasting).min()
    }
}

/// What all drives have shown, in the order of their joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProofReport {
    /// Each of them.
    pub drives: Vec<DriveProof>,
}

impl ProofReport {
    /// How long the slowest drive may push without its master; `None` where one was not proven.
    pub fn lasting(&self) -> Option<Duration> {
        let mut each = self.drives.iter().map(DriveProof::lasting);
        each.try_fold(Duration::ZERO, |longest, lasting| Some(longest.max(lasting?)))
            .filter(|longest| !longest.is_zero())
    }
}

/// A drive that does not stop by itself.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{name}, node {}: {fault}", node.raw())]
pub struct NotProven {
    /// What people call it.
    pub name: String,
    /// Where it is.
    pub node: NodeId,
    /// What it did instead.
    pub fault: NoTrip,
}

/// What a drive did that did not stop by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTrip {
    /// It went on.
    KeptPower {
        /// What should have stopped it.
        said: Watchdog,
        /// For so long.
        lasted: Duration,
    },
    /// There is nothing to prove.
    NoTimer,
}

/// As in "joint 3 (elbow), node 3: kept its power stage on for 40 ms without RPDOs (1400h:5 says 5 ms)".
impl fmt::Display for NoTrip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::KeptPower { said: Watchdog { awaited, object, millis }, lasted } => write!(
                f,
                "kept its power stage on for {} ms without {awaited} ({object} says {millis} ms)",
                lasted.as_millis()
            ),
            Self::NoTimer => f.write_str(
                "has no timer that stops it without its master: neither one of its RPDOs nor of a heartbeat",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::watchdog::Awaited;

    fn trip(awaited: Awaited, millis: u16, measured: u64) -> Option<Trip> {
        let object = match awaited {
            Awaited::Rpdo => Object::rpdo_communication(1, 5),
            Awaited::Heartbeat => Object::CONSUMER_HEARTBEAT,
        };
        let said = Watchdog { awaited, object, millis };
        Some(Trip { said, measured: Duration::from_micros(measured) })
    }

    fn drive(rpdo: Option<Trip>, heartbeat: Option<Trip>) -> DriveProof {
        let node = NodeId::new(3).unwrap();
        DriveProof { name: "joint 3 (elbow)".into(), node, rpdo, heartbeat, missing: Vec::new() }
    }

    #[test]
    fn the_quicker_timer_of_the_slowest_drive_counts_and_what_it_took_if_that_was_longer() {
        let (rpdo, heartbeat) =
            (trip(Awaited::Rpdo, 5, 5_400), trip(Awaited::Heartbeat, 22, 22_900));
        let both = drive(rpdo, heartbeat);
        assert_eq!(both.lasting(), Some(Duration::from_millis(6)));
        assert_eq!(
            drive(trip(Awaited::Rpdo, 5, 7_300), None).lasting().unwrap().as_micros(),
            7_300
        );
        let report =
            ProofReport { drives: vec![both.clone(), drive(None, heartbeat), both.clone()] };
        assert_eq!(report.lasting(), Some(Duration::from_millis(25)));
        let report = ProofReport { drives: vec![both, drive(None, None)] };
        assert_eq!(report.lasting(), None, "one that nothing stops");
        assert_eq!(ProofReport::default().lasting(), None);
    }

    #[test]
    fn who_went_on_is_named_with_what_should_have_stopped_it() {
        let said = trip(Awaited::Rpdo, 5, 0).unwrap().said;
        let fault = NoTrip::KeptPower { said, lasted: Duration::from_millis(40) };
        let DriveProof { name, node, .. } = drive(None, None);
        assert_eq!(
            NotProven { name, node, fault }.to_string(),
            "joint 3 (elbow), node 3: kept its power stage on for 40 ms without RPDOs (1400h:5 says 5 ms)"
        );
    }
}
