//! Node guarding (CiA 301, 7.2.8.2.1) of a node without a heartbeat. The master polls it by remote frames, and the node
//! answers with its NMT state and a toggle bit.
//!
//! | answer | meaning                                             |
//! |--------|-----------------------------------------------------|
//! | bit 7  | toggles from answer to answer, 0 after a boot-up     |
//! | 6–0    | the NMT state                                       |
//!
//! An answer with the wrong toggle bit is ignored. The node detects a lost master by missing polls (life guarding, 100Ch
//! and 100Dh).

use std::time::Duration;

use canopen_rs::nmt::{decode_heartbeat, heartbeat_cob_id};
use canopen_rs::{NmtState, NodeId};

use crate::frame::Frame;
use crate::heartbeat::{Health, HeartbeatEvent};
use units::time::Instant;

/// Parameters of guarding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Guarding {
    /// Guard time (100Ch), in ms, at least 1.
    pub guard_time_ms: u16,
    /// Life time factor (100Dh), at least 1: number of guard times after which either side is lost.
    pub life_time_factor: u8,
}

impl Guarding {
    /// Time between two polls.
    pub fn guard_time(self) -> Duration {
        Duration::from_millis(u64::from(self.guard_time_ms.max(1)))
    }

    /// Time without a message after which either side is lost.
    pub fn life_time(self) -> Duration {
        self.guard_time() * u32::from(self.life_time_factor.max(1))
    }
}

/// Guard of one node.
#[derive(Clone, Debug)]
pub struct Guard {
    node: NodeId,
    guarding: Guarding,
    health: Health,
    /// Expected toggle bit of the next answer; `None` accepts either.
    toggle: Option<u8>,
    /// Time of the next poll.
    poll_at: Instant,
    /// Time at which the node is lost.
    due: Instant,
    /// No polls are sent, and their answers not missed.
    is_paused: bool,
}

impl Guard {
    /// Returns a guard that polls from `now` on. The node may have been guarded before: its first answer sets
    /// the expected toggle bit.
    pub fn new(node: NodeId, guarding: Guarding, now: Instant) -> Self {
        let due = now + guarding.life_time();
        Self {
            node,
            guarding,
            health: Health::NeverSeen,
            toggle: None,
            poll_at: now,
            due,
            is_paused: false,
        }
    }

    /// NMT state of the node, if known.
    pub const fn health(&self) -> Health {
        self.health
    }

    /// Stops polling, so that the node misses its master.
    pub const fn pause(&mut self) {
        self.is_paused = true;
    }

    /// Polls again from `now` on. The first answer may have either toggle bit.
    pub fn resume(&mut self, now: Instant) {
        self.is_paused = false;
        self.toggle = None;
        self.poll_at = now;
        self.due = now + self.guarding.life_time();
    }

    /// Takes one frame.
    pub fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<HeartbeatEvent> {
        if frame.cob_id != heartbeat_cob_id(self.node) || frame.is_remote() {
            return None;
        }
        let &[answer] = frame.data() else { return None };
        let state = decode_heartbeat(&[answer & !TOGGLE]).ok()?;
        let before = self.health;
        if state == NmtState::Initialising {
            self.toggle = Some(0);
            self.on_state(now, NmtState::PreOperational);
            return Some(before.on_boot_up());
        }
        let toggle = answer & TOGGLE;
        if self.toggle.is_some_and(|expected| expected != toggle) {
            return None;
        }
        self.toggle = Some(toggle ^ TOGGLE);
        self.on_state(now, state);
        (before != self.health).then_some(HeartbeatEvent::State(state))
    }

    /// Polls the node when due, and reports its loss once.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<HeartbeatEvent> {
        if self.is_paused {
            return None;
        }
        if now >= self.poll_at {
            let on_beat = self.poll_at + self.guarding.guard_time();
            self.poll_at = if on_beat > now { on_beat } else { now + self.guarding.guard_time() };
            out.push(Frame::remote(heartbeat_cob_id(self.node), 1));
        }
        if self.health == Health::Lost || now < self.due {
            return None;
        }
        self.health = Health::Lost;
        // The first answer after a loss may have either toggle bit.
        self.toggle = None;
        Some(HeartbeatEvent::Lost)
    }

    /// Time of the next call of [`on_time`](Self::on_time). A lost node is still polled.
    pub fn deadline(&self) -> Option<Instant> {
        if self.is_paused {
            return None;
        }
        let due = (self.health != Health::Lost).then_some(self.due);
        Some(due.map_or(self.poll_at, |due| due.min(self.poll_at)))
    }

    fn on_state(&mut self, now: Instant, state: NmtState) {
        self.health = Health::Alive(state);
        self.due = now + self.guarding.life_time();
    }
}

/// Toggle bit of an answer.
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
    fn node_is_polled_once_per_guard_time() {
        let (mut guard, mut out) = (guard(), Vec::new());
        let polled: Vec<u64> = (0..50)
            .filter(|ms| {
                out.clear();
                guard.on_time(at(*ms), &mut out);
                out == [Frame::remote(0x703, 1)]
            })
            .collect();
        assert_eq!(polled, [0, 20, 40]);
    }

    #[test]
    fn missed_polls_are_skipped() {
        let (mut guard, mut out) = (guard(), Vec::new());
        guard.on_frame(at(1), &answer(5));
        guard.on_time(at(50), &mut out);
        guard.on_time(at(51), &mut out);
        assert_eq!(out.len(), 1);
        assert_eq!(guard.deadline(), Some(at(61)), "one life time after the last answer");
    }

    #[test]
    fn answer_with_the_wrong_toggle_bit_is_ignored() {
        let mut guard = guard();
        assert_eq!(guard.on_frame(at(1), &answer(0x85)), Some(HeartbeatEvent::State(OPERATIONAL)));
        for ms in [21, 41] {
            assert_eq!(guard.on_frame(at(ms), &answer(0x85)), None);
        }
        assert_eq!(guard.on_time(at(60), &mut Vec::new()), None);
        assert_eq!(guard.on_time(at(61), &mut Vec::new()), Some(HeartbeatEvent::Lost));
        assert_eq!(guard.on_time(at(62), &mut Vec::new()), None, "reported once");
    }

    #[test]
    fn toggling_node_is_alive() {
        let mut guard = guard();
        for (turn, ms) in (1..1_000).step_by(20).enumerate() {
            let toggle = if turn % 2 == 0 { 0 } else { 0x80 };
            guard.on_frame(at(ms), &answer(toggle | 5));
            assert_eq!(guard.on_time(at(ms + 19), &mut Vec::new()), None, "{ms}");
        }
        assert_eq!(guard.health(), Health::Alive(OPERATIONAL));
    }

    #[test]
    fn boot_up_is_a_reboot_and_restarts_the_toggle() {
        let mut guard = guard();
        assert_eq!(guard.on_frame(at(1), &answer(0)), Some(HeartbeatEvent::BootedUp));
        assert_eq!(guard.on_frame(at(2), &answer(5)), Some(HeartbeatEvent::State(OPERATIONAL)));
        assert_eq!(guard.on_frame(at(3), &answer(0)), Some(HeartbeatEvent::Rebooted));
        assert_eq!(guard.on_frame(at(4), &answer(0xFF)), None, "the first toggle bit is 0");
        assert_eq!(guard.on_frame(at(5), &answer(0x7F)), None, "a booted node is pre-operational");
        assert_eq!(guard.on_frame(at(6), &answer(0x85)), Some(HeartbeatEvent::State(OPERATIONAL)));
    }

    #[test]
    fn silent_node_is_lost_after_its_life_time_and_still_polled() {
        let (mut guard, mut out) = (guard(), Vec::new());
        assert_eq!(guard.on_time(at(59), &mut out), None);
        assert_eq!(guard.on_time(at(60), &mut out), Some(HeartbeatEvent::Lost));
        out.clear();
        guard.on_time(at(100), &mut out);
        assert_eq!(out.len(), 1);
        assert_eq!(
            guard.on_frame(at(101), &answer(0x85)),
            Some(HeartbeatEvent::State(OPERATIONAL))
        );
    }

    #[test]
    fn polls_of_others_and_frames_of_other_nodes_are_ignored() {
        let mut guard = guard();
        for frame in [Frame::remote(0x703, 1), Frame::new(0x704, [5]), Frame::new(0x703, [5, 5])] {
            assert_eq!(guard.on_frame(at(1), &frame), None, "{frame}");
        }
        assert_eq!(guard.health(), Health::NeverSeen);
    }

    proptest! {
        #[test]
        fn any_answers_keep_one_poll_per_guard_time(
            steps in proptest::collection::vec((0_u64..30, any::<u8>()), 0..100),
        ) {
            let (mut guard, mut out, mut now, mut lost) = (guard(), Vec::new(), 0, 0);
            for (step, byte) in steps {
                now += step;
                guard.on_frame(at(now), &answer(byte));
                lost += u64::from(guard.on_time(at(now), &mut out) == Some(HeartbeatEvent::Lost));
                prop_assert!(guard.deadline().is_some_and(|due| due > at(now)));
            }
            prop_assert!(u64::try_from(out.len()).unwrap() <= now / 20 + 1);
            prop_assert!(lost <= now / 60);
        }
    }
}
