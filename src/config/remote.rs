//! `[remote]`: the commanded side. Today a virtual object, a wall and a box.

use nalgebra::Isometry3;
use nalgebra::Unit;
use nalgebra::Vector3;

use crate::config::problem::Problems;
use crate::config::raw;

/// A virtual object and what it can touch.
#[derive(Clone, Debug)]
pub struct Virtual {
    /// First pose of the object in its base.
    pub x_b_m: Isometry3<f64>,
    /// Pose of the force sensor in the frame under control.
    pub x_m_s: Isometry3<f64>,
    /// Mass the sensor carries, in kg.
    pub mass: f64,
    /// Its centre in {S}, in m.
    pub centre_of_mass: [f64; 3],
    /// How fast the object follows, in s.
    pub servo_time_constant: f64,
    /// Force accommodation: six rates per contact force or moment.
    pub accommodation: [f64; 6],
    /// A plane to push against.
    pub wall: Option<(Vector3<f64>, Unit<Vector3<f64>>, Contact)>,
    /// A box to bump into: its centre and half its sides.
    pub block: Option<(Vector3<f64>, Vector3<f64>, Contact)>,
}

/// How a surface yields.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// In N/m.
    pub stiffness: f64,
    /// In N·s/m.
    pub damping: f64,
}

/// `None` where a problem has been noted.
pub(super) fn settings(raw: &raw::File, problems: &mut Problems<'_>) -> Option<Virtual> {
    let remote = &raw.remote;
    if remote.kind != "virtual" {
        problems.add("remote.kind", format_args!("\"{}\": there is \"virtual\"", remote.kind));
    }
    let start = problems.all_finite("remote.start_m", remote.start_m);
    let sensor = problems.all_finite("remote.sensor_m", remote.sensor_m);
    let linear = "remote.accommodation_m_per_ns";
    let linear = problems.not_negative(linear, remote.accommodation_m_per_ns);
    let angular = "remote.accommodation_rad_per_nms";
    let angular = problems.not_negative(angular, remote.accommodation_rad_per_nms);
    let wall = remote.wall.as_ref().map(|wall| {
        let point = problems.all_finite("remote.wall.point_m", wall.point_m);
        let normal = problems.all_finite("remote.wall.normal", wall.normal);
        let normal = Unit::try_new(Vector3::from(normal), 1e-6);
        if normal.is_none() {
            problems.add("remote.wall.normal", "has no direction");
        }
        let stiffness = "remote.wall.stiffness_n_per_m";
        let contact = Contact {
            stiffness: problems.positive(stiffness, wall.stiffness_n_per_m),
            damping: problems.not_negative("remote.wall.damping_ns_per_m", wall.damping_ns_per_m),
        };
        (Vector3::from(point), normal.unwrap_or(Vector3::x_axis()), contact)
    });
    let block = remote.block.as_ref().map(|block| {
        let centre = problems.all_finite("remote.box.centre_m", block.centre_m);
        let half = problems.none_negative("remote.box.half_size_m", block.half_size_m);
        let stiffness = "remote.box.stiffness_n_per_m";
        let contact = Contact {
            stiffness: problems.positive(stiffness, block.stiffness_n_per_m),
            damping: problems.not_negative("remote.box.damping_ns_per_m", block.damping_ns_per_m),
        };
        (Vector3::from(centre), Vector3::from(half), contact)
    });
    Some(Virtual {
        x_b_m: Isometry3::translation(start[0], start[1], start[2]),
        x_m_s: Isometry3::translation(sensor[0], sensor[1], sensor[2]),
        mass: problems.not_negative("remote.mass_kg", remote.mass_kg),
        centre_of_mass: problems.all_finite("remote.centre_of_mass_m", remote.centre_of_mass_m),
        servo_time_constant: problems
            .positive("remote.servo_time_constant_s", remote.servo_time_constant_s),
        accommodation: [linear, linear, linear, angular, angular, angular],
        wall,
        block,
    })
}
