//! Node guarding (CiA 301, 7.2.8.2.1): the watch over a node that has no heartbeat. The master asks by a
//! remote frame, the node answers with its state and a bit that alternates.
//!
//! | answer | meaning                                             |
//! |--------|-----------------------------------------------------|
//! | bit 7  | toggles from answer to answer, 0 after a boot-up     |
//! | 6–0    | the NMT state                                       |
//!
//! An answer with the wrong toggle bit counts as none. What a node does that is no longer asked is its
//! own business (life guarding); here it is told how long it may wait, by 100Ch and 100Dh.

use std::time::Duration;

use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::nmt::heartbeat_cob_id;

use crate::frame::Frame;
use crate::heartbeat::Health;
use crate::heartbeat::News;
use units::time::Instant;

/// How a node is guarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Guarding {
    /// How often it is asked (100Ch), in ms, at least 1.
    pub guard_time_ms: u16,
    /// It, and its guard, are lost after so many guard times without a word (100Dh), at least 1.
    pub life_time_factor: u8,
}

impl Guarding {
    /// From one question to the next.
    pub fn guard_time(self) -> Duration {
        Duration::from_millis(u64::from(self.guard_time_ms.max(1)))
    }

    /// How long either may hear nothing of the other.
    pub fn life_time(self) -> Duration {
        self.guard_time() * u32::from(self.life_time_factor.max(1))
    }
}

/// The guard of one node.
#[derive(Clone, Debug)]
pub struct Guard {
    node: NodeId,
    guarding: Guarding,
    health: Health,
    /// The toggle bit that the next answer must have; `None` takes the first one as it comes.
    toggle: Option<u8>,
    /// When it is asked next.
    ask: Instant,
    /// When it will have been silent for too long.
    due: Instant,
}

impl Guard {
    /// A guard that asks from `now` on. The node may have been guarded before: its first answer says
    /// where its toggle bit is.
    pub fn new(node: NodeId, guarding: Guarding, now: Instant) -> Self {
        let due = now + guarding.life_time();
        Self { node, guarding, health: Health::NeverSeen, toggle: None, ask: now, due }
    }

    /// What is known of the node.
    pub const fn health(&self) -> Health {
        self.health
    }

    /// Listens to one frame.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<News> {
        if frame.cob_id != heartbeat_cob_id(self.node) || frame.is_remote() {
            return None;
        }
        let &[answer] = frame.data() else { return None };
        let state = decode_heartbeat(&[answer & !TOGGLE]).ok()?;
        let before = self.health;
        if state == NmtState::Initialising {
            self.toggle = Some(0);
            self.heard(now, NmtState::PreOperational);
            let news = if before == Health::NeverSeen { News::BootedUp } else { News::Rebooted };
            return Some(news);
        }
        let toggle = answer & TOGGLE;
        if self.toggle.is_some_and(|expected| expected != toggle) {
            return None;
        }
        self.toggle = Some(toggle ^ TOGGLE);
        self.heard(now, state);
        (before != self.health).then_some(News::State(state))
    }

    /// Asks when it is time to, and says once when the node has been silent for too long.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<News> {
        if now >= self.ask {
            let on_beat = self.ask + self.guarding.guard_time();
            self.ask = if on_beat > now { on_beat } else { now + self.guarding.guard_time() };
            out.push(Frame::remote(heartbeat_cob_id(self.node), 1));
        }
        if self.health == Health::Lost || now < self.due {
            return None;
        }
        self.health = Health::Lost;
        // Whatever it says next is as good as a first word.
        self.toggle = None;
        Some(News::Lost)
    }

    /// When [`on_time`](Self::on_time) must next be called: a node that is lost is asked on.
    pub fn deadline(&self) -> Option<Instant> {
        let due = (self.health != Health::Lost).then_some(self.due);
        Some(due.map_or(self.ask, |due| due.min(self.ask)))
    }

    fn heard(&mut self, now: Instant, state: NmtState) {
        self.health = Health::Alive(state);
        self.due = now + self.guarding.life_time();
    }
}

/// The bit that alternates.
const TOGGLE: u8 = 0x80;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const GUARDING: Guarding = Guarding { guard_time_ms: 20, life_time_factor: 3 };
    const OPERATIONAL: NmtState = NmtState::Operational;

    fn at(ms: u64) -> Instant {
        Instant::from_micros(ms * 1_000)
    }

    fn guard() -> Guard {
        Guard::new(NodeId::new(3).unwrap(), GUARDING, at(0))
    }

    fn answer(byte: u8) -> Frame {
        Frame::new(0x703, [byte])
    }

    #[test]
    fn it_asks_once_a_guard_time_by_a_remote_frame() {
        let (mut guard, mut out) = (guard(), Vec::new());
        let asked: Vec<u64> = (0..50)
            .filter(|ms| {
                out.clear();
                guard.on_time(at(*ms), &mut out);
                out == [Frame::remote(0x703, 1)]
            })
            .collect();
        assert_eq!(asked, [0, 20, 40]);
    }

    #[test]
    fn missed_questions_are_not_made_up_for() {
        let (mut guard, mut out) = (guard(), Vec::new());
        guard.on_frame(at(1), &answer(5));
        guard.on_time(at(50), &mut out);
        guard.on_time(at(51), &mut out);
        assert_eq!(out.len(), 1);
        assert_eq!(guard.deadline(), Some(at(61)), "one life time after the last answer");
    }

    #[test]
    fn an_answer_that_does_not_toggle_is_none() {
        let mut guard = guard();
        assert_eq!(guard.on_frame(at(1), &answer(0x85)), Some(News::State(OPERATIONAL)));
        for ms in [21, 41] {
            assert_eq!(guard.on_frame(at(ms), &answer(0x85)), None);
        }
        assert_eq!(guard.on_time(at(60), &mut Vec::new()), None);
        assert_eq!(guard.on_time(at(61), &mut Vec::new()), Some(News::Lost));
        assert_eq!(guard.on_time(at(62), &mut Vec::new()), None, "said once");
    }

    #[test]
    fn a_node_that_toggles_is_alive() {
        let mut guard = guard();
        for (turn, ms) in (1..1_000).step_by(20).enumerate() {
            let toggle = if turn % 2 == 0 { 0 } else { 0x80 };
            guard.on_frame(at(ms), &answer(toggle | 5));
            assert_eq!(guard.on_time(at(ms + 19), &mut Vec::new()), None, "{ms}");
        }
        assert_eq!(guard.health(), Health::Alive(OPERATIONAL));
    }

    #[test]
    fn a_boot_up_of_a_guarded_node_is_a_reboot_and_its_toggle_begins_anew() {
        let mut guard = guard();
        assert_eq!(guard.on_frame(at(1), &answer(0)), Some(News::BootedUp));
        assert_eq!(guard.on_frame(at(2), &answer(5)), Some(News::State(OPERATIONAL)));
        assert_eq!(guard.on_frame(at(3), &answer(0)), Some(News::Rebooted));
        assert_eq!(guard.on_frame(at(4), &answer(0xFF)), None, "the first toggle bit is 0");
        assert_eq!(guard.on_frame(at(5), &answer(0x7F)), None, "a booted node is pre-operational");
        assert_eq!(guard.on_frame(at(6), &answer(0x85)), Some(News::State(OPERATIONAL)));
    }

    #[test]
    fn a_node_that_never_answers_is_lost_after_one_life_time_and_asked_on() {
        let (mut guard, mut out) = (guard(), Vec::new());
        assert_eq!(guard.on_time(at(59), &mut out), None);
        assert_eq!(guard.on_time(at(60), &mut out), Some(News::Lost));
        out.clear();
        guard.on_time(at(100), &mut out);
        assert_eq!(out.len(), 1);
        assert_eq!(guard.on_frame(at(101), &answer(0x85)), Some(News::State(OPERATIONAL)));
    }

    #[test]
    fn questions_of_others_and_frames_of_other_nodes_are_no_answer() {
        let mut guard = guard();
        for frame in [Frame::remote(0x703, 1), Frame::new(0x704, [5]), Frame::new(0x703, [5, 5])] {
            assert_eq!(guard.on_frame(at(1), &frame), None, "{frame}");
        }
        assert_eq!(guard.health(), Health::NeverSeen);
    }

    proptest! {
        #[test]
        fn whatever_is_heard_it_asks_at_most_once_a_guard_time(
            steps in proptest::collection::vec((0_u64..30, any::<u8>()), 0..100),
        ) {
            let (mut guard, mut out, mut now, mut lost) = (guard(), Vec::new(), 0, 0);
            for (step, byte) in steps {
                now += step;
                guard.on_frame(at(now), &answer(byte));
                lost += u64::from(guard.on_time(at(now), &mut out) == Some(News::Lost));
                prop_assert!(guard.deadline().is_some_and(|due| due > at(now)));
            }
            prop_assert!(u64::try_from(out.len()).unwrap() <= now / 20 + 1);
            prop_assert!(lost <= now / 60);
        }
    }
}
