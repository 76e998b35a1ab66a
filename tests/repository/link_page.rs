//! docs/link.md against the contract: its tables have the offsets of the interface files, and its test vectors are the
//! messages of the Rust code.

use std::fs;

use serde_json::Value;

use contract::{
    Capability, Command, Echo, FarState, Feedback, Gripper, Head, Measurements, Motion,
    PayloadRemoval, Pose, Reason,
};

const MESSAGES: [&str; 4] = ["Head", "Command", "Feedback", "Capability"];

fn page() -> String {
    fs::read_to_string("docs/link.md").unwrap()
}

/// Offset, size in bytes and name of a field.
type Field = (usize, usize, String);

/// Size in bytes of a type, as the page or an interface file writes it.
fn size(of: &str) -> usize {
    let (of, count) = of.strip_suffix(']').and_then(|of| of.split_once('[')).unwrap_or((of, "1"));
    let count: usize = count.parse().unwrap();
    count
        * match of {
            "uint8" => 1,
            "uint16" => 2,
            "uint32" => 4,
            "uint64" | "float64" => 8,
            "geometry_msgs/Twist" | "geometry_msgs/Wrench" => 48,
            "geometry_msgs/Pose" => 56,
            "Head" => 40,
            other => panic!("{other}"),
        }
}

/// Returns the rows of the page's table of a message.
fn table(page: &str, message: &str) -> Vec<Field> {
    let heading = format!("### {message}\n");
    let text = page.split_once(&heading).unwrap().1.split("\n#").next().unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| ")?.split_once(" | "));
    let rows = rows.filter_map(|(offset, rest)| Some((offset.parse().ok()?, rest)));
    rows.map(|(offset, rest)| {
        let mut cells = rest.split(" | ");
        (offset, size(cells.next().unwrap()), cells.next().unwrap().to_owned())
    })
    .collect()
}

/// Returns the fields of an interface file, without the head of a message.
fn interface(message: &str) -> Vec<Field> {
    let text = fs::read_to_string(format!("share/frhc_msgs/msg/{message}.msg")).unwrap();
    let (mut offset, mut fields) = (0, Vec::new());
    for line in text.lines() {
        let declared = line.split('#').next().unwrap().trim();
        let Some((of, name)) = declared.split_once(' ').filter(|_| !declared.contains('=')) else {
            continue;
        };
        // Plain CDR puts a gap before a number that does not stand at a multiple of its size.
        let element = size(of.split('[').next().unwrap()).min(8);
        assert_eq!(offset % element, 0, "{message}: {name}");
        if of != "Head" {
            fields.push((offset, size(of), name.trim().to_owned()));
        }
        offset += size(of);
    }
    fields
}

#[test]
fn tables_have_the_fields_of_the_interface_files() {
    let page = page();
    for message in MESSAGES {
        assert_eq!(table(&page, message), interface(message), "{message}");
    }
    let length = |message| {
        let (offset, size, _) = interface(message).pop().unwrap();
        4 + offset + size
    };
    let lengths = [Command::LENGTH, Feedback::LENGTH, Capability::LENGTH];
    assert_eq!(["Command", "Feedback", "Capability"].map(length), lengths);
}

#[test]
fn codes_have_the_names_of_the_interface_files() {
    let codes = |message: &str| -> Vec<(String, u8)> {
        let text = fs::read_to_string(format!("share/frhc_msgs/msg/{message}.msg")).unwrap();
        let constants =
            text.lines().filter_map(|line| line.strip_prefix("uint8 ")?.split_once('='));
        constants.map(|(name, code)| (name.to_owned(), code.parse().unwrap())).collect()
    };
    let feedback = codes("Feedback");
    let states = FarState::ALL.map(|state| (format!("{state:?}").to_uppercase(), state.code()));
    let in_capitals = |name: &str| {
        let mut words = String::new();
        for letter in name.chars() {
            words += if letter.is_uppercase() && !words.is_empty() { "_" } else { "" };
            words.extend(letter.to_uppercase());
        }
        words
    };
    let reasons = Reason::ALL.map(|reason| (in_capitals(&format!("{reason:?}")), reason.code()));
    assert_eq!(feedback[..states.len()], states);
    assert_eq!(feedback[states.len()..][..reasons.len()], reasons);
    let removals = PayloadRemoval::ALL.map(PayloadRemoval::code);
    let removes = codes("Capability").into_iter().filter(|(name, _)| name.starts_with("REMOVES_"));
    assert_eq!(removes.map(|(_, code)| code).collect::<Vec<_>>(), removals);
}

#[test]
fn test_vectors_are_the_messages_of_the_contract() {
    let page = page();
    let vectors = page.split("```json\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let mut kinds = Vec::new();
    for vector in vectors {
        let vector: Value = serde_json::from_str(vector).unwrap();
        let kind = vector["type"].as_str().unwrap().rsplit('/').next().unwrap().to_owned();
        let hex: String =
            vector["bytes"].as_array().unwrap().iter().map(|row| row.as_str().unwrap()).collect();
        let bytes: Vec<u8> = (0..hex.len())
            .step_by(2)
            .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap())
            .collect();
        let fields = &vector["fields"];
        match kind.as_str() {
            "Command" => {
                let command = command(fields);
                assert_eq!(command.encode()[..], bytes);
                assert_eq!(Command::decode(&bytes), Ok(command));
            }
            "Feedback" => {
                let feedback = feedback(fields);
                assert_eq!(feedback.encode()[..], bytes);
                assert_eq!(Feedback::decode(&bytes), Ok(feedback));
            }
            _ => {
                let (head, capability) = (head(fields), capability(fields));
                assert_eq!(capability.encode(&head)[..], bytes);
                assert_eq!(Capability::decode(&bytes), Ok((head, capability)));
            }
        }
        kinds.push(kind);
    }
    assert_eq!(kinds, ["Command", "Command", "Feedback", "Capability"]);
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn flag(value: &Value, bit: u64) -> bool {
    count(value) & bit != 0
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|place| number(&value[place]))
}

fn vectors(value: &Value, names: [&str; 2]) -> [f64; 6] {
    std::array::from_fn(|place| number(&value[names[place / 3]][["x", "y", "z"][place % 3]]))
}

fn pose(value: &Value) -> Pose {
    Pose {
        position: ["x", "y", "z"].map(|axis| number(&value["position"][axis])),
        orientation: ["x", "y", "z", "w"].map(|axis| number(&value["orientation"][axis])),
    }
}

fn gripper(fields: &Value) -> Gripper {
    let [position, force] = ["gripper_position", "gripper_force"].map(|key| number(&fields[key]));
    Gripper { position, force }
}

fn head(fields: &Value) -> Head {
    let head = &fields["head"];
    let message = |session, sequence| Echo {
        session: count(&head[session]),
        sequence: count(&head[sequence]),
    };
    Head {
        arm: count(&head["arm"]).try_into().unwrap(),
        epoch: count(&head["epoch"]).try_into().unwrap(),
        own: message("session", "sequence"),
        echo: message("echoed_session", "echoed_sequence"),
    }
}

fn command(fields: &Value) -> Command {
    Command {
        head: head(fields),
        motion: match count(&fields["mode"]) {
            0 => Motion::Hold,
            1 => Motion::Rate(vectors(&fields["rate"], ["linear", "angular"])),
            _ => Motion::Pose(pose(&fields["pose"])),
        },
        is_engaged: flag(&fields["engaged"], 1),
        asks_capability: flag(&fields["asks_capability"], 1),
        gripper: flag(&fields["has_gripper"], 1).then(|| gripper(fields)),
    }
}

fn feedback(fields: &Value) -> Feedback {
    let code = |key| u8::try_from(count(&fields[key])).unwrap();
    let valid = |bit| flag(&fields["valid"], bit);
    Feedback {
        head: head(fields),
        reason: Reason::from_code(code("reason"))
            .filter(|reason| reason.state().code() == code("state"))
            .unwrap(),
        obeyed_session: count(&fields["obeyed_session"]),
        acted_sequence: count(&fields["acted_sequence"]),
        measured: Measurements {
            wrench: valid(1).then(|| vectors(&fields["wrench"], ["force", "torque"])),
            pose: valid(2).then(|| pose(&fields["pose"])),
            gripper: valid(4).then(|| gripper(fields)),
        },
    }
}

fn capability(fields: &Value) -> Capability {
    let removal = u8::try_from(count(&fields["payload_removal"])).unwrap();
    let [senses, follows] =
        ["senses", "follows"].map(|key| move |bit: u64| flag(&fields[key], bit));
    Capability {
        senses_wrench: senses(1),
        senses_pose: senses(2),
        has_gripper: senses(4),
        follows_rates: follows(1),
        follows_poses: follows(2),
        payload_removal: PayloadRemoval::from_code(removal).unwrap(),
        accommodation: numbers(&fields["accommodation"]),
        deadband: numbers(&fields["deadband"]),
        servo_lag: number(&fields["servo_lag"]),
        sample_period: number(&fields["sample_period"]),
        hold_after: number(&fields["hold_after"]),
        sensor_range: numbers(&fields["sensor_range"]),
        stiffest_contact: number(&fields["stiffest_contact"]),
        max_speed: numbers(&fields["max_speed"]),
        workspace: [numbers(&fields["workspace_low"]), numbers(&fields["workspace_high"])],
    }
}
