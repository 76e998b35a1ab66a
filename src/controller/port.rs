//! The reflection port, where task and hand exchange energy, and what keeps it passive there.
//!
//! Neither knows the task: both look only at the torques that were held and at how far the joints came.
//! [`TorqueDelay`] says which torque acted until this sample.

use crate::JointVector;
use crate::passivity::Passivity;
use crate::period::Period;
use crate::tank::Tank;
use crate::torque_delay::TorqueDelay;
use crate::velocity::Moving;
use units::spatial::{Twist, Wrench};

/// The port with its state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    period: Period,
    passivity: Option<Passivity>,
    tank: Option<Tank>,
    /// Torques of the port.
    held: TorqueDelay<JointVector>,
}

/// Output of the port.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passed {
    /// The task wrench that may act, at {G}.
    pub f_g_task: Wrench,
    /// The wrench of the dampers that keep the port passive, at {G}.
    pub f_g_passivity: Wrench,
    /// Energy from the hand into the port less energy out of it, in J, where it is observed.
    pub energy: Option<f64>,
    /// Level of the tank, in J, where there is one.
    pub tank: Option<f64>,
}

impl Port {
    pub(crate) fn new(period: Period, passivity: Option<Passivity>, tank: Option<Tank>) -> Self {
        Self { period, passivity, tank, held: TorqueDelay::new(JointVector::zeros()) }
    }

    /// Takes the rates at which the joints came here, and lets through what may act of `f_g_task`.
    pub(crate) fn pass(&mut self, qd: &JointVector, moving: &Moving, f_g_task: &Wrench) -> Passed {
        let dt = self.period.seconds();
        let v_g = &moving.v_g_raw;
        let work = -self.held.acted().dot(qd) * dt; // of the hand against the port, since the last sample
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
    pub(crate) const fn hold(&mut self, tau: &JointVector) {
        self.held.push(*tau);
    }
}

/// A damper of `strength` N·s/m on translations; rotations have none of their own.
fn damper(strength: f64, v_g: &Twist) -> Wrench {
    Wrench { force: v_g.linear * -strength, ..Wrench::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passivity::PassivitySettings;
    use crate::tank::TankSettings;

    const DT: f64 = 1e-3;

    fn port(has_tank: bool) -> Port {
        let observed = PassivitySettings {
            max_energy: 1e3,
            max_damping: 20.0,
            lever: 0.1,
            contact_threshold: 0.1,
            contact_release_cycles: 500,
            is_one_sided: true,
        };
        let tank = TankSettings {
            initial: 0.1,
            min: 0.0,
            low: 0.05,
            max: 1e3,
            refill: 50.0,
            max_damping: 2e3,
        };
        Port::new(
            Period::new(DT).unwrap(),
            (!has_tank).then(|| Passivity::new(observed).unwrap()),
            has_tank.then(|| Tank::new(tank).unwrap()),
        )
    }

    fn first(value: f64) -> JointVector {
        JointVector::from([value, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn push() -> Wrench {
        Wrench { force: [1.0, 0.0, 0.0].into(), ..Wrench::ZERO }
    }

    fn at_rest() -> Moving {
        Moving::default()
    }

    /// Work of the hand booked in each cycle, if these torques are held at these rates.
    fn booked(has_tank: bool, taus: &[f64], rates: &[f64]) -> Vec<f64> {
        let mut port = port(has_tank);
        let mut before = if has_tank { 0.1 } else { 0.0 };
        let cycle = |(tau, qd): (&f64, &f64)| {
            let passed = port.pass(&first(*qd), &at_rest(), &push());
            port.hold(&first(*tau));
            let level = passed.energy.or(passed.tank).unwrap();
            level - std::mem::replace(&mut before, level)
        };
        taus.iter().zip(rates).map(cycle).collect()
    }

    #[test]
    fn torque_works_from_the_sync_after_its_own_to_the_next() {
        // Computed from sample 0, taken over at SYNC 1, in force until SYNC 2: sample 2 shows its motion.
        for has_tank in [false, true] {
            let work = booked(has_tank, &[3.0, 0.0, 0.0, 0.0], &[-1.0, -10.0, -100.0, -1_000.0]);
            let of_third = 3.0 * 100.0 * DT;
            for (work, expected) in work.iter().zip([0.0, 0.0, of_third, 0.0]) {
                assert!((work - expected).abs() < 1e-12, "{work} J instead of {expected}");
            }
        }
    }

    #[test]
    fn hand_that_gives_way_takes_energy_out() {
        let work = booked(false, &[2.0; 5], &[1.0; 5]);
        assert!(work.iter().skip(2).all(|work| (work + 2.0 * DT).abs() < 1e-12), "{work:?}");
        let work = booked(true, &[2.0; 5], &[1.0; 5]);
        assert!(work.iter().skip(2).all(|work| (work + 2.0 * DT).abs() < 1e-12), "{work:?}");
    }

    #[test]
    fn empty_tank_lets_no_power_out_and_damps() {
        let mut port = port(true);
        let moving = Moving {
            v_g_raw: Twist { linear: [0.5, 0.0, 0.0].into(), ..Twist::ZERO },
            ..at_rest()
        };
        for _ in 0..200 {
            port.hold(&first(10.0));
            port.pass(&first(1.0), &moving, &push());
        }
        let passed = port.pass(&first(1.0), &moving, &push());
        assert!(passed.f_g_task.power(&moving.v_g_raw).abs() < 1e-12, "{passed:?}");
        assert!(passed.f_g_passivity.power(&moving.v_g_raw) < 0.0, "{passed:?}");
    }

    #[test]
    fn port_without_layers_passes_all() {
        let mut port = Port::new(Period::new(DT).unwrap(), None, None);
        port.hold(&first(1.0));
        let passed = port.pass(&first(1.0), &at_rest(), &push());
        assert_eq!(passed, Passed { f_g_task: push(), ..Passed::default() });
    }
}
