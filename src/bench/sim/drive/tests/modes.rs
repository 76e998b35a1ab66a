//! Position, velocity and stop functions, with a motor that accelerates under its torque.

use std::f64::consts::TAU;

use super::*;

/// Inertia of a middle joint, in ‰ per increment/s².
const INERTIA: f64 = 2.5e-5;
/// Increments per revolution of the joint.
const INCREMENTS: f64 = 16_384.0 * -40.0;

impl Wire {
    /// Runs `ms` cycles in which the motor accelerates.
    pub(super) fn run(&mut self, ms: usize, word: Controlword) {
        for _ in 0..ms {
            let pushed = self.drive.demand() / INERTIA / INCREMENTS * TAU;
            self.motor.velocity += 1e-3 * pushed;
            self.motor.position += 1e-3 * self.motor.velocity;
            self.feed(1, word, 0);
        }
    }

    pub(super) fn signed(&self, object: Object) -> i32 {
        self.drive.dictionary().unsigned(object).cast_signed()
    }

    pub(super) fn command(&mut self, object: Object, value: i32) {
        let ([low, high], [b0, b1, b2, b3]) = (object.index.to_le_bytes(), value.to_le_bytes());
        self.send(Frame::new(0x603, [0x23, low, high, object.sub, b0, b1, b2, b3]));
        assert_eq!(self.signed(object), value);
    }

    /// Turns the motor at 50,000 increments/s in profile velocity mode.
    fn turning() -> Self {
        let mut wire = Self::enabled_with(0);
        wire.set_mode(3);
        wire.command(Object::TARGET_VELOCITY, 50_000);
        wire.run(300, Controlword::ENABLE_OPERATION);
        let velocity = wire.signed(Object::VELOCITY_ACTUAL);
        assert!((49_000..51_000).contains(&velocity), "{velocity}");
        wire
    }
}

#[test]
fn quick_stop_active_holds_the_position() {
    let mut wire = Wire::turning();
    wire.write(Object::QUICK_STOP_OPTION, [6, 0]);
    wire.run(500, Controlword::QUICK_STOP);
    assert_eq!(wire.drive.state(), State::QuickStopActive);
    assert!(wire.statusword().has(1 << 10));
    let place = wire.signed(Object::POSITION_ACTUAL);
    wire.motor.velocity += 0.01;
    wire.run(500, Controlword::QUICK_STOP);
    let moved = wire.signed(Object::POSITION_ACTUAL) - place;
    assert!(moved.abs() < 200, "{moved}");
    wire.run(300, Controlword::ENABLE_OPERATION);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(wire.signed(Object::VELOCITY_ACTUAL) > 40_000, "it goes on");
}

#[test]
fn ramps_reach_standstill_before_operation_is_left() {
    for (object, code, word, end) in [
        (Object::QUICK_STOP_OPTION, 1, Controlword::QUICK_STOP, State::SwitchOnDisabled),
        (Object::QUICK_STOP_OPTION, 2, Controlword::QUICK_STOP, State::SwitchOnDisabled),
        (Object::QUICK_STOP_OPTION, 3, Controlword::QUICK_STOP, State::SwitchOnDisabled),
        (Object::SHUTDOWN_OPTION, 1, Controlword::SHUTDOWN, State::ReadyToSwitchOn),
        (Object::DISABLE_OPERATION_OPTION, 1, Controlword::SWITCH_ON, State::SwitchedOn),
    ] {
        let mut wire = Wire::turning();
        wire.write(object, [code, 0]);
        let mut ms = 0;
        while wire.drive.state() != end {
            wire.run(1, word);
            ms += 1;
            assert!(ms < 4_100, "{object} = {code}");
        }
        let velocity = wire.signed(Object::VELOCITY_ACTUAL);
        assert!(velocity.abs() < 2_000, "{object} = {code}: {velocity} after {ms} ms");
        assert!(!wire.has_torque());
    }
}

#[test]
fn profile_position_takes_the_set_point_at_the_edge() {
    let mut wire = Wire::enabled_with(0);
    let start = wire.signed(Object::POSITION_ACTUAL);
    wire.set_mode(1);
    wire.command(Object::TARGET_POSITION, start + 20_000);
    wire.run(50, Controlword::ENABLE_OPERATION);
    assert!((wire.signed(Object::POSITION_ACTUAL) - start).abs() < 100);
    wire.run(1_000, Controlword(0x1F));
    assert!((wire.signed(Object::POSITION_ACTUAL) - start - 20_000).abs() < 200);
    assert!(wire.statusword().has(1 << 10));
}

#[test]
fn cyclic_position_follows_targets_not_parameters() {
    let mut wire = Wire::enabled_with(0);
    let start = wire.signed(Object::POSITION_ACTUAL);
    wire.set_mode(8);
    wire.run(100, Controlword::ENABLE_OPERATION);
    wire.write(Object::MAX_TORQUE, 900_u16.to_le_bytes());
    wire.run(200, Controlword::ENABLE_OPERATION);
    let moved = wire.signed(Object::POSITION_ACTUAL) - start;
    assert!(moved.abs() < 100, "607Ah has not changed: {moved}");
    for step in 1..=200 {
        wire.command(Object::TARGET_POSITION, start + 50 * step);
        wire.run(1, Controlword::ENABLE_OPERATION);
    }
    wire.run(200, Controlword::ENABLE_OPERATION);
    let moved = wire.signed(Object::POSITION_ACTUAL) - start;
    assert!((moved - 10_000).abs() < 300, "{moved}");
}
