//! Tests of both ends: epochs, silence, changes of session, and counts of losses.

use std::time::Duration;

use super::{ARM, Ends, HOLD_AFTER, OFFSET, at, rate};
use crate::{Capability, FarEnd, Feedback, Motion, NodeEnd, Order, PayloadRemoval, Reason, Reject};

pub(super) const FIGURES: Capability = Capability {
    senses_wrench: true,
    senses_pose: true,
    has_gripper: false,
    follows_rates: true,
    follows_poses: true,
    payload_removal: PayloadRemoval::Weight,
    accommodation: [0.001; 6],
    deadband: [1.0; 6],
    servo_lag: 0.02,
    sample_period: 0.001,
    hold_after: 0.1,
    sensor_range: [200.0, 10.0],
    stiffest_contact: 5_000.0,
    max_speed: [0.5, 2.0],
    workspace: [[-1.0; 3], [1.0; 3]],
};

#[test]
fn far_side_moves_only_after_an_arming() {
    let mut ends = Ends::new();
    for millis in 0..50 {
        assert_eq!(ends.exchange(at(millis), rate(at(millis))).0, Motion::Hold);
    }
    assert_eq!(ends.far.reason(), Reason::NotArmed);
    ends.node.begin_epoch();
    assert_eq!(ends.exchange(at(50), rate(at(50))).0, rate(at(50)));
    assert_eq!((ends.far.reason(), ends.far.leader()), (Reason::None, (11, 1)));
}

#[test]
fn sample_is_as_old_as_the_command_that_it_echoes() {
    let mut ends = Ends::armed();
    let command = ends.command(at(10), Motion::Hold);
    ends.far.on_message(at(18) + OFFSET, &command);
    let feedback = ends.feedback(at(19));
    let sample = ends.node.on_message(at(27), &feedback).unwrap();
    assert_eq!(sample.at, at(10));
    assert_eq!(ends.node.round_trips().percentile(100), Some(Duration::from_millis(17)));
}

#[test]
fn hazard_34_silence_holds_until_a_new_epoch() {
    let mut ends = Ends::armed();
    assert_eq!(ends.exchange(at(10), rate(at(10))).0, rate(at(10)));
    // The echo of that command was sent at 3 ms.
    assert_eq!(ends.far.motion(at(103) + OFFSET), rate(at(10)));
    assert_eq!(ends.far.motion(at(104) + OFFSET), Motion::Hold);
    assert_eq!(ends.far.reason(), Reason::Silence);
    for millis in 200..400 {
        assert_eq!(ends.exchange(at(millis), rate(at(millis))).0, Motion::Hold);
    }
    ends.node.begin_epoch();
    assert_eq!(ends.exchange(at(400), rate(at(400))).0, rate(at(400)));
}

#[test]
fn reason_of_the_robot_holds_until_a_new_epoch() {
    let mut ends = Ends::armed();
    ends.far.hold(Reason::WrenchLimit);
    ends.far.hold(Reason::SensorInvalid);
    let (performed, sample) = ends.exchange(at(5), rate(at(5)));
    let feedback = sample.unwrap().feedback;
    assert_eq!((performed, feedback.reason), (Motion::Hold, Reason::WrenchLimit), "the first");
    ends.node.begin_epoch();
    assert_eq!(ends.exchange(at(6), rate(at(6))).0, rate(at(6)));
}

#[test]
fn hazard_35_stopped_far_side_acts_on_nothing_of_its_backlog() {
    let mut ends = Ends::armed();
    assert_eq!(ends.exchange(at(10), rate(at(10))).0, rate(at(10)));
    let backlog: Vec<_> =
        (11..3_011).map(|millis| ends.command(at(millis), rate(at(millis)))).collect();
    for command in &backlog {
        ends.far.on_message(at(3_011) + OFFSET, command);
        assert_eq!(ends.far.motion(at(3_011) + OFFSET), Motion::Hold);
    }
    assert_eq!(ends.far.rejects().get(Reject::Old), 3_000);
    assert_eq!(ends.far.reason(), Reason::Silence);
}

#[test]
fn hazard_37_second_node_reads_who_leads() {
    let mut ends = Ends::armed();
    let mut second = NodeEnd::new(ARM, 33);
    second.begin_epoch();
    let order = Order { motion: rate(at(5)), is_engaged: true, gripper: None };
    for millis in 5..300 {
        ends.far.on_message(at(millis) + OFFSET, &second.command(at(millis), &order));
        let (performed, _) = ends.exchange(at(millis), rate(at(millis)));
        assert_eq!(performed, rate(at(millis)));
        let feedback = ends.feedback(at(millis));
        assert_eq!(second.on_message(at(millis), &feedback), None);
    }
    assert_eq!(second.rejects().get(Reject::Session), 295, "echoes of the node that leads");
    assert_eq!(ends.far.rejects().get(Reject::NotLeader), 295);
}

#[test]
fn hazard_37_node_that_led_before_never_leads_again() {
    let mut ends = Ends::armed();
    let mut second = Ends { node: NodeEnd::new(ARM, 33), far: ends.far.clone() };
    let led = |ends: &mut Ends, from: u64| {
        (from..from + 5).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
        ends.node.begin_epoch();
        ends.exchange(at(from + 5), rate(at(from))).0
    };
    assert_eq!(led(&mut second, 200), rate(at(200)));
    assert_eq!(second.far.leader(), (33, 1));
    ends.far = second.far;
    assert_eq!(led(&mut ends, 400), Motion::Hold);
    assert_eq!(ends.far.leader(), (33, 1));
    assert!(ends.far.rejects().get(Reject::Left) > 0);
}

#[test]
fn hazard_34_restarted_far_side_holds_in_the_epoch_it_finds() {
    let mut ends = Ends::armed();
    ends.far = FarEnd::new(ARM, 44, HOLD_AFTER);
    for millis in 4..300 {
        let (performed, sample) = ends.exchange(at(millis), rate(at(millis)));
        assert_eq!(performed, Motion::Hold);
        // The former session is current while its newest echo is fresh.
        assert_eq!(sample.is_some(), millis >= 104, "{millis}");
    }
    assert_eq!((ends.node.far_session(), ends.far.reason()), (44, Reason::NotArmed));
    ends.node.begin_epoch();
    assert_eq!(ends.exchange(at(300), rate(at(300))).0, rate(at(300)));
}

#[test]
fn rejected_capability_leaves_the_valid_one() {
    let mut ends = Ends::armed();
    let invalid = |ends: &mut Ends, now, session| {
        let Feedback { mut head, .. } = Feedback::decode(&ends.feedback(now)).unwrap();
        head.own.session = session;
        ends.node.on_message(now, &Capability { hold_after: -1.0, ..FIGURES }.encode(&head));
    };
    invalid(&mut ends, at(4), 23);
    assert_eq!(ends.node.rejected(), Some(Reject::Impossible));
    assert_eq!((ends.node.capability(), ends.node.invalid_capability()), (None, None), "another");
    invalid(&mut ends, at(5), 22);
    let reason = ends.node.invalid_capability().map(|invalid| invalid.to_string());
    assert_eq!(reason.as_deref(), Some("hold_after must be within 0..=1000000000, got -1"));
    assert_eq!(ends.node.capability(), None);
    ends.exchange(at(6), Motion::Hold);
    let capability = ends.far.capability(at(6) + OFFSET, &FIGURES).unwrap();
    ends.node.on_message(at(6), &capability);
    invalid(&mut ends, at(7), 22);
    assert_eq!(ends.node.rejected(), Some(Reject::Impossible));
    assert_eq!((ends.node.capability(), ends.node.invalid_capability()), (Some(&FIGURES), None));
}

#[test]
fn capability_is_asked_until_the_session_has_one() {
    let mut ends = Ends::new();
    assert!(ends.far.capability(at(0) + OFFSET, &FIGURES).is_none());
    (0..3).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
    let capability = ends.far.capability(at(3) + OFFSET, &FIGURES).unwrap();
    assert!(ends.node.capability().is_none());
    ends.node.on_message(at(3), &capability);
    assert_eq!(ends.node.capability(), Some(&FIGURES));
    (4..6).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
    assert!(ends.far.capability(at(6) + OFFSET, &FIGURES).is_none(), "no longer asked");
    ends.far = FarEnd::new(ARM, 44, HOLD_AFTER);
    (200..205).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
    assert!(ends.node.capability().is_none(), "of another session");
    assert!(ends.far.capability(at(205) + OFFSET, &FIGURES).is_some());
}

#[test]
fn unlimited_figures_are_sent_as_the_largest() {
    let mut ends = Ends::new();
    (0..3).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
    let unlimited = Capability { stiffest_contact: f64::INFINITY, ..FIGURES };
    let capability = ends.far.capability(at(3) + OFFSET, &unlimited).unwrap();
    ends.node.on_message(at(3), &capability);
    assert_eq!(ends.node.capability().map(|it| it.stiffest_contact), Some(1e9));
}

#[test]
fn losses_are_counted_once_and_late_feedback_is_not_lost() {
    let mut ends = Ends::armed();
    let sent: Vec<_> = (5..15).map(|millis| ends.feedback(at(millis))).collect();
    // 0 to 3, 6, 5 late, 9 twice: 4, 7 and 8 are lost.
    for place in [0, 1, 2, 3, 6, 5, 9, 9] {
        ends.node.on_message(at(20), &sent[place]);
    }
    assert_eq!(ends.node.lost(), 3);
}

#[test]
fn losses_of_an_interruption_are_counted() {
    let mut ends = Ends::armed();
    // 500 feedbacks are lost, and the next ones have echoes that are too old.
    (4..504).for_each(|millis| _ = ends.feedback(at(millis)));
    for millis in 504..510 {
        let feedback = ends.feedback(at(millis));
        assert_eq!(ends.node.on_message(at(millis), &feedback), None);
    }
    assert_eq!(ends.node.lost(), 500);
}

#[test]
fn last_number_of_a_session_overflows_nothing() {
    let mut ends = Ends::armed();
    let mut bytes = ends.feedback(at(5));
    bytes[20..28].copy_from_slice(&u64::MAX.to_le_bytes());
    assert!(ends.node.on_message(at(5), &bytes).is_some());
    let next = ends.feedback(at(6));
    assert_eq!(ends.node.on_message(at(6), &next), None);
    assert!(ends.node.lost() > 1 << 63);
}

#[test]
fn hazard_34_interrupted_link_resumes_in_the_same_session() {
    for [there, back] in [[false, true], [true, false], [false, false]] {
        let mut ends = Ends::armed();
        for millis in 4..1_000 {
            let command = ends.command(at(millis), Motion::Hold);
            if there {
                ends.far.on_message(at(millis) + OFFSET, &command);
            }
            ends.far.motion(at(millis) + OFFSET);
            let feedback = ends.feedback(at(millis));
            if back {
                ends.node.on_message(at(millis), &feedback);
            }
        }
        assert_eq!(ends.far.reason(), Reason::Silence);
        (1_000..1_004).for_each(|millis| _ = ends.exchange(at(millis), Motion::Hold));
        ends.node.begin_epoch();
        let (performed, sample) = ends.exchange(at(1_004), rate(at(1_004)));
        assert_eq!(performed, rate(at(1_004)));
        assert!(sample.is_some_and(|sample| sample.at >= at(1_003)));
        assert_eq!((ends.far.leader(), ends.node.far_session()), ((11, 2), 22));
    }
}
