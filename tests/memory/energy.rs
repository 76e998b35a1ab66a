//! The energy layers of the controller against traces computed by an independent program
//! (`tests/oracles/stability.json`), in one dimension and in six.

use crate::common::oracle::{self, assert_near, list, number, numbers};
use crate::common::prelude::*;
use controller::passivity::{Passivity, PassivitySettings};
use controller::tank::{Tank, TankSettings};

/// Limits that none of the traces reaches.
const SETTINGS: PassivitySettings = PassivitySettings {
    max_energy: 1e3,
    max_damping: 1e5,
    lever: 0.1,
    contact_threshold: 1e-9,
    contact_release_cycles: 10,
    is_one_sided: false,
};

/// Returns the wrench of a trace's force. The traces count a resisting force as positive, the controller a driving one.
fn resisting(force: f64) -> Wrench {
    Wrench::from_components([-force, 0.0, 0.0, 0.0, 0.0, 0.0])
}

fn along(speed: f64) -> Twist {
    Twist::from_components([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
}

/// Plays the trace of a press and a release; returns the observed energies in J and the forces in N.
fn press_and_release(is_one_sided: bool) -> (Vec<f64>, Vec<f64>) {
    let trace = &oracle::oracle("stability.json")["po_pc_trace"];
    let dt = number(&trace["T"]);
    let (x, f_env) = (numbers::<9>(&trace["x"]), numbers::<9>(&trace["f_env"]));
    let mut passivity = Passivity::new(PassivitySettings { is_one_sided, ..SETTINGS }).unwrap();
    let (mut x_before, mut held) = (0.0, 0.0);
    let (mut energies, mut forces) = (Vec::new(), Vec::new());
    for (x, f_env) in x.into_iter().zip(f_env) {
        let v_g = along((x - x_before) / dt);
        // A constant wrench of 1 N keeps the contact from ending: the trace has no release.
        passivity.account(held * (x - x_before), &resisting(1.0), 0.0);
        let damping = passivity.damping(dt, &v_g, 0.0);
        let damper = passivity.wrench(damping, &v_g, &resisting(f_env));
        held = f_env - damper.force.x;
        energies.push(passivity.energy());
        forces.push(held);
        x_before = x;
    }
    (energies, forces)
}

#[test]
fn passivity_observer_and_controller_match_the_trace() {
    let trace = &oracle::oracle("stability.json")["po_pc_trace"]["exact"];
    let (energies, forces) = press_and_release(false);
    assert_near("E", &energies, &numbers::<9>(&trace["E"]));
    assert_near("f", &forces, &numbers::<9>(&trace["f_out"]));
}

#[test]
fn one_sided_contact_never_pulls() {
    let trace = &oracle::oracle("stability.json")["po_pc_trace"]["exact_unilateral_clip"];
    let (energies, forces) = press_and_release(true);
    assert_near("E", &energies, &numbers::<9>(&trace["E"]));
    assert_near("f", &forces, &numbers::<9>(&trace["f_out"]));
}

#[test]
fn torque_of_a_cycle_acts_between_the_next_two_syncs() {
    let mut bench = started(&config(KRAFT), scenario("stiff-wall"), ());
    let calibration = config(KRAFT).controller.calibration;
    let mut sent = Vec::new();
    // Squared error between the exerted torque and the target torque of this cycle, last cycle and the one before.
    let mut off = [0.0; 3];
    for _ in 0..6_000 {
        let record = bench.cycle();
        // The simulation integrated up to this cycle's SYNC with these torques.
        let exerted = bench.world_mut().torques();
        sent.push(calibration.torques(&record.output.targets));
        for (off, tau) in off.iter_mut().zip(sent.iter().rev()) {
            *off += (exerted - tau).norm_squared();
        }
    }
    let [of_this, of_last, of_the_one_before] = off;
    assert!(of_the_one_before < 0.01 * of_last.min(of_this), "{off:?}");
}

#[test]
fn textbook_observer_misses_the_energy_of_a_held_force() {
    let trace = &oracle::oracle("stability.json")["po_pc_trace"]["hannaford_ryu_2002"];
    let textbook = numbers::<9>(&trace["E"]);
    let (energies, _) = press_and_release(false);
    assert!(textbook.iter().all(|energy| *energy >= 0.0), "it takes the port for passive");
    assert!(energies.iter().any(|energy| *energy < -1e-3), "the port supplied more than 1 mJ");
}

#[test]
fn six_axes_are_damped_together() {
    let case = &oracle::oracle("stability.json")["pc_6dof"];
    let f_g_task = -Wrench::from_components(numbers(&case["F"]));
    let v_g = Twist::from_components(numbers(&case["V"]));
    let mut passivity = Passivity::new(SETTINGS).unwrap();
    passivity.account(number(&case["E"]), &f_g_task, 0.0);
    let damping = passivity.damping(number(&case["T"]), &v_g, 0.0);
    let f_g = f_g_task + passivity.wrench(damping, &v_g, &f_g_task);
    assert_near("F_out", &(-f_g).components(), &numbers::<6>(&case["F_out"]));
}

#[test]
fn tank_level_and_forces_match_the_trace() {
    let trace = &oracle::oracle("stability.json")["energy_tank_trace"];
    let at = |key: &str| number(&trace[key]);
    let mut tank = Tank::new(TankSettings {
        initial: at("H0"),
        min: at("H_min"),
        max: at("H_max"),
        low: at("H_d"),
        refill: at("d_bar"),
        max_damping: 60.0,
    })
    .unwrap();
    let (mut applied, dt) = (0.0, at("T"));
    let (mut levels, mut limited, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for (f_des, dx) in list(&trace["F_des"]).iter().zip(list(&trace["dx"])) {
        let (f_des, dx) = (number(f_des), number(dx));
        tank.account(-applied * dx);
        let let_through = f_des * tank.share(f_des * dx);
        applied = let_through - tank.refill() * dx / dt;
        levels.push(tank.level());
        limited.push(let_through);
        forces.push(applied);
    }
    assert_near("H", &levels, &numbers::<8>(&trace["H"]));
    assert_near("F limited", &limited, &numbers::<8>(&trace["F_limited"]));
    assert_near("F applied", &forces, &numbers::<8>(&trace["F_applied"]));
}
