//! Error control of one node: its heartbeat is consumed, or it is guarded (CiA 301, 7.2.8.2).

use std::time::Duration;

use crate::frame::Frame;
use crate::guarding::Guard;
use crate::heartbeat::{Consumer, Health, HeartbeatEvent};
use crate::plan::{ErrorControl, NodePlan};
use units::time::Instant;

/// Monitor of one node by its error control service.
#[derive(Clone, Debug)]
pub(super) enum ErrorControlMonitor {
    Heartbeat(Consumer),
    Guarding(Guard),
}

impl ErrorControlMonitor {
    /// Returns the error control of `plan`, expected to begin at `now`.
    pub(super) fn new(plan: &NodePlan, now: Instant) -> Self {
        match plan.error_control {
            ErrorControl::Heartbeat { period_ms, lost_after } => {
                let period = Duration::from_millis(u64::from(period_ms));
                let consumer = Consumer::new(plan.node, lost_after, now + lost_after);
                Self::Heartbeat(consumer.every(period))
            }
            ErrorControl::Guarding(guarding) => {
                Self::Guarding(Guard::new(plan.node, guarding, now))
            }
        }
    }

    /// Returns the NMT state, if known.
    pub(super) const fn health(&self) -> Health {
        match self {
            Self::Heartbeat(consumer) => consumer.health(),
            Self::Guarding(guard) => guard.health(),
        }
    }

    /// Takes one frame with its node-id.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame) -> Option<HeartbeatEvent> {
        match self {
            Self::Heartbeat(consumer) => consumer.on_frame(now, frame),
            Self::Guarding(guard) => guard.on_frame(now, frame),
        }
    }

    /// Handles expired timers.
    pub(super) fn on_time(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<HeartbeatEvent> {
        match self {
            Self::Heartbeat(consumer) => consumer.on_time(now),
            Self::Guarding(guard) => guard.on_time(now, out),
        }
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub(super) fn deadline(&self) -> Option<Instant> {
        match self {
            Self::Heartbeat(consumer) => consumer.deadline(),
            Self::Guarding(guard) => guard.deadline(),
        }
    }

    /// Stops guarding, if the node is guarded.
    pub(super) const fn pause(&mut self) {
        match self {
            Self::Guarding(guard) => guard.pause(),
            Self::Heartbeat(_) => {}
        }
    }

    /// Guards again, if the node is guarded.
    pub(super) fn resume(&mut self, now: Instant) {
        match self {
            Self::Guarding(guard) => guard.resume(now),
            Self::Heartbeat(_) => {}
        }
    }
}
