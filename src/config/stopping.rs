//! Timers that stop each drive after the loss of the master, by its plan, and the resulting reaction times.

use std::fmt;
use std::time::Duration;

use crate::buses::BusSettings;
use crate::force_cap::UNPROVEN_REACTION_TIME;
use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::protection::timer_tolerance;
use crate::raw;
use canopen::bits;
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::watchdog::{LifeSign, Watchdog};

/// Interval at which the proof test polls for received frames while RPDOs are withheld.
const POLL_TIME: Duration = Duration::from_millis(1);

/// Timers that stop the drive of one joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stopping {
    /// Timers of the plan.
    pub watchdogs: Vec<Watchdog>,
    /// Time to read the statusword (6041h); `None` for a drive with EMCY (1014h) in its EDS.
    reading: Option<ReadingTime>,
}

/// Maximum time in which the proof test reads the statuswords (6041h) of all drives by SDO, once their timers have expired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ReadingTime {
    /// Time for RPDO timers: all drives are read at once.
    at_once: Duration,
    /// Time for heartbeat and guarding timers: one drive is read per cycle.
    in_turn: Duration,
}

impl Stopping {
    /// Returns the maximum time from the loss of the master until the fastest timer stops the drive; `None` without timers.
    pub fn reaction_time(&self) -> Option<Duration> {
        self.watchdogs.iter().map(|watchdog| self.time_of(watchdog)).min()
    }

    /// Returns the maximum time until `watchdog` has stopped the drive and the node has detected it.
    pub fn time_of(&self, watchdog: &Watchdog) -> Duration {
        let reading = self.reading.map_or(Duration::ZERO, |reading| match watchdog.awaited {
            LifeSign::Rpdo => reading.at_once,
            LifeSign::Heartbeat | LifeSign::Guarding => reading.in_turn,
        });
        let set = Duration::from_millis(watchdog.millis.into());
        set + timer_tolerance(watchdog.awaited).max(reading)
    }
}

/// `RPDO timer 8 ms, heartbeat 25 ms`, or `nothing`; `heartbeat 22 ms (read from 6041h within 36 ms, as it has no 1014h)`
impl fmt::Display for Stopping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.watchdogs.is_empty() {
            return f.write_str("nothing");
        }
        let timers: Vec<_> = self.watchdogs.iter().map(Watchdog::to_string).collect();
        f.write_str(&timers.join(", "))?;
        match self.reading.and(self.reaction_time()) {
            Some(time) => {
                let millis = time.as_micros().div_ceil(1_000);
                write!(f, " (read from 6041h within {millis} ms, as it has no 1014h)")
            }
            None => Ok(()),
        }
    }
}

impl Parameters {
    /// Returns the timers that stop each drive, in the order of the joints.
    pub fn stopping(&self) -> Vec<Stopping> {
        let plans = self.node_plans();
        let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
        self.joints.iter().zip(drives).map(|(joint, plan)| self.stopping_of(joint, plan)).collect()
    }

    fn stopping_of(&self, joint: &JointParameters, plan: &NodePlan) -> Stopping {
        let has_emergencies = joint.eds.object(Object::EMCY_COB_ID).is_some();
        let reading = (!has_emergencies).then(|| self.reading_time());
        Stopping { watchdogs: plan.watchdogs().collect(), reading }
    }

    /// Returns the maximum time to read the statuswords of all drives.
    fn reading_time(&self) -> ReadingTime {
        let drives = u32::try_from(self.joints.len()).unwrap_or(u32::MAX);
        let transfer = |bus: &BusSettings| {
            Duration::from_secs(1) * (2 * bits::worst_case(8)) / bus.bitrate.max(1)
        };
        let transfer = self.buses.iter().map(transfer).max().unwrap_or_default();
        // The first request waits for the end of a cycle, and the last reply may arrive in the next one.
        let in_turn = self.period * (drives + 1);
        ReadingTime { at_once: 2 * POLL_TIME + transfer * drives, in_turn }
    }

    /// Returns the maximum time from the loss of the master until every drive has stopped, by the plans. Without a proof
    /// test or a timer it is [`UNPROVEN_REACTION_TIME`].
    pub fn planned_reaction_time(&self) -> Duration {
        if !self.safety.protection.proves_drives {
            return UNPROVEN_REACTION_TIME;
        }
        let each = self.stopping();
        let longest = each.iter().map(|it| it.reaction_time().unwrap_or(UNPROVEN_REACTION_TIME));
        longest.max().unwrap_or(UNPROVEN_REACTION_TIME)
    }
}

/// Refuses drives without any timer, and an RPDO timer that no drive supports.
pub(super) fn check(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let plans = config.node_plans();
    let drives = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
    let joints = config.joints.iter().zip(raw.joint.all());
    for (plan, (joint, raw)) in drives.zip(joints) {
        if plan.watchdogs().next().is_none() {
            let has = |object| joint.eds.object(object).is_some();
            let can_be_guarded = has(Object::GUARD_TIME) && has(Object::LIFE_TIME_FACTOR);
            let remedy = if has(Object::rpdo_communication(1, 5)) {
                let [usual, least] =
                    [4, 2].map(|cycles| (config.period * cycles).as_micros().div_ceil(1_000));
                format!("set safety.rpdo_timer_ms to {usual}, four cycles; to {least} at least")
            } else if can_be_guarded {
                "guard it by joint.boot.guard_time_ms and life_time_factor".to_owned()
            } else {
                "it would need 1016h (heartbeat consumer), 100Ch and 100Dh (node guarding) or 1400h:5 (RPDO timer)".to_owned()
            };
            let reason = format!("nothing stops the drive without its master; {remedy}");
            problems.add_of(plan.name.clone(), &raw.eds, reason);
        }
    }
    let has_timer = |object| config.joints.iter().any(|joint| joint.eds.object(object).is_some());
    if config.safety.rpdo_timer_ms > 0 && !has_timer(Object::rpdo_communication(1, 5)) {
        let reason = "no drive has an RPDO timer (1400h:5) by its EDS; set it to 0";
        problems.add(&raw.safety.rpdo_timer_ms, reason);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Config;
    use crate::files::{self, Files};
    use crate::trust::Trust;

    #[test]
    fn drive_that_nothing_stops_gets_one_refusal_with_a_value() {
        let read = |name: &str| String::from_utf8(files::read(Path::new(name)).unwrap()).unwrap();
        let (file, sheet) = ("config/kraft_like_500hz.toml", "eds/frhc_drive.eds");
        let without = read(sheet).replace("[1016", "[2016").replace("=0x1016\n", "=0x2016\n");
        for (timer, refusal) in [
            ("8", None),
            (
                "0",
                Some(
                    "nothing stops the drive without its master; set safety.rpdo_timer_ms to 8, four cycles; to 4 at least",
                ),
            ),
        ] {
            let text =
                read(file).replacen("rpdo_timer_ms = 8", &format!("rpdo_timer_ms = {timer}"), 1);
            let files = Files::on_disk(Trust::Any)
                .with(Path::new(file), text.into_bytes())
                .with(Path::new(sheet), without.clone().into_bytes());
            let refused = Config::load_from(&files, Path::new(file)).err().map(|it| it.to_string());
            assert_eq!(refused.is_some(), refusal.is_some(), "{refused:?}");
            if let (Some(refused), Some(refusal)) = (refused, refusal) {
                assert!(refused.lines().count() == 1 && refused.ends_with(refusal), "{refused}");
            }
        }
    }
}
