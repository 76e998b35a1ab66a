//! One or two parallel pegs: cylinders with a sharp or chamfered end.
//!
//! Their frame {E} has its origin in the plane of the ends, midway between the pegs, z out of the pegs, and the pegs on
//! x. A peg is convex: the distance to its surface is the smallest of those to its planes.
//!
//! An edge inside a hole lies between cone and bore, or bore and lower face. Its normals do not point out of the hole, so
//! it cannot bear the end of a peg. The rim bears the peg while it passes the edge. The push of the edge on side or
//! chamfer grows from zero behind the end, as the gradient of an energy. Depths above L are those of a convex peg:
//!
//! ```text
//!  s = min(side, chamfer)        depth = min(s, end, s end / L)        L = r / 20
//! ```

use nalgebra::{Isometry3, Vector3};

use crate::contact::plate::places;
use crate::contact::solid::{Bounds, Solid};
use crate::contact::surface::{Feature, Touch};

/// Length behind the end, per radius, on which the push of an edge inside a hole grows.
const RAMP: f64 = 0.05;

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

    /// Returns the peg whose axis is at `axis` in {E}, as edges at the mouth of a hole touch it, or those inside.
    pub(super) fn peg(&self, axis: f64, is_mouth: bool) -> Peg {
        let is_chamfered = self.is_chamfered();
        let width = if is_chamfered { self.chamfer_width } else { 0.0 };
        let length = if is_chamfered { self.chamfer_length } else { 0.0 };
        let ramp = if is_mouth { 0.0 } else { RAMP * self.radius };
        Peg { axis, radius: self.radius, base: -self.length, width, length, ramp }
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
    /// Length behind the end on which the push grows; zero where the end bears.
    ramp: f64,
}

impl Peg {
    /// Returns `touch` of side or chamfer with its push grown from zero at the end.
    fn grown(&self, touch: &Touch, end: f64) -> Touch {
        let (share, axial) = (end / self.ramp, touch.depth / self.ramp);
        let gradient = touch.normal * share + Vector3::z() * axial;
        let steepness = gradient.norm();
        let depth = touch.depth * share * steepness;
        Touch { depth, normal: gradient / steepness, feature: touch.feature }
    }
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
        if end < depth.max(self.ramp) && depth > 0.0 {
            if depth < self.ramp {
                return Some(self.grown(&Touch { depth, normal, feature }, end));
            }
            (depth, normal, feature) = (end, Vector3::z(), Feature::PegEnd);
        }
        (depth > 0.0).then_some(Touch { depth, normal, feature })
    }

    /// Projects the points, a circle, along the peg: an ellipse with half axes between `inner` and the radius.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a peg of 5 mm radius with a chamfer of `width` and equal length.
    fn pegs(width: f64) -> Pegs {
        Pegs {
            x_m_t: Isometry3::identity(),
            count: 1,
            radius: 5e-3,
            length: 0.03,
            spacing: 0.0,
            chamfer_width: width,
            chamfer_length: width,
        }
    }

    /// Returns the push on a point `inside` the side of a peg and `behind` its end, per stiffness.
    fn push(peg: &Peg, inside: f64, behind: f64) -> Vector3<f64> {
        let touch = peg.touch(&Vector3::new(peg.radius - inside, 0.0, -behind));
        touch.map_or_else(Vector3::zeros, |touch| touch.normal * touch.depth)
    }

    #[test]
    fn edge_inside_a_hole_does_not_bear_the_end_of_a_peg() {
        let [mouth, inner] = [true, false].map(|is_mouth| pegs(0.0).peg(0.0, is_mouth));
        let inside = 1e-5;
        let steps = || (1..=1_000).map(|step| f64::from(step) * 1e-6);
        let up = |peg: &Peg| steps().map(|behind| push(peg, inside, behind).z).fold(0.0, f64::max);
        assert!((up(&mouth) - inside).abs() < 2e-6, "{} m", up(&mouth));
        assert!(up(&inner) < 0.05 * inside, "{} m", up(&inner));
        let side = push(&inner, inside, 1e-3);
        assert!((side - Vector3::x() * inside).norm() < 1e-12, "{side}");
    }

    #[test]
    fn push_is_the_gradient_of_an_energy() {
        for (width, is_mouth) in [(0.0, true), (0.0, false), (5e-4, true), (5e-4, false)] {
            let peg = pegs(width).peg(0.0, is_mouth);
            // Around a square, with and against the side; steps cross every change of feature.
            let corners =
                [[-1e-4, -1e-4], [6e-4, -1e-4], [6e-4, 9e-4], [-1e-4, 9e-4], [-1e-4, -1e-4]];
            let (mut total, mut given) = (0.0, 0.0);
            for pair in corners.windows(2) {
                let [[x, z], [x_end, z_end]] = [pair[0], pair[1]];
                let [dx, dz] = [(x_end - x) / 2e4, (z_end - z) / 2e4];
                for step in 0..20_000 {
                    let share = f64::from(step) + 0.5;
                    let push = push(&peg, x + share * dx, z + share * dz);
                    let work = -push.x * dx - push.z * dz;
                    (total, given) = (total + work, given + work.abs());
                }
            }
            assert!(given > 0.0 && total.abs() < 1e-3 * given, "{total} of {given}");
        }
    }
}
