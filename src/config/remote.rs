//! `[remote]`: the commanded side. Today a virtual object, and what it can touch: a wall, a box, a
//! sphere.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::problem::Problems;
use crate::raw::{self, six};
use crate::value::{Optional, Value};
use controller::virtual_coupling::VirtualCoupling;
use remote::site::{Contact, Virtual};
use robot::accommodation::Accommodation;
use robot::god_object::Coupling;
use robot::object::Servo;
use robot::payload::Payload;
use written::List;

/// Maximum coefficient of friction; rubber on rubber is below.
const MAX_FRICTION: f64 = 2.0;

/// Minimum radius of a sphere, in m: the object touches with the corners of a cube of 4 cm.
const MIN_RADIUS: f64 = 0.03;

/// Maximum radius of a sphere, in m; a larger one is a wall.
const MAX_RADIUS: f64 = 10.0;

/// The virtual object and what it can touch; `None` where a problem has been noted. `coupling` is that of the hand.
pub(super) fn settings(
    file: &raw::File,
    coupling: Option<&VirtualCoupling>,
    problems: &mut Problems<'_>,
) -> Option<Virtual> {
    let raw = &file.remote;
    refuse_stiff_remote(file, problems);
    if let Some(other) = raw.kind.as_ref().filter(|kind| *kind != "virtual") {
        problems.add(&raw.kind, format_args!("unknown value \"{other}\"; expected \"virtual\""));
    }
    let start = problems.all_finite(&raw.start_m);
    let turned = problems.all_finite(&raw.start_deg.or(List::default()));
    let sensor = problems.all_finite(&raw.sensor_m);
    let accommodation = accommodation(raw, problems);
    let servo = servo(raw, problems);
    let payload = payload(raw, problems);
    let wall = raw.wall.as_ref().map(|raw| wall(raw, problems));
    let block = raw.r#box.as_ref().map(|raw| block(raw, problems));
    let sphere = raw.sphere.as_ref().map(|raw| sphere(raw, problems));

    raw.kind.as_ref()?;
    let [about_x, about_y, about_z] = turned?.map(f64::to_radians);
    Some(Virtual {
        x_b_m: Isometry3::from_parts(
            Translation3::from(start?),
            UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
        ),
        x_m_s: Isometry3::from(Translation3::from(sensor?)),
        payload: payload?,
        servo: servo?,
        accommodation: accommodation?,
        // Its numbers were checked with the hand's.
        coupling: coupling.and_then(|made| {
            Coupling::new(*made.stiffness().values(), *made.damping().values()).ok()
        }),
        wall: given(wall)?,
        block: given(block)?,
        sphere: given(sphere)?,
    })
}

/// Notes a virtual coupling to a commanded side that surfaces cannot stop: the coupling would hide the contact, since
/// it shows how far the object stays behind its command.
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

/// Turns a section that was noted into `None`, and keeps one that is absent.
fn given<T>(section: Option<Option<T>>) -> Option<Option<T>> {
    match section {
        None => Some(None),
        Some(read) => read.map(Some),
    }
}

fn accommodation(raw: &raw::Remote, problems: &mut Problems<'_>) -> Option<Accommodation> {
    let before = problems.count();
    let linear = problems.not_negative(&raw.accommodation_m_per_ns);
    let angular = problems.not_negative(&raw.accommodation_rad_per_nms);
    let (linear, angular) = (linear?, angular?);
    // The virtual sensor has no bias, so nothing need go unnoticed.
    let made = Accommodation::new(six([linear; 3], [angular; 3]), [0.0; 6]);
    // A gain that is refused here is too large, so it is the larger one.
    let larger =
        if linear > angular { &raw.accommodation_m_per_ns } else { &raw.accommodation_rad_per_nms };
    problems.take_unless_noted(before, larger, made)
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
    let made = Payload::new(mass?, centre?);
    problems.take_unless_noted(before, &raw.mass_kg, made)
}

/// A point of it and the direction out of it.
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

/// Centre and half size.
fn block(
    raw: &raw::Block,
    problems: &mut Problems<'_>,
) -> Option<(Vector3<f64>, Vector3<f64>, Contact)> {
    let centre = problems.all_finite(&raw.centre_m);
    let half = problems.none_negative(&raw.half_size_m);
    let contact = contact(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, &raw.friction, problems);
    Some((Vector3::from(centre?), Vector3::from(half?), contact?))
}

/// Centre and radius.
fn sphere(raw: &raw::Sphere, problems: &mut Problems<'_>) -> Option<(Vector3<f64>, f64, Contact)> {
    let centre = problems.all_finite(&raw.centre_m);
    let radius = problems.within(&raw.radius_m, MIN_RADIUS..=MAX_RADIUS);
    let contact = contact(&raw.stiffness_n_per_m, &raw.damping_ns_per_m, &raw.friction, problems);
    Some((Vector3::from(centre?), radius?, contact?))
}

/// A surface.
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
