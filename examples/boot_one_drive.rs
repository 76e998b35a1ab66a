//! Boots one simulated drive as a CANopen master does, and prints the frames on the bus.
//!
//! `cargo run --release --example boot_one_drive`
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;
use std::time::Duration;

use bus::{Bus, BusEvent, ReceivedEvent, Tap};
use canopen::eds::Eds;
use canopen::frame::{Channel, Telegram};
use canopen::master::Master;
use canopen::plan::{HeartbeatSettings, Identity, NodePlan};
use canopen::{NodeId, layout};
use canopen_device::dictionary::Dictionary;
use memory_bus::Memory;
use sim::actuator::ActuatorSettings;
use sim::drive::{Drive, DriveSettings, EncoderKind};
use sim::motion::Tuning;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Prints each frame in the format of candump.
struct Print;

impl Tap for Print {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        let micros = at.as_micros();
        println!("({}.{:06}) can0 {}", micros / 1_000_000, micros % 1_000_000, telegram.frame);
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // The drive: its EDS, and its motor.
    let eds = Eds::parse(include_bytes!("../eds/frhc_drive.eds"))?;
    let node = NodeId::new(5).ok().ok_or("1 to 127")?;
    let drive = Drive::new(DriveSettings {
        channel: Channel(0),
        node,
        dictionary: Dictionary::new(&eds, node),
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
        latency: Duration::from_micros(100),
        tuning: Tuning::default(),
    });
    let mut bus = Memory::new(&[1_000_000], drive, Print);

    // The plan: expected identity, PDOs with an event timer of 5 ms, heartbeats, at most 100 % of rated torque.
    let identity = Identity { vendor: 0x0F8C, product: 0x0402_0010, revision: 0x0001_0000 };
    let heartbeats = HeartbeatSettings {
        master: NodeId::new(127).ok().ok_or("1 to 127")?,
        master_lost_ms: 22,
        heartbeat_ms: 25,
        node_lost_ms: 60,
    };
    let plan = NodePlan::drive(
        "elbow".to_owned(),
        node,
        identity,
        layout::per_drive(node, Some(5)),
        &heartbeats,
        1_000,
    );

    // The master does no I/O: frames and time in, frames and events out.
    let mut master = Master::new(vec![(Channel(0), plan)]);
    let mut out = Vec::new();
    while master.is_booting() {
        let until = master.deadline().unwrap_or(bus.now() + Duration::from_millis(10));
        let event = match bus.receive(until) {
            Some(ReceivedEvent { at, channel, event: BusEvent::Frame(frame) }) => {
                master.on_frame(at, &Telegram { channel, frame }, &mut out)
            }
            Some(_) => None,
            None => master.on_time(bus.now(), &mut out),
        };
        if let Some(event) = event {
            println!("# {event}");
        }
        for telegram in out.drain(..) {
            bus.send(telegram)?;
        }
    }
    println!("# {:?}", master.health(NodeIndex(0)));
    Ok(())
}
