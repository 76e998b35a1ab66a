//! Tests of encoding and decoding.

use proptest::prelude::*;

use super::ARM;
use crate::head::{Echo, Head, Kind};
use crate::{
    Capability, Command, Feedback, Gripper, Measurements, Motion, PayloadRemoval, Pose, Reason,
    Reject,
};

fn head() -> impl Strategy<Value = Head> {
    (any::<u32>(), 1..u64::MAX, 1..u64::MAX, any::<u64>(), any::<u64>()).prop_map(
        |(epoch, session, sequence, echoed_session, echoed_sequence)| Head {
            arm: ARM,
            epoch,
            own: Echo { session, sequence },
            echo: Echo { session: echoed_session, sequence: echoed_sequence },
        },
    )
}

fn pose() -> impl Strategy<Value = Pose> {
    (prop::array::uniform3(-1e3..1e3_f64), prop::array::uniform4(0.1..1.0_f64)).prop_map(
        |(position, parts)| {
            let norm = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
            Pose { position, orientation: parts.map(|part| part / norm) }
        },
    )
}

fn motion() -> impl Strategy<Value = Motion> {
    prop_oneof![
        Just(Motion::Hold),
        prop::array::uniform6(-100.0..100.0_f64).prop_map(Motion::Rate),
        pose().prop_map(Motion::Pose),
    ]
}

fn gripper() -> impl Strategy<Value = Option<Gripper>> {
    prop::option::of((0.0..1.0, 0.0..100.0))
        .prop_map(|given| given.map(|(position, force)| Gripper { position, force }))
}

prop_compose! {
    fn command()(
        head in head(), motion in motion(), is_engaged: bool, asks_capability: bool, gripper in gripper(),
    ) -> Command {
        Command { head, motion, is_engaged, asks_capability, gripper }
    }
}

prop_compose! {
    fn feedback()(
        head in head(), reason in 0..9_u8, obeyed_session: u64, acted_sequence: u64,
        wrench in prop::option::of(prop::array::uniform6(-1e5..1e5_f64)), pose in prop::option::of(pose()),
        gripper in gripper(),
    ) -> Feedback {
        Feedback {
            head,
            reason: Reason::from_code(reason).unwrap(),
            obeyed_session,
            acted_sequence,
            measured: Measurements { wrench, pose, gripper },
        }
    }
}

prop_compose! {
    fn capability()(
        flags in prop::array::uniform5(any::<bool>()), removal in 0..3_u8,
        six in prop::array::uniform6(0.0..1.0_f64), nine in prop::array::uniform9(0.0..1e9_f64),
        low in prop::array::uniform3(-1.0..1.0_f64),
    ) -> Capability {
        let [senses_wrench, senses_pose, has_gripper, follows_rates, follows_poses] = flags;
        let [servo_lag, sample_period, hold_after, n, nm, stiffest_contact, v, w, more] = nine;
        Capability {
            senses_wrench, senses_pose, has_gripper, follows_rates, follows_poses,
            payload_removal: PayloadRemoval::from_code(removal).unwrap(),
            accommodation: six,
            deadband: six.map(|part| part + more / 1e9),
            servo_lag, sample_period, hold_after,
            sensor_range: [n, nm],
            stiffest_contact,
            max_speed: [v, w],
            workspace: [low, low.map(|part| part + 1.0)],
        }
    }
}

/// Asserts that all numbers are within ±`limit`.
fn check_numbers(numbers: &[f64], limit: f64) {
    assert!(numbers.iter().all(|number| number.abs() <= limit), "{numbers:?}");
}

fn check_head(head: &Head) {
    assert!(head.own.session != 0 && head.own.sequence != 0, "{head:?}");
}

fn check_pose(pose: &Pose) {
    check_numbers(&pose.position, 1e3);
    let norm = pose.orientation.iter().map(|part| part * part).sum::<f64>().sqrt();
    assert!((norm - 1.0).abs() <= 1e-6, "{norm}");
}

fn check_gripper(gripper: Option<Gripper>) {
    gripper.iter().for_each(|Gripper { position, force }| check_numbers(&[*position, *force], 1e3));
}

fn check_capability(capability: &Capability) {
    let Capability { servo_lag, sample_period, hold_after, stiffest_contact, .. } = *capability;
    let not_negative = [
        &[servo_lag, sample_period, hold_after, stiffest_contact][..],
        &capability.accommodation,
        &capability.deadband,
        &capability.sensor_range,
        &capability.max_speed,
    ]
    .concat();
    check_numbers(&not_negative, 1e9);
    assert!(not_negative.iter().all(|number| *number >= 0.0), "{not_negative:?}");
    check_numbers(&capability.workspace.concat(), 1e9);
    let [low, high] = &capability.workspace;
    assert!(low.iter().zip(high).all(|(low, high)| low <= high), "{:?}", capability.workspace);
}

/// Asserts that every decoded value is within its range; returns whether the message decodes as any kind.
fn check_values(bytes: &[u8]) -> bool {
    let command = Command::decode(bytes);
    if let Ok(Command { head, motion, gripper, .. }) = &command {
        check_head(head);
        check_gripper(*gripper);
        match motion {
            Motion::Hold => {}
            Motion::Rate(rate) => check_numbers(rate, 100.0),
            Motion::Pose(pose) => check_pose(pose),
        }
    }
    let feedback = Feedback::decode(bytes);
    if let Ok(Feedback { head, measured, .. }) = &feedback {
        check_head(head);
        check_gripper(measured.gripper);
        measured.pose.iter().for_each(check_pose);
        measured.wrench.iter().for_each(|wrench| check_numbers(wrench, 1e5));
    }
    let capability = Capability::decode(bytes);
    if let Ok((head, capability)) = &capability {
        check_head(head);
        check_capability(capability);
    }
    command.is_ok() || feedback.is_ok() || capability.is_ok()
}

/// Generates any number, or one near the ends of a range.
fn wild() -> impl Strategy<Value = [u8; 8]> {
    let limits = prop::sample::select(vec![100.0, 1e3, 1e5, 1e9]);
    let near =
        (limits, -2..=2_i8).prop_map(|(limit, side)| limit * f64::from(side) * (1.0 + 1e-12));
    prop_oneof![prop::num::f64::ANY, near, -1.0..1.0_f64].prop_map(f64::to_le_bytes)
}

proptest! {
    #[test]
    fn messages_are_decoded_as_they_were_encoded(
        command in command(), feedback in feedback(), head in head(), capability in capability(),
    ) {
        prop_assert_eq!(Command::decode(&command.encode()), Ok(command));
        prop_assert_eq!(Feedback::decode(&feedback.encode()), Ok(feedback));
        prop_assert_eq!(Capability::decode(&capability.encode(&head)), Ok((head, capability)));
    }

    #[test]
    fn hazard_33_any_bytes_are_refused_or_decode_within_range(
        mut bytes in prop::collection::vec(any::<u8>(), 0..300), kind in 0..5_u8,
    ) {
        check_values(&bytes);
        // With a valid head, random bytes reach the values.
        let beginning = [0, 1, 0, 0, kind, 1];
        bytes.iter_mut().zip(beginning).for_each(|(byte, valid)| *byte = valid);
        for length in [Command::LENGTH, Feedback::LENGTH, Capability::LENGTH] {
            bytes.resize(length, 7);
            check_values(&bytes);
        }
    }

    #[test]
    fn hazard_33_valid_messages_with_any_values_stay_in_range(
        command in command(), feedback in feedback(), capability in capability(), head in head(),
        wild in prop::collection::vec((0..30_usize, wild()), 0..4), code in prop::option::of((44..48_usize, 0..10_u8)),
    ) {
        let messages = [
            command.encode().to_vec(),
            feedback.encode().to_vec(),
            capability.encode(&head).to_vec(),
        ];
        for mut bytes in messages {
            for (place, number) in &wild {
                // Numbers from the end of the head on, eight bytes each.
                let place = (44 + 8 * place).min(bytes.len() - 8);
                bytes[place..place + 8].copy_from_slice(number);
            }
            if let Some((place, code)) = code {
                bytes[place] = code;
            }
            let is_valid = check_values(&bytes);
            prop_assert!(is_valid || !wild.is_empty() || code.is_some());
        }
    }

    #[test]
    fn truncated_and_extended_messages_are_rejected(command in command(), feedback in feedback(), extra: u8) {
        let (command, feedback) = (command.encode(), feedback.encode());
        for length in 0..command.len() {
            prop_assert!(Command::decode(&command[..length]).is_err());
        }
        for length in 0..feedback.len() {
            prop_assert!(Feedback::decode(&feedback[..length]).is_err());
        }
        let longer = [&command[..], &[extra]].concat();
        prop_assert_eq!(Command::decode(&longer), Err(Reject::Length));
    }

    #[test]
    fn hazard_33_values_out_of_range_are_rejected(
        command in command(), feedback in feedback(), capability in capability(), head in head(), place in 0..13_usize,
        wild in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-2e9), Just(2e9)],
    ) {
        let with = |bytes: &[u8], offset: usize| {
            let mut bytes = bytes.to_vec();
            bytes[offset..offset + 8].copy_from_slice(&wild.to_le_bytes());
            bytes
        };
        // Offsets of the page count from the end of the encapsulation header.
        let rate = Command { motion: Motion::Rate([0.0; 6]), ..command };
        let pose = Command { motion: Motion::Pose(Pose::default()), ..command };
        let bytes = if place < 6 { rate.encode() } else { pose.encode() };
        prop_assert_eq!(Command::decode(&with(&bytes, 52 + 8 * place)), Err(Reject::Impossible));
        let measured = Measurements { wrench: Some([0.0; 6]), pose: Some(Pose::default()), gripper: None };
        let bytes = Feedback { measured, ..feedback }.encode();
        prop_assert_eq!(Feedback::decode(&with(&bytes, 68 + 8 * place)), Err(Reject::Impossible));
        let bytes = capability.encode(&head);
        let decoded = Capability::decode(&with(&bytes, 52 + 16 * place));
        prop_assert_eq!(decoded.map_err(Reject::from), Err(Reject::Impossible));
    }
}

#[test]
fn state_that_contradicts_its_reason_is_rejected() {
    let head = Head { arm: ARM, epoch: 0, own: Echo { session: 1, sequence: 1 }, echo: Echo::NONE };
    for (reason, other) in [(Reason::None, 0), (Reason::Silence, 1)] {
        let (obeyed_session, acted_sequence, measured) = (0, 0, Measurements::default());
        let feedback = Feedback { head, reason, obeyed_session, acted_sequence, measured };
        let mut bytes = feedback.encode();
        bytes[44] = other;
        assert_eq!(Feedback::decode(&bytes), Err(Reject::Impossible), "{reason}");
    }
}

#[test]
fn lengths_are_within_those_of_the_contract() {
    const { assert!(Command::LENGTH <= 200 && Feedback::LENGTH <= 200 && Capability::LENGTH <= 512) };
    assert_eq!([Command::LENGTH, Feedback::LENGTH, Capability::LENGTH], [188, 196, 276]);
}

#[test]
fn other_versions_kinds_and_encodings_are_named() {
    let head = Head { arm: ARM, epoch: 0, own: Echo { session: 1, sequence: 1 }, echo: Echo::NONE };
    let command = Command {
        head,
        motion: Motion::Hold,
        is_engaged: false,
        asks_capability: false,
        gripper: None,
    };
    let decoded = |place: usize, byte: u8| {
        let mut bytes = command.encode();
        bytes[place] = byte;
        Command::decode(&bytes)
    };
    assert_eq!(decoded(1, 0), Err(Reject::Foreign), "big-endian");
    assert_eq!(decoded(4, Kind::Feedback.code()), Err(Reject::Foreign));
    assert_eq!(decoded(4, 9), Err(Reject::Foreign));
    assert_eq!(decoded(5, 2), Err(Reject::Version));
    assert_eq!(decoded(44, 3), Err(Reject::Impossible), "mode");
    assert_eq!(decoded(45, 2), Err(Reject::Impossible), "flag");
    assert_eq!(decoded(48, 1), Ok(command), "reserved bytes are not read");
    assert_eq!(decoded(12, 0), Err(Reject::Impossible), "session zero");
    assert_eq!(decoded(20, 0), Err(Reject::Impossible), "sequence zero");
}

#[test]
fn field_of_a_capability_out_of_range_is_named() {
    let head = Head { arm: ARM, epoch: 0, own: Echo { session: 1, sequence: 1 }, echo: Echo::NONE };
    let bytes = super::ends::FIGURES.encode(&head);
    // Offsets of the page count from the end of the encapsulation header.
    let number = |offset: usize, value: f64| {
        let mut bytes = bytes;
        bytes[4 + offset..4 + offset + 8].copy_from_slice(&value.to_le_bytes());
        Capability::decode(&bytes).map(|_| ()).map_err(|invalid| invalid.to_string())
    };
    let least = "must be within 0..=1000000000, got";
    for (offset, value, words) in [
        (48, -1.0, format!("accommodation {least} -1")),
        (96 + 40, f64::NAN, format!("deadband {least} NaN")),
        (144, 2e9, format!("servo_lag {least} 2000000000")),
        (152, f64::INFINITY, format!("sample_period {least} inf")),
        (160, -0.1, format!("hold_after {least} -0.1")),
        (176, f64::NAN, format!("sensor_range {least} NaN")),
        (184, -2.0, format!("stiffest_contact {least} -2")),
        (200, -0.5, format!("max_speed {least} -0.5")),
        (
            208,
            -2e9,
            "workspace_low must be within -1000000000..=1000000000, got -2000000000".to_owned(),
        ),
        (240, -1.5, "workspace_high must be within -1..=1000000000, got -1.5".to_owned()),
        (248, 2e9, "workspace_high must be within -1..=1000000000, got 2000000000".to_owned()),
    ] {
        assert_eq!(number(offset, value), Err(words));
    }
    for (offset, value) in [(160, 0.0), (160, 1e9), (232, -1.0), (208, 1.0), (208, -1e9)] {
        assert_eq!(number(offset, value), Ok(()), "{value} at {offset}");
    }
}
