//! Whatever happens, in whatever order.

use proptest::prelude::*;

use super::*;
use canopen::error_codes;

/// What may happen to a drive.
#[derive(Clone, Copy, Debug)]
enum Happening {
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

fn happening() -> impl Strategy<Value = Happening> {
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
            Happening::Set(object, value)
        });
    prop_oneof![
        8 => prop::sample::select(words.to_vec()).prop_map(Happening::Word),
        1 => any::<u16>().prop_map(Happening::Word),
        3 => (-3_000..=3_000_i16).prop_map(Happening::Target),
        1 => prop::sample::select(vec![0, 1, 3, 4, 6, 8, 9, 10, 10, 10]).prop_map(Happening::Mode),
        3 => set,
        4 => (0..60_u8).prop_map(Happening::Pass),
        1 => any::<u16>().prop_map(Happening::Fail),
        1 => any::<bool>().prop_map(Happening::TorqueOff),
        1 => (20.0..70.0_f64).prop_map(Happening::Voltage),
        1 => (-25.0..25.0_f64, 0.0..130.0_f64).prop_map(|(velocity, heat)| Happening::Motor(velocity, heat)),
        1 => Just(Happening::Loss),
        1 => Just(Happening::Reset),
    ]
}

impl Wire {
    /// Out of the box and operational, in cyclic torque mode.
    fn started() -> Self {
        let mut wire = Self::new();
        wire.pass();
        wire.start();
        wire
    }

    fn start(&mut self) {
        self.say(Frame::new(0, [1, 3]));
        self.choose(10);
    }

    /// Asks for it, whether or not it is granted.
    fn download(&mut self, object: Object, bytes: [u8; 2]) {
        let [low, high] = object.index.to_le_bytes();
        self.say(Frame::new(0x603, [0x2B, low, high, object.sub, bytes[0], bytes[1], 0, 0]));
    }

    fn happen(&mut self, happening: Happening) {
        match happening {
            Happening::Word(word) => self.download(Object::CONTROLWORD, word.to_le_bytes()),
            Happening::Target(target) => self.download(Object::TARGET_TORQUE, target.to_le_bytes()),
            Happening::Mode(mode) => self.choose(mode),
            Happening::Set(object, value) => self.download(object, value.to_le_bytes()),
            Happening::Pass(ms) => (0..ms).for_each(|_| self.pass()),
            Happening::Fail(code) => self.drive.fail_with(code),
            Happening::TorqueOff(is_off) => self.drive.set_safe_torque_off(is_off),
            Happening::Voltage(volts) => self.drive.set_link_voltage(volts),
            Happening::Motor(velocity, temperature) => {
                self.motor = Sensed { velocity, temperature, ..self.motor };
                self.turn();
            }
            // To be stopped in operation is to lose the master.
            Happening::Loss => {
                self.say(Frame::new(0, [2, 3]));
                self.say(Frame::new(0, [1, 3]));
            }
            Happening::Reset => {
                self.say(Frame::new(0, [0x81, 3]));
                self.start();
            }
        }
    }
}

proptest! {
    #[test]
    fn whatever_happens_torque_is_within_its_limits_and_only_where_there_may_be_some(
        happenings in proptest::collection::vec(happening(), 1..120),
    ) {
        let mut wire = Wire::started();
        for happening in happenings {
            wire.happen(happening);
            let (state, demand) = (wire.drive.state(), wire.drive.demand());
            prop_assert_eq!(wire.statusword().state(), Some(state), "{:?}", happening);
            let may_push = matches!(
                state,
                State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
            );
            prop_assert!(may_push || demand.abs() <= 0.0, "{demand} ‰ in {state}");
            let limit = |object| f64::from(wire.drive.dictionary().unsigned(object));
            let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
            prop_assert!(demand <= both.min(limit(Object::POSITIVE_TORQUE_LIMIT)), "{:?}", happening);
            prop_assert!(-demand <= both.min(limit(Object::NEGATIVE_TORQUE_LIMIT)), "{:?}", happening);
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_stop_is_over_in_bounded_time(
        happenings in proptest::collection::vec(happening(), 1..60),
        last in prop::sample::select(vec![0x02, 0x06, 0x07, 0x00]),
        is_fault: bool,
    ) {
        let mut wire = Wire::started();
        happenings.into_iter().for_each(|happening| wire.happen(happening));
        // The slowest there is.
        wire.say(Frame::new(0x603, [0x23, 0x87, 0x60, 0, 1, 0, 0, 0]));
        // Nothing holds a motor once its stop is over.
        wire.download(Object::QUICK_STOP_OPTION, [1, 0]);
        wire.happen(if is_fault { Happening::Fail(error_codes::OVER_CURRENT) } else { Happening::Word(last) });
        let end = wire.now + Duration::from_secs_f64(stop::LONGEST);
        while wire.now <= end {
            wire.now = wire.now + 50 * MS;
            wire.turn();
            wire.drive.on_time(wire.now, &mut Vec::new());
        }
        let state = wire.drive.state();
        let is_held = state == State::QuickStopActive && !is_fault;
        prop_assert!(is_held || !wire.pushes(), "{state}");
        prop_assert!(!matches!(state, State::OperationEnabled | State::FaultReactionActive), "{state}");
    }
}
