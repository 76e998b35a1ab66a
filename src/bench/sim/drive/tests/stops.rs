//! Stops on a ramp, in profile torque mode: the torque falls along 6087h.

use super::*;
use canopen::error_codes;

/// Time of the ramp: 6087h is 10,000 ‰/s by default, so 500 ‰ take 50 ms.
const SLOPE_MS: std::ops::RangeInclusive<usize> = 48..=52;
const SLOW_DOWN: [u8; 2] = [1, 0];
const TARGET: i16 = 500;

/// Enables the drive with torque in this mode.
fn torque_in_mode(mode: u8) -> Wire {
    let mut wire = Wire::enabled_with(TARGET);
    wire.set_mode(mode);
    wire.feed(200, Controlword::ENABLE_OPERATION, TARGET);
    assert!((wire.drive.demand() - f64::from(TARGET)).abs() < 1e-6);
    wire
}

/// Counts the ms, up to 10 s, that the drive stays in `state` with this controlword.
fn time_in_state(wire: &mut Wire, state: State, word: Controlword) -> usize {
    let lasts = (0..10_000).take_while(|_| {
        wire.feed(1, word, TARGET);
        wire.drive.state() == state
    });
    lasts.count()
}

#[test]
fn option_codes_lower_torque_before_operation_is_left() {
    for (object, word, during, end) in [
        (
            Object::SHUTDOWN_OPTION,
            Controlword::SHUTDOWN,
            State::OperationEnabled,
            State::ReadyToSwitchOn,
        ),
        (
            Object::DISABLE_OPERATION_OPTION,
            Controlword::SWITCH_ON,
            State::OperationEnabled,
            State::SwitchedOn,
        ),
        (
            Object::QUICK_STOP_OPTION,
            Controlword::QUICK_STOP,
            State::QuickStopActive,
            State::SwitchOnDisabled,
        ),
    ] {
        let mut wire = torque_in_mode(4);
        assert!(time_in_state(&mut wire, during, word) <= 1, "the master sets {object} to 0");
        assert_eq!((wire.drive.state(), wire.has_torque()), (end, false), "{object}");
        let mut wire = torque_in_mode(4);
        wire.write(object, SLOW_DOWN);
        let lasts = time_in_state(&mut wire, during, word);
        assert!(SLOPE_MS.contains(&lasts), "{object}: {lasts} ms");
        assert_eq!((wire.drive.state(), wire.has_torque()), (end, false), "{object}");
    }
}

#[test]
fn cyclic_torque_stops_at_once() {
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::QUICK_STOP] {
        let mut wire = torque_in_mode(10);
        for object in
            [Object::SHUTDOWN_OPTION, Object::DISABLE_OPERATION_OPTION, Object::QUICK_STOP_OPTION]
        {
            wire.write(object, SLOW_DOWN);
        }
        wire.write(Object::CONTROLWORD, word.0.to_le_bytes());
        assert!(!wire.has_torque() && wire.drive.state() != State::OperationEnabled);
    }
}

#[test]
fn cancelled_shutdown_restores_the_torque() {
    let mut wire = torque_in_mode(4);
    wire.write(Object::SHUTDOWN_OPTION, SLOW_DOWN);
    wire.feed(20, Controlword::SHUTDOWN, TARGET);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(wire.drive.demand() < 400.0);
    wire.feed(100, Controlword::ENABLE_OPERATION, TARGET);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!((wire.drive.demand() - f64::from(TARGET)).abs() < 1e-6);
}

#[test]
fn fault_reaction_sends_emcy_first_and_ends_in_fault() {
    let mut wire = torque_in_mode(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::FaultReactionActive, true));
    wire.step();
    assert_eq!(wire.emcy_codes(), [(error_codes::OVER_CURRENT, 0x03)]);
    let lasts = time_in_state(&mut wire, State::FaultReactionActive, Controlword::ENABLE_OPERATION);
    assert!(SLOPE_MS.contains(&lasts), "{lasts} ms");
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert_eq!(wire.emcy_codes().len(), 1);
}

#[test]
fn safe_torque_off_ends_a_fault_reaction() {
    let mut wire = torque_in_mode(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    wire.feed(5, Controlword::ENABLE_OPERATION, TARGET);
    assert!(wire.has_torque());
    wire.drive.set_safe_torque_off(true);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
}

#[test]
fn stop_continues_without_a_bus() {
    let mut wire = torque_in_mode(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    // Stop remote node in NMT operational is a connection loss (6007h = 1).
    wire.send(Frame::new(0, [2, 3]));
    assert_eq!(wire.drive.state(), State::FaultReactionActive);
    wire.drive.unplug();
    (0..60).for_each(|_| wire.step());
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
}

#[test]
fn halt_removes_torque_and_keeps_operation_enabled() {
    const HALT: Controlword = Controlword(Controlword::ENABLE_OPERATION.0 | 1 << 8);
    let mut wire = torque_in_mode(10);
    wire.feed(2, HALT, TARGET);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::OperationEnabled, false));
    wire.feed(2, Controlword::ENABLE_OPERATION, TARGET);
    assert!(wire.has_torque());
}
