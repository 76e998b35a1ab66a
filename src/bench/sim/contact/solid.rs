//! Wall, box and sphere: depth of a point, and the normal of the nearest surface.

use nalgebra::{Unit, Vector3};

use crate::contact::surface::{Feature, Surface, Touch};

/// Half-space behind a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Point of the plane, in {b}.
    pub point: Vector3<f64>,
    /// Outward normal, in {b}.
    pub normal: Unit<Vector3<f64>>,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Solid box along the axes of {b}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Centre, in {b}.
    pub centre: Vector3<f64>,
    /// Half the edge lengths, in m.
    pub half_size: Vector3<f64>,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Solid sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, in {b}.
    pub centre: Vector3<f64>,
    /// Radius, in m.
    pub radius: f64,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Bounds of a set of points: all are within `radius` of `centre`, and in one plane if there is an `axis` to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) centre: Vector3<f64>,
    pub(super) radius: f64,
    pub(super) axis: Option<Vector3<f64>>,
}

impl Bounds {
    /// Returns the maximum distance of points from the centre along an axis of the frame, whose component of `axis` is
    /// returned by `of`.
    pub(super) fn reach(&self, of: impl Fn(&Vector3<f64>) -> f64) -> f64 {
        let share = self.axis.map_or(1.0, |axis| (1.0 - of(&axis).powi(2)).max(0.0).sqrt());
        self.radius * share
    }
}

/// Body that contact points can penetrate, in the frame in which it rests.
pub(super) trait Solid {
    /// Returns the contact of a point that is inside.
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch>;

    /// Returns whether all points within `bounds` are certainly outside; false where this cheap test does not decide.
    fn is_clear_of(&self, bounds: &Bounds) -> bool;
}

impl Solid for Wall {
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch> {
        let depth = (self.point - p).dot(&self.normal);
        let normal = self.normal.into_inner();
        (depth > 0.0).then_some(Touch { depth, normal, feature: Feature::Solid })
    }

    fn is_clear_of(&self, bounds: &Bounds) -> bool {
        (bounds.centre - self.point).dot(&self.normal) >= bounds.radius
    }
}

impl Solid for Block {
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch> {
        let inside = p - self.centre;
        let depths = self.half_size - inside.abs();
        let side = |along: f64| 1.0_f64.copysign(along);
        let ways_out = [
            (depths.x, Vector3::x() * side(inside.x)),
            (depths.y, Vector3::y() * side(inside.y)),
            (depths.z, Vector3::z() * side(inside.z)),
        ];
        let shortest = ways_out.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
        let (depth, normal) = shortest.filter(|(depth, _)| *depth > 0.0)?;
        Some(Touch { depth, normal, feature: Feature::Solid })
    }

    fn is_clear_of(&self, bounds: &Bounds) -> bool {
        let outside = (bounds.centre - self.centre).abs() - self.half_size;
        outside.max() >= bounds.radius
    }
}

impl Solid for Sphere {
    /// Returns the contact of a point; the normal at the centre, where it is undefined, is up.
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch> {
        let from_centre = p - self.centre;
        let depth = self.radius - from_centre.norm();
        let normal = from_centre.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
        (depth > 0.0).then_some(Touch { depth, normal, feature: Feature::Solid })
    }

    fn is_clear_of(&self, bounds: &Bounds) -> bool {
        (bounds.centre - self.centre).norm() >= self.radius + bounds.radius
    }
}
