//! `frhc ctl zero`: a person says that joints are in their rest position.

use crate::zero::refusal::{Moving, ZeroError};
use crate::zero::unknown::UnknownJoint;
use crate::zero::{STANDSTILL_TIME, UnknownZero, UnknownZeros, ZeroState, Zeros};
use crate::{Node, RequestError};
use bus::Bus;
use canopen::pdo::DriveSample;
use remote::Remote;
use units::numbering::Joint;
use units::time::Instant;

impl Zeros {
    /// Returns the joints that a request sets: all that are not absolute, or of them `called` and the joints tied to it.
    pub(super) fn requested(
        &self,
        names: &[String; 6],
        called: Option<Joint>,
    ) -> Result<[bool; 6], ZeroError> {
        let group = called.map_or([true; 6], |joint| self.zeroing.group(joint));
        let is_set =
            |joint: Joint| *joint.entry(&group) && !self.zeroing.zero(joint).source.is_absolute();
        let joints = Joint::ALL.map(is_set);
        match called {
            _ if joints.contains(&true) => Ok(joints),
            Some(joint) => Err(ZeroError::Absolute { joint, name: joint.entry(names).clone() }),
            None => Err(ZeroError::AllAbsolute),
        }
    }

    /// Returns the joints among `joints` whose drives are homed.
    fn homed(&self, joints: &[bool; 6]) -> Vec<Joint> {
        let set =
            Joint::each(joints).filter(|(joint, is_set)| **is_set && self.homing(*joint).is_some());
        set.map(|(joint, _)| joint).collect()
    }

    /// Checks that these joints have been at standstill for long enough.
    pub(super) fn check_standstill(
        &self,
        names: &[String; 6],
        joints: &[bool; 6],
        now: Instant,
    ) -> Result<(), ZeroError> {
        let moving: Vec<_> = Joint::each(joints)
            .filter(|(_, is_set)| **is_set)
            .map(|(joint, _)| Moving {
                joint,
                name: joint.entry(names).clone(),
                at_rest: self.standstill.time(joint, now),
            })
            .filter(|moving| moving.at_rest < STANDSTILL_TIME)
            .collect();
        if moving.is_empty() { Ok(()) } else { Err(ZeroError::Moving(moving)) }
    }

    /// Returns the joints that forbid arming. Those of `set_by_arming` do not.
    pub(crate) fn unknown(
        &self,
        names: &[String; 6],
        samples: &[DriveSample; 6],
        set_by_arming: &[bool; 6],
    ) -> Result<(), UnknownZeros> {
        let q = self.zeroing.positions(&self.counts(samples));
        let joints = Joint::each(self.states.iter().zip(set_by_arming).zip(q.iter()));
        let unknown: Vec<_> = joints
            .filter_map(|(joint, ((state, is_set), q))| {
                let why = match state {
                    ZeroState::Unknown(why) if !is_set => *why,
                    ZeroState::Unknown(_) | ZeroState::Known => return None,
                };
                let awaited = self.zeroing.second_rest(joint).map(|rest| (*q, rest));
                Some(UnknownJoint {
                    joint,
                    name: joint.entry(names).clone(),
                    why,
                    awaited: awaited.filter(|_| why == UnknownZero::NotVerified),
                })
            })
            .collect();
        if unknown.is_empty() { Ok(()) } else { Err(UnknownZeros(unknown)) }
    }
}

impl<B: Bus, R: Remote> Node<B, R> {
    /// Sets the zeros of `called` and of all joints tied to it, or of all joints, by the rest posture. Drives that keep
    /// their zero are homed.
    ///
    /// # Errors
    /// When the node is not ready, the deadman is not known to be released, a joint has moved within 1 s, its posture is
    /// not the rest posture by whole revolutions, or a homing fails.
    pub(crate) fn set_zero(
        &mut self,
        now: Instant,
        called: Option<Joint>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), RequestError> {
        self.safety.check_released(self.operator.enable_state())?;
        let joints = self.zeros.requested(&self.joint_names, called)?;
        self.zeros.check_standstill(&self.joint_names, &joints, now)?;
        let homed = self.zeros.homed(&joints);
        for joint in &homed {
            self.zeros.lose(*joint, UnknownZero::NotReferenced);
        }
        self.home(&homed, give_up)?;
        let samples = *self.samples.latest();
        let q = self.zeros.positions_with(&joints, &samples);
        self.rest.check_joints(&self.joint_names, &q, &joints).map_err(ZeroError::from)?;
        self.take_zeros(&joints);
        self.rest.on_read(&joints);
        Ok(())
    }

    /// Sets the zeros of `joints` by the newest samples. A step of the positions is no speed.
    pub(crate) fn take_zeros(&mut self, joints: &[bool; 6]) {
        let samples = *self.samples.latest();
        self.zeros.set(joints, &samples);
        if self.zeros.has_shifted() {
            self.plausibility.on_zero_set();
        }
    }
}
