//! Sections and keys of the dual-peg experiment's file; only their types are checked.

use config::section::sections;
use config::value::Value;
use toml_input::List;

sections! {
    /// Root table of the file.
    DualPegFile {
        hand_controller: Value<String>,
        robot: Value<String>,
        operators: Value<Vec<String>>,
        trials: Value<u32>,
        max_seconds: Value<f64>,
        pegs: Pegs,
        holes: Holes,
        contact: PegContact,
        control: PegControl,
        operator: PegOperator,
        start: PegStart,
        sweep: PegSweep,
    }

    Pegs {
        radius_m: Value<f64>,
        length_m: Value<f64>,
        spacing_m: Value<f64>,
        chamfer_m: Value<f64>,
    }

    Holes {
        radius_m: Value<f64>,
        chamfer_m: Value<f64>,
        thickness_m: Value<f64>,
        insert_depth_m: Value<f64>,
    }

    PegContact {
        stiffness_n_per_m: Value<f64>,
        damping_ns_per_m: Value<f64>,
        friction: Value<f64>,
    }

    PegControl {
        wrench_gain: Value<List<f64, 2>>,
        accommodation_m_per_ns: Value<f64>,
        accommodation_rad_per_nms: Value<f64>,
        stop_force_n: Value<f64>,
        stop_moment_nm: Value<f64>,
        sensor_noise_n: Value<f64>,
        sensor_noise_nm: Value<f64>,
    }

    PegOperator {
        visual_delay_s: Value<f64>,
        visual_error_m: Value<f64>,
        visual_error_deg: Value<f64>,
        tolerance_m: Value<f64>,
        tolerance_deg: Value<f64>,
        approach_m_per_s: Value<f64>,
        insert_m_per_s: Value<f64>,
        near_m: Value<f64>,
        correction_per_s: Value<f64>,
        max_correction_m_per_s: Value<f64>,
        max_turn_deg_per_s: Value<f64>,
        effort_per_s: Value<f64>,
        stall_m: Value<f64>,
        stall_s: Value<f64>,
        back_off_m: Value<f64>,
        search_m: Value<f64>,
    }

    PegStart {
        height_m: Value<f64>,
        misalignment_m: Value<List<f64, 2>>,
        misalignment_deg: Value<List<f64, 2>>,
    }

    PegSweep {
        visual_error_m: Value<Vec<f64>>,
        misalignment_m: Value<Vec<f64>>,
        trials: Value<u32>,
    }
}
