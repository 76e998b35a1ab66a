//! The operator's switch box: a CiA 401 input module of one byte.
//!
//! What the bits mean is in [`SwitchInputs`](crate::canopen::pdo::SwitchInputs).

use std::time::Duration;

use crate::canopen::NodeId;
use crate::canopen::device::Application;
use crate::canopen::device::Device;
use crate::canopen::device::Reset;
use crate::canopen::dictionary::Dictionary;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::object::Object;
use crate::canopen::station::Station;
use crate::time::Instant;

/// One switch box.
#[derive(Clone, Debug)]
pub struct SwitchBox {
    channel: Channel,
    device: Device<Inputs>,
    frames: Vec<Frame>,
}

/// The levels at its terminals.
#[derive(Clone, Copy, Debug, Default)]
struct Inputs(u8);

impl Application for Inputs {
    fn on_reset(&mut self, dictionary: &mut Dictionary, _reset: Reset) {
        self.show(dictionary);
    }
}

impl Inputs {
    fn show(self, dictionary: &mut Dictionary) {
        dictionary.set(Object::DIGITAL_INPUTS, &[self.0]);
    }
}

impl SwitchBox {
    /// A box that is switched on, with every input low.
    pub fn new(channel: Channel, node: NodeId, dictionary: Dictionary) -> Self {
        let device = Device::new(node, dictionary, Inputs::default(), Duration::ZERO);
        Self { channel, device, frames: Vec::with_capacity(FRAMES) }
    }

    /// Where it is.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// The levels at its terminals become `inputs`, the first one bit 0.
    pub fn set(&mut self, inputs: u8) {
        if self.device.application().0 != inputs {
            self.device.touch(|terminals, dictionary| {
                *terminals = Inputs(inputs);
                terminals.show(dictionary);
            });
        }
    }
}

/// Room for what a device says at once.
const FRAMES: usize = 8;

impl Station for SwitchBox {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel {
            self.device.on_frame(now, frame, &mut self.frames);
            out.extend(self.frames.drain(..).map(|frame| Telegram { channel, frame }));
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        self.device.on_time(now, &mut self.frames);
        out.extend(self.frames.drain(..).map(|frame| Telegram { channel, frame }));
    }

    fn deadline(&self) -> Option<Instant> {
        self.device.deadline()
    }
}
