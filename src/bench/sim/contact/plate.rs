//! Plate with one or two round holes, chamfered or with sharp edges.
//!
//! The plate's frame {P} has its origin in the face, midway between the holes, z out of the material, and the holes on
//! x. Around each hole the cross-section of the material is convex, so the distance to its surface is the smallest of
//! those to its planes. The spring force of a point is the gradient of its energy:
//!
//! ```text
//!           r_h   w                            depth = min(-z, z + t, sides, cone, ρ - r_h)
//!            │  ◄──►┌──────── z = 0             cone = (c (ρ - r_h) - w (z + c)) / √(w² + c²)
//!   hole     │    ╱ │ c
//!            │  ╱ material
//!            ├─     │
//! ```

use nalgebra::{Isometry3, Vector3};

use crate::contact::solid::{Bounds, Solid};
use crate::contact::surface::{Feature, Surface, Touch};

/// Equal holes with parallel axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Holes {
    /// Number of holes, 1 or 2.
    pub count: u8,
    /// Radius of the bore, in m.
    pub radius: f64,
    /// Distance between the axes of two holes, in m.
    pub spacing: f64,
    /// Radial width of the chamfer, in m; zero for a sharp edge.
    pub chamfer_width: f64,
    /// Depth of the chamfer, in m; zero for a sharp edge.
    pub chamfer_depth: f64,
}

/// Plate with through holes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plate {
    /// Pose of {P} in {b}.
    pub x_b_p: Isometry3<f64>,
    /// Half the edge lengths of the face along x and y of {P}, in m.
    pub half_size: [f64; 2],
    /// Thickness, in m.
    pub thickness: f64,
    /// Number, radius, distance and chamfer of the holes.
    pub holes: Holes,
    /// Stiffness, damping and friction.
    pub surface: Surface,
}

/// Plate with the slope of its chamfers.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlateSolid {
    plate: Plate,
    /// Inward and upward part of the normal of a chamfer.
    slope: Option<[f64; 2]>,
}

/// Circle in a plane of equal z of {P}.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) centre: Vector3<f64>,
    pub(super) radius: f64,
    /// At the face of the plate, so that a peg's end can rest on it.
    pub(super) is_mouth: bool,
}

impl Holes {
    /// Returns the x of each axis in {P}.
    pub(super) fn axes(&self) -> impl Iterator<Item = f64> + use<> {
        places(self.count, self.spacing)
    }

    /// Returns the radius of a hole in the face.
    pub(super) fn mouth(&self) -> f64 {
        self.radius + self.chamfer_width
    }

    /// Returns the normal of a chamfer: its inward and upward parts.
    fn slope(&self) -> Option<[f64; 2]> {
        let (w, c) = (self.chamfer_width, self.chamfer_depth);
        (w > 0.0 && c > 0.0).then(|| [c / w.hypot(c), w / w.hypot(c)])
    }
}

impl Plate {
    /// Returns the edges of all holes: at the mouth, between chamfer and bore, and at the lower face.
    pub(super) fn edges(&self) -> impl Iterator<Item = Edge> + use<> {
        let Self { holes, thickness, .. } = *self;
        let is_chamfered = holes.chamfer_width > 0.0 && holes.chamfer_depth > 0.0;
        holes.axes().flat_map(move |axis| {
            let at = |radius, depth: f64, is_mouth| {
                let centre = Vector3::new(axis, 0.0, -depth);
                Edge { centre, radius, is_mouth }
            };
            let inner = is_chamfered.then(|| at(holes.radius, holes.chamfer_depth, false));
            let mouth = at(holes.mouth(), 0.0, true);
            inner.into_iter().chain([mouth, at(holes.radius, thickness, false)])
        })
    }
}

impl PlateSolid {
    /// Creates the solid of a plate.
    pub(super) fn new(plate: Plate) -> Self {
        Self { plate, slope: plate.holes.slope() }
    }

    /// Returns the pose of {P} in {b}.
    pub(super) const fn x_b_p(&self) -> &Isometry3<f64> {
        &self.plate.x_b_p
    }

    /// Returns the nearest of chamfer and bore of the hole at `axis`, with the direction to its axis not yet of length 1.
    fn hole(&self, axis: f64, p: &Vector3<f64>) -> (f64, Feature, [f64; 3]) {
        let Holes { radius, chamfer_depth, .. } = self.plate.holes;
        let (x, y) = (p.x - axis, p.y);
        let rho = (x * x + y * y).sqrt();
        let from_bore = rho - radius;
        if let Some([across, up]) = self.slope {
            let from_cone = across * from_bore - up * (p.z + chamfer_depth);
            if from_cone < from_bore {
                return (from_cone, Feature::Cone, [x, y, rho]);
            }
        }
        (from_bore, Feature::Bore, [x, y, rho])
    }

    /// Returns the normal of chamfer or bore.
    fn hole_normal(&self, feature: Feature, [x, y, rho]: [f64; 3]) -> Vector3<f64> {
        let inward = Vector3::new(x, y, 0.0) * (-1.0 / rho);
        match self.slope {
            Some([across, up]) if feature == Feature::Cone => inward * across + Vector3::z() * up,
            _ => inward,
        }
    }

    /// Returns the side or lower face that is nearer than `depth`.
    fn outside(&self, p: &Vector3<f64>, depth: f64) -> Option<(f64, Vector3<f64>)> {
        let Plate { half_size: [hx, hy], thickness, .. } = &self.plate;
        let below = p.z + thickness;
        let (x, y) = (hx - p.x.abs(), hy - p.y.abs());
        let nearest = below.min(x).min(y);
        if nearest >= depth {
            return None;
        }
        let normal = if below <= nearest {
            -Vector3::z()
        } else if x <= nearest {
            Vector3::x() * 1.0_f64.copysign(p.x)
        } else {
            Vector3::y() * 1.0_f64.copysign(p.y)
        };
        Some((nearest, normal))
    }
}

impl Solid for PlateSolid {
    fn touch(&self, p: &Vector3<f64>) -> Option<Touch> {
        let (mut depth, mut feature, mut around) = (-p.z, Feature::Face, [0.0; 3]);
        if depth <= 0.0 {
            return None;
        }
        for axis in self.plate.holes.axes() {
            let (from_hole, part, place) = self.hole(axis, p);
            if from_hole < depth {
                (depth, feature, around) = (from_hole, part, place);
            }
        }
        if let Some((nearest, normal)) = self.outside(p, depth) {
            let touch = Touch { depth: nearest, normal, feature: Feature::Solid };
            return (nearest > 0.0).then_some(touch);
        }
        let is_face = feature == Feature::Face;
        let normal = if is_face { Vector3::z() } else { self.hole_normal(feature, around) };
        (depth > 0.0).then_some(Touch { depth, normal, feature })
    }

    fn is_clear_of(&self, bounds: &Bounds) -> bool {
        let Plate { half_size: [hx, hy], thickness, holes, .. } = &self.plate;
        let Bounds { centre, radius, .. } = *bounds;
        let height = bounds.reach(|axis| axis.z);
        let is_beside = centre.x.abs() - hx >= radius || centre.y.abs() - hy >= radius;
        let is_above = centre.z >= height || centre.z + height <= -thickness;
        let is_in_hole = |axis: f64| (centre.x - axis).hypot(centre.y) + radius <= holes.radius;
        is_beside || is_above || holes.axes().any(is_in_hole)
    }
}

/// Returns the x of one place, or of two that are `spacing` apart.
pub(super) fn places(count: u8, spacing: f64) -> impl Iterator<Item = f64> + use<> {
    let first = if count > 1 { -spacing / 2.0 } else { 0.0 };
    (0..count.min(2)).map(move |place| first + f64::from(place) * spacing)
}
