//! Devices without an application on a bus in memory, and a session of the bench tools.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use cli::live_bus::Session;

use super::bench::Wire;
use bus::Bus;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::{Channel, Frame, Telegram};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use canopen_device::station::Station;
use canopen_device::{Application, Device};
use canopen_tools::diagnostics::network_monitor::NetworkMonitor;
use memory_bus::Memory;
use units::time::Instant;

/// Application that only resets a written max motor speed to 0.
#[derive(Clone, Debug)]
pub(crate) struct Idle;

impl Application for Idle {
    fn written(&mut self, dictionary: &mut Dictionary, object: Object) {
        if object == Object::MAX_MOTOR_SPEED {
            dictionary.set(object, &[0; 4]);
        }
    }
}

/// Devices on one bus, with the dictionary of the shipped drive.
#[derive(Debug, Default)]
pub(crate) struct Devices(pub(crate) Vec<Device<Idle>>);

impl Devices {
    /// Devices from pairs of node-id and serial number.
    pub(crate) fn from_numbers(numbers: &[(u8, u32)]) -> Self {
        let eds = Eds::parse(&std::fs::read("eds/frhc_drive.eds").unwrap()).unwrap();
        let device = |(node, serial): &(u8, u32)| {
            let node = NodeId::new(*node).unwrap();
            let mut dictionary = Dictionary::new(&eds, node);
            assert!(dictionary.set_default(Object::SERIAL, &serial.to_le_bytes()));
            Device::new(node, dictionary, Idle, Duration::ZERO)
        };
        Self(numbers.iter().map(device).collect())
    }
}

impl Station for Devices {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        for device in &mut self.0 {
            let mut frames = Vec::new();
            device.on_frame(now, frame, &mut frames);
            out.extend(frames.into_iter().map(|frame| Telegram { channel, frame }));
        }
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        for device in
            self.0.iter_mut().filter(|device| device.deadline().is_some_and(|due| due <= now))
        {
            let mut frames = Vec::new();
            device.on_time(now, &mut frames);
            let channel = Channel(0);
            out.extend(frames.into_iter().map(|frame| Telegram { channel, frame }));
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.0.iter().filter_map(Device::deadline).min()
    }
}

/// Session on a bus of 1 Mbit/s with devices after their boot-up, and the frames since then.
pub(crate) fn session(devices: Devices) -> (Session<Memory<Devices, Wire>>, Wire) {
    let wire = Wire::default();
    let mut bus = Memory::new(&[1_000_000], devices, wire.clone());
    while bus.receive(Instant::from_micros(10_000)).is_some() {}
    wire.clear();
    (Session::new(bus, Channel(0), Arc::<AtomicBool>::default()), wire)
}

/// Waits a millisecond, so that the last frames are sent and received.
pub(crate) fn settle(session: &mut Session<Memory<Devices, Wire>>) {
    let until = session.now() + Duration::from_millis(1);
    let mut listening = NetworkMonitor::new(Duration::from_secs(1), Some(until));
    while session.resume(&mut listening).unwrap().is_some() {}
}
