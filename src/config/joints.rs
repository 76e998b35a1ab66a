//! `[arm]` and `[[joint]]`: the arm, its encoders, its torque curves.

use std::path::Path;

use nalgebra::Isometry3;
use nalgebra::Translation3;
use nalgebra::UnitQuaternion;

use crate::bodies;
use crate::boot;
use crate::boot::BootSettings;
use crate::lookup;
use crate::names;
use crate::plausibility;
use crate::problem::Problems;
use crate::raw;
use crate::simulated;
use crate::simulated::Simulated;
use crate::units::Units;
use canopen::NodeId;
use canopen::eds::Eds;
use canopen::frame::Channel;
use canopen::plan::Identity;
use controller::arm::JointKind;
use controller::arm::Link;
use controller::calibration::Calibration;
use controller::calibration::JointCalibration;
use controller::calibration::TorqueCurve;
use controller::coupling::Coupling;

/// One joint: where it is on the network, how it moves, what moves it.
#[derive(Clone, Debug)]
pub struct Joint {
    /// What people call it.
    pub name: String,
    /// Its drive's bus.
    pub channel: Channel,
    /// Its drive's node-id.
    pub node: NodeId,
    /// What its drive must be.
    pub identity: Identity,
    /// How its drive is booted.
    pub boot: BootSettings,
    /// What its drive's maker says of it.
    pub eds: Eds,
    /// Kinematics, masses and range.
    pub link: Link,
    /// Where it starts in simulation, in rad or m.
    pub start: f64,
    /// Dry friction at the joint, in N·m or N.
    pub coulomb_friction: f64,
    /// Viscous friction at the joint, in N·m·s/rad or N·s/m.
    pub viscous_friction: f64,
    /// Encoder counts per revolution of the motor.
    pub counts_per_rev: u32,
    /// Motor revolutions per joint revolution; negative where they turn against each other.
    pub gear_ratio: f64,
    /// Counts at joint position zero.
    pub zero_counts: i32,
    /// The motor's rated torque, in N·m.
    pub rated_torque: f64,
    /// The most its actuator is asked for, in N·m or N.
    pub max_torque: f64,
    /// How fast it may move before torque goes off, in rad/s or m/s.
    pub max_speed: f64,
    /// c1, c3, c5 of the torque curve.
    pub torque_curve: [f64; 3],
    /// Encoder and torque curve, as the controller uses them.
    pub calibration: JointCalibration,
    /// What its simulated motor and gear do besides.
    pub simulated: Simulated,
}

impl Joint {
    /// Key of [`max_torque`](Self::max_torque) and its unit.
    pub(super) const fn max_torque_key(&self) -> (&'static str, &'static str) {
        match self.link.kind {
            JointKind::Revolute => ("max_torque_nm", "N·m"),
            JointKind::Prismatic => ("max_force_n", "N"),
        }
    }
}

/// All six joints; `None` where a problem has been noted.
pub(super) fn joints(
    file: &Path,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) -> Option<[Joint; 6]> {
    let mut joints = Vec::new();
    let called = raw.joint.iter().map(|joint| joint.name.as_str());
    names::check("joint", called, problems);
    for (place, joint) in raw.joint.iter().enumerate() {
        joints.push(read(file, raw, place, joint, problems));
    }
    let joints: Vec<Joint> = joints.into_iter().collect::<Option<_>>()?;
    let found = joints.len();
    let all = joints.try_into().ok();
    if all.is_none() {
        problems.add("joint", format_args!("{found} joints; a hand controller has 6"));
    }
    all
}

fn read(
    file: &Path,
    raw: &raw::File,
    place: usize,
    joint: &raw::Joint,
    problems: &mut Problems<'_>,
) -> Option<Joint> {
    let key = |name: &str| format!("joint[{place}].{name}");
    let channel = lookup::channel(&key("bus"), raw, &joint.bus, problems);
    let node = lookup::node_id(&key("node_id"), joint.node_id, problems);
    let eds = lookup::eds(&key("eds"), file, &joint.eds, problems);
    let identity =
        Identity { vendor: joint.vendor_id, product: joint.product_code, revision: joint.revision };
    let lost_ms = raw.safety.drive_lost_ms;
    let boot = boot::of_drive(&key("boot"), joint.boot.as_ref(), lost_ms, problems);
    let kinds = [("revolute", JointKind::Revolute), ("prismatic", JointKind::Prismatic)];
    let kind = joint.kind.as_deref().unwrap_or("revolute");
    let kind = problems.one_of(&key("kind"), kind, &kinds)?;
    let usual_speed = plausibility::usual_speed(&raw.safety, kind);
    // A torque that is wrong is reported itself, not the curve up to it.
    let before = problems.count();
    let moved = moved(&key, kind, usual_speed, joint, problems);

    let coefficients = joint.torque_curve.0;
    let curve = moved.as_ref().map(|moved| TorqueCurve::new(coefficients, moved.max_torque));
    let curve =
        curve.and_then(|curve| problems.take_unless_noted(before, &key("torque_curve"), curve));
    let calibration = curve.and_then(|curve| {
        let counts = joint.encoder_counts_per_rev;
        let made = JointCalibration::new(counts, joint.gear_ratio, joint.zero_counts, curve);
        problems.take(&key("gear_ratio"), made)
    });
    let given = moved.as_ref().map(|moved| moved.max_torque).zip(Some(&joint.simulated));
    let simulated = given.and_then(|(max_torque, given)| {
        let mut of = Units {
            key: &|name| key(&format!("simulated.{name}")),
            slides: kind == JointKind::Prismatic,
            problems,
        };
        simulated::read(given, max_torque, &mut of)
    });
    let alpha = problems.finite(&key("alpha_deg"), joint.alpha_deg).to_radians();
    let a = problems.within(&key("a_m"), joint.a_m, -10.0..=10.0);
    let d = problems.within(&key("d_m"), joint.d_m, -10.0..=10.0);
    let theta = problems.finite(&key("theta_deg"), joint.theta_deg).to_radians();
    let mass = problems.within(&key("mass_kg"), joint.mass_kg, 0.0..=1_000.0);
    let centre_of_mass =
        bodies::centre_of_mass(&key("centre_of_mass_m"), joint.centre_of_mass_m.0, problems);
    let inertia = bodies::inertia(&key("inertia_kg_m2"), joint.inertia_kg_m2.0, problems);
    let rated_torque = problems.within(&key("rated_torque_nm"), joint.rated_torque_nm, 1e-3..=4e6);
    let moved = moved?;
    Some(Joint {
        name: joint.name.clone(),
        channel: channel?,
        node: node?,
        identity,
        boot,
        eds: eds?,
        link: Link {
            kind,
            alpha,
            a,
            d,
            theta,
            mass,
            centre_of_mass,
            inertia,
            rotor_inertia: moved.rotor_inertia,
            range: moved.range,
        },
        start: moved.start,
        coulomb_friction: moved.coulomb_friction,
        viscous_friction: moved.viscous_friction,
        counts_per_rev: joint.encoder_counts_per_rev,
        gear_ratio: joint.gear_ratio,
        zero_counts: joint.zero_counts,
        rated_torque,
        max_torque: moved.max_torque,
        max_speed: moved.max_speed,
        torque_curve: coefficients,
        calibration: calibration?,
        simulated: simulated?,
    })
}

/// What is written in other units where a joint slides.
struct Moved {
    range: [f64; 2],
    start: f64,
    max_speed: f64,
    max_torque: f64,
    rotor_inertia: f64,
    coulomb_friction: f64,
    viscous_friction: f64,
}

/// Reads those keys. Angles are typed in degrees; all else is SI, and so is what comes out.
fn moved(
    key: &dyn Fn(&str) -> String,
    kind: JointKind,
    usual_speed: f64,
    joint: &raw::Joint,
    problems: &mut Problems<'_>,
) -> Option<Moved> {
    let slides = kind == JointKind::Prismatic;
    let mut of = Units { key, slides, problems };
    let [degrees, metres] = [joint.limit_deg, joint.limit_m].map(|limit| limit.map(|list| list.0));
    let range = of.either(("limit_deg", degrees), ("limit_m", metres));
    let torque =
        of.either(("max_torque_nm", joint.max_torque_nm), ("max_force_n", joint.max_force_n));
    let rotor = of.either(
        ("rotor_inertia_kg_m2", joint.rotor_inertia_kg_m2),
        ("rotor_mass_kg", joint.rotor_mass_kg),
    );
    let speed = of.at_most_one(
        ("max_speed_rad_per_s", joint.max_speed_rad_per_s),
        ("max_speed_m_per_s", joint.max_speed_m_per_s),
    );
    let coulomb = of.either(
        ("coulomb_friction_nm", joint.coulomb_friction_nm),
        ("coulomb_friction_n", joint.coulomb_friction_n),
    );
    let viscous = of.either(
        ("viscous_friction_nms_per_rad", joint.viscous_friction_nms_per_rad),
        ("viscous_friction_ns_per_m", joint.viscous_friction_ns_per_m),
    );
    let start = of.at_most_one(("start_deg", joint.start_deg), ("start_m", joint.start_m));

    let si = |value: f64| if slides { value } else { value.to_radians() };
    let problems = of.problems;
    let range = range.map(|(name, [low, high])| {
        problems.all_finite(&key(name), [low, high]);
        if low >= high {
            problems.add(&key(name), format_args!("from {low} to {high} is no range"));
        }
        [si(low), si(high)]
    });
    let start = range.zip(start).map(|([low, high], (name, given))| {
        let start = given.map_or_else(|| resting(low, high), si);
        if !(low..=high).contains(&start) {
            problems.add(&key(name), "the joint would start out of its range");
        }
        start
    });
    let max_torque = torque.map(|(name, value)| problems.positive(&key(name), value));
    let max_speed = speed.map(|(name, given)| match given {
        Some(speed) => problems.within(&key(name), speed, plausibility::SPEEDS),
        None => usual_speed,
    });
    let rotor_inertia = rotor.map(|(name, value)| problems.positive(&key(name), value));
    let coulomb = coulomb.map(|(name, value)| problems.not_negative(&key(name), value));
    let viscous = viscous.map(|(name, value)| problems.not_negative(&key(name), value));
    Some(Moved {
        range: range?,
        start: start?,
        max_speed: max_speed?,
        max_torque: max_torque?,
        rotor_inertia: rotor_inertia?,
        coulomb_friction: coulomb?,
        viscous_friction: viscous?,
    })
}

/// Where a joint starts of which nothing is said: at zero, or in the middle of a range without it.
fn resting(low: f64, high: f64) -> f64 {
    if (low..=high).contains(&0.0) { 0.0 } else { f64::midpoint(low, high) }
}

/// Pose of the grip in link 6, and gravity in {0}.
pub(super) fn grip_and_gravity(
    arm: &raw::Arm,
    problems: &mut Problems<'_>,
) -> (Isometry3<f64>, [f64; 3]) {
    let [x, y, z] = problems.all_finite("arm.grip_m", arm.grip_m.0);
    let [about_x, about_y, about_z] = problems.all_finite("arm.grip_rad", arm.grip_rad.0);
    let gravity = bodies::gravity(arm, problems);
    let x_6_g = Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    );
    (x_6_g, gravity)
}

/// Encoders and torque curves of all joints, and what couples them.
pub(super) fn calibration(joints: &[Joint; 6], coupling: Option<Coupling<6>>) -> Calibration<6> {
    let calibration = Calibration::new(joints.each_ref().map(|joint| joint.calibration));
    coupling.map_or(calibration, |coupling| calibration.coupled(coupling))
}

/// What couples joints and actuators; `None` where nothing does, or a problem has been noted.
pub(super) fn coupling(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Coupling<6>> {
    let given = raw.coupling.as_ref()?;
    problems.take(
        "coupling.matrix",
        Coupling::new(given.matrix.0.map(|row| row.0), given.offset_rad_or_m.0),
    )
}
