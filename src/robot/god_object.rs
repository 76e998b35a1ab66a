//! God-object (Zilles and Salisbury 1995): in pose mode, an object that a virtual coupling draws to its command and
//! that surfaces stop. The coupling is that of Colgate, Stanley and Brown (1995).
//!
//! The object has no mass. At the end of every period the coupling and the contact are in equilibrium:
//!
//! ```text
//!  K s + B ds/dt = f_m(x_b_m, v_m)      s: from the commanded pose to the object, in the commanded frame
//! ```
//!
//! In free space the equilibrium is the commanded pose, without lag. On a rigid surface it is the point of the surface
//! nearest to the command. A surface of stiffness `k_e` yields by `K / (K + k_e)` of the commanded depth.
//!
//! Backward Euler with Newton's method is stable for any stiffness of the surface. The iteration starts at the last pose,
//! so the object stays on its side of a surface.

use std::iter;

use nalgebra::{Isometry3, SMatrix, SVector};
use thiserror::Error;

use units::spatial::{Twist, Wrench};

/// Maximum stiffness and damping, in N/m, N·m/rad, N·s/m and N·m·s/rad.
const MAX_VALUE: f64 = 1e6;

/// Maximum Newton steps in a period; the next period continues from the result.
const MAX_STEPS: usize = 16;

/// Maximum halvings of a step that does not reduce the imbalance.
const MAX_HALVINGS: usize = 32;

/// Step of the numerical derivative, in m or rad.
const DIFFERENCE: f64 = 1e-8;

/// Energy of a converged imbalance, in J: 0.1 µN at 5 kN/m.
const TOLERANCE: f64 = 1e-18;

/// Spring and damper that draw the object to its command, per axis of {MRF}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    stiffness: [f64; 6],
    damping: [f64; 6],
}

/// Stiffness or damping out of range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidCoupling {
    /// Stiffness out of range. Without a spring the object would not follow its command.
    #[error("stiffness of a virtual coupling must be above 0 and at most {MAX_VALUE}, got {0}")]
    Stiffness(f64),
    /// Damping out of range.
    #[error("damping of a virtual coupling must be within 0..={MAX_VALUE}, got {0}")]
    Damping(f64),
}

impl Coupling {
    /// Creates a coupling from its stiffness in N/m and N·m/rad, and its damping in N·s/m and N·m·s/rad.
    ///
    /// # Errors
    /// Returns the first value out of range, or NaN.
    pub fn new(stiffness: [f64; 6], damping: [f64; 6]) -> Result<Self, InvalidCoupling> {
        let is_spring = |value: &f64| *value > 0.0 && *value <= MAX_VALUE;
        if let Some(wrong) = stiffness.into_iter().find(|value| !is_spring(value)) {
            return Err(InvalidCoupling::Stiffness(wrong));
        }
        match damping.into_iter().find(|value| !(0.0..=MAX_VALUE).contains(value)) {
            Some(wrong) => Err(InvalidCoupling::Damping(wrong)),
            None => Ok(Self { stiffness, damping }),
        }
    }
}

/// Coupling with its stretch at the end of the last period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GodObject {
    coupling: Coupling,
    stretch: Option<Twist>,
}

impl GodObject {
    /// Creates a god-object without a command.
    pub const fn new(coupling: Coupling) -> Self {
        Self { coupling, stretch: None }
    }

    /// Discards the stretch, if no pose is commanded.
    pub const fn release(&mut self) {
        self.stretch = None;
    }

    /// Computes the twist that moves the object from `x_b_m` to equilibrium in `dt` s, which must be positive. `contact`
    /// returns the wrench on the object at {MRF} for a pose and a twist of {MRF}.
    pub fn twist(
        &self,
        dt: f64,
        x_b_d: &Isometry3<f64>,
        x_b_m: &Isometry3<f64>,
        contact: impl Fn(&Isometry3<f64>, &Twist) -> Wrench,
    ) -> Twist {
        let balance = Balance {
            stiffness: self.coupling.stiffness,
            // In the first cycle the stretch has no rate.
            damping: self.stretch.map_or([0.0; 6], |_| self.coupling.damping),
            before: self.stretch.unwrap_or_default(),
            x_d_m: x_b_d.inverse() * x_b_m,
            x_b_m: *x_b_m,
            dt,
            contact,
        };
        balance.solved() * dt.recip()
    }

    /// Records the pose that the object reached after [`twist`](Self::twist).
    pub fn reached(&mut self, x_b_d: &Isometry3<f64>, x_b_m: &Isometry3<f64>) {
        let stretch = Twist::reaching(&(x_b_d.inverse() * x_b_m), 1.0);
        self.stretch = stretch.is_finite().then_some(stretch);
    }
}

/// Equilibrium of coupling and contact at the end of a period. The unknown is the displacement of the object in {MRF}.
struct Balance<C> {
    stiffness: [f64; 6],
    damping: [f64; 6],
    before: Twist,
    x_d_m: Isometry3<f64>,
    x_b_m: Isometry3<f64>,
    dt: f64,
    contact: C,
}

impl<C: Fn(&Isometry3<f64>, &Twist) -> Wrench> Balance<C> {
    /// Returns the displacement without imbalance, or the best one found.
    fn solved(&self) -> Twist {
        let mut dx = Twist::ZERO;
        let mut f_rest = self.imbalance(&dx);
        for _ in 0..MAX_STEPS {
            if self.energy(&f_rest) < TOLERANCE {
                break;
            }
            let Some(step) = self.newton_step(&dx, &f_rest) else { break };
            let Some(next) = self.shorter(&dx, &f_rest, step) else { break };
            (dx, f_rest) = next;
        }
        dx
    }

    /// Returns the contact wrench on the object, less the wrench that the coupling exerts on the hand, after a
    /// displacement.
    fn imbalance(&self, dx: &Twist) -> Wrench {
        let moved = dx.over(1.0);
        let stretch = Twist::reaching(&(self.x_d_m * moved), 1.0);
        let rate = (stretch + self.before * -1.0) * self.dt.recip();
        let pull = stretch.scaled(&self.stiffness) + rate.scaled(&self.damping);
        let f_m = (self.contact)(&(self.x_b_m * moved), &(*dx * self.dt.recip()));
        f_m - Wrench { force: pull.linear, moment: pull.angular }
    }

    /// Returns the energy that a wrench stores in the spring, in J: a common norm of force and moment.
    fn energy(&self, f: &Wrench) -> f64 {
        let squares = f.components().into_iter().zip(self.stiffness);
        squares.map(|(part, stiffness)| part * part / (2.0 * stiffness)).sum()
    }

    /// Returns the Newton step, which removes a linear imbalance; `None` if the derivative is singular.
    fn newton_step(&self, dx: &Twist, f_rest: &Wrench) -> Option<Twist> {
        let slope = SMatrix::<f64, 6, 6>::from([0, 1, 2, 3, 4, 5].map(|axis| {
            let unit = std::array::from_fn(|other| if other == axis { DIFFERENCE } else { 0.0 });
            let f_moved = self.imbalance(&(*dx + Twist::from_components(unit)));
            ((f_moved - *f_rest) * DIFFERENCE.recip()).components()
        }));
        let step = slope.lu().solve(&SVector::from((-*f_rest).components()))?;
        Some(Twist::from_components(step.into()))
    }

    /// Halves `step` until it reduces the imbalance; returns the new displacement and its imbalance.
    fn shorter(&self, dx: &Twist, f_rest: &Wrench, step: Twist) -> Option<(Twist, Wrench)> {
        let energy = self.energy(f_rest);
        let halved = iter::successors(Some(step), |step| Some(*step * 0.5)).take(MAX_HALVINGS);
        let mut next = halved.map(|step| *dx + step).map(|next| (next, self.imbalance(&next)));
        next.find(|(_, f_next)| self.energy(f_next) < energy)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    const DT: f64 = 1e-3;

    /// Position of the wall's surface along x, in m.
    const SURFACE: f64 = 0.5;

    fn coupling() -> Coupling {
        Coupling::new([5e3, 5e3, 5e3, 20.0, 20.0, 20.0], [10.0, 10.0, 10.0, 0.02, 0.02, 0.02])
            .unwrap()
    }

    /// Returns a wall of stiffness `k_e` that a point of the object at `p_m` touches.
    fn wall(k_e: f64, p_m: Vector3<f64>) -> impl Fn(&Isometry3<f64>, &Twist) -> Wrench {
        move |x_b_m, _| {
            let depth = (x_b_m * nalgebra::Point3::from(p_m)).x - SURFACE;
            let force_b = Vector3::new(-k_e * depth.max(0.0), 0.0, 0.0);
            let force = x_b_m.rotation.inverse() * force_b;
            Wrench { force, moment: p_m.cross(&force) }
        }
    }

    /// Follows one command for `cycles` periods of `DT`.
    fn followed(
        x_b_m: Isometry3<f64>,
        x_b_d: &Isometry3<f64>,
        cycles: usize,
        contact: impl Fn(&Isometry3<f64>, &Twist) -> Wrench,
    ) -> Isometry3<f64> {
        let mut object = GodObject::new(coupling());
        (0..cycles).fold(x_b_m, |x_b_m, _| {
            let moved = x_b_m * object.twist(DT, x_b_d, &x_b_m, &contact).over(DT);
            object.reached(x_b_d, &moved);
            moved
        })
    }

    fn free(_: &Isometry3<f64>, _: &Twist) -> Wrench {
        Wrench::ZERO
    }

    fn pose() -> impl Strategy<Value = Isometry3<f64>> {
        prop::array::uniform6(-0.3..0.3_f64)
            .prop_map(|[x, y, z, a, b, c]| Isometry3::new([x, y, z].into(), [a, b, c].into()))
    }

    fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        let x = a.inverse() * b;
        x.translation.vector.norm() + x.rotation.angle()
    }

    proptest! {
        #[test]
        fn free_object_reaches_its_command_in_one_period(x_b_m in pose(), x_b_d in pose()) {
            prop_assert!(distance(&followed(x_b_m, &x_b_d, 1, free), &x_b_d) < 1e-9);
        }

        #[test]
        fn surface_gives_way_as_a_spring_in_series(
            k_e in 1e2..1e7_f64, depth in 1e-4..0.05_f64, y in -0.2..0.2_f64
        ) {
            let x_b_d = Isometry3::translation(SURFACE + depth, y, 0.0);
            let x_b_m = followed(Isometry3::identity(), &x_b_d, 200, wall(k_e, Vector3::zeros()));
            let expected = depth * 5e3 / (5e3 + k_e);
            let reached = x_b_m.translation.vector;
            prop_assert!((reached.x - SURFACE - expected).abs() < 1e-9, "{reached}");
            prop_assert!((reached.y - y).abs() < 1e-9 && x_b_m.rotation.angle() < 1e-9);
        }

        #[test]
        fn contact_carries_the_wrench_of_the_coupling(
            k_e in 1e2..1e6_f64, depth in 1e-3..0.02_f64, p_m in prop::array::uniform3(-0.02..0.02_f64)
        ) {
            let contact = wall(k_e, p_m.into());
            let x_b_d = Isometry3::translation(SURFACE + depth + 0.02, 0.0, 0.0);
            let x_b_m = followed(Isometry3::identity(), &x_b_d, 200, &contact);
            let stretch = Twist::reaching(&(x_b_d.inverse() * x_b_m), 1.0);
            let pull = stretch.scaled(&coupling().stiffness).components();
            let carried = contact(&x_b_m, &Twist::ZERO).components();
            prop_assert!(pull.iter().zip(carried).all(|(a, b)| (a - b).abs() < 1e-5), "{pull:?} {carried:?}");
        }

        #[test]
        fn any_command_keeps_the_twist_finite(
            command in prop::array::uniform6(any::<f64>()), dt in 1e-9..1.0_f64, f in any::<f64>()
        ) {
            let [x, y, z, a, b, c] = command;
            let x_b_d = Isometry3::new([x, y, z].into(), [a, b, c].into());
            let mut object = GodObject::new(coupling());
            let contact = |_: &Isometry3<f64>, _: &Twist| Wrench::from_components([f; 6]);
            for _ in 0..2 {
                let v_m = object.twist(dt, &x_b_d, &Isometry3::identity(), contact);
                prop_assert!(v_m.is_finite(), "{v_m:?}");
                object.reached(&x_b_d, &Isometry3::identity());
            }
        }
    }

    #[test]
    fn rigid_surface_stops_the_object_at_once() {
        let x_b_d = Isometry3::translation(SURFACE + 0.05, 0.1, 0.0);
        let start = Isometry3::translation(SURFACE - 1e-6, 0.0, 0.0);
        let x_b_m = followed(start, &x_b_d, 1, wall(1e9, Vector3::zeros()));
        assert!((x_b_m.translation.x - SURFACE).abs() < 1e-6, "{x_b_m}");
        assert!((x_b_m.translation.y - 0.1).abs() < 1e-9, "{x_b_m}");
    }

    #[test]
    fn coupling_without_a_spring_is_refused() {
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut stiffness = [1.0; 6];
            stiffness[4] = wrong;
            let refused = Coupling::new(stiffness, [0.0; 6]);
            assert!(matches!(refused, Err(InvalidCoupling::Stiffness(_))), "{wrong}");
        }
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            let refused = Coupling::new([1.0; 6], [wrong; 6]);
            assert!(matches!(refused, Err(InvalidCoupling::Damping(_))), "{wrong}");
        }
    }
}
