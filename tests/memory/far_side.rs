//! A robot in another process: its configuration, contact, faults of the network and of the far side, and refusals.

use contract::Reason;

use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use crate::linked_node::{LinkedNode, Network, ask, booted, cycles, engage};

/// Shipped hand controllers.
const HANDS: [&str; 3] = ["kraft_like", "jpl_like", "sixr_spherical"];

#[test]
fn link_is_accepted_for_every_hand_controller() {
    for name in HANDS {
        let config = parse(KRAFT, &linked(name, LINK));
        let agreement = config.far_side.agreement.unwrap();
        assert_eq!((agreement.round_trip, agreement.stated.stiffest_contact), (MS * 5, 2_000.0));
        assert_eq!(agreement.stated.accommodation, [0.01, 0.01, 0.01, 0.5, 0.5, 0.5]);
    }
}

#[test]
fn round_trip_and_contact_of_a_link_count_for_stability() {
    let most = |keys: &str| {
        let findings = parse(KRAFT, &linked("kraft_like", keys)).findings();
        let held = findings.iter().filter(|finding| finding.name == "rate reflection, held");
        held.map(|finding| finding.right.value).fold(f64::INFINITY, f64::min)
    };
    let softer = |ms: u32| format!("round_trip_ms = {ms}.0\nstiffest_contact_n_per_m = 500.0");
    let bounds = [5, 16].map(|ms| most(&softer(ms)));
    assert!(bounds[0] > bounds[1], "{bounds:?}");
    let stiff = "round_trip_ms = 5.0\nstiffest_contact_n_per_m = 200000.0";
    let refused = refusal(KRAFT, &linked("kraft_like", stiff));
    assert!(refused.contains("controller."), "{refused}");
}

#[test]
fn keys_that_a_link_excludes_or_lacks_are_named() {
    for (keys, reason) in [
        ("round_trip_ms = 5.0", "remote.link.stiffest_contact_n_per_m: missing field"),
        ("stiffest_contact_n_per_m = 1e3", "remote.link.round_trip_ms: missing field"),
        ("round_trip_ms = 21.0\nstiffest_contact_n_per_m = 1e3", "at most the maximum age"),
        ("delay_ms = 2.0\nround_trip_ms = 5.0", "remote.link.delay_ms: describes a simulated link"),
        ("seed = 2\nround_trip_ms = 5.0", "remote.link.seed: describes a simulated link"),
        ("sensor_range_n = -5.0", "remote.link.sensor_range_n: must be within"),
        ("sample_period_ms = nan", "remote.link.sample_period_ms: must be within"),
        ("arm = 70000", "invalid value: integer `70000`"),
    ] {
        let refused = refusal(KRAFT, &linked("kraft_like", keys));
        assert!(refused.contains(reason), "{reason}: {refused}");
    }
    let text = fs::read_to_string(KRAFT).unwrap();
    let text = text.replacen("kind = \"virtual\"", "kind = \"link\"", 1);
    let refused = refusal(KRAFT, &text);
    for key in ["remote.wall: ", "remote.box: ", "remote.link.round_trip_ms: "] {
        assert!(refused.contains(key), "{key}: {refused}");
    }
}

#[test]
fn contact_is_felt_through_the_socket_with_every_hand() {
    for hand in HANDS {
        let (mut node, _) = booted(hand, LINK, Network::default());
        assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed), "{hand}");
        let felt = (0..2_000).map(|_| node.cycle().output.f_g_task.force.norm());
        let most = felt.fold(0.0, f64::max);
        assert_eq!(node.cause(), None, "{hand}");
        assert!(most > 1.0, "{hand}: {most} N");
    }
}

/// The far side writes the time of each sample into its force: on any network, no sample beyond the maximum age acts.
#[test]
fn hazard_36_no_sample_older_than_its_limit_acts_on_any_network() {
    // At 8 ms a sample acts at an age of 19 ms: jitter of 1 ms or one lost message is too much.
    let half = MS / 2;
    for (delay, max_age, jitter, loss) in [
        (0, 20, half, 0.01),
        (2, 20, half, 0.01),
        (5, 20, half, 0.01),
        (8, 20, Duration::ZERO, 0.0),
        (20, 100, MS * 2, 0.01),
        (40, 100, MS * 4, 0.01),
    ] {
        let keys = format!(
            "round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0"
        );
        let network = Network { delay: MS * delay, jitter, loss, duplicates: 0.05 };
        let (mut node, handle) = booted("kraft_like", &keys, network);
        handle.writes_its_time.set(true);
        engage(&mut node);
        let (mut acted, mut oldest) = (0, 0.0_f64);
        for _ in 0..1_500 {
            let record = node.cycle();
            if record.mode == Mode::Engaged {
                let age = record.at.since(Instant::ZERO).as_secs_f64() - record.f_s.force.x;
                oldest = oldest.max(age);
                acted += 1;
            }
        }
        assert_eq!(node.cause(), None, "{delay} ms");
        let most = f64::from(max_age) * 1e-3 + 2e-3;
        assert!(acted > 1_000 && oldest <= most, "{delay} ms: {oldest} s in {acted} cycles");
    }
}

/// Runs the node up to engagement, then `cut`; returns the time for which reflection still acted.
fn reflected_after(node: &mut LinkedNode, cut: impl FnOnce()) -> Duration {
    let record = engage(node);
    assert_eq!((record.mode, record.cause), (Mode::Engaged, None));
    cut();
    let (from, mut felt_for) = (record.at, Duration::ZERO);
    for _ in 0..400 {
        let record = node.cycle();
        if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            felt_for = record.at.since(from);
        }
    }
    assert_eq!(node.mode(), Mode::ReflectionOff);
    felt_for
}

#[test]
fn hazard_34_cut_link_ends_reflection_until_a_reset() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let felt_for = reflected_after(&mut node, || handle.is_cut.set(true));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::LinkLost));
    let refused = ask(&mut node, Request::Reset).unwrap_err();
    assert_eq!(refused, "the far side does not answer: connect it to the link's socket");
    handle.is_cut.set(false);
    cycles(&mut node, 50);
    assert_eq!(node.remote().far.reason(), Reason::Silence, "it goes on in no old epoch");
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn hazard_47_reason_of_a_hold_is_the_cause_and_a_reset_ends_it() {
    let (mut node, handle) = booted("jpl_like", LINK, Network::default());
    let held = Some(Reason::SensorSaturated);
    let felt_for = reflected_after(&mut node, || handle.hold.set(held));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::FarSideHolds { reason: Reason::SensorSaturated }));
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn restarted_far_side_is_felt_after_a_reset_alone() {
    let (mut node, handle) = booted("kraft_like", LINK, Network::default());
    let felt_for = reflected_after(&mut node, || handle.restarts.set(true));
    assert!(felt_for <= MS * 70, "{felt_for:?}");
    assert_eq!(node.cause(), Some(Cause::LinkLost));
    assert_eq!(node.remote().far.reason(), Reason::NotArmed);
    assert_eq!(ask(&mut node, Request::Reset), Ok(Mode::Armed));
    cycles(&mut node, 10);
    assert_eq!((node.cause(), node.remote().far.reason()), (None, Reason::None));
}

#[test]
fn hazard_48_slow_link_stops_while_engaged_and_names_both_times() {
    let keys = "round_trip_ms = 5.0\nmax_age_ms = 20.0\nstiffest_contact_n_per_m = 2000.0";
    let network = Network { delay: MS * 4, ..Network::default() };
    let (mut node, _) = booted("kraft_like", keys, network);
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
    cycles(&mut node, 2_000);
    let cause = node.cause().unwrap();
    assert!(matches!(cause, Cause::LinkSlow { p99_us: 8_000.., stated_us: 5_000 }), "{cause}");
    assert_eq!(node.mode(), Mode::ReflectionOff);
}

#[test]
fn arming_names_every_figure_that_is_worse_than_stated() {
    let (mut node, _) = booted("kraft_like", LINK, Network::default());
    node.remote_mut().capability.servo_lag = 0.05;
    node.remote_mut().capability.stiffest_contact = 9_000.0;
    // After a restart of the far side, its figures are requested again.
    node.remote_mut().handle.restarts.set(true);
    cycles(&mut node, 300);
    assert_eq!(
        ask(&mut node, Request::Arm).unwrap_err(),
        "remote.servo_time_constant_s is 0.01, and the far side has 0.05: correct the key, or the far side; \
         remote.link.stiffest_contact_n_per_m is 2000, and the far side has 9000: correct the key, or the far side"
    );
    assert_eq!(node.mode(), Mode::Ready);
}
