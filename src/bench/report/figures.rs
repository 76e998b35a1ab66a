//! Figures of a session: extremes, means and counts over all cycles.

use std::time::Duration;

use node::record::Mode;
use signals::Cycle;

/// Maximum time between two cycles, in s; a longer time is a pause.
const LONGEST_CYCLE: f64 = 0.1;

/// Figures over all cycles of a session.
#[derive(Clone, Debug, Default)]
pub(crate) struct Figures {
    /// Number of cycles in the session.
    pub(crate) cycles: u64,
    /// Cycles and samples of joints that are missing.
    pub(crate) cycles_with_missing: u64,
    pub(crate) missing: u64,
    /// Overruns, by the replay.
    pub(crate) overruns: u64,
    /// Time engaged, in s, and the number of times that it began.
    pub(crate) engaged_seconds: f64,
    pub(crate) engagements: u64,
    /// Wrench sensed at {S} while engaged: greatest force and moment, and rms of the force.
    pub(crate) sensed: Magnitudes,
    /// Wrench of task and passivity at the grip while engaged, by the replay.
    pub(crate) felt: Magnitudes,
    /// Greatest torque of each joint, in N·m (N).
    pub(crate) torques: [f64; 6],
    /// Age of samples of the commanded side, by the replay: greatest, in s.
    pub(crate) sample_age: Option<f64>,
    /// Lowest and last energy of the port, by the replay, in J.
    pub(crate) energy: Option<[f64; 2]>,
    /// Load of each bus.
    pub(crate) loads: Vec<Load>,
    last: Option<(Duration, Mode)>,
}

/// Greatest force and moment, and rms of the force.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Magnitudes {
    /// Greatest force, in N.
    pub(crate) force: f64,
    /// Greatest moment, in N·m.
    pub(crate) moment: f64,
    squares: f64,
    count: u64,
}

impl Magnitudes {
    fn add(&mut self, force: f64, moment: f64) {
        self.force = self.force.max(force);
        self.moment = self.moment.max(moment);
        if force.is_finite() {
            self.squares += force * force;
            self.count += 1;
        }
    }

    /// Returns the rms of the force, in N; `None` without any.
    pub(crate) fn rms(&self) -> Option<f64> {
        let count = u32::try_from(self.count).ok().filter(|count| *count > 0)?;
        Some((self.squares / f64::from(count)).sqrt())
    }
}

/// Load of a bus, in percent of its bit rate.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Load {
    sum: f64,
    seconds: f64,
    /// Sum and length of the current second.
    window: [f64; 2],
    /// Greatest mean over a second.
    pub(crate) greatest: f64,
}

impl Load {
    /// Adds the load of a cycle. One after a pause, as in a boot, is left out: its load does not hold for the pause.
    fn add(&mut self, percent: f64, dt: f64) {
        if dt > LONGEST_CYCLE {
            return;
        }
        self.sum += percent * dt;
        self.seconds += dt;
        let [sum, seconds] = &mut self.window;
        *sum += percent * dt;
        *seconds += dt;
        if *seconds >= 1.0 {
            self.greatest = self.greatest.max(*sum / *seconds);
            self.window = [0.0; 2];
        }
    }

    /// Returns the mean over all cycles without a pause before them, in percent; 0 without such cycles.
    pub(crate) fn mean(&self) -> f64 {
        if self.seconds > 0.0 { self.sum / self.seconds } else { 0.0 }
    }
}

impl Figures {
    /// Adds the next cycle.
    pub(crate) fn add(&mut self, cycle: &Cycle<'_>) {
        let at = cycle.at.since(units::time::Instant::ZERO);
        let missing = cycle.sampled.iter().filter(|sampled| !**sampled).count();
        let missing = u64::try_from(missing).unwrap_or(0);
        self.cycles += 1;
        self.missing += missing;
        self.cycles_with_missing += u64::from(missing > 0);
        let dt = self.last.map_or(0.0, |(before, _)| at.saturating_sub(before).as_secs_f64());
        let before = self.last.replace((at, cycle.mode)).map(|(_, mode)| mode);
        if cycle.mode == Mode::Engaged {
            self.engaged_seconds += dt;
            self.engagements += u64::from(before != Some(Mode::Engaged));
            self.sensed.add(cycle.f_s.force.norm(), cycle.f_s.moment.norm());
        }
        for (greatest, tau) in self.torques.iter_mut().zip(cycle.tau().unwrap_or_default()) {
            *greatest = greatest.max(tau.abs());
        }
        if let Some(record) = cycle.record {
            self.overruns = record.overruns;
            if cycle.mode == Mode::Engaged {
                let felt = record.output.f_g_task + record.output.port.f_g_passivity;
                self.felt.add(felt.force.norm(), felt.moment.norm());
            }
            if let Some(energy) = record.output.port.energy {
                let [lowest, _] = self.energy.unwrap_or([energy; 2]);
                self.energy = Some([lowest.min(energy), energy]);
            }
        }
        let age = cycle.sample_age.map(|age| age.as_secs_f64());
        self.sample_age = match (self.sample_age, age) {
            (Some(greatest), Some(age)) => Some(greatest.max(age)),
            (greatest, age) => greatest.or(age),
        };
        if let Some(wire) = cycle.wire {
            self.loads.resize(wire.load_percent.len(), Load::default());
            let loads = self.loads.iter_mut().zip(&wire.load_percent);
            loads.for_each(|(load, percent)| load.add(*percent, dt));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;
    use units::spatial::Wrench;
    use units::time::Instant;

    #[test]
    fn figures_count_engaged_cycles_alone() {
        let mut figures = Figures::default();
        for (number, mode) in
            (1..).zip([Mode::Armed, Mode::Engaged, Mode::Engaged, Mode::DrivesOff])
        {
            let at = Instant::from_micros(number * 10_000);
            let f_s = Wrench::from_components([3.0, 4.0, 0.0, 0.0, 0.0, 2.0]);
            let sampled = [true, true, true, number != 4, true, true];
            figures.add(&Cycle { at, f_s, sampled, ..fixture::cycle(number, mode) });
        }
        assert_eq!((figures.cycles, figures.engagements, figures.missing), (4, 1, 1));
        assert!((figures.engaged_seconds - 0.02).abs() < 1e-9);
        assert!((figures.sensed.rms().unwrap() - 5.0).abs() < 1e-9);
        assert!((figures.sensed.moment - 2.0).abs() < 1e-9);
        assert_eq!(figures.felt.rms(), None);
    }

    #[test]
    fn load_has_its_mean_and_its_greatest_second() {
        let mut load = Load::default();
        (0..2_000).for_each(|at| load.add(if at < 1_000 { 20.0 } else { 80.0 }, 0.001));
        load.add(80.0, 5.0); // a pause
        assert!((load.mean() - 50.0).abs() < 1e-6);
        assert!((load.greatest - 80.0).abs() < 1.0, "{}", load.greatest);
    }
}
