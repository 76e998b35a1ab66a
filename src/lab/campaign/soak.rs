//! Long runs in which nothing may trip: a link that loses one word in a hundred, drives whose samples are lost
//! one in a thousand, and an operator who works, touches, lets go and comes back.

use std::num::NonZero;
use std::time::Duration;

use crate::bench::Bench;
use crate::campaign::draw::Draw;
use crate::campaign::monitor::Monitor;
use crate::campaign::play;
use crate::campaign::play::StageError;
use crate::campaign::run::each;
use config::Config;
use node::cause::Cause;
use sim::scenario::Scenario;
use units::numbering::Joint;

/// One lap takes so long, in s.
const LAP_S: f64 = 20.0;

/// The share of the link's words that are lost.
const LINK_LOSS: f64 = 0.01;

/// The share of each drive's samples that are lost.
const TPDO_LOSS: f64 = 0.001;

/// What one lap came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Lap {
    /// Its number, from 1.
    pub number: u32,
    /// The hand controller: a place in the list.
    pub config: usize,
    /// Its cycles.
    pub cycles: u64,
    /// What it tripped for, and when; it should not have.
    pub trip: Option<(Duration, Cause)>,
    /// The first breach of a law.
    pub breach: Option<String>,
}

impl Lap {
    /// Whether nothing happened that should not.
    pub const fn is_good(&self) -> bool {
        self.trip.is_none() && self.breach.is_none()
    }
}

/// Laps on these hand controllers by turns, until they come to `cycles`; `progress` is told the cycles of each.
///
/// # Errors
/// Where a hand controller does not come up.
pub fn soak(
    seed: u64,
    configs: &[Config],
    cycles: u64,
    threads: NonZero<usize>,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<Vec<Lap>, StageError> {
    let mut laps = Vec::new();
    let mut planned = 0;
    for (number, (place, config)) in (1..).zip(configs.iter().enumerate().cycle()) {
        if planned >= cycles {
            break;
        }
        let most = (cycles - planned).min(of(config, LAP_S));
        laps.push((number, place, config, most));
        planned += most;
    }
    let laps = each(threads, &laps, &|(number, place, config, most)| {
        let lap = lap(seed, (*number, *place), config, *most)?;
        progress(lap.cycles);
        Ok(lap)
    });
    laps.into_iter().collect()
}

/// So many seconds, in cycles.
fn of(config: &Config, seconds: f64) -> u64 {
    let cycles = Duration::from_secs_f64(seconds).as_micros() / config.period.as_micros().max(1);
    u64::try_from(cycles).unwrap_or(u64::MAX)
}

fn lap(
    seed: u64,
    (number, place): (u32, usize),
    config: &Config,
    most: u64,
) -> Result<Lap, StageError> {
    let mut draw = Draw::of(seed, number);
    let scenario = Scenario::parse(&script(&mut draw, config)).map_err(StageError::Script)?;
    let mut bench = Bench::new(config, scenario, draw.bits(), false, Monitor::new(config));
    play::bring_up(&mut bench)?;
    let mut lap = Lap { number, config: place, cycles: 0, trip: None, breach: None };
    while lap.cycles < most && lap.trip.is_none() {
        play::answer(&mut bench);
        let record = bench.cycle();
        let now = bench.now();
        bench.tap_mut().told(now, record.mode);
        lap.cycles += 1;
        lap.trip = record.cause.map(|cause| (bench.elapsed(), cause));
    }
    lap.breach = bench.tap_mut().breaches().first().map(ToString::to_string);
    Ok(lap)
}

/// Twenty seconds of work: two contacts, a release between them, rates and then poses.
fn script(draw: &mut Draw, config: &Config) -> String {
    let mut script = format!("seconds = {:.1}\n\n{WORK}", LAP_S + 5.0);
    script.push_str(&moves(draw));
    let period = config.period.as_secs_f64();
    let mut faults: Vec<(f64, String)> =
        Joint::ALL.into_iter().flat_map(|joint| losses(draw, joint, period)).collect();
    let words = LAP_S / period;
    let mut at_s = 0.0;
    // Losses that follow each other by chance, on average every hundredth word.
    while at_s < LAP_S - 0.1 {
        let until_next = -(1.0 - draw.within(0.0, 0.999_999)).ln() / (LINK_LOSS * words / LAP_S);
        at_s += until_next.max(0.001);
        let lost = period.max(0.001);
        faults.push((at_s, format!("kind = \"link_frozen\"\nfor_s = {lost:.6}")));
    }
    faults.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    for (at_s, keys) in faults {
        script.push_str(&format!("[[fault]]\nat_s = {at_s:.6}\n{keys}\n\n"));
    }
    script
}

/// Samples of one drive that are lost, each alone: never two in a row.
fn losses(draw: &mut Draw, joint: Joint, period: f64) -> Vec<(f64, String)> {
    let keys = format!("kind = \"drop\"\njoint = {joint}\nframe = \"tpdo1\"\ncount = 1");
    let mut losses = Vec::new();
    let mut at_s = 0.0;
    loop {
        let until_next = -(1.0 - draw.within(0.0, 0.999_999)).ln() * period / TPDO_LOSS;
        at_s += until_next.max(ALONE * period);
        if at_s > LAP_S {
            return losses;
        }
        losses.push((at_s, keys.clone()));
    }
}

/// Periods between two lost samples of a drive, at least.
const ALONE: f64 = 3.0;

/// Where the hand goes: into the wall and out of it, then about.
fn moves(draw: &mut Draw) -> String {
    let mut entries = String::new();
    let mut add = |at_s: f64, duration_s: f64, [x, y, z]: [f64; 3]| {
        entries.push_str(&format!(
            "[[move]]\nat_s = {at_s:.3}\nduration_s = {duration_s:.3}\nto_m = [{x:.4}, {y:.4}, {z:.4}]\n\n"
        ));
    };
    let push = draw.within(0.03, 0.05);
    add(1.6, draw.within(0.4, 0.8), [push, 0.0, 0.0]);
    add(7.0, draw.within(0.4, 0.8), [-0.03, 0.0, 0.0]);
    add(8.0, draw.within(0.4, 0.8), [0.0, 0.0, 0.0]);
    for step in 0..6 {
        let to = [0; 3].map(|_| draw.within(-0.03, 0.03));
        add(11.6 + 1.2 * f64::from(step), draw.within(0.5, 1.1), to);
    }
    add(18.9, 0.6, [0.0, 0.0, 0.0]);
    entries
}

const WORK: &str = "\
[[console]]
at_s = 0.05
request = \"arm\"

[[console]]
at_s = 10.6
request = \"mode pose\"

[[console]]
at_s = 19.8
request = \"disarm\"

[[switch]]
at_s = 1.1
deadman = true

[[switch]]
at_s = 1.2
reflection = true

[[switch]]
at_s = 1.25
reflection = false

[[switch]]
at_s = 1.4
reference = true

[[switch]]
at_s = 1.45
reference = false

[[switch]]
at_s = 10.0
deadman = false

[[switch]]
at_s = 11.0
deadman = true

[[switch]]
at_s = 11.2
reference = true

[[switch]]
at_s = 11.25
reference = false

[[switch]]
at_s = 19.6
deadman = false

";

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use sim::scenario::fault::Fault;

    #[test]
    fn promise_14_a_thousandth_of_each_drives_samples_is_lost_and_never_two_in_a_row() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let mut lost = 0;
        for number in 1..=20 {
            let mut draw = Draw::of(1, number);
            let scenario = Scenario::parse(&script(&mut draw, &config)).unwrap();
            for joint in 1..=6 {
                let whom = format!("joint {joint}");
                let is_its = |fault: &&Fault| fault.whom.to_string() == whom;
                let lost_at = |fault: &Fault| fault.begins;
                let times: Vec<_> = scenario.faults().iter().filter(is_its).map(lost_at).collect();
                assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= 2 * config.period));
                lost += times.len();
            }
        }
        assert!((2_000..2_800).contains(&lost), "{lost} of 2,400,000");
    }
}
