//! Properties of a drive for any inputs in any order.

use proptest::prelude::*;

use super::*;
use canopen::error_codes;

/// Input of the drive.
#[derive(Clone, Copy, Debug)]
enum Input {
    Word(u16),
    Target(i16),
    Mode(u8),
    Set(Object, i16),
    Pass(u8),
    Fail(u16),
    TorqueOff(bool),
    Voltage(f64),
    Motor(f64, f64),
    Loss,
    Reset,
}

fn input() -> impl Strategy<Value = Input> {
    let words = [0x00, 0x02, 0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x1F, 0x80, 0x10F];
    let ways = [
        (Object::ABORT_CONNECTION, 3),
        (Object::QUICK_STOP_OPTION, 8),
        (Object::SHUTDOWN_OPTION, 1),
        (Object::DISABLE_OPERATION_OPTION, 1),
        (Object::HALT_OPTION, 4),
        (Object::FAULT_REACTION, 4),
        (Object::MAX_TORQUE, 3_000),
        (Object::MAX_CURRENT, 3_000),
        (Object::POSITIVE_TORQUE_LIMIT, 3_000),
        (Object::NEGATIVE_TORQUE_LIMIT, 3_000),
    ];
    let set =
        (prop::sample::select(ways.to_vec()), 0..=1_000_i32).prop_map(|((object, most), part)| {
            let value = i16::try_from(most * part / 1_000).unwrap();
            Input::Set(object, value)
        });
    prop_oneof![
        8 => prop::sample::select(words.to_vec()).prop_map(Input::Word),
        1 => any::<u16>().prop_map(Input::Word),
        3 => (-3_000..=3_000_i16).prop_map(Input::Target),
        1 => prop::sample::select(vec![0, 1, 3, 4, 6, 8, 9, 10, 10, 10]).prop_map(Input::Mode),
        3 => set,
        4 => (0..60_u8).prop_map(Input::Pass),
        1 => any::<u16>().prop_map(Input::Fail),
        1 => any::<bool>().prop_map(Input::TorqueOff),
        1 => (20.0..70.0_f64).prop_map(Input::Voltage),
        1 => (-25.0..25.0_f64, 0.0..130.0_f64).prop_map(|(velocity, heat)| Input::Motor(velocity, heat)),
        1 => Just(Input::Loss),
        1 => Just(Input::Reset),
    ]
}

impl Wire {
    /// Creates an operational drive with default values, in cyclic synchronous torque mode.
    fn started() -> Self {
        let mut wire = Self::new();
        wire.step();
        wire.start();
        wire
    }

    fn start(&mut self) {
        self.send(Frame::new(0, [1, 3]));
        self.set_mode(10);
    }

    /// Requests a download; the drive may refuse it.
    fn download(&mut self, object: Object, bytes: [u8; 2]) {
        let [low, high] = object.index.to_le_bytes();
        self.send(Frame::new(0x603, [0x2B, low, high, object.sub, bytes[0], bytes[1], 0, 0]));
    }

    fn apply(&mut self, input: Input) {
        match input {
            Input::Word(word) => self.download(Object::CONTROLWORD, word.to_le_bytes()),
            Input::Target(target) => self.download(Object::TARGET_TORQUE, target.to_le_bytes()),
            Input::Mode(mode) => self.set_mode(mode),
            Input::Set(object, value) => self.download(object, value.to_le_bytes()),
            Input::Pass(ms) => (0..ms).for_each(|_| self.step()),
            Input::Fail(code) => self.drive.fail_with(code),
            Input::TorqueOff(is_off) => self.drive.set_safe_torque_off(is_off),
            Input::Voltage(volts) => self.drive.set_link_voltage(volts),
            Input::Motor(velocity, temperature) => {
                self.motor = MotorReading { velocity, temperature, ..self.motor };
                self.update_motor();
            }
            // Stop remote node in NMT operational counts as a connection loss.
            Input::Loss => {
                self.send(Frame::new(0, [2, 3]));
                self.send(Frame::new(0, [1, 3]));
            }
            Input::Reset => {
                self.send(Frame::new(0, [0x81, 3]));
                self.start();
            }
        }
    }
}

proptest! {
    #[test]
    fn any_input_keeps_torque_in_limits_and_states_that_allow_it(
        inputs in proptest::collection::vec(input(), 1..120),
    ) {
        let mut wire = Wire::started();
        for input in inputs {
            wire.apply(input);
            let (state, demand) = (wire.drive.state(), wire.drive.demand());
            prop_assert_eq!(wire.statusword().state(), Some(state), "{:?}", input);
            let may_have_torque = matches!(
                state,
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
            );
            prop_assert!(may_have_torque || demand.abs() <= 0.0, "{demand} ‰ in {state}");
            let limit = |object| f64::from(wire.drive.dictionary().unsigned(object));
            let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
            prop_assert!(demand <= both.min(limit(Object::POSITIVE_TORQUE_LIMIT)), "{:?}", input);
            prop_assert!(-demand <= both.min(limit(Object::NEGATIVE_TORQUE_LIMIT)), "{:?}", input);
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn stops_end_in_bounded_time(
        inputs in proptest::collection::vec(input(), 1..60),
        last in prop::sample::select(vec![0x02, 0x06, 0x07, 0x00]),
        is_fault: bool,
    ) {
        let mut wire = Wire::started();
        inputs.into_iter().for_each(|input| wire.apply(input));
        // The slowest slope possible.
        wire.send(Frame::new(0x603, [0x23, 0x87, 0x60, 0, 1, 0, 0, 0]));
        // 605Ah = 1: the motor is free after the stop.
        wire.download(Object::QUICK_STOP_OPTION, [1, 0]);
        wire.apply(if is_fault { Input::Fail(error_codes::OVER_CURRENT) } else { Input::Word(last) });
        let end = wire.now + Duration::from_secs_f64(stop::MAX_STOP_TIME);
        while wire.now <= end {
            wire.now = wire.now + 50 * MS;
            wire.update_motor();
            wire.drive.on_time(wire.now, &mut Vec::new());
        }
        let state = wire.drive.state();
        let is_held = state == State::QuickStopActive && !is_fault;
        prop_assert!(is_held || !wire.has_torque(), "{state}");
        prop_assert!(!matches!(state, State::OperationEnabled | State::FaultReactionActive), "{state}");
    }
}
