//! What the commanded object can touch: a wall and a box, as springs and dampers in six degrees of
//! freedom.
//!
//! The object touches with points fixed in it. Each point that is inside a surface is pushed out along
//! the surface's normal by its share of the stiffness and, against its approach, of the damping; the
//! moment follows from where the points are. A surface never pulls. Damping grows with the depth, so
//! that nothing jumps at the touch (Hunt and Crossley 1975).

use nalgebra::Isometry3;
use nalgebra::Point3;
use nalgebra::Unit;
use nalgebra::Vector3;

use crate::spatial::Twist;
use crate::spatial::Wrench;

/// How a surface yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// With all points of one face in contact, in N/m.
    pub stiffness: f64,
    /// The same at [`FULL_DAMPING`] depth, in N·s/m.
    pub damping: f64,
}

/// At this depth the damping is all there, in m.
pub const FULL_DAMPING: f64 = 1e-3;

/// A plane that is solid behind its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Any point of it, in the object's base.
    pub point: Vector3<f64>,
    /// Out of the solid.
    pub normal: Unit<Vector3<f64>>,
    /// How it yields.
    pub surface: Surface,
}

/// A solid box along the axes of the object's base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Its centre.
    pub centre: Vector3<f64>,
    /// Half its sides.
    pub half_size: Vector3<f64>,
    /// How it yields.
    pub surface: Surface,
}

/// Half the side of the cube whose corners touch, in m.
const HALF_CUBE: f64 = 0.02;

/// Corners of one face: what shares a surface's stiffness when the object lies flat on it.
const SHARE: f64 = 0.25;

/// A wall, a box, either or neither.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scene {
    /// The wall.
    pub wall: Option<Wall>,
    /// The box.
    pub block: Option<Block>,
}

impl Scene {
    /// The wrench on the object, at {MRF} in {MRF}, when it is at `x_b_m` with twist `v_m`.
    pub fn wrench(&self, x_b_m: &Isometry3<f64>, v_m: &Twist) -> Wrench {
        let mut f_m = Wrench::ZERO;
        for p_m in corners() {
            let p_b = (x_b_m * Point3::from(p_m)).coords;
            let v_b = x_b_m.rotation * (v_m.linear + v_m.angular.cross(&p_m));
            let touches = [
                self.wall.and_then(|wall| Some((wall.depth(&p_b)?, wall.surface))),
                self.block.and_then(|block| Some((block.depth(&p_b)?, block.surface))),
            ];
            for ((depth, normal), surface) in touches.into_iter().flatten() {
                let force_b = normal.into_inner() * surface.push(depth, v_b.dot(&normal));
                let force = x_b_m.rotation.inverse() * force_b;
                f_m = f_m + Wrench { force, moment: p_m.cross(&force) };
            }
        }
        f_m
    }
}

impl Surface {
    /// The push on one point, `depth` m inside and leaving with `speed` m/s. Never a pull.
    fn push(&self, depth: f64, speed: f64) -> f64 {
        let damping = self.damping * (depth / FULL_DAMPING).min(1.0);
        (SHARE * (self.stiffness * depth - damping * speed)).max(0.0)
    }
}

impl Wall {
    /// How deep a point is inside, and the way out.
    fn depth(&self, p_b: &Vector3<f64>) -> Option<(f64, Unit<Vector3<f64>>)> {
        let depth = (self.point - p_b).dot(&self.normal);
        (depth > 0.0).then_some((depth, self.normal))
    }
}

impl Block {
    /// How deep a point is inside, and the shortest way out.
    fn depth(&self, p_b: &Vector3<f64>) -> Option<(f64, Unit<Vector3<f64>>)> {
        let inside = p_b - self.centre;
        let depths = self.half_size - inside.abs();
        let side = |along: f64| 1.0_f64.copysign(along);
        let ways_out = [
            (depths.x, Vector3::x() * side(inside.x)),
            (depths.y, Vector3::y() * side(inside.y)),
            (depths.z, Vector3::z() * side(inside.z)),
        ];
        let shortest = ways_out.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (depth, way_out) = shortest.filter(|(depth, _)| *depth > 0.0)?;
        Some((depth, Unit::new_unchecked(way_out)))
    }
}

/// Where the object touches, in {MRF}.
fn corners() -> impl Iterator<Item = Vector3<f64>> {
    let side = |corner: u8, bit: u8| if corner >> bit & 1 == 0 { -HALF_CUBE } else { HALF_CUBE };
    (0..8).map(move |corner| Vector3::new(side(corner, 0), side(corner, 1), side(corner, 2)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SURFACE: Surface = Surface { stiffness: 2_000.0, damping: 20.0 };

    fn scene() -> Scene {
        let point = Vector3::new(0.55, 0.0, 0.0);
        let wall = Wall { point, normal: -Vector3::x_axis(), surface: SURFACE };
        let (centre, half_size) = (Vector3::new(0.4, 0.25, 0.3), Vector3::new(0.1, 0.05, 0.1));
        Scene { wall: Some(wall), block: Some(Block { centre, half_size, surface: SURFACE }) }
    }

    fn at(x: f64) -> Isometry3<f64> {
        Isometry3::translation(x, 0.0, 0.3)
    }

    #[test]
    fn nothing_is_felt_in_the_open() {
        assert_eq!(scene().wrench(&at(0.4), &Twist::ZERO), Wrench::ZERO);
    }

    #[test]
    fn lying_flat_is_the_whole_stiffness_and_no_moment() {
        let depth = 0.005;
        let f_m = scene().wrench(&at(0.55 - HALF_CUBE + depth), &Twist::ZERO);
        assert!((f_m.force - Vector3::new(-SURFACE.stiffness * depth, 0.0, 0.0)).norm() < 1e-9);
        assert!(f_m.moment.norm() < 1e-9);
    }

    #[test]
    fn a_corner_pressed_alone_turns_the_object_away() {
        let tilt = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.2);
        let x_b_m = Isometry3::from_parts(at(0.53).translation, tilt);
        let f_m = scene().wrench(&x_b_m, &Twist::ZERO);
        assert!(f_m.force.x < 0.0 && f_m.moment.z < -1e-3, "{f_m:?}");
    }

    #[test]
    fn the_box_pushes_out_through_its_nearest_side() {
        let x_b_m = Isometry3::translation(0.4, 0.25 - 0.05 - HALF_CUBE + 0.004, 0.3);
        let f_m = scene().wrench(&x_b_m, &Twist::ZERO);
        assert!((f_m.force - Vector3::new(0.0, -8.0, 0.0)).norm() < 1e-9, "{f_m:?}");
    }

    #[test]
    fn nothing_jumps_at_the_touch() {
        let v_m = Twist { linear: Vector3::new(0.3, 0.0, 0.0), angular: Vector3::zeros() };
        let f_m = scene().wrench(&at(0.55 - HALF_CUBE + 1e-9), &v_m);
        assert!(f_m.force.norm() < 1e-4, "{f_m:?}");
    }

    proptest! {
        #[test]
        fn a_wall_never_pulls(x in 0.5..0.6_f64, v in -1.0..1.0_f64, turn in -1.0..1.0_f64) {
            let v_m = Twist::from_components([v, 0.0, 0.0, 0.0, turn, 0.0]);
            prop_assert!(scene().wrench(&at(x), &v_m).force.x <= 0.0);
        }
    }
}
