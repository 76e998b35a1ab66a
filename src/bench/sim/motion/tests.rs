//! Properties of all modes, for any objects and feedback.

use proptest::prelude::*;

use super::*;
use crate::motion::fixture::{drive, put};
use canopen::eds::Eds;

/// Statusword bits 10, 12 and 13.
const OWN: u16 = 1 << 10 | 1 << 12 | 1 << 13;

const MODES: [i8; 9] = [0, 1, 3, 4, 6, 8, 9, 10, -5];

/// Returns each object of the profile, whatever its access, with its size.
fn profile(dictionary: &Dictionary) -> Vec<(Object, usize)> {
    let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
    let objects = eds.objects().iter().map(|described| described.object);
    objects
        .filter(|object| object.index >= Object::ABORT_CONNECTION.index)
        .filter_map(|object| Some((object, dictionary.get(object)?.len())))
        .collect()
}

/// Generates numbers at the ends of each type, and others.
fn number() -> impl Strategy<Value = u32> {
    prop_oneof![
        Just(0),
        Just(1),
        Just(u32::MAX),
        Just((1 << 15) - 1),
        Just(1 << 15),
        Just((1 << 31) - 1),
        Just(1 << 31),
        any::<u32>(),
        0_u32..1_000,
    ]
}

fn rate() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        any::<f64>(),
        -1e5..1e5_f64,
    ]
}

fn feedback() -> impl Strategy<Value = Feedback> {
    (any::<i32>(), rate(), rate()).prop_map(|(position, velocity, per_mille)| Feedback {
        position,
        velocity,
        per_mille,
        ..Feedback::default()
    })
}

#[derive(Clone, Debug)]
enum Act {
    Write(usize, u32),
    Begin(usize),
    Word(u16),
    Step(f64),
    Stop(f64, Ramp),
    Hold(f64),
}

fn act() -> impl Strategy<Value = Act> {
    let time = || prop_oneof![Just(0.0), Just(SERVO_PERIOD), Just(SERVO_PERIOD), rate()];
    let ramp = prop_oneof![Just(Ramp::SlowDown), Just(Ramp::QuickStop), Just(Ramp::CurrentLimit)];
    prop_oneof![
        (any::<usize>(), number()).prop_map(|(object, number)| Act::Write(object, number)),
        (0..MODES.len()).prop_map(Act::Begin),
        any::<u16>().prop_map(Act::Word),
        time().prop_map(Act::Step),
        (time(), ramp).prop_map(|(time, ramp)| Act::Stop(time, ramp)),
        time().prop_map(Act::Hold),
    ]
}

/// Checks a demand against 6072h, 6073h, 60E0h and 60E1h.
fn is_within_limits(demand: &TorqueDemand, dictionary: &Dictionary) -> bool {
    let limit = |object| f64::from(dictionary.unsigned(object));
    let both = limit(Object::MAX_TORQUE).min(limit(Object::MAX_CURRENT));
    demand.per_mille <= both.min(limit(Object::POSITIVE_TORQUE_LIMIT))
        && demand.per_mille >= -both.min(limit(Object::NEGATIVE_TORQUE_LIMIT))
}

proptest! {
    #[test]
    fn torque_stays_within_limits_for_any_input(
        acts in proptest::collection::vec((act(), feedback()), 1..150),
    ) {
        let mut dictionary = drive();
        let objects = profile(&dictionary);
        let mut motion = Motion::default();
        for (act, feedback) in acts {
            let demand = match act {
                Act::Write(which, number) => {
                    let (object, size) = objects[which % objects.len()];
                    dictionary.set(object, &number.to_le_bytes()[..size.min(4)]);
                    motion.on_written(object, &dictionary);
                    None
                }
                Act::Begin(mode) => {
                    motion.begin(MODES[mode], &feedback, &dictionary);
                    None
                }
                Act::Word(word) => {
                    motion.on_controlword(Controlword(word), &feedback, &dictionary);
                    None
                }
                Act::Step(dt) => Some(motion.step(dt, &feedback, &mut dictionary)),
                Act::Stop(dt, ramp) => motion.stop(dt, ramp, &feedback, &mut dictionary),
                Act::Hold(dt) => Some(motion.hold(dt, &feedback, &mut dictionary)),
            };
            if let Some(demand) = demand {
                prop_assert!(is_within_limits(&demand, &dictionary), "{demand:?}");
                prop_assert_eq!(demand.status & !OWN, 0, "bits of other owners");
            }
        }
    }

    #[test]
    fn mode_start_keeps_the_torque(mode in 0..MODES.len(), torque in -3_000.0..3_000.0_f64) {
        let mode = MODES[mode];
        let mut dictionary = drive();
        let mut motion = Motion::default();
        let feedback = Feedback { per_mille: torque, ..Feedback::default() };
        motion.begin(mode, &feedback, &dictionary);
        let demand = motion.step(SERVO_PERIOD, &feedback, &mut dictionary);
        // 6071h is zero: the torque modes go there, on a slope of 10 ‰/ms or at once.
        let expected = match mode {
            0 | -5 | 10 => 0.0,
            4 => torque.signum() * (torque.abs() - 10.0).max(0.0),
            _ => torque,
        };
        prop_assert!((demand.per_mille - expected).abs() < 1e-9, "{mode}: {demand:?}");
    }
}

#[test]
fn position_of_the_wrap_changes_no_mode() {
    for mode in MODES {
        let run = |start: i32| {
            let mut dictionary = drive();
            let mut motion = Motion::default();
            let at = |distance: i32| Feedback {
                position: start.wrapping_add(distance),
                ..Feedback::default()
            };
            motion.begin(mode, &at(0), &dictionary);
            put(&mut dictionary, Object::TARGET_POSITION, 2_000);
            put(&mut dictionary, Object::TARGET_VELOCITY, 3_000);
            put(&mut dictionary, Object::HOMING_METHOD, 37);
            motion.on_controlword(Controlword(0x5F), &at(0), &dictionary);
            let target = start.wrapping_add(2_000).cast_unsigned();
            if mode == 8 {
                put(&mut dictionary, Object::TARGET_POSITION, target);
            }
            (0..200_i32)
                .map(|tick| motion.step(SERVO_PERIOD, &at(tick * 7), &mut dictionary))
                .collect::<Vec<_>>()
        };
        for (near, far) in run(0).into_iter().zip(run(i32::MAX - 700)) {
            // Places of 2³¹ have an ulp of 5e-7.
            assert!((near.per_mille - far.per_mille).abs() < 1e-5, "{mode}: {near:?}, {far:?}");
            assert_eq!((near.status, near.error), (far.status, far.error), "mode {mode}");
        }
    }
}
