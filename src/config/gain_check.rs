//! `gain_check`: stability of the configured gains with the configured arm, surfaces and network.
//!
//! This module describes the loop; [`stability`](controller::stability) has the inequalities. The delay of each torque
//! follows from the cycle of `node` and the exchange with the virtual object of `remote`:
//!
//! ```text
//!  SYNC k      joints sampled    step k: damping and return of k; the object is commanded, and moves
//!  SYNC k + 1  those act         step k + 1: at its end the wrench is sensed where the object is
//!  SYNC k + 2                    step k + 2: that wrench is reflected
//!  SYNC k + 3  it acts
//! ```

use nalgebra::{Matrix3, Point3};

use crate::friction_share;
use crate::operator::OperatorImpedance;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use crate::value::{HasPlace, Place};
use controller::JointVector;
use controller::arm::Arm;
use controller::friction::MAX_SHARE;
use controller::gains::AXES;
use controller::scaling::Scale;
use controller::stability::axis::{Axis, AxisGains, Impedance, Timing};
use controller::stability::device::{Device, JointResistance, Massless};
use controller::stability::finding::{Culprit, Finding, Verdict};
use controller::stability::gate::StabilityGate;
use controller::stability::grip_dynamics::GripDynamics;
use remote::site::Contact;
use robot::interaction::Interaction;
use units::numbering::Joint;

/// Cycles from the SYNC that samples the joints to the SYNC at which their torque acts (synchronous RPDO, CiA 301).
const TORQUE_DELAY: u32 = 1;

/// Cycles from the sampling of a commanded pose until its reflected wrench acts. The object reaches the pose of cycle k at
/// its end. The wrench is sensed at the end of k + 1, used in k + 2, and acts at SYNC k + 3.
const POSE_DELAY: u32 = 3;

/// Cycles as for a pose, less the one that the law of a rate contains as integration.
const RATE_DELAY: u32 = 2;

/// Further cycles of a robot with masses: its computer commands the arm a cycle late, and its sensor reports the mean over
/// a cycle. That makes one and a half, rounded up.
const ROBOT_DELAY: u32 = 2;

/// Cycles until the object yields to a wrench: it does so in the same exchange.
const ACCOMMODATION_DELAY: u32 = 0;

/// Distance of the contact from the centre of the object, in m. A contact stiffness k resists rotation with k r².
const TOUCH_RADIUS: f64 = 0.02;

/// Changes of a single joint from the start, as shares of its range, for the further postures.
const SHARES_OF_RANGE: [f64; 2] = [-0.15, 0.15];

/// Minimum smallest singular value of the Jacobian, as a share of that at the start. Postures below it are near-singular
/// and skipped.
const MIN_SINGULAR_SHARE: f64 = 0.5;

/// Lever that weights rotations in the singular value, in m.
const LEVER: f64 = 0.1;

/// Returns whether unstable gains are refused, which is the default; `gain_check = "warn"` accepts them.
pub(super) fn refuses(raw: &raw::File, problems: &mut Problems<'_>) -> bool {
    let choices = [("refuse", true), ("warn", false)];
    let asked = raw.controller.gain_check.or("refuse".to_owned());
    problems.one_of(&asked, &choices).unwrap_or(true)
}

/// Reports each violated inequality once for translations and once for rotations, at the worst axis. Skips the check if
/// there are other problems, because the numbers may then be invalid.
pub(super) fn check(
    config: &Parameters,
    refuses: bool,
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    if problems.count() > 0 {
        return;
    }
    let judged = match JudgedAxes::new(config) {
        Ok(judged) => judged,
        Err(massless) => return problems.add(&raw.joint, massless),
    };
    let findings = judged.findings(&Scale::ONE);
    for (is_rotation, axes) in [false, true].into_iter().zip(findings.chunks(3)).filter(|_| refuses)
    {
        let found = axes.iter().flatten().cloned();
        let refused: Vec<Finding> =
            found.filter(|finding| finding.verdict == Verdict::Refuses).collect();
        for worst in worst_of_each(&refused) {
            let remedy = remedy(worst.culprit, config);
            problems.add(place(worst.culprit, is_rotation, raw), format_args!("{worst}{remedy}"));
        }
    }
    if refuses && problems.count() == 0 {
        check_scales(&judged, &config.controller.bounds.scale, raw, problems);
    }
}

/// Checks the gains at the greatest scales, if these raise a gain. Each scaled loop has the gain K_T K_P or K_T K_V, and
/// the gate finds its least unstable multiple. Gains that are stable at the greatest scales are so at smaller ones.
fn check_scales(
    judged: &JudgedAxes,
    [_, most]: &[Scale; 2],
    raw: &raw::File,
    problems: &mut Problems<'_>,
) {
    if *most == Scale::ONE {
        return;
    }
    let refused = judged.findings(most).into_iter().flatten();
    let refused = refused.filter(|finding| finding.verdict == Verdict::Refuses);
    if let Some(worst) = refused.max_by(|a, b| a.share().total_cmp(&b.share())) {
        let Scale { motion, rotation, force } = most;
        let at = format_args!("at motion {motion}, rotation {rotation}, force {force}: {worst}");
        problems.add(raw.controller.scale.place(), at);
    }
}

impl Parameters {
    /// Returns every inequality of every axis, satisfied or violated.
    pub fn findings(&self) -> Vec<Finding> {
        let judged = JudgedAxes::new(self).map(|judged| judged.findings(&Scale::ONE));
        judged.into_iter().flatten().flatten().collect()
    }
}

/// Cartesian axes of the grip as configured, and the postures in which they are checked.
struct JudgedAxes {
    axes: [Axis; 6],
    postures: Vec<GripDynamics>,
}

impl JudgedAxes {
    fn new(config: &Parameters) -> Result<Self, Massless> {
        let (axes, postures) = (axes(config)?, postures(config)?);
        Ok(Self { axes, postures })
    }

    /// Returns the findings of each axis at these scales: first passivity and closed forms, then the gate.
    fn findings(&self, scale: &Scale) -> [Vec<Finding>; 6] {
        let axes = self.axes.each_ref().map(|axis| scaled(axis, scale));
        let gate = StabilityGate { axes: &axes, postures: &self.postures };
        [0, 1, 2, 3, 4, 5].map(|index| {
            let mut findings = axes.get(index).map(Axis::findings).unwrap_or_default();
            findings.extend(gate.findings(index));
            findings
        })
    }
}

/// Returns the axis with its gains multiplied by the scales.
fn scaled(axis: &Axis, scale: &Scale) -> Axis {
    let command = if axis.is_rotation { scale.rotation } else { scale.motion };
    let AxisGains { rate, pose, wrench, .. } = axis.gains;
    let gains = AxisGains {
        rate: rate * command,
        pose: pose * command,
        wrench: wrench * scale.force,
        ..axis.gains
    };
    Axis { gains, ..*axis }
}

/// Returns the text that names the largest share of friction compensation that holds, for a share that does not.
fn remedy(culprit: Culprit, config: &Parameters) -> String {
    let is_refused = |finding: &Finding| {
        finding.culprit == Culprit::Friction && finding.verdict == Verdict::Refuses
    };
    let holds = |config: &Parameters| {
        axes(config)
            .is_ok_and(|axes| !axes.iter().flat_map(Axis::findings).any(|it| is_refused(&it)))
    };
    let largest = (culprit == Culprit::Friction).then(|| friction_share::largest(config, holds));
    let largest =
        largest.flatten().map(|share| format!("; the largest share that holds is {share}"));
    largest.unwrap_or_default()
}

/// Returns the most violated finding of each name.
fn worst_of_each(findings: &[Finding]) -> Vec<&Finding> {
    let is_worst = |finding: &&Finding| {
        let others = findings.iter().filter(|other| other.name == finding.name);
        let worst = others.max_by(|a, b| a.share().total_cmp(&b.share()));
        worst.is_some_and(|worst| worst.axis == finding.axis)
    };
    findings.iter().filter(is_worst).collect()
}

/// Returns the place of the gain that causes a finding.
fn place(culprit: Culprit, is_rotation: bool, raw: &raw::File) -> &Place {
    let raw::File { controller, remote, .. } = raw;
    let (tank, coupling) = (controller.tank.as_ref(), controller.virtual_coupling.as_ref());
    let friction = controller.friction.as_ref();
    match (culprit, is_rotation) {
        (Culprit::Tank, _) => at(tank.map(|tank| &tank.max_damping_ns_per_m), controller),
        (Culprit::Friction, _) => at(friction.map(|friction| &friction.share), controller),
        (Culprit::PassivityDamper, _) => {
            let passivity = controller.passivity.as_ref();
            at(passivity.map(|passivity| &passivity.max_damping_ns_per_m), controller)
        }
        (Culprit::Damping, false) => controller.damping_ns_per_m.place(),
        (Culprit::Damping, true) => controller.damping_nms_per_rad.place(),
        (Culprit::Wrench, _) => controller.wrench_gain.place(),
        (Culprit::Centring, false) => controller.centring_n.place(),
        (Culprit::Centring, true) => controller.centring_nm.place(),
        (Culprit::Accommodation, false) => remote.accommodation_m_per_ns.place(),
        (Culprit::Accommodation, true) => remote.accommodation_rad_per_nms.place(),
        (Culprit::Coupling, false) => at(coupling.map(|made| &made.stiffness_n_per_m), controller),
        (Culprit::Coupling, true) => {
            at(coupling.map(|made| &made.stiffness_nm_per_rad), controller)
        }
    }
}

/// Returns the place of a key, or of `[controller]` if its section is absent.
fn at<'r>(key: Option<&'r impl HasPlace>, controller: &'r raw::Controller) -> &'r Place {
    key.map_or_else(|| controller.place(), HasPlace::place)
}

/// Returns the six Cartesian axes of the grip with device, hand, environment, gains and timing.
#[expect(clippy::indexing_slicing, reason = "axes are numbered by an array of six")]
fn axes(config: &Parameters) -> Result<[Axis; 6], Massless> {
    let controller = &config.controller;
    let start = JointVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    let devices = Device::at_grip(&controller.arm, &resistances(config), &start)?;
    let environment = stiffest(config);
    let later = link_cycles(config) + if is_robot(config) { ROBOT_DELAY } else { 0 };
    let timing = Timing {
        period: config.period.as_secs_f64(),
        torque_delay: TORQUE_DELAY,
        pose_delay: POSE_DELAY + later,
        rate_delay: RATE_DELAY + later,
        accommodation_delay: ACCOMMODATION_DELAY,
        link_cycles: link_cycles(config),
        is_robot: is_robot(config),
        servo_lag: config.remote.servo.time_constant(),
        velocity_filter: controller.extensions.velocity_filter.seconds(),
    };
    let (deadbands, plateaus) = (controller.channels.deadbands(), controller.channels.plateaus());
    Ok([0, 1, 2, 3, 4, 5].map(|axis| {
        let is_rotation = axis >= 3;
        let OperatorImpedance { linear, angular } = config.operator;
        let share = if is_rotation { TOUCH_RADIUS * TOUCH_RADIUS } else { 1.0 };
        Axis {
            name: AXES[axis],
            is_rotation,
            device: devices[axis],
            hand: if is_rotation { angular } else { linear },
            environment: Impedance {
                stiffness: environment.stiffness * share,
                damping: environment.damping * share,
            },
            coupling: controller.extensions.virtual_coupling.map(|coupling| Impedance {
                stiffness: coupling.stiffness().values()[axis],
                damping: coupling.damping().values()[axis],
            }),
            yielded_inertia: yielded_inertia(config, axis),
            tank_damping: tank_damping(config, is_rotation),
            passivity_damping: passivity_damping(config, is_rotation),
            gains: AxisGains {
                rate: controller.command.rate_gain.values()[axis],
                pose: controller.command.pose_gain.values()[axis],
                wrench: controller.reflection.gain().values()[axis],
                damping: controller.damping.values()[axis],
                deadband: deadbands[axis],
                plateau: plateaus[axis],
                accommodation: config.remote.interaction.accommodation.gain()[axis],
            },
            timing,
            is_watched: controller.extensions.passivity.is_some(),
        }
    }))
}

/// Returns the dynamics of the grip at the start, then at the further postures.
fn postures(config: &Parameters) -> Result<Vec<GripDynamics>, Massless> {
    let arm = &config.controller.arm;
    let start = JointVector::from(config.joints.each_ref().map(|joint| joint.plant.start));
    let viscous = resistances(config).map(|joint| joint.viscous);
    let at = |q: &JointVector, posture| GripDynamics::at(arm, &viscous, q, posture);
    let least = MIN_SINGULAR_SHARE * smallest_singular_value(arm, &start);
    let mut postures = vec![at(&start, "at the start".to_owned())?];
    for (place, (joint, [low, high])) in config.joints.iter().zip(arm.ranges()).enumerate() {
        for share in SHARES_OF_RANGE {
            let mut q = start;
            if let Some(moved) = q.get_mut(place) {
                *moved = (*moved + share * (high - low)).clamp(low, high);
            }
            if smallest_singular_value(arm, &q) >= least {
                let posture =
                    format!("with {} moved by {:.0} % of its range", joint.name, 100.0 * share);
                postures.push(at(&q, posture)?);
            }
        }
    }
    Ok(postures)
}

/// Returns the smallest singular value of the Jacobian, its rotations weighted by [`LEVER`].
fn smallest_singular_value(arm: &Arm<6>, q: &JointVector) -> f64 {
    let mut weighted = arm.jacobian(&arm.posture(q)).matrix();
    for mut row in weighted.row_iter_mut().skip(3) {
        row *= LEVER;
    }
    weighted.singular_values().min()
}

/// Returns whether an arm with masses holds the object, in this configuration or in another process.
fn is_robot(config: &Parameters) -> bool {
    config.robot.is_some() || config.far_side.agreement.is_some()
}

/// Returns the delay of a link from command to wrench, in cycles: round trip with jitter, and the far side's cycle.
/// Accommodation has no such delay, because the far side computes it.
fn link_cycles(config: &Parameters) -> u32 {
    let simulated = config.link.simulated.map(|link| link.round_trip());
    let agreed = config.far_side.agreement.map(|agreement| agreement.round_trip);
    let Some(round_trip) = agreed.or(simulated) else { return 0 };
    let cycles = round_trip.as_micros().div_ceil(config.period.as_micros().max(1));
    u32::try_from(cycles).unwrap_or(u32::MAX)
}

/// Returns the mass of the payload, in kg, or its inertia about an axis of {MRF}, in kg·m²; zero without an arm with
/// masses. `remove_inertia` makes no difference: its bandwidth is too low for the frequencies of interest.
fn yielded_inertia(config: &Parameters, axis: usize) -> f64 {
    let Interaction { sensor, payload, .. } = &config.remote.interaction;
    if !is_robot(config) {
        return 0.0;
    }
    let Some(about) = axis.checked_sub(3) else { return payload.mass() };
    let r = (sensor.x_m_s * Point3::from(*payload.centre_of_mass())).coords;
    let turned = sensor.x_m_s.rotation.to_rotation_matrix();
    let inertia = turned.matrix() * payload.inertia() * turned.matrix().transpose();
    let of_point = (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * payload.mass();
    (inertia + of_point).diagonal().get(about).copied().unwrap_or_default()
}

/// Returns the maximum damping of the tank, in N·s/m; it damps translations only.
fn tank_damping(config: &Parameters, is_rotation: bool) -> f64 {
    let tank = config.controller.extensions.tank.filter(|_| !is_rotation);
    tank.map_or(0.0, |tank| tank.max_damping())
}

/// Returns the maximum damping of the passivity layer, in N·s/m or N·m·s/rad.
fn passivity_damping(config: &Parameters, is_rotation: bool) -> f64 {
    let passivity = config.controller.extensions.passivity.as_ref();
    let lever = passivity.map_or(0.0, |passivity| passivity.lever());
    let share = if is_rotation { lever * lever } else { 1.0 };
    passivity.map_or(0.0, |passivity| passivity.max_damping() * share)
}

/// Returns the friction that compensation leaves at each joint, assuming that its real friction is below the identified one.
fn resistances(config: &Parameters) -> [JointResistance; 6] {
    let compensation = config.controller.extensions.friction;
    let left = compensation.map_or(1.0, |friction| MAX_SHARE - friction.settings().share);
    let stiffness: [f64; 6] =
        compensation.map_or([0.0; 6], |friction| friction.negative_stiffness().into());
    Joint::ALL.map(|number| {
        let joint = number.entry(&config.joints);
        JointResistance {
            coulomb: joint.plant.friction.coulomb,
            viscous: joint.plant.friction.viscous * left,
            quantum: joint.calibration.quantum(),
            compensated_stiffness: *number.entry(&stiffness),
        }
    })
}

/// Returns the impedance of the stiffest surface, or zero without one. That of a far side is stated, without damping.
fn stiffest(config: &Parameters) -> Impedance {
    if let Some(agreement) = &config.far_side.agreement {
        return Impedance { stiffness: agreement.stated.stiffest_contact, damping: 0.0 };
    }
    let wall = config.remote.wall.map(|(.., contact)| contact);
    let block = config.remote.block.map(|(.., contact)| contact);
    let sphere = config.remote.sphere.map(|(.., contact)| contact);
    let contacts = [wall, block, sphere].into_iter().flatten();
    let stiffest = contacts.max_by(|a, b| a.stiffness.total_cmp(&b.stiffness));
    stiffest.map_or(Impedance::default(), |Contact { stiffness, damping, .. }| Impedance {
        stiffness,
        damping,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Config;
    use crate::shipped::HAND_CONTROLLERS;

    #[test]
    fn refused_share_of_friction_names_the_largest_that_holds() {
        let file = Path::new("config/kraft_like.toml");
        let text = String::from_utf8(crate::files::read(file).unwrap()).unwrap();
        let (before, rest) = text.split_once("[controller.friction]\n").unwrap();
        let (_, after) = rest.split_once("\n[").unwrap();
        // A weak hand leaves the negative stiffness to K_D.
        let hand = "\n[operator]\ndamping_nms_per_rad = 0.002\n";
        let with = |share: f64| {
            let friction =
                format!("[controller.friction]\nshare = {share}\npresliding_rad = 1e-4\n\n[");
            let text = format!("{before}{friction}{after}{hand}");
            Config::parse(file, &text).err().map(|it| it.to_string()).unwrap_or_default()
        };
        let is_refused = |share| with(share).contains("friction compensation, ");
        let refused = with(0.65);
        let (_, largest) = refused.split_once("; the largest share that holds is ").unwrap();
        let largest: f64 = largest.lines().next().unwrap().parse().unwrap();
        assert!(
            is_refused(0.65) && is_refused(largest + 0.01) && !is_refused(largest),
            "{refused}"
        );
    }

    #[test]
    fn smaller_scales_hold_where_the_greatest_do() {
        let refuses = |judged: &JudgedAxes, scale: &Scale| {
            let mut findings = judged.findings(scale).into_iter().flatten();
            findings.any(|finding| finding.verdict == Verdict::Refuses)
        };
        for file in HAND_CONTROLLERS {
            let config = Config::load(Path::new(file)).unwrap();
            let judged = JudgedAxes::new(&config).unwrap();
            // The greatest factor on one product that holds, within a tenth.
            let most = (0..60).map(|tenths| 1.0 + 0.1 * f64::from(tenths));
            let of = |command: f64, force: f64| Scale { motion: command, rotation: command, force };
            let most = most.take_while(|most| !refuses(&judged, &of(*most, 1.0))).last().unwrap();
            for share in [0.0, 0.03, 0.2, 0.5, 0.8] {
                for smaller in [of(most * share, 1.0), of(most, share), of(1.0, most * share)] {
                    assert!(!refuses(&judged, &smaller), "{file}: {smaller:?} of {most}");
                }
            }
        }
    }
}
