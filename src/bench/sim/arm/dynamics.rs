//! The arm's dynamics: mass matrix, bias, accelerations, energy.
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
    /// Mass matrix.
    pub(crate) mass: JointMatrix<N>,
    /// Bias: `C(q, qd) qd + g(q)`.
    pub(crate) bias: Joints<N>,
}

impl<const N: usize> Arm<N> {
    /// Returns mass matrix and bias, in one pass.
    pub(crate) fn dynamics(&self, posture: &Posture<N>, qd: &Joints<N>) -> Dynamics<N> {
        let (bodies, axes) = (self.bodies(posture), self.axes(posture));
        Dynamics { mass: self.mass(&bodies, &axes), bias: self.efforts(&bodies, &axes, qd) }
    }

    /// Returns the joint torques that balance gravity, in N·m or N.
    pub fn gravity(&self, posture: &Posture<N>) -> Joints<N> {
        self.bias(posture, &Joints::zeros())
    }

    /// Returns the bias: `C(q, qd) qd + g(q)`.
    pub fn bias(&self, posture: &Posture<N>, qd: &Joints<N>) -> Joints<N> {
        self.efforts(&self.bodies(posture), &self.axes(posture), qd)
    }

    /// Returns the mass matrix.
    pub fn mass_matrix(&self, posture: &Posture<N>) -> JointMatrix<N> {
        self.mass(&self.bodies(posture), &self.axes(posture))
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
        let bodies = self.bodies(posture);
        let kinetic = qd.dot(&(self.mass(&bodies, &self.axes(posture)) * qd)) / 2.0;
        kinetic - bodies.iter().map(|body| body.first_moment.dot(&self.gravity)).sum::<f64>()
    }

    fn bodies(&self, posture: &Posture<N>) -> [Body; N] {
        let mut bodies = self.links.map(|link| link.body);
        for (body, x_0_i) in bodies.iter_mut().zip(&posture.x_0_links) {
            *body = body.carried_in(x_0_i);
        }
        bodies
    }

    /// Returns the motion of each joint at unit rate.
    fn axes(&self, posture: &Posture<N>) -> [Motion; N] {
        let mut axes = [Motion::NONE; N];
        for (axis, (link, x_0_i)) in axes.iter_mut().zip(self.links.iter().zip(&posture.x_0_links))
        {
            *axis = link.unit_motion(x_0_i);
        }
        axes
    }

    /// Sums composite bodies inward: a joint moves all links outward of it as one body.
    fn mass(&self, bodies: &[Body; N], axes: &[Motion; N]) -> JointMatrix<N> {
        let mut mass = JointMatrix::<N>::zeros();
        let mut composite = Body::NONE;
        for ((joint, body), axis) in bodies.iter().enumerate().zip(axes).rev() {
            composite = composite.plus(body);
            let effort = composite.times(axis);
            let mut column = mass.column_mut(joint);
            for (axis, entry) in axes.iter().zip(column.iter_mut()).take(joint + 1) {
                *entry = axis.dot(&effort);
            }
        }
        mass.fill_lower_triangle_with_upper_triangle();
        mass + self.rotors
    }

    /// Returns the joint torques at velocities `qd` and zero accelerations.
    fn efforts(&self, bodies: &[Body; N], axes: &[Motion; N], qd: &Joints<N>) -> Joints<N> {
        let mut efforts = [Effort::NONE; N];
        let mut velocity = Motion::NONE;
        // Gravity as an upward acceleration of the base.
        let mut acceleration = Motion { angular: Vector3::zeros(), linear: -self.gravity };
        let links = bodies.iter().zip(axes).zip(qd.iter());
        for (effort, ((body, axis), qd)) in efforts.iter_mut().zip(links) {
            let own = axis.scaled(*qd);
            acceleration = acceleration.plus(&velocity.cross(&own));
            velocity = velocity.plus(&own);
            let momentum = body.times(&velocity);
            *effort = body.times(&acceleration).plus(&velocity.cross_effort(&momentum));
        }
        let mut tau = Joints::<N>::zeros();
        let mut outboard = Effort::NONE;
        for ((tau, axis), effort) in tau.iter_mut().zip(axes).zip(&efforts).rev() {
            outboard = outboard.plus(effort);
            *tau = axis.dot(&outboard);
        }
        tau
    }
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
