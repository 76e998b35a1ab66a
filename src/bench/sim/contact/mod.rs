//! Contact of a tool with fixed solids, by analytic geometry and springs at points.
//!
//! The tool, fixed to {M}, is a cube or one or two pegs. The scene, fixed in {b}, has a wall, a box, a sphere, and a
//! plate with one or two holes. Points fixed in one body are pushed out of the other (`surface`): corners of the cube and
//! rims of the pegs out of all solids, edges of the holes out of the pegs. A tilted peg in a hole needs both: its rim
//! touches the bore on one side, and the edge of the hole its side on the other.
//!
//! Depth and normal are exact at each point. A circle has 36 points, so the deepest point is found within 5°, and its
//! depth within 0.4 % of the eccentricity. Two contacts are not modelled: edges of box, wall or sphere against the side of a
//! peg, and the base of a peg beyond its length.

mod features;
mod insertion;
mod patch;
mod peg;
mod plate;
mod scene;
mod solid;
mod surface;

pub use features::Features;
pub use insertion::{Insertion, Misalignment};
pub use peg::Pegs;
pub use plate::{Holes, Plate};
pub use scene::{HALF_CUBE, InvalidContact, Scene, Shape};
pub use solid::{Block, Sphere, Wall};
pub use surface::Surface;

use nalgebra::{Isometry3, IsometryMatrix3};

use crate::contact::patch::{ContactTally, Patch, Points};
use crate::contact::peg::Peg;
use crate::contact::plate::PlateSolid;
use crate::contact::solid::Solid;
use units::spatial::{Twist, Wrench};

/// Kinds of edges of a hole: true at the mouth, false inside.
const EDGES: [bool; 2] = [true, false];

/// Solid with a patch for each set of points of the tool.
#[derive(Clone, Debug)]
struct Opposite<S> {
    solid: S,
    patches: Vec<Patch>,
}

impl<S: Solid> Opposite<S> {
    fn new(solid: S, surface: &Surface, sets: &[Points]) -> Self {
        Self { solid, patches: sets.iter().map(|set| Patch::new(set, surface)).collect() }
    }

    /// Returns the wrench on all sets, at the solid's frame.
    fn wrench(
        &mut self,
        sets: &[Points],
        x: &IsometryMatrix3<f64>,
        v: &Twist,
        seen: &mut ContactTally,
    ) -> Wrench {
        let patches = self.patches.iter_mut().zip(sets);
        patches.fold(Wrench::ZERO, |sum, (patch, set)| {
            sum + patch.wrench(set, x, v, &self.solid, seen)
        })
    }
}

/// Contact of a tool with a scene; remembers where points stick.
#[derive(Clone, Debug)]
pub struct Contact {
    shape: Shape,
    scene: Scene,
    /// Points of the tool, in {M}.
    tool_points: Vec<Points>,
    /// Edges of the holes at their mouths, and inside, in {P}.
    edges: [Vec<Points>; 2],
    wall: Option<Opposite<Wall>>,
    block: Option<Opposite<Block>>,
    sphere: Option<Opposite<Sphere>>,
    plate: Option<Opposite<PlateSolid>>,
    /// Pegs, as touched by each kind of edge.
    pegs: [Vec<Opposite<Peg>>; 2],
    seen: ContactTally,
}

impl Contact {
    /// Creates a tool without contact.
    ///
    /// # Errors
    ///
    /// Returns an error if a size is not positive, a peg does not fit its hole, or holes overlap.
    pub fn new(shape: Shape, scene: Scene) -> Result<Self, InvalidContact> {
        scene::check(&shape, &scene)?;
        let tool_points = tool_points(&shape);
        let edges = EDGES.map(|is_mouth| {
            let edges = scene.plate.iter().flat_map(Plate::edges);
            let circle = |edge: plate::Edge| Points::circle(&edge.centre.into(), edge.radius);
            edges.filter(|edge| edge.is_mouth == is_mouth).map(circle).collect::<Vec<_>>()
        });
        let pegs = match (&shape, &scene.plate) {
            (Shape::Pegs(pegs), Some(plate)) => {
                let peg = |(is_mouth, edges): (bool, &Vec<Points>)| {
                    let solids = pegs.axes().map(|axis| pegs.peg(axis, is_mouth));
                    solids.map(|peg| Opposite::new(peg, &plate.surface, edges)).collect()
                };
                [(EDGES[0], &edges[0]), (EDGES[1], &edges[1])].map(peg)
            }
            (Shape::Pegs(_), None) | (Shape::Cube { .. }, _) => [Vec::new(), Vec::new()],
        };
        Ok(Self {
            wall: scene.wall.map(|wall| Opposite::new(wall, &wall.surface, &tool_points)),
            block: scene.block.map(|block| Opposite::new(block, &block.surface, &tool_points)),
            sphere: scene.sphere.map(|sphere| Opposite::new(sphere, &sphere.surface, &tool_points)),
            plate: scene
                .plate
                .map(|plate| Opposite::new(PlateSolid::new(plate), &plate.surface, &tool_points)),
            pegs,
            shape,
            scene,
            tool_points,
            edges,
            seen: ContactTally::default(),
        })
    }

    /// Returns the wrench of the scene on the tool, at {M} in {M}, for pose `x_b_m` and twist `v_m`, and moves the
    /// anchors of friction. Each call is one step along the path of the tool.
    pub fn wrench(&mut self, x_b_m: &Isometry3<f64>, v_m: &Twist) -> Wrench {
        let mut seen = ContactTally::default();
        let (sets, x) = (&self.tool_points, nalgebra::convert(*x_b_m));
        let v_b = v_m.at(x_b_m);
        let mut f_b = Wrench::ZERO;
        if let Some(wall) = &mut self.wall {
            f_b = f_b + wall.wrench(sets, &x, &v_b, &mut seen);
        }
        if let Some(block) = &mut self.block {
            f_b = f_b + block.wrench(sets, &x, &v_b, &mut seen);
        }
        if let Some(sphere) = &mut self.sphere {
            f_b = f_b + sphere.wrench(sets, &x, &v_b, &mut seen);
        }
        let mut f_m = f_b.at(&x_b_m.inverse());
        if let Some(plate) = &mut self.plate {
            let x_p_m = plate.solid.x_b_p().inverse() * x_b_m;
            let v_p = v_m.at(&x_p_m);
            let f_p = plate.wrench(sets, &nalgebra::convert(x_p_m), &v_p, &mut seen);
            f_m = f_m + f_p.at(&x_p_m.inverse());
            f_m = f_m + self.edges_on_pegs(&x_p_m, v_m, &mut seen);
        }
        self.seen = seen;
        f_m
    }

    /// Returns the wrench of the edges of the holes on the pegs, at {M} in {M}: the reaction of that on the edges.
    fn edges_on_pegs(
        &mut self,
        x_p_m: &Isometry3<f64>,
        v_m: &Twist,
        seen: &mut ContactTally,
    ) -> Wrench {
        let Shape::Pegs(pegs) = &self.shape else { return Wrench::ZERO };
        let x_m_e = pegs.x_m_e();
        let x_e_p = nalgebra::convert((x_p_m * x_m_e).inverse());
        // The plate moves past the pegs.
        let v_e = v_m.at(&x_m_e.inverse()) * -1.0;
        let mut f_e = Wrench::ZERO;
        for (pegs, edges) in self.pegs.iter_mut().zip(&self.edges) {
            for peg in pegs {
                f_e = f_e - peg.wrench(edges, &x_e_p, &v_e, seen);
            }
        }
        f_e.at(&x_m_e)
    }

    /// Returns the points in contact in the last call of [`wrench`](Self::wrench).
    pub const fn features(&self) -> &Features {
        &self.seen.features
    }

    /// Returns the sum of the normal forces of all points in the last call of [`wrench`](Self::wrench), in N.
    pub const fn pressure(&self) -> f64 {
        self.seen.pressure
    }

    /// Returns whether the tool at `x_b_m` touches or is inside a solid. Anchors do not move.
    pub fn is_touching_at(&self, x_b_m: &Isometry3<f64>) -> bool {
        let mut probe = self.clone();
        probe.wrench(x_b_m, &Twist::ZERO);
        probe.seen.features.is_any()
    }

    /// Returns the stiffness of one point on a circle against the plate, in N/m; zero without a plate.
    pub fn point_stiffness(&self) -> f64 {
        let stiffness = self.scene.plate.map_or(0.0, |plate| plate.surface.stiffness);
        stiffness / f64::from(patch::POINTS_ON_A_CIRCLE)
    }

    /// Returns the tool.
    pub const fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Returns the solids of the environment, in {b}.
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }
}

/// Returns the points of a tool, in {M}: corners, or the circles at the ends of the pegs.
fn tool_points(shape: &Shape) -> Vec<Points> {
    match shape {
        Shape::Cube { half_edge } => vec![Points::corners(*half_edge)],
        Shape::Pegs(pegs) => {
            let circles = pegs.axes().flat_map(|axis| pegs.rims().map(move |rim| (axis, rim)));
            let circle = |(axis, (radius, z))| {
                Points::circle(&(pegs.x_m_e() * Isometry3::translation(axis, 0.0, z)), radius)
            };
            circles.map(circle).collect()
        }
    }
}

#[cfg(test)]
mod tests;
