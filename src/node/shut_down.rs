//! Orderly end of the node: torque, power, NMT pre-operational, then the nodes' monitoring of this master. Not a stop
//! S1 to S3, which [`safety`](crate::safety) enters.
//!
//! A drive that monitors the master's heartbeat enters a fault (8130h) when it ends. So the monitoring is ended first, by
//! SDO, while heartbeat and guarding continue: only once *every* drive has confirmed that its power stage is off.
//! Otherwise all drives keep their watchdogs, which are then the last protection.

use std::time::Duration;

use thiserror::Error;

use crate::{Node, power};
use bus::{Bus, BusEvent};
use canopen::frame::Telegram;
use canopen::master::event::Event;
use remote::Remote;
use units::numbering::Joint;
use units::wording::{grouped, in_one_line, listed};

/// Cycles at zero torque before the drives are switched off.
const ZERO_TORQUE_CYCLES: u32 = 5;

/// Maximum time until all statuswords confirm that the power stages are off.
const POWER_OFF_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum time for the end of all nodes' monitoring: two writes to each, each repeated once.
const MONITORING_OFF_TIMEOUT: Duration = Duration::from_millis(300);

/// Maximum time of one wait for a frame while monitoring is ended.
const MAX_RECEIVE_WAIT: Duration = Duration::from_millis(1);

/// Drives that did not confirm that their power stages are off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{}; all drives keep their watchdogs and end in fault 8130h", lines(.statuswords))]
pub struct PowerOffError {
    /// Last statusword of each such joint.
    pub statuswords: [Option<u16>; 6],
}

/// Returns `joints 3 and 4: drive did not confirm that it is off (6041h = 1237h)` for each statusword, separated by
/// semicolons.
fn lines(statuswords: &[Option<u16>; 6]) -> String {
    let line = |(joint, statusword): (Joint, &Option<u16>)| {
        let statusword = (*statusword)?;
        let reason = format!("drive did not confirm that it is off (6041h = {statusword:04X}h)");
        Some((joint, reason))
    };
    let groups = grouped(Joint::each(statuswords).filter_map(line)).into_iter();
    let lines = groups.map(|(joints, reason)| {
        let several = if joints.len() > 1 { "s" } else { "" };
        format!("joint{several} {}: {reason}", listed(&joints))
    });
    in_one_line(&lines.collect::<Vec<_>>())
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Ends the node in order. Torque ramps to zero, the drives are switched off and confirm it by statusword, and the nodes are set
    /// pre-operational. Then their monitoring of this master ends, unless `is_urgent` returns true.
    ///
    /// # Errors
    /// When a drive does not confirm in time. Disable voltage was sent to it, and the watchdogs of all drives still run.
    pub fn shut_down(&mut self, is_urgent: &mut dyn FnMut() -> bool) -> Result<(), PowerOffError> {
        // The next boot writes the planned limits.
        self.safety.end_alone(self.wire.read_clock());
        self.safety.disarm();
        while self.safety.allows_torque() {
            self.cycle();
        }
        for _ in 0..ZERO_TORQUE_CYCLES {
            self.cycle();
        }
        self.switch_off(is_urgent)
    }

    /// Disables voltage, awaits confirmation by the statuswords, then sets NMT pre-operational and ends the monitoring.
    pub(super) fn switch_off(
        &mut self,
        is_urgent: &mut dyn FnMut() -> bool,
    ) -> Result<(), PowerOffError> {
        self.safety.switch_drives_off(self.wire.read_clock());
        let until = self.wire.read_clock() + POWER_OFF_TIMEOUT;
        while !self.is_off() && self.wire.read_clock() < until {
            self.cycle();
        }
        let statuswords = self.powered();
        self.enter_pre_operational();
        if statuswords != [None; 6] {
            return Err(PowerOffError { statuswords });
        }
        self.end_monitoring(is_urgent);
        Ok(())
    }

    /// Returns whether the latest statusword of every drive reports its power stage off.
    pub fn is_off(&self) -> bool {
        self.powered() == [None; 6]
    }

    /// Returns the statuswords of the joints whose drives may still apply torque.
    fn powered(&self) -> [Option<u16>; 6] {
        self.samples
            .latest()
            .each_ref()
            .map(|sample| power::may_apply_torque(sample.statusword).then_some(sample.statusword.0))
    }

    /// Sets all nodes pre-operational, so that no PDO of this master acts any more.
    pub(super) fn enter_pre_operational(&mut self) {
        self.network.master.enter_pre_operational(&mut self.wire.out);
        self.send_queued();
        let flushed = self.wire.read_clock() + self.timing.period;
        while let Some(received) = self.wire.receive(flushed) {
            if matches!(received.event, BusEvent::Error(_)) {
                self.on_received(received);
            }
        }
    }

    /// Ends every node's monitoring of this master, and sends heartbeat and guarding until all have confirmed or failed.
    fn end_monitoring(&mut self, is_urgent: &mut dyn FnMut() -> bool) {
        let now = self.wire.read_clock();
        let mut waiting: usize = 0;
        for node in self.network.master.nodes() {
            let is_requested = self.network.master.end_monitoring(now, node, &mut self.wire.out);
            waiting += usize::from(is_requested);
        }
        let until = now + MONITORING_OFF_TIMEOUT;
        while waiting > 0 && !is_urgent() && !self.wire.transmission.is_shut() {
            let now = self.wire.read_clock();
            if now >= until {
                return;
            }
            self.send_heartbeat(now);
            while let Some(event) = self.network.master.on_time(now, &mut self.wire.out) {
                waiting = waiting.saturating_sub(self.count_end(event));
            }
            self.send_queued();
            while let Some(telegram) = self.network.master.release() {
                self.send(telegram);
            }
            let Some(received) = self.wire.receive(until.min(now + MAX_RECEIVE_WAIT)) else {
                continue;
            };
            match received.event {
                BusEvent::Frame(frame) => {
                    let telegram = Telegram { channel: received.channel, frame };
                    let master = &mut self.network.master;
                    let event = master.on_frame(received.at, &telegram, &mut self.wire.out);
                    waiting =
                        waiting.saturating_sub(event.map_or(0, |event| self.count_end(event)));
                }
                BusEvent::Error(_) => self.on_received(received),
            }
        }
    }

    /// Logs a node that keeps its monitoring. Returns the number of nodes whose end of monitoring this event reports.
    /// Ignores other events, such as reports of pre-operational.
    fn count_end(&mut self, event: Event) -> usize {
        let is_kept = matches!(event, Event::MonitoringKept { .. });
        let is_ended = is_kept || matches!(event, Event::MonitoringEnded { .. });
        if is_kept {
            self.log_event(event);
        }
        usize::from(is_ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silent_bus::node;

    #[test]
    fn shut_down_before_a_boot_ends_at_once() {
        let mut node = node();
        let start = node.bus().now();
        assert_eq!(node.shut_down(&mut || false), Ok(()));
        let elapsed = node.bus().now().since(start);
        assert!(elapsed < POWER_OFF_TIMEOUT / 10, "{elapsed:?}");
        let mut sent = node.bus().sent.iter().map(|(_, telegram)| telegram.frame);
        assert!(!sent.any(|frame| frame.data().starts_with(&[0x23, 0x16, 0x10])), "not booted");
    }
}
