//! The gain checker over a whole configuration: the loop as one sees it from the grip, at the posture
//! where the arm starts.

use nalgebra::SMatrix;
use nalgebra::SVector;

use crate::config::Config;
use crate::config::problem::Problems;
use crate::config::raw;
use crate::controller::stability::Axis;
use crate::controller::stability::Finding;
use crate::controller::stability::Loop;
use crate::controller::stability::Topic;
use crate::controller::stability::Verdict;

/// A synchronous target acts from the SYNC after the sample it answers.
const ASSIST_LATE: u32 = 1;

/// The wrench sensed at the end of one cycle belongs to the pose commanded in the one before, is used in
/// the next, and acts from the SYNC after that.
const REFLECTION_LATE: u32 = 3;

/// The object gives way to the wrench of the same instant.
const ACCOMMODATION_LATE: u32 = 0;

type SixBySix = SMatrix<f64, 6, 6>;

/// The impedance of the hand that the bounds count on, per axis.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    /// In N/m and N·m/rad.
    pub stiffness: [f64; 6],
    /// In N·s/m and N·m·s/rad.
    pub damping: [f64; 6],
}

/// `[operator]`: a light grip of an adult hand unless said otherwise.
pub(super) fn operator(raw: &raw::File, problems: &mut Problems<'_>) -> Operator {
    let given = &raw.operator;
    let mut number = |key: &str, value| problems.not_negative(&format!("operator.{key}"), value);
    let (k, c) = (
        number("stiffness_n_per_m", given.stiffness_n_per_m),
        number("stiffness_nm_per_rad", given.stiffness_nm_per_rad),
    );
    let (b, d) = (
        number("damping_ns_per_m", given.damping_ns_per_m),
        number("damping_nms_per_rad", given.damping_nms_per_rad),
    );
    Operator { stiffness: [k, k, k, c, c, c], damping: [b, b, b, d, d, d] }
}

/// Notes every finding that refuses the configuration, under the key to blame.
pub(super) fn refuse(config: &Config, problems: &mut Problems<'_>) {
    for finding in config.findings() {
        if finding.verdict == Verdict::Refuses {
            problems.add(blamed(&finding), finding);
        }
    }
}

/// The key whose value is to be changed first.
fn blamed(finding: &Finding) -> &'static str {
    let turns = finding.axis.starts_with("about");
    match finding.topic {
        Topic::Accommodation => "remote.accommodation_m_per_ns",
        Topic::ServoLag => "remote.servo_time_constant_s",
        Topic::RateStability | Topic::RatePassivity | Topic::PosePassivity => {
            "controller.wrench_gain"
        }
        Topic::VirtualCoupling => "controller.virtual_coupling",
        Topic::Damping if turns => "controller.damping_nms_per_rad",
        Topic::Damping => "controller.damping_ns_per_m",
        Topic::CentringSlope | Topic::CentringFriction | Topic::Quantisation if turns => {
            "controller.centring_nm"
        }
        Topic::CentringSlope | Topic::CentringFriction | Topic::Quantisation => {
            "controller.centring_n"
        }
    }
}

/// The whole loop of a configuration.
pub(super) fn around(config: &Config) -> Loop {
    let settings = &config.controller;
    let device = Device::at_start(config);
    let stiffest = |surfaces: [Option<f64>; 2]| surfaces.into_iter().flatten().fold(0.0, f64::max);
    let remote = &config.remote;
    let met = stiffest([
        remote.wall.map(|(.., contact)| contact.stiffness),
        remote.block.map(|(.., contact)| contact.stiffness),
    ]);
    let coupled = settings.beyond.virtual_coupling;
    let mut axes = [Axis::default(); 6];
    for (place, axis) in axes.iter_mut().enumerate() {
        // Every list here has six entries.
        let of = |list: &[f64; 6]| list.get(place).copied().unwrap_or(0.0);
        *axis = Axis {
            device_damping: of(&device.damping),
            friction: of(&device.friction),
            mass: of(&device.mass),
            quantum: of(&device.quantum),
            hand_stiffness: of(&config.operator.stiffness),
            hand_damping: of(&config.operator.damping),
            rate_gain: of(settings.command.rate_gain.values()),
            pose_gain: of(settings.command.pose_gain.values()),
            wrench_gain: of(settings.reflection.gain().values()),
            damping: of(settings.damping.values()),
            plateau: of(&settings.channels.plateaus()),
            deadband: of(&settings.channels.deadbands()),
            // Things are met by sides and edges: what turns the object is soft.
            environment: if place < 3 { met } else { 0.0 },
            accommodation: of(remote.accommodation.gain()),
            virtual_coupling: coupled.map(|coupling| {
                [of(coupling.stiffness().values()), of(coupling.damping().values())]
            }),
        };
    }
    Loop {
        period: settings.period.seconds(),
        assist_late: ASSIST_LATE,
        reflection_late: REFLECTION_LATE,
        accommodation_late: ACCOMMODATION_LATE,
        velocity_filter: settings.beyond.velocity_filter.seconds(),
        servo_lag: remote.servo.time_constant(),
        is_watched: settings.beyond.passivity.is_some(),
        axes,
    }
}

/// The device as the hand meets it at the grip, per axis of {G}.
struct Device {
    damping: [f64; 6],
    friction: [f64; 6],
    mass: [f64; 6],
    quantum: [f64; 6],
}

impl Device {
    /// Seen through the Jacobian at the start. Damping is the least there is when the other axes are
    /// free, `1 / (J B⁻¹ Jᵀ)_ii`; mass and friction are the most there is when they are held,
    /// `(J⁻ᵀ M J⁻¹)_ii` and `Σ_j τ_c,j |J⁻¹_ji|`; a step is what all encoders together may hide,
    /// `Σ_j |J_ij| Δ_j`. Where the Jacobian has no inverse, mass and friction are left out.
    fn at_start(config: &Config) -> Self {
        let joints = &config.joints;
        let arm = &config.controller.arm;
        let posture = arm.posture(&SVector::from(joints.each_ref().map(|joint| joint.start)));
        let j_g = arm.jacobian(&posture);
        let mut jacobian = SixBySix::zeros();
        jacobian.fixed_rows_mut::<3>(0).copy_from(&j_g.linear);
        jacobian.fixed_rows_mut::<3>(3).copy_from(&j_g.angular);
        let inverse = jacobian.try_inverse().unwrap_or_else(SixBySix::zeros);
        let mass = inverse.transpose() * arm.mass_matrix(&posture) * inverse;

        let of_joints = |of: fn(&crate::config::Joint) -> f64| joints.each_ref().map(of);
        let softness = of_joints(|joint| joint.viscous_friction.recip());
        let coulomb = of_joints(|joint| joint.coulomb_friction);
        let step = of_joints(|joint| {
            std::f64::consts::TAU / (f64::from(joint.counts_per_rev) * joint.gear_ratio.abs())
        });
        let rows = |matrix: &SixBySix, weights: [f64; 6], power: i32| {
            let mut sums = [0.0; 6];
            for (sum, row) in sums.iter_mut().zip(matrix.row_iter()) {
                let parts = row.iter().zip(weights);
                *sum = parts
                    .filter(|(entry, _)| entry.abs() > 0.0)
                    .map(|(entry, weight)| entry.abs().powi(power) * weight)
                    .sum();
            }
            sums
        };
        Self {
            damping: rows(&jacobian, softness, 2).map(f64::recip),
            friction: rows(&inverse.transpose(), coulomb, 1),
            mass: mass.diagonal().into(),
            quantum: rows(&jacobian, step, 1),
        }
    }
}
