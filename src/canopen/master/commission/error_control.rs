//! Heartbeats and boot-up messages during a boot: the one that a step waits for, or that of an unexpected reboot.

use std::time::Duration;

use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::{NmtCommand, NmtState};

use crate::frame::Frame;
use crate::heartbeat::is_boot_up;
use crate::master::boot_error::Problem;
use crate::master::commission::{Boot, BootOutcome, Wait};
use crate::master::duplicate::Sign;
use crate::master::steps::{Next, Stage};
use crate::nmt::Order;
use units::time::Instant;

/// Maximum time for which a boot-up message waits behind the traffic of the other boots.
const MAX_BOOT_UP_DELAY: Duration = Duration::from_millis(10);

impl Boot {
    /// Takes a heartbeat or a boot-up message.
    pub(super) fn on_heartbeat(
        &mut self,
        now: Instant,
        frame: &Frame,
        out: &mut Vec<Frame>,
    ) -> Option<BootOutcome> {
        let sent = out.len();
        let outcome = if is_boot_up(frame, self.plan.node) {
            self.on_boot_up(now, out)
        } else {
            self.reported_state =
                frame.data().try_into().ok().and_then(|data| decode_heartbeat(data).ok());
            match (&self.wait, self.reported_state) {
                (Wait::Heartbeat, Some(NmtState::Operational)) => self.next_step(now, out),
                (Wait::Heartbeat, Some(_)) => self.on_mismatch(now, Problem::NotStarted, out),
                _ => None,
            }
        };
        self.replies.on_requests(self.plan.node, out.get(sent..).unwrap_or_default());
        outcome
    }

    /// Handles a boot-up message. A self-starting node (1F80h) is set pre-operational.
    fn on_boot_up(&mut self, now: Instant, out: &mut Vec<Frame>) -> Option<BootOutcome> {
        self.reported_state = Some(NmtState::PreOperational);
        match self.wait {
            Wait::BootUp => {
                out.push(Order::to(self.plan.node, NmtCommand::EnterPreOperational).frame());
                self.next_step(now, out)
            }
            Wait::Read(_) | Wait::Heartbeat if self.stage == Stage::CheckRunning => {
                self.on_mismatch(now, Problem::Rebooted, out)
            }
            // Answers outrank a boot-up message, which may have waited behind them on a full bus.
            Wait::Read(_) | Wait::Write(_) | Wait::Retry(_)
                if self.resets.count == 1 && self.has_just_answered(now) =>
            {
                self.go(now, Next::Stage(Stage::Reset), out)
            }
            Wait::Read(_) | Wait::Write(_) | Wait::Retry(_)
                if self.resets.answered_at.is_some() =>
            {
                self.fail(Problem::Rebooted)
            }
            // The first of two may stem from the power-up, so the node is reset again.
            Wait::Read(_) if self.resets.count == 1 => {
                self.at = self.at.saturating_sub(1);
                self.take_step(now, out)
            }
            Wait::Read(_) if self.resets.count > 1 => {
                self.fail(Problem::Duplicate(Sign::TwoBootUps))
            }
            Wait::Start
            | Wait::Read(_)
            | Wait::Write(_)
            | Wait::Retry(_)
            | Wait::Listen
            | Wait::Heartbeat
            | Wait::Over => None,
        }
    }

    /// Returns whether the first answer after the reset is so recent that its boot-up message may still come.
    fn has_just_answered(&self, now: Instant) -> bool {
        self.resets.answered_at.is_some_and(|at| now < at + MAX_BOOT_UP_DELAY)
    }
}
