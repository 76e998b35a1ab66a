//! The configuration file as it is written: sections and keys, nothing checked but their types.

use serde::Deserialize;

use written::List;

/// A whole file.
#[derive(Debug, Deserialize)]
pub(super) struct File {
    pub(super) node: Node,
    pub(super) bus: Vec<Bus>,
    pub(super) arm: Arm,
    pub(super) joint: Vec<Joint>,
    pub(super) coupling: Option<Coupling>,
    pub(super) switches: Switches,
    pub(super) controller: Controller,
    #[serde(default)]
    pub(super) operator: Operator,
    pub(super) remote: Remote,
    pub(super) safety: Safety,
}

#[derive(Debug, Deserialize)]
pub(super) struct Node {
    pub(super) sync_period_us: u64,
    pub(super) node_id: u8,
    pub(super) heartbeat_ms: u16,
    pub(super) socket: Option<String>,
    #[serde(default)]
    pub(super) store_configuration: bool,
    #[serde(default)]
    pub(super) restore_defaults: bool,
    pub(super) sync_counter: Option<u8>,
    pub(super) time_period_ms: Option<u32>,
}

/// What is unusual about one node's boot.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Boot {
    pub(super) revisions: Option<String>,
    pub(super) serial: Option<u32>,
    pub(super) software_version: Option<String>,
    pub(super) program_id: Option<u32>,
    pub(super) guard_time_ms: Option<u16>,
    pub(super) life_time_factor: Option<u8>,
    #[serde(default)]
    pub(super) optional: bool,
    #[serde(default)]
    pub(super) keep_alive: bool,
}

#[derive(Debug, Deserialize)]
pub(super) struct Bus {
    pub(super) name: String,
    pub(super) interface: String,
    pub(super) bitrate: u32,
    pub(super) layout: String,
    pub(super) load_limit_percent: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Arm {
    pub(super) gravity_m_per_s2: List<f64, 3>,
    pub(super) grip_m: List<f64, 3>,
    #[serde(default)]
    pub(super) grip_rad: List<f64, 3>,
    #[serde(default)]
    pub(super) gravity_balanced: bool,
}

#[derive(Debug, Deserialize)]
pub(super) struct Coupling {
    pub(super) matrix: List<List<f64, 6>, 6>,
    #[serde(default)]
    pub(super) offset_rad_or_m: List<f64, 6>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Joint {
    pub(super) name: String,
    pub(super) kind: Option<String>,
    pub(super) bus: String,
    pub(super) node_id: u8,
    pub(super) eds: String,
    pub(super) vendor_id: u32,
    pub(super) product_code: u32,
    pub(super) revision: u32,
    pub(super) alpha_deg: f64,
    pub(super) a_m: f64,
    pub(super) d_m: f64,
    pub(super) theta_deg: f64,
    pub(super) mass_kg: f64,
    pub(super) centre_of_mass_m: List<f64, 3>,
    pub(super) inertia_kg_m2: List<f64, 6>,
    pub(super) rotor_inertia_kg_m2: Option<f64>,
    pub(super) rotor_mass_kg: Option<f64>,
    pub(super) coulomb_friction_nm: Option<f64>,
    pub(super) coulomb_friction_n: Option<f64>,
    pub(super) viscous_friction_nms_per_rad: Option<f64>,
    pub(super) viscous_friction_ns_per_m: Option<f64>,
    pub(super) limit_deg: Option<List<f64, 2>>,
    pub(super) limit_m: Option<List<f64, 2>>,
    pub(super) max_speed_rad_per_s: Option<f64>,
    pub(super) max_speed_m_per_s: Option<f64>,
    pub(super) start_deg: Option<f64>,
    pub(super) start_m: Option<f64>,
    pub(super) encoder_counts_per_rev: u32,
    pub(super) gear_ratio: f64,
    pub(super) zero_counts: i32,
    pub(super) rated_torque_nm: f64,
    pub(super) max_torque_nm: Option<f64>,
    pub(super) max_force_n: Option<f64>,
    pub(super) torque_curve: List<f64, 3>,
    pub(super) boot: Option<Boot>,
    #[serde(default)]
    pub(super) simulated: Simulated,
}

/// What a simulated motor and gear do that no controller is told of.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Simulated {
    pub(super) current_loop_us: Option<f64>,
    pub(super) torque_curve_reverse: Option<List<f64, 3>>,
    pub(super) hysteresis_nm: Option<f64>,
    pub(super) hysteresis_n: Option<f64>,
    pub(super) backlash_deg: Option<f64>,
    pub(super) backlash_m: Option<f64>,
    pub(super) thermal_time_constant_s: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Switches {
    pub(super) bus: String,
    pub(super) node_id: u8,
    pub(super) eds: String,
    pub(super) vendor_id: u32,
    pub(super) product_code: u32,
    pub(super) revision: u32,
    pub(super) boot: Option<Boot>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Controller {
    pub(super) preset: String,
    pub(super) mode: String,
    pub(super) rate_gain_per_s: List<f64, 6>,
    pub(super) pose_gain: List<f64, 6>,
    pub(super) wrench_gain: List<f64, 6>,
    pub(super) deadband_m: List<f64, 3>,
    pub(super) deadband_rad: List<f64, 3>,
    pub(super) centring_n: List<f64, 3>,
    pub(super) centring_nm: List<f64, 3>,
    pub(super) damping_ns_per_m: List<f64, 3>,
    pub(super) damping_nms_per_rad: List<f64, 3>,
    pub(super) assist_fraction: f64,
    pub(super) max_force_n: f64,
    pub(super) max_moment_nm: f64,
    pub(super) gain_check: Option<String>,
    #[serde(default)]
    pub(super) pose_deadband: bool,
    #[serde(default)]
    pub(super) velocity_filter_s: f64,
    pub(super) centring_law: Option<String>,
    pub(super) contact_fade_n: Option<f64>,
    pub(super) torque_rise_s: Option<f64>,
    #[serde(default)]
    pub(super) readings: Readings,
    pub(super) walls: Option<Walls>,
    pub(super) engagement: Option<Engagement>,
    pub(super) soft_stops: Option<SoftStops>,
    pub(super) passivity: Option<Passivity>,
    pub(super) tank: Option<Tank>,
    pub(super) virtual_coupling: Option<VirtualCoupling>,
}

/// Single readings of the paper, each over the preset's.
#[derive(Debug, Default, Deserialize)]
pub(super) struct Readings {
    pub(super) orientation: Option<String>,
    pub(super) displacement: Option<String>,
    pub(super) centring: Option<String>,
    pub(super) gravity: Option<String>,
    pub(super) scaling: Option<String>,
    pub(super) damping: Option<String>,
    pub(super) latch_on_deadman: Option<bool>,
    pub(super) task_wrench: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Walls {
    pub(super) at_m: List<f64, 3>,
    pub(super) at_rad: List<f64, 3>,
    pub(super) stiffness_n_per_m: List<f64, 3>,
    pub(super) stiffness_nm_per_rad: List<f64, 3>,
    #[serde(default)]
    pub(super) in_pose_mode: bool,
}

#[derive(Debug, Deserialize)]
pub(super) struct Engagement {
    pub(super) ramp_s: f64,
    pub(super) calm_n: Option<f64>,
    pub(super) calm_nm: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct SoftStops {
    pub(super) margin: f64,
    pub(super) push: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Passivity {
    pub(super) max_energy_j: f64,
    pub(super) max_damping_ns_per_m: f64,
    pub(super) lever_m: f64,
    pub(super) calm_n: f64,
    pub(super) calm_s: f64,
    #[serde(default = "yes")]
    pub(super) one_sided: bool,
}

#[derive(Debug, Deserialize)]
pub(super) struct Tank {
    pub(super) initial_j: f64,
    pub(super) min_j: f64,
    pub(super) low_j: f64,
    pub(super) max_j: f64,
    pub(super) refill_ns_per_m_per_j: f64,
    pub(super) max_damping_ns_per_m: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct VirtualCoupling {
    pub(super) stiffness_n_per_m: List<f64, 3>,
    pub(super) stiffness_nm_per_rad: List<f64, 3>,
    pub(super) damping_ns_per_m: List<f64, 3>,
    pub(super) damping_nms_per_rad: List<f64, 3>,
}

const fn yes() -> bool {
    true
}

#[derive(Debug, Default, Deserialize)]
pub(super) struct Operator {
    pub(super) stiffness_n_per_m: Option<f64>,
    pub(super) damping_ns_per_m: Option<f64>,
    pub(super) stiffness_nm_per_rad: Option<f64>,
    pub(super) damping_nms_per_rad: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Remote {
    pub(super) kind: String,
    pub(super) start_m: List<f64, 3>,
    #[serde(default)]
    pub(super) start_deg: List<f64, 3>,
    pub(super) sensor_m: List<f64, 3>,
    pub(super) mass_kg: f64,
    pub(super) centre_of_mass_m: List<f64, 3>,
    pub(super) servo_time_constant_s: f64,
    pub(super) max_speed_m_per_s: f64,
    pub(super) max_turn_rad_per_s: f64,
    pub(super) accommodation_m_per_ns: f64,
    pub(super) accommodation_rad_per_nms: f64,
    pub(super) wall: Option<Wall>,
    #[serde(rename = "box")]
    pub(super) block: Option<Block>,
    pub(super) sphere: Option<Sphere>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Wall {
    pub(super) point_m: List<f64, 3>,
    pub(super) normal: List<f64, 3>,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_ns_per_m: f64,
    #[serde(default)]
    pub(super) friction: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Block {
    pub(super) centre_m: List<f64, 3>,
    pub(super) half_size_m: List<f64, 3>,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_ns_per_m: f64,
    #[serde(default)]
    pub(super) friction: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sphere {
    pub(super) centre_m: List<f64, 3>,
    pub(super) radius_m: f64,
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_ns_per_m: f64,
    #[serde(default)]
    pub(super) friction: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct Safety {
    pub(super) rpdo_timer_ms: u16,
    pub(super) node_lost_ms: u16,
    pub(super) drive_heartbeat_ms: u16,
    pub(super) drive_lost_ms: u16,
    pub(super) missing_samples: u32,
    pub(super) gravity_ramp_s: f64,
    pub(super) reflection_ramp_s: f64,
    pub(super) max_joint_speed_rad_per_s: Option<f64>,
    pub(super) max_joint_speed_m_per_s: Option<f64>,
    pub(super) max_grip_speed_m_per_s: Option<f64>,
    pub(super) limit_margin_rad: Option<f64>,
    pub(super) limit_margin_m: Option<f64>,
    pub(super) torque_tolerance_per_mille: Option<u16>,
    pub(super) torque_differs_ms: Option<u64>,
    pub(super) frozen_ms: Option<u64>,
    pub(super) max_missing_percent: Option<u32>,
    #[serde(default = "yes")]
    pub(super) prove_drives: bool,
    #[serde(default = "one_kilogram")]
    pub(super) effective_mass_kg: f64,
}

const fn one_kilogram() -> f64 {
    1.0
}

/// Three linear and three angular numbers as one six-vector.
pub(super) const fn six([x, y, z]: [f64; 3], [about_x, about_y, about_z]: [f64; 3]) -> [f64; 6] {
    [x, y, z, about_x, about_y, about_z]
}
