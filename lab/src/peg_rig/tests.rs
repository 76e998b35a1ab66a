//! Rig against the analysis of a single peg by Whitney 1982 (Quasi-static assembly of compliantly supported rigid parts)
//! and Simunovic 1975 (Force information in assembly processes).

use super::*;

const SETTINGS: PegRigSettings = PegRigSettings {
    peg_radius: 5e-3,
    peg_length: 0.03,
    peg_chamfer: [0.0; 2],
    hole_radius: 5.01e-3,
    hole_chamfer: [0.0; 2],
    thickness: 0.03,
    friction: 0.3,
    stiffness: 3.6e8,
};

/// Force into the hole, in N: small, so that the peg is nearly rigid.
const PUSH: f64 = 2.0;

/// Returns the ratio of a load to the boundary of the jamming diagram in its direction: below 1 the peg moves in.
///
/// In two-point contact, with forces normal to the axis at the end of the peg and at the mouth of the hole, both at the
/// limit of friction (Whitney 1982): `M / (r F_z) = ±λ - µ (1 + λ) F_x / F_z` with `λ = l / (2 r µ)`.
/// With both on one side: `F_x / F_z = ±1 / µ`.
fn load_ratio(settings: &PegRigSettings, depth: f64, push: &Push) -> f64 {
    let (r, mu) = (settings.peg_radius, settings.friction);
    let lambda = depth / (2.0 * r * mu);
    let (fx, m) = (push.across / push.into, push.moment / (r * push.into));
    let two_point = (m + mu * (1.0 + lambda) * fx).abs() / lambda;
    let one_side = fx.abs() * mu;
    two_point.max(one_side)
}

/// Returns the distance from the boundary of all pushes on a grid with another result than the diagram's.
fn differences(settings: PegRigSettings, depth: f64) -> Vec<f64> {
    let rig = PegRig::new(settings).unwrap();
    let (r, mu) = (settings.peg_radius, settings.friction);
    let lambda = depth / (2.0 * r * mu);
    let grid = || (-4..=4_i8).map(|place| f64::from(place) * 0.3);
    let pushes = grid().flat_map(|row| grid().map(move |column| (row, column)));
    let different = pushes.filter_map(|(row, column)| {
        let (fx, m) = (column / mu, row * (2.0 * lambda + 1.0));
        let push = Push { across: fx * PUSH, into: PUSH, moment: m * r * PUSH };
        let ratio = load_ratio(&settings, depth, &push);
        (rig.moves_in(depth, &push) != (ratio < 1.0)).then_some((ratio - 1.0).abs())
    });
    different.collect()
}

#[test]
fn peg_jams_as_the_jamming_diagram_says() {
    for (friction, depth) in [(0.3, 0.01), (0.15, 0.006), (0.5, 0.012)] {
        let different = differences(PegRigSettings { friction, ..SETTINGS }, depth);
        assert!(different.iter().all(|distance| *distance < 0.05), "{different:?}");
        assert!(different.len() <= 4, "{different:?} of 81");
    }
}

#[test]
fn peg_wedges_below_mu_times_its_diameter_only() {
    let mut different = Vec::new();
    for friction in [0.1, 0.2, 0.3, 0.4, 0.5] {
        let rig = PegRig::new(PegRigSettings { friction, ..SETTINGS }).unwrap();
        let bound = friction * 2.0 * SETTINGS.peg_radius;
        for share in [0.5, 0.7, 0.85, 0.95, 1.05, 1.15, 1.3, 1.6, 2.0] {
            if rig.wedges(share * bound, 2e-3) != (share < 1.0) {
                different.push((friction, share));
            }
        }
    }
    assert!(
        different.iter().all(|(_, share): &(f64, f64)| (share - 1.0).abs() < 0.06),
        "{different:?}"
    );
    assert!(different.len() <= 2, "{different:?} of 45");
}

#[test]
fn chamfer_captures_a_peg_within_its_width() {
    let settings = PegRigSettings {
        hole_chamfer: [1e-3, 1e-3],
        hole_radius: 5.1e-3,
        friction: 0.1,
        stiffness: 3.6e6,
        ..SETTINGS
    };
    let rig = PegRig::new(settings).unwrap();
    let grip = Grip { centre: 0.0, lateral: 2e3, angular: 5.0, force: 20.0 };
    for step in 0..8_u8 {
        let angle = f64::from(step) * std::f64::consts::TAU / 8.0;
        let lower = |offset: f64| {
            let approach =
                Approach { offset: [offset * angle.cos(), offset * angle.sin()], tilt: [0.0; 2] };
            rig.lower(&approach, &grip, 0.012)
        };
        let inside = lower(1.0e-3);
        assert_eq!(inside.outcome, Outcome::Inserted, "{inside:?}");
        let outside = lower(1.25e-3);
        assert_eq!(outside.outcome, Outcome::Rejected, "{outside:?}");
    }
}

#[test]
fn tilted_peg_enters_with_a_soft_grip_and_jams_with_a_stiff_one() {
    let settings = PegRigSettings {
        hole_chamfer: [1e-3, 1e-3],
        hole_radius: 5.05e-3,
        stiffness: 3.6e6,
        ..SETTINGS
    };
    let rig = PegRig::new(settings).unwrap();
    let approach = Approach { offset: [0.0, 0.0], tilt: [0.0, 0.03] };
    let lower = |angular, lateral| {
        let grip = Grip { centre: 0.0, lateral, angular, force: 20.0 };
        rig.lower(&approach, &grip, 0.02)
    };
    let soft = lower(1.0, 1e3);
    assert_eq!(soft.outcome, Outcome::Inserted, "{soft:?}");
    let stiff = lower(200.0, 1e3);
    assert_eq!(stiff.outcome, Outcome::Jammed, "{stiff:?}");
    assert!(stiff.features.is_two_point(), "{stiff:?}");
}

#[test]
fn hole_smaller_than_the_peg_is_refused() {
    let error = PegRig::new(PegRigSettings { hole_radius: 4.9e-3, ..SETTINGS }).unwrap_err();
    assert_eq!(error, InvalidContact::HoleTooSmall { peg: 5e-3, hole: 4.9e-3 });
}

#[test]
fn peg_is_pushed_along_the_normal_of_what_it_touches() {
    let settings = PegRigSettings { hole_chamfer: [1e-3, 1e-3], ..SETTINGS };
    let rig = PegRig::new(settings).unwrap();
    let at = |x: f64, depth: f64| {
        let approach = Approach { offset: [x, 0.0], tilt: [0.0; 2] };
        rig.touched(&approach, depth)
    };
    let free = at(0.0, 5e-3);
    assert!(!free.features.is_any() && free.f_e == Wrench::ZERO, "{free:?}");
    let cone = at(0.6e-3, 0.5e-3);
    assert!(cone.features.cone > 0 && cone.features.bore == 0, "{cone:?}");
    let [x, z] = [cone.f_e.force.x, cone.f_e.force.z];
    assert!(x < 0.0 && (x + z).abs() < 0.1 * z, "{cone:?}");
    let bore = at(0.02e-3, 5e-3);
    assert!(bore.features.bore > 0 && bore.features.cone == 0, "{bore:?}");
    assert!(bore.f_e.force.x < 0.0 && bore.f_e.force.z.abs() < 1e-9, "{bore:?}");
}

#[test]
fn stiff_pegs_pass_the_edge_between_chamfer_and_bore() {
    let grip = Grip { centre: 0.0, lateral: 1e3, angular: 5.0, force: 5.0 };
    for (chamfer, offset, tilt) in [
        ([0.0; 2], 0.2e-3, -0.02),
        ([0.0; 2], 0.6e-3, -0.02),
        ([5e-4; 2], 1.4e-3, -0.01),
        ([5e-4; 2], 0.6e-3, -0.02),
    ] {
        let settings = PegRigSettings {
            peg_chamfer: chamfer,
            hole_chamfer: [1e-3; 2],
            hole_radius: 5.05e-3,
            stiffness: 3.6e7,
            ..SETTINGS
        };
        let rig = PegRig::new(settings).unwrap();
        let lower =
            |tilt| rig.lower(&Approach { offset: [offset, 0.0], tilt: [0.0, tilt] }, &grip, 0.012);
        let passed = lower(tilt);
        assert_eq!(passed.outcome, Outcome::Inserted, "{passed:?}");
        let steep = lower(-0.04);
        assert_ne!(steep.outcome, Outcome::Inserted, "{steep:?}");
    }
}

#[test]
fn peg_beside_its_hole_is_rejected_however_far() {
    let rig = PegRig::new(SETTINGS).unwrap();
    let grip = Grip { centre: 0.0, lateral: 1e3, angular: 5.0, force: 20.0 };
    let lowered = |x: f64, force: f64| {
        let approach = Approach { offset: [x, 0.0], ..Approach::default() };
        rig.lower(&approach, &Grip { force, ..grip }, 0.01)
    };
    assert_eq!(lowered(0.0, 20.0).outcome, Outcome::Inserted);
    for offset in [0.05, 0.11, 0.2, -1.0, 1e3] {
        let found = lowered(offset, 20.0);
        assert_eq!(found.outcome, Outcome::Rejected, "{offset} m: {found:?}");
        assert!(found.depth < 1e-3 && found.features.face > 0, "{offset} m: {found:?}");
    }
    // This force compresses the face by more than the depth.
    assert_eq!(lowered(0.2, 1e7).outcome, Outcome::Rejected);
}
