//! `kind = "both"`: a robot in another process, and its model in the node.

use crate::common::linked::{LINK, MODEL, linked, with_model};
use crate::common::prelude::*;
use crate::common::refusals::are_refused;
use crate::linked_node::{Network, ask, booted_near, cycles, engage, parse_as};
use node::cause::CauseKind;
use remote::model::Difference;

/// Returns the names of the shipped hand controllers.
fn hands() -> impl Iterator<Item = &'static str> {
    HAND_CONTROLLERS.map(|file| &file["config/".len()..file.len() - ".toml".len()]).into_iter()
}

const HALF: Duration = Duration::from_micros(500);

/// Within the figures of the link: a round trip of five cycles.
const NETWORKS: [Network; 3] = [
    Network { delay: Duration::ZERO, jitter: Duration::ZERO, loss: 0.0, duplicates: 0.0 },
    Network { delay: HALF, jitter: MS, loss: 0.0, duplicates: 0.0 },
    Network { delay: HALF, jitter: MS, loss: 0.01, duplicates: 0.1 },
];

#[test]
fn hazard_49_contact_over_a_link_stays_within_the_limit() {
    for hand in hands() {
        let text = with_model(hand);
        let cycles = 5.0e3 * parse_as(hand, &text).period.as_secs_f64();
        let stated = format!("round_trip_ms = {:.1}", cycles.max(5.0));
        let config = parse_as(hand, &text.replace("round_trip_ms = 5.0", &stated));
        let limit = config.far_side.model_limit.unwrap();
        for network in NETWORKS {
            let (mut node, _) = booted_near(hand, &config, network, ());
            engage(&mut node);
            let mut found = Difference::default();
            let mut pressed: f64 = 0.0;
            for _ in 0..10_000 {
                let record = node.cycle();
                found = found.max(record.model.unwrap());
                pressed = pressed.max(record.f_s.force.norm());
            }
            assert_eq!(node.cause(), None, "{hand} {network:?}");
            assert!(pressed > 1.0, "{hand} {network:?}: {pressed} N");
            assert!(
                found.distance < 0.5 * limit.distance && found.angle < 0.5 * limit.angle,
                "{hand} {network:?}: {found:?}"
            );
        }
    }
}

#[test]
fn hazard_49_robot_that_does_not_follow_ends_reflection() {
    for hand in hands() {
        let config = parse_as(hand, &with_model(hand));
        let (mut node, handle) = booted_near(hand, &config, Network::default(), ());
        handle.is_blocked.set(true);
        assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
        let stopped = (0..10_000).map(|_| node.cycle()).find(|record| record.cause.is_some());
        let stopped = stopped.unwrap_or_else(|| panic!("{hand}: {:?}", node.cycle().model));
        let Some(Cause::ModelDiffers { micrometres, millidegrees }) = stopped.cause else {
            panic!("{hand}: {:?}", stopped.cause);
        };
        // At 0.5 m/s a cycle more than the limit.
        let is_just_beyond =
            (20_000..20_600).contains(&micrometres) || (5_000..5_200).contains(&millidegrees);
        assert!(is_just_beyond, "{hand}: {micrometres} um, {millidegrees} mdeg");
        assert_eq!(stopped.mode, Mode::ReflectionOff, "{hand}");
        let after = cycles(&mut node, 100);
        assert_eq!(after.output.command, Motion::Hold, "{hand}");
        let Difference { distance, angle } = after.model.unwrap();
        assert!(distance < 1e-9 && angle < 1e-9, "{hand}: nothing is commanded");
        assert_eq!(after.cause.map(|cause| cause.kind()), Some(CauseKind::ModelDiffers), "{hand}");
    }
}

#[test]
fn views_have_the_joints_of_the_model() {
    let arm = "robot = \"robots/puma560.toml\"";
    let text = with_model("kraft_like")
        .replace("start_m = [0.4, 0.0, 0.3] ", arm)
        .replace("start_deg = [90.0, 0.0, 90.0]", "");
    let config = parse(KRAFT, &text);
    let (mut node, _) = booted_near("kraft_like", &config, Network::default(), ());
    let record = engage(&mut node);
    let chain = *config.robot.as_ref().unwrap().law().chain();
    let followed = chain.forward(&record.q_r.unwrap().0.into());
    let off = (followed.translation.vector - record.x_b_m.translation.vector).norm();
    assert!(off < 2e-3, "{off} m");
}

#[test]
fn hazard_18_keys_of_a_model_are_refused_by_name() {
    let rows = [
        ("remote.link.model_limit_m", "0.002", "must be at least 0.0025"),
        ("remote.link.model_limit_deg", "0.1", "must be at least 0.57"),
        ("remote.link.model_limit_m", "nan", "must be within"),
    ];
    are_refused(KRAFT, &with_model("kraft_like"), &rows);
    let both =
        |keys: &str| linked("kraft_like", keys).replacen("kind = \"link\"", "kind = \"both\"", 1);
    let angle = format!("{LINK}\nmodel_limit_m = 0.02");
    for (text, reason) in [
        (both(LINK), "remote.link.model_limit_m: missing field"),
        (both(&angle), "remote.link.model_limit_deg: missing field"),
        (linked("kraft_like", &angle), "model_limit_deg: missing field"),
    ] {
        let refusal = refusal(KRAFT, &text);
        assert!(refusal.contains(reason), "{reason}: {refusal}");
    }
}

#[test]
fn one_key_switches_between_the_three_modes() {
    let file = fs::read_to_string(KRAFT).unwrap();
    let link = format!("[remote.link]\n{LINK}\n{MODEL}\n\n[safety]");
    let file = file.replacen("[safety]", &link, 1);
    for (kind, has_link, has_model) in
        [("virtual", false, false), ("link", true, false), ("both", true, true)]
    {
        let text = file.replacen("kind = \"virtual\"", &format!("kind = \"{kind}\""), 1);
        let far = parse(KRAFT, &text).far_side.clone();
        assert_eq!(
            (far.agreement.is_some(), far.model_limit.is_some()),
            (has_link, has_model),
            "{kind}"
        );
    }
}
