//! One simulated drive alone on a bus, and SDO transfers with it.

use std::time::Duration;

use bus::{Bus, BusEvent, Tap};
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::{Channel, Frame, Telegram};
use canopen::sdo::{Outcome, Transfer};
use canopen_device::dictionary::Dictionary;
use memory_bus::Memory;
use sim::actuator::ActuatorSettings;
use sim::drive::{Drive, DriveSettings, EncoderKind};
use sim::motion::Tuning;

/// Pause before a frame is offered again after the transmit queue was full.
const RETRY_AFTER: Duration = Duration::from_micros(50);

pub(crate) fn node() -> NodeId {
    NodeId::new(5).unwrap()
}

/// Returns a drive before its boot-up.
pub(crate) fn drive() -> Drive {
    let eds = Eds::parse(include_bytes!("../../eds/frhc_drive.eds")).unwrap();
    Drive::new(DriveSettings {
        channel: Channel(0),
        node: node(),
        dictionary: Dictionary::new(&eds, node()),
        actuator: ActuatorSettings {
            counts_per_rev: 4096.0,
            gear_ratio: 50.0,
            zero_counts: 0,
            rated_torque: 0.3,
            torque_curve: [10.0, 0.0, 0.0],
            max_torque: 30.0,
        },
        encoder: EncoderKind::Absolute,
        is_prismatic: false,
        latency: Duration::ZERO,
        tuning: Tuning::default(),
    })
}

/// Runs a transfer to its end; `out` has its first requests.
pub(crate) fn carry<T: Tap>(
    bus: &mut Memory<Drive, T>,
    mut transfer: Transfer,
    mut out: Vec<Frame>,
) -> Outcome {
    loop {
        let is_accepted = |frame: &Frame, bus: &mut Memory<_, _>| {
            bus.send(Telegram { channel: Channel(0), frame: *frame }).is_ok()
        };
        let count = out.iter().take_while(|frame| is_accepted(frame, bus)).count();
        out.drain(..count);
        let retry = bus.now() + RETRY_AFTER;
        let until = if out.is_empty() { transfer.deadline().unwrap() } else { retry };
        let outcome = match bus.receive(until).map(|received| (received.at, received.event)) {
            Some((at, BusEvent::Frame(frame))) => transfer.on_frame(at, &frame, &mut out),
            Some((_, BusEvent::Error(_))) => None,
            // Segments wait for room in the queue.
            None if out.is_empty() => transfer.on_time(bus.now(), &mut out),
            None => None,
        };
        if let Some(outcome) = outcome {
            for frame in out {
                bus.send(Telegram { channel: Channel(0), frame }).unwrap();
            }
            // Frames on the wire arrive.
            while bus.receive(bus.now() + Duration::from_millis(5)).is_some() {}
            return outcome;
        }
    }
}
