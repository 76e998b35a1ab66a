//! Status of a node as rows of name and value.

use serde_json::{Map, Value};

use units::wording::{listed, without_minus_zero};

/// Units of members that have no unit in their name. Torques of a prismatic joint are in N.
const UNITS: [(&str, &str); 4] = [
    ("f_g_task", "N, N·m"),
    ("p_b_m", "m"),
    ("budget", "N·m; N of a prismatic joint"),
    ("joints", "position, torque, target torque of rated"),
];

/// Least width of a number in a list.
const NUMBER: usize = 8;

/// Members that are omitted, because the rows of the joints contain them with names and units.
const IN_JOINTS: [&str; 3] = ["q", "tau", "targets"];

/// Formats a status as rows of name and value; members of an object follow it, indented.
pub(super) fn table(status: &Value) -> String {
    let mut status = status.clone();
    let joints = status.get("joints").and_then(|joints| joints.as_array().cloned());
    let joints = joints.unwrap_or_default();
    if let Some(members) = status.as_object_mut().filter(|_| !joints.is_empty()) {
        IN_JOINTS.iter().for_each(|name| drop(members.remove(*name)));
    }
    name_joints(&mut status, &joints);
    rows(&status, 0, &joints).join("\n")
}

/// Replaces the lists of numbers of joints by text with their names.
fn name_joints(status: &mut Value, joints: &[Value]) {
    let name = |number: &Value| {
        let joint = joints.iter().find(|joint| joint.get("joint") == Some(number));
        joint.and_then(|joint| joint.get("name")).map_or_else(|| plain(number), plain)
    };
    let unknown = |it: &Value| {
        let part = |name| it.get(name).unwrap_or(&Value::Null);
        format!("{}: {}", name(part("joint")), plain(part("why")))
    };
    let mut replace = |member: &str, text: &dyn Fn(&Value) -> String| {
        let Some(value) = status.get_mut(member) else { return };
        let texts = value.as_array().map(|list| list.iter().map(text).collect::<Vec<_>>());
        let text = texts.filter(|texts| !texts.is_empty()).map(|texts| listed(&texts));
        *value = text.map_or(Value::Null, Value::from);
    };
    replace("not_off", &name);
    replace("zero_unknown", &unknown);
}

fn rows(object: &Value, indent: usize, joints: &[Value]) -> Vec<String> {
    let names: Vec<_> = joints.iter().filter_map(|joint| joint.get("name")?.as_str()).collect();
    let column = names.iter().map(|name| name.chars().count()).fold(NUMBER, usize::max);
    let members = object.as_object().into_iter().flatten();
    let members = members.filter(|(_, value)| !value.is_null());
    let of_member = |(name, value): (&String, &Value)| {
        let unit = UNITS.iter().find(|(member, _)| member == name).map(|(_, unit)| *unit);
        let name = format!("{:indent$}{name}", "");
        let headed = || unit.map_or_else(|| name.clone(), |unit| format!("{name}, {unit}"));
        let items = value.as_array().filter(|list| list.iter().any(Value::is_object));
        let steps = value.as_array().filter(|_| name.trim_start() == "way_out");
        if let Some(steps) = steps {
            steps.iter().enumerate().map(|(place, step)| step_row(&name, place, step)).collect()
        } else if let Some(list) = items {
            [vec![headed()], list.iter().map(joint_row).collect()].concat()
        } else if let Some(members) = value.as_object().filter(|of| is_percentiles(of)) {
            let value = |(name, value)| format!("{name} {}", plain(value));
            let values = members.iter().map(value).collect::<Vec<_>>().join(", ");
            vec![format!("{:26} {values}", headed())]
        } else if let Some(members) = value.as_object() {
            // Each list contains all joints.
            let has_lists = members.values().any(Value::is_array);
            let names: String = names.iter().map(|name| format!("{name:>column$} ")).collect();
            let columns = (has_lists && !names.is_empty()).then(|| row("", &names));
            let columns = columns.into_iter().collect();
            [vec![headed()], columns, rows(value, indent + 2, joints)].concat()
        } else if let Some(list) = value.as_array() {
            let numbers: String =
                list.iter().map(|it| format!("{:>column$} ", plain(it))).collect();
            vec![row(&headed(), &numbers)]
        } else {
            vec![row(&headed(), &plain(value))]
        }
    };
    members.flat_map(of_member).collect()
}

/// Formats a step that leads on; the first has the name of the member.
fn step_row(name: &str, place: usize, step: &Value) -> String {
    row(if place == 0 { name } else { "" }, &format!("{}. {}", place + 1, plain(step)))
}

/// Returns whether these are percentiles of one time, which fit into a row.
fn is_percentiles(members: &Map<String, Value>) -> bool {
    members.get("p50").is_some_and(Value::is_u64)
}

/// Formats position, torque and target of a joint with their units.
fn joint_row(joint: &Value) -> String {
    let member = |name: &str| joint.get(name).map(plain).unwrap_or_default();
    let value = |name: &str| {
        let unit = member(&format!("{name}_unit"));
        format!("{:>8} {unit:4}", member(name))
    };
    let values =
        format!("{} {} {:>5} ‰", value("position"), value("torque"), member("target_per_mille"));
    row(&format!("  {}", member("name")), &values)
}

/// Formats one row: a name in a column, then its value.
pub(super) fn row(name: &str, value: &str) -> String {
    format!("{name:16} {value}")
}

fn plain(value: &Value) -> String {
    if let Some(text) = value.as_str() {
        return text.to_owned();
    }
    if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
        return without_minus_zero(format!("{number:.3}"));
    }
    value.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_is_rows_of_names_and_values() {
        let status = serde_json::json!({
            "mode": "armed", "stopped_by": null, "q": [0.5, -1.0],
            "budget": { "task": [0.0, 1.5], "assist_scale": 1.0, "limiting_joint": null },
        });
        let rows = "mode             armed\n\
            q                   0.500   -1.000 \n\
            budget, N·m; N of a prismatic joint\n\
            \x20 task              0.000    1.500 \n\
            \x20 assist_scale   1.000";
        assert_eq!(table(&status), rows);
    }

    #[test]
    fn joints_have_names_and_units() {
        let joint = |name: &str, units: [&str; 2]| {
            serde_json::json!({
                "joint": 1, "name": name, "position": 0.5, "position_unit": units[0],
                "torque": -1.25, "torque_unit": units[1], "target_per_mille": -12,
            })
        };
        let status = serde_json::json!({
            "reflection": "off", "q": [0.5, 0.5], "p_b_m": [0.1, 0.2, 0.3],
            "joints": [joint("azimuth", ["rad", "N·m"]), joint("lift", ["m", "N"])],
            "budget": { "gravity": [0.0, 1.5] }, "lost": { "frames": 0 },
        });
        let table = table(&status);
        for line in [
            "reflection       off",
            "  azimuth           0.500 rad    -1.250 N·m    -12 ‰",
            "  lift              0.500 m      -1.250 N      -12 ‰",
            "p_b_m, m            0.100    0.200    0.300 ",
            "                  azimuth     lift ",
            "  gravity           0.000    1.500 ",
        ] {
            assert!(table.lines().any(|one| one == line), "{line:?} in\n{table}");
        }
        assert!(!table.lines().any(|line| line.starts_with("q ")), "{table}");
        assert_eq!(table.matches("azimuth").count(), 2, "{table}");
    }

    #[test]
    fn stop_has_names_and_the_way_out() {
        let names = ["elevation of the arm", "elbow"];
        let joints = (1..)
            .zip(names)
            .map(|(joint, name)| serde_json::json!({ "joint": joint, "name": name }));
        let status = serde_json::json!({
            "mode": "drives-off", "not_off": [1, 2], "way_out": ["Remove the cause.", "Reset."],
            "joints": joints.collect::<Vec<_>>(),
            "zero_unknown": [{ "joint": 2, "why": "the drive has rebooted" }],
            "budget": { "gravity": [-0.0001, 1.5] },
        });
        let table = table(&status);
        for line in [
            "not_off          elevation of the arm and elbow",
            "way_out          1. Remove the cause.",
            "                 2. Reset.",
            "zero_unknown     elbow: the drive has rebooted",
            "                 elevation of the arm                elbow ",
            "  gravity                       0.000                1.500 ",
        ] {
            assert!(table.lines().any(|one| one == line), "{line:?} in\n{table}");
        }
    }
}
