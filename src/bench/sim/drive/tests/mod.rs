//! Drive on a bus, as its master sees it.

mod anything;
mod commands;
mod data_sheets;
mod encoder;
mod faults;
mod homing;
mod modes;
mod stops;

use super::*;
use canopen::drive::{Controlword, Goal, PowerStage, Statusword};
use canopen::eds::Eds;
use canopen::layout;
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::pdo::DriveSample;
use canopen::plan::{HeartbeatSettings, Identity, NodePlan};
use canopen::sync::Sync;
use units::drive::{Counts, PerMille};

const BUS: Channel = Channel(0);
const MS: Duration = Duration::from_millis(1);
const RPDO_TIMER_MS: u16 = 5;
const MASTER_LOST_MS: u16 = 22;

const ACTUATOR: ActuatorSettings = ActuatorSettings {
    counts_per_rev: 16_384.0,
    gear_ratio: -40.0,
    zero_counts: 1_200,
    rated_torque: 0.1765,
    torque_curve: [133.144, -0.393_453, 0.019_672_6],
    max_torque: 6.0,
};

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

fn drive() -> Drive {
    drive_with(EncoderKind::Absolute, &[])
}

/// Returns a drive with this encoder and these quirks.
fn drive_with(encoder: EncoderKind, quirks: &[&str]) -> Drive {
    let eds = Eds::parse(include_bytes!("../../../../../eds/frhc_drive.eds")).unwrap();
    let quirks = Quirks::new(quirks.iter().map(|quirk| quirk.parse().unwrap()));
    let settings = DriveSettings {
        channel: BUS,
        node: node(),
        dictionary: Dictionary::new(&eds, node()),
        actuator: ACTUATOR,
        encoder,
        is_prismatic: false,
        latency: Duration::from_micros(60),
        tuning: Tuning::default(),
    };
    Drive::with(settings, &quirks)
}

fn plan() -> NodePlan {
    let identity = Identity { vendor: 0x0F8C, product: 0x0402_0010, revision: 0x0001_0000 };
    let pdos = layout::per_drive(node(), Some(RPDO_TIMER_MS));
    let heartbeats = HeartbeatSettings {
        master: NodeId::new(127).unwrap(),
        master_lost_ms: MASTER_LOST_MS,
        heartbeat_ms: 25,
        node_lost_ms: 60,
    };
    NodePlan::drive("joint 3".into(), node(), identity, pdos, &heartbeats, 1_000)
}

/// Decodes TPDO1 of the layout with one frame per direction.
fn sample(data: &[u8]) -> Option<DriveSample> {
    let &[s0, s1, p0, p1, p2, p3, t0, t1] = data else { return None };
    Some(DriveSample {
        statusword: Statusword(u16::from_le_bytes([s0, s1])),
        position: Counts(i32::from_le_bytes([p0, p1, p2, p3])),
        torque: PerMille(i16::from_le_bytes([t0, t1])),
    })
}

/// Drive and its master's end of the bus.
struct Wire {
    drive: Drive,
    /// Motor values; the motor applies the torque demand.
    motor: MotorReading,
    now: Instant,
    stage: PowerStage,
    sample: DriveSample,
    emergencies: Vec<Frame>,
}

impl Wire {
    fn new() -> Self {
        Self::with_drive(drive())
    }

    fn with_drive(drive: Drive) -> Self {
        Self {
            drive,
            motor: MotorReading { temperature: 25.0, ..MotorReading::default() },
            now: Instant::ZERO,
            stage: PowerStage::default(),
            sample: DriveSample::default(),
            emergencies: Vec::new(),
        }
    }

    /// Boots a drive without quirks by the real master.
    fn booted() -> Self {
        Self::new().boot()
    }

    /// Boots the drive by the real master.
    fn boot(self) -> Self {
        let mut wire = self;
        let mut master = Master::new(vec![(BUS, plan())]);
        for _ in 0..5_000 {
            let (mut sent, mut event) = (Vec::new(), None);
            while let Some(due) = master.deadline().filter(|due| *due <= wire.now) {
                event = master.on_time(wire.now.max(due), &mut sent).or(event);
            }
            let mut answers = Vec::new();
            wire.drive.on_time(wire.now, &mut answers);
            while !sent.is_empty() || !answers.is_empty() {
                for Telegram { channel, frame } in sent.drain(..) {
                    wire.drive.on_frame(wire.now, channel, &frame, &mut answers);
                }
                for answer in answers.drain(..) {
                    event = master.on_frame(wire.now, &answer, &mut sent).or(event);
                }
            }
            match event {
                Some(Event::Booted) => return wire,
                Some(Event::BootFailed(error)) => panic!("{error}"),
                _ => wire.now = wire.now + MS,
            }
        }
        panic!("neither booted nor failed");
    }

    /// Returns whether the drive demands torque.
    fn has_torque(&self) -> bool {
        self.drive.demand().abs() > 0.0
    }

    /// Sends a frame to the drive.
    fn send(&mut self, frame: Frame) {
        let mut sent = Vec::new();
        self.drive.on_frame(self.now, BUS, &frame, &mut sent);
        self.receive(&sent);
    }

    /// Updates the motor: it applies the torque demand.
    fn update_motor(&mut self) {
        self.motor.per_mille = self.drive.demand();
        self.drive.sense(&self.motor);
    }

    /// Advances by 1 ms.
    fn step(&mut self) {
        self.now = self.now + MS;
        self.update_motor();
        let mut sent = Vec::new();
        self.drive.on_time(self.now, &mut sent);
        self.receive(&sent);
    }

    fn receive(&mut self, sent: &[Telegram]) {
        for Telegram { frame, .. } in sent {
            match frame.cob_id {
                // Before it is mapped, it holds the statusword only.
                0x183 => {
                    self.sample = sample(frame.data()).unwrap_or(self.sample);
                }
                0x083 => self.emergencies.push(*frame),
                _ => {}
            }
        }
    }

    fn write(&mut self, object: Object, bytes: [u8; 2]) {
        let [low, high] = object.index.to_le_bytes();
        self.send(Frame::new(0x603, [0x2B, low, high, 0, bytes[0], bytes[1], 0, 0]));
        assert_eq!(self.drive.dictionary().get(object), Some(&bytes[..]));
    }

    /// Runs a cycle of 1 ms: SYNC, TPDO, and the RPDO for the next cycle.
    fn cycle(&mut self, goal: Goal, torque: i16) {
        self.send(Sync::default().frame());
        self.step();
        let controlword = self.stage.controlword(self.sample.statusword.state(), goal);
        let [c0, c1] = controlword.0.to_le_bytes();
        let [t0, t1] = torque.to_le_bytes();
        self.send(Frame::new(0x203, [c0, c1, t0, t1]));
    }

    /// Boots and enables a drive without quirks with this target torque.
    fn enabled_with(torque: i16) -> Self {
        Self::booted().enable(torque)
    }

    /// Enables the drive with this target torque.
    fn enable(self, torque: i16) -> Self {
        let mut wire = self;
        for _ in 0..10 {
            wire.cycle(Goal::OperationEnabled, torque);
        }
        assert_eq!(wire.drive.state(), State::OperationEnabled);
        wire
    }

    /// Runs `ms` cycles with the same frames.
    fn feed(&mut self, ms: usize, word: Controlword, torque: i16) {
        for _ in 0..ms {
            self.send(Frame::new(0x77F, [5]));
            let ([c0, c1], [t0, t1]) = (word.0.to_le_bytes(), torque.to_le_bytes());
            self.send(Frame::new(0x203, [c0, c1, t0, t1]));
            self.send(Sync::default().frame());
            self.step();
        }
    }

    /// Writes the mode of operation.
    fn set_mode(&mut self, mode: u8) {
        self.send(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, mode, 0, 0, 0]));
    }

    /// Returns the statusword in the dictionary.
    fn statusword(&self) -> Statusword {
        Statusword(self.drive.dictionary().i16(Object::STATUSWORD).cast_unsigned())
    }

    /// Returns error code and error register of each EMCY.
    fn emcy_codes(&self) -> Vec<(u16, u8)> {
        let bytes = self.emergencies.iter().map(|frame| frame.data().to_vec());
        bytes.map(|data| (u16::from_le_bytes([data[0], data[1]]), data[2])).collect()
    }
}
