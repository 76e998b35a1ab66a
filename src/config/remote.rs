//! `[remote]`: the commanded side. It is a virtual object, free or held by an arm, in a scene of wall, box and sphere.
//! Or it is a robot in another process, with an optional model of robot and scene.

use std::path::Path;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::files;
use crate::gripper;
use crate::problem::Problems;
use crate::raw::{self, six};
use crate::robots::{self, RobotArm};
use crate::value::{HasPlace, Optional, Value};
use controller::virtual_coupling::VirtualCoupling;
use remote::site::{Contact, GRAVITY, Virtual};
use robot::accommodation::Accommodation;
use robot::god_object::Coupling;
use robot::interaction::Interaction;
use robot::object::Servo;
use robot::payload::Payload;
use robot::shared_control::SharedControl;
use robot::wrist_sensor::{Reports, WristSensor};
use toml_input::List;
use units::spatial::Wrench;

/// Maximum coefficient of friction; rubber on rubber is below.
const MAX_FRICTION: f64 = 2.0;

/// Minimum radius of a sphere, in m: the object touches with the corners of a cube of 4 cm.
const MIN_RADIUS: f64 = 0.03;

/// Maximum radius of a sphere, in m; a larger one is a wall.
const MAX_RADIUS: f64 = 10.0;

/// Reads the virtual object with its scene, and the arm that holds it. Returns `None` after a problem. `coupling` is the
/// virtual coupling of the hand.
pub(super) fn settings(
    file: &raw::File,
    named_in: &Path,
    coupling: Option<&VirtualCoupling>,
    problems: &mut Problems<'_>,
) -> Option<(Virtual, Option<RobotArm>)> {
    let raw = &file.remote;
    refuse_stiff_remote(file, problems);
    let kind = kind(raw, problems);
    let is_far = kind.is_some_and(|kind| kind != Kind::Virtual);
    if is_far {
        refuse_far_keys(raw, problems);
    }
    // A robot in another process reports its start pose with its first sample.
    let is_unknown = is_far && raw.robot.is_absent() && raw.start_m.is_absent();
    let body = if is_unknown {
        Some((Isometry3::identity(), None))
    } else {
        body(&file.remote, named_in, problems)
    };
    let interaction = interaction(raw, problems);
    let servo = servo(raw, problems);
    let wall = raw.wall.as_ref().map(|raw| wall(raw, problems));
    let block = raw.r#box.as_ref().map(|raw| block(raw, problems));
    let sphere = raw.sphere.as_ref().map(|raw| sphere(raw, problems));
    let gripper = raw.gripper.as_ref().map(|raw| gripper::simulated(raw, problems));

    kind?;
    let (x_b_m, robot) = body?;
    let arm = robot.as_ref().map(RobotArm::following);
    let remote = Virtual {
        x_b_m,
        arm,
        interaction: interaction?,
        servo: servo?,
        // Its numbers were checked with the hand's.
        coupling: coupling.and_then(|made| {
            Coupling::new(*made.stiffness().values(), *made.damping().values()).ok()
        }),
        wall: given(wall)?,
        block: given(block)?,
        sphere: given(sphere)?,
        gripper: given(gripper)?,
    };
    refuse_contact_at_start(&remote, raw, problems);
    Some((remote, robot))
}

/// Location of the commanded side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// In this process.
    Virtual,
    /// In another process, behind the contract of docs/link.md.
    Link,
    /// In another process, with a model of it in this process.
    Both,
}

fn kind(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Kind> {
    let kinds = [("virtual", Kind::Virtual), ("link", Kind::Link), ("both", Kind::Both)];
    problems.one_of(&raw.kind, &kinds)
}

/// Returns whether the commanded side is in another process.
pub(super) fn is_link(raw: &raw::Remote) -> bool {
    raw.kind.as_ref().is_some_and(|kind| kind == "link" || kind == "both")
}

/// Returns whether the commanded side is in another process, with a model of it in this one.
pub(super) fn is_both(raw: &raw::Remote) -> bool {
    raw.kind.as_ref().is_some_and(|kind| kind == "both")
}

/// Returns whether the file describes a model: by `kind = "both"`, or by its limits. Arm and scene then belong to the
/// model, so the same file remains valid with `kind = "link"`.
pub(super) fn has_model(raw: &raw::Remote) -> bool {
    let limits = [&raw.link.model_limit_m, &raw.link.model_limit_deg];
    is_both(raw) || limits.into_iter().any(|limit| !limit.is_absent())
}

/// Refuses keys that only the other process can set: errors of the sensor, and without a model also arm, scene and
/// shared control.
fn refuse_far_keys(raw: &raw::Remote, problems: &mut Problems<'_>) {
    let wall = raw.wall.as_ref().map(HasPlace::place);
    let block = raw.r#box.as_ref().map(HasPlace::place);
    let sphere = raw.sphere.as_ref().map(HasPlace::place);
    let gripper = raw.gripper.as_ref().map(HasPlace::place);
    let shared = raw.shared_control.as_ref().map(HasPlace::place);
    let of_sensor = [
        (!raw.sensor_sign.is_absent()).then(|| raw.sensor_sign.place()),
        (!raw.sensor_bias_n.is_absent()).then(|| raw.sensor_bias_n.place()),
        (!raw.sensor_bias_nm.is_absent()).then(|| raw.sensor_bias_nm.place()),
    ];
    let robot = (!raw.robot.is_absent()).then(|| raw.robot.place());
    let of_model =
        [robot, wall, block, sphere, gripper, shared].into_iter().filter(|_| !has_model(raw));
    for place in of_sensor.into_iter().chain(of_model).flatten() {
        let kind = raw.kind.as_ref().map_or("", String::as_str);
        let reason = format_args!(
            "with kind = \"{kind}\" the far side has it, in its own configuration: remove it here"
        );
        problems.add(place, reason);
    }
}

/// Refuses an arm whose tool starts inside a surface. A free object may start there.
fn refuse_contact_at_start(remote: &Virtual, raw: &raw::Remote, problems: &mut Problems<'_>) {
    let f_m = remote.contact_at_start();
    if remote.arm.is_some() && f_m != Wrench::ZERO {
        let [x, y, z] = remote.x_b_m.translation.vector.into();
        let reason = format!(
            "the object would start in a surface, at ({x:.3}, {y:.3}, {z:.3}) m with {:.1} N on it: \
             change start_deg or base_m of the robot, or move the surface",
            f_m.force.norm()
        );
        problems.add(&raw.robot, reason);
    }
}

/// Reads the start pose of {MRF} in {b}, and the arm that holds it. With an arm, its start joints determine the pose.
fn body(
    raw: &raw::Remote,
    named_in: &Path,
    problems: &mut Problems<'_>,
) -> Option<(Isometry3<f64>, Option<RobotArm>)> {
    let Some(name) = raw.robot.as_ref() else {
        if raw.start_m.is_absent() {
            problems.add(&raw.start_m, "missing field `start_m`");
        }
        return robots::pose(&raw.start_m, &raw.start_deg, problems).map(|x_b_m| (x_b_m, None));
    };
    for given in [&raw.start_m, &raw.start_deg].into_iter().filter(|key| !key.is_absent()) {
        let reason = "contradicts remote.robot: its joints say where it starts; remove one of both";
        problems.add(given, reason);
    }
    let file = files::beside(named_in, name);
    match RobotArm::load_from(problems.files(), &file) {
        Ok(arm) => Some((arm.following().pose(), Some(arm))),
        Err(invalid) => {
            problems.add(&raw.robot, format_args!("{} is not usable", file.display()));
            problems.absorb(invalid);
            None
        }
    }
}

/// Refuses a virtual coupling to a commanded side that surfaces do not stop. The coupling renders the lag of the object
/// behind its command, which contact would not change there.
fn refuse_stiff_remote(file: &raw::File, problems: &mut Problems<'_>) {
    let kind = file.remote.kind.as_ref().filter(|kind| *kind != "virtual");
    if let (Some(kind), Some(section)) = (kind, &file.controller.virtual_coupling) {
        let reason = format_args!(
            "needs an object that surfaces stop, and remote.kind = \"{kind}\" follows its command into them: \
             contact would not be felt; remove the section, or set remote.kind = \"virtual\""
        );
        problems.add(section, reason);
    }
}

/// Returns `None` for an invalid section and `Some(None)` for an absent one.
pub(super) fn given<T>(section: Option<Option<T>>) -> Option<Option<T>> {
    match section {
        None => Some(None),
        Some(read) => read.map(Some),
    }
}

fn accommodation(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Accommodation> {
    let before = problems.count();
    let linear = problems.not_negative(&raw.accommodation_m_per_ns);
    let angular = problems.not_negative(&raw.accommodation_rad_per_nms);
    let force = problems.within(&raw.accommodation_deadband_n.or(0.0), 0.0..=1e3);
    let moment = problems.within(&raw.accommodation_deadband_nm.or(0.0), 0.0..=1e3);
    let (linear, angular, force, moment) = (linear?, angular?, force?, moment?);
    let made = Accommodation::new(six([linear; 3], [angular; 3]), six([force; 3], [moment; 3]));
    // A gain refused here is too large, so the larger one is reported.
    let larger =
        if linear > angular { &raw.accommodation_m_per_ns } else { &raw.accommodation_rad_per_nms };
    problems.take_unless_noted(before, larger, made)
}

/// Reads sensor, payload, accommodation and shared control.
fn interaction(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Interaction> {
    let x_m_s = robots::pose(&raw.sensor_m, &raw.sensor_deg, problems);
    let signs = [(1, Reports::OnTool), (-1, Reports::OnArm)];
    let sign = raw.sensor_sign.or(1);
    let reports = signs.iter().find(|(named, _)| sign.get() == Some(*named));
    if reports.is_none()
        && let Some(wrong) = sign.get()
    {
        let reason = "must be 1, a sensor that reports the wrench on the tool, or -1, on the arm";
        problems.add(&sign, format_args!("{reason}; got {wrong}"));
    }
    let force = problems.all_finite(&raw.sensor_bias_n.or(List::default()));
    let moment = problems.all_finite(&raw.sensor_bias_nm.or(List::default()));
    let payload = payload(raw, problems);
    let accommodation = accommodation(raw, problems);
    let shared = match &raw.shared_control {
        Some(section) => shared_control(section, problems),
        None => Some(SharedControl::default()),
    };
    let bias = Wrench::from_components(six(force?, moment?));
    Some(Interaction {
        sensor: WristSensor { x_m_s: x_m_s?, reports: reports?.1, bias },
        payload: payload?,
        gravity_in_b: Vector3::from(GRAVITY),
        removes_inertia: raw.remove_inertia.or(false).get()?,
        feels_payload: raw.feel_payload.or(false).get()?,
        accommodation: accommodation?,
        shared: shared?,
    })
}

fn shared_control(raw: &raw::SharedControl, problems: &mut Problems<'_>) -> Option<SharedControl> {
    let before = problems.count();
    let operator = problems.all_finite(&raw.operator);
    let linear = problems.all_finite(&raw.auto_m_per_s.or(List::default()));
    let angular = problems.all_finite(&raw.auto_rad_per_s.or(List::default()));
    let made = SharedControl::new(operator?, six(linear?, angular?));
    problems.take_unless_noted(before, &raw.operator, made)
}

fn servo(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Servo> {
    let before = problems.count();
    let time_constant = problems.not_negative(&raw.servo_time_constant_s);
    let max_speed = problems.positive(&raw.max_speed_m_per_s);
    let max_turn = problems.positive(&raw.max_turn_rad_per_s);
    let made = Servo::new(time_constant?, max_speed?, max_turn?);
    problems.take_unless_noted(before, &raw.servo_time_constant_s, made)
}

fn payload(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Payload> {
    let before = problems.count();
    let mass = problems.not_negative(&raw.mass_kg);
    let centre = problems.all_finite(&raw.centre_of_mass_m);
    let inertia = problems.all_finite(&raw.inertia_kg_m2.or(List::default()));
    let made = Payload::new(mass?, centre?);
    let made = problems.take_unless_noted(before, &raw.mass_kg, made)?;
    problems.take_unless_noted(before, &raw.inertia_kg_m2, made.with_inertia(inertia?))
}

/// Reads a point of the wall in {b}, in m, its outward normal, and its contact.
fn wall(
    raw: &raw::Wall,
    problems: &mut Problems<'_>,
) -> Option<(Vector3<f64>, Unit<Vector3<f64>>, Contact)> {
    let point = problems.all_finite(&raw.point_m);
    let normal = problems.all_finite(&raw.normal).map(Vector3::from);
    let direction = normal.and_then(|normal| Unit::try_new(normal, 1e-6));
    if normal.is_some() && direction.is_none() {
        problems.add(&raw.normal, "has no direction");
    }
    let contact = contact(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, &raw.friction, problems);
    normal?;
    Some((Vector3::from(point?), direction.unwrap_or(Vector3::x_axis()), contact?))
}

/// Reads centre and half size of the box, in m, and its contact.
fn block(
    raw: &raw::Block,
    problems: &mut Problems<'_>,
) -> Option<(Vector3<f64>, Vector3<f64>, Contact)> {
    let centre = problems.all_finite(&raw.centre_m);
    let half = problems.none_negative(&raw.half_size_m);
    let contact = contact(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, &raw.friction, problems);
    Some((Vector3::from(centre?), Vector3::from(half?), contact?))
}

/// Reads centre and radius of the sphere, in m, and its contact.
fn sphere(raw: &raw::Sphere, problems: &mut Problems<'_>) -> Option<(Vector3<f64>, f64, Contact)> {
    let centre = problems.all_finite(&raw.centre_m);
    let radius = problems.within(&raw.radius_m, MIN_RADIUS..=MAX_RADIUS);
    let contact = contact(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, &raw.friction, problems);
    Some((Vector3::from(centre?), radius?, contact?))
}

/// Reads stiffness, damping and friction of a surface.
fn contact(
    stiffness: &Value<f64>,
    damping: &Value<f64>,
    friction: &Optional<f64>,
    problems: &mut Problems<'_>,
) -> Option<Contact> {
    let stiffness = problems.positive(stiffness);
    let damping = problems.not_negative(damping);
    let friction = problems.within(&friction.or(0.0), 0.0..=MAX_FRICTION);
    Some(Contact { stiffness: stiffness?, damping: damping?, friction: friction? })
}
