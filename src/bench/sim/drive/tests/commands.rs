//! Commands, targets and modes, and the reported values.

use super::*;
use canopen::abort::AbortCode;
use canopen::error_codes;

#[test]
fn target_torque_acts_at_the_next_sync() {
    let mut wire = Wire::booted();
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(!wire.has_torque(), "the RPDO waits for the next SYNC");
    wire.send(Sync::default().frame());
    assert!((wire.drive.demand() - 500.0).abs() < 1e-9);
    wire.step();
    assert_eq!(wire.sample.torque, PerMille(0), "the motor has not applied it yet");
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!(wire.sample.torque, PerMille(500));
    for _ in 0..2 {
        wire.cycle(Goal::VoltageDisabled, 500);
    }
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::SwitchOnDisabled, false));
}

#[test]
fn rpdo_timeout_removes_the_torque() {
    let mut wire = Wire::enabled_with(500);
    for _ in 1..RPDO_TIMER_MS {
        wire.send(Sync::default().frame());
        wire.step();
    }
    assert!(wire.has_torque());
    wire.step();
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    assert_eq!(wire.drive.last_error(), error_codes::RPDO_TIMEOUT);
    let fault = wire.drive.dictionary().get(Object::STATUSWORD).unwrap().to_vec();
    let expected = Frame::new(0x83, [0x50, 0x82, 0x11, 0, 0, fault[0], fault[1], 0]);
    assert_eq!(wire.emergencies, [expected], "torque, now zero, and statusword");
}

#[test]
fn drive_without_heartbeat_consumer_keeps_its_torque() {
    let mut wire = Wire::new();
    wire.step();
    wire.send(Frame::new(0, [1, 3]));
    wire.send(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]));
    for word in [0x06, 0x07, 0x0F] {
        wire.write(Object::CONTROLWORD, [word, 0]);
    }
    wire.write(Object::TARGET_TORQUE, 500_i16.to_le_bytes());
    wire.send(Frame::new(0x77F, [5]));
    for _ in 0..10_000 {
        wire.step();
    }
    assert!(wire.has_torque());
    assert_eq!(wire.emergencies, []);
}

#[test]
fn connection_loss_reaction_follows_6007h() {
    const SLOW_DOWN_AND_STAY: u8 = 5;
    for (option, state, is_on) in [
        (0, State::OperationEnabled, true),
        (1, State::Fault, false),
        (2, State::SwitchOnDisabled, false),
        (3, State::QuickStopActive, false),
    ] {
        let mut wire = Wire::enabled_with(500);
        wire.write(Object::ABORT_CONNECTION, [option, 0]);
        wire.write(Object::QUICK_STOP_OPTION, [SLOW_DOWN_AND_STAY, 0]);
        for _ in 0..100 {
            wire.motor.position = 0.1;
            wire.step();
        }
        assert_eq!(wire.drive.state(), state, "6007h = {option}");
        assert_eq!(wire.has_torque(), is_on, "6007h = {option}");
    }
}

#[test]
fn fault_reset_needs_an_edge_and_sends_error_reset() {
    let mut wire = Wire::enabled_with(500);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    wire.cycle(Goal::OperationEnabled, 0);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::Fault, false));
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "no reset was requested");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    let codes: Vec<_> = wire.emergencies.iter().map(|frame| frame.data()[..2].to_vec()).collect();
    assert_eq!(codes, [[0x10, 0x23], [0, 0]]);
}

#[test]
fn torque_is_limited_and_needs_a_mode() {
    let mut wire = Wire::enabled_with(500);
    wire.write(Object::MAX_TORQUE, 100_u16.to_le_bytes());
    assert_eq!(wire.drive.dictionary().i16(Object::TORQUE_DEMAND), 100);
    for _ in 0..3 {
        wire.cycle(Goal::OperationEnabled, -500);
    }
    assert_eq!(wire.sample.torque, PerMille(-100));
    assert!(wire.sample.statusword.has(Statusword::INTERNAL_LIMIT));
    wire.send(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 0, 0, 0, 0]));
    assert_eq!(wire.drive.dictionary().i8(Object::MODE_DISPLAY), 0);
    assert!(!wire.has_torque());
}

#[test]
fn unsupported_mode_is_refused() {
    let mut wire = Wire::new();
    wire.step();
    let mut sent = Vec::new();
    let request = Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]);
    wire.drive.on_frame(wire.now, BUS, &request, &mut sent);
    let [low, .., high] = AbortCode::VALUE_INVALID.0.to_le_bytes();
    let data = sent[0].frame.data().to_vec();
    assert_eq!((data[0], data[4], data[7]), (0x80, low, high));
}

#[test]
fn tpdo_has_the_position_at_the_sync() {
    let mut wire = Wire::enabled_with(0);
    wire.motor.position = 0.5;
    wire.update_motor();
    wire.send(Sync::default().frame());
    wire.motor.position = 0.7;
    wire.step();
    let turns = 0.5 / std::f64::consts::TAU * -40.0 * 16_384.0;
    let counts = f64::from(wire.sample.position.0 - 1_200);
    assert!((counts - turns).abs() <= 0.5);
}

#[test]
fn reset_node_restores_power_up_state_but_not_position() {
    let mut wire = Wire::enabled_with(500);
    wire.motor.position = 0.5;
    wire.update_motor();
    let position = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    wire.send(Frame::new(0, [0x81, 3]));
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::NotReadyToSwitchOn, false));
    wire.step();
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::SwitchOnDisabled, false));
    let after = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    assert_eq!(after, position);
    assert_eq!(wire.drive.dictionary().unsigned(Object::RATED_TORQUE), 177);
    assert_eq!(wire.drive.last_error(), 0);
}

#[test]
fn unplugged_drive_neither_receives_nor_sends() {
    let mut wire = Wire::enabled_with(500);
    wire.drive.unplug();
    wire.sample = DriveSample::default();
    for _ in 0..10 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!((wire.sample, wire.emergencies.len()), (DriveSample::default(), 0));
}

#[test]
fn mode_changes_at_once_but_not_during_a_stop() {
    let mut wire = Wire::enabled_with(500);
    assert_eq!(wire.drive.mode(), 10);
    wire.write(Object::QUICK_STOP_OPTION, [5, 0]);
    wire.write(Object::CONTROLWORD, [2, 0]);
    let shown = |wire: &Wire| wire.drive.dictionary().i8(Object::MODE_DISPLAY);
    wire.set_mode(4);
    assert_eq!(shown(&wire), 10);
    wire.write(Object::CONTROLWORD, [0x0F, 0]);
    assert_eq!((wire.drive.state(), shown(&wire)), (State::OperationEnabled, 4));
    wire.set_mode(10);
    assert_eq!(shown(&wire), 10);
}

#[test]
fn power_cycle_boots_with_default_values() {
    let mut wire = Wire::enabled_with(500);
    wire.drive.unplug();
    wire.step();
    wire.drive.switch_on(wire.now);
    assert_eq!((wire.drive.state(), wire.has_torque()), (State::NotReadyToSwitchOn, false));
    let mut sent = Vec::new();
    wire.drive.on_time(wire.now, &mut sent);
    assert!(sent.iter().any(|telegram| telegram.frame == Frame::new(0x703, [0])), "its boot-up");
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    assert_eq!(wire.drive.dictionary().i16(Object::ABORT_CONNECTION), 0);
}

#[test]
fn digital_inputs_are_in_60fdh() {
    let mut wire = Wire::new();
    wire.drive.set_inputs(0x0002_0005);
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
    wire.step();
    wire.send(Frame::new(0, [0x81, 3]));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
}

#[test]
fn switched_off_drive_has_no_torque_and_sends_nothing() {
    let mut wire = Wire::enabled_with(500);
    wire.drive.switch_off();
    assert!(!wire.has_torque());
    wire.sample = DriveSample::default();
    for _ in 0..10 {
        wire.cycle(Goal::OperationEnabled, 500);
    }
    assert_eq!((wire.sample, wire.drive.deadline()), (DriveSample::default(), None));
    assert_eq!(wire.drive.state(), State::NotReadyToSwitchOn);
    wire.drive.switch_on(wire.now);
    wire.step();
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
}
