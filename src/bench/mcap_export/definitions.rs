//! ROS 2 message definitions of an export, as rosbag2 writes them: a type, and all types that it consists of.

/// Types without their packages' `msg`, and their definitions. Comments are left out.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    (
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    ),
    ("geometry_msgs/Wrench", "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"),
    ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/WrenchStamped", "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n"),
    ("geometry_msgs/TwistStamped", "std_msgs/Header header\ngeometry_msgs/Twist twist\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    (
        "sensor_msgs/JointState",
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    ),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
         string hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
    ),
    (
        "diagnostic_msgs/DiagnosticArray",
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    ),
    ("frhc_msgs/Head", include_str!("../../../share/frhc_msgs/msg/Head.msg")),
    ("frhc_msgs/Command", include_str!("../../../share/frhc_msgs/msg/Command.msg")),
];

/// Line between two definitions.
const RULE: &str =
    "================================================================================";

/// Returns the definition of a type, followed by those of the types that it consists of.
pub(crate) fn with_dependencies(name: &str) -> String {
    let mut found = Vec::new();
    collect(name, &mut found);
    let mut text = String::new();
    for (place, (name, definition)) in found.iter().enumerate() {
        if place > 0 {
            text.push_str(&format!("{RULE}\nMSG: {name}\n"));
        }
        text.push_str(definition);
    }
    text
}

/// Appends a type and its dependencies, each once, in the order in which they are named.
fn collect(name: &str, found: &mut Vec<(String, &'static str)>) {
    let definition = DEFINITIONS.iter().find(|(known, _)| *known == name);
    let Some((_, definition)) = definition.filter(|_| found.iter().all(|(it, _)| it != name))
    else {
        return;
    };
    found.push((name.to_owned(), definition));
    let package = name.split('/').next().unwrap_or_default();
    for line in definition.lines() {
        let field = line.split(['#', ' ', '[']).next().unwrap_or_default();
        let is_relative = field.starts_with(|first: char| first.is_ascii_uppercase());
        let field = if is_relative { format!("{package}/{field}") } else { field.to_owned() };
        if field.contains('/') {
            collect(&field, found);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definition_is_followed_by_each_dependency_once() {
        let text = with_dependencies("tf2_msgs/TFMessage");
        assert!(text.starts_with("geometry_msgs/TransformStamped[] transforms\n===="), "{text}");
        let messages: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
        let expected = [
            "geometry_msgs/TransformStamped",
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "geometry_msgs/Transform",
            "geometry_msgs/Vector3",
            "geometry_msgs/Quaternion",
        ];
        assert_eq!(messages, expected);
    }

    #[test]
    fn every_named_type_has_a_definition() {
        for (name, definition) in DEFINITIONS {
            for field in definition.lines().filter_map(|line| line.split([' ', '[']).next()) {
                let is_known = DEFINITIONS.iter().any(|(known, _)| *known == field);
                assert!(!field.contains('/') || is_known, "{name}: {field}");
            }
        }
    }

    #[test]
    fn types_of_the_same_package_are_found_without_its_name() {
        let text = with_dependencies("frhc_msgs/Command");
        assert!(
            text.contains("\nMSG: frhc_msgs/Head\n") && text.contains("uint64 echoed_sequence")
        );
    }
}
