//! Dynamics of the arm: mass matrix, bias, accelerations, energy.
//!
//! Bodies, motions and forces are expressed at the origin of {0} in its axes (Featherstone 2008, spatial vectors), so
//! they add up. The mass matrix uses composite bodies (6.2), the bias the recursive Newton-Euler algorithm (5.3):
//!
//! ```text
//!  M_ij = s_i · (I_j + I_j+1 + ..) s_j,  i <= j        bias_i = s_i · Σ_k>=i (I_k a_k + v_k x* I_k v_k)
//! ```

use nalgebra::{IsometryMatrix3, Vector3};

use crate::arm::rigid::{Body, Effort, Motion};
use crate::arm::{Arm, JointKind, JointMatrix, Joints, Link, Posture};
use units::spatial::Wrench;

/// Equation of motion at one state: `M qdd + bias = tau`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dynamics<const N: usize = 6> {
    /// `M(q)`, with the rotor inertias.
    pub(crate) mass: JointMatrix<N>,
    /// Bias: `C(q, qd) qd + g(q)`.
    pub(crate) bias: Joints<N>,
}

impl<const N: usize> Arm<N> {
    /// Returns mass matrix and bias, in one pass outward and one inward.
    pub(crate) fn dynamics(&self, posture: &Posture<N>, qd: &Joints<N>) -> Dynamics<N> {
        self.dynamics_along(posture.x_0_links.iter().copied(), qd)
    }

    /// Returns mass matrix and bias at joint positions `q`, without the posture's other poses.
    pub(crate) fn dynamics_at(&self, q: &Joints<N>, qd: &Joints<N>) -> Dynamics<N> {
        let mut x_0_i = IsometryMatrix3::identity();
        let x_0_links = self.links.iter().zip(q.iter()).map(|(link, q)| {
            x_0_i *= link.step(*q);
            x_0_i
        });
        self.dynamics_along(x_0_links, qd)
    }

    /// Returns mass matrix and bias with the links at these poses in {0}: link by link outward, then summed inward.
    fn dynamics_along(
        &self,
        x_0_links: impl Iterator<Item = IsometryMatrix3<f64>>,
        qd: &Joints<N>,
    ) -> Dynamics<N> {
        let mut moving = [Moving::NONE; N];
        let mut velocity = Motion::NONE;
        // Gravity as an upward acceleration of the base.
        let mut acceleration = Motion { angular: Vector3::zeros(), linear: -self.gravity };
        let links = self.links.iter().zip(x_0_links).zip(qd.iter());
        for (moving, ((link, x_0_i), qd)) in moving.iter_mut().zip(links) {
            let (body, axis) = (link.body.carried_in(&x_0_i), link.unit_motion(&x_0_i));
            let own = axis.scaled(*qd);
            acceleration = acceleration.plus(&velocity.cross(&own));
            velocity = velocity.plus(&own);
            let momentum = body.times(&velocity);
            let effort = body.times(&acceleration).plus(&velocity.cross_effort(&momentum));
            *moving = Moving { body, axis, effort };
        }
        self.summed(&moving)
    }

    /// Sums forces and composite bodies inward: a joint moves all links outward of it as one body.
    fn summed(&self, moving: &[Moving; N]) -> Dynamics<N> {
        let (mut mass, mut bias) = (JointMatrix::<N>::zeros(), Joints::<N>::zeros());
        let (mut composite, mut outboard) = (Body::NONE, Effort::NONE);
        for ((joint, link), bias) in moving.iter().enumerate().zip(bias.iter_mut()).rev() {
            outboard = outboard.plus(&link.effort);
            *bias = link.axis.dot(&outboard);
            composite = composite.plus(&link.body);
            let effort = composite.times(&link.axis);
            let mut column = mass.column_mut(joint);
            for (inboard, entry) in moving.iter().zip(column.iter_mut()).take(joint + 1) {
                *entry = inboard.axis.dot(&effort);
            }
        }
        mass.fill_lower_triangle_with_upper_triangle();
        Dynamics { mass: mass + self.rotors, bias }
    }

    /// Returns the joint torques that balance gravity, in N·m or N: the bias at rest, in which inertia has no part.
    pub fn gravity(&self, posture: &Posture<N>) -> Joints<N> {
        let (mut tau, mut outboard) = (Joints::<N>::zeros(), Effort::NONE);
        let links = self.links.iter().zip(&posture.x_0_links);
        for (tau, (link, x_0_i)) in tau.iter_mut().zip(links).rev() {
            outboard = outboard.plus(&link.body.support_in(x_0_i, &-self.gravity));
            *tau = link.unit_motion(x_0_i).dot(&outboard);
        }
        tau
    }

    /// Returns the bias: `C(q, qd) qd + g(q)`.
    pub fn bias(&self, posture: &Posture<N>, qd: &Joints<N>) -> Joints<N> {
        self.dynamics(posture, qd).bias
    }

    /// Returns `M(q)` with the rotor inertias, in kg·m² (kg for a prismatic joint).
    pub fn mass_matrix(&self, posture: &Posture<N>) -> JointMatrix<N> {
        self.dynamics(posture, &Joints::zeros()).mass
    }

    /// Returns the accelerations for torques `tau` and a wrench on the grip, at {G} in {G}.
    pub fn acceleration(
        &self,
        posture: &Posture<N>,
        qd: &Joints<N>,
        tau: &Joints<N>,
        f_g: &Wrench,
    ) -> Joints<N> {
        let Dynamics { mass, bias } = self.dynamics(posture, qd);
        let push = tau + self.jacobian(posture).torques(f_g) - bias;
        accelerations(mass, &push, &[false; N])
    }

    /// Returns kinetic plus potential energy, in J; the latter is zero for masses at the origin of {0}.
    pub fn energy(&self, posture: &Posture<N>, qd: &Joints<N>) -> f64 {
        let kinetic = qd.dot(&(self.mass_matrix(posture) * qd)) / 2.0;
        let links = self.links.iter().zip(&posture.x_0_links);
        let bodies = links.map(|(link, x_0_i)| link.body.carried_in(x_0_i));
        kinetic - bodies.map(|body| body.first_moment.dot(&self.gravity)).sum::<f64>()
    }
}

/// Motion and force of a link at a posture, at the origin of {0} in its axes.
#[derive(Clone, Copy, Debug)]
struct Moving {
    body: Body,
    /// Motion of the link at unit rate of its joint.
    axis: Motion,
    /// Force that moves it.
    effort: Effort,
}

impl Moving {
    const NONE: Self = Self { body: Body::NONE, axis: Motion::NONE, effort: Effort::NONE };
}

/// Returns the accelerations of `mass` under `push`; joints that are `held` have none.
pub(crate) fn accelerations<const N: usize>(
    mut mass: JointMatrix<N>,
    push: &Joints<N>,
    held: &[bool; N],
) -> Joints<N> {
    let mut push = *push;
    for (joint, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        mass.fill_row(joint, 0.0);
        mass.fill_column(joint, 0.0);
        mass.view_mut((joint, joint), (1, 1)).fill(1.0);
        push.fill_row(joint, 0.0);
    }
    mass.cholesky().map_or_else(Joints::zeros, |mass| mass.solve(&push))
}

impl Link {
    /// Returns the motion of this link at unit rate of its joint.
    fn unit_motion(&self, x_0_i: &IsometryMatrix3<f64>) -> Motion {
        let axis = x_0_i.rotation * Vector3::z();
        match self.kind {
            JointKind::Revolute => {
                Motion { angular: axis, linear: x_0_i.translation.vector.cross(&axis) }
            }
            JointKind::Prismatic => Motion { angular: Vector3::zeros(), linear: axis },
            JointKind::Fixed => Motion::NONE,
        }
    }
}
