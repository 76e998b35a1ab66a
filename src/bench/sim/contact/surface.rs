//! Force of a surface on one point inside it: a spring, a damper that grows with depth, and dry friction.
//!
//! The normal force is never negative and continuous at contact (Hunt and Crossley 1975). Friction is a tangential
//! spring, the bristle, whose force is at most µ times the normal force (Cundall and Strack 1979), so a point at rest
//! does not creep. The anchor of the bristle follows the point when the limit is reached, and when the surface turns:
//!
//! ```text
//!  f_n = max(0, k d - c min(d/d_c, 1) v_n)      f_t = -k_t ξ - β c v_t,   |k_t ξ| ≤ µ f_n,  |f_t| ≤ µ f_n,  0 ≤ β ≤ 1
//! ```
//!
//! Each change of ξ but the point's own motion shortens it, so friction gives back no more than it has taken.

use nalgebra::Vector3;

/// Tangential stiffness per normal stiffness; 0.7 to 1 for elastic bodies (Mindlin 1949).
const TANGENTIAL: f64 = 0.8;

/// Stiffness, damping and friction of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Stiffness with all points of a face of the tool in contact, in N/m: the end of a cube, or of one peg.
    pub stiffness: f64,
    /// Damping with all these points at `damping_depth` or below, in N·s/m.
    pub damping: f64,
    /// Depth at which damping reaches its full value, in m.
    pub damping_depth: f64,
    /// Friction coefficient µ, 0 or above.
    pub friction: f64,
}

/// Contact of a point inside a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Touch {
    /// Depth, in m.
    pub(super) depth: f64,
    /// Outward unit normal of the nearest surface.
    pub(super) normal: Vector3<f64>,
    /// Part of the solid that is nearest.
    pub(super) feature: Feature,
}

/// Part of a solid.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Feature {
    /// Wall, box or sphere; sides and lower face of a plate.
    Solid,
    /// Face of the plate on the side of the tool.
    Face,
    /// Chamfer of a hole.
    Cone,
    /// Bore of a hole.
    Bore,
    /// End of a peg, on the edge of a hole.
    PegEnd,
    /// Chamfer of a peg, on the edge of a hole.
    PegChamfer,
    /// Side of a peg, on the edge of a hole.
    PegSide,
}

/// Law of one point: a share of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointLaw {
    stiffness: f64,
    damping: f64,
    damping_depth: f64,
    friction: f64,
}

impl PointLaw {
    /// Creates the law of one of `points` points that share the `surface`.
    pub(super) fn new(surface: &Surface, points: f64) -> Self {
        Self {
            stiffness: surface.stiffness / points,
            damping: surface.damping / points,
            damping_depth: surface.damping_depth,
            friction: surface.friction,
        }
    }

    /// Returns the damping at a depth, in N·s/m.
    fn damping_at(&self, depth: f64) -> f64 {
        self.damping * (depth / self.damping_depth).min(1.0)
    }
}

/// Tangential spring of one point; its anchor is where it is not stretched.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bristle {
    anchor: Option<Vector3<f64>>,
}

impl Bristle {
    /// Returns the force and its normal part on the point at `p` with velocity `v`, in the frame in which the surface rests.
    pub(super) fn force(
        &mut self,
        law: &PointLaw,
        touch: &Touch,
        p: &Vector3<f64>,
        v: &Vector3<f64>,
    ) -> (Vector3<f64>, f64) {
        let normal = touch.normal;
        let leaving = v.dot(&normal);
        let damping = law.damping_at(touch.depth);
        let push = (law.stiffness * touch.depth - damping * leaving).max(0.0);
        let limit = law.friction * push;
        let stiffness = TANGENTIAL * law.stiffness;

        let stretch = p - self.anchor.unwrap_or(*p);
        let stretch = stretch - normal * stretch.dot(&normal);
        let pull = stiffness * stretch.norm();
        let stretch = if pull > limit { stretch * (limit / pull) } else { stretch };
        self.anchor = Some(p - stretch);

        let held = stretch * -stiffness;
        let damped = (v - normal * leaving) * -damping;
        (normal * push + held + damped * share_within(limit, &held, &damped), push)
    }
}

/// Returns the largest share of `added` in 0..=1 with which its sum with `held` is not longer than `limit`.
fn share_within(limit: f64, held: &Vector3<f64>, added: &Vector3<f64>) -> f64 {
    if (held + added).norm_squared() <= limit * limit {
        return 1.0;
    }
    let square = added.norm_squared();
    if square <= 0.0 {
        return 0.0;
    }
    let along = -held.dot(added);
    let room = (limit * limit - held.norm_squared()).max(0.0);
    ((along + (along * along + square * room).sqrt()) / square).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SURFACE: Surface =
        Surface { stiffness: 1e4, damping: 50.0, damping_depth: 1e-3, friction: 0.3 };

    fn touch(depth: f64) -> Touch {
        Touch { depth, normal: Vector3::z(), feature: Feature::Solid }
    }

    fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-size..size).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn force_is_within_the_friction_cone_and_never_pulls(
            path in prop::collection::vec((vector(1e-3), vector(0.5), 0.0..2e-3_f64), 1..20)
        ) {
            let law = PointLaw::new(&SURFACE, 4.0);
            let mut bristle = Bristle::default();
            for (p, v, depth) in path {
                let (f, _) = bristle.force(&law, &touch(depth), &p, &v);
                prop_assert!(f.z >= 0.0, "{f}");
                prop_assert!(f.xy().norm() <= 0.3 * f.z * (1.0 + 1e-9) + 1e-12, "{f}");
            }
        }
    }

    #[test]
    fn point_below_its_friction_limit_does_not_creep() {
        let law = PointLaw::new(&Surface { damping: 0.0, ..SURFACE }, 1.0);
        let mut bristle = Bristle::default();
        let at = |x: f64| Vector3::new(x, 0.0, 0.0);
        bristle.force(&law, &touch(1e-3), &at(0.0), &Vector3::zeros());
        for _ in 0..1_000 {
            let (f, _) = bristle.force(&law, &touch(1e-3), &at(2e-4), &Vector3::zeros());
            assert!((f.x + TANGENTIAL * 1e4 * 2e-4).abs() < 1e-9, "{f}");
        }
        // 3 N of friction are 0.375 mm of stretch; beyond, the anchor follows.
        let (f, _) = bristle.force(&law, &touch(1e-3), &at(5e-3), &Vector3::zeros());
        assert!((f.x + 3.0).abs() < 1e-9, "{f}");
        let (back, _) = bristle.force(&law, &touch(1e-3), &at(5e-3 - 3.75e-4), &Vector3::zeros());
        assert!(back.x.abs() < 1e-9, "{back}");
    }

    #[test]
    fn sliding_friction_is_mu_times_the_normal_force() {
        let law = PointLaw::new(&SURFACE, 1.0);
        let mut bristle = Bristle::default();
        let v = Vector3::new(0.1, 0.0, 0.0);
        for step in 0..100 {
            let (f, _) = bristle.force(&law, &touch(1e-3), &(v * 1e-3 * f64::from(step)), &v);
            assert!(step < 10 || (f.x + 0.3 * f.z).abs() < 1e-9, "{f}");
        }
    }
}
