//! Confirmation that drives are off after disable voltage, and the steps towards a drive that does not confirm it.
//!
//! ```text
//!  disable voltage in the RPDO        statusword in its TPDO, in 2 cycles or 25 ms (Exchange::power_off_time)
//!    ▼ not off                        at once for a drive with missing samples
//!  6040h = 0 by SDO, 6041h read       10 ms
//!    ▼ not off
//!  NMT stop of the node               20 ms, in which 6007h acts; all drives off
//!    ▼
//!  NMT pre-operational, 6041h read    10 ms
//!    ▼ not off
//!  heartbeat and guarding end         for all nodes; 6041h is read once a second
//! ```
//!
//! An RPDO may be lost, or may wait for a SYNC that the drive does not receive, so sending it is no confirmation. A drive
//! that does not answer counts as on.

mod run;

use std::time::Duration;

use crate::power::may_apply_torque;
use canopen::drive::{State, Statusword};
use canopen::exchange::Exchange;
use canopen::master::event::PowerOffStep;
use units::numbering::Joint;
use units::time::Instant;

/// Time for a statusword read by SDO to report power off.
const SDO_TIMEOUT: Duration = Duration::from_millis(10);

/// Time in NMT stopped, before pre-operational makes the drive answer SDO again.
const STOPPED_TIME: Duration = Duration::from_millis(20);

/// Time allowed for a drive's own fault reaction (605Eh), which disable voltage does not shorten.
const FAULT_REACTION_TIME: Duration = Duration::from_millis(100);

/// Time between two readings of the statusword after the last step.
const READ_INTERVAL: Duration = Duration::from_secs(1);

/// Minimum time between two steps, and between two readings. A request and its reply take longer than the rest of a 1 ms
/// cycle, so consecutive ones would delay SYNCs and then bunch them.
const MIN_INTERVAL: Duration = Duration::from_millis(3);

/// View of a drive in one cycle.
#[derive(Clone, Copy, Debug)]
struct View {
    /// Set if disable voltage is in its RPDO.
    must_be_off: bool,
    /// Newest statusword.
    statusword: Statusword,
    /// Set if its sample was received in this cycle.
    is_fresh: bool,
}

/// Progress of one drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No confirmation is pending: the drive may be on, or has reported that it is off.
    Settled,
    /// Disable voltage is in its RPDO since this SYNC.
    Commanded(Instant),
    /// A step was taken at this time.
    Taken(PowerOffStep, Instant),
}

/// Frames to send for a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Take(PowerOffStep),
    ReadStatusword,
}

/// Confirmations of the six drives.
#[derive(Clone, Debug)]
pub(super) struct PowerOff {
    /// Maximum time from disable voltage in the RPDO to the statusword.
    follow_times: [Duration; 6],
    /// Number of cycles without a sample from which an RPDO is not trusted to act.
    max_missed: u32,
    missed: [u32; 6],
    stages: [Stage; 6],
    /// Index of the joint with the next turn.
    next: usize,
    /// Time of the last step.
    stepped: Option<Instant>,
    /// Time of the last step or reading.
    acted: Option<Instant>,
}

impl PowerOff {
    /// Returns confirmations for drives that may be on. After `max_missed` cycles without a sample the first step is taken
    /// at once.
    pub(super) fn new(exchange: &Exchange, period: Duration, max_missed: u32) -> Self {
        let follow_time = |joint: Joint| exchange.power_off_time(joint.into(), period);
        Self {
            follow_times: Joint::ALL.map(follow_time),
            max_missed,
            missed: [0; 6],
            stages: [Stage::Settled; 6],
            next: 0,
            stepped: None,
            acted: None,
        }
    }

    /// Drops all progress, before the drives are enabled again.
    pub(super) const fn restart(&mut self) {
        self.missed = [0; 6];
        self.stages = [Stage::Settled; 6];
    }

    /// Returns the joints whose drives have not reported power off after a step.
    pub(super) fn not_off(&self) -> [bool; 6] {
        self.stages.map(|stage| matches!(stage, Stage::Taken(..)))
    }

    /// Returns the drive that now reports power off after a step, with that step.
    fn confirmed(&mut self, views: &[View; 6]) -> Option<(Joint, PowerOffStep)> {
        let mut joints = Joint::each(self.stages.iter_mut().zip(views));
        joints.find_map(|(joint, (stage, view))| {
            let is_off = !view.must_be_off || !may_apply_torque(view.statusword);
            let before =
                if is_off { std::mem::replace(stage, Stage::Settled) } else { return None };
            match before {
                Stage::Taken(step, _) => Some((joint, step)),
                Stage::Settled | Stage::Commanded(_) => None,
            }
        })
    }

    /// Advances all drives by a cycle whose SYNC was sent at `sync_at`, and returns at most one action.
    fn advance(
        &mut self,
        now: Instant,
        sync_at: Instant,
        views: &[View; 6],
        is_stopped: bool,
    ) -> Option<(Joint, Action)> {
        for (missed, view) in self.missed.iter_mut().zip(views) {
            *missed = if view.is_fresh { 0 } else { missed.saturating_add(1) };
        }
        let is_free = |acted: Option<Instant>| acted.is_none_or(|at| now.since(at) >= MIN_INTERVAL);
        let (may_step, may_read) = (is_free(self.stepped), is_free(self.acted));
        let mut reading = None;
        for index in (self.next..6).chain(0..self.next) {
            let joint = *Joint::ALL.get(index)?;
            let is_lost = is_stopped && *joint.entry(&self.missed) >= self.max_missed;
            let follow_time = *joint.entry(&self.follow_times);
            let stage = joint.entry_mut(&mut self.stages);
            let (next, action) = stage.next(now, sync_at, joint.entry(views), is_lost, follow_time);
            match action {
                None => *stage = next,
                Some(Action::Take(step)) if may_step => {
                    *stage = next;
                    (self.next, self.stepped, self.acted) = ((index + 1) % 6, Some(now), Some(now));
                    return Some((joint, Action::Take(step)));
                }
                Some(Action::ReadStatusword) => reading = reading.or(Some((index, joint, next))),
                Some(Action::Take(_)) => {}
            }
        }
        let (index, joint, next) = reading.filter(|_| may_read)?;
        *joint.entry_mut(&mut self.stages) = next;
        (self.next, self.acted) = ((index + 1) % 6, Some(now));
        Some((joint, Action::ReadStatusword))
    }
}

impl Stage {
    /// Returns the next stage and its action. `is_lost`: its samples are missing and the node is stopped.
    fn next(
        self,
        now: Instant,
        sync_at: Instant,
        view: &View,
        is_lost: bool,
        follow_time: Duration,
    ) -> (Self, Option<Action>) {
        if !may_apply_torque(view.statusword) || !(view.must_be_off || is_lost) {
            return (self, None);
        }
        match self {
            Self::Settled | Self::Commanded(_) if is_lost => {
                Self::taking(PowerOffStep::Download, now)
            }
            Self::Settled => (Self::Commanded(sync_at), None),
            Self::Commanded(since) => {
                let is_reacting = view.statusword.state() == Some(State::FaultReactionActive);
                let own_time = if is_reacting { FAULT_REACTION_TIME } else { Duration::ZERO };
                let is_due = sync_at.since(since) >= follow_time.max(own_time);
                if is_due { Self::taking(PowerOffStep::Download, now) } else { (self, None) }
            }
            Self::Taken(step, at) => {
                let is_due = now.since(at) >= duration(step);
                match (step, is_due) {
                    (PowerOffStep::Download, true) => Self::taking(PowerOffStep::NmtStop, now),
                    (PowerOffStep::NmtStop, true) => {
                        Self::taking(PowerOffStep::PreOperational, now)
                    }
                    (PowerOffStep::PreOperational, true) => {
                        Self::taking(PowerOffStep::NoErrorControl, now)
                    }
                    (PowerOffStep::NoErrorControl, true) => {
                        (Self::Taken(step, now), Some(Action::ReadStatusword))
                    }
                    (PowerOffStep::Download | PowerOffStep::PreOperational, false) => {
                        (self, Some(Action::ReadStatusword))
                    }
                    // No server answers in NMT stopped.
                    (PowerOffStep::NmtStop | PowerOffStep::NoErrorControl, false) => (self, None),
                }
            }
        }
    }

    /// Takes a step now.
    const fn taking(step: PowerOffStep, now: Instant) -> (Self, Option<Action>) {
        (Self::Taken(step, now), Some(Action::Take(step)))
    }
}

/// Returns the time from a step to the next one; after the last one, between two readings of the statusword.
const fn duration(step: PowerOffStep) -> Duration {
    match step {
        PowerOffStep::Download | PowerOffStep::PreOperational => SDO_TIMEOUT,
        PowerOffStep::NmtStop => STOPPED_TIME,
        PowerOffStep::NoErrorControl => READ_INTERVAL,
    }
}

/// Stages and statuswords of the confirmation, kept over a boot that may fail.
#[derive(Clone, Copy, Debug)]
pub(super) struct PowerOffState {
    stages: [Stage; 6],
    statuswords: [Statusword; 6],
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use config::Config;

    const ELBOW: Joint = Joint::of::<3>();
    const ENABLED: Statusword = Statusword(0x1237);
    const OFF: Statusword = Statusword(0x0250);

    /// Confirmations at 500 Hz with one PDO in each direction.
    fn confirmations() -> PowerOff {
        let config = Config::load(Path::new("config/kraft_like_500hz.toml")).unwrap();
        PowerOff::new(config.exchange(), config.period, 3)
    }

    /// Drives that are off, except the elbow's.
    fn views(statusword: Statusword, must_be_off: bool) -> [View; 6] {
        let mut views = [View { must_be_off: true, statusword: OFF, is_fresh: true }; 6];
        views[2] = View { must_be_off, statusword, is_fresh: true };
        views
    }

    /// Runs `cycles` cycles of 2 ms; returns the steps with their times in ms.
    fn steps(power_off: &mut PowerOff, cycles: u64, views: &[View; 6]) -> Vec<(u64, PowerOffStep)> {
        let mut steps = Vec::new();
        for cycle in 0..cycles {
            let at = Instant::from_micros(2_000 * cycle);
            if let Some((joint, Action::Take(step))) = power_off.advance(at, at, views, true) {
                assert_eq!(joint, ELBOW);
                steps.push((2 * cycle, step));
            }
        }
        steps
    }

    #[test]
    fn hazard_46_steps_follow_at_their_times_and_end() {
        let mut power_off = confirmations();
        assert_eq!(
            steps(&mut power_off, 2_000, &views(ENABLED, true)),
            [
                (4, PowerOffStep::Download),
                (14, PowerOffStep::NmtStop),
                (34, PowerOffStep::PreOperational),
                (44, PowerOffStep::NoErrorControl),
            ]
        );
        assert_eq!(power_off.not_off(), [false, false, true, false, false, false]);
    }

    #[test]
    fn drive_that_may_be_on_or_is_off_gets_no_step() {
        for (statusword, must_be_off) in [(ENABLED, false), (OFF, true)] {
            let mut power_off = confirmations();
            assert_eq!(steps(&mut power_off, 100, &views(statusword, must_be_off)), []);
            assert_eq!(power_off.not_off(), [false; 6]);
        }
    }

    #[test]
    fn hazard_01_missing_samples_lead_to_the_first_step_at_once() {
        let mut views = views(ENABLED, false);
        views[2].is_fresh = false;
        let first = steps(&mut confirmations(), 4, &views);
        assert_eq!(first, [(4, PowerOffStep::Download)], "in the third cycle without a sample");
        views[2].statusword = OFF;
        assert_eq!(steps(&mut confirmations(), 100, &views), [], "known to be off");
    }

    #[test]
    fn fault_reaction_has_100_ms() {
        let reacting = views(Statusword(0x000F), true);
        let first = steps(&mut confirmations(), 60, &reacting);
        assert_eq!(first.first(), Some(&(100, PowerOffStep::Download)));
    }

    #[test]
    fn six_drives_take_steps_in_turn_3_ms_apart() {
        let mut power_off = confirmations();
        let views = [View { must_be_off: true, statusword: ENABLED, is_fresh: true }; 6];
        let mut joints = Vec::new();
        for cycle in 0..9 {
            let at = Instant::from_micros(2_000 * cycle);
            if let Some((joint, Action::Take(_))) = power_off.advance(at, at, &views, true) {
                joints.push((2 * cycle, joint.number()));
            }
        }
        assert_eq!(joints, [(4, 1), (8, 2), (12, 3), (16, 4)]);
    }

    #[test]
    fn confirmation_is_reported_once_with_its_last_step() {
        let mut power_off = confirmations();
        steps(&mut power_off, 4, &views(ENABLED, true));
        assert_eq!(power_off.confirmed(&views(ENABLED, true)), None);
        let confirmed = power_off.confirmed(&views(OFF, true));
        assert_eq!(confirmed, Some((ELBOW, PowerOffStep::Download)));
        assert_eq!(power_off.confirmed(&views(OFF, true)), None);
    }
}
