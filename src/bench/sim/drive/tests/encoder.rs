//! Position at power-up, by the kind of the encoder.

use std::f64::consts::TAU;

use super::*;
use crate::fault::Faults;
use crate::fault::devices::Devices;
use crate::motion::wrapped;
use crate::scenario::Scenario;

const KINDS: [EncoderKind; 3] = [
    EncoderKind::Absolute,
    EncoderKind::SingleTurn { unique_turns: 4.0 },
    EncoderKind::Incremental,
];

/// Returns the encoder position, in increments, at a joint position in rad.
fn increments(position: f64) -> i32 {
    let increments = position / TAU * ACTUATOR.counts_per_rev * ACTUATOR.gear_ratio;
    ACTUATOR.zero_counts + wrapped(increments)
}

/// Returns 6064h of a drive powered up at `start`, then moved to `position`, both in rad.
fn expected(kind: EncoderKind, start: f64, position: f64) -> i32 {
    let first = match kind {
        EncoderKind::Absolute => increments(start),
        EncoderKind::SingleTurn { .. } => increments(start).rem_euclid(4 * 16_384),
        EncoderKind::Incremental => 0,
    };
    first + increments(position) - increments(start)
}

impl Wire {
    /// Moves the motor to `position`, in rad, and returns 6064h.
    fn position_at(&mut self, position: f64) -> i32 {
        self.motor.position = position;
        self.update_motor();
        self.drive.dictionary().unsigned(Object::POSITION_ACTUAL).cast_signed()
    }
}

#[test]
fn each_power_up_determines_the_position_by_its_kind() {
    for kind in KINDS {
        let mut wire = Wire::with_drive(drive_with(kind, &[]));
        assert_eq!(wire.position_at(-0.5), expected(kind, -0.5, -0.5), "{kind:?}: first reading");
        wire.step();
        assert_eq!(wire.position_at(0.75), expected(kind, -0.5, 0.75), "{kind:?}: moved");
        wire.drive.switch_off();
        // The arm falls while it has no power.
        wire.position_at(1.0);
        wire.drive.switch_on(wire.now);
        assert_eq!(wire.position_at(1.25), expected(kind, 1.25, 1.25), "{kind:?}: power cycle");
        wire.step();
        assert_eq!(wire.position_at(1.5), expected(kind, 1.25, 1.5), "{kind:?}: moved again");
    }
}

#[test]
fn position_is_lost_without_readings_while_off() {
    for kind in KINDS {
        let mut wire = Wire::with_drive(drive_with(kind, &[]));
        wire.position_at(-0.5);
        wire.step();
        wire.drive.switch_off();
        wire.drive.switch_on(wire.now);
        wire.drive.on_time(wire.now, &mut Vec::new());
        assert_eq!(wire.drive.state(), State::SwitchOnDisabled, "initialised before a reading");
        assert_eq!(wire.position_at(1.25), expected(kind, 1.25, 1.25), "{kind:?}");
    }
}

#[test]
fn node_reset_is_a_power_up_and_communication_reset_is_not() {
    for kind in KINDS {
        let mut wire = Wire::with_drive(drive_with(kind, &[]));
        wire.position_at(-0.5);
        wire.step();
        wire.position_at(0.75);
        wire.send(Frame::new(0, [0x82, 3]));
        wire.step();
        assert_eq!(wire.position_at(0.75), expected(kind, -0.5, 0.75), "{kind:?}: 82h");
        wire.send(Frame::new(0, [0x81, 3]));
        let shown = wire.signed(Object::POSITION_ACTUAL);
        assert_eq!(shown, expected(kind, 0.75, 0.75), "{kind:?}: 81h");
        wire.step();
        assert_eq!(wire.position_at(1.0), expected(kind, 0.75, 1.0), "{kind:?}: moved");
    }
}

#[test]
fn faults_that_power_cycle_a_drive_lose_its_position() {
    for fault in ["kind = \"reset\"", "kind = \"unplug\"\nfor_s = 0.5"] {
        for kind in KINDS {
            let mut wire = Wire::with_drive(drive_with(kind, &[]));
            wire.position_at(-0.5);
            wire.step();
            wire.position_at(0.75);
            let script = format!("seconds = 5\n[[fault]]\nat_s = 1\njoint = 3\n{fault}\n");
            let mut faults = Faults::new(Scenario::parse(&script).unwrap().faults(), 1);
            faults.begin(wire.now);
            while let Some(due) = faults.deadline() {
                let mut devices: Devices<'_> =
                    [None, None, Some(&mut wire.drive), None, None, None, None];
                faults.on_time(due, &mut devices, &mut Vec::new());
                wire.now = due;
            }
            assert_eq!(wire.position_at(0.75), expected(kind, 0.75, 0.75), "{kind:?}, {fault}");
            wire.step();
            assert_eq!(wire.position_at(1.0), expected(kind, 0.75, 1.0), "{kind:?}, {fault}");
        }
    }
}

#[test]
fn factors_apply_to_increments_since_power_up() {
    let mut wire = Wire::with_drive(drive_with(EncoderKind::Incremental, &["stored:6091h:1=2"]));
    assert_eq!(wire.position_at(1.0), 0);
    wire.step();
    let half = (increments(1.5) - increments(1.0)) / 2;
    assert!((wire.position_at(1.5) - half).abs() <= 1);
}

#[test]
fn velocity_and_torque_do_not_depend_on_the_encoder_kind() {
    let shown = |kind| {
        let mut drive = drive_with(kind, &["wrong-revolution"]);
        let motor =
            MotorReading { position: 1.0, velocity: 2.0, per_mille: 30.0, temperature: 25.0 };
        drive.sense(&motor);
        [Object::VELOCITY_ACTUAL, Object::TORQUE_ACTUAL].map(|it| drive.dictionary().unsigned(it))
    };
    assert_eq!(KINDS.map(shown), [shown(EncoderKind::Absolute); 3]);
}
