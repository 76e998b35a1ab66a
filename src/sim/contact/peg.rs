//! One or two parallel pegs: cylinders with a sharp or chamfered end.
//!
//! Their frame {E} has its origin in the plane of the ends, midway between the pegs, z out of the pegs, and the pegs on
//! x. A peg is convex: the distance to its surface is the smallest of those to its planes.

use nalgebra::{Isometry3, Vector3};

use crate::contact::plate::places;
use crate::contact::solid::{Bounds, Solid};
use crate::contact::surface::{Feature, Touch};

/// Equal pegs with parallel axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pegs {
    /// Pose of the pegs' base in {M}: origin midway between them, z along the pegs to their ends, the pegs on x.
    pub x_m_t: Isometry3<f64>,
    /// Number of pegs, 1 or 2.
    pub count: u8,
    /// Radius, in m.
    pub radius: f64,
    /// Length from base to end, in m.
    pub length: f64,
    /// Distance between the axes of two pegs, in m.
    pub spacing: f64,
    /// Radial width of the chamfer of the ends, in m; zero for a sharp edge.
    pub chamfer_width: f64,
    /// Length of the chamfer, in m; zero for a sharp edge.
    pub chamfer_length: f64,
}

impl Pegs {
    /// Returns the pose of {E} in {M}.
    pub fn x_m_e(&self) -> Isometry3<f64> {
        self.x_m_t * Isometry3::translation(0.0, 0.0, self.length)
    }

    /// Returns the x of each axis in {E}.
    pub(super) fn axes(&self) -> impl Iterator<Item = f64> + use<> {
        places(self.count, self.spacing)
    }

    /// Returns whether the ends are chamfered.
    fn is_chamfered(&self) -> bool {
        self.chamfer_width > 0.0 && self.chamfer_length > 0.0
    }

    /// Returns radius and z in {E} of the circles at the end of a peg: of the end, and where a chamfer begins.
    pub(super) fn rims(&self) -> impl Iterator<Item = (f64, f64)> + use<> {
        let chamfer = self.is_chamfered().then_some((self.radius, -self.chamfer_length));
        let end = if self.is_chamfered() { self.radius - self.chamfer_width } else { self.radius };
        std::iter::once((end, 0.0)).chain(chamfer)
    }

    /// Returns the peg whose axis is at `axis` in {E}.
    pub(super) fn peg(&self, axis: f64) -> Peg {
        let is_chamfered = self.is_chamfered();
        let width = if is_chamfered { self.chamfer_width } else { 0.0 };
        let length = if is_chamfered { self.chamfer_length } else { 0.0 };
        Peg { axis, radius: self.radius, base: -self.length, width, length }
    }
}

/// One peg, in {E}.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peg {
    axis: f64,
    radius: f64,
    /// z of its base.
    base: f64,
    /// Width and length of the chamfer.
    width: f64,
    length: f64,
}

impl Solid for Peg {
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch> {
        let (x, y) = (p.x - self.axis, p.y);
        let end = -p.z;
        let square = x * x + y * y;
        if end <= 0.0 || p.z < self.base || square >= self.radius * self.radius {
            return None;
        }
        let rho = square.sqrt();
        let side = self.radius - rho;
        let outward = if rho > 0.0 { Vector3::new(x / rho, y / rho, 0.0) } else { Vector3::x() };
        let (mut depth, mut normal, mut feature) = (side, outward, Feature::PegSide);
        let slope = self.width.hypot(self.length);
        if slope > 0.0 {
            let chamfer = (self.length * side - self.width * (p.z + self.length)) / slope;
            if chamfer < depth {
                normal = outward * (self.length / slope) + Vector3::z() * (self.width / slope);
                (depth, feature) = (chamfer, Feature::PegChamfer);
            }
        }
        if end < depth {
            (depth, normal, feature) = (end, Vector3::z(), Feature::PegEnd);
        }
        (depth > 0.0).then_some(Touch { depth, normal, feature })
    }

    /// The points are a circle: its projection along the peg is an ellipse, whose half axes are between `inner` and the
    /// radius.
    fn is_clear_of(&self, bounds: &Bounds) -> bool {
        let Bounds { centre, radius, axis } = *bounds;
        let height = bounds.reach(|axis| axis.z);
        let offset = (centre.x - self.axis).hypot(centre.y);
        let inner = axis.map_or(0.0, |axis| radius * axis.z.abs());
        let is_before_end = centre.z - height >= 0.0;
        let is_behind_base = centre.z + height <= self.base;
        let is_outside = offset >= radius + self.radius;
        let is_around = inner - offset >= self.radius;
        is_before_end || is_behind_base || is_outside || is_around
    }
}
