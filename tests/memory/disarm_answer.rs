//! Answer to a disarm: it says that the arm is torque-free only when the drives are. Hazard 13.

use crate::common::prelude::*;
use config::SeenBy;
use node::push::Push;
use units::drive::PerMille;

/// Script, and the time of the request to disarm in it, in s.
#[derive(Clone, Copy, Debug)]
struct Situation {
    script: &'static str,
    request_s: f64,
}

/// Engaged and in contact: presses into the wall from 3.0 s on.
const CONTACT: Situation =
    Situation { script: include_str!("../../config/scenarios/contact_10s.toml"), request_s: 4.0 };

/// Armed with an open deadman: gravity compensation alone.
const ARMED: Situation = Situation {
    script: "seconds = 5\n[[console]]\nat_s = 0.02\nrequest = \"arm\"\n",
    request_s: 1.5,
};

/// Configurations of drives without an RPDO timer.
const WITHOUT_TIMER: [&str; 4] = [
    "config/drives/elmo_gold.toml",
    "config/drives/maxon_epos4.toml",
    "config/drives/nanotec_cl4e.toml",
    "config/drives/technosoft_ipos.toml",
];

/// Maximum torque demand (6074h) of a drive that does not push, in ‰ of rated torque.
const TORQUE_FREE: f64 = 20.0;

/// Answer to a disarm, with the ground truth at its time.
#[derive(Clone, Copy, Debug)]
struct Answer {
    /// Time from the request to the end of the answer's cycle.
    after: Duration,
    mode: Mode,
    pushes: [Push; 6],
    /// Torque demand of each drive, in ‰ of rated torque.
    demands: [f64; 6],
    /// Largest torque demand when the mode became ready; zero if it did not.
    at_ready: f64,
    /// Time from the answer until no torque demand is larger than [`TORQUE_FREE`].
    torque_time: Duration,
}

impl Answer {
    fn is_torque_free(&self) -> bool {
        self.pushes == [Push::Excluded; 6]
    }

    /// Returns the largest torque demand, in ‰ of rated torque.
    fn demand(&self) -> f64 {
        largest(&self.demands)
    }
}

fn largest(demands: &[f64; 6]) -> f64 {
    demands.iter().fold(0.0, |largest: f64, demand| largest.max(demand.abs()))
}

/// Returns the torque demand of each drive, in ‰ of rated torque.
fn demands(bench: &Bench<()>) -> [f64; 6] {
    bench.node().bus().stations().drives().each_ref().map(|it| it.demand())
}

/// Returns a bench shortly before the request. Every drive has this quirk, if any.
fn before(situation: Situation, config: &Config, quirk: Option<&str>) -> Bench<()> {
    let mut scenario = script(situation.script);
    for joint in Joint::ALL {
        scenario.quirks_mut().add(joint, quirk.map(|it| it.parse::<Quirk>().unwrap()));
    }
    let mut bench = started(config, scenario, ());
    while bench.elapsed().as_secs_f64() < situation.request_s - 0.15 {
        bench.cycle();
    }
    bench
}

/// Returns the fault of RPDOs of a joint that are lost from a time after the request on, in s.
fn lost(situation: Situation, joint: usize, after_s: f64) -> String {
    let at_s = situation.request_s + after_s;
    format!("[[fault]]\nat_s = {at_s:.4}\nkind = \"drop\"\njoint = {joint}\nframe = \"rpdo1\"\n")
}

/// Disarms with these faults; returns the answer. Until then no push is excluded of a drive that applies torque.
fn disarmed(bench: &Bench<()>, config: &Config, situation: Situation, faults: &str) -> Answer {
    let mut bench = bench.clone();
    bench.follow(script(&format!("{}{faults}", situation.script)), 1);
    while bench.elapsed().as_secs_f64() < situation.request_s {
        bench.cycle();
    }
    let requested_at = bench.now();
    bench.ask(Request::Disarm).unwrap();
    let has_timer = config.held_torques()[0].seen_by == SeenBy::RpdoTimer;
    let mut at_ready = None;
    let mut answer = loop {
        let record = bench.cycle();
        let demands = demands(&bench);
        if !record.mode.allows_torque() {
            let is_ready = record.mode == Mode::Ready;
            at_ready = at_ready.or(is_ready.then(|| largest(&demands)));
            for (place, push) in record.pushes.iter().enumerate() {
                let is_said_free = *push == Push::Excluded && !has_timer;
                assert!(
                    !is_said_free || demands[place].abs() <= TORQUE_FREE,
                    "{faults}: joint {} is said to apply no torque: {demands:?}",
                    place + 1
                );
            }
        }
        let after = bench.now().since(requested_at);
        if record.is_torque_free() || after >= config.disarm_timeout() {
            let (mode, pushes) = (record.mode, record.pushes);
            let at_ready = at_ready.unwrap_or_default();
            break Answer { after, mode, pushes, demands, at_ready, torque_time: Duration::ZERO };
        }
    };
    let answered_at = bench.now();
    while largest(&demands(&bench)) > TORQUE_FREE {
        bench.cycle();
    }
    answer.torque_time = bench.now().since(answered_at);
    answer
}

#[test]
fn disarm_of_each_shipped_arm_is_answered_in_100_ms() {
    println!("configuration                      answer, filtered 6077h, in ms");
    for file in HAND_CONTROLLERS {
        let config = config(file);
        let times = [None, Some("filtered-torque")].map(|quirk| {
            let answer = disarmed(&before(CONTACT, &config, quirk), &config, CONTACT, "");
            assert!(answer.is_torque_free() && answer.mode == Mode::Ready, "{file}: {answer:?}");
            assert!(answer.demand() <= TORQUE_FREE, "{file}: {answer:?}");
            answer.after.as_secs_f64() * 1e3
        });
        println!("{file:34} {:6.1} {:6.1}", times[0], times[1]);
        // The recorder thread and the socket take the rest.
        assert!(times.iter().all(|ms| *ms < 85.0), "{file}: {times:?}");
    }
}

#[test]
fn hazard_13_disarm_never_hides_a_held_torque() {
    println!("configuration                      losses, torque held in ready, answered as a stop");
    for file in WITHOUT_TIMER {
        let config = config(file);
        let (mut losses, mut held, mut stopped, mut torque) = (0, 0, 0, 0.0_f64);
        for (situation, quirk) in
            [(CONTACT, None), (CONTACT, Some("filtered-torque")), (ARMED, None)]
        {
            let bench = before(situation, &config, quirk);
            for (joint, step) in [2, 3].into_iter().flat_map(|it| (-25..=13).map(move |n| (it, n)))
            {
                let fault = lost(situation, joint, 0.0043 * f64::from(step));
                let answer = disarmed(&bench, &config, situation, &fault);
                let case = format!("{file}: {fault}{quirk:?}: {answer:?}");
                losses += 1;
                held += u32::from(answer.at_ready > TORQUE_FREE);
                stopped += u32::from(answer.mode.is_stopped());
                torque = torque.max(answer.at_ready);
                if answer.is_torque_free() {
                    assert!(answer.demand() <= TORQUE_FREE, "{case}");
                } else {
                    let pushes = answer.pushes.iter().filter(|it| **it != Push::Excluded);
                    assert_eq!(pushes.count(), 1, "{case}");
                    assert_ne!(answer.pushes[joint - 1], Push::Excluded, "{case}");
                }
            }
        }
        println!("{file:34} {losses} {held} (up to {torque:.0} ‰) {stopped}");
        // An answer by the mode alone would hide these.
        assert!(held >= 10 && torque > 100.0, "{file}: {held} of {losses}, up to {torque} ‰");
    }
}

#[test]
fn hazard_13_drive_that_cannot_be_disabled_is_named() {
    for file in WITHOUT_TIMER {
        let config = config(file);
        let bench = before(ARMED, &config, None);
        // Neither its controlwords nor NMT stopped end its torque.
        let at_s = ARMED.request_s;
        let ignores =
            format!("[[fault]]\nat_s = {at_s}\nkind = \"controlword_ignored\"\njoint = 3\n");
        let no_nmt =
            format!("[[fault]]\nat_s = {at_s}\nkind = \"drop\"\njoint = 3\nframe = \"nmt\"\n");
        let faults = format!("{ignores}{no_nmt}{}", lost(ARMED, 3, 0.0));
        let mut bench = bench.clone();
        bench.follow(script(&format!("{}{faults}", ARMED.script)), 1);
        while bench.elapsed().as_secs_f64() < ARMED.request_s {
            bench.cycle();
        }
        let requested_at = bench.now();
        bench.ask(Request::Disarm).unwrap();
        let mut held_until = requested_at;
        let record = loop {
            let record = bench.cycle();
            assert!(!record.is_torque_free(), "{file}");
            if demands(&bench)[2].abs() > 100.0 {
                held_until = bench.now();
            }
            if bench.now().since(requested_at) >= config.disarm_timeout() {
                break record;
            }
        };
        let [_, _, Push::Shown(PerMille(shown)), ..] = record.pushes else {
            panic!("{file}: {record:?}")
        };
        assert!(shown.abs() > 100, "{file}: {shown} ‰");
        // An answer by the mode would have come before. At the end its watchdog may have switched it off.
        assert!(held_until.since(requested_at) >= 55 * MS, "{file}: {held_until:?}");
    }
}

#[test]
fn hazard_13_rpdo_timer_ends_torque_held_at_an_answer() {
    println!("configuration                      largest torque at the answer, its longest time");
    for file in HAND_CONTROLLERS {
        let config = config(file);
        if config.held_torques()[0].seen_by != SeenBy::RpdoTimer {
            continue;
        }
        let bench = before(CONTACT, &config, None);
        let (mut torque, mut longest) = (0.0_f64, Duration::ZERO);
        for (joint, ms) in [2, 3].into_iter().flat_map(|it| (30..=60).map(move |ms| (it, ms))) {
            let fault = lost(CONTACT, joint, 0.001 * f64::from(ms));
            let answer = disarmed(&bench, &config, CONTACT, &fault);
            if answer.mode == Mode::Ready {
                torque = torque.max(answer.demand());
                longest = longest.max(answer.torque_time);
            }
        }
        println!("{file:34} {torque:.0} ‰ {longest:?}");
        assert!(longest <= config.held_torques()[0].time, "{file}: {torque} ‰ for {longest:?}");
    }
}
