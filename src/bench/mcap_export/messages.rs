//! ROS 2 messages of an export. The order of the fields is that of their definitions: CDR has no names.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::Serialize;

use units::spatial::{Twist, Wrench};

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Time {
    sec: i32,
    nanosec: u32,
}

impl Time {
    /// From nanoseconds since 1970. The latest one is in 2038.
    pub(crate) fn from_nanos(nanos: u64) -> Self {
        const SECOND: u64 = 1_000_000_000;
        Self {
            sec: i32::try_from(nanos / SECOND).unwrap_or(i32::MAX),
            nanosec: u32::try_from(nanos % SECOND).unwrap_or_default(),
        }
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Header {
    pub(crate) stamp: Time,
    pub(crate) frame_id: &'static str,
}

/// `geometry_msgs/Vector3` and `geometry_msgs/Point`.
#[derive(Clone, Copy, Debug, Serialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

impl From<Vector3<f64>> for Vector {
    fn from(vector: Vector3<f64>) -> Self {
        Self { x: vector.x, y: vector.y, z: vector.z }
    }
}

/// `geometry_msgs/Quaternion`.
#[derive(Clone, Copy, Debug, Serialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

impl From<UnitQuaternion<f64>> for Quaternion {
    fn from(rotation: UnitQuaternion<f64>) -> Self {
        let coords = rotation.coords;
        Self { x: coords.x, y: coords.y, z: coords.z, w: coords.w }
    }
}

/// `geometry_msgs/Pose` and `geometry_msgs/Transform`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Pose {
    position: Vector,
    orientation: Quaternion,
}

impl From<Isometry3<f64>> for Pose {
    fn from(x: Isometry3<f64>) -> Self {
        Self { position: x.translation.vector.into(), orientation: x.rotation.into() }
    }
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct PoseStamped {
    pub(crate) header: Header,
    pub(crate) pose: Pose,
}

/// Two vectors, a linear and an angular one: `geometry_msgs/Wrench` and `geometry_msgs/Twist`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Screw {
    linear: Vector,
    angular: Vector,
}

impl From<Wrench> for Screw {
    fn from(wrench: Wrench) -> Self {
        Self { linear: wrench.force.into(), angular: wrench.moment.into() }
    }
}

impl From<Twist> for Screw {
    fn from(twist: Twist) -> Self {
        Self { linear: twist.linear.into(), angular: twist.angular.into() }
    }
}

/// `geometry_msgs/WrenchStamped` and `geometry_msgs/TwistStamped`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct ScrewStamped {
    pub(crate) header: Header,
    pub(crate) screw: Screw,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: &'static str,
    pub(crate) transform: Pose,
}

/// `tf2_msgs/TFMessage`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Transforms {
    pub(crate) transforms: Vec<TransformStamped>,
}

/// `sensor_msgs/JointState`.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct JointState<'a> {
    pub(crate) header: Header,
    pub(crate) name: &'a [String],
    pub(crate) position: &'a [f64],
    pub(crate) velocity: &'a [f64],
    pub(crate) effort: &'a [f64],
}

/// Level of a `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
    Ok,
    Warn,
    Error,
}

impl Serialize for Level {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u8(match self {
            Self::Ok => 0,
            Self::Warn => 1,
            Self::Error => 2,
        })
    }
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct KeyValue {
    pub(crate) key: &'static str,
    pub(crate) value: String,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DiagnosticStatus {
    pub(crate) level: Level,
    pub(crate) name: String,
    pub(crate) message: String,
    pub(crate) hardware_id: &'static str,
    pub(crate) values: Vec<KeyValue>,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct DiagnosticArray {
    pub(crate) header: Header,
    pub(crate) status: Vec<DiagnosticStatus>,
}
