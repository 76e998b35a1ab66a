//! What goes wrong inside a drive, and what it takes to go on.

use super::*;
use canopen::error_codes;

#[test]
fn safe_torque_off_takes_the_torque_at_once_and_holds_its_fault() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_safe_torque_off(true);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert!(!wire.statusword().has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 1 << 3);
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "its cause is still there");
    wire.drive.set_safe_torque_off(false);
    for _ in 0..8 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "nobody has asked for a reset since");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(wire.statusword().has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(wire.told(), [(error_codes::SAFE_TORQUE_OFF, 0x21), (0, 0)]);
}

#[test]
fn safe_torque_off_is_there_after_power_up() {
    let mut wire = Wire::new();
    wire.drive.set_safe_torque_off(true);
    assert_eq!(wire.drive.state(), State::NotReadyToSwitchOn);
    wire.pass();
    assert_eq!(
        (wire.drive.state(), wire.drive.last_error()),
        (State::Fault, error_codes::SAFE_TORQUE_OFF)
    );
}

#[test]
fn a_hot_winding_warns_and_then_is_a_fault_until_it_has_cooled() {
    let mut wire = Wire::pushing(500);
    wire.motor.temperature = 112.34;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(wire.statusword().has(Statusword::WARNING) && wire.pushes());
    assert_eq!(wire.drive.dictionary().i16(Object::WINDING_TEMPERATURE), 1_123);
    wire.motor.temperature = 121.0;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.told(), [(error_codes::OVER_TEMPERATURE, 0x09)]);
    for (temperature, state) in [(121.0, State::Fault), (25.0, State::OperationEnabled)] {
        wire.motor.temperature = temperature;
        wire.stage.reset_fault();
        for _ in 0..8 {
            wire.cycle(Goal::OperationEnabled, 0);
        }
        assert_eq!(wire.drive.state(), state, "{temperature} °C");
    }
}

#[test]
fn a_motor_that_runs_away_trips_and_one_that_is_turned_by_hand_does_not() {
    let too_fast = 1.2 * 6_000.0 / 60.0 * std::f64::consts::TAU / 40.0;
    let mut wire = Wire::booted();
    wire.motor.velocity = too_fast;
    wire.cycle(Goal::VoltageDisabled, 0);
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    let mut wire = Wire::pushing(500);
    wire.motor.velocity = too_fast / 1.2;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(wire.pushes());
    wire.motor.velocity = -too_fast;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.told(), [(error_codes::OVER_SPEED, 0x21)]);
}

#[test]
fn a_link_without_voltage_gives_no_torque_whatever_the_fault_reaction() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_link_voltage(20.0);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.drive.dictionary().unsigned(Object::LINK_VOLTAGE), 20_000);
    wire.pass();
    assert_eq!(wire.told(), [(error_codes::UNDER_VOLTAGE, 0x05)]);
}
