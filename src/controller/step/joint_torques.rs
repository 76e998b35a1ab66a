//! Joint torques of a cycle: the requested contributions (Eq. 7, 3.3), and their limit (Eq. 10).

use crate::booking::PortTorques;
use crate::friction::FrictionCompensation;
use crate::friction_bound::GripLoad;
use crate::hold::HeldArm;
use crate::interpretation::Weight;
use crate::limits::{LimitedTorques, Slew, TorqueRequest};
use crate::step::{ArmState, Controller, GripWrenches, permitted};
use crate::switches::Permissions;
use crate::valid_input::ValidInput;
use crate::{DriveTargets, Input, InvalidValue, JointVector, Ledger};
use units::numbering::Joint;
use units::spatial::Wrench;

impl Controller {
    /// Computes the requested joint torques: Jᵀ times the wrenches at the grip, gravity, soft stops and friction.
    pub(super) fn torques(
        &mut self,
        given: &ValidInput,
        permissions: &Permissions,
        arm: &ArmState,
        grip: &GripWrenches,
    ) -> Ledger {
        let ArmState { qd, j_g, twist, .. } = arm;
        let GripWrenches { port, f_g_centring, f_g_damping, ramp } = grip;
        let f_g_task = &port.f_g_task;
        let f_g_return = *f_g_centring * self.fade(f_g_task, f_g_centring);
        let soft_stops = self.soft_stops(permissions, arm);
        let load = GripLoad::new(&twist.v_g, f_g_task, &f_g_return, f_g_damping)
            .driven_by(soft_stops.dot(qd));
        // An active port needs the dissipation of friction.
        let weight = ramp * (1.0 - port.activity);
        Ledger {
            task: j_g.torques(f_g_task),                      // Eq. 7
            gravity: self.gravity(arm) * given.gravity_share, // 3.3
            centring: j_g.torques(&f_g_return),
            damping: j_g.torques(f_g_damping),
            passivity: j_g.torques(&permitted(permissions.task, port.f_g_passivity)),
            soft_stops,
            friction: self.friction(given, arm, &load, weight),
            self_driven: self.self_driven(),
            share: given.reflection_share,
            ..Ledger::nothing()
        }
    }

    /// Returns the remaining share of the return to centre in contact, 0 to 1 (decision 23). Damping does not fade.
    fn fade(&self, f_g_task: &Wrench, f_g_centring: &Wrench) -> f64 {
        self.layers.contact_fade.map_or(1.0, |fade| fade.share(f_g_task, f_g_centring))
    }

    /// Computes the gravity compensation (decision 12).
    fn gravity(&self, ArmState { posture, j_g, .. }: &ArmState) -> JointVector {
        let arm = &self.settings.arm;
        match self.settings.interpretation.weight {
            Weight::PerLink => arm.gravity(posture),
            Weight::AtGrip => j_g.torques(&arm.gravity_at_grip(posture)),
        }
    }

    /// Computes the torques of the soft stops; zero with the deadman open.
    fn soft_stops(&self, permissions: &Permissions, arm: &ArmState) -> JointVector {
        let stops = self.layers.soft_stops.filter(|_| permissions.commands);
        stops.map_or_else(JointVector::zeros, |stops| stops.torques(&arm.q, &arm.qd))
    }

    /// Computes the friction compensation with `weight`, 0 to 1; zero if not configured. Without gravity compensation the
    /// arm is not armed, which restores a withdrawn compensation.
    fn friction(
        &mut self,
        given: &ValidInput,
        arm: &ArmState,
        load: &GripLoad,
        weight: f64,
    ) -> JointVector {
        let Some(friction) = &mut self.layers.friction else { return JointVector::zeros() };
        if given.gravity_share <= 0.0 {
            friction.rearm();
        }
        friction.torques(&arm.q, &arm.qd, load, weight)
    }

    /// Returns the self-driven joint since the last arming.
    fn self_driven(&self) -> Option<Joint> {
        self.layers.friction.as_ref().and_then(FrictionCompensation::self_driven)
    }

    /// Adds the torques of the hold to a request. Without gravity compensation there are none.
    pub(super) fn held(&mut self, request: Ledger, input: &Input, arm: &ArmState) -> Ledger {
        if input.gravity_share <= 0.0 {
            self.hold.cut();
        }
        if !self.hold.is_active() || input.gravity_share <= 0.0 {
            return request;
        }
        let arm = HeldArm {
            q: arm.q,
            qd: arm.qd,
            mass: self.settings.arm.mass_matrix(&arm.posture),
            gravity: self.gravity(arm),
            j_g: &arm.j_g,
        };
        Ledger { hold: self.hold.torques(&arm, input.hold) * input.gravity_share, ..request }
    }

    /// Limits the requested torques to the actuators' capacities and rates of change.
    pub(super) fn limit(
        &mut self,
        request: Ledger,
        held: Option<DriveTargets>,
    ) -> (JointVector, Ledger, Option<InvalidValue>) {
        if held == Some(DriveTargets::Withdrawn) {
            self.layers.slew.iter_mut().for_each(Slew::reset);
        }
        let coupling = self.settings.calibration.coupling();
        let port = request.task + request.passivity;
        let torques = TorqueRequest {
            gravity: coupling.at_actuators(&carried(&request)),
            task: coupling.at_actuators(&(port + request.soft_stops + request.friction)),
            assist: coupling.at_actuators(&(request.centring + request.damping)),
        };
        let limited = self.limits.combine(&torques, request.share);
        let LimitedTorques { assist_scale, rest_scale, limiting_joint, is_broken, .. } = limited;
        let (tau_a, slewing_joint) = match &mut self.layers.slew {
            Some(slew) if is_broken => slew.drop_to_zero(),
            Some(slew) => slew.limit(&limited.tau),
            None => (limited.tau, None),
        };
        let held_share = if is_broken { 0.0 } else { rest_scale * request.share };
        let [port, damper] = [port, request.passivity].map(|tau| {
            coupling.at_actuators(&if is_broken { JointVector::zeros() } else { tau * held_share })
        });
        self.port.request(&limited.tau, &PortTorques { port, damper });
        self.last.0 = tau_a;
        let tau = coupling.at_joints(&tau_a);
        let broken = is_broken.then_some(InvalidValue::TorqueNotFinite);
        let [limiting_joint, slewing_joint] =
            [limiting_joint, slewing_joint].map(|place| place.and_then(Joint::at));
        let ledger = Ledger { assist_scale, rest_scale, limiting_joint, slewing_joint, ..request };
        (tau, ledger, broken)
    }
}

/// Returns the torques that are not scaled: gravity compensation, and the hold in its motion.
fn carried(request: &Ledger) -> JointVector {
    // A sum with zeros would lose the sign of a zero, and sessions are compared bit by bit.
    let is_held = request.hold.iter().any(|tau| *tau != 0.0);
    if is_held { request.gravity + request.hold } else { request.gravity }
}
