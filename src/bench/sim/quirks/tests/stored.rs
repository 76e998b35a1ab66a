//! Behaviour of a drive with wrong values stored in its nameplate.

use super::*;

#[test]
fn stored_values_survive_resets_and_turn_the_encoder() {
    let turned = |names: &[&str]| {
        let mut drive = drive(names);
        let resets = [0x82, 0x81].map(|command| Frame::new(0x000, [command, 3]));
        let received: Vec<_> = (1..).map(ms).zip(resets).collect();
        sent(&mut drive, &received, ms(5));
        drive.sense(&MotorReading { position: std::f64::consts::TAU, ..MotorReading::default() });
        drive.dictionary().unsigned(Object::POSITION_ACTUAL).cast_signed()
    };
    assert_eq!(turned(&[]), 204_800);
    assert_eq!(turned(&["polarity-reversed"]), -204_800);
    assert_eq!(turned(&["stored:607Eh=0x40"]), 204_800, "velocities only");
    assert_eq!(turned(&["stored"]), 102_400);
    assert_eq!(turned(&["stored:608Fh:1=2048"]), 409_600);
    assert_eq!(turned(&["stored:6092h:1=8192"]), 409_600);
}

#[test]
fn velocity_resolution_stored_wrong_scales_velocities_only() {
    let shown = |names: &[&str]| {
        let mut drive = drive(names);
        sent(&mut drive, &[], ms(5));
        let turn = std::f64::consts::TAU;
        drive.sense(&MotorReading { position: turn, velocity: turn, ..MotorReading::default() });
        [Object::POSITION_ACTUAL, Object::VELOCITY_ACTUAL].map(|it| drive.dictionary().unsigned(it))
    };
    assert_eq!(shown(&[]), [204_800, 204_800]);
    assert_eq!(shown(&["stored:6090h:1=8192"]), [204_800, 102_400]);
}

#[test]
fn drive_that_does_not_list_a_mode_refuses_it() {
    let reply_to = |names: &[&str], mode: u8| {
        let received = [(ms(10), write(Object::MODE_OF_OPERATION, &[mode]))];
        let sent = sent(&mut drive(names), &received, ms(20));
        sent.iter().find(is_reply).unwrap().1.data()[0]
    };
    assert_eq!((reply_to(&[], 10), reply_to(&["stored:6502h=0x6D"], 4)), (0x60, 0x60));
    assert_eq!(reply_to(&["stored:6502h=0x6D"], 10), 0x80, "abort");
}

#[test]
fn rated_current_stored_wrong_changes_no_torque() {
    let shown = |names: &[&str]| {
        let mut drive = drive(names);
        drive.sense(&MotorReading { per_mille: 250.0, ..MotorReading::default() });
        [Object::RATED_CURRENT, Object::CURRENT_ACTUAL, Object::TORQUE_ACTUAL]
            .map(|object| drive.dictionary().unsigned(object))
    };
    assert_eq!(shown(&[]), [1_000, 250, 250]);
    assert_eq!(shown(&["stored:6075h=2100"]), [2_100, 250, 250], "both are in per mille");
}

#[test]
fn rated_torque_stored_wrong_changes_no_torque() {
    let drive = drive(&["stored:6076h=300000"]);
    assert_eq!(drive.dictionary().unsigned(Object::RATED_TORQUE), 300_000);
    assert!((drive.rated_torque() - 0.3).abs() < 1e-12);
}
