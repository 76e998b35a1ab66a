//! NMT master (CiA 302-2): boots every node of every bus, starts them, then monitors them.
//!
//! The master reports [`Event`]s; `node::safety` decides the reaction. TPDOs belong to the cyclic exchange
//! and are ignored here. The bus does not return a master's own frames: every NMT command, SYNC or RPDO
//! received comes from another master.
//!
//! Once the network runs, guarding, NMT commands and the steps towards a drive that is not off are sent at once. Other SDO
//! requests wait in a queue, from which each cycle [releases](Master::release) one frame.

pub mod boot_error;
pub mod check;
pub mod commission;
pub mod configuration;
mod disturbance;
pub mod duplicate;
mod error_control;
pub mod error_history;
pub mod event;
mod inquiry;
mod monitoring_off;
mod node_request;
mod phase;
mod power_off;
pub mod read_back;
mod receive;
mod report;
mod sdo_traffic;
mod slave;
mod standstill;
pub mod steps;
mod unknown_nodes;

pub use inquiry::STATUSWORD_TIMEOUT;

use std::collections::VecDeque;

use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::{SDO_REQUEST_COB_BASE, SDO_RESPONSE_COB_BASE};
use canopen_rs::{NmtCommand, NodeId};

use crate::frame::{Channel, FUNCTION_CODE, Frame, Telegram};
use crate::heartbeat::Health;
use crate::master::event::Event;
use crate::master::read_back::ObjectRead;
use crate::master::slave::Slave;
use crate::master::unknown_nodes::UnknownNodes;
use crate::nameplate::StoredValue;
use crate::nmt::Order;
use crate::object::Object;
use crate::plan::NodePlan;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Maximum number of queued events, and of queued frames. Further ones are dropped.
const MAX_QUEUED: usize = 64;

/// Master of all nodes on all buses.
#[derive(Clone, Debug)]
pub struct Master {
    slaves: Vec<Slave>,
    /// Node-id of this master, if the master produces a heartbeat.
    own: Option<NodeId>,
    unknown_nodes: UnknownNodes,
    /// Number of uploads that other clients have initiated.
    foreign_uploads: u32,
    phase: Phase,
    /// Set if an emergency triggers a read of the node's error history (1003h).
    reads_error_history: bool,
    /// Frames of the node being served. Kept to avoid allocation in the cycle.
    frames: Vec<Frame>,
    /// Frames waiting for a cycle while the network runs.
    transmit_queue: VecDeque<Telegram>,
    /// Events not returned yet.
    events: VecDeque<Event>,
}

/// Progress of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Booting,
    /// Start commands are sent; every node must report operational by this time.
    Starting(Instant),
    Running,
    /// At least one mandatory node could not be booted.
    Failed,
}

impl Master {
    /// Returns a master that starts to boot with the first call of [`on_time`](Self::on_time).
    pub fn new(plans: Vec<(Channel, NodePlan)>) -> Self {
        let unknown_nodes = UnknownNodes::except(&plans);
        let slaves = plans.into_iter().map(|(channel, plan)| Slave::new(channel, plan));
        Self {
            slaves: slaves.collect(),
            own: None,
            unknown_nodes,
            foreign_uploads: 0,
            phase: Phase::Booting,
            reads_error_history: true,
            frames: Vec::with_capacity(8),
            transmit_queue: VecDeque::with_capacity(MAX_QUEUED),
            events: VecDeque::with_capacity(MAX_QUEUED),
        }
    }

    /// Sets the node-id of this master: once the network runs, its heartbeat from another sender is a foreign master's.
    #[must_use]
    pub fn with_node_id(self, own: NodeId) -> Self {
        Self { own: Some(own), ..self }
    }

    /// Boots every node again, as after power-up. Before `reset_from` only the power of drives is switched off, and no
    /// node is reset: if another master is detected, its nodes remain unchanged.
    pub fn restart(&mut self, reset_from: Instant) {
        self.slaves.iter_mut().for_each(|slave| slave.restart(reset_from));
        self.transmit_queue.clear();
        self.events.clear();
        self.phase = Phase::Booting;
    }

    /// Returns whether a boot or start is in progress; false after success and after failure.
    pub fn is_booting(&self) -> bool {
        match self.phase {
            Phase::Booting | Phase::Starting(_) => true,
            Phase::Running | Phase::Failed => false,
        }
    }

    /// Returns the NMT state of a node, as far as its heartbeats or guarding show it.
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
        match frame.cob_id & FUNCTION_CODE {
            // TPDO1 to TPDO4 of the predefined connection set belong to the cyclic exchange.
            0x180 | 0x280 | 0x380 | 0x480 => return None,
            _ if frame.is_remote() => return None,
            // It would keep drives enabled that monitor nothing else, after this master has ended.
            HEARTBEAT_COB_BASE if self.is_own_heartbeat(&frame) => {
                self.report(Event::ForeignMaster { channel, frame });
            }
            SDO_RESPONSE_COB_BASE | HEARTBEAT_COB_BASE => self.answer(now, channel, &frame, out),
            SDO_REQUEST_COB_BASE => self.request_of_another(now, channel, &frame),
            _ if self.is_ours_alone(channel, &frame) => {
                self.report(Event::ForeignMaster { channel, frame });
            }
            _ => self.emergency(now, channel, &frame, out),
        }
        if let Some(node_id) = self.unknown_nodes.on_frame(channel, &frame) {
            self.report(Event::UnknownNode { channel, node_id });
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// Handles expired timers. Returns one event per call: call it until its deadline lies ahead.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) -> Option<Event> {
        for place in (0..self.slaves.len()).map(NodeIndex) {
            let Some(slave) = self.slaves.get_mut(place.0) else { continue };
            let report = slave.on_time(now, &mut self.frames);
            self.after(now, place, report, out);
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// Time of the next call of [`on_time`](Self::on_time).
    pub fn deadline(&self) -> Option<Instant> {
        let start = match self.phase {
            Phase::Starting(until) => Some(until),
            Phase::Booting | Phase::Running | Phase::Failed => None,
        };
        let unreported = (!self.events.is_empty()).then_some(Instant::ZERO);
        let slaves = self.slaves.iter().filter_map(Slave::deadline);
        slaves.chain(start).chain(unreported).min()
    }

    /// Takes the oldest frame from the transmit queue.
    pub fn release(&mut self) -> Option<Telegram> {
        self.transmit_queue.pop_front()
    }

    /// Returns whether frames wait in the transmit queue.
    pub fn has_queued(&self) -> bool {
        !self.transmit_queue.is_empty()
    }

    /// Starts to read the error history (1003h) of a node, reported as [`Event::ErrorHistory`]. Does nothing
    /// while another request to the node is pending.
    pub fn read_error_history(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) {
        self.request(now, node, out, |slave, frames| slave.read_error_history(now, frames));
    }

    /// Optional objects that the node lacks, or whose value it refuses; they are not configured.
    pub fn missing_objects(&self, node: NodeIndex) -> &[Object] {
        self.slaves.get(node.0).map(|slave| slave.missing.as_slice()).unwrap_or_default()
    }

    /// Nameplate of a drive as its boot read it; empty before the boot, and for a plan without a nameplate.
    pub fn nameplate(&self, node: NodeIndex) -> &[StoredValue] {
        self.slaves.get(node.0).map(|slave| slave.held.as_slice()).unwrap_or_default()
    }

    /// Sets whether an emergency triggers a read of the node's error history (1003h).
    pub const fn set_reads_error_history(&mut self, enable: bool) {
        self.reads_error_history = enable;
    }

    /// Starts to read the statusword (6041h) of a drive, reported as [`Event::Statusword`] within [`STATUSWORD_TIMEOUT`] or
    /// not at all. Returns false while another request to the drive is pending.
    pub fn read_statusword(
        &mut self,
        now: Instant,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
    ) -> bool {
        self.request(now, node, out, |slave, frames| slave.read_statusword(now, frames))
    }

    /// Starts to read an object of a node again, reported as [`Event::ReadBack`]. Returns false while another
    /// request to the node is pending.
    pub fn read_back(
        &mut self,
        now: Instant,
        node: NodeIndex,
        setting: ObjectRead,
        out: &mut Vec<Telegram>,
    ) -> bool {
        self.request(now, node, out, |slave, frames| slave.read_back(now, setting, frames))
    }

    /// Starts to write and read back the planned torque limits of a drive whose mode was checked under reduced ones. Reported
    /// as [`Event::LimitsRaised`] or [`Event::BootFailed`]. Returns false while another request to the drive is pending.
    pub fn raise_limits(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) -> bool {
        self.request(now, node, out, |slave, frames| slave.raise_limits(now, frames))
    }

    /// Starts to prepare a drive that is off for its planned homing. Reported as [`Event::HomingPrepared`] or
    /// [`Event::BootFailed`]. Returns false while another request to the drive is pending.
    pub fn prepare_homing(
        &mut self,
        now: Instant,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
    ) -> bool {
        self.request(now, node, out, |slave, frames| slave.prepare_homing(now, frames))
    }

    /// Starts to restore mode and torque limits of a drive that is off after a homing. Reported as
    /// [`Event::HomingLeft`] or [`Event::BootFailed`]. Returns false while another request to the drive is pending.
    pub fn leave_homing(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) -> bool {
        self.request(now, node, out, |slave, frames| slave.leave_homing(now, frames))
    }

    /// Starts to limit the torque of a drive that is off to a share of its planned limits, in ‰. Reported as
    /// [`Event::TorqueLimited`] or [`Event::BootFailed`]. Returns false while another request to the drive is pending.
    pub fn limit_torque(
        &mut self,
        now: Instant,
        node: NodeIndex,
        share: u16,
        out: &mut Vec<Telegram>,
    ) -> bool {
        self.request(now, node, out, |slave, frames| slave.limit_torque(now, share, frames))
    }

    /// Starts to end a node's monitoring of this master (1016h:1 or 100Dh and 100Ch set to zero), reported as
    /// [`Event::MonitoringEnded`] or [`Event::MonitoringKept`]. Returns false if the node is not booted or monitors
    /// nothing.
    pub fn end_monitoring(
        &mut self,
        now: Instant,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
    ) -> bool {
        self.request(now, node, out, |slave, frames| slave.end_monitoring(now, frames))
    }

    /// Indices of all nodes, those that are not booted included.
    pub fn nodes(&self) -> impl Iterator<Item = NodeIndex> + use<> {
        (0..self.slaves.len()).map(NodeIndex)
    }

    /// Stops guarding the drives: they must miss their master.
    pub fn pause_guarding(&mut self) {
        let drives = self.slaves.iter_mut().filter(|slave| slave.plan.is_drive());
        drives.for_each(Slave::pause_guarding);
    }

    /// Guards the drives again.
    pub fn resume_guarding(&mut self, now: Instant) {
        let drives = self.slaves.iter_mut().filter(|slave| slave.plan.is_drive());
        drives.for_each(|slave| slave.resume_guarding(now));
    }

    /// Starts every monitored node again, because a node may have left operational after a communication error (1029h).
    pub fn start_nodes(&self, out: &mut Vec<Telegram>) {
        let watched = self.slaves.iter().filter(|slave| slave.is_watched() && !slave.is_late);
        out.extend(watched.map(|slave| telegram(slave, NmtCommand::StartRemoteNode)));
    }

    /// Sets every node pre-operational. Call it after torque and power are off.
    pub fn enter_pre_operational(&self, out: &mut Vec<Telegram>) {
        let order = NmtCommand::EnterPreOperational;
        out.extend(self.slaves.iter().map(|slave| telegram(slave, order)));
    }

    /// Number of uploads that other clients have initiated at the nodes of this master.
    pub const fn foreign_uploads(&self) -> u32 {
        self.foreign_uploads
    }

    /// Sends or queues the frames of a request to a node. Returns false if `start` starts none.
    fn request(
        &mut self,
        now: Instant,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
        start: impl FnOnce(&mut Slave, &mut Vec<Frame>) -> bool,
    ) -> bool {
        let slave = self.slaves.get_mut(node.0);
        let is_requested = slave.is_some_and(|slave| start(slave, &mut self.frames));
        if is_requested {
            self.after(now, node, None, out);
        }
        is_requested
    }

    /// Queues an event; drops it if the queue is full.
    fn report(&mut self, event: Event) {
        if self.events.len() < MAX_QUEUED {
            self.events.push_back(event);
        }
    }
}

fn telegram(slave: &Slave, command: NmtCommand) -> Telegram {
    let frame = Order::to(slave.plan.node, command).frame();
    Telegram { channel: slave.channel, frame }
}

#[cfg(test)]
mod tests;
