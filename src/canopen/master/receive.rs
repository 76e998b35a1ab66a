//! Received frames by their sender: nodes of this master, other SDO clients, another master.

use canopen_rs::nmt::heartbeat_cob_id;

use crate::emcy::{self, Emergency};
use crate::frame::{Channel, FUNCTION_CODE, Frame, Telegram};
use crate::layout::Direction;
use crate::master::event::Event;
use crate::master::sdo_traffic::Foreign;
use crate::master::slave::Slave;
use crate::master::{Master, Phase};
use crate::{nmt, sync};
use units::numbering::NodeIndex;
use units::time::Instant;

impl Master {
    /// Returns the node that a frame of the predefined connection set comes from or goes to.
    fn place(&self, channel: Channel, frame: &Frame) -> Option<NodeIndex> {
        let node_id = frame.cob_id & !FUNCTION_CODE;
        let is_its =
            |slave: &Slave| slave.channel == channel && u16::from(slave.plan.node.raw()) == node_id;
        self.slaves.iter().position(is_its).map(NodeIndex)
    }

    /// Takes an SDO request of another client: a download shows another master, an upload is allowed.
    pub(super) fn request_of_another(&mut self, now: Instant, channel: Channel, frame: &Frame) {
        let Some(node) = self.place(channel, frame) else { return };
        let Some(slave) = self.slaves.get_mut(node.0) else { return };
        match slave.on_foreign_request(now, frame) {
            Some(Foreign::Download) => self.report(Event::ForeignMaster { channel, frame: *frame }),
            Some(Foreign::Upload) => {
                self.foreign_uploads = self.foreign_uploads.saturating_add(1);
                if slave.is_newly_read() {
                    self.report(Event::ReadByAnother { node });
                }
            }
            Some(Foreign::Other) | None => {}
        }
    }

    /// Takes an SDO reply, a heartbeat, a boot-up message or an answer to guarding.
    pub(super) fn answer(
        &mut self,
        now: Instant,
        channel: Channel,
        frame: &Frame,
        out: &mut Vec<Telegram>,
    ) {
        let Some(place) = self.place(channel, frame) else { return };
        let Some(slave) = self.slaves.get_mut(place.0) else { return };
        if slave.is_foreign_reply(now, frame) {
            return self.report(Event::ForeignMaster { channel, frame: *frame });
        }
        let report = slave.on_frame(now, frame, &mut self.frames);
        self.after(now, place, report, out);
    }

    /// Returns whether only a master sends this frame, SDO excepted: an NMT command, a SYNC or an RPDO.
    pub fn is_foreign(&self, Telegram { channel, frame }: &Telegram) -> bool {
        !frame.is_remote() && self.is_ours_alone(*channel, frame)
    }

    /// Returns whether a frame that is received before the boot is of another master: it [is foreign](Self::is_foreign), or
    /// has the COB-ID of this master's heartbeat. The heartbeat of a master with another node-id looks like that of a node.
    pub fn is_of_other_master(&self, telegram: &Telegram) -> bool {
        self.is_foreign(telegram) || self.has_own_heartbeat_id(&telegram.frame)
    }

    /// Returns whether the frame has the COB-ID of this master's heartbeat while the network runs.
    pub(super) fn is_own_heartbeat(&self, frame: &Frame) -> bool {
        self.phase == Phase::Running && self.has_own_heartbeat_id(frame)
    }

    fn has_own_heartbeat_id(&self, frame: &Frame) -> bool {
        !frame.is_remote() && self.own.is_some_and(|own| frame.cob_id == heartbeat_cob_id(own))
    }

    /// Returns whether only this master may send the frame.
    pub(super) fn is_ours_alone(&self, channel: Channel, frame: &Frame) -> bool {
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

    /// Takes an emergency at the planned COB-ID or at the default one, which holds until 1014h is written.
    pub(super) fn emergency(
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
        let plan = self.slaves.get(node.0).map(|slave| &slave.plan);
        if plan.is_some_and(|plan| emergency.is_warning(&plan.emcy_warnings)) {
            return self.report(Event::EmergencyWarning { node, emergency });
        }
        self.report(Event::Emergency { node, emergency });
        if self.reads_error_history && !emergency.is_reset() {
            self.read_error_history(now, node, out);
        }
    }
}
