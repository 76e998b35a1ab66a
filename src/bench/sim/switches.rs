//! Switch box of the operator: a CiA 401 module with a byte of digital inputs, and the lever of a gripper.
//!
//! [`Input`](faults::Input) has the wiring of the bits. The lever is wired to every analogue input of the box.

use std::time::Duration;

use canopen_rs::NmtCommand;

use canopen::NodeId;
use canopen::frame::{Channel, Frame, Telegram};
use canopen::nmt::Order;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use canopen_device::station::{Station, earlier};
use canopen_device::{Application, Device, Reset};
use units::time::Instant;

/// Simulated switch box.
#[derive(Clone, Debug)]
pub struct SwitchBox {
    channel: Channel,
    is_plugged: bool,
    device: Device<Inputs>,
    frames: Vec<Frame>,
}

/// Levels of the inputs: the digital ones, and that of the lever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Inputs {
    digital: u8,
    lever: i16,
}

impl Application for Inputs {
    fn on_reset(&mut self, dictionary: &mut Dictionary, _reset: Reset) {
        self.show(dictionary);
    }
}

impl Inputs {
    fn show(self, dictionary: &mut Dictionary) {
        dictionary.set(Object::DIGITAL_INPUTS, &[self.digital]);
        for number in 1..=ANALOGUE_INPUTS {
            dictionary.set(Object::analogue_input(number), &self.lever.to_le_bytes());
        }
    }
}

impl SwitchBox {
    /// Creates a box at power-up, with all inputs low.
    pub fn new(channel: Channel, node: NodeId, dictionary: Dictionary) -> Self {
        let device = Device::new(node, dictionary, Inputs::default(), Duration::ZERO);
        Self { channel, is_plugged: true, device, frames: Vec::with_capacity(FRAMES) }
    }

    /// Disconnects the box from its bus.
    pub const fn unplug(&mut self) {
        self.is_plugged = false;
    }

    /// Connects the box and cycles its power: it boots.
    pub fn switch_on(&mut self, now: Instant) {
        self.is_plugged = true;
        let power_up = Order::to(self.node(), NmtCommand::ResetNode).frame();
        self.device.on_frame(now, &power_up, &mut self.frames);
    }

    /// Sends an EMCY for a transient condition; `register` has its bits of 1001h.
    pub fn report_transient_error(&mut self, code: u16, register: u8) {
        self.device.report_transient_error(code, register);
    }

    /// Returns the CAN bus.
    pub const fn channel(&self) -> Channel {
        self.channel
    }

    /// Returns the object dictionary.
    pub const fn dictionary(&self) -> &Dictionary {
        self.device.dictionary()
    }

    /// Returns the node-id.
    pub const fn node(&self) -> NodeId {
        self.device.node()
    }

    /// Sets the digital inputs, the first one in bit 0.
    pub fn set(&mut self, inputs: u8) {
        self.update(Inputs { digital: inputs, ..*self.device.application() });
    }

    /// Sets the analogue inputs, in counts.
    pub fn set_lever(&mut self, counts: i16) {
        self.update(Inputs { lever: counts, ..*self.device.application() });
    }

    fn update(&mut self, inputs: Inputs) {
        if *self.device.application() != inputs {
            self.device.touch(|terminals, dictionary| {
                *terminals = inputs;
                terminals.show(dictionary);
            });
        }
    }
}

/// Maximum number of analogue inputs that the lever is wired to.
const ANALOGUE_INPUTS: u8 = 8;

/// Capacity of the frame buffer.
const FRAMES: usize = 8;

impl Station for SwitchBox {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if channel == self.channel && self.is_plugged {
            self.device.on_frame(now, frame, &mut self.frames);
            self.send(out);
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        self.device.on_time(now, &mut self.frames);
        self.send(out);
    }

    fn deadline(&self) -> Option<Instant> {
        let unsent = (!self.frames.is_empty()).then_some(Instant::ZERO);
        earlier(unsent, self.device.deadline())
    }
}

impl SwitchBox {
    fn send(&mut self, out: &mut Vec<Telegram>) {
        let channel = self.channel;
        let sent = self.frames.drain(..).filter(|_| self.is_plugged);
        out.extend(sent.map(|frame| Telegram { channel, frame }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::eds::Eds;

    const BUS: Channel = Channel(1);

    /// Returns a box configured as by the master, and operational.
    fn switch_box() -> SwitchBox {
        let eds = Eds::parse(include_bytes!("../../../eds/frhc_switches.eds")).unwrap();
        let node = NodeId::new(16).unwrap();
        let mut switches = SwitchBox::new(BUS, node, Dictionary::new(&eds, node));
        let mut out = Vec::new();
        switches.on_time(Instant::ZERO, &mut out);
        for (object, value) in canopen::layout::switches(node, Some(1))
            .iter()
            .filter(|pdo| pdo.service.is_some())
            .flat_map(canopen::layout::Pdo::writes)
        {
            let bytes = canopen::sdo::bytes(&value);
            let [low, high] = object.index.to_le_bytes();
            let mut request = [0x23, low, high, object.sub, 0, 0, 0, 0];
            request[0] |= u8::try_from(4 - bytes.len()).unwrap() << 2;
            request[4..4 + bytes.len()].copy_from_slice(&bytes);
            out.clear();
            switches.on_frame(Instant::ZERO, BUS, &Frame::new(0x610, request), &mut out);
            assert_eq!(out[0].frame.data()[0], 0x60, "{object}");
        }
        switches.on_frame(Instant::ZERO, BUS, &Frame::new(0, [1, 0]), &mut out);
        switches
    }

    /// Returns the times and input bytes of its TPDOs until `until`.
    fn sent(switches: &mut SwitchBox, from: u64, until: u64) -> Vec<(u64, u8)> {
        let (mut now, mut all) = (from, Vec::new());
        while let Some(due) =
            switches.deadline().map(Instant::as_micros).filter(|due| *due <= until)
        {
            now = now.max(due);
            let mut out = Vec::new();
            switches.on_time(Instant::from_micros(now), &mut out);
            all.extend(out.iter().map(|telegram| (now, telegram.frame.data()[0])));
            assert!(out.iter().all(|sent| sent.channel == BUS && sent.frame.cob_id == 0x190));
        }
        all
    }

    #[test]
    fn changes_are_sent_at_once_and_inputs_every_5_ms() {
        let mut switches = switch_box();
        assert_eq!(sent(&mut switches, 0, 11_000), [(5_000, 0), (10_000, 0)]);
        switches.set(2);
        assert_eq!(sent(&mut switches, 12_000, 16_999), [(12_000, 2)]);
        switches.set(2);
        assert_eq!(sent(&mut switches, 16_999, 17_000), [(17_000, 2)], "no change, but due");
    }

    #[test]
    fn bouncing_switch_is_sent_once_per_ms_at_most() {
        let mut switches = switch_box();
        let mut count = 0;
        for now in 20_000..24_000 {
            switches.set(u8::from(now % 2 == 0));
            count += sent(&mut switches, now, now).len();
        }
        assert_eq!(count, 4);
    }

    #[test]
    fn lever_follows_the_digital_inputs_in_their_frame() {
        let mut switches = switch_box();
        switches.set(0b10);
        switches.set_lever(-2);
        let mut out = Vec::new();
        switches.on_time(Instant::from_micros(20_000), &mut out);
        assert_eq!(out[0].frame.data(), [0b10, 0xFE, 0xFF]);
    }

    #[test]
    fn frames_of_another_bus_are_ignored() {
        let mut switches = switch_box();
        let mut out = Vec::new();
        let reset = Frame::new(0, [0x81, 0]);
        switches.on_frame(Instant::ZERO, Channel(0), &reset, &mut out);
        assert_eq!(out, []);
    }
}
