//! The reflection port, where task and hand exchange energy, and what keeps it passive there.
//!
//! Neither knows the task: both look only at the torques that were held and at how far the joints came.
//! A drive takes a synchronous target over at the SYNC after the one it was computed for, so what acted
//! until this sample is what was computed two cycles ago.

use crate::controller::JointVector;
use crate::controller::passivity::Passivity;
use crate::controller::period::Period;
use crate::controller::tank::Tank;
use crate::controller::velocity::Moving;
use crate::spatial::Twist;
use crate::spatial::Wrench;

/// The port, with what it has passed on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    period: Period,
    passivity: Option<Passivity>,
    tank: Option<Tank>,
    /// What was computed last, and before that.
    held: [JointVector; 2],
}

/// What the port lets through.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passed {
    /// The task wrench that may act, at {G}.
    pub f_g_task: Wrench,
    /// The wrench of the dampers that keep the port passive, at {G}.
    pub f_g_passivity: Wrench,
    /// What the hand has put into the port less what it got out, in J, where it is observed.
    pub energy: Option<f64>,
    /// What is in the tank, in J, where there is one.
    pub tank: Option<f64>,
}

impl Port {
    pub(crate) fn new(period: Period, passivity: Option<Passivity>, tank: Option<Tank>) -> Self {
        Self { period, passivity, tank, held: [JointVector::zeros(); 2] }
    }

    /// Takes the rates at which the joints came here, and lets through what may act of `f_g_task`.
    pub(crate) fn pass(&mut self, qd: &JointVector, moving: &Moving, f_g_task: &Wrench) -> Passed {
        let dt = self.period.seconds();
        let v_g = &moving.v_g_raw;
        let [_, acted] = self.held;
        let work = -acted.dot(qd) * dt; // of the hand against the port, since the last sample
        let mut passed = Passed { f_g_task: *f_g_task, ..Passed::default() };
        if let Some(tank) = &mut self.tank {
            tank.account(work);
            passed.f_g_task = *f_g_task * tank.share(f_g_task.power(v_g) * dt);
            passed.f_g_passivity = damper(tank.refill(), v_g);
            passed.tank = Some(tank.level());
        }
        if let Some(passivity) = &mut self.passivity {
            passivity.account(work, f_g_task);
            let damping = passivity.wrench(dt, v_g, &passed.f_g_task);
            passed.f_g_passivity = passed.f_g_passivity + damping;
            passed.energy = Some(passivity.energy());
        }
        passed
    }

    /// The torques of the port, as far as they are really asked for, in N·m or N.
    pub(crate) fn hold(&mut self, tau: &JointVector) {
        let [last, _] = self.held;
        self.held = [*tau, last];
    }
}

/// A damper of `strength` N·s/m on translations; rotations have none of their own.
fn damper(strength: f64, v_g: &Twist) -> Wrench {
    Wrench { force: v_g.linear * -strength, ..Wrench::ZERO }
}
