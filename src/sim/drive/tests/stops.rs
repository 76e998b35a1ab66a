//! Stops that take their time: in profile torque mode, whose torque is lowered along 6087h.

use super::*;
use canopen::error_codes;

/// 6087h is 10,000 ‰/s by default: 500 ‰ are gone in 50 ms.
const SLOPE_MS: std::ops::RangeInclusive<usize> = 48..=52;
const SLOW_DOWN: [u8; 2] = [1, 0];
const TARGET: i16 = 500;

/// Pushes in this mode.
fn pushing(mode: u8) -> Wire {
    let mut wire = Wire::pushing(TARGET);
    wire.choose(mode);
    wire.feed(200, Controlword::ENABLE_OPERATION, TARGET);
    assert!((wire.drive.demand() - f64::from(TARGET)).abs() < 1e-6);
    wire
}

/// How many ms it stays in `state`, up to 10 s, while the controlword is `word`.
fn stays(wire: &mut Wire, state: State, word: Controlword) -> usize {
    let lasts = (0..10_000).take_while(|_| {
        wire.feed(1, word, TARGET);
        wire.drive.state() == state
    });
    lasts.count()
}

#[test]
fn a_torque_is_lowered_before_operation_is_left_where_the_option_codes_say_so() {
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
        let mut wire = pushing(4);
        assert!(stays(&mut wire, during, word) <= 1, "the master has set {object} to 0");
        assert_eq!((wire.drive.state(), wire.pushes()), (end, false), "{object}");
        let mut wire = pushing(4);
        wire.write(object, SLOW_DOWN);
        let lasts = stays(&mut wire, during, word);
        assert!(SLOPE_MS.contains(&lasts), "{object}: {lasts} ms");
        assert_eq!((wire.drive.state(), wire.pushes()), (end, false), "{object}");
    }
}

#[test]
fn a_cyclic_torque_has_no_ramp_and_so_is_gone_at_once() {
    for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON, Controlword::QUICK_STOP] {
        let mut wire = pushing(10);
        for object in
            [Object::SHUTDOWN_OPTION, Object::DISABLE_OPERATION_OPTION, Object::QUICK_STOP_OPTION]
        {
            wire.write(object, SLOW_DOWN);
        }
        wire.write(Object::CONTROLWORD, word.0.to_le_bytes());
        assert!(!wire.pushes() && wire.drive.state() != State::OperationEnabled);
    }
}

#[test]
fn a_ramp_that_is_taken_back_leads_up_again() {
    let mut wire = pushing(4);
    wire.write(Object::SHUTDOWN_OPTION, SLOW_DOWN);
    wire.feed(20, Controlword::SHUTDOWN, TARGET);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!(wire.drive.demand() < 400.0);
    wire.feed(100, Controlword::ENABLE_OPERATION, TARGET);
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    assert!((wire.drive.demand() - f64::from(TARGET)).abs() < 1e-6);
}

#[test]
fn a_fault_reaction_is_told_when_it_begins_and_is_a_fault_when_it_ends() {
    let mut wire = pushing(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::FaultReactionActive, true));
    wire.pass();
    assert_eq!(wire.told(), [(error_codes::OVER_CURRENT, 0x03)]);
    let lasts = stays(&mut wire, State::FaultReactionActive, Controlword::ENABLE_OPERATION);
    assert!(SLOPE_MS.contains(&lasts), "{lasts} ms");
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.told().len(), 1);
}

#[test]
fn safe_torque_off_cuts_a_fault_reaction_short() {
    let mut wire = pushing(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    wire.feed(5, Controlword::ENABLE_OPERATION, TARGET);
    assert!(wire.pushes());
    wire.drive.set_safe_torque_off(true);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
}

#[test]
fn a_stop_goes_on_when_nobody_listens() {
    let mut wire = pushing(4);
    wire.write(Object::FAULT_REACTION, SLOW_DOWN);
    // To be stopped in operation is to lose the master (6007h = 1).
    wire.say(Frame::new(0, [2, 3]));
    assert_eq!(wire.drive.state(), State::FaultReactionActive);
    wire.drive.unplug();
    (0..60).for_each(|_| wire.pass());
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
}

#[test]
fn a_halted_drive_stays_enabled_without_torque_and_goes_on_when_it_may() {
    const HALT: Controlword = Controlword(Controlword::ENABLE_OPERATION.0 | 1 << 8);
    let mut wire = pushing(10);
    wire.feed(2, HALT, TARGET);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::OperationEnabled, false));
    wire.feed(2, Controlword::ENABLE_OPERATION, TARGET);
    assert!(wire.pushes());
}
