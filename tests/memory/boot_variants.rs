//! Boots as drives do them and people set them up: swapped drives, warnings by EMCY, slow enabling.

use crate::common::prelude::*;

fn bench(world: &Config, config: &Config, faults: &str) -> Bench<Wire> {
    let scenario = script(&format!("seconds = 20\n{faults}"));
    Bench::in_world_of(world, config, scenario, 1, Wire::default())
}

#[test]
fn swapped_drives_are_named_and_a_wrong_rating_is_not() {
    let right = text(KRAFT_500HZ);
    let world = right
        .replace("\nnode_id = 2\n", "\nnode_id = 93\n")
        .replace("\nnode_id = 3\n", "\nnode_id = 2\n")
        .replace("\nnode_id = 93\n", "\nnode_id = 3\n");
    assert_ne!(world, right);
    let config = parse(KRAFT_500HZ, &right);
    let error = bench(&parse(KRAFT_500HZ, &world), &config, "").bring_up().unwrap_err().to_string();
    let remedy =
        "so the drives seem to be swapped: exchange their node-ids or cables, not their keys";
    let lines: Vec<&str> = error.lines().collect();
    assert_eq!(
        lines,
        [
            format!(
                "joint 2 (elevation), node 2: rated torque (6076h) is 131 mN·m, expected 176.5 mN·m: it fits joint 3 (elbow), \
                 node 3, {remedy}"
            ),
            format!(
                "joint 3 (elbow), node 3: rated torque (6076h) is 177 mN·m, expected 130.7 mN·m: it fits joint 2 (elevation), \
                 node 2, {remedy}"
            ),
        ]
    );

    let world = right.replace("rated_torque_nm = 0.1307", "rated_torque_nm = 0.1765");
    let error = bench(&parse(KRAFT_500HZ, &world), &config, "").bring_up().unwrap_err().to_string();
    assert!(error.contains("correct rated_torque_nm") && !error.contains("swapped"), "{error}");
}

/// Returns an armed bench of the file whose joints list these codes.
fn armed(file: &str) -> Bench<Wire> {
    let config = parse(file, &in_each_joint(&text(file), "emcy_warnings = [0x8611, 0xFF01]"));
    let mut bench = bench(&config, &config, "");
    bench.bring_up().unwrap_or_else(|error| panic!("{file}: {error}"));
    bench.run(20);
    bench.ask(Request::Arm).unwrap();
    bench.run(20);
    while bench.next_event().is_some() {}
    bench
}

#[test]
fn hazard_07_listed_emergency_warns_and_every_other_one_stops() {
    for file in HAND_CONTROLLERS {
        let mut warned = armed(file);
        for code in [0x8611, 0xFF01] {
            warned.world_mut().drive_mut(ELBOW).unwrap().report_transient_error(code, 0);
            warned.run(20);
            assert_eq!(warned.node().mode(), Mode::Armed, "{file}: {code:04X}h");
            let events: Vec<_> = std::iter::from_fn(|| warned.next_event()).collect();
            let is_warning = |event: &Event| {
                matches!(event, Event::EmergencyWarning { node, emergency }
                    if *node == ELBOW.into() && emergency.code == code)
            };
            assert!(events.iter().any(is_warning), "{file}: {events:?}");
        }
        // Listed, but with an error; and not listed.
        for (code, register) in [(0x8611, 0x01), (0x8612, 0x00)] {
            let mut stopped = armed(file);
            stopped.world_mut().drive_mut(ELBOW).unwrap().report_transient_error(code, register);
            let record = until(&mut stopped, |record| record.mode.is_stopped());
            let cause = Cause::Emergency { node: ELBOW.into(), code };
            assert_eq!(record.cause, Some(cause), "{file}: {code:04X}h {register:02X}h");
        }
    }
}

#[test]
fn error_reset_is_no_warning_to_list() {
    let text = in_each_joint(&text(KRAFT_500HZ), "emcy_warnings = [0x0000]");
    let refused = refusal(KRAFT_500HZ, &text);
    assert!(refused.contains("emcy_warnings") && refused.contains("error reset"), "{refused}");
}

#[test]
fn time_to_enable_is_that_of_the_file() {
    let right = text(KRAFT_500HZ);
    let stuck = "[[fault]]\nat_s = 0\nkind = \"controlword_ignored\"\njoint = 3\n";
    let mut took = Vec::new();
    for key in ["", "enable_ms = 500\n", "enable_ms = 4000\n"] {
        let config = parse(KRAFT_500HZ, &right.replace("[safety]\n", &format!("[safety]\n{key}")));
        let wire = Wire::default();
        let mut bench =
            Bench::new(&config, script(&format!("seconds = 20\n{stuck}")), 1, wire.clone());
        let error = bench.bring_up().unwrap_err().to_string();
        assert!(error.starts_with("joint 3:") || error.contains("joint 3"), "{error}");
        let syncs = wire.since(Instant::ZERO, 0x80);
        let first = syncs.first().unwrap().0;
        took.push(bench.node().bus().now().since(first));
    }
    for (took, millis) in took.iter().zip([2_000, 500, 4_000]) {
        // After it, the enabled drives are switched off.
        let limit = Duration::from_millis(millis);
        assert!(
            *took >= limit && *took < limit + Duration::from_millis(900),
            "{took:?} of {limit:?}"
        );
    }
}
