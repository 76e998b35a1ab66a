//! Monitor of all nodes of a bus: boot-up, change of state, loss, emergencies. Sends nothing.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::procedure::Procedure;
use canopen::emcy::{self, Emergency};
use canopen::frame::Frame;
use canopen::heartbeat::{self, Consumer};
use units::time::Instant;

/// Event of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkEvent {
    /// Change of its health.
    Heartbeat(NodeId, heartbeat::HeartbeatEvent),
    /// Emergency at its COB-ID of the predefined connection set.
    Emergency(NodeId, Emergency),
}

/// Monitor of a bus.
#[derive(Clone, Debug)]
pub struct NetworkMonitor {
    silence: Duration,
    until: Option<Instant>,
    nodes: Vec<(NodeId, Consumer)>,
    /// Events of nodes lost at the same time.
    news: VecDeque<(Instant, NetworkEvent)>,
}

impl NetworkMonitor {
    /// Returns a monitor with consumer heartbeat time `silence`, until `until` or without end.
    pub const fn new(silence: Duration, until: Option<Instant>) -> Self {
        Self { silence, until, nodes: Vec::new(), news: VecDeque::new() }
    }

    fn receive(&mut self, now: Instant, frame: &Frame) -> Option<NetworkEvent> {
        let [_, low] = frame.cob_id.to_be_bytes();
        let node = NodeId::new(low & 0x7F).ok()?;
        if frame.cob_id == emcy::default_cob_id(node) {
            return Some(NetworkEvent::Emergency(node, Emergency::decode(frame.data())?));
        }
        if frame.cob_id != heartbeat_cob_id(node) {
            return None;
        }
        let known = self.nodes.iter_mut().find(|(known, _)| *known == node);
        let news = if let Some((_, consumer)) = known {
            consumer.on_frame(now, frame)
        } else {
            let mut consumer = Consumer::new(node, self.silence, now + self.silence);
            let news = consumer.on_frame(now, frame);
            // An invalid heartbeat creates no node.
            self.nodes.extend(news.map(|_| (node, consumer)));
            news
        };
        news.map(|news| NetworkEvent::Heartbeat(node, news))
    }
}

impl Procedure for NetworkMonitor {
    /// Next event with its time of reception; `None` at the end.
    type Outcome = Option<(Instant, NetworkEvent)>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        _: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        let news = self.receive(now, frame);
        self.news.extend(news.map(|news| (now, news)));
        self.news.pop_front().map(Some)
    }

    fn on_time(&mut self, now: Instant, _: &mut Vec<Frame>) -> Option<Self::Outcome> {
        for (node, consumer) in &mut self.nodes {
            let lost = consumer.on_time(now).map(|news| NetworkEvent::Heartbeat(*node, news));
            self.news.extend(lost.map(|news| (now, news)));
        }
        let is_over = self.until.is_some_and(|until| until <= now);
        self.news.pop_front().map(Some).or(is_over.then_some(None))
    }

    fn deadline(&self) -> Option<Instant> {
        let waiting = self.news.front().map(|(at, _)| *at);
        let silences = self.nodes.iter().filter_map(|(_, consumer)| consumer.deadline());
        silences.chain(waiting).chain(self.until).min()
    }
}

#[cfg(test)]
mod tests {
    use canopen_rs::NmtState;

    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn node(raw: u8) -> NodeId {
        NodeId::new(raw).unwrap()
    }

    #[test]
    fn only_changes_are_reported() {
        let mut monitor = NetworkMonitor::new(Duration::from_millis(100), None);
        let mut receive = |millis, cob_id, byte: u8| {
            let news = monitor.on_frame(at(millis), &Frame::new(cob_id, [byte]), &mut Vec::new());
            news.map(|news| news.unwrap().1)
        };
        let pre_operational = heartbeat::HeartbeatEvent::State(NmtState::PreOperational);
        let beat = |news| Some(NetworkEvent::Heartbeat(node(3), news));
        assert_eq!(receive(0, 0x703, 0x7F), beat(pre_operational));
        assert_eq!(receive(50, 0x703, 0x7F), None);
        assert_eq!(receive(60, 0x703, 0), beat(heartbeat::HeartbeatEvent::Rebooted));
        assert_eq!(receive(60, 0x704, 0x42), None, "no heartbeat");
        assert_eq!(receive(60, 0x083, 0), None, "no emergency");
        assert_eq!(monitor.deadline(), Some(at(160)));
    }

    #[test]
    fn all_nodes_lost_at_once_are_reported() {
        let mut monitor = NetworkMonitor::new(Duration::from_millis(100), None);
        for cob_id in [0x703, 0x704] {
            monitor.on_frame(at(0), &Frame::new(cob_id, [5]), &mut Vec::new());
        }
        let lost = |raw| {
            Some(Some((
                at(100),
                NetworkEvent::Heartbeat(node(raw), heartbeat::HeartbeatEvent::Lost),
            )))
        };
        assert_eq!(monitor.on_time(at(100), &mut Vec::new()), lost(3));
        assert_eq!(monitor.deadline(), Some(at(100)));
        assert_eq!(monitor.on_time(at(100), &mut Vec::new()), lost(4));
        assert_eq!(monitor.deadline(), None);
    }

    #[test]
    fn monitor_ends_at_its_time() {
        let mut monitor = NetworkMonitor::new(Duration::from_millis(100), Some(at(50)));
        assert_eq!(monitor.deadline(), Some(at(50)));
        assert_eq!(monitor.on_time(at(49), &mut Vec::new()), None);
        assert_eq!(monitor.on_time(at(50), &mut Vec::new()), Some(None));
    }

    #[test]
    fn emergency_is_reported_with_its_node() {
        let mut monitor = NetworkMonitor::new(Duration::from_millis(100), None);
        let frame = Frame::new(0x083, [0x10, 0x23, 3, 0, 0, 0, 0, 0]);
        let (_, news) = monitor.on_frame(at(0), &frame, &mut Vec::new()).unwrap().unwrap();
        assert!(
            matches!(news, NetworkEvent::Emergency(of, what) if of == node(3) && what.code == 0x2310)
        );
    }
}
