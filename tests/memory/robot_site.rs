//! Simulated robots at the commanded side, under the control of the room `robot`.

use nalgebra::Isometry3;

use crate::common::prelude::*;
use config::robots::RobotArm;
use controller::stability::finding::Verdict;
use remote::{Command, Remote};
use robot::wrench_limit::WrenchLimit;
use sim::wrist_sensor::WristSensorSettings;
use testbench::robot_site::{Equipment, RobotSite};
use testbench::side::Side;

/// Deadband of the accommodation, in N.
const F_DB: f64 = 1.5;

const ARMS: [&str; 2] = [PUMA, "config/robots/eight_r_synthetic.toml"];

/// Returns the configuration kraft_like with an arm in place of the free object, and changes of its text.
fn config(file: &str, changes: &[(&str, &str)]) -> Config {
    parse(KRAFT, &changed(KRAFT_TEXT, changes)).with_robot(RobotArm::load(Path::new(file)).unwrap())
}

/// Commands a twist for `cycles` ms; returns the site.
fn driven(config: &Config, equipment: &Equipment, v_m: Twist, cycles: u32) -> RobotSite {
    let mut site = RobotSite::new(config, equipment, 1).unwrap();
    for cycle in 0..cycles {
        site.exchange(Instant::ZERO + Duration::from_millis(1) * cycle, &Motion::Rate(v_m).into());
    }
    site
}

/// Twist along the approach axis of {MRF}: into the wall.
fn ahead(speed: f64) -> Twist {
    Twist::from_components([0.0, 0.0, speed, 0.0, 0.0, 0.0])
}

#[test]
fn simulated_arms_press_with_the_force_of_the_law() {
    for file in ARMS {
        let config = config(file, &[]);
        let k_fa = config.remote.interaction.accommodation.gain()[2];
        let site = driven(&config, &Equipment::from_remote(&config.remote), ahead(0.06), 8_000);
        let (felt, law) = (-site.control().contact().force.z, 0.06 / k_fa);
        assert!((felt / law - 1.0).abs() < 0.01, "{file}: {felt} N, law {law} N");
    }
}

#[test]
fn hold_in_contact_returns_to_its_force() {
    for (file, step) in ARMS.into_iter().flat_map(|file| [(file, 6e-5), (file, 3e-4)]) {
        let config = config(file, &[]);
        let mut site = RobotSite::new(&config, &Equipment::from_remote(&config.remote), 1).unwrap();
        let start = *site.pose();
        let force = |site: &RobotSite| -site.arm().f_m_contact().force.z;
        let mut cycles = (0..).map(|cycle| Instant::ZERO + Duration::from_millis(1) * cycle);
        // The hand moves the object into the wall by successively deeper poses. At 0.3 m/s the arm lags by 6 mm.
        let mut depth = 0.0;
        while force(&site) < 3.0 {
            depth += step;
            let x_b_d = start * Isometry3::translation(0.0, 0.0, depth);
            site.exchange(cycles.next().unwrap(), &Motion::Pose(x_b_d).into());
        }
        for _ in 0..3_000 {
            site.exchange(cycles.next().unwrap(), &Command::HOLD);
        }
        let rest = force(&site);
        assert!((1.0..4.0).contains(&rest), "{file}, {step} m per ms: {rest} N");
    }
}

#[test]
fn new_epoch_ends_the_stop_of_an_arm_at_its_wrench_limit() {
    let config = config(ARMS[0], &[]);
    let limit = WrenchLimit { force: 2.0, moment: 1.0 };
    let equipment = Equipment { limit, ..Equipment::from_remote(&config.remote) };
    let mut site = Side::from(driven(&config, &equipment, ahead(0.06), 4_000));
    let is_stopped = |site: &Side| site.robot().unwrap().control().is_stopped();
    assert!(is_stopped(&site));
    site.begin_epoch();
    assert!(!is_stopped(&site));
}

#[test]
fn bias_of_the_sensor_shifts_the_force_by_itself() {
    let mut bias = [0.0; 6];
    bias[2] = 1.5;
    for file in ARMS {
        let config = config(file, &[]);
        let ideal = Equipment::from_remote(&config.remote);
        let sensor = WristSensorSettings { bias, ..WristSensorSettings::default() };
        let biased = Equipment { sensor, ..ideal.clone() };
        let force = |equipment: &Equipment| {
            driven(&config, equipment, ahead(0.06), 8_000).arm().f_m_contact().force.z
        };
        let shift = force(&biased) - force(&ideal);
        assert!((shift + 1.5).abs() < 0.02, "{file}: {shift} N");
    }
}

#[test]
fn known_bias_and_sign_of_the_sensor_are_removed() {
    let keys =
        "sensor_sign = -1\nsensor_bias_n = [1.0, -2.0, 3.0]\nsensor_bias_nm = [0.1, 0.0, -0.2]\n";
    let changed = config(ARMS[0], &[("[remote.wall]", &format!("{keys}[remote.wall]"))]);
    let plain = config(ARMS[0], &[]);
    let felt = |config: &Config| {
        let site = driven(config, &Equipment::from_remote(&config.remote), ahead(0.06), 6_000);
        *site.control().contact()
    };
    let difference = felt(&changed) - felt(&plain);
    assert!(difference.components().iter().all(|part| part.abs() < 1e-6), "{difference:?}");
}

#[test]
fn payload_that_would_shake_an_arm_is_warned_of() {
    let verdicts = |config: &Config| {
        let of = config.findings();
        let of = of.into_iter().filter(|finding| finding.name == "accommodation, payload");
        of.map(|finding| (finding.axis, finding.verdict)).collect::<Vec<_>>()
    };
    let (warns, holds) = (Verdict::Warns, Verdict::Holds);
    let found = verdicts(&config(ARMS[0], &[("mass_kg = 0.8", "mass_kg = 1.1")]));
    assert_eq!(found[..3], [("x", warns), ("y", warns), ("z", warns)]);
    assert!(found[3..].iter().all(|(_, verdict)| *verdict == holds), "{found:?}");
    let shipped = verdicts(&config(ARMS[0], &[]));
    assert!(shipped.iter().all(|(_, verdict)| *verdict == holds), "{shipped:?}");
}

#[test]
fn wrench_limit_stops_the_arm() {
    let config =
        config(ARMS[0], &[("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 0.0 ")]);
    let limit = WrenchLimit { force: 30.0, moment: 5.0 };
    let equipment = Equipment { limit, ..Equipment::from_remote(&config.remote) };
    let site = driven(&config, &equipment, ahead(0.05), 6_000);
    assert!(site.control().is_stopped());
    let held = site.arm().f_m_contact().force.norm();
    assert!((20.0..60.0).contains(&held), "{held} N");
}

#[test]
fn simulated_arms_play_the_contact_scenario() {
    for file in ARMS {
        let config = config(file, &[]);
        let text = fs::read_to_string("config/scenarios/contact_10s.toml").unwrap();
        let site = RobotSite::new(&config, &Equipment::from_remote(&config.remote), 1).unwrap();
        let scenario = script(&text);
        let mut bench = Bench::with_side(&config, site.into(), scenario, 1, ());
        bench.bring_up().unwrap();
        let mut most = 0.0_f64;
        for _ in 0..10_000 {
            let record = bench.cycle();
            assert_eq!(record.cause, None, "{file}");
            most = most.max(bench.side().robot().unwrap().arm().f_m_contact().force.norm());
        }
        assert!((2.0..15.0).contains(&most), "{file}: {most} N");
    }
}

/// The hand holds the grip displaced, from 3.5 s on.
fn displaced(x: f64) -> Scenario {
    let entries = format!(
        "seconds = 12.0\n[hand]\ntremor_mm = 0.0\n\
         [[console]]\nat_s = 0.3\nrequest = \"arm\"\n\
         [[switch]]\nat_s = 2.2\ndeadman = true\n\
         [[switch]]\nat_s = 2.5\nreflection = true\n\
         [[switch]]\nat_s = 2.6\nreflection = false\n\
         [[switch]]\nat_s = 2.8\nreference = true\n\
         [[switch]]\nat_s = 2.9\nreference = false\n\
         [[move]]\nat_s = 3.0\nduration_s = 0.5\nto_m = [{x:?}, 0.0, 0.0]\n"
    );
    script(&entries)
}

#[test]
fn held_displacement_presses_with_gain_and_deadband() {
    // A wall on the other side for the other sign.
    let behind = [
        ("point_m = [0.47, 0.0, 0.0]", "point_m = [0.25, 0.0, 0.0]"),
        ("normal = [-1.0, 0.0, 0.0]", "normal = [1.0, 0.0, 0.0]"),
    ];
    let yielding = "accommodation_m_per_ns = 0.01 ";
    let keys = format!(
        "accommodation_deadband_n = {F_DB:?}\naccommodation_deadband_nm = 0.02\n{yielding}"
    );
    for (file, sign) in ARMS.into_iter().flat_map(|file| [(file, 1.0), (file, -1.0)]) {
        let mut changes = vec![(yielding, keys.as_str())];
        changes.extend(behind.iter().filter(|_| sign < 0.0));
        let config = config(file, &changes);
        let site = RobotSite::new(&config, &Equipment::from_remote(&config.remote), 1).unwrap();
        let mut bench = Bench::with_side(&config, site.into(), displaced(sign * 0.045), 1, ());
        bench.bring_up().unwrap();
        let mut x_0_h = None;
        let (mut law, mut pressed, mut count) = (0.0, 0.0, 0.0);
        let k_v = config.controller.command.rate_gain.values()[2];
        let k_fa = config.remote.interaction.accommodation.gain()[2];
        let deadband = config.controller.channels.deadbands()[2];
        while bench.elapsed() < Duration::from_secs(12) {
            let record = bench.cycle();
            assert_eq!(record.cause, None, "{file}");
            let x_0_g = *bench.world().plant().x_0_g();
            if bench.elapsed() < Duration::from_millis(2_850) {
                x_0_h = Some(x_0_g);
            }
            if bench.elapsed() > Duration::from_secs(11) {
                let dx = (x_0_h.unwrap().inverse() * x_0_g).translation.z;
                assert!(dx * sign > 1.5 * deadband, "{dx}");
                law += k_v * (dx - deadband * sign) / k_fa + F_DB * sign;
                pressed -= bench.side().robot().unwrap().arm().f_m_contact().force.z;
                count += 1.0;
            }
        }
        let (law, pressed) = (law / count, pressed / count);
        assert!((pressed / law - 1.0).abs() < 0.01, "{file}: {pressed} N, law {law} N");
    }
}
