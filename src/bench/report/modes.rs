//! Modes over time, and the stops among them.

use std::collections::VecDeque;

use node::cause::Cause;
use node::record::Mode;
use picture::strip::Band;
use signals::Cycle;

/// Maximum number of changes that are kept. Only a flickering mode has more.
const MAX_SPELLS: usize = 4_000;

/// Maximum number of stops whose seconds are kept.
const MAX_CLOSE_UPS: usize = 8;

/// Maximum number of stops that are listed.
const MAX_STOPS: usize = 200;

/// Time kept before a stop and after it, in s, as in a fault record.
pub(crate) const BEFORE: f64 = 2.0;
pub(crate) const AFTER: f64 = 1.0;

/// Time in one mode.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spell {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) mode: Mode,
}

/// Part of a cycle that a close-up of a stop shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) at: f64,
    pub(crate) mode: Mode,
    pub(crate) q: Option<[f64; 6]>,
    pub(crate) tau: Option<[f64; 6]>,
    /// Force sensed, in N.
    pub(crate) force: f64,
    /// Number of joints without a sample.
    pub(crate) missing: u8,
}

/// Entry into a latched mode.
#[derive(Clone, Debug)]
pub(crate) struct Stop {
    /// Time of its SYNC, in s.
    pub(crate) at: f64,
    /// Number of the cycle in `bus.log`.
    pub(crate) cycle: u64,
    pub(crate) from: Mode,
    pub(crate) to: Mode,
    /// Last latched mode before its end.
    pub(crate) last: Mode,
    /// Time at which a reset has ended it.
    pub(crate) ended: Option<f64>,
    /// First cause, by the replay.
    pub(crate) cause: Option<Cause>,
    /// Seconds around it; empty where there were too many stops.
    pub(crate) moments: Vec<Moment>,
}

/// Modes over time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Modes {
    pub(crate) spells: Vec<Spell>,
    /// Number of spells that are not kept.
    pub(crate) more_spells: u64,
    pub(crate) stops: Vec<Stop>,
    /// Number of stops that are not kept.
    pub(crate) more_stops: u64,
    before: VecDeque<Moment>,
    mode: Option<Mode>,
}

impl Modes {
    /// Adds a cycle at a time in s.
    pub(crate) fn add(&mut self, at: f64, cycle: &Cycle<'_>) {
        let mode = cycle.mode;
        let moment = moment(at, cycle);
        let before = self.mode.replace(mode);
        match self.spells.last_mut() {
            Some(last) if last.mode == mode => last.to = at,
            last => {
                last.into_iter().for_each(|last| last.to = at);
                if self.spells.len() < MAX_SPELLS {
                    self.spells.push(Spell { from: at, to: at, mode });
                } else {
                    self.more_spells += 1;
                }
            }
        }
        let from = before.unwrap_or(mode);
        if from != mode {
            self.change(at, cycle, from);
        }
        let is_near = |stop: &&mut Stop| !stop.moments.is_empty() && at - stop.at <= AFTER;
        self.stops
            .iter_mut()
            .rev()
            .take(2)
            .filter(is_near)
            .for_each(|stop| stop.moments.push(moment));
        if let Some(stop) = self.stops.last_mut().filter(|_| mode.is_latched()) {
            stop.cause = stop.cause.or(cycle.cause());
        }
        while self.before.front().is_some_and(|oldest| at - oldest.at > BEFORE) {
            self.before.pop_front();
        }
        self.before.push_back(moment);
    }

    /// Takes the change from one mode to that of a cycle.
    fn change(&mut self, at: f64, cycle: &Cycle<'_>, from: Mode) {
        let to = cycle.mode;
        match (from.is_latched(), to.is_latched()) {
            (false, true) if self.stops.len() < MAX_STOPS => {
                let has_room = self.stops.len() < MAX_CLOSE_UPS;
                let moments = self.before.iter().copied().filter(|_| has_room).collect();
                let (cycle, cause) = (cycle.number, cycle.cause());
                let ended = None;
                self.stops.push(Stop { at, cycle, from, to, last: to, ended, cause, moments });
            }
            (false, true) => self.more_stops += 1,
            (true, true) => self.stops.last_mut().into_iter().for_each(|stop| stop.last = to),
            (true, false) => {
                self.stops.last_mut().into_iter().for_each(|stop| stop.ended = Some(at));
            }
            (false, false) => {}
        }
    }

    /// Returns the modes as bars of a picture, their times less `zero`.
    pub(crate) fn bands(&self, zero: f64) -> Vec<Band> {
        let band = |spell: &Spell| Band {
            from: spell.from - zero,
            to: spell.to - zero,
            name: spell.mode.name().to_owned(),
            colour: colour(spell.mode),
        };
        self.spells.iter().map(band).collect()
    }

    /// Returns the time at which a mode was entered first.
    pub(crate) fn first(&self, mode: Mode) -> Option<f64> {
        self.spells.iter().find(|spell| spell.mode == mode).map(|spell| spell.from)
    }

    /// Returns the time in a mode, in s, as far as it is kept.
    pub(crate) fn seconds_in(&self, mode: Mode) -> f64 {
        let spells = self.spells.iter().filter(|spell| spell.mode == mode);
        spells.map(|spell| spell.to - spell.from).sum()
    }

    /// Returns the mode of the last cycle.
    pub(crate) const fn last(&self) -> Option<Mode> {
        self.mode
    }
}

fn moment(at: f64, cycle: &Cycle<'_>) -> Moment {
    let missing = cycle.sampled.iter().filter(|sampled| !**sampled).count();
    Moment {
        at,
        mode: cycle.mode,
        q: cycle.q(),
        tau: cycle.tau(),
        force: cycle.f_s.force.norm(),
        missing: u8::try_from(missing).unwrap_or(u8::MAX),
    }
}

/// Returns the colour of a mode in a picture: blue while it works, warm where it is stopped.
pub(crate) fn colour(mode: Mode) -> usize {
    mode.code().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    fn modes(of: &[(f64, Mode)]) -> Modes {
        let mut modes = Modes::default();
        for (number, (at, mode)) in (1..).zip(of) {
            modes.add(*at, &fixture::cycle(number, *mode));
        }
        modes
    }

    #[test]
    fn stop_has_its_worst_mode_its_end_and_the_seconds_around_it() {
        let engaged = (0..30).map(|at| (f64::from(at) * 0.1, Mode::Engaged));
        let stopped = [(3.0, Mode::ZeroTorque), (3.1, Mode::DrivesOff), (9.0, Mode::Boot)];
        let modes = modes(&engaged.chain(stopped).collect::<Vec<_>>());
        let [stop] = &modes.stops[..] else { panic!("{:?}", modes.stops) };
        assert_eq!(
            (stop.cycle, stop.from, stop.to, stop.last),
            (31, Mode::Engaged, Mode::ZeroTorque, Mode::DrivesOff)
        );
        assert_eq!(stop.ended, Some(9.0));
        // 2 s before it, the cycle itself and one after it.
        assert_eq!(stop.moments.len(), 20 + 2);
        assert!((modes.seconds_in(Mode::Engaged) - 3.0).abs() < 1e-9);
        assert_eq!(modes.first(Mode::DrivesOff), Some(3.1));
    }

    #[test]
    fn flickering_mode_is_kept_in_constant_room() {
        let flicker = (0..20_000)
            .map(|at| (f64::from(at), if at % 2 == 0 { Mode::Armed } else { Mode::ReflectionOff }));
        let modes = modes(&flicker.collect::<Vec<_>>());
        assert_eq!((modes.spells.len(), modes.stops.len()), (MAX_SPELLS, MAX_STOPS));
        assert_eq!(modes.more_stops, 10_000 - 200);
        assert_eq!(
            modes.stops.iter().filter(|stop| !stop.moments.is_empty()).count(),
            MAX_CLOSE_UPS
        );
    }
}
