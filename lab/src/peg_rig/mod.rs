//! Test rig: a passive peg in or above a hole, pushed by a given wrench or lowered by a compliant grip.
//!
//! The peg has no mass and moves quasi-statically (`body`), as in the analysis of Whitney (1982) and Simunovic (1975). The
//! tests compare the jamming diagram and the bound of wedging. All poses are in the frame {P} of the plate: origin at the
//! intersection of the hole's axis with the face, z out of the material. Pegs without tilt are parallel to z.

mod body;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::Serialize;

use crate::peg_rig::body::Body;
use sim::contact::{Contact, Features, Holes, InvalidContact, Pegs, Plate, Scene, Shape, Surface};
use units::spatial::{Twist, Wrench};

/// Maximum steps of one run.
const MAX_STEPS: u32 = 3_000_000;

/// Steps between two tests of progress.
const WINDOW: u32 = 2_000;

/// Progress, relative to that without friction, below which a peg is stuck.
const STANDSTILL: f64 = 2e-3;

/// Maximum steps in which a peg in a hole comes to rest.
const MAX_RESTING_STEPS: u32 = 40_000;

/// Motion of a peg at rest, relative to that without contact or at its release.
const AT_REST: f64 = 1e-6;

/// Force between the contacts of a wedged peg, relative to that under load.
const WEDGED: f64 = 0.05;

/// Gap between peg and plate at the start of a lowering, in m.
const GAP: f64 = 1e-4;

/// Half the edge length of the plate, in m: no peg is beside it.
const BOUNDLESS: f64 = f64::MAX;

/// Settings of one peg and one hole; lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PegRigSettings {
    /// Radius outside its chamfer.
    pub peg_radius: f64,
    /// Length from base to end.
    pub peg_length: f64,
    /// Radial width and length of the peg's chamfer; zeros for a sharp edge.
    pub peg_chamfer: [f64; 2],
    /// Radius of the bore.
    pub hole_radius: f64,
    /// Radial width and depth of the hole's chamfer; zeros for a sharp edge.
    pub hole_chamfer: [f64; 2],
    /// Thickness of the plate.
    pub thickness: f64,
    /// Friction coefficient µ.
    pub friction: f64,
    /// Stiffness with all points of the end on the face, in N/m.
    pub stiffness: f64,
}

/// Pose of the peg before it is lowered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approach {
    /// Position x, y of the centre of the peg's end, in m.
    pub offset: [f64; 2],
    /// Rotation vector about x and y, in rad.
    pub tilt: [f64; 2],
}

/// Compliant grip: springs at a centre of compliance on the axis of the peg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// Distance of the centre from the end of the peg, in m.
    pub centre: f64,
    /// Stiffness across the hole, in N/m.
    pub lateral: f64,
    /// Stiffness against rotation, in N·m/rad.
    pub angular: f64,
    /// Force into the hole, in N.
    pub force: f64,
}

/// End of a lowering.
#[derive(Clone, Copy, Debug, Eq, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// End of the peg in the bore, at the requested depth.
    Inserted,
    /// Peg that stopped with its end in the bore.
    Jammed,
    /// Peg that stopped on the face or in the chamfer, or was pressed into the face.
    Rejected,
}

/// Outcome of a lowering, with the final pose and contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoweringResult {
    /// Depth reached, or where the peg stopped.
    pub outcome: Outcome,
    /// Pose of the peg's end in {P}; its z axis points into the hole.
    pub x_p_e: Isometry3<f64>,
    /// Depth of the centre of the end below the face, in m.
    pub depth: f64,
    /// Points in contact.
    pub features: Features,
}

/// Contact of a peg at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PegContact {
    /// Wrench of the plate on the peg, at the centre of its end in the axes of the plate.
    pub f_e: Wrench,
    /// Points in contact.
    pub features: Features,
}

/// Wrench on a peg at the centre of its end, in the plane of x and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Force along x, in N.
    pub across: f64,
    /// Force into the hole, in N.
    pub into: f64,
    /// Moment that turns x towards z, in N·m.
    pub moment: f64,
}

/// Peg and plate.
#[derive(Clone, Debug)]
pub struct PegRig {
    settings: PegRigSettings,
    contact: Contact,
}

impl PegRig {
    /// Creates a rig.
    ///
    /// # Errors
    ///
    /// Returns an error if a size is not positive, or the hole is smaller than the peg.
    pub fn new(settings: PegRigSettings) -> Result<Self, InvalidContact> {
        let [peg_width, peg_chamfer_length] = settings.peg_chamfer;
        let [hole_width, hole_depth] = settings.hole_chamfer;
        let pegs = Pegs {
            x_m_t: Isometry3::translation(0.0, 0.0, -settings.peg_length),
            count: 1,
            radius: settings.peg_radius,
            length: settings.peg_length,
            spacing: 0.0,
            chamfer_width: peg_width,
            chamfer_length: peg_chamfer_length,
        };
        let holes = Holes {
            count: 1,
            radius: settings.hole_radius,
            spacing: 0.0,
            chamfer_width: hole_width,
            chamfer_depth: hole_depth,
        };
        let surface = Surface {
            stiffness: settings.stiffness,
            damping: 0.0,
            damping_depth: 1.0,
            friction: settings.friction,
        };
        let plate = Plate {
            x_b_p: Isometry3::identity(),
            half_size: [BOUNDLESS; 2],
            thickness: settings.thickness,
            holes,
            surface,
        };
        let scene = Scene { plate: Some(plate), ..Scene::default() };
        Ok(Self { settings, contact: Contact::new(Shape::Pegs(pegs), scene)? })
    }

    /// Returns the contact of a peg placed at `approach` with its end `depth` m below the face, without friction anchors.
    pub fn touched(&self, approach: &Approach, depth: f64) -> PegContact {
        let x_p_e = approach.at(-depth);
        let mut contact = self.contact.clone();
        let f_e = contact.wrench(&x_p_e, &Twist::ZERO).turned(&x_p_e.rotation);
        PegContact { f_e, features: *contact.features() }
    }

    /// Returns whether a peg at `depth` moves in under `push`. It starts in the middle of the hole without tilt, comes to
    /// rest at constant depth, and is then released.
    pub fn moves_in(&self, depth: f64, push: &Push) -> bool {
        let load = push.wrench();
        let mut body = self.settled(depth, &load);
        let (start, enough) = (body.depth(), self.visible_motion(depth));
        self.run(&mut body, |_| load, |body| body.depth() >= start + enough)
    }

    /// Returns whether a peg at `depth` stays wedged after the removal of the `moment`, in N·m, that tilted it. The two
    /// contacts of a wedged peg retain at least 5 % of their force.
    pub fn wedges(&self, depth: f64, moment: f64) -> bool {
        let mut body = self.settled(depth, &Push { across: 0.0, into: 0.0, moment }.wrench());
        let loaded = body.pressure();
        let first = body.yield_to(&Wrench::ZERO, false);
        for _ in 0..MAX_RESTING_STEPS {
            let motion = body.yield_to(&Wrench::ZERO, false);
            if body.pressure() < WEDGED * loaded {
                return false;
            }
            if motion < AT_REST * first {
                break;
            }
        }
        body.features().is_two_point()
    }

    /// Lowers a peg with `grip` until its end is at `depth`, or it stops.
    pub fn lower(&self, approach: &Approach, grip: &Grip, depth: f64) -> LoweringResult {
        let [a, b] = approach.tilt;
        let start = approach.at(self.settings.peg_radius * a.hypot(b).sin() + GAP);
        let mut body = self.body(start, depth);
        let load = |x_p_e: &Isometry3<f64>| grip.wrench(&start, x_p_e);
        let is_at_depth = self.run(&mut body, load, |body| body.depth() >= depth);
        let [_, chamfer] = self.settings.hole_chamfer;
        // A force may also press the end of a peg that deep into the face.
        let end = body.x_p_e().translation;
        let outcome = if is_at_depth && end.x.hypot(end.y) < self.settings.hole_radius {
            Outcome::Inserted
        } else if body.depth() > chamfer && body.features().bore > 0 {
            Outcome::Jammed
        } else {
            Outcome::Rejected
        };
        LoweringResult {
            outcome,
            x_p_e: *body.x_p_e(),
            depth: body.depth(),
            features: *body.features(),
        }
    }

    /// Returns a peg from the middle of the hole, at rest under `load` at constant depth.
    fn settled(&self, depth: f64, load: &Wrench) -> Body {
        let mut body = self
            .body(Isometry3::from_parts(Vector3::new(0.0, 0.0, -depth).into(), facing()), depth);
        for step in 0..MAX_STEPS {
            let motion = body.yield_to(load, true);
            let free = (load.force.norm() + load.moment.norm() / self.lever(depth)) * body.scale();
            if step > WINDOW && motion < AT_REST * free {
                break;
            }
        }
        body
    }

    /// Moves the peg until `is_done`, then returns true, or until standstill.
    fn run(
        &self,
        body: &mut Body,
        load: impl Fn(&Isometry3<f64>) -> Wrench,
        is_done: impl Fn(&Body) -> bool,
    ) -> bool {
        let mut before = body.x_p_e().translation.vector;
        let (mut free, mut turned) = (0.0, body.x_p_e().rotation);
        for step in 1..=MAX_STEPS {
            let load = load(body.x_p_e());
            body.yield_to(&load, false);
            free += load.force.z.abs() * body.scale();
            if is_done(body) {
                return true;
            }
            if step % WINDOW == 0 {
                let x = body.x_p_e();
                let moved = (x.translation.vector - before).norm()
                    + self.settings.peg_length * x.rotation.angle_to(&turned);
                if moved < STANDSTILL * free {
                    return false;
                }
                (before, free, turned) = (x.translation.vector, 0.0, x.rotation);
            }
        }
        false
    }

    fn body(&self, x_p_e: Isometry3<f64>, depth: f64) -> Body {
        Body::new(self.contact.clone(), x_p_e, self.contact.point_stiffness(), self.lever(depth))
    }

    /// Returns an upper bound, in m, of the motion of a peg stuck at `depth`. Until its second contact it tilts around the
    /// first, from one side of the hole to the other, and slides.
    fn visible_motion(&self, depth: f64) -> f64 {
        let PegRigSettings { peg_radius, hole_radius, .. } = self.settings;
        let lever = self.lever(depth);
        let tilting = 5.0 * peg_radius / depth;
        let sliding = 4.0 * lever * lever / (depth * peg_radius);
        (tilting + sliding + 0.5) * (hole_radius - peg_radius)
    }

    /// Returns the length that relates moments to forces, for depths up to `depth`.
    fn lever(&self, depth: f64) -> f64 {
        depth.max(self.settings.peg_radius)
    }
}

impl Push {
    /// Returns the wrench at the end of the peg, in the axes of the plate.
    fn wrench(&self) -> Wrench {
        Wrench {
            force: Vector3::new(self.across, 0.0, -self.into),
            moment: Vector3::new(0.0, -self.moment, 0.0),
        }
    }
}

impl Approach {
    /// Returns the pose of the end of the peg in {P}, its centre `height` m above the face.
    fn at(&self, height: f64) -> Isometry3<f64> {
        let ([x, y], [a, b]) = (self.offset, self.tilt);
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(a, b, 0.0)) * facing();
        Isometry3::from_parts(Vector3::new(x, y, height).into(), rotation)
    }
}

impl Grip {
    /// Returns the wrench of the grip on a peg at `x_p_e` that was at `start`, at its end in the axes of the plate.
    fn wrench(&self, start: &Isometry3<f64>, x_p_e: &Isometry3<f64>) -> Wrench {
        let centre = |x: &Isometry3<f64>| x.rotation * Vector3::new(0.0, 0.0, -self.centre);
        let arm = centre(x_p_e);
        let moved = (x_p_e.translation.vector + arm) - (start.translation.vector + centre(start));
        let force = Vector3::new(-self.lateral * moved.x, -self.lateral * moved.y, -self.force);
        let turned = (x_p_e.rotation * start.rotation.inverse()).scaled_axis();
        Wrench { force, moment: turned * -self.angular + arm.cross(&force) }
    }
}

/// Returns the orientation of a peg without tilt.
fn facing() -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI)
}

#[cfg(test)]
mod tests;
