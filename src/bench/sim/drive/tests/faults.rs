//! Faults inside a drive, and their resets.

use super::*;
use canopen::error_codes;

#[test]
fn safe_torque_off_removes_torque_and_latches_its_fault() {
    let mut wire = Wire::enabled_with(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_safe_torque_off(true);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert!(!wire.statusword().has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 1 << 3);
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "the cause is still present");
    wire.drive.set_safe_torque_off(false);
    for _ in 0..8 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "no reset was requested since");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(wire.statusword().has(Statusword::VOLTAGE_ENABLED));
    assert_eq!(wire.emcy_codes(), [(error_codes::SAFE_TORQUE_OFF, 0x21), (0, 0)]);
}

#[test]
fn safe_torque_off_at_power_up_is_a_fault() {
    let mut wire = Wire::new();
    wire.drive.set_safe_torque_off(true);
    assert_eq!(wire.drive.state(), State::NotReadyToSwitchOn);
    wire.step();
    assert_eq!(
        (wire.drive.state(), wire.drive.last_error()),
        (State::Fault, error_codes::SAFE_TORQUE_OFF)
    );
}

#[test]
fn hot_winding_warns_then_faults_until_cool() {
    let mut wire = Wire::enabled_with(500);
    wire.motor.temperature = 112.34;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(wire.statusword().has(Statusword::WARNING) && wire.has_torque());
    assert_eq!(wire.drive.dictionary().i16(Object::WINDING_TEMPERATURE), 1_123);
    wire.motor.temperature = 121.0;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert_eq!(wire.emcy_codes(), [(error_codes::OVER_TEMPERATURE, 0x09)]);
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
fn overspeed_trips_with_torque_only() {
    let too_fast = 1.2 * 6_000.0 / 60.0 * std::f64::consts::TAU / 40.0;
    let mut wire = Wire::booted();
    wire.motor.velocity = too_fast;
    wire.cycle(Goal::VoltageDisabled, 0);
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    let mut wire = Wire::enabled_with(500);
    wire.motor.velocity = too_fast / 1.2;
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(wire.has_torque());
    wire.motor.velocity = -too_fast;
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert_eq!(wire.emcy_codes(), [(error_codes::OVER_SPEED, 0x21)]);
}

#[test]
fn under_voltage_removes_torque_despite_605eh() {
    let mut wire = Wire::enabled_with(500);
    wire.write(Object::FAULT_REACTION, [1, 0]);
    wire.drive.set_link_voltage(20.0);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert_eq!(wire.drive.dictionary().unsigned(Object::LINK_VOLTAGE), 20_000);
    wire.step();
    assert_eq!(wire.emcy_codes(), [(error_codes::UNDER_VOLTAGE, 0x05)]);
}
