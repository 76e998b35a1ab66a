//! Small campaigns: their promises, and their repeatability. The large ones run from scripts/test.sh and
//! scripts/soak.sh.

use std::num::NonZero;

use crate::common::prelude::*;
use campaign::case::Case;
use campaign::run::{Campaign, Part};
use campaign::situation::Situation;
use campaign::table::Table;
use campaign::verdict::{Outcome, Verdict};
use campaign::{catalogue, soak, timers};
use node::{BringUpError, cause};

const SEED: u64 = 7;

/// Every shipped hand controller.
fn configs() -> Vec<Config> {
    HAND_CONTROLLERS.map(config).to_vec()
}

fn threads(count: usize) -> NonZero<usize> {
    NonZero::new(count).unwrap()
}

fn play(faults: usize, only: &str) -> Vec<Verdict> {
    let campaign = Campaign::new(SEED, configs(), faults, Some(only));
    assert!(!campaign.cases().is_empty(), "{only}");
    campaign.run(threads(2), &|| {}).unwrap()
}

/// Fails unless every criterion is met and no invariant violated.
fn all_pass(verdicts: &[Verdict]) {
    for verdict in verdicts {
        assert!(verdict.is_good(), "{verdict:?}");
    }
}

#[test]
fn campaign_of_a_seed_is_the_same_with_any_number_of_threads() {
    let campaign =
        |seed, count| Campaign::new(seed, configs(), 24, None).run(threads(count), &|| {}).unwrap();
    let (one, two) = (campaign(SEED, 1), campaign(SEED, 2));
    assert_eq!(one.len(), 24);
    assert_eq!(format!("{one:?}"), format!("{two:?}"));
    assert_eq!(Table::from_verdicts(&one).to_string(), Table::from_verdicts(&two).to_string());
    assert_ne!(format!("{one:?}"), format!("{:?}", campaign(SEED + 1, 2)));
}

#[test]
fn replayed_case_has_the_same_verdict() {
    let campaign = Campaign::new(SEED, configs(), 3, Some("TPDO lost"));
    let verdicts = campaign.run(threads(2), &|| {}).unwrap();
    for verdict in verdicts {
        let one = Campaign::of_one(SEED, configs(), verdict.number).unwrap();
        let mut cycles = 0;
        let of_case = &mut |_: &mut _, _: &_, part| cycles += u32::from(part == Part::Case);
        let (again, frames) = one.replay((), of_case).unwrap().unwrap();
        assert_eq!(format!("{again:?}"), format!("{verdict:?}"));
        assert!(cycles > 50 && frames.len() > 1_000);
    }
}

#[test]
fn cases_of_all_files_are_replayed_from_their_own_boots() {
    let configs = configs();
    let mut files = [0; HAND_CONTROLLERS.len()];
    // Ten rounds of the kinds, each on another file.
    let count = catalogue::kinds().count() * HAND_CONTROLLERS.len();
    for place in 0..60 {
        let number = u32::try_from(1 + place * count / 60).unwrap();
        let one = Campaign::of_one(SEED, configs.clone(), number).unwrap();
        files[one.cases()[0].config] += 1;
        let verdicts = one.run(threads(1), &|| {}).unwrap();
        let [verified] = &*one.verify(&verdicts, threads(1), &|| {}).unwrap() else { panic!() };
        assert_eq!((verified.case, verified.difference.as_deref()), (number, None));
        assert!(verified.cycles > 100 && verified.frames > verified.cycles, "{verified:?}");
    }
    assert_eq!(files, [6; HAND_CONTROLLERS.len()]);
}

#[test]
fn forged_statusword_is_a_drive_that_left() {
    let forged = "kind = \"foreign_frame\", bus = 0, cob_id = 0x286, payload = \"7614\"";
    let scenario = format!("seconds = 1.0\nfault = [{{ at_s = 0.5, {forged} }}]");
    let config = config(KRAFT);
    let mut bench = Bench::new(&config, script(&scenario), SEED, Wire::default());
    bench.bring_up().unwrap();
    let cause = (0..600).find_map(|_| bench.cycle().cause);
    assert_eq!(cause.map(|cause| cause.kind()), Some(cause::CauseKind::DriveLeft));
}

#[test]
fn boot_without_end_is_given_up_in_virtual_time() {
    let scenario = script("seconds = 1.0");
    let config = config(KRAFT);
    let mut bench = Bench::new(&config, scenario, SEED, Wire::default());
    let given_up = bench.bring_up_within(Duration::from_millis(100));
    assert!(matches!(given_up, Err(BringUpError::GivenUp | BringUpError::LeftOn(_))));
    let took = bench.now().since(Instant::ZERO);
    assert!(took < Duration::from_millis(700), "{took:?}");
}

#[test]
fn stopped_process_names_no_drive() {
    for only in ["process killed", "process stopped", "backlog after a stop"] {
        for verdict in play(6, only) {
            let kind = verdict.observed.cause.map(|cause| cause.kind());
            assert_eq!(kind, Some(cause::CauseKind::Overrun), "{verdict:?}");
        }
    }
}

#[test]
fn drives_are_off_115_ms_after_zero_torque() {
    for only in ["SYNC missing", "deadman channel stuck", "heartbeat lost"] {
        let verdicts = play(6, only);
        all_pass(&verdicts);
        assert!(Table::from_verdicts(&verdicts).total.off_ms.unwrap() <= 115.0);
    }
}

#[test]
fn two_thousand_faults_have_two_of_each_kind_per_file() {
    let campaign = Campaign::new(1, configs(), 2_000, None);
    for kind in catalogue::kinds() {
        for (place, file) in HAND_CONTROLLERS.iter().enumerate() {
            let is_it = |case: &&Case| (case.kind.name, case.config) == (kind.name, place);
            let count = campaign.cases().iter().filter(is_it).count();
            assert!(count >= 2, "{file}: {count} of {}", kind.name);
        }
    }
}

#[test]
fn every_kind_is_in_every_round_with_a_valid_scenario() {
    let count = catalogue::kinds().count();
    let campaign = Campaign::new(SEED, configs(), 10 * count, None);
    let of_round = |round: &[Case]| round.iter().map(|case| case.config).collect::<Vec<_>>();
    let places: Vec<_> = campaign.cases().chunks(count).map(of_round).collect();
    let expected: Vec<_> = (0..10).map(|round| vec![round % configs().len(); count]).collect();
    assert_eq!(places, expected, "each round is one file's");
    for round in campaign.cases().chunks(count) {
        let mut names: Vec<&str> = round.iter().map(|case| case.kind.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        for case in round {
            let scenario = case.scenario().unwrap_or_else(|error| panic!("{case:?}: {error}"));
            let written = scenario.to_toml();
            let read = Scenario::parse(&written);
            let read = read.unwrap_or_else(|error| panic!("{case:?}: {error}\n{written}"));
            // A force that is NaN equals none.
            assert_eq!(format!("{read:?}"), format!("{scenario:?}"));
        }
    }
    let mut phases: Vec<_> =
        campaign.cases().iter().map(|case| case.onset.as_micros() % 1_000).collect();
    phases.sort_unstable();
    phases.dedup();
    assert!(phases.len() > 300, "at any microsecond of a cycle: {}", phases.len());
    for situation in Situation::ALL {
        assert!(campaign.cases().iter().any(|case| case.situation == situation));
    }
}

#[test]
fn promise_01_detected_fault_stops_all_joints_in_five_cycles() {
    for only in ["drive unplugged", "wire cut", "SYNC missing"] {
        let verdicts = play(4, only);
        all_pass(&verdicts);
        let line = Table::from_verdicts(&verdicts).total;
        assert!(line.t_zero.unwrap().max <= 5 && line.spread.is_none_or(|spread| spread <= 1));
        assert_eq!((line.latched, line.missed, line.false_trips), (line.injected, 0, 0));
    }
}

#[test]
fn promise_02_drives_of_a_killed_node_stop_by_themselves() {
    let verdicts = play(10, "process killed");
    for verdict in &verdicts {
        assert_eq!(verdict.outcome, Outcome::Met, "{verdict:?}");
    }
    let limits = |verdict: &Verdict| verdict.criterion.to_string();
    let mut limits: Vec<String> = verdicts.iter().map(limits).collect();
    limits.sort();
    limits.dedup();
    let expected =
        [25, 33, 5, 6, 9].map(|millis| format!("drives torque-free within {millis}.0 ms"));
    assert_eq!(limits, expected);
}

#[test]
fn promise_02_and_03_expected_times_are_those_of_the_proof_test() {
    for config in configs() {
        let mut bench = Bench::new(&config, script("seconds = 1.0"), SEED, Wire::default());
        bench.bring_up().unwrap();
        let proven = bench.node().proof_test_report().reaction_time().unwrap();
        // What is measured includes the drive's report.
        let expected = timers::slowest(&config);
        let is_expected = (expected..expected + Duration::from_millis(1)).contains(&proven);
        assert!(is_expected, "{}: {proven:?} of {expected:?}", config.file.display());
    }
}

#[test]
fn promise_04_failed_drive_stops_the_others_in_two_cycles() {
    for only in ["drive fault", "safe torque off", "drive reboots"] {
        let verdicts = play(4, only);
        all_pass(&verdicts);
        assert!(Table::from_verdicts(&verdicts).total.t_zero.unwrap().max <= 2);
    }
}

#[test]
fn promise_08_reflection_ends_20_ms_after_the_deadman() {
    let verdicts = play(6, "deadman released");
    all_pass(&verdicts);
    assert!(Table::from_verdicts(&verdicts).total.t_zero_ms.unwrap() <= 20.0);
}

#[test]
fn promise_09_no_drive_of_any_file_pushes_before_arming() {
    all_pass(&play(10, "stored torque offset"));
    all_pass(&play(20, "torque before arming"));
}

#[test]
fn hazard_13_lost_commands_leave_no_drive_on() {
    for only in ["controlword lost", "RPDO lost"] {
        let verdicts = play(20, only);
        all_pass(&verdicts);
        assert_eq!(Table::from_verdicts(&verdicts).total.left_on, 0);
    }
}

#[test]
fn hazard_13_every_lost_rpdo_of_a_moving_arm_is_seen() {
    let verdicts = play(100, "RPDO lost");
    let case = |verdict: &Verdict| Case::draw(SEED, verdict.number, &configs()).unwrap();
    let (mut engaged, mut without_timer) = (0, 0);
    for verdict in verdicts.iter().filter(|verdict| verdict.kind == "RPDO lost") {
        let case = case(verdict);
        if Situation::ENGAGED.contains(&case.situation) {
            assert!(verdict.observed.detected.is_some(), "{verdict:?}");
            engaged += 1;
            without_timer += usize::from(case.injection.cut_off.is_some());
        }
    }
    assert!(engaged >= 20 && without_timer >= 8, "{engaged} {without_timer}");
}

#[test]
fn promise_10_no_acting_torque_is_older_than_a_drives_timer() {
    let configs = configs();
    let mut oldest = Duration::ZERO;
    for only in ["adapter stalls", "adapter stalls for a moment", "stall within a cycle"] {
        for verdict in play(20, only) {
            assert_eq!(verdict.outcome, Outcome::Met, "{verdict:?}");
            // The last target before the timer expires acts at the next SYNC.
            let limit = timers::oldest_torque(&configs[verdict.config]);
            assert!(verdict.observed.oldest <= limit, "{verdict:?}");
            oldest = oldest.max(verdict.observed.oldest);
        }
    }
    assert!(oldest > Duration::from_millis(10), "heartbeats end it late: {oldest:?}");
}

#[test]
fn promise_14_lost_samples_and_a_bad_link_stop_nothing() {
    let laps = soak::soak(SEED, &configs(), 30_000, threads(2), &|_| {}).unwrap();
    assert!(laps.iter().map(|lap| lap.cycles).sum::<u64>() >= 30_000);
    for lap in laps {
        assert!(lap.is_good(), "{lap:?}");
    }
}
