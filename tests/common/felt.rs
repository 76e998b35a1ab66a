//! Check of the reflected wrench against the wall's, from a session's log alone. It uses the simulator's kinematics,
//! which share no code with the controller's.

use nalgebra::SVector;

use canopen_tools::candump::{Content, Line};
use config::Config;
use sim::arm::Arm;
use telemetry::session::{NODE, WRENCH};
use units::spatial::Wrench;

/// Content of one cycle's log lines.
#[derive(Default)]
struct Cycle {
    counts: [Option<i32>; 6],
    targets: [Option<i16>; 6],
    f_s: Option<Wrench>,
    is_engaged: bool,
}

/// Checks every settled cycle in contact: each target torque is that of `g(q) + Jᵀ K_T F` within rounding, 0.5 ‰.
/// Return to centre, damping, friction compensation and the passivity layer must be off. Returns the number of cycles compared.
pub(crate) fn torques_are_those_of_the_wall(log: &str, config: &Config, arm: &Arm) -> u32 {
    let mut compared = 0;
    let mut engaged_for = 0;
    for cycle in cycles(log) {
        engaged_for = if cycle.is_engaged { engaged_for + 1 } else { 0 };
        let Some(f_s) = cycle.f_s else { continue };
        // 0.6 s after the deadman closes, both reflection and gravity compensation have ramped up.
        if engaged_for < 600 || f_s.force.norm() < 1.0 {
            continue;
        }
        let q = SVector::from(std::array::from_fn(|joint| {
            let calibrated = &config.joints[joint].plant.actuator;
            let counts = cycle.counts[joint].unwrap().wrapping_sub(calibrated.zero_counts);
            let turns = f64::from(counts) / f64::from(calibrated.counts_per_rev);
            turns * std::f64::consts::TAU / calibrated.gear_ratio
        }));
        let f_g = f_s
            .at(&config.remote.interaction.sensor.x_m_s)
            .scaled(&[0.3, 0.3, 0.3, 0.15, 0.15, 0.15]);
        let posture = arm.posture(&q);
        let tau = arm.gravity(&posture) + arm.jacobian(&posture).torques(&f_g);
        for (joint, calibrated) in
            config.plant().joints.iter().map(|joint| joint.actuator).enumerate()
        {
            let [c1, c3, c5] = calibrated.torque_curve;
            let t = tau[joint];
            let per_mille =
                (c1 * t + c3 * t.powi(3) + c5 * t.powi(5)) * calibrated.gear_ratio.signum();
            let sent = f64::from(cycle.targets[joint].unwrap());
            let error = (sent - per_mille).abs();
            assert!(error <= 0.5 + 1e-6, "joint {}: {sent} sent for {per_mille}", joint + 1);
        }
        compared += 1;
    }
    compared
}

/// Splits the log into cycles, from SYNC to the record of the cycle.
fn cycles(log: &str) -> impl Iterator<Item = Cycle> + '_ {
    let mut cycle = Cycle::default();
    log.lines().filter_map(move |text| {
        let line = Line::parse(text).unwrap();
        match &line.content {
            Content::Fd(_, data) if line.id == WRENCH.1 => {
                let parts =
                    data.chunks_exact(8).map(|part| f64::from_le_bytes(part.try_into().unwrap()));
                let parts: Vec<f64> = parts.collect();
                cycle.f_s = Some(Wrench::from_components(parts.try_into().unwrap()));
            }
            Content::Fd(_, data) if line.id == NODE.1 => {
                cycle.is_engaged = data[0] == 3;
                return Some(std::mem::take(&mut cycle));
            }
            Content::Data(data) => {
                let joint = usize::try_from(line.id & 0x7F).unwrap().wrapping_sub(1);
                match (line.id & 0x780, joint) {
                    (0x180, 0..6) => {
                        cycle.counts[joint] =
                            Some(i32::from_le_bytes(data[0..4].try_into().unwrap()));
                    }
                    (0x200, 0 | 3) => {
                        for (slot, target) in data.chunks_exact(2).enumerate() {
                            let target = i16::from_le_bytes(target.try_into().unwrap());
                            cycle.targets[joint + slot] = Some(target);
                        }
                    }
                    _ => {}
                }
            }
            Content::Fd(..) | Content::Remote(_) | Content::Error(_) => {}
        }
        None
    })
}
