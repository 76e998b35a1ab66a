//! Rest posture: the first arming after a boot verifies sign and scale of positions that no object of a drive does.
//!
//! Until then no torque acts, so a wrong factor or zero moves nothing. Later armings may start anywhere, until a joint's position
//! becomes doubtful again: by a reboot, a sensor fault, a jump, or missing samples.

use derive_more::Display;
use thiserror::Error;

use crate::joint_reading::JointReading;
use config::Config;
use config::rest::Rest;
use controller::JointVector;
use controller::arm::JointKind;
use controller::hold::HoldGoal;
use units::numbering::Joint;
use units::wording::in_one_line;

/// Rest posture of the arm, and whether the arm was in it.
#[derive(Clone, Debug)]
pub(super) struct RestPosture {
    rests: [Option<Rest>; 6],
    kinds: [JointKind; 6],
    /// Joints that were in it since their position was doubtful.
    is_confirmed: [bool; 6],
}

/// Joints that are not at rest at the first arming after a boot.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "{}: at the first arming after a boot the arm must rest; bring it there, or correct the sign of gear_ratio, \
     encoder_counts_per_rev or zero_counts of the joint",
    in_one_line(.0)
)]
pub struct NotAtRest(Vec<Reading>);

/// Reading of a joint that is not at rest.
#[derive(Clone, Debug, Display, PartialEq)]
#[display("joint {joint} ({name}): reads {}, {} is {rest}", rest.format(*q), rest.key())]
struct Reading {
    joint: Joint,
    name: String,
    rest: Rest,
    /// In rad or m.
    q: f64,
}

impl RestPosture {
    /// Returns the rest posture before the first arming.
    pub(super) fn new(config: &Config) -> Self {
        let joints = config.joints.each_ref();
        Self {
            rests: joints.map(|joint| joint.rest),
            kinds: joints.map(|joint| joint.plant.link.kind),
            is_confirmed: [false; 6],
        }
    }

    /// Returns the kind of each joint.
    pub(super) const fn kinds(&self) -> &[JointKind; 6] {
        &self.kinds
    }

    /// Requires the posture again, before the network boots.
    pub(super) const fn restart(&mut self) {
        self.is_confirmed = [false; 6];
    }

    /// Requires the position of one joint again, because its position is doubtful.
    pub(super) const fn require(&mut self, joint: Joint) {
        *joint.entry_mut(&mut self.is_confirmed) = false;
    }

    /// Checks joint positions `q`, in rad or m, at a request to arm, of the joints that have one. `names` are those of the
    /// joints, base first.
    ///
    /// # Errors
    /// Every joint with a rest position that is not there, and was not since its position was doubtful.
    pub(super) fn check(
        &self,
        names: &[String; 6],
        q: &JointVector,
        has_position: &[bool; 6],
    ) -> Result<(), NotAtRest> {
        let is_checked =
            |joint: Joint| *joint.entry(has_position) && !*joint.entry(&self.is_confirmed);
        self.check_joints(names, q, &Joint::ALL.map(is_checked))
    }

    /// Checks the positions of some joints, as [`check`](Self::check).
    ///
    /// # Errors
    /// Every one of `checked` with a rest position that is not there.
    pub(super) fn check_joints(
        &self,
        names: &[String; 6],
        q: &JointVector,
        checked: &[bool; 6],
    ) -> Result<(), NotAtRest> {
        let joints = Joint::each(self.rests.iter().zip(names).zip(q.iter()));
        let readings: Vec<_> = joints
            .filter_map(|(joint, ((rest, name), q))| {
                let rest = rest.filter(|rest| *joint.entry(checked) && !rest.contains(*q))?;
                Some(Reading { joint, name: name.clone(), rest, q: *q })
            })
            .collect();
        if readings.is_empty() { Ok(()) } else { Err(NotAtRest(readings)) }
    }

    /// Returns name and position of each joint that nothing verifies at an arming: it has no rest position, and this is the
    /// first arming since its position was doubtful. `q` is in rad or m.
    pub(super) fn unverified(&self, names: &[String; 6], q: &JointVector) -> Vec<String> {
        let joints = Joint::each(names.iter().zip(&self.kinds).zip(q.iter()));
        let without = joints.filter(|(joint, _)| {
            !joint.entry(&self.is_confirmed) && joint.entry(&self.rests).is_none()
        });
        without
            .map(|(_, ((name, kind), q))| format!("{name} {}", JointReading::new(*q, *kind)))
            .collect()
    }

    /// Returns the rest posture as the goal of a hold at `speed`, a share of the maximum speed.
    ///
    /// # Errors
    /// Returns the joints without a rest position.
    pub(super) fn goal(&self, names: &[String; 6], speed: f64) -> Result<HoldGoal, Vec<String>> {
        let without = self.rests.iter().zip(names).filter(|(rest, _)| rest.is_none());
        let without: Vec<_> = without.map(|(_, name)| name.clone()).collect();
        if !without.is_empty() {
            return Err(without);
        }
        let each = |of: fn(&Rest) -> f64| self.rests.map(|rest| rest.as_ref().map_or(0.0, of));
        Ok(HoldGoal {
            q: each(Rest::position).into(),
            tolerance: each(Rest::tolerance).into(),
            speed,
        })
    }

    /// Requires the posture no more until the next boot: the arm was armed in it.
    pub(super) const fn on_armed(&mut self) {
        self.is_confirmed = [true; 6];
    }

    /// Requires these joints no more: they were read there.
    pub(super) fn on_read(&mut self, joints: &[bool; 6]) {
        for (joint, _) in Joint::each(joints).filter(|(_, is_read)| **is_read) {
            *joint.entry_mut(&mut self.is_confirmed) = true;
        }
    }
}
