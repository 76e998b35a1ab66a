//! How old what the node says is: between the moment a frame is taken and the one it is on the wire, or acts.
//!
//! What an adapter holds back comes out later, and the node cannot take it back. So it is judged by what it
//! knew when it gave the frame away; whether an old target acted on a drive is asked of the drives.

use std::collections::VecDeque;
use std::time::Duration;

use crate::campaign::monitor::sheet::Sheet;
use canopen::frame::Channel;
use canopen::frame::Frame;
use canopen::frame::Telegram;
use units::numbering::Joint;
use units::time::Instant;

/// A target that acts later is stale, in periods: 2 ms at 1 kHz.
const STALE: u32 = 2;

/// What was taken, and what waits to act.
#[derive(Clone, Debug)]
pub(super) struct Age {
    /// Of each bus, the oldest first.
    taken: Vec<VecDeque<(Instant, Frame)>>,
    /// The target that acts at the next SYNC, and since when it was on its way.
    waiting: [Option<(Instant, i16)>; 6],
    /// How old the target in force was when it began to act; zero where it asks for no torque.
    acting: [Duration; 6],
    /// Targets that were not zero, and stale, on the wire.
    pub(super) delivered: u64,
}

impl Age {
    pub(super) fn new(buses: usize) -> Self {
        Self {
            taken: vec![VecDeque::new(); buses],
            waiting: [None; 6],
            acting: [Duration::ZERO; 6],
            delivered: 0,
        }
    }

    /// A bus has taken a frame.
    pub(super) fn on_taken(&mut self, at: Instant, telegram: &Telegram) {
        let Channel(bus) = telegram.channel;
        if let Some(taken) = self.taken.get_mut(usize::from(bus)) {
            taken.push_back((at, telegram.frame));
        }
    }

    /// A frame of the node's is on the wire: when it was taken. What was taken before it was lost.
    pub(super) fn on_sent(&mut self, at: Instant, telegram: &Telegram) -> Instant {
        let Channel(bus) = telegram.channel;
        let Some(taken) = self.taken.get_mut(usize::from(bus)) else { return at };
        let place = taken.iter().position(|(_, frame)| *frame == telegram.frame);
        let gone = place.and_then(|place| taken.drain(..=place).next_back());
        gone.map_or(at, |(since, _)| since)
    }

    /// A target that was taken at `since`.
    pub(super) fn on_target(
        &mut self,
        sheet: &Sheet,
        (at, since): (Instant, Instant),
        (joint, target): (Joint, i16),
    ) {
        self.delivered += u64::from(target != 0 && at.since(since) > stale(sheet.period));
        *joint.entry_mut(&mut self.waiting) = Some((since, target));
    }

    /// A SYNC: what has come since the last one acts now.
    pub(super) fn on_sync(&mut self, sheet: &Sheet, at: Instant, channel: Channel) {
        let joints = sheet.nodes.iter().zip(&mut self.waiting).zip(&mut self.acting);
        for ((_, waiting), acting) in joints.filter(|((node, _), _)| node.channel == channel) {
            if let Some((since, target)) = waiting.take() {
                *acting = if target == 0 { Duration::ZERO } else { at.since(since) };
            }
        }
    }

    /// Returns how old each joint's target in force was when it began to act.
    pub(super) const fn acting(&self) -> [Duration; 6] {
        self.acting
    }
}

pub(super) fn stale(period: Duration) -> Duration {
    period * STALE
}
