//! Effects of LSS on the device.

use crate::lss::BitRate;
use crate::lss::layer::Silence;
use crate::sdo_server::SdoServer;
use crate::{Application, Device, Reset};
use canopen::frame::Frame;
use units::time::Instant;

impl<A: Application> Device<A> {
    /// Returns whether the device has a node-id.
    pub const fn is_configured(&self) -> bool {
        self.layer.node().is_some()
    }

    /// Bit rate configured by LSS; `None` without a configuration.
    pub const fn bit_rate(&self) -> Option<BitRate> {
        self.layer.bit_rate()
    }

    /// Cycles the power. The device boots up with the next call of [`on_time`](Self::on_time), with the stored
    /// node-id.
    pub fn power_cycle(&mut self) {
        self.layer.power_cycle();
        self.adopt_node();
        self.dictionary.restore(0..=u16::MAX);
        self.initialise(Reset::Node);
        self.update_deadline();
    }

    /// Takes over the active node-id; default COB-IDs follow it.
    pub(crate) fn adopt_node(&mut self) {
        let Some(node) = self.layer.node().filter(|node| *node != self.node) else { return };
        self.dictionary.readdress(self.node, node);
        self.sdo = SdoServer::new(node);
        self.node = node;
    }

    /// Takes an LSS frame: in every state (CiA 305) and without a node-id, but not during a bit rate change.
    pub(crate) fn on_lss(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) {
        let is_switching = matches!(self.layer.silence(), Some(Silence::Until(end)) if now < end);
        if !is_switching && self.layer.on_frame(now, frame, out) {
            self.reset(now, Reset::Communication, out);
        }
    }
}
