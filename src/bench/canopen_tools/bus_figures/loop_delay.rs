//! Delay from the position that a drive samples to the torque computed from it.

use canopen::load::timeline::{CycleStage, Timeline};

/// Delay from sampling to torque, in µs, for both kinds of RPDO.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopDelay {
    /// Synchronous RPDOs (types 0 to 240), which act together at the SYNC after their reception.
    pub synchronous_us: f64,
    /// First event-driven RPDO (254, 255), which acts on reception.
    pub first_arrival_us: f64,
    /// Last event-driven RPDO.
    pub last_arrival_us: f64,
}

impl LoopDelay {
    /// Delay from the sampling of a position, at the end of SYNC, to the torque computed from it; zero without RPDOs.
    pub fn new(timeline: &Timeline, period_us: f64) -> Self {
        let ends = |is_wanted: fn(CycleStage) -> bool| {
            let steps = timeline.steps.iter().filter(move |step| is_wanted(step.stage));
            steps.map(|step| step.end_us)
        };
        let sampled = ends(|stage| stage == CycleStage::Sync).fold(0.0, f64::max);
        let arrivals: Vec<f64> =
            ends(|stage| matches!(stage, CycleStage::Rpdo(_))).map(|end| end - sampled).collect();
        // SYNC always takes the same time: RPDOs complete before the next one starts act at its end.
        let periods = (timeline.done_us / period_us.max(1.0)).ceil().max(1.0);
        let periods = if arrivals.is_empty() { 0.0 } else { periods };
        let first = arrivals.iter().copied().reduce(f64::min);
        Self {
            synchronous_us: periods * period_us,
            first_arrival_us: first.unwrap_or(0.0),
            last_arrival_us: arrivals.iter().copied().fold(0.0, f64::max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::load::streams::{Role, streams};
    use canopen::testing::networks::{drives, grouped, master, worst_timeline};

    #[test]
    fn synchronous_torque_acts_one_period_after_its_position() {
        let timeline = worst_timeline(&streams(&drives(3), 1_000, master(), 5));
        let delay = LoopDelay::new(&timeline, 1_000.0);
        assert_eq!(delay.synchronous_us.to_string(), "1000");
        // Latency 100, three TPDOs of 135, host 60, then one RPDO of 95, and three.
        assert_eq!(delay.first_arrival_us.to_string(), "660");
        assert_eq!(delay.last_arrival_us.to_string(), "850");
    }

    #[test]
    fn torque_after_the_next_sync_acts_one_sync_later() {
        let timeline = worst_timeline(&streams(&grouped(), 1_000, master(), 5));
        assert_eq!(LoopDelay::new(&timeline, 1_000.0).synchronous_us.to_string(), "2000");
        assert_eq!(LoopDelay::new(&timeline, 1_015.0).synchronous_us.to_string(), "1015");
    }

    #[test]
    fn bus_without_torques_has_no_delay() {
        let none = LoopDelay { synchronous_us: 0.0, first_arrival_us: 0.0, last_arrival_us: 0.0 };
        for period_us in [0, 1_000] {
            let period = f64::from(period_us);
            let silent = worst_timeline(&streams(&drives(0), period_us, master(), 0));
            assert_eq!(LoopDelay::new(&silent, period), none);
            // Positions alone: the drives of the bus have their torques on another.
            let mut planned = streams(&drives(3), period_us, master(), 0);
            planned.retain(|stream| !matches!(stream.role, Role::Rpdo(_)));
            let positions = worst_timeline(&planned);
            assert_eq!(LoopDelay::new(&positions, period), none);
            assert_eq!(
                positions
                    .steps
                    .iter()
                    .filter(|step| matches!(step.stage, CycleStage::Tpdo(_)))
                    .count(),
                3
            );
        }
    }
}
