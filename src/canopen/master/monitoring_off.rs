//! End of a node's monitoring of its master before an orderly end of the master. Sets heartbeat consumer (1016h:1) or
//! life guarding (100Dh, 100Ch) to zero by SDO.
//!
//! Otherwise the node reports the end of the master as a fault (8130h). Nothing is stored (1010h): a reset restores the
//! stored values, and every boot verifies or writes the planned ones.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::{NodeId, Value};

use crate::frame::Frame;
use crate::object::Object;
use crate::plan::{ErrorControl, NodePlan};
use crate::sdo::{SdoError, Transfer, bytes};
use units::time::Instant;

/// Time allowed for one reply; short, because the process ends.
const REPLY_TIMEOUT: Duration = Duration::from_millis(70);

/// Outcome: monitoring is off, or the object that could not be written.
pub(super) type EndResult = Result<(), (Object, SdoError)>;

/// Writes that end the monitoring of the master, one after the other. An unanswered one is repeated once.
#[derive(Clone, Debug)]
pub(super) struct MonitoringOff {
    node: NodeId,
    object: Object,
    zero: Vec<u8>,
    transfer: Transfer,
    has_repeated: bool,
    later: VecDeque<(Object, Value)>,
}

impl MonitoringOff {
    /// Requests the first write; `None` for a node that monitors no master. Objects in `missing` are skipped.
    pub(super) fn start(
        plan: &NodePlan,
        missing: &[Object],
        now: Instant,
        out: &mut Vec<Frame>,
    ) -> Option<Self> {
        let mut later = writes(plan);
        later.retain(|(object, _)| !missing.contains(object));
        let (object, zero) = later.pop_front()?;
        let (node, zero) = (plan.node, bytes(&zero));
        let transfer = request(node, object, &zero, now, out).ok()?;
        Some(Self { node, object, zero, transfer, has_repeated: false, later })
    }

    /// Takes one received frame. Returns the outcome once.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<EndResult> {
        let written = self.transfer.on_frame(now, frame, out)?.map(|_| ());
        self.proceed(now, written, out)
    }

    /// Repeats an overdue request once, then ends.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<EndResult> {
        let written = self.transfer.on_time(now, out)?.map(|_| ());
        self.proceed(now, written, out)
    }

    /// Time of the next call of [`on_time`](Self::on_time); `None` after the outcome.
    pub(super) const fn deadline(&self) -> Option<Instant> {
        self.transfer.deadline()
    }

    fn proceed(
        &mut self,
        now: Instant,
        written: Result<(), SdoError>,
        out: &mut Vec<Frame>,
    ) -> Option<EndResult> {
        match written {
            Ok(()) => {
                let Some((object, zero)) = self.later.pop_front() else { return Some(Ok(())) };
                (self.object, self.zero, self.has_repeated) = (object, bytes(&zero), false);
            }
            Err(SdoError::Timeout) if !self.has_repeated => self.has_repeated = true,
            Err(error) => return Some(Err((self.object, error))),
        }
        match request(self.node, self.object, &self.zero, now, out) {
            Ok(transfer) => {
                self.transfer = transfer;
                None
            }
            Err(error) => Some(Err((self.object, error))),
        }
    }
}

fn request(
    node: NodeId,
    object: Object,
    zero: &[u8],
    now: Instant,
    out: &mut Vec<Frame>,
) -> Result<Transfer, SdoError> {
    Transfer::write(node, object, zero.to_vec(), REPLY_TIMEOUT, now, out)
}

/// Returns the writes that end the planned monitoring of the master. The life time factor comes first: at zero it
/// already ends life guarding.
fn writes(plan: &NodePlan) -> VecDeque<(Object, Value)> {
    let consumer = plan.safety.iter().any(|(object, _)| *object == Object::CONSUMER_HEARTBEAT);
    let heartbeat = consumer.then_some((Object::CONSUMER_HEARTBEAT, Value::Unsigned32(0)));
    let guarding = match plan.error_control {
        ErrorControl::Heartbeat { .. } => None,
        ErrorControl::Guarding(_) => Some([
            (Object::LIFE_TIME_FACTOR, Value::Unsigned8(0)),
            (Object::GUARD_TIME, Value::Unsigned16(0)),
        ]),
    };
    heartbeat.into_iter().chain(guarding.into_iter().flatten()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::abort::AbortCode;
    use crate::testing::plans::{elbow, guarded_elbow, switch_box};

    const NOW: Instant = Instant::ZERO;

    fn confirmation(object: Object) -> Frame {
        let [low, high] = object.index.to_le_bytes();
        Frame::new(0x583, [0x60, low, high, object.sub, 0, 0, 0, 0])
    }

    #[test]
    fn heartbeat_consumer_is_set_to_zero() {
        let mut out = Vec::new();
        let mut ending = MonitoringOff::start(&elbow(), &[], NOW, &mut out).unwrap();
        assert_eq!(out, [Frame::new(0x603, [0x23, 0x16, 0x10, 1, 0, 0, 0, 0])]);
        let confirmed = confirmation(Object::CONSUMER_HEARTBEAT);
        assert_eq!(ending.on_frame(NOW, &confirmed, &mut out), Some(Ok(())));
        assert_eq!((out.len(), ending.deadline()), (1, None));
    }

    #[test]
    fn guarded_node_gets_both_factors_of_its_life_time() {
        let mut out = Vec::new();
        let mut ending = MonitoringOff::start(&guarded_elbow(), &[], NOW, &mut out).unwrap();
        let factor = confirmation(Object::LIFE_TIME_FACTOR);
        assert_eq!(ending.on_frame(NOW, &factor, &mut out), None);
        let time = confirmation(Object::GUARD_TIME);
        assert_eq!(ending.on_frame(NOW, &time, &mut out), Some(Ok(())));
        let expected = [[0x2F, 0x0D, 0x10, 0], [0x2B, 0x0C, 0x10, 0]];
        assert_eq!(
            out.iter().map(|frame| frame.data()[..4].to_vec()).collect::<Vec<_>>(),
            expected
        );
    }

    #[test]
    fn node_without_monitoring_gets_nothing() {
        let mut out = Vec::new();
        assert!(MonitoringOff::start(&switch_box(), &[], NOW, &mut out).is_none());
        let missing = [Object::CONSUMER_HEARTBEAT];
        assert!(MonitoringOff::start(&elbow(), &missing, NOW, &mut out).is_none());
        assert!(out.is_empty());
    }

    #[test]
    fn unanswered_write_is_repeated_once() {
        let mut out = Vec::new();
        let mut ending = MonitoringOff::start(&elbow(), &[], NOW, &mut out).unwrap();
        let first = ending.deadline().unwrap();
        assert_eq!(ending.on_time(first, &mut out), None);
        let second = ending.deadline().unwrap();
        let ended = ending.on_time(second, &mut out);
        assert_eq!(ended, Some(Err((Object::CONSUMER_HEARTBEAT, SdoError::Timeout))));
        let writes = out.iter().filter(|frame| frame.data()[0] == 0x23);
        assert_eq!((writes.count(), second.since(NOW)), (2, 2 * REPLY_TIMEOUT));
    }

    #[test]
    fn refused_write_is_reported_at_once() {
        let mut out = Vec::new();
        let mut ending = MonitoringOff::start(&elbow(), &[], NOW, &mut out).unwrap();
        let abort = Frame::new(0x583, [0x80, 0x16, 0x10, 1, 0x22, 0, 0, 8]);
        let error = SdoError::AbortedByServer(AbortCode(0x0800_0022));
        let ended = ending.on_frame(NOW, &abort, &mut out);
        assert_eq!(ended, Some(Err((Object::CONSUMER_HEARTBEAT, error))));
    }
}
