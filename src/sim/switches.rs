//! A simulated CiA 401 input module: the operator's switches on the bus.

use std::time::Duration;

use crate::canopen::NodeId;
use crate::canopen::device::Application;
use crate::canopen::device::Device;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::object::Object;
use crate::canopen::station::Station;
use crate::time::Instant;

/// A switch box.
#[derive(Clone, Debug)]
pub struct SwitchBox {
    channel: Channel,
    device: Device<Inputs>,
    /// Whether an input has changed that no frame has told of.
    has_changed: bool,
    out: Vec<Frame>,
}

impl SwitchBox {
    /// A box that boots at the first opportunity, with all inputs clear.
    pub fn new(channel: Channel, node: NodeId, dictionary: Dictionary) -> Self {
        let device = Device::new(node, dictionary, Duration::ZERO, Inputs(0));
        Self { channel, device, has_changed: false, out: Vec::with_capacity(8) }
    }

    /// Sets the eight inputs (6000h:1).
    pub fn set(&mut self, inputs: u8) {
        if self.device.application().0 != inputs {
            self.device.touch(|application| application.0 = inputs);
            self.has_changed = true;
        }
    }

    fn send(&mut self, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        out.extend(self.out.drain(..).map(|frame| Telegram { channel, frame }));
    }
}

impl Station for SwitchBox {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel {
            self.device.on_frame(now, frame, &mut self.out);
            self.send(out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        self.has_changed = false;
        self.device.on_time(now, &mut self.out);
        self.send(out);
    }

    fn deadline(&self) -> Option<Instant> {
        if self.has_changed { Some(Instant::ZERO) } else { self.device.deadline() }
    }
}

/// Eight inputs, and nothing else to do.
#[derive(Clone, Copy, Debug)]
struct Inputs(u8);

impl Application for Inputs {
    fn refresh(&mut self, dictionary: &mut Dictionary) {
        dictionary.set(Object::DIGITAL_INPUTS, &[self.0]);
    }

    fn connection_lost(&mut self, _dictionary: &mut Dictionary) -> [u8; 5] {
        [0; 5]
    }

    fn has_fault(&self) -> bool {
        false
    }

    fn reset(&mut self, dictionary: &mut Dictionary) {
        self.refresh(dictionary);
    }
}
