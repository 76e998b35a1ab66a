//! `[remote]`: the commanded side. Today a virtual object, and what it can touch: a wall, a box, a
//! sphere.

use nalgebra::Isometry3;
use nalgebra::Translation3;
use nalgebra::Unit;
use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

use crate::problem::Problems;
use crate::raw;
use remote::site::Contact;
use remote::site::Virtual;
use robot::accommodation::Accommodation;
use robot::object::Servo;
use robot::payload::Payload;

/// No coefficient of friction is higher: rubber on rubber is below.
const ROUGHEST: f64 = 2.0;

/// The object touches with the corners of a cube of 4 cm; a smaller sphere slips in between, in m.
const SMALLEST: f64 = 0.03;

/// No sphere is larger, in m: a larger one is a wall.
const LARGEST: f64 = 10.0;

/// `None` where a problem has been noted.
pub(super) fn settings(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Virtual> {
    let remote = &raw.remote;
    if remote.kind != "virtual" {
        problems.add("remote.kind", format_args!("\"{}\": there is \"virtual\"", remote.kind));
    }
    let start = problems.all_finite("remote.start_m", remote.start_m.0);
    let turned = problems.all_finite("remote.start_deg", remote.start_deg.0).map(f64::to_radians);
    let sensor = problems.all_finite("remote.sensor_m", remote.sensor_m.0);
    let before = problems.count();
    let linear =
        problems.not_negative("remote.accommodation_m_per_ns", remote.accommodation_m_per_ns);
    let angular =
        problems.not_negative("remote.accommodation_rad_per_nms", remote.accommodation_rad_per_nms);
    let gain = [linear, linear, linear, angular, angular, angular];
    // The virtual sensor has no bias, so nothing need go unnoticed.
    let accommodation = Accommodation::new(gain, [0.0; 6]);
    let key = "remote.accommodation_m_per_ns";
    let accommodation = problems.take_unless_noted(before, key, accommodation);

    let before = problems.count();
    let servo = Servo::new(
        problems.not_negative("remote.servo_time_constant_s", remote.servo_time_constant_s),
        problems.positive("remote.max_speed_m_per_s", remote.max_speed_m_per_s),
        problems.positive("remote.max_turn_rad_per_s", remote.max_turn_rad_per_s),
    );
    let servo = problems.take_unless_noted(before, "remote.servo_time_constant_s", servo);

    let before = problems.count();
    let mass = problems.not_negative("remote.mass_kg", remote.mass_kg);
    let centre = problems.all_finite("remote.centre_of_mass_m", remote.centre_of_mass_m.0);
    let payload = Payload::new(mass, centre);
    let payload = problems.take_unless_noted(before, "remote.mass_kg", payload);
    Some(Virtual {
        x_b_m: Isometry3::from_parts(
            Translation3::from(start),
            UnitQuaternion::from_euler_angles(turned[0], turned[1], turned[2]),
        ),
        x_m_s: Isometry3::translation(sensor[0], sensor[1], sensor[2]),
        payload: payload?,
        servo: servo?,
        accommodation: accommodation?,
        wall: remote.wall.as_ref().map(|raw| wall(raw, problems)),
        block: remote.block.as_ref().map(|raw| block(raw, problems)),
        sphere: remote.sphere.as_ref().map(|raw| sphere(raw, problems)),
    })
}

fn wall(
    raw: &raw::Wall,
    problems: &mut Problems<'_>,
) -> (Vector3<f64>, Unit<Vector3<f64>>, Contact) {
    let point = problems.all_finite("remote.wall.point_m", raw.point_m.0);
    let normal = problems.all_finite("remote.wall.normal", raw.normal.0);
    let normal = Unit::try_new(Vector3::from(normal), 1e-6);
    if normal.is_none() {
        problems.add("remote.wall.normal", "has no direction");
    }
    let yields = [raw.stiffness_n_per_m, raw.damping_ns_per_m, raw.friction];
    let contact = contact("remote.wall", yields, problems);
    (Vector3::from(point), normal.unwrap_or(Vector3::x_axis()), contact)
}

fn block(raw: &raw::Block, problems: &mut Problems<'_>) -> (Vector3<f64>, Vector3<f64>, Contact) {
    let centre = problems.all_finite("remote.box.centre_m", raw.centre_m.0);
    let half = problems.none_negative("remote.box.half_size_m", raw.half_size_m.0);
    let yields = [raw.stiffness_n_per_m, raw.damping_ns_per_m, raw.friction];
    (Vector3::from(centre), Vector3::from(half), contact("remote.box", yields, problems))
}

fn sphere(raw: &raw::Sphere, problems: &mut Problems<'_>) -> (Vector3<f64>, f64, Contact) {
    let centre = problems.all_finite("remote.sphere.centre_m", raw.centre_m.0);
    let radius = problems.within("remote.sphere.radius_m", raw.radius_m, SMALLEST..=LARGEST);
    let yields = [raw.stiffness_n_per_m, raw.damping_ns_per_m, raw.friction];
    (Vector3::from(centre), radius, contact("remote.sphere", yields, problems))
}

/// The surface of what stands in `table`: its stiffness, damping and friction.
fn contact(
    table: &str,
    [stiffness, damping, friction]: [f64; 3],
    problems: &mut Problems<'_>,
) -> Contact {
    Contact {
        stiffness: problems.positive(&format!("{table}.stiffness_n_per_m"), stiffness),
        damping: problems.not_negative(&format!("{table}.damping_ns_per_m"), damping),
        friction: problems.within(&format!("{table}.friction"), friction, 0.0..=ROUGHEST),
    }
}
