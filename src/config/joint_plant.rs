//! `[[joint]]`, as far as it is about what the joint is made of: its link, its friction, its motor.
//!
//! Angles are typed in degrees; all else is SI, and so is what comes out.

use crate::bodies;
use crate::plant::Actuator;
use crate::plant::Friction;
use crate::plant::JointPlant;
use crate::raw;
use crate::simulated;
use crate::units::Units;
use controller::arm::Link;

/// The joint with its `actuator`; `None` where a problem has been noted.
pub(super) fn read(
    joint: &raw::Joint,
    actuator: Option<Actuator>,
    of: &mut Units<'_, '_, '_>,
) -> Option<JointPlant> {
    let range = range(joint, of);
    let start = range.and_then(|range| start(joint, range, of));
    let friction = friction(joint, of);
    let drivetrain =
        actuator.and_then(|actuator| simulated::read(&joint.simulated, actuator.max_torque, of));
    let link = link(joint, range, of);
    Some(JointPlant {
        link: link?,
        start: start?,
        friction: friction?,
        actuator: actuator?,
        drivetrain: drivetrain?,
    })
}

/// Motor, encoder and gear.
pub(super) fn actuator(joint: &raw::Joint, of: &mut Units<'_, '_, '_>) -> Option<Actuator> {
    let torque =
        of.either(("max_torque_nm", joint.max_torque_nm), ("max_force_n", joint.max_force_n));
    let key = of.key;
    let rated_torque =
        of.problems.within(&key("rated_torque_nm"), joint.rated_torque_nm, 1e-3..=4e6);
    let (name, max_torque) = torque?;
    Some(Actuator {
        counts_per_rev: joint.encoder_counts_per_rev,
        gear_ratio: joint.gear_ratio,
        zero_counts: joint.zero_counts,
        rated_torque,
        max_torque: of.problems.positive(&key(name), max_torque),
        torque_curve: joint.torque_curve.0,
    })
}

/// From its lowest position to its highest.
fn range(joint: &raw::Joint, of: &mut Units<'_, '_, '_>) -> Option<[f64; 2]> {
    let [degrees, metres] = [joint.limit_deg, joint.limit_m].map(|limit| limit.map(|list| list.0));
    let (name, [low, high]) = of.either(("limit_deg", degrees), ("limit_m", metres))?;
    let key = (of.key)(name);
    of.problems.all_finite(&key, [low, high]);
    if low >= high {
        of.problems.add(&key, format_args!("from {low} to {high} is no range"));
    }
    Some([of.si(low), of.si(high)])
}

/// Where it starts: at zero if nothing is said, or in the middle of a range without it.
fn start(joint: &raw::Joint, [low, high]: [f64; 2], of: &mut Units<'_, '_, '_>) -> Option<f64> {
    let (name, given) =
        of.at_most_one(("start_deg", joint.start_deg), ("start_m", joint.start_m))?;
    let resting = || if (low..=high).contains(&0.0) { 0.0 } else { f64::midpoint(low, high) };
    let start = given.map_or_else(resting, |given| of.si(given));
    if !(low..=high).contains(&start) {
        of.problems.add(&(of.key)(name), "the joint would start out of its range");
    }
    Some(start)
}

fn friction(joint: &raw::Joint, of: &mut Units<'_, '_, '_>) -> Option<Friction> {
    let coulomb = of.either(
        ("coulomb_friction_nm", joint.coulomb_friction_nm),
        ("coulomb_friction_n", joint.coulomb_friction_n),
    );
    let viscous = of.either(
        ("viscous_friction_nms_per_rad", joint.viscous_friction_nms_per_rad),
        ("viscous_friction_ns_per_m", joint.viscous_friction_ns_per_m),
    );
    let [coulomb, viscous] = [coulomb, viscous]
        .map(|found| found.map(|(name, value)| of.problems.not_negative(&(of.key)(name), value)));
    Some(Friction { coulomb: coulomb?, viscous: viscous? })
}

/// Kinematics and masses.
fn link(joint: &raw::Joint, range: Option<[f64; 2]>, of: &mut Units<'_, '_, '_>) -> Option<Link> {
    let rotor = of.either(
        ("rotor_inertia_kg_m2", joint.rotor_inertia_kg_m2),
        ("rotor_mass_kg", joint.rotor_mass_kg),
    );
    let Units { key, kind, problems } = of;
    let rotor_inertia = rotor.map(|(name, value)| problems.positive(&key(name), value));
    let alpha = problems.finite(&key("alpha_deg"), joint.alpha_deg).to_radians();
    let a = problems.within(&key("a_m"), joint.a_m, -10.0..=10.0);
    let d = problems.within(&key("d_m"), joint.d_m, -10.0..=10.0);
    let theta = problems.finite(&key("theta_deg"), joint.theta_deg).to_radians();
    let mass = problems.within(&key("mass_kg"), joint.mass_kg, 0.0..=1_000.0);
    let centre_of_mass =
        bodies::centre_of_mass(&key("centre_of_mass_m"), joint.centre_of_mass_m.0, problems);
    let inertia = bodies::inertia(&key("inertia_kg_m2"), joint.inertia_kg_m2.0, problems);
    let (kind, rotor_inertia, range) = (*kind, rotor_inertia?, range?);
    Some(Link { kind, alpha, a, d, theta, mass, centre_of_mass, inertia, rotor_inertia, range })
}
