//! Constants of a running node: its arm, the robot, the scene, the buses.

use nalgebra::Vector3;
use serde::Serialize;

use super::head::Head;
use super::pose::Pose;
use crate::origin::Origin;
use crate::status::JointLabel;
use config::robots::{RobotArm, RobotJoint};
use config::{Config, FarSide, JointParameters};
use remote::scene::HALF_CUBE;
use remote::site::Virtual;

/// Program that the node runs in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// `frhc run`.
    Run,
    /// `frhc demo`.
    Demo,
}

/// First line sent to each reader.
#[derive(Debug, Serialize)]
pub(super) struct Description<'a> {
    #[serde(flatten)]
    head: Head,
    program: &'static str,
    source: Source,
    configuration: String,
    started_at: Option<String>,
    period_us: u64,
    cycles_per_snapshot: u64,
    hand: Hand<'a>,
    robot: Option<Robot<'a>>,
    x_m_s: Pose,
    tool: Option<Tool>,
    scene: Scene,
    buses: Vec<Bus<'a>>,
    stops_by: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Hand<'a> {
    joints: [HandJoint<'a>; 6],
    x_6_g: Pose,
}

#[derive(Debug, Serialize)]
struct HandJoint<'a> {
    name: &'a str,
    kind: &'static str,
    alpha: f64,
    a: f64,
    d: f64,
    theta: f64,
    range: [f64; 2],
    max_torque: f64,
    position_unit: &'static str,
    torque_unit: &'static str,
}

#[derive(Debug, Serialize)]
struct Robot<'a> {
    name: &'a str,
    joints: Vec<RobotLink>,
    x_b_0: Pose,
    x_n_m: Pose,
}

#[derive(Debug, Serialize)]
struct RobotLink {
    alpha: f64,
    a: f64,
    d: f64,
    theta: f64,
    range: [f64; 2],
}

/// Body that touches the scene. A simulation of pegs sends another kind.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Tool {
    Cube { half_edge: f64 },
}

#[derive(Debug, Default, Serialize)]
struct Scene {
    wall: Option<Wall>,
    r#box: Option<Block>,
    sphere: Option<Sphere>,
}

#[derive(Debug, Serialize)]
struct Wall {
    point: [f64; 3],
    normal: [f64; 3],
}

#[derive(Debug, Serialize)]
struct Block {
    centre: [f64; 3],
    half_size: [f64; 3],
}

#[derive(Debug, Serialize)]
struct Sphere {
    centre: [f64; 3],
    radius: f64,
}

#[derive(Debug, Serialize)]
struct Bus<'a> {
    name: &'a str,
    bitrate: u32,
    load_limit_percent: f64,
}

impl<'a> Description<'a> {
    /// Describes the node of a configuration. `origin` is the wall clock at time zero; `None` in virtual time.
    pub(super) fn new(
        config: &'a Config,
        source: Source,
        origin: Option<Origin>,
        cycles_per_snapshot: u64,
    ) -> Self {
        let file = config.file.file_name().map(|name| name.to_string_lossy().into_owned());
        let Virtual { interaction, .. } = &config.remote;
        // Tool and scene of a far side are unknown here, unless a model describes them.
        let FarSide { agreement, model_limit, .. } = &config.far_side;
        let is_here = agreement.is_none() || model_limit.is_some();
        Self {
            head: Head::new("description"),
            program: concat!("frhc ", env!("CARGO_PKG_VERSION")),
            source,
            configuration: file.unwrap_or_default(),
            started_at: origin.map(Origin::utc),
            period_us: u64::try_from(config.period.as_micros()).unwrap_or(u64::MAX),
            cycles_per_snapshot,
            hand: Hand {
                joints: config.joints.each_ref().map(hand_joint),
                x_6_g: Pose::from_isometry(&config.x_6_g),
            },
            robot: config.robot.as_ref().filter(|_| is_here).map(robot),
            x_m_s: Pose::from_isometry(&interaction.sensor.x_m_s),
            tool: is_here.then_some(Tool::Cube { half_edge: HALF_CUBE }),
            scene: if is_here { scene(&config.remote) } else { Scene::default() },
            buses: config
                .buses
                .iter()
                .map(|bus| Bus {
                    name: &bus.name,
                    bitrate: bus.bitrate,
                    load_limit_percent: bus.load_limit_percent,
                })
                .collect(),
            stops_by: config.stopping().iter().map(ToString::to_string).collect(),
        }
    }
}

fn hand_joint(joint: &JointParameters) -> HandJoint<'_> {
    let link = &joint.plant.link;
    let label = JointLabel::from_parameters(joint);
    let [position_unit, torque_unit] = label.units();
    HandJoint {
        name: &joint.name,
        kind: if label.is_prismatic { "prismatic" } else { "revolute" },
        alpha: link.alpha,
        a: link.a,
        d: link.d,
        theta: link.theta,
        range: link.range,
        max_torque: joint.plant.actuator.max_torque,
        position_unit,
        torque_unit,
    }
}

fn robot(arm: &RobotArm) -> Robot<'_> {
    let link = |joint: &RobotJoint| RobotLink {
        alpha: joint.link.alpha,
        a: joint.link.a,
        d: joint.link.d,
        theta: joint.link.theta,
        range: joint.limit.range,
    };
    Robot {
        name: &arm.name,
        joints: arm.joints.iter().map(link).collect(),
        x_b_0: Pose::from_isometry(&arm.x_b_0),
        x_n_m: Pose::from_isometry(&arm.x_n_m),
    }
}

fn scene(remote: &Virtual) -> Scene {
    let wall = |(point, normal): (Vector3<f64>, Vector3<f64>)| Wall {
        point: point.into(),
        normal: normal.into(),
    };
    Scene {
        wall: remote.wall.map(|(point, normal, _)| wall((point, normal.into_inner()))),
        r#box: remote.block.map(|(centre, half_size, _)| Block {
            centre: centre.into(),
            half_size: half_size.into(),
        }),
        sphere: remote.sphere.map(|(centre, radius, _)| Sphere { centre: centre.into(), radius }),
    }
}
