//! The dual peg of Table I, in short, the work of Eq. 11, and settings that are refused.

use serde_json::Value;

use crate::common::prelude::*;
use experiments::dual_peg::bench::{self, Situation};
use experiments::dual_peg::condition::Condition;
use experiments::dual_peg::contact_work::ContactWork;
use experiments::dual_peg::settings::DualPeg;
use experiments::dual_peg::trial::{Outcome, Trial};
use units::spatial::{Twist, Wrench};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/config/dual_peg.toml");

fn settings() -> DualPeg {
    DualPeg::load(Path::new(FILE)).unwrap()
}

fn played(settings: &DualPeg, condition: Condition, situation: &Situation) -> Trial {
    let operator = ("steady", bench::operator("steady").unwrap());
    Trial::play(settings, condition, operator, 0, situation).unwrap()
}

#[test]
fn aligned_pegs_are_inserted_without_work() {
    let settings = settings();
    let situation = Situation::drawn(&settings, 1, [0.0; 2], [0.0; 2], 0.0);
    for condition in [Condition::NEITHER, Condition::BOTH] {
        let trial = played(&settings, condition, &situation);
        assert_eq!(trial.outcome, Outcome::Inserted, "{condition}");
        assert!(trial.literal() < 0.01 && trial.attempts == 1, "{trial:?}");
    }
}

#[test]
fn both_switches_on_take_less_work_than_both_off() {
    let settings = settings();
    let situation = Situation::drawn(&settings, 7, [0.002; 2], [0.02; 2], 0.001);
    let work = |condition| {
        let trial = played(&settings, condition, &situation);
        assert_eq!(trial.outcome, Outcome::Inserted, "{condition}");
        let parts = trial.literal_j.iter().zip(&trial.absolute_j);
        assert!(parts.into_iter().all(|(literal, absolute)| *literal <= absolute + 1e-12));
        trial.literal()
    };
    let (both, neither) = (work(Condition::BOTH), work(Condition::NEITHER));
    assert!(both < 0.5 * neither, "{both} J, {neither} J");
}

#[test]
fn same_trial_is_the_same_bit_for_bit() {
    let settings = settings();
    let situation = Situation::drawn(&settings, 3, [0.001; 2], [0.01; 2], 0.001);
    let [first, second] = [(); 2].map(|()| played(&settings, Condition::BOTH, &situation));
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
}

#[test]
fn invalid_settings_are_refused_by_key() {
    let text = fs::read_to_string(FILE).unwrap();
    for (old, new, expected) in [
        (
            "radius_m = 0.01012",
            "radius_m = 0.0099",
            "holes.radius_m: must be above pegs.radius_m = 0.01",
        ),
        (
            "accommodation_m_per_ns = 0.0002",
            "accommodation_m_per_ns = 0.001",
            "control.accommodation_m_per_ns: K_FA k_e τ_s",
        ),
        (
            "insert_depth_m = 0.020",
            "insert_depth_m = 0.050",
            "holes.insert_depth_m: must be below pegs.length_m",
        ),
        ("trials = 20", "trials = 0", "trials: must be within 1..="),
        (
            "misalignment_deg = [0.0, 2.0]",
            "misalignment_deg = [2.0, 0.0]",
            "start.misalignment_deg: must rise",
        ),
        ("height_m = 0.030", "height_m = 0.001", "start.height_m: must be above"),
        ("stall_s = 0.6", "stall = 0.6", "operator.stall: unknown key"),
        ("robots/puma560.toml", "robots/absent.toml", "config/robots/absent.toml"),
    ] {
        assert!(text.contains(old), "{old}");
        let changed = text.replacen(old, new, 1);
        let message = DualPeg::parse(Path::new(FILE), &changed).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn contact_work_matches_the_reference() {
    let paper = fs::read_to_string(format!("{ROOT}/tests/oracles/paper.json")).unwrap();
    let eq11 = &serde_json::from_str::<Value>(&paper).unwrap()["eq11"];
    let work_of = |samples: u32, force: fn(f64) -> [f64; 6], way: fn(f64) -> [f64; 6]| {
        let mut work = ContactWork::default();
        let at = |sample: u32| f64::from(sample) / f64::from(samples - 1);
        for sample in 0..samples {
            let before = way(at(sample.saturating_sub(1)));
            let mut dx = way(at(sample));
            dx.iter_mut().zip(before).for_each(|(now, before)| *now -= before);
            work.add(&Wrench::from_components(force(at(sample))), &Twist::from_components(dx));
        }
        [work.literal(), work.absolute()]
    };
    let expected = |case: &str| ["W_literal", "W_abs"].map(|key| eq11[case][key].as_f64().unwrap());
    let monotone = work_of(
        101,
        |s| [20.0 * s, 0.0, 0.0, 0.0, -s * s, 0.0],
        |s| [0.1 * s, 0.0, 0.0, 0.0, -0.2 * s * s, 0.0],
    );
    assert_near(monotone, expected("monotone"));
    let round_trip = work_of(
        201,
        |s| [20.0 * (1.0 - (2.0 * s - 1.0).abs()), 0.0, 0.0, 0.0, 0.0, 0.0],
        |s| [0.1 * (1.0 - (2.0 * s - 1.0).abs()), 0.0, 0.0, 0.0, 0.0, 0.0],
    );
    assert_near(round_trip, expected("elastic_round_trip"));
}

/// Asserts that two works are equal within rounding, in J.
#[track_caller]
fn assert_near(found: [f64; 2], expected: [f64; 2]) {
    let is_near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(is_near, "{found:?}, expected {expected:?}");
}
