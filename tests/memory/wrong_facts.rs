//! A wrong sign or scale of a joint whose drive verifies neither: found by the rest posture, before any torque.

use crate::common::prelude::*;
use crate::common::rest::{KRAFT_LIKE, at_rest};
use crate::common::zero::{with_second_rest, with_zero};
use canopen::fact::Fact;
use node::{RequestError, Unfit};

/// Shipped arms, with a rest posture for each: degrees, and metres of the slide.
const ARMS: [(&str, [f64; 6]); 3] = [
    (KRAFT_500HZ, KRAFT_LIKE),
    (JPL, [25.0, -25.0, 0.42, 30.0, -30.0, 30.0]),
    (SIXR, [25.0, -70.0, 120.0, 30.0, 40.0, -30.0]),
];

/// Place of the configurations, whose paths are relative to it.
const FILE: &str = "config/test.toml";

/// Objects that verify sign and position scale.
const VERIFYING: [&str; 4] = ["607E", "608F", "6091", "6092"];

/// Returns the path of a data sheet without [`VERIFYING`] objects: they are of the maker.
fn sheet(test: &str) -> String {
    let mut sheet = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    for object in VERIFYING {
        let own = object.replacen('6', "2", 1);
        sheet = sheet.replace(&format!("=0x{object}"), &format!("=0x{own}"));
        sheet = sheet.replace(&format!("[{object}"), &format!("[{own}"));
    }
    let path = folder("wrong_facts", test).join("drive.eds");
    fs::write(&path, sheet).unwrap();
    fs::canonicalize(path).unwrap().to_str().unwrap().to_owned()
}

/// Returns a shipped configuration with low force limits, this rest posture, and drives that cannot verify sign and scale.
fn arm(test: &str, file: &str, rest: [f64; 6]) -> String {
    let text = fs::read_to_string(file).unwrap().replace("../eds/frhc_drive.eds", &sheet(test));
    let text = text.replace("max_force_n = 40.0 ", "max_force_n = 2.0 ");
    let text = text.replace("push = 0.2 ", "push = 0.05 ").replace("push = 0.5 ", "push = 0.05 ");
    let accepted = "\naccept_stated_only = [\"sign\", \"position_scale\"]\nencoder_counts_per_rev";
    at_rest(&text.replace("\nencoder_counts_per_rev", accepted), rest)
}

/// Returns the text with a change in one joint's section.
fn in_joint(text: &str, joint: usize, change: impl Fn(&str) -> String) -> String {
    let mut parts: Vec<String> = text.split("\n[[joint]]\n").map(str::to_owned).collect();
    parts[joint] = change(&parts[joint]);
    parts.join("\n[[joint]]\n")
}

/// Returns a configuration with the opposite direction of the drive of this joint.
fn reversed(text: &str, joint: usize) -> String {
    in_joint(text, joint, |part| match part.contains("gear_ratio = -") {
        true => part.replace("gear_ratio = -", "gear_ratio = "),
        false => part.replace("gear_ratio = ", "gear_ratio = -"),
    })
}

/// Returns a configuration whose drive of this joint counts `halves / 2` times its increments.
fn counting(text: &str, joint: usize, halves: u32) -> String {
    in_joint(text, joint, |part| {
        let increments = 16_384 / 2 * halves;
        part.replace(
            "encoder_counts_per_rev = 16384",
            &format!("encoder_counts_per_rev = {increments}"),
        )
    })
}

/// Returns a node of `node` with the arm of `world`, without requests.
fn bench(world: &str, node: &str) -> Bench<Wire> {
    let [world, node] = [world, node].map(|text| parse(FILE, text));
    Bench::in_world_of(&world, &node, script("seconds = 9\n"), 1, Wire::default())
}

/// Returns the refusal of a request to arm; asserts that no motor exerted torque afterwards.
fn arming_refusal(world: &str, node: &str) -> String {
    let mut bench = bench(world, node);
    // A position beyond its limit at the start ends the boot of a tenfold scale.
    if let Err(error) = bench.bring_up() {
        return error.to_string();
    }
    let refused = bench.ask(Request::Arm).map(|_| ()).map_err(|error| error.to_string());
    for _ in 0..300 {
        bench.cycle();
        let torques = bench.world_mut().torques();
        assert!(torques.abs().max() < 1e-9, "{refused:?}: {torques:?}");
    }
    refused.unwrap_err()
}

#[test]
fn hazard_41_wrong_sign_or_scale_is_refused_before_torque() {
    for (file, rest) in ARMS {
        let right = arm("wrong", file, rest);
        for joint in 1..=6 {
            let wrong = [reversed(&right, joint), counting(&right, joint, 4)]
                .into_iter()
                .chain([1, 20].map(|halves| counting(&right, joint, halves)));
            for (which, world) in wrong.enumerate() {
                let refused = arming_refusal(&world, &right);
                let names = refused.contains(&format!("joint {joint}"));
                let others = (1..=6).filter(|other| *other != joint);
                let blames =
                    others.filter(|other| refused.contains(&format!("joint {other} "))).count();
                assert!(names && blames == 0, "{file}, joint {joint}, case {which}: {refused}");
            }
        }
    }
}

/// Second rest posture of each of [`ARMS`].
const SECOND: [[f64; 6]; 3] = [
    [0.0, -80.0, 60.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.36, 0.0, 0.0, 0.0],
    [0.0, -40.0, 90.0, 0.0, 10.0, 0.0],
];

/// Zeroes an arm in its rest posture, moves it to the second one and back, and returns the refusal to arm, `None` if it is
/// armed.
fn zeroed(world: &str, node: &str) -> Option<String> {
    let mut bench = bench(world, node);
    if let Err(error) = bench.bring_up() {
        return Some(error.to_string());
    }
    let config = parse(FILE, node);
    let run = |bench: &mut Bench<Wire>, millis: u32| {
        (0..millis / u32::try_from(config.period.as_millis().max(1)).unwrap())
            .for_each(|_| _ = bench.cycle());
    };
    run(&mut bench, 1_100);
    if let Err(error) = bench.ask(Request::Zero(None)) {
        return Some(error.to_string());
    }
    for is_second in [true, false] {
        let q = config.joints.each_ref().map(|joint| {
            let rest = if is_second { joint.second_rest } else { joint.rest };
            rest.unwrap().position()
        });
        bench.world_mut().guide_to(q);
        run(&mut bench, 2_500);
    }
    assert!(bench.world_mut().torques().amax() < 1e-9, "no torque before arming");
    bench.ask(Request::Arm).err().map(|error| error.to_string())
}

/// Asserts that arms of this kind are refused with a wrong sign or scale of any joint, and armed without.
fn is_verified(kind: &str) {
    for ((file, rest), second) in ARMS.into_iter().zip(SECOND) {
        let absolute = arm(kind, file, rest);
        let of_kind = |text: &str| with_second_rest(&with_zero(text, kind), second);
        let right = of_kind(&absolute);
        assert_eq!(zeroed(&right, &right), None, "{file}, {kind}");
        for joint in 1..=6 {
            let wrong = [reversed(&absolute, joint), counting(&absolute, joint, 4)]
                .into_iter()
                .chain([1, 20].map(|halves| counting(&absolute, joint, halves)));
            for (which, world) in wrong.enumerate() {
                let refused = zeroed(&of_kind(&world), &right).unwrap_or_default();
                let is_named =
                    [" (", ":"].iter().any(|end| refused.contains(&format!("joint {joint}{end}")));
                assert!(is_named, "{file}, {kind}, joint {joint}, case {which}: {refused}");
            }
        }
    }
}

#[test]
fn hazard_51_wrong_fact_of_single_turn_joint_is_refused() {
    is_verified("single-turn");
}

#[test]
fn hazard_51_wrong_fact_of_rest_joint_is_refused() {
    is_verified("rest");
}

#[test]
fn hazard_51_wrong_fact_of_homing_joint_is_refused() {
    is_verified("homing");
}

#[test]
fn right_arm_at_rest_is_armed_and_carried() {
    for (file, rest) in ARMS {
        let text = arm("right", file, rest);
        let mut bench = bench(&text, &text);
        bench.bring_up().unwrap();
        bench.ask(Request::Arm).unwrap_or_else(|error| panic!("{file}: {error}"));
        for _ in 0..2_000 {
            let record = bench.cycle();
            assert_eq!((record.mode, record.cause), (Mode::Armed, None), "{file}");
        }
    }
}

/// Returns the first arm of [`ARMS`] with the elbow's cradle elsewhere.
fn placed(text: &str, degrees: f64) -> String {
    text.replace("rest_deg = 95\n", &format!("rest_deg = {degrees}\n"))
}

#[test]
fn arm_is_at_rest_within_five_degrees() {
    let (file, rest) = ARMS[0];
    let text = arm("placed", file, rest);
    for (degrees, is_armed) in [(90.5, true), (99.0, true), (89.0, false), (101.5, false)] {
        let mut bench = bench(&placed(&text, degrees), &text);
        bench.bring_up().unwrap();
        match bench.ask(Request::Arm) {
            Ok(_) => assert!(is_armed, "{degrees}°"),
            Err(RequestError::Unfit(reasons)) => {
                let [Unfit::NotAtRest(reason)] = &reasons[..] else { panic!("{reasons:?}") };
                let reason = reason.to_string();
                assert!(!is_armed, "{degrees}°: {reason}");
                for part in
                    ["joint 3 (elbow): reads ", "rest_deg is 95.0°, within 5.0°", "gear_ratio"]
                {
                    assert!(reason.contains(part), "{part}: {reason}");
                }
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn rest_is_required_once_after_each_boot() {
    let (file, rest) = ARMS[0];
    let text = arm("once", file, rest);
    let mut bench = bench(&text, &text);
    bench.bring_up().unwrap();
    bench.ask(Request::Arm).unwrap();
    (0..700).for_each(|_| _ = bench.cycle());
    bench.ask(Request::Disarm).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    // Without torque the arm sinks into the hand.
    (0..700).for_each(|_| _ = bench.cycle());
    let sunk = bench.cycle().output.q[3].to_degrees();
    assert!((sunk + 45.0).abs() > 6.0, "pitch at {sunk}°");
    bench.ask(Request::Arm).unwrap();
    bench.ask(Request::Disarm).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    bench.world_mut().set_lays_down(false);
    bench.bring_up().unwrap();
    (0..700).for_each(|_| _ = bench.cycle());
    let Err(RequestError::Unfit(reasons)) = bench.ask(Request::Arm) else { panic!("armed") };
    assert!(matches!(&reasons[..], [Unfit::NotAtRest(_)]), "{reasons:?}");
    // An operator who lays it down.
    bench.world_mut().set_lays_down(true);
    bench.bring_up().unwrap();
    (0..700).for_each(|_| _ = bench.cycle());
    bench.ask(Request::Arm).unwrap();
}

#[test]
fn accepted_facts_need_a_rest_posture() {
    let (file, rest) = ARMS[0];
    let text = arm("needed", file, rest);
    let without = text.replace("rest_deg = -45\n", "").replace("rest_deg = 95\n", "");
    let refused = refusal(FILE, &without);
    assert!(
        refused.contains(
            "joint[2].rest_deg: rest_deg must state the position at the first arming after a boot, which alone verifies sign \
             and position scale: elbow, pitch"
        ),
        "{refused}"
    );
    assert_eq!(refused.lines().count(), 1, "{refused}");
    let near = refusal(FILE, &text.replace("rest_deg = 95\n", "rest_deg = 19\n"));
    assert!(near.contains("joint[2].rest_deg: must be at least 20.0°"), "{near}");
    assert!(near.contains("got 19.0°"), "{near}");
    let beyond = refusal(FILE, &text.replace("rest_deg = 95\n", "rest_deg = 141\n"));
    assert!(
        beyond.contains("joint[2].rest_deg: the joint would rest out of its range"),
        "{beyond}"
    );
    let sliding = refusal(FILE, &text.replace("rest_deg = 95\n", "rest_m = 0.5\n"));
    assert!(sliding.contains("a revolute joint has `rest_deg`"), "{sliding}");
    // Drives that verify both need none.
    let verified = fs::read_to_string(file).unwrap();
    let eds = fs::canonicalize("eds").unwrap();
    parse(FILE, &verified.replace("../eds", &eds.to_string_lossy()));
}

#[test]
fn coupled_actuator_must_rest_off_its_zero() {
    let (file, rest) = ARMS[0];
    let coupling = "[coupling]\nmatrix = [[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, -2, 1, 0, 0, 0], \
        [0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n[controller]\n";
    let text = arm("coupled", file, rest).replace("[controller]\n", coupling);
    // The elbow's actuator is at 95° - 2 times 50°.
    let refused = refusal(FILE, &text);
    assert!(
        refused.contains("joint[2].rest_deg: must be at least 20.0° from the zero"),
        "{refused}"
    );
    assert!(refused.contains("got 5.0°"), "{refused}");
}

#[test]
fn every_joint_of_a_shipped_file_states_its_rest() {
    let mut accepting = Vec::new();
    for name in HAND_CONTROLLERS {
        let config = config(name);
        assert!(config.joints.iter().all(|joint| joint.rest.is_some()), "{name}");
        let accepts = |fact: &Fact| *fact != Fact::TorqueUnit;
        if config.joints.iter().any(|joint| joint.accepted.iter().any(accepts)) {
            accepting.push(name);
        }
    }
    assert_eq!(accepting.len(), 3, "{accepting:?}");
}
