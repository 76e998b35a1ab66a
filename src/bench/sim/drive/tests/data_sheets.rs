//! Drives made from the data sheets of real ones: each has what its EDS has, and no more.

use super::*;
use canopen_device::ConnectionLoss;
use canopen_rs::nmt::heartbeat_cob_id;

fn drive_of(eds: &[u8], quirks: &[&str]) -> Drive {
    let eds = Eds::parse(eds).unwrap();
    let quirks = Quirks::new(quirks.iter().map(|quirk| quirk.parse().unwrap()));
    let settings = DriveSettings {
        channel: BUS,
        node: node(),
        dictionary: Dictionary::new(&eds, node()),
        actuator: ACTUATOR,
        encoder: EncoderKind::Absolute,
        is_prismatic: false,
        latency: Duration::from_micros(60),
        tuning: Tuning::default(),
    };
    Drive::with(settings, &quirks)
}

macro_rules! sheets {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_bytes!(concat!("../../../../../eds/drives/", $name, ".eds")).as_slice())),*]
    };
}

/// Drives that have a target torque (6071h) and mode 10.
const WITH_TORQUE: [(&str, &[u8]); 6] = sheets![
    "maxon-epos4",
    "maxon-epos4-50-15",
    "elmo-gold",
    "nanotec-cl4-e",
    "infranor-easy-ak",
    "eyou-euservo",
];

/// Drives with a target torque, but by 6502h of their data sheets without mode 10.
const WITHOUT_MODE_10: [(&str, &[u8]); 3] =
    sheets!["ingenia-eve-net-c", "ingenia-eve-xcr-c", "technosoft-ipos"];

/// 6502h with mode 10 and no other: a firmware that has it.
const MODE_10: &str = "stored:6502h=0x200";

/// Drive and its master's end of the bus: one frame per millisecond.
struct Line {
    drive: Drive,
    now: Instant,
    sent: Vec<Frame>,
}

impl Line {
    fn from_eds(eds: &[u8]) -> Self {
        Self::with(eds, &[])
    }

    fn with(eds: &[u8], quirks: &[&str]) -> Self {
        let mut line = Self { drive: drive_of(eds, quirks), now: Instant::ZERO, sent: Vec::new() };
        line.pass(MS);
        line
    }

    /// Lets `time` pass.
    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while let Some(due) = self.drive.deadline().filter(|due| *due <= end) {
            self.now = self.now.max(due);
            let mut out = Vec::new();
            self.drive.on_time(self.now, &mut out);
            self.sent.extend(out.into_iter().map(|telegram| telegram.frame));
        }
        self.now = end;
    }

    fn frame(&mut self, frame: &Frame) {
        let mut out = Vec::new();
        self.drive.on_frame(self.now, BUS, frame, &mut out);
        self.sent.extend(out.into_iter().map(|telegram| telegram.frame));
        self.pass(MS);
    }

    /// Writes an object by SDO; returns whether it is confirmed.
    fn write(&mut self, object: Object, bytes: &[u8]) -> bool {
        let [low, high] = object.index.to_le_bytes();
        let unused = 4 - u8::try_from(bytes.len()).unwrap();
        let mut payload = [0x23 | unused << 2, low, high, object.sub, 0, 0, 0, 0];
        payload[4..4 + bytes.len()].copy_from_slice(bytes);
        self.frame(&Frame::new(0x603, payload));
        // Event-driven TPDOs may follow.
        let reply = self.sent.iter().rfind(|frame| frame.cob_id == 0x583).unwrap();
        reply.data().starts_with(&[0x60, low, high, object.sub])
    }

    /// Enables the drive with 100 ‰ in cyclic synchronous torque mode.
    fn enable(&mut self) {
        assert!(self.write(Object::MODE_OF_OPERATION, &[10]));
        self.frame(&Frame::new(0x000, [1, 3]));
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::ENABLE_OPERATION] {
            assert!(self.write(Object::CONTROLWORD, &word.0.to_le_bytes()));
        }
        assert!(self.write(Object::TARGET_TORQUE, &[100, 0]));
    }
}

#[test]
fn real_data_sheets_make_drives_with_torque() {
    for (name, eds) in WITH_TORQUE {
        let mut line = Line::from_eds(eds);
        assert_eq!(line.drive.state(), State::SwitchOnDisabled, "{name}");
        line.enable();
        assert_eq!(line.drive.state(), State::OperationEnabled, "{name}");
        assert!((line.drive.demand() - 100.0).abs() < 1e-9, "{name}: {} ‰", line.drive.demand());
    }
}

#[test]
fn mode_10_is_refused_by_a_drive_whose_6502h_lacks_it() {
    for (name, eds) in WITHOUT_MODE_10 {
        assert!(!Line::from_eds(eds).write(Object::MODE_OF_OPERATION, &[10]), "{name}");
        let mut line = Line::with(eds, &[MODE_10]);
        line.enable();
        assert_eq!(line.drive.state(), State::OperationEnabled, "{name}");
    }
}

#[test]
fn limit_by_current_limits_the_torque() {
    let eds = include_bytes!("../../../../../eds/drives/ingenia-eve-net-c.eds");
    let mut line = Line::with(eds, &[MODE_10]);
    assert!(line.write(Object::MAX_CURRENT, &[60, 0]));
    line.enable();
    assert!((line.drive.demand() - 60.0).abs() < 1e-9);
}

#[test]
fn torque_limit_of_the_maker_is_stored() {
    let mut line = Line::from_eds(include_bytes!("../../../../../eds/drives/maxon-epos4.eds"));
    let output_current_limit: Object = "3001h:2".parse().unwrap();
    assert!(line.write(output_current_limit, &1_200_u32.to_le_bytes()));
    assert_eq!(line.drive.dictionary().unsigned(output_current_limit), 1_200);
    assert!(!line.write(output_current_limit, &5_000_u32.to_le_bytes()), "above its HighLimit");
}

#[test]
fn absent_objects_cannot_be_written() {
    let mut ingenia =
        Line::from_eds(include_bytes!("../../../../../eds/drives/ingenia-eve-net-c.eds"));
    assert!(!ingenia.write(Object::CONSUMER_HEARTBEAT, &0x007F_0016_u32.to_le_bytes()));
    assert!(!ingenia.write(Object::MAX_TORQUE, &[0, 1]));
    let mut epos4 = Line::from_eds(include_bytes!("../../../../../eds/drives/maxon-epos4.eds"));
    assert!(!epos4.write(Object::rpdo_communication(1, 5), &[8, 0]));
    assert!(!epos4.write(Object::ERROR_BEHAVIOUR, &[1]));
}

#[test]
fn life_guarding_stops_drives_without_heartbeat_consumer() {
    for eds in [
        include_bytes!("../../../../../eds/drives/ingenia-eve-net-c.eds").as_slice(),
        include_bytes!("../../../../../eds/drives/eyou-euservo.eds"),
    ] {
        let mut line = Line::with(eds, &[MODE_10]);
        assert!(line.write(Object::GUARD_TIME, &[20, 0]));
        assert!(line.write(Object::LIFE_TIME_FACTOR, &[3]));
        line.enable();
        let poll = Frame::remote(heartbeat_cob_id(node()), 1);
        line.frame(&poll);
        line.pass(Duration::from_millis(57));
        assert_eq!(line.drive.state(), State::OperationEnabled, "within the life time");
        line.pass(Duration::from_millis(3));
        assert_eq!((line.drive.state(), line.drive.demand()), (State::Fault, 0.0));
        assert_eq!(line.drive.last_error(), ConnectionLoss::Heartbeat.error_code());
    }
}

#[test]
fn sync_is_80h_where_1005h_is_absent() {
    let mut line = Line::from_eds(include_bytes!("../../../../../eds/drives/elmo-gold.eds"));
    assert!(line.drive.dictionary().entry(Object::SYNC_COB_ID).is_none());
    let cob_id = Object::tpdo_communication(1, 1);
    assert!(line.write(cob_id, &0x8000_0183_u32.to_le_bytes()));
    assert!(line.write(Object::tpdo_mapping(1, 0), &[1]));
    assert!(line.write(Object::tpdo_communication(1, 2), &[1]));
    assert!(line.write(cob_id, &0x0000_0183_u32.to_le_bytes()));
    line.frame(&Frame::new(0x000, [1, 3]));
    let before = line.sent.len();
    line.frame(&Frame::new(0x080, []));
    assert!(line.sent.iter().skip(before).any(|frame| frame.cob_id == 0x183));
}

#[test]
fn delivered_polarity_of_80h_is_stored_whole() {
    let eds = Eds::parse(include_bytes!("../../../../../eds/frhc_drive.eds")).unwrap();
    let settings = DriveSettings {
        channel: BUS,
        node: node(),
        dictionary: Dictionary::new(&eds, node()),
        actuator: ACTUATOR,
        encoder: EncoderKind::Absolute,
        is_prismatic: false,
        latency: Duration::ZERO,
        tuning: Tuning::default(),
    };
    let delivery = Delivery { stored: vec![(Object::POLARITY, 0x80)], ..Delivery::default() };
    let drive = Drive::delivered(settings, &delivery, &Quirks::default());
    assert_eq!(drive.dictionary().unsigned(Object::POLARITY), 0x80);
}
