//! Steps to a power stage that is off, for a drive that does not report it after "disable voltage" in its RPDO.
//!
//! Their frames precede every other request: SDO requests to the drive that still wait are dropped. The owner of the
//! [master](crate::master) decides when a step is due.

use canopen_rs::NmtCommand;
use canopen_rs::sdo::request_cob_id;

use crate::frame::{Frame, Telegram};
use crate::master::slave::Slave;
use crate::master::{Master, telegram};
use units::numbering::NodeIndex;
use units::time::Instant;

impl Master {
    /// Sends "disable voltage" (6040h = 0) to a drive by SDO at once and then reads its statusword, reported as
    /// [`Event::Statusword`](crate::master::event::Event::Statusword).
    pub fn power_off(&mut self, now: Instant, node: NodeIndex, out: &mut Vec<Telegram>) {
        self.request_at_once(node, out, |slave, frames| slave.power_off(now, frames));
    }

    /// Reads the statusword (6041h) of a drive at once, unless it is being read or the power being switched off.
    pub fn read_statusword_at_once(
        &mut self,
        now: Instant,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
    ) {
        self.request_at_once(node, out, |slave, frames| slave.read_statusword_at_once(now, frames));
    }

    /// Sets one node to NMT stopped, in which it answers no SDO. Abandons the requests to it.
    pub fn stop_node(&mut self, node: NodeIndex, out: &mut Vec<Telegram>) {
        self.drop_waiting_requests(node);
        if let Some(slave) = self.slaves.get_mut(node.0) {
            slave.abandon_requests();
            out.push(telegram(slave, NmtCommand::StopRemoteNode));
        }
    }

    /// Sets one node to NMT pre-operational.
    pub fn set_pre_operational(&self, node: NodeIndex, out: &mut Vec<Telegram>) {
        let slave = self.slaves.get(node.0);
        out.extend(slave.map(|slave| telegram(slave, NmtCommand::EnterPreOperational)));
    }

    /// Stops guarding all nodes, until the next boot.
    pub fn end_guarding(&mut self) {
        self.slaves.iter_mut().for_each(Slave::pause_guarding);
    }

    /// Starts a request whose frames are sent at once, in place of those to this node that wait.
    fn request_at_once(
        &mut self,
        node: NodeIndex,
        out: &mut Vec<Telegram>,
        start: impl FnOnce(&mut Slave, &mut Vec<Frame>),
    ) {
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        start(slave, &mut self.frames);
        if self.frames.is_empty() {
            return;
        }
        self.frames.iter().for_each(|frame| slave.on_sent(frame));
        let channel = slave.channel;
        self.drop_waiting_requests(node);
        out.extend(self.frames.drain(..).map(|frame| Telegram { channel, frame }));
    }

    /// Drops the SDO requests to a node that wait for a cycle.
    fn drop_waiting_requests(&mut self, node: NodeIndex) {
        let Some(slave) = self.slaves.get(node.0) else { return };
        let (channel, cob_id) = (slave.channel, request_cob_id(slave.plan.node));
        self.transmit_queue.retain(|it| (it.channel, it.frame.cob_id) != (channel, cob_id));
    }
}
