//! Tool and scene of a contact, and the checks of their dimensions.

use crate::contact::peg::Pegs;
use crate::contact::plate::Plate;
use crate::contact::solid::{Block, Sphere, Wall};
use crate::contact::surface::Surface;

/// Half the edge of the cube of the commanded object, in m.
pub const HALF_CUBE: f64 = 0.02;

/// Shape of the tool, fixed to {M}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Corners of a cube around the origin of {M}.
    Cube {
        /// Half the edge length, in m.
        half_edge: f64,
    },
    /// One or two pegs.
    Pegs(Pegs),
}

/// Solids of the environment, fixed in {b}; all optional.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scene {
    pub wall: Option<Wall>,
    /// Box along the axes of {b}.
    pub block: Option<Block>,
    pub sphere: Option<Sphere>,
    /// Plate with holes.
    pub plate: Option<Plate>,
}

/// Tool and scene that cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidContact {
    /// Length or stiffness that must be positive.
    #[error("{name} must be positive and finite, got {got}")]
    NotPositive {
        /// Name of the parameter.
        name: &'static str,
        /// Value, in the SI unit of the parameter.
        got: f64,
    },
    /// Parameter that must not be negative.
    #[error("{name} must be 0 or above and finite, got {got}")]
    Negative {
        /// Name of the parameter.
        name: &'static str,
        /// Value, in the SI unit of the parameter.
        got: f64,
    },
    /// Number of pegs or holes other than 1 or 2.
    #[error("{name} must be 1 or 2, got {got}")]
    Count {
        /// Name of the parameter.
        name: &'static str,
        /// Value.
        got: u8,
    },
    /// More pegs than holes.
    #[error("{pegs} pegs need as many holes, got {holes}")]
    TooFewHoles {
        /// Number of pegs.
        pegs: u8,
        /// Number of holes.
        holes: u8,
    },
    /// Hole that no peg enters.
    #[error(
        "the hole radius must be above the peg radius {peg} m, got {hole} m; widen the hole or use a thinner peg"
    )]
    HoleTooSmall {
        /// Radius of the peg, in m.
        peg: f64,
        /// Radius of the hole, in m.
        hole: f64,
    },
    /// Pegs or holes that overlap, or holes beyond the plate.
    #[error("{name} must be above {limit} m, got {got} m")]
    TooClose {
        /// Name of the parameter.
        name: &'static str,
        /// Limit, in m.
        limit: f64,
        /// Value, in m.
        got: f64,
    },
    /// Chamfer without one of its sizes, or as large as its peg or plate.
    #[error(
        "the chamfer of the {body} must have a width and a depth below its radius and length, got {width} m by {depth} m"
    )]
    Chamfer {
        /// Body that has the chamfer.
        body: &'static str,
        /// Radial width, in m.
        width: f64,
        /// Depth along the axis, in m.
        depth: f64,
    },
}

/// Checks tool and scene.
pub(super) fn check(shape: &Shape, scene: &Scene) -> Result<(), InvalidContact> {
    let surfaces = [
        scene.wall.map(|wall| wall.surface),
        scene.block.map(|block| block.surface),
        scene.sphere.map(|sphere| sphere.surface),
        scene.plate.map(|plate| plate.surface),
    ];
    surfaces.iter().flatten().try_for_each(check_surface)?;
    if let Some(block) = &scene.block {
        block.half_size.iter().try_for_each(|half| positive("half_size", *half))?;
    }
    if let Some(sphere) = &scene.sphere {
        positive("sphere radius", sphere.radius)?;
    }
    if let Some(plate) = &scene.plate {
        check_plate(plate)?;
    }
    match shape {
        Shape::Cube { half_edge } => positive("half_edge", *half_edge),
        Shape::Pegs(pegs) => check_pegs(pegs, scene.plate.as_ref()),
    }
}

fn check_surface(surface: &Surface) -> Result<(), InvalidContact> {
    positive("stiffness", surface.stiffness)?;
    positive("damping_depth", surface.damping_depth)?;
    not_negative("damping", surface.damping)?;
    not_negative("friction", surface.friction)
}

fn check_plate(plate: &Plate) -> Result<(), InvalidContact> {
    let holes = &plate.holes;
    let [hx, hy] = plate.half_size;
    for (name, value) in [
        ("half_size", hx),
        ("half_size", hy),
        ("thickness", plate.thickness),
        ("hole radius", holes.radius),
    ] {
        positive(name, value)?;
    }
    count("number of holes", holes.count)?;
    let limits = [f64::INFINITY, plate.thickness];
    chamfer("hole", [holes.chamfer_width, holes.chamfer_depth], limits)?;
    let (mouth, spacing) = (holes.mouth(), if holes.count > 1 { holes.spacing } else { 0.0 });
    if holes.count > 1 {
        above("hole spacing", holes.spacing, 2.0 * mouth)?;
    }
    above("half_size", hx, spacing / 2.0 + mouth)?;
    above("half_size", hy, mouth)
}

fn check_pegs(pegs: &Pegs, plate: Option<&Plate>) -> Result<(), InvalidContact> {
    positive("peg radius", pegs.radius)?;
    positive("peg length", pegs.length)?;
    count("number of pegs", pegs.count)?;
    chamfer("peg", [pegs.chamfer_width, pegs.chamfer_length], [pegs.radius, pegs.length])?;
    if pegs.count > 1 {
        above("peg spacing", pegs.spacing, 2.0 * pegs.radius)?;
    }
    let Some(holes) = plate.map(|plate| plate.holes) else { return Ok(()) };
    if holes.count < pegs.count {
        return Err(InvalidContact::TooFewHoles { pegs: pegs.count, holes: holes.count });
    }
    if holes.radius <= pegs.radius {
        return Err(InvalidContact::HoleTooSmall { peg: pegs.radius, hole: holes.radius });
    }
    Ok(())
}

/// Checks a chamfer: both sizes are zero, or both are positive and below their `limits`.
fn chamfer(body: &'static str, sizes: [f64; 2], limits: [f64; 2]) -> Result<(), InvalidContact> {
    let is_sharp = sizes.iter().all(|size| size.abs() <= 0.0);
    let fits = |(size, limit): (&f64, &f64)| *size > 0.0 && size < limit;
    if is_sharp || sizes.iter().zip(&limits).all(fits) {
        return Ok(());
    }
    let [width, depth] = sizes;
    Err(InvalidContact::Chamfer { body, width, depth })
}

fn positive(name: &'static str, got: f64) -> Result<(), InvalidContact> {
    let is_valid = got.is_finite() && got > 0.0;
    if is_valid { Ok(()) } else { Err(InvalidContact::NotPositive { name, got }) }
}

fn not_negative(name: &'static str, got: f64) -> Result<(), InvalidContact> {
    let is_valid = got.is_finite() && got >= 0.0;
    if is_valid { Ok(()) } else { Err(InvalidContact::Negative { name, got }) }
}

fn above(name: &'static str, got: f64, limit: f64) -> Result<(), InvalidContact> {
    if got > limit { Ok(()) } else { Err(InvalidContact::TooClose { name, limit, got }) }
}

const fn count(name: &'static str, got: u8) -> Result<(), InvalidContact> {
    if matches!(got, 1 | 2) { Ok(()) } else { Err(InvalidContact::Count { name, got }) }
}
