//! Reflection port, the one-port where task and hand exchange energy, with passivity layer and tank.
//!
//! Both layers use only held torques and joint motion, not a model of the task. `Booking` computes the port's part of
//! the held torques; [`TorqueDelay`] selects the torque that acted up to this sample.

use crate::booking::{Booking, PortTorques};
use crate::coupling::Coupling;
use crate::damper::Damper;
use crate::never_pulls::NeverPulls;
use crate::passivity::Passivity;
use crate::period::Period;
use crate::tank::Tank;
use crate::torque_delay::TorqueDelay;
use crate::unloading::Unloading;
use crate::velocity::GripTwist;
use crate::{Extensions, JointVector};
use units::spatial::{Twist, Wrench};

/// Reflection port with its layers and their state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    period: Period,
    passivity: Option<Passivity>,
    damper: Damper,
    /// Bounds K_D so that it never pulls into the surface.
    bounds_damping: bool,
    never_pulls: NeverPulls,
    unloading: Unloading,
    tank: Option<Tank>,
    booking: Booking,
    /// Held torques of the port, at the joints.
    held: TorqueDelay<PortTorques>,
    /// Joint positions of the last sample.
    q_before: Option<JointVector>,
}

/// Wrenches and energies of the reflection port in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PortOutput {
    /// Permitted task wrench, at {G}.
    pub f_g_task: Wrench,
    /// Wrench of the passivity damper and the tank's damper, at {G}.
    pub f_g_passivity: Wrench,
    /// Activity of the port, 0 to 1: four times the passivity damper over its maximum, at most 1.
    pub activity: f64,
    /// Observed net energy from the hand into the port, in J; `None` without a passivity layer.
    pub energy: Option<f64>,
    /// Level of the tank, in J; `None` without one.
    pub tank: Option<f64>,
}

impl Port {
    /// Bounds the wrench of K_D at {G}, so that its sum with this cycle's port wrenches does not pull into the surface.
    pub(crate) fn bounded_damping(&self, f_g_damping: &Wrench, passed: &PortOutput) -> Wrench {
        let f_g_port = passed.f_g_task + passed.f_g_passivity;
        self.never_pulls.bounded_damping(f_g_damping, &f_g_port)
    }

    pub(crate) fn new(period: Period, layers: &Extensions) -> Self {
        let Extensions { passivity, tank, damping_never_pulls, .. } = *layers;
        let held = TorqueDelay::new(PortTorques::zero());
        Self {
            period,
            passivity,
            bounds_damping: damping_never_pulls || passivity.is_some(),
            damper: Damper::default(),
            never_pulls: NeverPulls::default(),
            unloading: Unloading::default(),
            tank,
            booking: Booking::new(),
            held,
            q_before: None,
        }
    }

    /// Returns whether a layer observes energy. Without one, booking is unnecessary.
    pub(crate) const fn is_observed(&self) -> bool {
        self.passivity.is_some() || self.tank.is_some()
    }

    /// Books the torques that the actuators hold since the last cycle, in N·m or N.
    pub(crate) fn book(&mut self, tau_a: &JointVector, coupling: &Coupling<6>) {
        let PortTorques { port, damper } = self.booking.book(tau_a);
        let [port, damper] = [port, damper].map(|tau_a| coupling.at_joints(&tau_a));
        self.held.push(PortTorques { port, damper });
    }

    /// Records the actuator torques requested in this cycle, before their slew limit, and the port's part of them.
    pub(crate) const fn request(&mut self, tau_a: &JointVector, parts: &PortTorques) {
        self.booking.request(tau_a, parts);
    }

    /// Updates the layers with new joint positions; returns the permitted part of `f_g_task` and the dampers' wrench.
    ///
    /// Targets take effect at the next SYNC. The torque of two cycles ago therefore acted during all of the motion
    /// since the last sample, skipped cycles included.
    pub(crate) fn pass(
        &mut self,
        q: &JointVector,
        twist: &GripTwist,
        f_g_task: &Wrench,
        storage: Storage,
    ) -> PortOutput {
        let dt = self.period.seconds();
        let v_g = &twist.v_g_raw;
        let dq = q - self.q_before.replace(*q).unwrap_or(*q);
        let work = -self.held.acted().port.dot(&dq); // hand → port, since the last sample
        let mut passed = PortOutput { f_g_task: *f_g_task, ..PortOutput::default() };
        if let Some(tank) = &mut self.tank {
            tank.account(work);
            passed.f_g_task = *f_g_task * tank.share(f_g_task.power(v_g) * dt);
            passed.f_g_passivity = damper(tank.refill(), v_g);
            passed.tank = Some(tank.level());
        }
        if self.bounds_damping {
            self.never_pulls.update(dt, &passed.f_g_task, v_g);
        }
        if let Some(passivity) = &mut self.passivity {
            let Storage { stored, returned, raised } = storage;
            passivity.account(work, f_g_task, stored.max(returned));
            passivity.grant(raised);
            if self.never_pulls.has_left() {
                passivity.release();
            }
            let initial = passivity.max_energy();
            passivity.grant(self.unloading.grant(passivity.is_in_contact(), initial, returned));
            // Predicted with the motion of the last cycle.
            let in_flight = -self.held.in_flight().damper.dot(&dq);
            let wanted = passivity.damping(dt, v_g, in_flight);
            self.damper.next(dt, wanted, passivity.max_damping(), v_g, passivity.is_engaged());
            let (damping, v_g) = (self.damper.damping(), self.damper.v_g());
            let f_g_damper = passivity.wrench(damping, v_g, &passed.f_g_task);
            let f_g_damper = self.never_pulls.bounded_damper(&f_g_damper, &passed.f_g_task);
            passed.f_g_passivity = passed.f_g_passivity + f_g_damper;
            passed.activity = (4.0 * damping / passivity.max_damping()).min(1.0);
            passed.energy = Some(passivity.energy());
        }
        passed
    }
}

/// Energy of a contact, in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Storage {
    /// Energy that the hand has stored in the spring of the contact.
    pub(crate) stored: f64,
    /// Maximum energy that the law returns if the hand unloads now.
    pub(crate) returned: f64,
    /// Part of `stored` added in this cycle by a rising force scale. The observer grants it, since no work of the hand did.
    pub(crate) raised: f64,
}

/// Returns the wrench of a damper of `strength` N·s/m on translations; rotations are not damped.
fn damper(strength: f64, v_g: &Twist) -> Wrench {
    Wrench { force: v_g.linear * -strength, ..Wrench::ZERO }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

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
        let layers = Extensions {
            passivity: (!has_tank).then(|| Passivity::new(observed).unwrap()),
            tank: has_tank.then(|| Tank::new(tank).unwrap()),
            ..Extensions::default()
        };
        Port::new(Period::new(DT).unwrap(), &layers)
    }

    fn first(value: f64) -> JointVector {
        JointVector::from([value, 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    fn push() -> Wrench {
        Wrench { force: [1.0, 0.0, 0.0].into(), ..Wrench::ZERO }
    }

    /// Requests a port torque that the drives then hold.
    fn hold(port: &mut Port, tau: f64, damper: f64) {
        port.request(&first(tau), &PortTorques { port: first(tau), damper: first(damper) });
        port.book(&first(tau), &Coupling::none());
    }

    fn at_rest() -> GripTwist {
        GripTwist::default()
    }

    /// Returns the work of the hand booked in each cycle, with these torques held at these rates.
    fn booked(has_tank: bool, taus: &[f64], rates: &[f64]) -> Vec<f64> {
        let mut port = port(has_tank);
        // The observer starts with a credit of `max_energy`.
        let mut before = if has_tank { 0.1 } else { 1e3 };
        let mut q = 0.0;
        let mut held = 0.0;
        let cycle = |(tau, qd): (&f64, &f64)| {
            q += qd * DT;
            hold(&mut port, held, 0.0);
            held = *tau;
            let passed = port.pass(&first(q), &at_rest(), &push(), Storage::default());
            let level = passed.energy.or(passed.tank).unwrap();
            level - std::mem::replace(&mut before, level)
        };
        taus.iter().zip(rates).map(cycle).collect()
    }

    #[test]
    fn torque_works_from_the_sync_after_its_own_to_the_next() {
        // Computed from sample 0, applied from SYNC 1 to SYNC 2: sample 2 shows its motion.
        for has_tank in [false, true] {
            let work = booked(has_tank, &[-3.0, 0.0, 0.0, 0.0], &[-0.1, -1.0, -10.0, -100.0]);
            let of_third = -3.0 * 10.0 * DT;
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
        let twist = GripTwist {
            v_g_raw: Twist { linear: [0.5, 0.0, 0.0].into(), ..Twist::ZERO },
            ..at_rest()
        };
        let mut q = 0.0;
        for _ in 0..200 {
            hold(&mut port, 10.0, 0.0);
            q += DT;
            port.pass(&first(q), &twist, &push(), Storage::default());
        }
        let passed = port.pass(&first(q + DT), &twist, &push(), Storage::default());
        assert!(passed.f_g_task.power(&twist.v_g_raw).abs() < 1e-12, "{passed:?}");
        assert!(passed.f_g_passivity.power(&twist.v_g_raw) < 0.0, "{passed:?}");
    }

    #[test]
    fn port_without_layers_passes_all() {
        let mut port = Port::new(Period::new(DT).unwrap(), &Extensions::default());
        hold(&mut port, 1.0, 0.0);
        let passed = port.pass(&first(1.0), &at_rest(), &push(), Storage::default());
        assert_eq!(passed, PortOutput { f_g_task: push(), ..PortOutput::default() });
    }

    #[test]
    fn damping_pulls_into_the_surface_unless_it_is_asked_not_to() {
        let drag = Wrench { force: Vector3::new(-3.0, 1.0, 0.0), ..Wrench::ZERO };
        let damped = |damping_never_pulls| {
            let layers = Extensions { damping_never_pulls, ..Extensions::default() };
            let mut port = Port::new(Period::new(DT).unwrap(), &layers);
            let passed = port.pass(&first(0.0), &at_rest(), &push(), Storage::default());
            port.bounded_damping(&drag, &passed).force
        };
        assert_eq!(damped(false), drag.force);
        assert_eq!(damped(true), Vector3::new(-1.0, 1.0, 0.0));
    }
}
