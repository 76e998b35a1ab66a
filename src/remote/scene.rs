//! Contact model of the commanded object: a wall, a box and a sphere, as springs, dampers and dry friction in six
//! degrees of freedom.
//!
//! Contact points are fixed in the object. A surface pushes each point inside it along the normal, with its share of
//! stiffness and damping. Moments follow from the positions of the points. A surface never pulls. Damping grows with
//! depth, so the force is continuous at contact (Hunt and Crossley 1975).
//!
//! Coulomb friction acts along the surface. Below [`FULL_SLIDING`] it is viscous, and so continuous when sliding
//! reverses. Friction only dissipates energy. Without stiction, a point under tangential load creeps.
//!
//! ```text
//!  f_t = -µ f_n v_t / max(|v_t|, FULL_SLIDING)      |f_t| ≤ µ f_n,   f_t · v_t ≤ 0
//! ```

use nalgebra::{Isometry3, Point3, Unit, Vector3};

use units::spatial::{Twist, Wrench};

/// Stiffness, damping and friction of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Stiffness with all points of one face in contact, in N/m.
    pub stiffness: f64,
    /// Damping with all points of one face in contact at [`FULL_DAMPING`] depth, in N·s/m.
    pub damping: f64,
    /// Friction coefficient µ, 0 or above.
    pub friction: f64,
}

/// Minimum depth of full damping, in m.
pub const FULL_DAMPING: f64 = 1e-3;

/// Minimum sliding speed of full friction, in m/s. With a lower value friction would chatter in a 1 kHz loop with force
/// accommodation.
pub const FULL_SLIDING: f64 = 0.01;

/// Half space behind a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Point of the plane in the object's base, in m.
    pub point: Vector3<f64>,
    /// Outward normal, in the object's base.
    pub normal: Unit<Vector3<f64>>,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Solid box along the axes of the object's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Centre in the object's base, in m.
    pub centre: Vector3<f64>,
    /// Half the edge lengths, in m.
    pub half_size: Vector3<f64>,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Solid sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre in the object's base, in m.
    pub centre: Vector3<f64>,
    /// Radius, in m.
    pub radius: f64,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Half the edge of the cube in {MRF} whose corners are the contact points, in m.
pub const HALF_CUBE: f64 = 0.02;

/// Share of a surface's stiffness per contact point: a face has four.
const SHARE: f64 = 0.25;

/// Solids in the environment of the object; the default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scene {
    /// Half space; `None` without a wall.
    pub wall: Option<Wall>,
    /// Box along the axes of the base; `None` without a box.
    pub block: Option<Block>,
    /// Sphere; `None` without a sphere.
    pub sphere: Option<Sphere>,
}

/// Depth of a point inside a solid, in m, and the outward normal there.
type Inside = (f64, Unit<Vector3<f64>>);

impl Scene {
    /// Computes the wrench on the object, at {MRF} in {MRF}, for pose `x_b_m` and twist `v_m`.
    pub fn wrench(&self, x_b_m: &Isometry3<f64>, v_m: &Twist) -> Wrench {
        let mut f_m = Wrench::ZERO;
        for p_m in corners() {
            let p_b = (x_b_m * Point3::from(p_m)).coords;
            let v_b = x_b_m.rotation * (v_m.linear + v_m.angular.cross(&p_m));
            for ((depth, normal), surface) in self.touches(&p_b).into_iter().flatten() {
                let force_b = surface.force(depth, &normal, &v_b);
                let force = x_b_m.rotation.inverse() * force_b;
                f_m = f_m + Wrench { force, moment: p_m.cross(&force) };
            }
        }
        f_m
    }

    /// Returns the contacts of a point with each solid.
    fn touches(&self, p_b: &Vector3<f64>) -> [Option<(Inside, Surface)>; 3] {
        [
            self.wall.and_then(|wall| Some((wall.depth(p_b)?, wall.surface))),
            self.block.and_then(|block| Some((block.depth(p_b)?, block.surface))),
            self.sphere.and_then(|sphere| Some((sphere.depth(p_b)?, sphere.surface))),
        ]
    }
}

impl Surface {
    /// Computes the force on one point, `depth` m inside, with velocity `v` in m/s.
    fn force(&self, depth: f64, normal: &Unit<Vector3<f64>>, v: &Vector3<f64>) -> Vector3<f64> {
        let leaving = v.dot(normal);
        let push = self.push(depth, leaving);
        let sliding = v - normal.into_inner() * leaving;
        let held_back = self.friction * push / sliding.norm().max(FULL_SLIDING);
        normal.into_inner() * push - sliding * held_back
    }

    /// Computes the normal force on one point, `depth` m inside and leaving with `speed` m/s; not negative.
    fn push(&self, depth: f64, speed: f64) -> f64 {
        let damping = self.damping * (depth / FULL_DAMPING).min(1.0);
        (SHARE * (self.stiffness * depth - damping * speed)).max(0.0)
    }
}

impl Wall {
    fn depth(&self, p_b: &Vector3<f64>) -> Option<Inside> {
        let depth = (self.point - p_b).dot(&self.normal);
        (depth > 0.0).then_some((depth, self.normal))
    }
}

impl Block {
    /// Returns the depth to the nearest face, and its normal.
    fn depth(&self, p_b: &Vector3<f64>) -> Option<Inside> {
        let inside = p_b - self.centre;
        let depths = self.half_size - inside.abs();
        let side = |along: f64| 1.0_f64.copysign(along);
        let faces = [
            (depths.x, Vector3::x() * side(inside.x)),
            (depths.y, Vector3::y() * side(inside.y)),
            (depths.z, Vector3::z() * side(inside.z)),
        ];
        let nearest = faces.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (depth, normal) = nearest.filter(|(depth, _)| *depth > 0.0)?;
        Some((depth, Unit::new_unchecked(normal)))
    }
}

impl Sphere {
    /// Returns the depth and the outward normal; the z axis at the centre, where the normal is undefined.
    fn depth(&self, p_b: &Vector3<f64>) -> Option<Inside> {
        let from_centre = p_b - self.centre;
        let depth = self.radius - from_centre.norm();
        let normal = Unit::try_new(from_centre, f64::MIN_POSITIVE).unwrap_or(Vector3::z_axis());
        (depth > 0.0).then_some((depth, normal))
    }
}

/// Returns the contact points, in {MRF}.
fn corners() -> impl Iterator<Item = Vector3<f64>> {
    let side = |corner: u8, bit: u8| if corner >> bit & 1 == 0 { -HALF_CUBE } else { HALF_CUBE };
    (0..8).map(move |corner| Vector3::new(side(corner, 0), side(corner, 1), side(corner, 2)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::UnitQuaternion;
    use proptest::prelude::*;

    use super::*;
    use units::math;

    const SURFACE: Surface = Surface { stiffness: 2_000.0, damping: 20.0, friction: 0.0 };

    fn scene() -> Scene {
        let point = Vector3::new(0.55, 0.0, 0.0);
        let wall = Wall { point, normal: -Vector3::x_axis(), surface: SURFACE };
        let (centre, half_size) = (Vector3::new(0.4, 0.25, 0.3), Vector3::new(0.1, 0.05, 0.1));
        let block = Block { centre, half_size, surface: SURFACE };
        Scene { wall: Some(wall), block: Some(block), sphere: None }
    }

    fn rough(friction: f64) -> Surface {
        Surface { friction, ..SURFACE }
    }

    /// Returns a scene with all solids of one surface.
    fn all_of(surface: Surface) -> Scene {
        let Scene { wall, block, .. } = scene();
        let centre = Vector3::new(0.4, -0.2, 0.3);
        Scene {
            wall: wall.map(|wall| Wall { surface, ..wall }),
            block: block.map(|block| Block { surface, ..block }),
            sphere: Some(Sphere { centre, radius: 0.08, surface }),
        }
    }

    fn at(x: f64) -> Isometry3<f64> {
        Isometry3::translation(x, 0.0, 0.3)
    }

    #[test]
    fn no_contact_gives_zero_wrench() {
        assert_eq!(scene().wrench(&at(0.4), &Twist::ZERO), Wrench::ZERO);
    }

    #[test]
    fn flat_contact_has_full_stiffness_and_no_moment() {
        let depth = 0.005;
        let f_m = scene().wrench(&at(0.55 - HALF_CUBE + depth), &Twist::ZERO);
        assert!((f_m.force - Vector3::new(-SURFACE.stiffness * depth, 0.0, 0.0)).norm() < 1e-9);
        assert!(f_m.moment.norm() < 1e-9);
    }

    #[test]
    fn contact_of_one_corner_gives_a_moment() {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.2);
        let x_b_m = Isometry3::from_parts(at(0.53).translation, tilt);
        let f_m = scene().wrench(&x_b_m, &Twist::ZERO);
        assert!(f_m.force.x < 0.0 && f_m.moment.z < -1e-3, "{f_m:?}");
    }

    #[test]
    fn box_pushes_out_at_its_nearest_side() {
        let x_b_m = Isometry3::translation(0.4, 0.25 - 0.05 - HALF_CUBE + 0.004, 0.3);
        let f_m = scene().wrench(&x_b_m, &Twist::ZERO);
        assert!((f_m.force - Vector3::new(0.0, -8.0, 0.0)).norm() < 1e-9, "{f_m:?}");
    }

    #[test]
    fn force_is_continuous_at_contact() {
        let v_m = Twist { linear: Vector3::new(0.3, 0.0, 0.0), angular: Vector3::zeros() };
        let f_m = scene().wrench(&at(0.55 - HALF_CUBE + 1e-9), &v_m);
        assert!(f_m.force.norm() < 1e-4, "{f_m:?}");
    }

    #[test]
    fn sliding_friction_is_mu_times_the_normal_force() {
        let (depth, friction) = (0.005, 0.3);
        let v_m = Twist::from_components([0.0, 0.1, 0.0, 0.0, 0.0, 0.0]);
        let f_m = all_of(rough(friction)).wrench(&at(0.55 - HALF_CUBE + depth), &v_m);
        let push = SURFACE.stiffness * depth;
        let expected = Vector3::new(-push, -friction * push, 0.0);
        assert!((f_m.force - expected).norm() < 1e-9, "{f_m:?}");
    }

    #[test]
    fn sphere_pushes_out_from_its_centre() {
        let scene = Scene { sphere: all_of(SURFACE).sphere, ..Scene::default() };
        let centre = scene.sphere.unwrap().centre;
        // A cube on a diagonal touches with one corner.
        let out = Unit::new_normalize(Vector3::new(1.0, 1.0, 1.0));
        let (corner, depth) = (HALF_CUBE * 3.0_f64.sqrt(), 0.003);
        let place = centre + out.into_inner() * (0.08 + corner - depth);
        let x_b_m = Isometry3::from_parts(place.into(), UnitQuaternion::identity());
        let f_m = scene.wrench(&x_b_m, &Twist::ZERO);
        let push = SHARE * SURFACE.stiffness * depth;
        assert!((f_m.force - out.into_inner() * push).norm() < 1e-9, "{f_m:?}");
        assert!(f_m.moment.norm() < 1e-9, "it goes through the middle: {f_m:?}");
    }

    /// Returns the work of the scene on an object along the closed `path` (parameter 0 to 1), in J, and its positive
    /// part.
    fn work(scene: &Scene, path: impl Fn(f64) -> Isometry3<f64>) -> (f64, f64) {
        const STEPS: u16 = 1_000;
        const SECONDS: f64 = 2.0;
        let dt = SECONDS / f64::from(STEPS);
        let at = |step: f64| path(step / f64::from(STEPS));
        (0..STEPS).map(f64::from).fold((0.0, 0.0), |(total, given), step| {
            let v_m = Twist::reaching(&(at(step).inverse() * at(step + 1.0)), dt);
            let work = scene.wrench(&at(step + 0.5), &v_m).power(&v_m) * dt;
            (total + work, given + work.max(0.0))
        })
    }

    /// Returns a closed path with rotation, near all solids.
    fn round(middle: [f64; 3], reach: [f64; 6], share: f64) -> Isometry3<f64> {
        let wave = |times: f64, reach: f64| reach * math::sin(TAU * times * share);
        let [x, y, z, a, b, c] = reach;
        let [mx, my, mz] = middle;
        let place = [mx + wave(1.0, x), my + wave(2.0, y), mz + wave(3.0, z)];
        Isometry3::new(place.into(), [wave(2.0, a), wave(1.0, b), wave(3.0, c)].into())
    }

    fn middle() -> impl Strategy<Value = [f64; 3]> {
        let (wall, block, sphere) = ([0.53, 0.0, 0.3], [0.4, 0.19, 0.3], [0.4, -0.12, 0.32]);
        prop_oneof![Just(wall), Just(block), Just(sphere)]
    }

    fn reach() -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(0.005..0.03_f64)
            .prop_map(|[x, y, z, a, b, c]| [x, y, z, 10.0 * a, 10.0 * b, 10.0 * c])
    }

    fn velocity() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-0.2..0.2_f64).prop_map(Vector3::from)
    }

    fn direction() -> impl Strategy<Value = Unit<Vector3<f64>>> {
        velocity().prop_filter_map("short", |v| Unit::try_new(v, 1e-3))
    }

    proptest! {
        #[test]
        fn wall_never_pulls(x in 0.5..0.6_f64, v in -1.0..1.0_f64, turn in -1.0..1.0_f64) {
            let v_m = Twist::from_components([v, 0.0, 0.0, 0.0, turn, 0.0]);
            prop_assert!(scene().wrench(&at(x), &v_m).force.x <= 0.0);
        }

        #[test]
        fn friction_opposes_sliding_up_to_mu_times_the_normal(
            friction in 0.0..1.5_f64, depth in 0.0..0.02_f64, normal in direction(), v in velocity()
        ) {
            let force = rough(friction).force(depth, &normal, &v);
            let push = force.dot(&normal);
            let held_back = force - normal.into_inner() * push;
            let sliding = v - normal.into_inner() * v.dot(&normal);
            prop_assert!(push >= -1e-12);
            prop_assert!(held_back.norm() <= friction * push + 1e-9);
            prop_assert!(held_back.dot(&sliding) <= 1e-12);
            prop_assert!(held_back.cross(&sliding).norm() < 1e-9);
            let is_sliding = sliding.norm() >= FULL_SLIDING;
            prop_assert!(!is_sliding || (held_back.norm() - friction * push).abs() < 1e-9);
        }

        #[test]
        fn force_is_continuous_when_sliding_reverses(
            friction in 0.0..1.5_f64, depth in 0.0..0.02_f64, normal in direction(), v in velocity()
        ) {
            let force = |v: Vector3<f64>| rough(friction).force(depth, &normal, &v);
            let little = v * 1e-9;
            prop_assert!((force(little) - force(-little)).norm() < 1e-5);
        }

        #[test]
        fn force_is_continuous_at_contact_with_the_sphere(
            friction in 0.0..1.5_f64, out in direction(), v in velocity()
        ) {
            let scene = Scene { sphere: all_of(rough(friction)).sphere, ..Scene::default() };
            let sphere = scene.sphere.unwrap();
            let just_inside = sphere.centre + out.into_inner() * (sphere.radius - 1e-9);
            let (depth, normal) = sphere.depth(&just_inside).unwrap();
            prop_assert!((normal.into_inner() - out.into_inner()).norm() < 1e-6);
            prop_assert!(sphere.surface.force(depth, &normal, &v).norm() < 1e-4);
            let just_outside = sphere.centre + out.into_inner() * (sphere.radius + 1e-9);
            prop_assert!(sphere.depth(&just_outside).is_none());
        }

        #[test]
        fn wrench_does_not_depend_on_the_base(
            friction in 0.0..1.0_f64, v in prop::array::uniform6(-0.3..0.3_f64),
            moved in prop::array::uniform6(-1.0..1.0_f64), middle in middle(), reach in reach()
        ) {
            let [x, y, z, a, b, c] = moved;
            let x_c_b = Isometry3::new([x, y, z].into(), [a, b, c].into());
            let here = Scene { block: None, ..all_of(rough(friction)) };
            let there = Scene {
                wall: here.wall.map(|wall| Wall {
                    point: x_c_b.transform_point(&wall.point.into()).coords,
                    normal: x_c_b.rotation * wall.normal,
                    ..wall
                }),
                sphere: here.sphere.map(|sphere| Sphere {
                    centre: x_c_b.transform_point(&sphere.centre.into()).coords,
                    ..sphere
                }),
                block: None,
            };
            let x_b_m = round(middle, reach, 0.1);
            let v_m = Twist::from_components(v);
            let difference = there.wrench(&(x_c_b * x_b_m), &v_m) - here.wrench(&x_b_m, &v_m);
            prop_assert!(difference.components().iter().all(|part| part.abs() < 1e-6));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn closed_paths_never_gain_energy(
            friction in 0.0..1.0_f64, damping in 0.0..40.0_f64, middle in middle(), reach in reach()
        ) {
            let scene = all_of(Surface { stiffness: 2_000.0, damping, friction });
            let (total, given) = work(&scene, |share| round(middle, reach, share));
            prop_assert!(total <= 5e-3 * given + 1e-9, "{total} J, of {given} J");
        }

        #[test]
        fn undamped_contact_conserves_energy(middle in middle(), reach in reach()) {
            let scene = all_of(Surface { stiffness: 2_000.0, damping: 0.0, friction: 0.0 });
            let (total, given) = work(&scene, |share| round(middle, reach, share));
            prop_assert!(total.abs() <= 5e-3 * given + 1e-9, "{total} J, of {given} J");
        }
    }
}
