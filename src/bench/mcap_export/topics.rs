//! Topics of an export, named as the Collaborative Robotics Toolkit (CRTK) names them, and the frames of its messages.

use crate::definitions;

/// Base {0} of the hand controller, and its links {1} to {6}.
pub(crate) const LINKS: [&str; 7] =
    ["frhc/0", "frhc/1", "frhc/2", "frhc/3", "frhc/4", "frhc/5", "frhc/6"];

/// Base {0} of the hand controller.
pub(crate) const ARM_BASE: &str = "frhc/0";

/// Frame {G} of the grip.
pub(crate) const GRIP: &str = "frhc/g";

/// Base {b} of the robot or scene.
pub(crate) const OBJECT_BASE: &str = "frhc/b";

/// Frame {MRF} of the commanded object.
pub(crate) const OBJECT: &str = "frhc/m";

/// Force sensor {S}.
pub(crate) const SENSOR: &str = "frhc/s";

/// Topics of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Topic {
    /// Joint positions and commanded torques.
    MeasuredJs,
    /// Pose of {G} in {0}.
    MeasuredCp,
    /// Twist of {G} in {G}.
    MeasuredCv,
    /// Wrench on the hand at {G}, in {G}.
    SetpointCf,
    /// Part of it that reflects the task.
    TaskCf,
    /// Wrench of the environment on the object at {S}, in {S}.
    ObjectMeasuredCf,
    /// Pose of {MRF} in {b}.
    ObjectMeasuredCp,
    /// Commanded pose of {MRF} in {b}.
    ObjectSetpointCp,
    /// Commanded twist of {MRF} in {MRF}.
    ObjectSetpointCv,
    /// Same commands as a message of the link.
    Command,
    /// Transforms of the links and of the object.
    Tf,
    /// Transforms that do not change.
    TfStatic,
    /// State of node, drives and buses.
    Diagnostics,
    /// Mode, timing and link of the cycle.
    Status,
    /// Torque budget of the cycle.
    Torques,
}

/// Encoding of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// CDR of a ROS 2 type, as package and name.
    Cdr { package: &'static str, name: &'static str },
    /// JSON: the schema and its name.
    Json { name: &'static str, schema: &'static str },
}

const fn ros(package: &'static str, name: &'static str) -> Encoding {
    Encoding::Cdr { package, name }
}

impl Topic {
    /// Topics in the order of their declaration, those without a ROS type last.
    pub(crate) const ALL: [Self; 15] = [
        Self::MeasuredJs,
        Self::MeasuredCp,
        Self::MeasuredCv,
        Self::SetpointCf,
        Self::TaskCf,
        Self::ObjectMeasuredCf,
        Self::ObjectMeasuredCp,
        Self::ObjectSetpointCp,
        Self::ObjectSetpointCv,
        Self::Command,
        Self::Tf,
        Self::TfStatic,
        Self::Diagnostics,
        Self::Status,
        Self::Torques,
    ];

    /// Returns the name in the file, with its leading slash.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::MeasuredJs => "/frhc/measured_js",
            Self::MeasuredCp => "/frhc/measured_cp",
            Self::MeasuredCv => "/frhc/measured_cv",
            Self::SetpointCf => "/frhc/setpoint_cf",
            Self::TaskCf => "/frhc/task/setpoint_cf",
            Self::ObjectMeasuredCf => "/frhc/object/measured_cf",
            Self::ObjectMeasuredCp => "/frhc/object/measured_cp",
            Self::ObjectSetpointCp => "/frhc/object/setpoint_cp",
            Self::ObjectSetpointCv => "/frhc/object/setpoint_cv",
            Self::Command => "/frhc/object/command",
            Self::Tf => "/tf",
            Self::TfStatic => "/tf_static",
            Self::Diagnostics => "/diagnostics",
            Self::Status => "/frhc/status",
            Self::Torques => "/frhc/torques",
        }
    }

    /// Returns the encoding of its messages.
    pub(crate) const fn encoding(self) -> Encoding {
        match self {
            Self::MeasuredJs => ros("sensor_msgs", "JointState"),
            Self::MeasuredCp | Self::ObjectMeasuredCp | Self::ObjectSetpointCp => {
                ros("geometry_msgs", "PoseStamped")
            }
            Self::MeasuredCv | Self::ObjectSetpointCv => ros("geometry_msgs", "TwistStamped"),
            Self::SetpointCf | Self::TaskCf | Self::ObjectMeasuredCf => {
                ros("geometry_msgs", "WrenchStamped")
            }
            Self::Command => ros("frhc_msgs", "Command"),
            Self::Tf | Self::TfStatic => ros("tf2_msgs", "TFMessage"),
            Self::Diagnostics => ros("diagnostic_msgs", "DiagnosticArray"),
            Self::Status => Encoding::Json {
                name: "frhc.Status",
                schema: include_str!("json_schemas/status.json"),
            },
            Self::Torques => Encoding::Json {
                name: "frhc.Torques",
                schema: include_str!("json_schemas/torques.json"),
            },
        }
    }

    /// Returns the durability of its publisher: 1 is transient local, 2 volatile (rmw).
    pub(crate) const fn durability(self) -> u8 {
        if matches!(self, Self::TfStatic) { 1 } else { 2 }
    }
}

impl Encoding {
    /// Returns whether messages have a ROS type.
    pub(crate) const fn is_ros(self) -> bool {
        matches!(self, Self::Cdr { .. })
    }

    /// Returns the name of its schema in the file.
    pub(crate) fn schema_name(self) -> String {
        match self {
            Self::Cdr { package, name } => format!("{package}/msg/{name}"),
            Self::Json { name, .. } => name.to_owned(),
        }
    }

    /// Returns the schema's encoding, its text, and the encoding of the messages, by their well-known names.
    pub(crate) fn schema(self) -> (&'static str, String, &'static str) {
        match self {
            Self::Cdr { package, name } => {
                let text = definitions::with_dependencies(&format!("{package}/{name}"));
                ("ros2msg", text, "cdr")
            }
            Self::Json { schema, .. } => ("jsonschema", schema.to_owned(), "json"),
        }
    }
}
