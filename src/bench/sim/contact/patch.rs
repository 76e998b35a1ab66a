//! Contact points fixed in one body, against one solid of the other.

use nalgebra::{Isometry3, IsometryMatrix3, Point3, Vector3};

use crate::contact::features::Features;
use crate::contact::solid::{Bounds, Solid};
use crate::contact::surface::{Bristle, PointLaw, Surface};
use units::spatial::{Twist, Wrench};

/// Points on a circle: neighbours are 10° apart, so the direction of a contact is right within 5°.
pub(super) const POINTS_ON_A_CIRCLE: u16 = 36;

/// Points that bear the stiffness of a surface: the corners of a face of a cube.
const CORNERS_OF_A_FACE: f64 = 4.0;

/// Points fixed in a body.
#[derive(Clone, Debug)]
pub(super) struct Points {
    points: Vec<Vector3<f64>>,
    bounds: Bounds,
    /// Number of points that share the stiffness of a surface.
    sharing: f64,
}

impl Points {
    /// Creates the corners of a cube around the origin.
    pub(super) fn corners(half_edge: f64) -> Self {
        let side =
            |corner: u8, bit: u8| if corner >> bit & 1 == 0 { -half_edge } else { half_edge };
        let corner = |corner| Vector3::new(side(corner, 0), side(corner, 1), side(corner, 2));
        let radius = half_edge * 3.0_f64.sqrt();
        let bounds = Bounds { centre: Vector3::zeros(), radius, axis: None };
        Self { points: (0..8).map(corner).collect(), bounds, sharing: CORNERS_OF_A_FACE }
    }

    /// Creates a circle around z of the frame at `x`.
    pub(super) fn circle(x: &Isometry3<f64>, radius: f64) -> Self {
        let count = f64::from(POINTS_ON_A_CIRCLE);
        let point = |place| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(place) / count).sin_cos();
            (x * Point3::new(radius * cos, radius * sin, 0.0)).coords
        };
        let (centre, axis) = (x.translation.vector, Some(x.rotation * Vector3::z()));
        let bounds = Bounds { centre, radius, axis };
        Self { points: (0..POINTS_ON_A_CIRCLE).map(point).collect(), bounds, sharing: count }
    }

    /// Returns the number of points.
    pub(super) fn count(&self) -> usize {
        self.points.len()
    }
}

/// All points in contact of one evaluation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContactTally {
    pub(super) features: Features,
    /// Sum of their normal forces, in N.
    pub(super) pressure: f64,
}

/// Contact of some points with one solid.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    law: PointLaw,
    bristles: Vec<Bristle>,
    is_touching: bool,
}

impl Patch {
    /// Creates a patch without contact.
    pub(super) fn new(points: &Points, surface: &Surface) -> Self {
        let law = PointLaw::new(surface, points.sharing);
        Self { law, bristles: vec![Bristle::default(); points.count()], is_touching: false }
    }

    /// Returns the wrench of `solid` on `points`, at the solid's frame. Their body has the pose `x` in that frame, and
    /// its twist is `v`, at that frame and in it.
    pub(super) fn wrench(
        &mut self,
        points: &Points,
        x: &IsometryMatrix3<f64>,
        v: &Twist,
        solid: &impl Solid,
        seen: &mut ContactTally,
    ) -> Wrench {
        let bounds = Bounds {
            centre: (x * Point3::from(points.bounds.centre)).coords,
            radius: points.bounds.radius,
            axis: points.bounds.axis.map(|axis| x.rotation * axis),
        };
        if solid.is_clear_of(&bounds) {
            self.release();
            return Wrench::ZERO;
        }
        self.is_touching = true;
        let mut sum = Wrench::ZERO;
        for (bristle, p) in self.bristles.iter_mut().zip(&points.points) {
            let p = (x * Point3::from(*p)).coords;
            let Some(touch) = solid.touch(&p) else {
                *bristle = Bristle::default();
                continue;
            };
            seen.features.add(touch.feature);
            let velocity = v.linear + v.angular.cross(&p);
            let (force, push) = bristle.force(&self.law, &touch, &p, &velocity);
            seen.pressure += push;
            sum = sum + Wrench { force, moment: p.cross(&force) };
        }
        sum
    }

    /// Forgets all anchors.
    fn release(&mut self) {
        if self.is_touching {
            self.bristles.fill(Bristle::default());
            self.is_touching = false;
        }
    }
}
