//! What is to be heard of all nodes of a bus: who comes, who changes its state, who falls silent, who is
//! in trouble. Says nothing itself.

use std::collections::VecDeque;
use std::time::Duration;

use canopen_rs::NodeId;
use canopen_rs::nmt::heartbeat_cob_id;

use canopen::emcy;
use canopen::emcy::Emergency;
use canopen::frame::Frame;
use canopen::heartbeat;
use canopen::heartbeat::Consumer;
use canopen::procedure::Procedure;
use units::time::Instant;

/// What was heard of one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkEvent {
    /// A change of its heartbeat.
    Heartbeat(NodeId, heartbeat::HeartbeatEvent),
    /// An emergency, by the predefined connection set.
    Emergency(NodeId, Emergency),
}

/// The watch over a bus.
#[derive(Clone, Debug)]
pub struct Watch {
    silence: Duration,
    until: Option<Instant>,
    nodes: Vec<(NodeId, Consumer)>,
    /// Said by nodes that fell silent at the same time.
    news: VecDeque<(Instant, NetworkEvent)>,
}

impl Watch {
    /// A node is lost after `silence`. Listens until `until`, or for ever.
    pub const fn new(silence: Duration, until: Option<Instant>) -> Self {
        Self { silence, until, nodes: Vec::new(), news: VecDeque::new() }
    }

    fn hear(&mut self, now: Instant, frame: &Frame) -> Option<NetworkEvent> {
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
            // What is no heartbeat is no node.
            self.nodes.extend(news.map(|_| (node, consumer)));
            news
        };
        news.map(|news| NetworkEvent::Heartbeat(node, news))
    }
}

impl Procedure for Watch {
    /// One piece of news after another, and when it was heard; `None` when it is time to end.
    type Outcome = Option<(Instant, NetworkEvent)>;

    fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        _: &mut Vec<Frame>,
    ) -> Option<Self::Outcome> {
        let news = self.hear(now, frame);
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
    fn changes_are_told_and_nothing_else() {
        let mut watch = Watch::new(Duration::from_millis(100), None);
        let mut hear = |millis, cob_id, byte: u8| {
            let news = watch.on_frame(at(millis), &Frame::new(cob_id, [byte]), &mut Vec::new());
            news.map(|news| news.unwrap().1)
        };
        let pre_operational = heartbeat::HeartbeatEvent::State(NmtState::PreOperational);
        let beat = |news| Some(NetworkEvent::Heartbeat(node(3), news));
        assert_eq!(hear(0, 0x703, 0x7F), beat(pre_operational));
        assert_eq!(hear(50, 0x703, 0x7F), None);
        assert_eq!(hear(60, 0x703, 0), beat(heartbeat::HeartbeatEvent::Rebooted));
        assert_eq!(hear(60, 0x704, 0x42), None, "no heartbeat");
        assert_eq!(hear(60, 0x083, 0), None, "no emergency");
        assert_eq!(watch.deadline(), Some(at(160)));
    }

    #[test]
    fn all_who_fall_silent_at_once_are_told_of() {
        let mut watch = Watch::new(Duration::from_millis(100), None);
        for cob_id in [0x703, 0x704] {
            watch.on_frame(at(0), &Frame::new(cob_id, [5]), &mut Vec::new());
        }
        let lost = |raw| {
            Some(Some((
                at(100),
                NetworkEvent::Heartbeat(node(raw), heartbeat::HeartbeatEvent::Lost),
            )))
        };
        assert_eq!(watch.on_time(at(100), &mut Vec::new()), lost(3));
        assert_eq!(watch.deadline(), Some(at(100)));
        assert_eq!(watch.on_time(at(100), &mut Vec::new()), lost(4));
        assert_eq!(watch.deadline(), None);
    }

    #[test]
    fn it_listens_until_it_is_time() {
        let mut watch = Watch::new(Duration::from_millis(100), Some(at(50)));
        assert_eq!(watch.deadline(), Some(at(50)));
        assert_eq!(watch.on_time(at(49), &mut Vec::new()), None);
        assert_eq!(watch.on_time(at(50), &mut Vec::new()), Some(None));
    }

    #[test]
    fn an_emergency_is_told_with_its_node() {
        let mut watch = Watch::new(Duration::from_millis(100), None);
        let frame = Frame::new(0x083, [0x10, 0x23, 3, 0, 0, 0, 0, 0]);
        let (_, news) = watch.on_frame(at(0), &frame, &mut Vec::new()).unwrap().unwrap();
        assert!(
            matches!(news, NetworkEvent::Emergency(of, what) if of == node(3) && what.code == 0x2310)
        );
    }
}
