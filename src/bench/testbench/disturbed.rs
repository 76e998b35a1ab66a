//! Faults of a commanded side in this process: a frozen or lost link, and a sensor with a wrong reading.

use std::time::Duration;

use contract::{FarEnd, NodeEnd, Reason};
use remote::{Command, Remote, RemoteSample, RobotJoints, SideError, messages};
use units::spatial::Wrench;
use units::time::Instant;

/// State of the link to the commanded side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkState {
    /// Transmits both ways.
    #[default]
    Up,
    /// Repeats the same sample with its old time.
    Frozen,
    /// Transmits nothing in either direction.
    Lost,
    /// Transmits with more delay than configured.
    Slow,
    /// Transmits to a commanded side that holds for a local reason until a new epoch.
    Held,
    /// Transmits to a commanded side led by another node, whose messages answer that node.
    Foreign,
}

/// Ends of the contract of a commanded side led by another node.
#[derive(Clone, Debug)]
struct ForeignLead {
    node: NodeEnd,
    other: NodeEnd,
    far: FarEnd,
}

impl ForeignLead {
    fn new() -> Self {
        Self {
            node: NodeEnd::new(0, 1),
            other: NodeEnd::new(0, 2),
            far: FarEnd::new(0, 3, Duration::from_millis(100)),
        }
    }

    /// Returns the sample that the node accepts from a message of a side led by another node.
    fn received(&mut self, now: Instant, sensed: &RemoteSample) -> Option<RemoteSample> {
        let order = messages::order(&Command::HOLD);
        self.node.command(now, &order);
        self.far.on_message(now, &self.other.command(now, &order));
        let feedback = self.far.feedback(now, &messages::measured(sensed));
        self.node.on_message(now, &feedback).and_then(|sample| messages::sensed(&sample))
    }
}

/// Commanded side with faults.
#[derive(Clone, Debug)]
pub struct FaultySide<R> {
    side: R,
    link: LinkState,
    /// Last sample over the link.
    known: Option<RemoteSample>,
    /// Set if the side holds until a new epoch.
    holds: bool,
    /// State of the lead by another node; `None` before the first one.
    usurped: Option<Box<ForeignLead>>,
    /// Reading of a broken sensor.
    sensor_fault: Option<Wrench>,
}

impl<R> FaultySide<R> {
    /// Creates a side without faults.
    pub const fn new(side: R) -> Self {
        Self {
            side,
            link: LinkState::Up,
            known: None,
            holds: false,
            usurped: None,
            sensor_fault: None,
        }
    }

    /// Returns the side itself.
    pub const fn side(&self) -> &R {
        &self.side
    }

    /// Returns the side itself.
    pub const fn side_mut(&mut self) -> &mut R {
        &mut self.side
    }

    /// Sets the state of the link.
    pub const fn set_link(&mut self, link: LinkState) {
        self.link = link;
    }

    /// Sets the wrench reported by a broken sensor; `None` repairs it.
    pub const fn set_sensor_fault(&mut self, reported: Option<Wrench>) {
        self.sensor_fault = reported;
    }
}

impl<R: Remote> Remote for FaultySide<R> {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.holds |= self.link == LinkState::Held;
        let passes = !self.holds && !matches!(self.link, LinkState::Lost | LinkState::Foreign);
        let sensed = self.side.exchange(now, if passes { command } else { &Command::HOLD })?;
        let sensed = RemoteSample { f_s: self.sensor_fault.unwrap_or(sensed.f_s), ..sensed };
        let newest = match self.link {
            LinkState::Up | LinkState::Slow | LinkState::Held => Some(sensed),
            LinkState::Frozen | LinkState::Lost => None,
            LinkState::Foreign => {
                let usurped = self.usurped.get_or_insert_with(|| Box::new(ForeignLead::new()));
                usurped.received(now, &sensed)
            }
        };
        self.known = newest.or(self.known);
        self.known
    }

    fn begin_epoch(&mut self) {
        self.holds = false;
        self.side.begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.side.end_epoch();
    }

    fn joints(&self) -> Option<RobotJoints> {
        self.side.joints()
    }

    fn error(&mut self) -> Option<SideError> {
        let slow = SideError::Slow { p99_us: 9_000, stated_us: 5_000 };
        let own = match (self.holds, self.link) {
            (true, _) => Some(SideError::Holds(Reason::SensorSilent)),
            (false, LinkState::Slow) => Some(slow),
            (false, _) => None,
        };
        own.or_else(|| self.side.error())
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use nalgebra::Isometry3;

    use super::*;
    use units::spatial::Motion;

    /// Reports its time, and counts commands that are not `Hold`.
    #[derive(Default)]
    struct Counting(u32);

    impl Remote for Counting {
        fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
            self.0 += u32::from(*command != Command::HOLD);
            let x_b_m = Isometry3::identity();
            Some(RemoteSample { at: now, f_s: Wrench::ZERO, x_b_m, gripper: None })
        }
    }

    #[test]
    fn frozen_link_repeats_and_lost_link_holds() {
        let mut side = FaultySide::new(Counting::default());
        let command = Motion::Pose(Isometry3::identity()).into();
        let at = |ms: u64| Instant::ZERO + Duration::from_millis(ms);
        let time_of =
            |side: &mut FaultySide<Counting>, ms| side.exchange(at(ms), &command).unwrap().at;
        assert_eq!(time_of(&mut side, 1), at(1));
        side.set_link(LinkState::Frozen);
        assert_eq!((time_of(&mut side, 2), side.side().0), (at(1), 2));
        side.set_link(LinkState::Lost);
        assert_eq!((time_of(&mut side, 3), side.side().0), (at(1), 2));
        side.set_link(LinkState::Up);
        assert_eq!((time_of(&mut side, 4), side.side().0), (at(4), 3));
    }

    #[test]
    fn far_side_of_another_node_neither_follows_nor_is_felt() {
        let mut side = FaultySide::new(Counting::default());
        let command = Motion::Pose(Isometry3::identity()).into();
        let at = |ms: u64| Instant::ZERO + Duration::from_millis(ms);
        side.exchange(at(1), &command);
        side.set_link(LinkState::Foreign);
        for ms in 2..20 {
            let sensed = side.exchange(at(ms), &command).unwrap();
            assert_eq!((sensed.at, side.side().0), (at(1), 1));
        }
        let rejects = *side.usurped.unwrap().node.rejects();
        assert_eq!(rejects.iter().collect::<Vec<_>>(), [(contract::Reject::Session, 18)]);
    }

    #[test]
    fn broken_sensor_reports_its_value() {
        let mut side = FaultySide::new(Counting::default());
        let wrong = Wrench::from_components([1.0; 6]);
        side.set_sensor_fault(Some(wrong));
        assert_eq!(side.exchange(Instant::ZERO, &Command::HOLD).unwrap().f_s, wrong);
        side.set_sensor_fault(None);
        assert_eq!(side.exchange(Instant::ZERO, &Command::HOLD).unwrap().f_s, Wrench::ZERO);
    }
}
