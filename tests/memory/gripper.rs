//! A gripper, from the inputs of the switch box to the object between its fingers: in the node's own scene and through the
//! socket of a link; inputs that are silent, out of range or contradictory; configurations that are refused.

use std::rc::Rc;

use crate::common::linked::{LINK, linked_text};
use crate::common::prelude::*;
use crate::common::refusals::are_refused;
use crate::linked_node::{Handle, LinkedSide, Network, ask, cycles};
use node::Node;
use node::record::GripperRecord;
use remote::Gripper;
use telemetry::losses::Losses;
use telemetry::status::Status;

/// Lever at the second analogue input: 20,000 counts are open, -12,000 closed.
const ANALOGUE: &str = "input = 2\nopen_counts = 20000\nclosed_counts = -12000";

/// Two buttons.
const DIGITAL: &str = "open_bit = 5\nclose_bit = 6";

/// Common keys of the input.
const MOTION: &str = "stroke_m = 0.06\nforce_n = 15.0\nmax_speed_m_per_s = 0.05";

/// Gripper that opens to 80 mm, with an object of 30 mm.
const GRIPPER: &str = "[remote.gripper]\nstroke_m = 0.08\nmax_speed_m_per_s = 0.2\n\
    object_m = 0.03\nstiffness_n_per_m = 5000.0\n";

/// Returns the hand controller with these keys of its gripper's input.
fn hand(keys: &str) -> String {
    hand_of(KRAFT_500HZ_TEXT, keys)
}

fn hand_of(text: &str, keys: &str) -> String {
    let section = format!("[switches.gripper]\n{keys}\n{MOTION}\n\n[controller]");
    text.replacen("[controller]", &section, 1)
}

/// Returns the same with a gripper of the object.
fn gripping(keys: &str) -> String {
    gripping_of(KRAFT_500HZ_TEXT, keys)
}

fn gripping_of(text: &str, keys: &str) -> String {
    hand_of(text, keys).replacen("[safety]", &format!("{GRIPPER}\n[safety]"), 1)
}

/// Returns a script that arms at 0.3 s and holds the deadman from 1.2 s on, with further switches, each with its time.
fn script(switches: &[(f64, &str)]) -> Scenario {
    let mut all = vec![(1.2, "deadman = true")];
    all.extend_from_slice(switches);
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    let switch = |(at, keys): &(f64, &str)| format!("[[switch]]\nat_s = {at:?}\n{keys}\n");
    let switches: String = all.iter().map(switch).collect();
    let arm = "[[console]]\nat_s = 0.3\nrequest = \"arm\"\n";
    Scenario::parse(&format!("seconds = 20.0\n[hand]\ntremor_mm = 0.0\n{arm}{switches}")).unwrap()
}

/// Returns a bench of the object in the node's own scene, after its boot.
fn bench(text: &str, scenario: Scenario) -> Bench<()> {
    started(&parse(KRAFT, text), scenario, ())
}

/// Runs until `seconds`; returns the last record.
fn until(bench: &mut Bench<()>, seconds: f64) -> Record {
    loop {
        let record = bench.cycle();
        if bench.elapsed().as_secs_f64() >= seconds {
            return record;
        }
    }
}

fn gripper(record: &Record) -> GripperRecord {
    record.gripper.unwrap()
}

/// Asserts that a gripper is at an opening in m with a force in N.
fn assert_at(gripper: Option<Gripper>, opening: f64, force: f64) {
    let Gripper { position, force: found } = gripper.unwrap();
    assert!((position - opening).abs() < 1e-6, "{position} m");
    assert!((found - force).abs() < 1e-3, "{found} N");
}

#[test]
fn analogue_lever_closes_the_gripper_on_its_object() {
    let script = script(&[(0.1, "gripper = 20000"), (2.5, "gripper = -12000")]);
    let mut bench = bench(&gripping(ANALOGUE), script);
    let armed = until(&mut bench, 1.1);
    assert_eq!((armed.mode, gripper(&armed).command), (Mode::Armed, None), "not engaged yet");
    assert_at(gripper(&armed).measured, 0.08, 0.0);
    let open = until(&mut bench, 2.4);
    assert_eq!(open.mode, Mode::Engaged);
    assert_at(gripper(&open).command, 0.06, 15.0);
    assert_at(gripper(&open).measured, 0.06, 0.0);
    let moving = until(&mut bench, 3.1);
    let GripperRecord { command, measured } = gripper(&moving);
    let (ahead, behind) = (command.unwrap().position, measured.unwrap().position);
    assert!(ahead < 0.035 && behind - ahead < 1e-3, "{behind} m behind {ahead} m");
    let closed = until(&mut bench, 5.0);
    assert_at(gripper(&closed).command, 0.0, 15.0);
    assert_at(gripper(&closed).measured, 0.027, 15.0);
    let status = Status::from_record(&closed, 0, Losses::default()).gripper.unwrap();
    assert_eq!((status.state, closed.cause), ("commanded", None));
    assert!(status.force_n.is_some_and(|force| (force - 15.0).abs() < 1e-3));
}

#[test]
fn two_buttons_open_and_close_the_gripper() {
    let buttons = |open: bool, close: bool| format!("buttons = [false, {open}, {close}, false]");
    let [opens, closes, rests] =
        [(true, false), (false, true), (false, false)].map(|(open, close)| buttons(open, close));
    let script = script(&[(2.0, &closes), (4.5, &rests), (5.5, &opens), (5.7, &rests)]);
    let mut bench = bench(&gripping(DIGITAL), script);
    let before = until(&mut bench, 1.9);
    assert_at(gripper(&before).command, 0.08, 15.0);
    let closed = until(&mut bench, 5.4);
    assert_at(gripper(&closed).measured, 0.027, 15.0);
    let opened = until(&mut bench, 8.0);
    let rise =
        gripper(&opened).command.unwrap().position - gripper(&closed).command.unwrap().position;
    assert!((rise - 0.01).abs() < 1e-3, "0.2 s at 0.05 m/s: {rise} m");
}

#[test]
fn released_deadman_keeps_the_opening() {
    let script = script(&[
        (0.1, "gripper = -12000"),
        (2.0, "deadman = false"),
        (2.5, "gripper = 20000"),
        (4.0, "deadman = true"),
    ]);
    let mut bench = bench(&gripping(ANALOGUE), script);
    let released = gripper(&until(&mut bench, 2.1));
    let later = until(&mut bench, 3.9);
    assert_eq!((later.mode, gripper(&later).command), (Mode::Armed, released.command));
    let engaged = gripper(&until(&mut bench, 4.5)).command.unwrap().position;
    assert!(engaged > released.command.unwrap().position + 0.01, "{engaged} m");
}

#[test]
fn hazard_50_input_out_of_range_ends_reflection_in_time() {
    let contradiction =
        "gripper inputs contradict each other: bits 5 (open) and 6 (close) are both set";
    let both = "buttons = [false, true, true, false]";
    let range = "gripper input at 21601 counts, beyond its range from -12000 (closed) to 20000 (open): check its wire, \
        and closed_counts and open_counts of switches.gripper";
    input_ends_reflection(KRAFT_500HZ, ANALOGUE, "gripper = 21601", range);
    for file in HAND_CONTROLLERS {
        input_ends_reflection(file, DIGITAL, both, contradiction);
    }
}

/// Asserts that this input at 3 s ends reflection with this cause, and that the gripper stays.
fn input_ends_reflection(file: &str, keys: &str, input: &str, message: &str) {
    let text = gripping_of(&fs::read_to_string(file).unwrap(), keys);
    let config = parse(file, &text);
    let mut bench = started(&config, script(&[(3.0, input)]), ());
    let before = until(&mut bench, 2.999);
    assert_eq!((before.mode, before.cause), (Mode::Engaged, None), "{file}");
    let mut record = before;
    while record.cause.is_none() {
        assert_eq!(gripper(&record).command, gripper(&before).command, "{file}, {keys}");
        record = bench.cycle();
        assert!(bench.elapsed().as_secs_f64() < 3.1, "{file}, {keys}");
    }
    assert_eq!(record.cause.unwrap().to_string(), message, "{file}");
    let after = until(&mut bench, 4.0);
    assert_eq!(after.mode, Mode::ReflectionOff, "{file}");
    assert_eq!(gripper(&after).command, None, "{file}");
    assert_eq!(gripper(&after).measured, gripper(&before).measured, "{file}: it stays");
    assert!(bench.ask(Request::Reset).is_err(), "{file}: the cause is present");
}

/// Returns a script as [`script`], with faults of the switch box's frames.
fn disturbed(switches: &[(f64, &str)], faults: &str) -> Scenario {
    let quiet = script(switches);
    let text = toml::to_string(&quiet).unwrap();
    Scenario::parse(&format!("{text}\n{faults}")).unwrap()
}

#[test]
fn hazard_50_glitches_move_nothing_and_stop_nothing() {
    // Both bits for 20 ms, ten times, while the gripper closes or rests.
    let [both, closes, rests] = ["true, true", "false, true", "false, false"]
        .map(|bits| format!("buttons = [false, {bits}, false]"));
    for file in HAND_CONTROLLERS {
        let mut switches = vec![(2.0, &closes[..]), (2.4, &rests)];
        for glitch in 0..10 {
            let at = 2.1 + 0.1 * f64::from(glitch);
            let after = if at < 2.4 { &closes } else { &rests };
            switches.extend([(at, &both[..]), (at + 0.02, after)]);
        }
        let config = parse(file, &gripping_of(&text(file), DIGITAL));
        let mut bench = started(&config, script(&switches), ());
        let open = gripper(&until(&mut bench, 1.99)).command.unwrap().position;
        let still = until(&mut bench, 2.45);
        let closed = gripper(&still).command.unwrap().position;
        // 0.4 s at 50 mm/s, less three glitches.
        assert!((open - closed - 0.017).abs() < 1e-3, "{file}: {open} m to {closed} m");
        let after = until(&mut bench, 3.5);
        assert_eq!((after.mode, after.cause), (Mode::Engaged, None), "{file}");
        assert_eq!(gripper(&after).command, gripper(&still).command, "{file}");
    }
}

#[test]
fn hazard_50_single_wrong_samples_move_nothing() {
    // One frame in ten has other counts: out of range, and within it, where 50 mm/s until the next frame are the limit.
    for (mask, travel) in [("000030", 0.0), ("00FF7F", 1.1e-3)] {
        let corrupt = format!(
            "[[fault]]\nat_s = 2.0\nkind = \"corrupt\"\ndevice = \"switches\"\nframe = \"tpdo1\"\nxor = \"{mask}\"\n\
             share = 0.1\n"
        );
        let scenario = disturbed(&[(0.1, "gripper = 20000")], &corrupt);
        let mut bench = bench(&gripping(ANALOGUE), scenario);
        let before = gripper(&until(&mut bench, 1.99)).command.unwrap().position;
        let mut farthest: f64 = 0.0;
        for _ in 0..2_000 {
            let record = bench.cycle();
            assert_eq!((record.mode, record.cause), (Mode::Engaged, None), "{mask}");
            farthest = farthest.max((gripper(&record).command.unwrap().position - before).abs());
        }
        assert!(farthest <= travel, "{mask}: {farthest} m");
    }
}

#[test]
fn hazard_50_frame_without_its_counts_releases_the_deadman() {
    let cut = "[[fault]]\nat_s = 2.0\nkind = \"resize\"\ndevice = \"switches\"\nframe = \"tpdo1\"\nbytes = 1\n";
    let scenario = disturbed(&[(0.1, "gripper = -12000")], cut);
    let mut bench = bench(&gripping(ANALOGUE), scenario);
    let before = until(&mut bench, 1.99);
    assert_eq!(before.mode, Mode::Engaged);
    let after = until(&mut bench, 2.05);
    assert_ne!(after.mode, Mode::Engaged, "the deadman is in the same frame");
    let stays = gripper(&after).command.unwrap_or(gripper(&after).measured.unwrap()).position;
    assert!((stays - gripper(&before).command.unwrap().position).abs() < 3e-3, "{stays} m");
}

#[test]
fn hazard_50_silent_input_releases_the_deadman_with_it() {
    let text = "seconds = 20.0\n[hand]\ntremor_mm = 0.0\n\
        [[console]]\nat_s = 0.3\nrequest = \"arm\"\n\
        [[switch]]\nat_s = 0.1\ngripper = -12000\n[[switch]]\nat_s = 1.2\ndeadman = true\n\
        [[fault]]\nat_s = 1.5\nkind = \"drop\"\ndevice = \"switches\"\nframe = \"tpdo1\"\nfor_s = 0.5\n";
    let mut bench = bench(&gripping(ANALOGUE), Scenario::parse(text).unwrap());
    assert_eq!(until(&mut bench, 1.49).mode, Mode::Engaged);
    let silent = until(&mut bench, 1.53);
    assert_eq!((silent.mode, silent.cause, silent.inputs), (Mode::Armed, None, None));
    let kept = gripper(&silent).command;
    assert!(kept.is_some());
    assert_eq!(gripper(&until(&mut bench, 1.99)).command, kept);
    let status = Status::from_record(&silent, 0, Losses::default());
    assert_eq!(status.switches_online, Some(false));
}

#[test]
fn commanded_side_without_a_gripper_is_armed_all_the_same() {
    let mut bench = bench(&hand(ANALOGUE), script(&[(0.1, "gripper = -12000")]));
    let record = until(&mut bench, 3.0);
    assert_eq!((record.mode, record.cause), (Mode::Engaged, None));
    assert_eq!(record.gripper, Some(GripperRecord::default()));
    let status = Status::from_record(&record, 0, Losses::default()).gripper.unwrap();
    assert_eq!(status.state, "the commanded side reports none");
}

#[test]
fn gripper_of_another_process_is_commanded_and_measured() {
    let near = parse(KRAFT, &linked_text(&hand(ANALOGUE), LINK));
    let far =
        parse(KRAFT, &KRAFT_500HZ_TEXT.replacen("[safety]", &format!("{GRIPPER}\n[safety]"), 1));
    let bitrates: Vec<u32> = near.buses.iter().map(|bus| bus.bitrate).collect();
    let switches = script(&[(0.1, "gripper = -12000"), (6.0, "gripper = 20000")]);
    let world = world::build(&near, switches, 1);
    let handle = Rc::new(Handle::default());
    let remote = LinkedSide::new(&near, &far, Network::default(), Rc::clone(&handle));
    let mut node = Node::new(&near, Memory::new(&bitrates, world, ()), remote);
    node.bring_up(&mut || false).unwrap();
    while node.cycle().inputs.is_none() || node.bus().now() < Instant::from_micros(1_000_000) {}
    assert_eq!(ask(&mut node, Request::Arm), Ok(Mode::Armed));
    let engaged = (0..3_000).find(|_| node.cycle().mode == Mode::Engaged);
    assert!(engaged.is_some(), "{:?}", node.cause());
    let closed = cycles(&mut node, 2_500);
    assert_at(gripper(&closed).measured, 0.027, 15.0);
    // A far side that holds keeps what it has gripped.
    handle.hold.set(Some(contract::Reason::Robot));
    let stopped = cycles(&mut node, 500);
    assert!(matches!(stopped.cause, Some(Cause::FarSideHolds { .. })), "{:?}", stopped.cause);
    assert_at(gripper(&stopped).measured, 0.027, 15.0);
}

#[test]
fn invalid_keys_of_a_gripper_are_refused_by_name() {
    let rows = [
        ("switches.gripper.input", "0", "must be within 1..=254, got 0"),
        ("switches.gripper.closed_counts", "20000", "must be another number"),
        ("switches.gripper.open_counts", "50000", "invalid value: integer `50000`"),
        ("switches.gripper.open_bit", "4", "contradicts the analogue input"),
        ("switches.gripper.stroke_m", "nan", "must be within"),
        ("switches.gripper.force_n", "-1.0", "must be within"),
        ("switches.gripper.max_speed_m_per_s", "inf", "must be within"),
    ];
    are_refused(KRAFT, &hand(ANALOGUE), &rows);
    let rows = [
        ("switches.gripper.close_bit", "5", "must be another bit than open_bit, got 5"),
        ("switches.gripper.open_bit", "3", "must be within 4..=7, got 3"),
    ];
    are_refused(KRAFT, &hand(DIGITAL), &rows);
    let rows = [
        ("remote.gripper.object_m", "0.08", "must be below stroke_m"),
        ("remote.gripper.max_speed_m_per_s", "nan", "must"),
    ];
    are_refused(KRAFT, &gripping(ANALOGUE), &rows);
    let button = "[[switches.button]]\nbit = 5\npress = \"align\"\n\n[switches.gripper]";
    let button = hand(DIGITAL).replacen("[switches.gripper]", button, 1);
    let linked = linked_text(&gripping(ANALOGUE), LINK);
    let without = |key| changed(&gripping(ANALOGUE), &[(key, "")]);
    for (text, reason) in [
        (
            hand(""),
            "switches.gripper: needs input, open_counts and closed_counts, or else open_bit",
        ),
        (
            hand("input = 1\nopen_counts = 5"),
            "switches.gripper.closed_counts: missing field `closed_counts`",
        ),
        (hand("open_counts = 5"), "switches.gripper.input: missing field `input`"),
        (hand("open_bit = 4"), "switches.gripper.close_bit: missing field `close_bit`"),
        (
            hand("input = 9\nopen_counts = 5\nclosed_counts = 6"),
            "switches.eds: switch box: its EDS lacks 6401h:9",
        ),
        (button, "switches.gripper.open_bit: bit 5 is that of a button"),
        (without("object_m = 0.03\n"), "remote.gripper.object_m: missing field"),
        (
            without("stiffness_n_per_m = 5000.0\n"),
            "remote.gripper.stiffness_n_per_m: missing field",
        ),
        (linked, "remote.gripper: with kind = \"link\" the far side has it"),
    ] {
        let found = refusal(KRAFT, &text);
        assert!(found.contains(reason), "{reason}: {found}");
    }
}

#[test]
fn analogue_input_costs_two_bytes_of_the_switch_box_frame() {
    let without = parse(KRAFT, KRAFT_500HZ_TEXT);
    let with = parse(KRAFT, &hand(ANALOGUE));
    let bits = |config: &Config| {
        let plans = config.node_plans();
        let (_, switches) = plans.last().unwrap();
        let services = switches.pdos.iter().filter_map(|pdo| pdo.service.as_ref());
        services.map(|service| service.bytes()).sum::<u32>()
    };
    assert_eq!((bits(&without), bits(&with)), (1, 3));
    assert_eq!(bits(&parse(KRAFT, &hand(DIGITAL))), 1, "digital inputs are there already");
}
