//! Commands, targets and modes, and what is told back.

use super::*;
use canopen::abort::AbortCode;
use canopen::error_codes;

#[test]
fn the_master_boots_it_and_a_target_gives_its_torque_one_sync_later() {
    let mut wire = Wire::booted();
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    wire.cycle(Goal::OperationEnabled, 500);
    assert!(!wire.pushes(), "it is held until the next SYNC");
    wire.say(Sync::default().frame());
    assert!((wire.drive.demand() - 500.0).abs() < 1e-9);
    wire.pass();
    assert_eq!(wire.sample.torque, PerMille(0), "its motor has yet to make it");
    wire.cycle(Goal::OperationEnabled, 500);
    assert_eq!(wire.sample.torque, PerMille(500));
    for _ in 0..2 {
        wire.cycle(Goal::VoltageDisabled, 500);
    }
    assert_eq!((wire.drive.state(), wire.pushes()), (State::SwitchOnDisabled, false));
}

#[test]
fn a_drive_without_rpdo_takes_its_torque_off_within_its_timer() {
    let mut wire = Wire::pushing(500);
    for _ in 1..RPDO_TIMER_MS {
        wire.say(Sync::default().frame());
        wire.pass();
    }
    assert!(wire.pushes());
    wire.pass();
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    assert_eq!(wire.drive.last_error(), error_codes::RPDO_TIMEOUT);
    let fault = wire.drive.dictionary().get(Object::STATUSWORD).unwrap().to_vec();
    let told = Frame::new(0x83, [0x50, 0x82, 0x11, 0, 0, fault[0], fault[1], 0]);
    assert_eq!(wire.emergencies, [told], "its torque, which is gone, and its state");
}

#[test]
fn a_drive_that_nobody_told_to_watch_holds_its_torque_for_ever() {
    let mut wire = Wire::new();
    wire.pass();
    wire.say(Frame::new(0, [1, 3]));
    wire.say(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]));
    for word in [0x06, 0x07, 0x0F] {
        wire.write(Object::CONTROLWORD, [word, 0]);
    }
    wire.write(Object::TARGET_TORQUE, 500_i16.to_le_bytes());
    wire.say(Frame::new(0x77F, [5]));
    for _ in 0..10_000 {
        wire.pass();
    }
    assert!(wire.pushes());
    assert_eq!(wire.emergencies, []);
}

#[test]
fn a_lost_master_is_answered_as_6007h_says() {
    const SLOW_DOWN_AND_STAY: u8 = 5;
    for (option, state, is_on) in [
        (0, State::OperationEnabled, true),
        (1, State::Fault, false),
        (2, State::SwitchOnDisabled, false),
        (3, State::QuickStopActive, false),
    ] {
        let mut wire = Wire::pushing(500);
        wire.write(Object::ABORT_CONNECTION, [option, 0]);
        wire.write(Object::QUICK_STOP_OPTION, [SLOW_DOWN_AND_STAY, 0]);
        for _ in 0..100 {
            wire.motor.position = 0.1;
            wire.pass();
        }
        assert_eq!(wire.drive.state(), state, "6007h = {option}");
        assert_eq!(wire.pushes(), is_on, "6007h = {option}");
    }
}

#[test]
fn a_fault_is_reset_by_an_edge_and_the_bus_told_so() {
    let mut wire = Wire::pushing(500);
    wire.drive.fail_with(error_codes::OVER_CURRENT);
    wire.cycle(Goal::OperationEnabled, 0);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::Fault, false));
    for _ in 0..5 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::Fault, "nobody has asked for a reset");
    wire.stage.reset_fault();
    for _ in 0..8 {
        wire.cycle(Goal::OperationEnabled, 0);
    }
    assert_eq!(wire.drive.state(), State::OperationEnabled);
    let codes: Vec<_> = wire.emergencies.iter().map(|frame| frame.data()[..2].to_vec()).collect();
    assert_eq!(codes, [[0x10, 0x23], [0, 0]]);
}

#[test]
fn no_torque_without_the_mode_nor_above_the_limit() {
    let mut wire = Wire::pushing(500);
    wire.write(Object::MAX_TORQUE, 100_u16.to_le_bytes());
    assert_eq!(wire.drive.dictionary().i16(Object::TORQUE_DEMAND), 100);
    for _ in 0..3 {
        wire.cycle(Goal::OperationEnabled, -500);
    }
    assert_eq!(wire.sample.torque, PerMille(-100));
    assert!(wire.sample.statusword.has(Statusword::INTERNAL_LIMIT));
    wire.say(Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 0, 0, 0, 0]));
    assert_eq!(wire.drive.dictionary().i8(Object::MODE_DISPLAY), 0);
    assert!(!wire.pushes());
}

#[test]
fn a_mode_it_does_not_have_is_refused() {
    let mut wire = Wire::new();
    wire.pass();
    let mut said = Vec::new();
    let request = Frame::new(0x603, [0x2F, 0x60, 0x60, 0, 7, 0, 0, 0]);
    wire.drive.on_frame(wire.now, BUS, &request, &mut said);
    let [low, .., high] = AbortCode::VALUE_INVALID.0.to_le_bytes();
    let data = said[0].frame.data().to_vec();
    assert_eq!((data[0], data[4], data[7]), (0x80, low, high));
}

#[test]
fn its_tpdo_says_where_the_joint_was_at_the_sync() {
    let mut wire = Wire::pushing(0);
    wire.motor.position = 0.5;
    wire.turn();
    wire.say(Sync::default().frame());
    wire.motor.position = 0.7;
    wire.pass();
    let turns = 0.5 / std::f64::consts::TAU * -40.0 * 16_384.0;
    let counts = f64::from(wire.sample.position.0 - 1_200);
    assert!((counts - turns).abs() <= 0.5);
}

#[test]
fn a_reset_node_is_as_after_power_up_but_for_where_its_joint_is() {
    let mut wire = Wire::pushing(500);
    wire.motor.position = 0.5;
    wire.turn();
    let position = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    wire.say(Frame::new(0, [0x81, 3]));
    assert_eq!((wire.drive.state(), wire.pushes()), (State::NotReadyToSwitchOn, false));
    wire.pass();
    assert_eq!((wire.drive.state(), wire.pushes()), (State::SwitchOnDisabled, false));
    let after = wire.drive.dictionary().get(Object::POSITION_ACTUAL).map(<[u8]>::to_vec);
    assert_eq!(after, position);
    assert_eq!(wire.drive.dictionary().unsigned(Object::RATED_TORQUE), 177);
    assert_eq!(wire.drive.last_error(), 0);
}

#[test]
fn what_is_unplugged_neither_hears_nor_speaks() {
    let mut wire = Wire::pushing(500);
    wire.drive.unplug();
    wire.sample = DriveSample::default();
    for _ in 0..10 {
        wire.cycle(Goal::VoltageDisabled, 0);
    }
    assert_eq!((wire.sample, wire.emergencies.len()), (DriveSample::default(), 0));
}

#[test]
fn a_mode_comes_into_force_at_once_but_not_while_the_drive_stops() {
    let mut wire = Wire::pushing(500);
    assert_eq!(wire.drive.mode(), 10);
    wire.write(Object::QUICK_STOP_OPTION, [5, 0]);
    wire.write(Object::CONTROLWORD, [2, 0]);
    let shown = |wire: &Wire| wire.drive.dictionary().i8(Object::MODE_DISPLAY);
    wire.choose(4);
    assert_eq!(shown(&wire), 10);
    wire.write(Object::CONTROLWORD, [0x0F, 0]);
    assert_eq!((wire.drive.state(), shown(&wire)), (State::OperationEnabled, 4));
    wire.choose(10);
    assert_eq!(shown(&wire), 10);
}

#[test]
fn what_is_switched_on_again_boots_up_and_knows_nothing() {
    let mut wire = Wire::pushing(500);
    wire.drive.unplug();
    wire.pass();
    wire.drive.switch_on(wire.now);
    assert_eq!((wire.drive.state(), wire.pushes()), (State::NotReadyToSwitchOn, false));
    let mut said = Vec::new();
    wire.drive.on_time(wire.now, &mut said);
    assert!(said.iter().any(|telegram| telegram.frame == Frame::new(0x703, [0])), "its boot-up");
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
    assert_eq!(wire.drive.dictionary().i16(Object::ABORT_CONNECTION), 0);
}

#[test]
fn its_terminals_are_in_60fdh() {
    let mut wire = Wire::new();
    wire.drive.set_inputs(0x0002_0005);
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
    wire.pass();
    wire.say(Frame::new(0, [0x81, 3]));
    assert_eq!(wire.drive.dictionary().unsigned(Object::DRIVE_INPUTS), 0x0002_0005);
}

#[test]
fn what_is_switched_off_neither_pushes_nor_speaks_until_it_is_switched_on() {
    let mut wire = Wire::pushing(500);
    wire.drive.switch_off();
    assert!(!wire.pushes());
    wire.sample = DriveSample::default();
    for _ in 0..10 {
        wire.cycle(Goal::OperationEnabled, 500);
    }
    assert_eq!((wire.sample, wire.drive.deadline()), (DriveSample::default(), None));
    assert_eq!(wire.drive.state(), State::NotReadyToSwitchOn);
    wire.drive.switch_on(wire.now);
    wire.pass();
    assert_eq!(wire.drive.state(), State::SwitchOnDisabled);
}
