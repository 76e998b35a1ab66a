//! Values stored in a drive at delivery: nameplate of motor and encoder, factor group, and objects without a default.
//!
//! A maker's tool stores them in a real drive. They survive resets; 1011h restores the defaults of the data sheet.

use crate::actuator::ActuatorSettings;
use crate::drive::status::natural;
use canopen::nameplate::units::SiUnit;
use canopen::object::Object;
use canopen_device::dictionary::{Dictionary, Entry};

/// Stores nameplate and factor group. One position unit is an encoder increment, gear and feed included.
pub(super) fn store(actuator: &ActuatorSettings, dictionary: &mut Dictionary) {
    let increments = natural(actuator.counts_per_rev);
    for (object, value) in [
        (Object::RATED_TORQUE, actuator.rated_millis()),
        (Object::ENCODER_INCREMENTS, increments),
        (Object::ENCODER_REVOLUTIONS, 1),
        (Object::VELOCITY_INCREMENTS, increments),
        (Object::VELOCITY_REVOLUTIONS, 1),
        (Object::FEED, increments),
        (Object::FEED_REVOLUTIONS, 1),
        (Object::POSITION_UNIT, SiUnit::INCREMENTS.0),
        (Object::VELOCITY_UNIT, SiUnit::RPM.0),
    ] {
        store_number(dictionary, object, value);
    }
    let modes = supported_modes(dictionary);
    for (object, value) in [
        (Object::DEVICE_TYPE, SERVO_DRIVE),
        (Object::SUPPORTED_MODES, modes),
        (Object::RATED_CURRENT, RATED_CURRENT_MA),
        (Object::GEAR_MOTOR_REVOLUTIONS, 1),
        (Object::GEAR_SHAFT_REVOLUTIONS, 1),
    ] {
        store_if_blank(dictionary, object, value);
    }
    for limit in LIMITS {
        let most = dictionary.entry(limit).and_then(|entry| entry.high);
        let most =
            most.and_then(|most| u32::try_from(most).ok()).unwrap_or(i32::MAX.unsigned_abs());
        store_if_blank(dictionary, limit, most);
    }
    accept_heartbeat_consumers(dictionary);
}

/// Removes limits of 1016h that exclude every entry with a node-id: an error of data sheets, not of drives.
fn accept_heartbeat_consumers(dictionary: &mut Dictionary) {
    for sub in 1..=u8::MAX {
        let object = Object { sub, ..Object::CONSUMER_HEARTBEAT };
        let Some(entry) = dictionary.entry(object) else { return };
        if entry.high.is_some_and(|high| high < LEAST_CONSUMER) {
            dictionary.remove_limits(object);
        }
    }
}

/// Smallest entry of 1016h that is used: node-id 1, 1 ms.
const LEAST_CONSUMER: i128 = 0x0001_0001;

/// Limits for which zero means not configured.
const LIMITS: [Object; 6] = [
    Object::MAX_TORQUE,
    Object::MAX_CURRENT,
    Object::MAX_MOTOR_SPEED,
    Object::MAX_PROFILE_VELOCITY,
    Object::POSITIVE_TORQUE_LIMIT,
    Object::NEGATIVE_TORQUE_LIMIT,
];

/// Device type (1000h): servo drive by CiA 402.
const SERVO_DRIVE: u32 = 0x0002_0192;

/// Rated current (6075h) where the data sheet has none, in mA. A configuration has no currents.
const RATED_CURRENT_MA: u32 = 1_000;

/// Modes of the simulation (6060h), each with the set-point that it needs.
const MODES: [(u32, Object); 7] = [
    (1, Object::TARGET_POSITION),
    (3, Object::TARGET_VELOCITY),
    (4, Object::TARGET_TORQUE),
    (6, Object::HOMING_METHOD),
    (8, Object::TARGET_POSITION),
    (9, Object::TARGET_VELOCITY),
    (10, Object::TARGET_TORQUE),
];

/// Returns 6502h of a drive with the set-points in `dictionary`.
fn supported_modes(dictionary: &Dictionary) -> u32 {
    let modes = MODES.iter().filter(|(_, target)| dictionary.entry(*target).is_some());
    modes.fold(0, |modes, (mode, _)| modes | 1 << (mode - 1))
}

/// Stores the low bytes of a number, within the largest of a signed object. An absent object stays absent.
fn store_number(dictionary: &mut Dictionary, object: Object, value: u32) {
    let Some(size) = dictionary.entry(object).and_then(Entry::size) else {
        return;
    };
    let most = if size < 4 { (1 << (8 * size - 1)) - 1 } else { u32::MAX };
    dictionary.set_default_number(object, value.min(most));
}

fn store_if_blank(dictionary: &mut Dictionary, object: Object, value: u32) {
    if dictionary.unsigned(object) == 0 {
        store_number(dictionary, object, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::NodeId;
    use canopen::eds::Eds;

    const ACTUATOR: ActuatorSettings = ActuatorSettings {
        counts_per_rev: 4_096.0,
        gear_ratio: 50.0,
        zero_counts: 0,
        rated_torque: 0.317,
        torque_curve: [10.0, 0.0, 0.0],
        max_torque: 30.0,
    };

    fn delivered(eds: &[u8]) -> Dictionary {
        let eds = Eds::parse(eds).unwrap();
        let mut dictionary = Dictionary::new(&eds, NodeId::new(1).unwrap());
        store(&ACTUATOR, &mut dictionary);
        dictionary
    }

    #[test]
    fn nameplate_follows_the_motor_and_survives_a_reset() {
        let mut dictionary = delivered(include_bytes!("../../../../eds/frhc_drive.eds"));
        dictionary.restore(0..=u16::MAX);
        for (object, value) in [
            (Object::RATED_TORQUE, 317),
            (Object::RATED_CURRENT, 1_000),
            (Object::ENCODER_INCREMENTS, 4_096),
            (Object::ENCODER_REVOLUTIONS, 1),
            (Object::VELOCITY_INCREMENTS, 4_096),
            (Object::GEAR_MOTOR_REVOLUTIONS, 1),
            (Object::GEAR_SHAFT_REVOLUTIONS, 1),
            (Object::FEED, 4_096),
            (Object::POLARITY, 0),
            (Object::MAX_TORQUE, 3_000),
        ] {
            assert_eq!(dictionary.unsigned(object), value, "{object}");
        }
    }

    #[test]
    fn consumer_heartbeat_limited_by_a_slip_is_writable() {
        let eds = include_bytes!("../../../../eds/drives/elmo-gold.eds");
        let entry = |dictionary: &Dictionary| {
            let entry = dictionary.entry(Object::CONSUMER_HEARTBEAT).unwrap().clone();
            entry.in_range(&0x007F_0016_u32.to_le_bytes())
        };
        let as_described = Dictionary::new(&Eds::parse(eds).unwrap(), NodeId::new(1).unwrap());
        assert!(entry(&as_described).is_err());
        assert_eq!(entry(&delivered(eds)), Ok(()));
    }

    #[test]
    fn blank_values_of_real_data_sheets_are_filled() {
        let epos4 = delivered(include_bytes!("../../../../eds/drives/maxon-epos4.eds"));
        assert_eq!(epos4.unsigned(Object::DEVICE_TYPE), SERVO_DRIVE);
        assert_eq!(epos4.unsigned(Object::SUPPORTED_MODES), 0x3AD, "homing methods, so mode 6");
        assert_eq!(epos4.unsigned(Object::RATED_TORQUE), 317);
        assert!(epos4.entry(Object::ENCODER_INCREMENTS).is_none(), "absent objects stay absent");
        let nanotec = delivered(include_bytes!("../../../../eds/drives/nanotec-cl4-e.eds"));
        assert_eq!(nanotec.unsigned(Object::SUPPORTED_MODES), 0x3EF, "as its data sheet has it");
        assert_eq!(nanotec.unsigned(Object::MAX_TORQUE), 100);
        assert_eq!(nanotec.unsigned(Object::MAX_CURRENT), 0x7FFF, "blank: no limit");
        assert_eq!(nanotec.unsigned(Object::VELOCITY_INCREMENTS), 4_096);
        let epos2 = delivered(include_bytes!("../../../../eds/drives/maxon-epos2.eds"));
        assert_eq!(epos2.unsigned(Object::SUPPORTED_MODES) & 1 << 9, 0, "no 6071h, no mode 10");
    }
}
