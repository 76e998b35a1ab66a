//! Sections and keys of a robot file, checked for their types only.

use crate::section::{OrEmpty, Sections, sections};
use crate::value::{Optional, Value};
use toml_input::List;

sections! {
    /// Root of a robot file.
    RobotFile {
        name: Value<String>,
        base_m: Value<List<f64, 3>>,
        base_deg: Optional<List<f64, 3>>,
        tool_m: Value<List<f64, 3>>,
        tool_deg: Optional<List<f64, 3>>,
        resolved_rate: OrEmpty<ResolvedRate>,
        joint: Sections<RobotJoint>,
    }

    ResolvedRate {
        damped_below: Optional<f64>,
        length_m: Optional<f64>,
        centring_per_s: Optional<f64>,
    }

    RobotJoint {
        alpha_deg: Value<f64>,
        a_m: Value<f64>,
        d_m: Value<f64>,
        theta_deg: Optional<f64>,
        start_deg: Value<f64>,
        limit_deg: Value<List<f64, 2>>,
        max_rate_deg_per_s: Value<f64>,
        max_acceleration_deg_per_s2: Value<f64>,
        mass_kg: Value<f64>,
        centre_of_mass_m: Value<List<f64, 3>>,
        inertia_kg_m2: Value<List<f64, 6>>,
        rotor_inertia_kg_m2: Value<f64>,
        max_torque_nm: Value<f64>,
        coulomb_friction_nm: Optional<f64>,
        viscous_friction_nms_per_rad: Optional<f64>,
    }
}
