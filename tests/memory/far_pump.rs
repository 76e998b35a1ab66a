//! A commanded side that pumps energy: the wrench that it reports pushes the hand where it moves. It is valid in every
//! sample. Judged by the plant: speed of the grip, and energy that the hand received.

use nalgebra::Vector3;

use crate::common::prelude::*;

/// Arms, engages and switches reflection on.
const SCRIPT: &str = "seconds = 30\n\
    [[console]]\nat_s = 0.1\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 1.6\ndeadman = true\n\
    [[switch]]\nat_s = 1.7\nreflection = true\n[[switch]]\nat_s = 1.75\nreflection = false\n";

/// Start of the pump and of its kick's end, and end of the session, in s.
const PUMP: [f64; 3] = [2.0, 2.05, 8.0];

/// Force that it reports, in N: reflected, above the greatest reflected force of every shipped file.
const FORCE: f64 = 200.0;

/// Effect of a pump on the hand.
#[derive(Debug)]
struct Damage {
    /// Maximum speed of the grip, in m/s.
    speed: f64,
    /// Energy of the wrench between grip and hand, in J.
    energy: f64,
    /// Time from the start of the pump to the stop, in s, and its cause.
    stop: Option<(f64, Cause)>,
}

/// Plays a pump against a hand, a preset of the scenarios.
fn pumped(file: &str, mode: &str, hand: &str) -> Damage {
    let text = text(file).replace("mode = \"rate\"", &format!("mode = \"{mode}\""));
    let config = parse(file, &text);
    let hand = format!("[hand]\npreset = \"{hand}\"\n");
    let mut bench = started(&config, script(&format!("{SCRIPT}{hand}")), ());
    let [start, kicked, end] = PUMP;
    let mut mode_before = Mode::Boot;
    while bench.elapsed().as_secs_f64() < start {
        mode_before = bench.cycle().mode;
    }
    assert_eq!(mode_before, Mode::Engaged, "{file}, {mode}, {hand}");
    let mut damage = Damage { speed: 0.0, energy: 0.0, stop: None };
    let mut before = bench.world().plant().x_0_g().translation.vector;
    while bench.elapsed().as_secs_f64() < end && damage.stop.is_none() {
        let x_0_g = *bench.world().plant().x_0_g();
        let dx_g = x_0_g.rotation.inverse() * (x_0_g.translation.vector - before);
        before = x_0_g.translation.vector;
        let kick = Vector3::x() * f64::from(bench.elapsed().as_secs_f64() < kicked);
        let force = dx_g.try_normalize(1e-7).unwrap_or(kick) * FORCE;
        bench.set_sensor_fault(Some(Wrench { force, moment: Vector3::zeros() }));
        let record = bench.cycle();
        let seconds = bench.elapsed().as_secs_f64() - start;
        damage.energy -= bench.world().plant().f_g_hand().force.dot(&dx_g);
        damage.speed = damage.speed.max(dx_g.norm() / config.period.as_secs_f64());
        damage.stop = record.cause.map(|cause| (seconds, cause));
    }
    damage
}

#[test]
fn hazard_45_pumped_hand_is_left_alone_or_slow() {
    for file in HAND_CONTROLLERS {
        for (mode, hand) in
            [("rate", "steady"), ("rate", "relaxed"), ("pose", "steady"), ("pose", "relaxed")]
        {
            let damage = pumped(file, mode, hand);
            let Damage { speed, energy, stop } = &damage;
            let end = match stop {
                Some((seconds, cause)) => format!("{cause} after {seconds:.2} s"),
                None => "no stop".to_owned(),
            };
            println!("{file}, {mode}, {hand} hand: {speed:.2} m/s, {energy:.2} J, {end}");
            assert!(*energy < 3.0, "{file}, {mode}, {hand}: {damage:?}");
            assert!(stop.is_some() || *speed < 0.25, "{file}, {mode}, {hand}: {damage:?}");
        }
    }
}
