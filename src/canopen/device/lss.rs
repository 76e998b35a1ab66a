//! The layer settings of a device: what its LSS slave (CiA 305) lets it be, hear and say.
//!
//! Without a node-id it says nothing, not even that it boots up, and hears nothing but LSS. While its bit
//! rate changes it hears and says nothing at all. A simulated bus has one bit rate for all, so a device is
//! heard again whichever it was given.

use std::time::Duration;

use canopen_rs::NodeId;

use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Frame;
use crate::canopen::lss::Address;
use crate::canopen::lss::BitRate;
use crate::canopen::lss::REQUEST_COB_ID;
use crate::canopen::lss::slave::Effect;
use crate::canopen::lss::slave::Slave;
use crate::canopen::object::Object;
use crate::time::Instant;

/// What one device is set to.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    slave: Slave,
    /// Until then the bit rate changes.
    changing: Option<Instant>,
}

impl Layer {
    /// Of a device that was delivered with a node-id, and the identity in its dictionary.
    pub(super) fn new(node: NodeId, dictionary: &Dictionary) -> Self {
        let address = Address {
            vendor: dictionary.unsigned(Object::VENDOR_ID),
            product: dictionary.unsigned(Object::PRODUCT_CODE),
            revision: dictionary.unsigned(Object::REVISION),
            serial: dictionary.unsigned(Object::SERIAL),
        };
        Self { slave: Slave::new(address, Some(node)), changing: None }
    }

    /// The node-id it has now.
    pub(super) const fn node(&self) -> Option<NodeId> {
        self.slave.node()
    }

    /// The bit rate it was configured for, `None` before.
    pub(super) const fn bit_rate(&self) -> Option<BitRate> {
        self.slave.bit_rate()
    }

    /// A bit rate that has changed by now has changed.
    pub(super) fn wake(&mut self, now: Instant) {
        self.changing.take_if(|until| *until <= now);
    }

    /// Why it does not speak, `None` if it does.
    pub(super) fn silence(&self) -> Option<Silence> {
        let unconfigured = self.node().is_none().then_some(Silence::Unconfigured);
        self.changing.map(Silence::Until).or(unconfigured)
    }

    /// Takes a frame that is of LSS; true if the device must reset its communication.
    pub(super) fn on_frame(&mut self, now: Instant, frame: &Frame, out: &mut Vec<Frame>) -> bool {
        match self.slave.on_frame(frame, out) {
            Some(Effect::Reset) => true,
            Some(Effect::BitRate(delay)) => {
                self.changing = (delay > Duration::ZERO).then_some(now + delay * 2);
                false
            }
            None => false,
        }
    }

    /// Communication is reset: the configured node-id becomes its own.
    pub(super) const fn reset(&mut self) {
        self.slave.reset();
    }

    /// Power is lost and comes back.
    pub(super) const fn power_cycle(&mut self) {
        self.slave.power_cycle();
        self.changing = None;
    }
}

/// Why a device does not speak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Silence {
    /// Its bit rate changes.
    Until(Instant),
    /// It has no node-id.
    Unconfigured,
}

impl Silence {
    /// When it ends by itself.
    pub(super) const fn end(self) -> Option<Instant> {
        match self {
            Self::Until(end) => Some(end),
            Self::Unconfigured => None,
        }
    }
}

/// Whether a frame is one of LSS for slaves.
pub(super) const fn is_request(frame: &Frame) -> bool {
    frame.cob_id == REQUEST_COB_ID
}
