//! The NMT master: boots every node of every bus, starts them, and then watches them.
//!
//! The cyclic exchange is not here; TPDOs are passed over at once. Nor is any decision: what is heard
//! is an [`Event`], what follows from it is `node::safety`'s. The bus does not hand a master its own
//! frames, so a command, a SYNC or an RPDO that is heard is somebody else's.
//!
//! Once the network runs, nothing but guarding is sent in a burst: what the master wants of a node by
//! SDO waits in an outbox, of which the cycle [releases](Master::release) one frame at a time.

pub mod boot_error;
pub mod check;
pub mod commission;
pub mod configuration;
pub mod duplicate;
pub mod error_history;
pub mod event;
mod inquiry;
pub mod read_back;
mod rest;
mod sdo_traffic;
mod slave;
pub mod steps;
mod strangers;

use std::collections::VecDeque;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::SDO_REQUEST_COB_BASE;
use canopen_rs::sdo::SDO_RESPONSE_COB_BASE;

use crate::emcy;
use crate::emcy::Emergency;
use crate::frame::Channel;
use crate::frame::Frame;
use crate::frame::Telegram;
use crate::heartbeat::Health;
use crate::heartbeat::News;
use crate::layout::Direction;
use crate::master::boot_error::Problem;
use crate::master::commission::PATIENCE;
use crate::master::event::Event;
use crate::master::read_back::Setting;
use crate::master::sdo_traffic::Foreign;
use crate::master::slave::Report;
use crate::master::slave::Slave;
use crate::master::strangers::Strangers;
use crate::nmt;
use crate::nmt::Order;
use crate::object::Object;
use crate::plan::NodePlan;
use crate::sync;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Events and frames that may wait for whoever owns the master; more are lost.
const QUEUE: usize = 64;

/// The master of all nodes on all buses.
#[derive(Clone, Debug)]
pub struct Master {
    slaves: Vec<Slave>,
    strangers: Strangers,
    /// Uploads that other clients have begun.
    foreign_uploads: u64,
    phase: Phase,
    /// Whether a node that tells of an error is asked for those it remembers.
    asks_why: bool,
    /// What one node wants sent; kept, so that nothing is allocated later.
    frames: Vec<Frame>,
    /// What waits for its cycle while the network runs.
    outbox: VecDeque<Telegram>,
    /// What has not been told yet.
    events: VecDeque<Event>,
}

/// How far they all are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Booting,
    /// Told to start; all must have said they did until then.
    Starting(Instant),
    Running,
    /// Not all of them could be booted.
    Failed,
}

impl Master {
    /// A master that begins to boot with the first call of [`on_time`](Self::on_time).
    pub fn new(plans: Vec<(Channel, NodePlan)>) -> Self {
        let strangers = Strangers::to(&plans);
        let slaves = plans.into_iter().map(|(channel, plan)| Slave::new(channel, plan));
        Self {
            slaves: slaves.collect(),
            strangers,
            foreign_uploads: 0,
            phase: Phase::Booting,
            asks_why: true,
            frames: Vec::with_capacity(8),
            outbox: VecDeque::with_capacity(QUEUE),
            events: VecDeque::with_capacity(QUEUE),
        }
    }

    /// Boots every node again, as after power-up.
    pub fn restart(&mut self) {
        self.slaves.iter_mut().for_each(Slave::restart);
        self.outbox.clear();
        self.events.clear();
        self.phase = Phase::Booting;
    }

    /// Whether a node is still to be booted or started; false once it is known how that went.
    pub fn is_booting(&self) -> bool {
        match self.phase {
            Phase::Booting | Phase::Starting(_) => true,
            Phase::Running | Phase::Failed => false,
        }
    }

    /// What is known of a node.
    pub fn health(&self, node: NodeIndex) -> Option<Health> {
        self.slaves.get(node.0).map(Slave::health)
    }

    /// Takes one received frame; telegrams to send are appended to `out`.
    pub fn on_frame(
        &mut self,
        now: Instant,
        telegram: &Telegram,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let Telegram { channel, frame } = *telegram;
        match frame.cob_id & FUNCTION {
            // TPDO1 to TPDO4 of the predefined connection set: the cycle's.
            0x180 | 0x280 | 0x380 | 0x480 => return None,
            _ if frame.is_remote() => return None,
            SDO_RESPONSE_COB_BASE | HEARTBEAT_COB_BASE => self.answer(now, channel, &frame, out),
            SDO_REQUEST_COB_BASE => self.request_of_another(now, channel, &frame),
            _ if self.is_ours_alone(channel, &frame) => {
                self.tell(Event::ForeignMaster { channel, frame });
            }
            _ => self.emergency(now, channel, &frame, out),
        }
        if let Some(node_id) = self.strangers.heard(channel, &frame) {
            self.tell(Event::Stranger { channel, node_id });
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// Does what is due. It says one thing at a time: call it until its deadline lies ahead.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) -> Option<Event> {
        for place in (0..self.slaves.len()).map(NodeIndex) {
            let Some(slave) = self.slaves.get_mut(place.0) else { continue };
            let report = slave.on_time(now, &mut self.frames);
            self.after(now, place, report, out);
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let start = match self.phase {
            Phase::Starting(until) => Some(until),
            Phase::Booting | Phase::Running | Phase::Failed => None,
        };
        let untold = (!self.events.is_empty()).then_some(Instant::ZERO);
        let slaves = self.slaves.iter().filter_map(Slave::deadline);
        slaves.chain(start).chain(untold).min()
    }

    /// The next frame that has waited for its cycle, the oldest first.
    pub fn release(&mut self) -> Option<Telegram> {
        self.outbox.pop_front()
    }

    /// Reads what a node remembers of its errors; an
    /// [`Event::ErrorHistory`] tells it. A node that cannot be asked now is not.
    pub fn read_history(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) {
        if let Some(slave) = self.slaves.get_mut(node.0) {
            slave.read_history(now, &mut self.frames);
            self.after(now, node, None, out);
        }
    }

    /// What a node was to be told and does not have: it is not set.
    pub fn missing(&self, node: NodeIndex) -> &[Object] {
        self.slaves.get(node.0).map(|slave| slave.missing.as_slice()).unwrap_or_default()
    }

    /// Whether a node that tells of an error is asked for those it remembers from now on.
    pub const fn asks_why(&mut self, asks: bool) {
        self.asks_why = asks;
    }

    /// Reads what a drive's power stage is in; an
    /// [`Event::Statusword`] tells it. A drive that cannot be asked now is not.
    pub fn read_statusword(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) {
        if let Some(slave) = self.slaves.get_mut(node.0) {
            slave.read_statusword(now, &mut self.frames);
            self.after(now, node, None, out);
        }
    }

    /// Reads an object of a node again; an [`Event::ReadBack`] reports
    /// what came of it. Returns whether it does: a node that is being asked is not asked more.
    pub fn read_back(
        &mut self,
        now: Instant,
        node: NodeIndex,
        setting: Setting,
        out: &mut Vec<Telegram>,
    ) -> bool {
        let slave = self.slaves.get_mut(node.0);
        let is_asked = slave.is_some_and(|it| it.read_back(now, setting, &mut self.frames));
        if is_asked {
            self.after(now, node, None, out);
        }
        is_asked
    }

    /// Tells a drive by SDO to take its power off: at once, without
    /// waiting for a SYNC or behind anything else.
    pub fn power_off(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) {
        if let Some(slave) = self.slaves.get_mut(node.0) {
            slave.power_off(now, &mut self.frames);
            self.frames.iter().for_each(|frame| slave.on_sent(frame));
            let channel = slave.channel;
            out.extend(self.frames.drain(..).map(|frame| Telegram { channel, frame }));
        }
    }

    /// Starts again every node that is watched: some may have left operational by themselves (1029h).
    pub fn start_again(&self, out: &mut Vec<Telegram>) {
        let watched = self.slaves.iter().filter(|slave| slave.is_watched() && !slave.is_late);
        out.extend(watched.map(|slave| telegram(slave, NmtCommand::StartRemoteNode)));
    }

    /// For an orderly stop, after torque and power are off: every node back to pre-operational.
    pub fn shut_down(&self, out: &mut Vec<Telegram>) {
        let order = NmtCommand::EnterPreOperational;
        out.extend(self.slaves.iter().map(|slave| telegram(slave, order)));
    }

    /// Number of uploads that other clients have begun at the nodes of this master.
    pub const fn foreign_uploads(&self) -> u64 {
        self.foreign_uploads
    }

    /// Place of the node that a frame of the predefined connection set is from or to.
    fn place(&self, channel: Channel, frame: &Frame) -> Option<NodeIndex> {
        let node_id = frame.cob_id & !FUNCTION;
        let is_its =
            |slave: &Slave| slave.channel == channel && u16::from(slave.plan.node.raw()) == node_id;
        self.slaves.iter().position(is_its).map(NodeIndex)
    }

    /// An SDO request of another client: to write is a master's, to read is anyone's.
    fn request_of_another(&mut self, now: Instant, channel: Channel, frame: &Frame) {
        let Some(node) = self.place(channel, frame) else { return };
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        match slave.on_foreign_request(now, frame) {
            Some(Foreign::Download) => self.tell(Event::ForeignMaster { channel, frame: *frame }),
            Some(Foreign::Upload) => {
                self.foreign_uploads += 1;
                if slave.is_newly_read() {
                    self.tell(Event::ReadByAnother { node });
                }
            }
            Some(Foreign::Other) | None => {}
        }
    }

    /// An SDO reply, a heartbeat, a boot-up message or an answer to guarding.
    fn answer(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        let Some(place) = self.place(channel, frame) else { return };
        let Some(slave) = self.slaves.get_mut(place.0) else { return };
        if slave.is_foreign_reply(now, frame) {
            return self.tell(Event::ForeignMaster { channel, frame: *frame });
        }
        let report = slave.on_frame(now, frame, &mut self.frames);
        self.after(now, place, report, out);
    }

    /// Sends what a node's part of the master wants sent, and draws the conclusion of its report.
    fn after(
        &mut self,
        now: Instant,
        node: NodeIndex,
        report: Option<Report>,
        out: &mut Vec<Telegram>,
    ) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        self.frames.iter().for_each(|frame| slave.on_sent(frame));
        let (channel, is_late) = (slave.channel, slave.is_late);
        let is_configured = matches!(report, Some(Report::Configured(_)));
        if is_configured && is_late && self.phase != Phase::Booting {
            // The others have been started without it.
            self.frames.push(Order::to(slave.plan.node, NmtCommand::StartRemoteNode).frame());
        }
        for frame in self.frames.drain(..) {
            let telegram = Telegram { channel, frame };
            if self.phase != Phase::Running || frame.is_remote() {
                out.push(telegram);
            } else if self.outbox.len() < QUEUE {
                self.outbox.push_back(telegram);
            }
        }
        match report {
            None => {}
            Some(Report::Configured(configuration)) => {
                if self.slaves.get(node.0).is_some_and(|slave| slave.was_enabled) {
                    self.tell(Event::FoundEnabled { node });
                }
                self.tell(Event::Configured { node, configuration });
            }
            Some(Report::Failed(error)) => self.tell(Event::BootFailed(error)),
            Some(Report::Absent(waited)) => self.tell(Event::Absent { node, waited }),
            Some(Report::History(history)) => self.tell(Event::ErrorHistory { node, history }),
            Some(Report::Statusword(statusword)) => {
                self.tell(Event::Statusword { node, statusword });
            }
            Some(Report::ReadBack(object, read)) => {
                self.tell(Event::ReadBack { node, object, read });
            }
            Some(Report::News(news)) if is_late => self.on_news_of_late(now, node, news),
            Some(Report::News(news)) => self.on_news(node, news),
        }
    }

    /// What is heard of an optional node on its way back to the others: nobody depends on it yet.
    fn on_news_of_late(&mut self, now: Instant, node: NodeIndex, news: News) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        match news {
            News::State(NmtState::Operational) => {
                slave.is_late = false;
                self.tell(Event::Joined { node });
            }
            News::State(_) => {}
            News::BootedUp | News::Rebooted | News::Lost => slave.look_again(now),
            News::Duplicate(sign) => self.tell(Event::Duplicate { node, sign }),
        }
    }

    /// What a heartbeat, or its absence, means: a failed boot until all run, an event from then on.
    fn on_news(&mut self, node: NodeIndex, news: News) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        let is_running = self.phase == Phase::Running;
        let (problem, event) = match news {
            News::State(_) if !is_running => return,
            News::State(state) => return self.tell(Event::StateChanged { node, state }),
            News::BootedUp | News::Rebooted => (Problem::Rebooted, Event::Rebooted { node }),
            News::Lost => (Problem::NoHeartbeat, Event::HeartbeatLost { node }),
            News::Duplicate(sign) => (Problem::Duplicate(sign), Event::Duplicate { node, sign }),
        };
        let event = if is_running { event } else { Event::BootFailed(slave.fail(problem)) };
        self.tell(event);
    }

    /// Goes on to the next phase if all nodes are ready for it.
    fn proceed(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let has_failed = self.slaves.iter().any(Slave::has_failed);
        match self.phase {
            Phase::Booting if self.slaves.iter().any(Slave::is_pending) => {}
            Phase::Booting if has_failed => self.phase = Phase::Failed,
            Phase::Booting => {
                self.phase = Phase::Starting(now + PATIENCE);
                let configured = self.slaves.iter().filter(|slave| slave.is_watched());
                out.extend(configured.map(|slave| telegram(slave, NmtCommand::StartRemoteNode)));
            }
            Phase::Starting(_) if !self.slaves.iter().any(Slave::is_starting) => {
                if has_failed {
                    self.phase = Phase::Failed;
                } else {
                    self.phase = Phase::Running;
                    self.tell(Event::Booted);
                }
            }
            Phase::Starting(until) if now >= until => {
                let late = self.slaves.iter_mut().find(|slave| slave.is_starting());
                let failed = late.map(|slave| Event::BootFailed(slave.fail(Problem::NotStarted)));
                failed.into_iter().for_each(|event| self.tell(event));
            }
            Phase::Starting(_) | Phase::Running | Phase::Failed => {}
        }
    }

    /// Has something to say; nobody hears of it if too much has not been heard yet.
    fn tell(&mut self, event: Event) {
        if self.events.len() < QUEUE {
            self.events.push_back(event);
        }
    }

    /// Returns whether only a master sends this, other than by SDO: a command, a SYNC or an RPDO.
    pub fn is_foreign(&self, Telegram { channel, frame }: &Telegram) -> bool {
        !frame.is_remote() && self.is_ours_alone(*channel, frame)
    }

    /// Whether only the master may send this.
    fn is_ours_alone(&self, channel: Channel, frame: &Frame) -> bool {
        let is_rpdo = |slave: &Slave| {
            slave.channel == channel
                && slave.plan.pdos.iter().any(|pdo| {
                    pdo.direction == Direction::Receive
                        && pdo.service.is_some()
                        && pdo.cob_id == frame.cob_id
                })
        };
        frame.cob_id == nmt::COB_ID
            || frame.cob_id == sync::COB_ID
            || self.slaves.iter().any(is_rpdo)
    }

    /// The emergency of one of the nodes, where it was planned to be or where it was before that.
    fn emergency(
        &mut self,
        now: Instant,
        channel: Channel,
        frame: &Frame,
        out: &mut Vec<Telegram>,
    ) {
        let is_its = |slave: &Slave| {
            let cob_ids = [slave.plan.emcy_cob_id, emcy::default_cob_id(slave.plan.node)];
            slave.channel == channel && cob_ids.contains(&frame.cob_id)
        };
        let Some(node) = self.slaves.iter().position(is_its).map(NodeIndex) else { return };
        let Some(emergency) = Emergency::decode(frame.data()) else { return };
        self.tell(Event::Emergency { node, emergency });
        if self.asks_why && !emergency.is_reset() {
            self.read_history(now, node, out);
        }
    }
}

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;

fn telegram(slave: &Slave, command: NmtCommand) -> Telegram {
    let frame = Order::to(slave.plan.node, command).frame();
    Telegram { channel: slave.channel, frame }
}

#[cfg(test)]
mod tests;
