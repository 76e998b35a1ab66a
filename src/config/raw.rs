//! Sections and keys of a configuration file, checked for their types only.

use crate::raw_gripper::{RemoteGripper, SwitchesGripper};
use crate::section::{OrEmpty, Sections, sections};
use crate::value::{Optional, Value};
use toml_input::List;

sections! {
    /// Root of a configuration file.
    File {
        node: Node,
        bus: Sections<Bus>,
        arm: Arm,
        joint: Sections<Joint>,
        coupling: Option<Coupling>,
        switches: Option<Switches>,
        controller: Controller,
        operator: OrEmpty<Operator>,
        remote: Remote,
        safety: Safety,
    }

    Node {
        sync_period_us: Value<u64>,
        node_id: Value<u8>,
        heartbeat_ms: Value<u16>,
        socket: Optional<String>,
        telemetry_socket: Optional<String>,
        store_configuration: Optional<bool>,
        restore_defaults: Optional<bool>,
        sync_counter: Optional<u8>,
        time_period_ms: Optional<u32>,
    }

    /// Boot of one node, where it differs from the defaults.
    Boot {
        revisions: Optional<String>,
        serial: Optional<u32>,
        software_version: Optional<String>,
        program_id: Optional<u32>,
        guard_time_ms: Optional<u16>,
        life_time_factor: Optional<u8>,
        optional: Optional<bool>,
        keep_alive: Optional<bool>,
        reply_ms: Optional<u32>,
        boot_ms: Optional<u32>,
        mode_shown: Optional<String>,
        write: Option<Sections<BootWrite>>,
    }

    /// SDO download that precedes those of the plan.
    BootWrite {
        object: Value<String>,
        value: Value<i64>,
    }

    /// Torque limit of a drive in place of 6072h.
    TorqueLimit {
        object: Optional<String>,
        value: Optional<i64>,
        makers_tool_per_mille: Optional<f64>,
        makers_tool_ma: Optional<f64>,
    }

    Bus {
        name: Value<String>,
        interface: Value<String>,
        bitrate: Value<u32>,
        layout: Value<String>,
        load_limit_percent: Value<f64>,
    }

    Arm {
        gravity_m_per_s2: Value<List<f64, 3>>,
        grip_m: Value<List<f64, 3>>,
        grip_rad: Optional<List<f64, 3>>,
        gravity_balanced: Optional<bool>,
        min_singular_value: Optional<f64>,
        max_grip_friction_n: Optional<f64>,
    }

    Coupling {
        matrix: Value<List<List<f64, 6>, 6>>,
        offset_rad_or_m: Optional<List<f64, 6>>,
    }

    Joint {
        name: Value<String>,
        kind: Optional<String>,
        bus: Value<String>,
        node_id: Value<u8>,
        eds: Value<String>,
        vendor_id: Value<u32>,
        product_code: Value<u32>,
        revision: Value<u32>,
        alpha_deg: Value<f64>,
        a_m: Value<f64>,
        d_m: Value<f64>,
        theta_deg: Value<f64>,
        mass_kg: Value<f64>,
        centre_of_mass_m: Value<List<f64, 3>>,
        inertia_kg_m2: Value<List<f64, 6>>,
        rotor_inertia_kg_m2: Optional<f64>,
        rotor_mass_kg: Optional<f64>,
        coulomb_friction_nm: Optional<f64>,
        coulomb_friction_n: Optional<f64>,
        viscous_friction_nms_per_rad: Optional<f64>,
        viscous_friction_ns_per_m: Optional<f64>,
        limit_deg: Optional<List<f64, 2>>,
        limit_m: Optional<List<f64, 2>>,
        max_speed_rad_per_s: Optional<f64>,
        max_speed_m_per_s: Optional<f64>,
        start_deg: Optional<f64>,
        start_m: Optional<f64>,
        rest_deg: Optional<f64>,
        rest_m: Optional<f64>,
        rest_tolerance_deg: Optional<f64>,
        rest_tolerance_m: Optional<f64>,
        second_rest_deg: Optional<f64>,
        second_rest_m: Optional<f64>,
        zero: Optional<String>,
        unique_turns: Optional<f64>,
        homing_method: Optional<i8>,
        homing_s: Optional<f64>,
        referenced_bit: Optional<u8>,
        keeps_position_over_82h: Optional<bool>,
        encoder_counts_per_rev: Value<u32>,
        gear_ratio: Value<f64>,
        zero_counts: Optional<i32>,
        rated_torque_nm: Value<f64>,
        max_torque_nm: Optional<f64>,
        max_force_n: Optional<f64>,
        torque_curve: Value<List<f64, 3>>,
        rated_torque_unit: Optional<String>,
        rated_current_a: Optional<f64>,
        drive_polarity: Optional<u8>,
        drive_encoder: Optional<List<u32, 2>>,
        drive_gear: Optional<List<u32, 2>>,
        drive_feed: Optional<List<u32, 2>>,
        drive_position_unit: Optional<u32>,
        drive_modes: Optional<u32>,
        accept_stated_only: Optional<Vec<String>>,
        emcy_warnings: Optional<Vec<u16>>,
        torque_limit: Option<TorqueLimit>,
        boot: Option<Boot>,
        simulated: OrEmpty<Simulated>,
    }

    /// Imperfections of a simulated motor and gear.
    Simulated {
        current_loop_us: Optional<f64>,
        torque_curve_reverse: Optional<List<f64, 3>>,
        stiction_nm: Optional<f64>,
        stiction_n: Optional<f64>,
        hysteresis_nm: Optional<f64>,
        hysteresis_n: Optional<f64>,
        backlash_deg: Optional<f64>,
        backlash_m: Optional<f64>,
        thermal_time_constant_s: Optional<f64>,
    }

    Switches {
        bus: Value<String>,
        node_id: Value<u8>,
        eds: Value<String>,
        vendor_id: Value<u32>,
        product_code: Value<u32>,
        revision: Value<u32>,
        deadman_at: Optional<String>,
        boot: Option<Boot>,
        button: Option<Sections<Button>>,
        gripper: Option<SwitchesGripper>,
    }

    /// Button of the switch box, and the adjustment that a press makes.
    Button {
        bit: Value<u8>,
        press: Value<String>,
    }

    Controller {
        preset: Value<String>,
        mode: Value<String>,
        rate_gain_per_s: Value<List<f64, 6>>,
        pose_gain: Value<List<f64, 6>>,
        wrench_gain: Value<List<f64, 6>>,
        deadband_m: Value<List<f64, 3>>,
        deadband_rad: Value<List<f64, 3>>,
        centring_n: Value<List<f64, 3>>,
        centring_nm: Value<List<f64, 3>>,
        damping_ns_per_m: Value<List<f64, 3>>,
        damping_nms_per_rad: Value<List<f64, 3>>,
        assist_fraction: Value<f64>,
        max_force_n: Value<f64>,
        max_moment_nm: Value<f64>,
        gain_check: Optional<String>,
        pose_deadband: Optional<bool>,
        velocity_filter_s: Optional<f64>,
        damping_never_pulls: Optional<bool>,
        centring_law: Optional<String>,
        contact_fade_n: Optional<f64>,
        torque_rise_s: Optional<f64>,
        readings: OrEmpty<Readings>,
        walls: Option<Walls>,
        engagement: Option<Engagement>,
        soft_stops: Option<SoftStops>,
        friction: Option<FrictionCompensation>,
        passivity: Option<Passivity>,
        tank: Option<Tank>,
        virtual_coupling: Option<VirtualCoupling>,
        scale: OrEmpty<Scale>,
    }

    /// Bounds of the scales that are set while running, `[low, high]` each.
    Scale {
        motion: Optional<List<f64, 2>>,
        rotation: Optional<List<f64, 2>>,
        force: Optional<List<f64, 2>>,
    }

    /// Interpretations of the paper that override the preset.
    Readings {
        orientation: Optional<String>,
        displacement: Optional<String>,
        centring: Optional<String>,
        gravity: Optional<String>,
        scaling: Optional<String>,
        damping: Optional<String>,
        latch_on_deadman: Optional<bool>,
        task_wrench: Optional<String>,
    }

    Walls {
        at_m: Value<List<f64, 3>>,
        at_rad: Value<List<f64, 3>>,
        stiffness_n_per_m: Value<List<f64, 3>>,
        stiffness_nm_per_rad: Value<List<f64, 3>>,
        in_pose_mode: Optional<bool>,
    }

    Engagement {
        ramp_s: Value<f64>,
        wait_below_n: Optional<f64>,
        wait_below_nm: Optional<f64>,
    }

    SoftStops {
        margin: Value<f64>,
        push: Value<f64>,
    }

    FrictionCompensation {
        share: Value<f64>,
        presliding_rad: Optional<f64>,
        presliding_m: Optional<f64>,
    }

    Passivity {
        max_energy_j: Value<f64>,
        max_damping_ns_per_m: Value<f64>,
        lever_m: Value<f64>,
        contact_threshold_n: Value<f64>,
        contact_release_s: Value<f64>,
        one_sided: Optional<bool>,
    }

    Tank {
        initial_j: Value<f64>,
        min_j: Value<f64>,
        low_j: Value<f64>,
        max_j: Value<f64>,
        refill_ns_per_m_per_j: Value<f64>,
        max_damping_ns_per_m: Optional<f64>,
    }

    VirtualCoupling {
        stiffness_n_per_m: Value<List<f64, 3>>,
        stiffness_nm_per_rad: Value<List<f64, 3>>,
        damping_ns_per_m: Value<List<f64, 3>>,
        damping_nms_per_rad: Value<List<f64, 3>>,
    }

    Operator {
        stiffness_n_per_m: Optional<f64>,
        damping_ns_per_m: Optional<f64>,
        stiffness_nm_per_rad: Optional<f64>,
        damping_nms_per_rad: Optional<f64>,
    }

    Remote {
        kind: Value<String>,
        robot: Optional<String>,
        start_m: Optional<List<f64, 3>>,
        start_deg: Optional<List<f64, 3>>,
        sensor_m: Value<List<f64, 3>>,
        sensor_deg: Optional<List<f64, 3>>,
        sensor_sign: Optional<i8>,
        sensor_bias_n: Optional<List<f64, 3>>,
        sensor_bias_nm: Optional<List<f64, 3>>,
        mass_kg: Value<f64>,
        centre_of_mass_m: Value<List<f64, 3>>,
        inertia_kg_m2: Optional<List<f64, 6>>,
        remove_inertia: Optional<bool>,
        feel_payload: Optional<bool>,
        servo_time_constant_s: Value<f64>,
        max_speed_m_per_s: Value<f64>,
        max_turn_rad_per_s: Value<f64>,
        accommodation_m_per_ns: Value<f64>,
        accommodation_rad_per_nms: Value<f64>,
        accommodation_deadband_n: Optional<f64>,
        accommodation_deadband_nm: Optional<f64>,
        shared_control: Option<SharedControl>,
        link: OrEmpty<RemoteLink>,
        wall: Option<Wall>,
        r#box: Option<Block>,
        sphere: Option<Sphere>,
        gripper: Option<RemoteGripper>,
    }

    RemoteLink {
        max_age_ms: Optional<f64>,
        delay_ms: Optional<f64>,
        jitter_ms: Optional<f64>,
        loss_percent: Optional<f64>,
        reorder: Optional<bool>,
        outage_s: Optional<List<f64, 2>>,
        hold_after_ms: Optional<f64>,
        seed: Optional<u64>,
        socket: Optional<String>,
        arm: Optional<u16>,
        round_trip_ms: Optional<f64>,
        sample_period_ms: Optional<f64>,
        sensor_range_n: Optional<f64>,
        sensor_range_nm: Optional<f64>,
        wrench_limit_n: Optional<f64>,
        wrench_limit_nm: Optional<f64>,
        stiffest_contact_n_per_m: Optional<f64>,
        model_limit_m: Optional<f64>,
        model_limit_deg: Optional<f64>,
        sensor: Option<RemoteSensor>,
    }

    RemoteSensor {
        address: Value<String>,
        counts_per_n: Value<f64>,
        counts_per_nm: Value<f64>,
        rate_hz: Optional<f64>,
    }

    SharedControl {
        operator: Value<List<f64, 6>>,
        auto_m_per_s: Optional<List<f64, 3>>,
        auto_rad_per_s: Optional<List<f64, 3>>,
    }

    Wall {
        point_m: Value<List<f64, 3>>,
        normal: Value<List<f64, 3>>,
        stiffness_n_per_m: Value<f64>,
        damping_ns_per_m: Value<f64>,
        friction: Optional<f64>,
    }

    Block {
        centre_m: Value<List<f64, 3>>,
        half_size_m: Value<List<f64, 3>>,
        stiffness_n_per_m: Value<f64>,
        damping_ns_per_m: Value<f64>,
        friction: Optional<f64>,
    }

    Sphere {
        centre_m: Value<List<f64, 3>>,
        radius_m: Value<f64>,
        stiffness_n_per_m: Value<f64>,
        damping_ns_per_m: Value<f64>,
        friction: Optional<f64>,
    }

    Safety {
        rpdo_timer_ms: Value<u16>,
        node_lost_ms: Value<u16>,
        drive_heartbeat_ms: Value<u16>,
        drive_lost_ms: Value<u16>,
        missing_samples: Value<u32>,
        gravity_ramp_s: Value<f64>,
        reflection_ramp_s: Value<f64>,
        max_joint_speed_rad_per_s: Optional<f64>,
        max_joint_speed_m_per_s: Optional<f64>,
        max_grip_speed_m_per_s: Optional<f64>,
        limit_margin_rad: Optional<f64>,
        limit_margin_m: Optional<f64>,
        torque_tolerance_per_mille: Optional<u16>,
        torque_differs_ms: Optional<u64>,
        frozen_ms: Optional<u64>,
        max_missing_percent: Optional<u32>,
        prove_drives: Optional<bool>,
        enable_ms: Optional<u32>,
        effective_mass_kg: Optional<f64>,
    }
}

/// Joins three linear and three angular components, linear first.
pub(super) const fn six([x, y, z]: [f64; 3], [about_x, about_y, about_z]: [f64; 3]) -> [f64; 6] {
    [x, y, z, about_x, about_y, about_z]
}
