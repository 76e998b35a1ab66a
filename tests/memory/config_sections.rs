//! Sections of a configuration: what their keys lead to, and which of their values are refused.

use crate::common::prelude::*;
use crate::common::refusals::{are_refused, with_value};
use crate::config::shipped;
use controller::JointVector;
#[test]
fn promise_02_heartbeat_shorter_than_its_cycle_is_refused() {
    let slow = [
        ("sync_period_us = 1000", "sync_period_us = 10000"),
        ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 30 "),
    ];
    for (heartbeat, lost, reasons) in [
        (
            1,
            2,
            [
                "node.heartbeat_ms: must be at least the cycle that sends it, 10000 µs",
                "safety.node_lost_ms: ",
            ],
        ),
        (5, 10, ["node.heartbeat_ms: ", "which leave every 1 cycles: 20000 µs, got 10 ms"]),
        (
            12,
            30,
            ["safety.node_lost_ms: must be at least two", "every 2 cycles: 40000 µs, got 30 ms"],
        ),
    ] {
        let text = changed(KRAFT_TEXT, &slow);
        let text = text.replacen("heartbeat_ms = 5 ", &format!("heartbeat_ms = {heartbeat} "), 1);
        let text = text.replacen("heartbeat_ms = 5\n", &format!("heartbeat_ms = {heartbeat}\n"), 1);
        let text = text.replacen("node_lost_ms = 22 ", &format!("node_lost_ms = {lost} "), 1);
        let refusal = refusal(KRAFT, &text);
        for reason in reasons {
            assert!(refusal.contains(reason), "{reason}: {refusal}");
        }
    }
}

/// Walls within the workspace, stiff enough to use up the assist.
const WALLS: &str = "[controller.walls]\nat_m = [0.02, 0.02, 0.02]\nat_rad = [1.0, 1.0, 1.0]\n\
    stiffness_n_per_m = [9000.0, 9000.0, 9000.0]\nstiffness_nm_per_rad = [0.0, 0.0, 0.0]\n\n[remote]\n";

#[test]
fn promise_03_force_cap_includes_every_source_of_force() {
    let heartbeat_only = ("rpdo_timer_ms = 5 ", "rpdo_timer_ms = 0 ");
    let weak = ("max_force_n = 40.0 ", "max_force_n = 1.0 ");
    let no_stops = ("push = 0.5 ", "push = 0.0 ");
    let no_dampers = ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 1.0");
    let strong_assist = ("assist_fraction = 0.35", "assist_fraction = 1.0");
    let plain = changed(KRAFT_TEXT, &[heartbeat_only, weak, no_stops, no_dampers, strong_assist]);
    parse(KRAFT, &plain);
    for (change, reason) in [
        (("[remote]\n", WALLS), "centring_n and walls"),
        (
            ("centring_n = [2.0, 2.0, 2.0]", "centring_n = [15.0, 15.0, 15.0]"),
            "centring_n and walls",
        ),
        (("push = 0.0 ", "push = 1.0 "), "soft_stops.push"),
        (
            ("max_damping_ns_per_m = 1.0", "max_damping_ns_per_m = 75.0"),
            "controller.passivity.max_damping_ns_per_m: ",
        ),
    ] {
        let refusal = refusal(KRAFT, &plain.replacen(change.0, change.1, 1));
        let found =
            refusal.lines().find(|line| line.contains("for the 25.0 ms until a drive stops"));
        assert!(found.is_some_and(|found| found.contains(reason)), "{reason}: {refusal}");
    }
}

#[test]
fn joint_behind_a_coupling_has_its_own_capacity_and_speed() {
    // The elbow follows its own actuator, and twice the second one in the other direction.
    let coupling = "[coupling]\nmatrix = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, -2, 1, 0, 0, 0], \
        [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n\n[switches]\n";
    let config = parse(KRAFT, &changed(KRAFT_TEXT, &[("[switches]\n", coupling)]));
    let stops = config.controller.extensions.soft_stops.unwrap();
    let mut q = config.joints.each_ref().map(|joint| joint.plant.start);
    q[2] = config.joints[2].plant.link.range[1];
    let tau = stops.torques(&q.into(), &JointVector::zeros());
    // Half of the capacity: 6 N·m of the second actuator at a ratio of 2 is less than 4 N·m of the third.
    assert!((tau[2] + 1.5).abs() < 1e-9, "{tau}");
    let speed_of = |config: &Config, joint: usize| {
        let (_, plan) = &config.node_plans()[joint];
        let limit =
            plan.writes().into_iter().find(|(object, _)| *object == Object::MAX_MOTOR_SPEED);
        format!("{:?}", limit.unwrap().1)
    };
    let plain = parse(KRAFT, KRAFT_TEXT);
    assert_eq!(speed_of(&config, 1), speed_of(&plain, 1));
    assert_ne!(speed_of(&config, 2), speed_of(&plain, 2), "the third actuator may turn faster");
}

#[test]
fn tank_damper_beyond_the_stable_maximum_is_refused() {
    let tank = |more: &str| {
        let tank = format!(
            "[controller.tank]\ninitial_j = 0.1\nmin_j = 0.0\nlow_j = 0.02\nmax_j = 0.5\n\
             refill_ns_per_m_per_j = 2000.0\n{more}\n[remote]\n"
        );
        let heavy = ("[safety]\n", "[safety]\neffective_mass_kg = 3.0\n");
        let weak = ("max_damping_ns_per_m = 75.0", "max_damping_ns_per_m = 60.0");
        changed(KRAFT_TEXT, &[weak, ("[remote]\n", &tank), heavy])
    };
    let config = parse(KRAFT, &tank(""));
    assert!(config.findings().iter().any(|finding| finding.name == "tank, damper"));
    let refusal = refusal(KRAFT, &tank("max_damping_ns_per_m = 600.0\n"));
    assert!(refusal.contains("controller.tank.max_damping_ns_per_m: tank, damper, "), "{refusal}");
}

/// Returns [`KRAFT_TEXT`] with these lines in the boot section of the switch box or of the last joint.
fn with_boot(of: &str, lines: &str) -> String {
    let (before, after) = KRAFT_TEXT.split_once("\n[switches]\n").unwrap();
    if of == "joint" {
        return format!("{before}\n[joint.boot]\n{lines}\n\n[switches]\n{after}");
    }
    KRAFT_TEXT.replacen(
        "\n[controller]\n",
        &format!("\n[switches.boot]\n{lines}\n\n[controller]\n"),
        1,
    )
}

#[test]
fn invalid_boot_settings_are_refused_by_key() {
    let long = "\"0123456789012345678901234567890123456789\"";
    let reason = format!("{long} is longer than 32 bytes");
    let guarding = with_boot("switches", "guard_time_ms = 50\nlife_time_factor = 2");
    let rows = [
        ("joint[5].boot.optional", "true", "an arm has all its joints"),
        ("joint[5].boot.keep_alive", "true", "what can push always begins anew"),
        ("joint[5].boot.revisions", "\"newer\"", ""),
        ("switches.boot.guard_time_ms", "0", ""),
        ("switches.boot.life_time_factor", "9", "450 ms in all: more than safety.drive_lost_ms"),
        ("switches.boot.serial_number", "1", "unknown key"),
        ("switches.boot.software_version", long, &reason),
    ];
    are_refused(KRAFT, &guarding, &rows);
    let rows = [
        ("switches.boot.guard_time_ms", "5", "needs a life_time_factor beside it"),
        ("switches.boot.life_time_factor", "5", "needs a guard_time_ms beside it"),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
}

/// Returns [`KRAFT_TEXT`] with these lines in the simulation section of its first joint.
fn with_simulated(lines: &str) -> String {
    let (first, rest) = KRAFT_TEXT.split_once("\n[[joint]]\nname = \"elevation\"").unwrap();
    format!("{first}\n[joint.simulated]\n{lines}\n\n[[joint]]\nname = \"elevation\"{rest}")
}

#[test]
fn invalid_simulated_drivetrain_is_refused_by_key() {
    let rows = [
        ("joint[0].simulated.current_loop_us", "-1.0", "must be within 0..=10000, got -1"),
        ("joint[0].simulated.current_loop_us", "nan", "must be within 0..=10000, got NaN"),
        ("joint[0].simulated.backlash_deg", "11.0", "must be within 0..=10, got 11"),
        ("joint[0].simulated.backlash_m", "0.001", "a revolute joint has `backlash_deg`"),
        ("joint[0].simulated.hysteresis_n", "0.1", "a revolute joint has"),
        ("joint[0].simulated.hysteresis_nm", "7.0", "must be within 0..=6, got 7"),
        ("joint[0].simulated.thermal_time_constant_s", "0", "must be within 0.1..=36000, got 0"),
        ("joint[0].simulated.torque_curve_reverse", "[1.0, -9.0, 0.0]", ""),
        ("joint[0].simulated.backlash", "0.1", "unknown key"),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
}

#[test]
fn drivetrain_without_settings_has_the_defaults() {
    let lines = "current_loop_us = 300.0\nbacklash_deg = 0.2\nhysteresis_nm = 0.03\n\
        thermal_time_constant_s = 12.5\ntorque_curve_reverse = [130.0, 0.0, 0.0]";
    let config = parse(KRAFT, &with_simulated(lines));
    let ([first, second, ..], default) = (&config.joints, &config.joints[5].plant.drivetrain);
    let simulated = &first.plant.drivetrain;
    assert!((simulated.current_loop - 300e-6).abs() < 1e-12);
    assert!((simulated.backlash - 0.2_f64.to_radians()).abs() < 1e-12);
    assert_eq!((simulated.hysteresis, simulated.thermal_time_constant), (0.03, 12.5));
    assert_eq!(simulated.torque_curve_reverse, Some([130.0, 0.0, 0.0]));
    assert_eq!(&second.plant.drivetrain, default);
    assert!((default.current_loop - 200e-6).abs() < 1e-12);
    assert_eq!(
        (default.backlash, default.hysteresis, default.torque_curve_reverse),
        (0.0, 0.0, None)
    );
}

#[test]
fn sync_counter_is_configured_in_every_drive() {
    let text =
        KRAFT_TEXT.replacen("[node]\n", "[node]\nsync_counter = 240\ntime_period_ms = 1000\n", 1);
    let text = text.replace("load_limit_percent = 90", "load_limit_percent = 91");
    let config = parse(KRAFT, &text);
    assert_eq!((config.sync_counter, config.time_period.unwrap().as_millis()), (Some(240), 1_000));
    let counting = config.node_plans().into_iter().filter(|(_, plan)| {
        plan.writes().iter().any(|(object, _)| *object == Object::SYNC_OVERFLOW)
    });
    assert_eq!(counting.count(), 6);
    let plain = parse(KRAFT, KRAFT_TEXT);
    assert!((config.loads()[0].used - plain.loads()[0].used - 10.0).abs() < 1e-9);
    let rows = [
        ("node.sync_counter", "1", "must be within 2..=240, got 1"),
        ("node.time_period_ms", "5", "must be within 10..=3600000, got 5"),
    ];
    are_refused(KRAFT, KRAFT_TEXT, &rows);
}

#[test]
fn boot_settings_are_in_the_plan_of_their_node() {
    let lines = "revisions = \"compatible\"\nserial = 7\nsoftware_version = \"0.1.0\"\n\
                 guard_time_ms = 80\nlife_time_factor = 3\noptional = true\nkeep_alive = true";
    let text = with_boot("switches", lines);
    let text = text.replacen("[node]\n", "[node]\nstore_configuration = true\n", 1);
    let config = parse(KRAFT, &text);
    let (_, plan) = config.node_plans().pop().unwrap();
    assert!(plan.is_optional && plan.keep_alive && plan.stores_configuration);
    assert_eq!(plan.admission.serial, Some(7));
    assert_eq!(plan.admission.software.unwrap().as_bytes(), b"0.1.0");
    assert_eq!(plan.error_control.lost_after(), Duration::from_millis(240));
}

#[test]
fn remote_environment_accepts_friction_and_a_sphere() {
    let plain = parse(KRAFT, KRAFT_TEXT);
    assert!(plain.remote.sphere.is_none());
    assert_eq!(plain.remote.wall.map(|(.., contact)| contact.friction), Some(0.0));
    let sphere = "[remote.sphere]\ncentre_m = [0.4, -0.2, 0.3]\nradius_m = 0.08\n\
                  stiffness_n_per_m = 1500.0\ndamping_ns_per_m = 10.0\nfriction = 0.4\n\n";
    let text = KRAFT_TEXT.replacen("[safety]", &format!("{sphere}[safety]"), 1);
    let config = parse(KRAFT, &text);
    let (centre, radius, contact) = config.remote.sphere.unwrap();
    assert_eq!((centre.y, radius, contact.friction), (-0.2, 0.08, 0.4));
    let rows = [
        ("remote.sphere.radius_m", "0.01", "must be within 0.03..=10, got 0.01"),
        ("remote.sphere.friction", "-0.4", "must be within 0..=2, got -0.4"),
        ("remote.sphere.friction", "nan", "must be within 0..=2, got NaN"),
        ("remote.sphere.frictoin", "0.4", "unknown key"),
        ("remote.box.friction", "3.0", "must be within 0..=2, got 3"),
    ];
    are_refused(KRAFT, &text, &rows);
    let missing = refusal(KRAFT, &text.replacen("radius_m = 0.08\n", "", 1));
    assert!(missing.starts_with(&format!("{KRAFT}:")), "{missing}");
    assert!(missing.contains("missing field `radius_m`"), "{missing}");
}

#[test]
fn hazard_18_invalid_adjustments_are_refused_by_key() {
    let bounds = "must be [low, high] with low within 0..=1 and high within 1..=10, got [0.5, 0.9]";
    let button = format!("{KRAFT_TEXT}\n[[switches.button]]\nbit = 4\npress = \"align\"\n");
    let (press, more) =
        ("switches.button[0].press", "expected \"scale motion|rotation|force FACTOR\"");
    let rows = [
        ("controller.scale.motion", "[0.5, 0.9]", bounds),
        ("controller.scale.rotation", "[-0.1, 1.0]", "must be"),
        ("controller.scale.force", "[nan, 1.0]", "must be"),
        ("controller.scale.force", "[0.0, inf]", "must be"),
        ("controller.scale.motion", "[0.5]", "must be a list of 2, got 1"),
        ("controller.scale.speed", "[0.5, 1.0]", "unknown key"),
        ("switches.button[0].bit", "3", "must be within 4..=7, got 3"),
        (press, "\"arm\"", more),
        (press, "\"lock rz off\"", "a press locks and releases in turn"),
    ];
    are_refused(KRAFT, &button, &rows);
    // Ten times the wrench is more than the loop bears.
    let beyond = refusal(KRAFT, &with_value(KRAFT_TEXT, "controller.scale.force", "[0.0, 10.0]").0);
    assert!(beyond.contains("controller.scale: at motion "), "{beyond}");
    assert!(beyond.contains("force 10: "), "{beyond}");
    let twofold =
        refusal(KRAFT, &with_value(&button, "switches.button[0].press", "\"scale motion 2\"").0);
    let expected = "scale of motion must be within 0.1..=1 (controller.scale.motion), got 2";
    assert!(twofold.contains(expected), "{twofold}");
    let twice = format!("{button}[[switches.button]]\nbit = 4\npress = \"align\"\n");
    let expected = "switches.button[1].bit: another button has this bit";
    assert!(refusal(KRAFT, &twice).contains(expected), "{}", refusal(KRAFT, &twice));
    let missing = refusal(KRAFT, &button.replacen("press = \"align\"\n", "", 1));
    assert!(missing.contains("missing field `press`"), "{missing}");
}

#[test]
fn bounds_of_contact_postures_are_within_their_ranges() {
    let keys = [("min_singular_value = 0.1 ", "10"), ("max_grip_friction_n = 0.6 ", "10000")];
    for (key, most) in keys {
        let (name, _) = key.split_once(" = ").unwrap();
        for wrong in ["0.0", "-1.0", "nan", "inf", "1e300"] {
            let text = KRAFT_TEXT.replace(key, &format!("{name} = {wrong} "));
            let refusal = refusal(KRAFT, &text);
            let range = format!("arm.{name}: must be within 0.000001..={most}, got");
            assert!(refusal.contains(&range), "{refusal}");
        }
    }
}

#[test]
fn rotor_and_viscous_friction_of_a_joint_have_ranges() {
    for (key, value, range) in [
        ("rotor_inertia_kg_m2", "9e18", "0.000001..=10000"),
        ("viscous_friction_nms_per_rad", "1e300", "0..=10000"),
    ] {
        let (before, rest) = KRAFT_TEXT.split_once(&format!("{key} = ")).unwrap();
        let (_, after) = rest.split_once([' ', '\n']).unwrap();
        let refusal = refusal(KRAFT, &format!("{before}{key} = {value}\n{after}"));
        let expected = format!("joint[0].{key}: must be within {range}, got ");
        assert!(refusal.contains(&expected), "{refusal}");
    }
}

#[test]
fn wall_of_each_shipped_file_is_met_in_a_good_posture() {
    for file in shipped() {
        let config = config(&file);
        let posture = config.wall_contact().unwrap().posture.unwrap();
        assert!(posture.friction_n <= 0.6 && posture.sigma_min >= 0.1, "{file}: {posture:?}");
        assert!(config.contact_bounds.permit(&posture), "{file}");
    }
}

#[test]
fn wall_beyond_the_reach_has_no_posture() {
    let text = KRAFT_TEXT.replace("point_m = [0.47,", "point_m = [0.8,");
    let config = parse(KRAFT, &text);
    assert!(config.wall_contact().unwrap().posture.is_err());
    let touching = KRAFT_TEXT.replace("point_m = [0.47,", "point_m = [0.42,");
    let config = parse(KRAFT, &touching);
    assert_eq!((config.wall_contact(), config.wall_depth_at_start()), (None, None));
    let inside = KRAFT_TEXT.replace("point_m = [0.47,", "point_m = [0.30,");
    let config = parse(KRAFT, &inside);
    assert_eq!(config.wall_contact(), None);
    assert!((config.wall_depth_at_start().unwrap() - 0.12).abs() < 1e-9);
}
