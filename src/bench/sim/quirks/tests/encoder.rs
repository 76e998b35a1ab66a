//! Position of a drive with a wrong encoder.

use std::f64::consts::TAU;

use super::*;

/// Increments of a joint revolution.
const REVOLUTION: i32 = 204_800;

/// Returns 6064h with the joint at these revolutions: at power-up, half a revolution later, and after each of two power-ups
/// there.
fn positions(names: &[&str], revolutions: f64) -> [i32; 4] {
    let mut drive = drive(names);
    let read = |drive: &mut Drive, revolutions: f64| {
        drive.sense(&MotorReading { position: revolutions * TAU, ..MotorReading::default() });
        drive.dictionary().unsigned(Object::POSITION_ACTUAL).cast_signed()
    };
    let first = read(&mut drive, revolutions);
    sent(&mut drive, &[], ms(1));
    let moved = read(&mut drive, revolutions + 0.5);
    sent(&mut drive, &[(ms(2), Frame::new(0x000, [0x81, 3]))], ms(3));
    let reset = read(&mut drive, revolutions + 0.5);
    drive.switch_off();
    drive.switch_on(ms(4));
    [first, moved, reset, read(&mut drive, revolutions + 0.5)]
}

#[test]
fn incremental_counts_from_zero_at_each_power_up() {
    let half = REVOLUTION / 2;
    assert_eq!(
        positions(&[], 1.0),
        [REVOLUTION, REVOLUTION + half, REVOLUTION + half, REVOLUTION + half]
    );
    assert_eq!(positions(&["incremental"], 1.0), [0, half, 0, 0]);
}

#[test]
fn slipped_encoder_is_off_by_the_same_angle_at_each_power_up() {
    for (quirk, off) in [
        ("encoder-slipped", 11_378),
        ("encoder-slipped:-20", -11_378),
        ("encoder-slipped:4.5", 2_560),
    ] {
        let expected = positions(&[], 1.0).map(|position| position + off);
        assert_eq!(positions(&[quirk], 1.0), expected, "{quirk}");
    }
    assert_eq!(
        positions(&["incremental", "encoder-slipped"], 1.0),
        positions(&["incremental"], 1.0)
    );
}

#[test]
fn wrong_revolution_is_off_by_motor_revolutions() {
    for (quirk, off) in [("wrong-revolution", 4_096), ("wrong-revolution:-3", -12_288)] {
        let expected = positions(&[], 1.0).map(|position| position + off);
        assert_eq!(positions(&[quirk], 1.0), expected, "{quirk}");
    }
}
