//! `[[joint]]`, physical part: link, friction and motor of a joint.
//!
//! Angles in the file are in degrees, all other quantities in SI units. All results are in SI units.

use crate::plant::{Actuator, Friction, JointPlant};
use crate::rest::Rest;
use crate::units::Units;
use crate::{bodies, raw, simulated};
use controller::arm::{JointKind, Link};
use toml_input::List;

/// Maximum angle of one count of 6064h, in degrees of a revolute joint.
const MAX_COUNT_DEG: f64 = 0.1;

/// Maximum length of one count of 6064h, in mm of a prismatic joint.
const MAX_COUNT_MM: f64 = 0.1;

/// Reads the joint with its range, rest position and `actuator`. Returns `None` after a problem.
pub(super) fn read(
    joint: &raw::Joint,
    range: Option<[f64; 2]>,
    rest: Option<Rest>,
    actuator: Option<Actuator>,
    of: &mut Units<'_, '_>,
) -> Option<JointPlant> {
    let start = range.and_then(|range| start(joint, range, rest, of));
    let max_torque = actuator.map(|actuator| actuator.max_torque);
    let friction = friction(joint, max_torque, of);
    let drivetrain = simulated::read(&joint.simulated, max_torque, of);
    let link = link(joint, range, of);
    Some(JointPlant {
        link: link?,
        start: start?,
        friction: friction?,
        actuator: actuator?,
        drivetrain: drivetrain?,
    })
}

/// Reads motor, encoder with its `zero_counts`, and gear. Returns `None` after a problem.
pub(super) fn actuator(
    joint: &raw::Joint,
    zero_counts: Option<i32>,
    of: &mut Units<'_, '_>,
) -> Option<Actuator> {
    let max_torque = of.either(&joint.max_torque_nm, &joint.max_force_n);
    let max_torque = max_torque.and_then(|value| of.problems.positive(value));
    let rated_torque = of.problems.within(&joint.rated_torque_nm, 1e-3..=4e6);
    let List(torque_curve) = joint.torque_curve.get()?;
    check_resolution(joint, of);
    Some(Actuator {
        counts_per_rev: joint.encoder_counts_per_rev.get()?,
        gear_ratio: joint.gear_ratio.get()?,
        zero_counts: zero_counts?,
        rated_torque: rated_torque?,
        max_torque: max_torque?,
        torque_curve,
    })
}

/// Refuses a joint whose position is coarser than 0.1° or 0.1 mm.
fn check_resolution(joint: &raw::Joint, of: &mut Units<'_, '_>) {
    let counts = joint.encoder_counts_per_rev.get().zip(joint.gear_ratio.get());
    let Some((counts, gear)) = counts.filter(|(_, gear)| *gear != 0.0) else { return };
    let count = std::f64::consts::TAU / (f64::from(counts) * gear.abs());
    let (count, limit, unit) = match of.kind {
        JointKind::Revolute => (count.to_degrees(), MAX_COUNT_DEG, "°"),
        JointKind::Prismatic => (count * 1e3, MAX_COUNT_MM, " mm"),
    };
    if count > limit {
        let reason = format!(
            "one count of 6064h must be at most {limit}{unit} of the joint, got {count:.3}{unit}"
        );
        of.problems.add(&joint.encoder_counts_per_rev, reason);
    }
}

/// Reads the range as lowest and highest position, in rad or m.
pub(super) fn range(joint: &raw::Joint, of: &mut Units<'_, '_>) -> Option<[f64; 2]> {
    let limit = of.either(&joint.limit_deg, &joint.limit_m)?;
    let [low, high] = of.problems.all_finite(limit)?;
    if low >= high {
        of.problems
            .add(limit, format_args!("must rise from lower to upper limit, got {low} to {high}"));
    }
    Some([of.si(low), of.si(high)])
}

/// Returns the start position: by default the rest position, else zero, or the middle of a range without zero.
fn start(
    joint: &raw::Joint,
    [low, high]: [f64; 2],
    rest: Option<Rest>,
    of: &mut Units<'_, '_>,
) -> Option<f64> {
    let given = of.at_most_one(&joint.start_deg, &joint.start_m)?;
    let start = if let Some(rest) = rest.filter(|_| given.is_absent()) {
        rest.position()
    } else if given.is_absent() {
        if (low..=high).contains(&0.0) { 0.0 } else { f64::midpoint(low, high) }
    } else {
        of.si(given.get()?)
    };
    if !(low..=high).contains(&start) {
        of.problems.add(given, "the joint would start out of its range");
    }
    Some(start)
}

/// Reads the friction at the joint. Its Coulomb part must be below the maximum torque.
fn friction(
    joint: &raw::Joint,
    max_torque: Option<f64>,
    of: &mut Units<'_, '_>,
) -> Option<Friction> {
    let coulomb = of.either(&joint.coulomb_friction_nm, &joint.coulomb_friction_n);
    let viscous = of.either(&joint.viscous_friction_nms_per_rad, &joint.viscous_friction_ns_per_m);
    let coulomb = coulomb.and_then(|value| {
        // A capacity of zero or below is reported separately.
        let most = max_torque.filter(|most| *most > 0.0).unwrap_or(f64::MAX);
        let size = of.problems.not_negative(value)?;
        if size >= most {
            of.problems.add(value, format_args!("must be below the joint's capacity of {most}"));
            return None;
        }
        Some(size)
    });
    let viscous = viscous.and_then(|value| of.problems.within(value, bodies::VISCOUS));
    Some(Friction { coulomb: coulomb?, viscous: viscous? })
}

/// Reads Denavit-Hartenberg parameters, mass and inertias of the link.
fn link(joint: &raw::Joint, range: Option<[f64; 2]>, of: &mut Units<'_, '_>) -> Option<Link> {
    let rotor = of.either(&joint.rotor_inertia_kg_m2, &joint.rotor_mass_kg);
    let problems = &mut *of.problems;
    let rotor_inertia = rotor.and_then(|value| problems.within(value, bodies::ROTOR));
    let alpha = problems.finite(&joint.alpha_deg);
    let a = problems.within(&joint.a_m, -10.0..=10.0);
    let d = problems.within(&joint.d_m, -10.0..=10.0);
    let theta = problems.finite(&joint.theta_deg);
    let mass = problems.within(&joint.mass_kg, 0.0..=1_000.0);
    let centre_of_mass = bodies::centre_of_mass(&joint.centre_of_mass_m, problems);
    let inertia = bodies::inertia(&joint.inertia_kg_m2, problems);
    Some(Link {
        kind: of.kind,
        alpha: alpha?.to_radians(),
        a: a?,
        d: d?,
        theta: theta?.to_radians(),
        mass: mass?,
        centre_of_mass: centre_of_mass?,
        inertia: inertia?,
        rotor_inertia: rotor_inertia?,
        range: range?,
    })
}
