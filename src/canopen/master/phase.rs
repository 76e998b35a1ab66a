//! Consequences of a node's report for the network: frames, events, the next phase.

use canopen_rs::{NmtCommand, NmtState};

use crate::frame::Telegram;
use crate::heartbeat::HeartbeatEvent;
use crate::master::boot_error::Problem;
use crate::master::event::Event;
use crate::master::report::Report;
use crate::master::slave::Slave;
use crate::master::steps::Stage;
use crate::master::{MAX_QUEUED, Master, Phase, telegram};
use crate::nmt::Order;
use crate::plan::BOOT_TIMEOUT;
use units::numbering::NodeIndex;
use units::time::Instant;

impl Master {
    /// Sends the frames of a slave and turns its report into events.
    pub(super) fn after(
        &mut self,
        now: Instant,
        node: NodeIndex,
        report: Option<Report>,
        out: &mut Vec<Telegram>,
    ) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        self.frames.iter().for_each(|frame| slave.on_sent(frame));
        let (channel, is_late) = (slave.channel, slave.is_late);
        let is_urgent = slave.has_urgent_request();
        let is_configured = matches!(report, Some(Report::Configured(_)));
        if is_configured && is_late && self.phase != Phase::Booting {
            slave.resume_guarding(now);
            // The other nodes have been started without it.
            self.frames.push(Order::to(slave.plan.node, NmtCommand::StartRemoteNode).frame());
        }
        for frame in self.frames.drain(..) {
            let telegram = Telegram { channel, frame };
            if self.phase != Phase::Running || frame.is_remote() || is_urgent {
                out.push(telegram);
            } else if self.transmit_queue.len() < MAX_QUEUED {
                self.transmit_queue.push_back(telegram);
            }
        }
        match report {
            None => {}
            Some(Report::Configured(configuration)) => {
                if self.slaves.get(node.0).is_some_and(|slave| slave.was_enabled) {
                    self.report(Event::FoundEnabled { node });
                }
                let refused = self.slaves.get_mut(node.0).map(|it| std::mem::take(&mut it.refused));
                for (object, code) in refused.into_iter().flatten() {
                    self.report(Event::ValueRefused { node, object, code });
                }
                self.report(Event::Configured { node, configuration });
            }
            Some(Report::Failed(error)) => self.report(Event::BootFailed(error)),
            // The mode that a drive did not take before its start belongs to the boot.
            Some(Report::StageDone(_)) if self.phase != Phase::Running => {}
            Some(Report::StageDone(stage)) => self.report(stage_done(stage, node)),
            Some(Report::Absent(waited)) => self.report(Event::Absent { node, waited }),
            Some(Report::History(history)) => self.report(Event::ErrorHistory { node, history }),
            Some(Report::Statusword(statusword)) => {
                self.report(Event::Statusword { node, statusword });
            }
            Some(Report::ReadBack(object, read)) => {
                self.report(Event::ReadBack { node, object, read });
            }
            Some(Report::Monitoring(Ok(()))) => self.report(Event::MonitoringEnded { node }),
            Some(Report::Monitoring(Err((object, error)))) => {
                self.report(Event::MonitoringKept { node, object, error });
            }
            Some(Report::HeartbeatEvent(news)) if is_late => {
                self.on_news_of_absent(now, node, news);
            }
            Some(Report::HeartbeatEvent(news)) => self.on_news(node, news),
        }
    }

    /// Handles an optional node that returns after the others have started.
    fn on_news_of_absent(&mut self, now: Instant, node: NodeIndex, news: HeartbeatEvent) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        match news {
            HeartbeatEvent::State(NmtState::Operational) => {
                slave.is_late = false;
                self.report(Event::Joined { node });
            }
            HeartbeatEvent::State(_) => {}
            HeartbeatEvent::BootedUp | HeartbeatEvent::Rebooted | HeartbeatEvent::Lost => {
                slave.await_again(now);
            }
            HeartbeatEvent::Duplicate(sign) => self.report(Event::Duplicate { node, sign }),
        }
    }

    /// Handles a change of a node's state: a failed boot until all nodes run, an event from then on.
    fn on_news(&mut self, node: NodeIndex, news: HeartbeatEvent) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        let is_running = self.phase == Phase::Running;
        let (problem, event) = match news {
            HeartbeatEvent::State(_) if !is_running => return,
            HeartbeatEvent::State(state) => {
                return self.report(Event::StateChanged { node, state });
            }
            HeartbeatEvent::BootedUp | HeartbeatEvent::Rebooted => {
                (Problem::Rebooted, Event::Rebooted { node })
            }
            HeartbeatEvent::Lost => (Problem::NoHeartbeat, Event::HeartbeatLost { node }),
            HeartbeatEvent::Duplicate(sign) => {
                (Problem::Duplicate(sign), Event::Duplicate { node, sign })
            }
        };
        let event = if is_running { event } else { Event::BootFailed(slave.fail(problem)) };
        self.report(event);
    }

    /// Enters the next phase once all nodes are ready for it.
    pub(super) fn proceed(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let has_failed = self.slaves.iter().any(Slave::has_failed);
        match self.phase {
            Phase::Booting if self.slaves.iter().any(Slave::is_pending) => {}
            Phase::Booting if has_failed => self.phase = Phase::Failed,
            Phase::Booting => {
                self.phase = Phase::Starting(now + BOOT_TIMEOUT);
                // Guarding has waited: its frames rank below all others, and would have waited for the SDO of the boot.
                self.slaves.iter_mut().for_each(|slave| slave.resume_guarding(now));
                let configured = self.slaves.iter().filter(|slave| slave.is_watched());
                out.extend(configured.map(|slave| telegram(slave, NmtCommand::StartRemoteNode)));
            }
            Phase::Starting(_) if !self.slaves.iter().any(Slave::is_starting) => {
                if has_failed {
                    self.phase = Phase::Failed;
                } else {
                    self.phase = Phase::Running;
                    self.report(Event::Booted);
                }
            }
            Phase::Starting(until) if now >= until => {
                let late = self.slaves.iter_mut().find(|slave| slave.is_starting());
                let failed = late.map(|slave| Event::BootFailed(slave.fail(Problem::NotStarted)));
                failed.into_iter().for_each(|event| self.report(event));
            }
            Phase::Starting(_) | Phase::Running | Phase::Failed => {}
        }
    }
}

/// Returns the event of a stage that ran after the start of a node.
fn stage_done(stage: Stage, node: NodeIndex) -> Event {
    if stage == Stage::PrepareHoming {
        Event::HomingPrepared { node }
    } else if stage == Stage::LeaveHoming {
        Event::HomingLeft { node }
    } else if matches!(stage, Stage::LimitTorque(_)) {
        Event::TorqueLimited { node }
    } else {
        Event::LimitsRaised { node }
    }
}
