//! Zeros of joints: unknown after a power-up, set by a person, lost with the drive's position. Judged by torque on the
//! wire and by the true posture.

use crate::common::prelude::*;
use crate::common::zero::with_zero;
use node::zero::{UnknownZero, ZeroState};
use node::{RequestError, Unfit};
use sim::random::SplitMix;

/// Kinds whose zero is lost with the power.
const LOST: [&str; 3] = ["single-turn", "rest", "homing"];

/// Time at rest before a zero may be set.
pub(super) const AT_REST: u32 = 1_010;

/// Maximum torque demand in a homing, in ‰ of rated torque.
pub(super) const LARGEST_DEMAND: f64 = 50.0 + 1e-9;

/// Maximum motion of a joint in a homing: 1°, or as many mm as rad.
pub(super) const LARGEST_MOTION: f64 = 1.0_f64.to_radians();

/// Data sheets without 6098h, whose drives cannot be homed.
const NOT_HOMED: [&str; 1] = ["config/drives/ingenia_eve.toml"];

/// Kinds that a shipped file can have.
fn kinds(file: &str) -> impl Iterator<Item = &'static str> {
    LOST.into_iter().filter(move |kind| *kind != "homing" || !NOT_HOMED.contains(&file))
}

/// Returns a shipped file with this kind of zero, and a second posture near its stops where signs and scales are stated only.
pub(super) fn file_with(file: &str, kind: &str) -> Config {
    let mut text = with_zero(&text(file), kind);
    if kind == "homing" && file.ends_with("elmo_gold.toml") {
        // Its data sheet ends at method 35.
        text = in_each_joint(&text, "homing_method = 35");
    }
    if kind == "homing" && file.ends_with("maxon_epos4.toml") {
        text = reading_zero_at_rest(&text);
    }
    if text.contains("accept_stated_only") {
        text = crate::common::zero::with_second_rest(&text, SECOND);
    }
    parse(file, &text)
}

/// Returns the text with `zero_counts` by which each drive reads 0 at rest: without 607Ch its home is 0.
fn reading_zero_at_rest(text: &str) -> String {
    let refused = refusal("config/drives/maxon_epos4.toml", text);
    let counts = refused.lines().filter_map(|line| {
        let (_, number) = line.split_once("zero_counts: must be ")?;
        number.split(',').next()
    });
    let mut parts = text.split("\nzero_counts = ");
    let mut changed = parts.next().unwrap().to_owned();
    for (part, counts) in parts.zip(counts) {
        let (_, rest) = part.split_once('\n').unwrap();
        changed.push_str(&format!("\nzero_counts = {counts}\n{rest}"));
    }
    changed
}

/// Second rest posture of the arm of `kraft_like`, in degrees.
const SECOND: [f64; 6] = [0.0, -80.0, 60.0, 0.0, 0.0, 0.0];

/// Returns a bench whose drives were switched on in the rest posture.
pub(super) fn powered_up(config: &Config) -> (Bench<Wire>, Wire) {
    let wire = Wire::default();
    let mut bench = Bench::new(config, script("seconds = 60\n"), 1, wire.clone());
    bench.bring_up().unwrap_or_else(|error| panic!("{}: {error}", config.file.display()));
    (bench, wire)
}

/// Runs cycles of this time.
pub(super) fn run_for(bench: &mut Bench<Wire>, config: &Config, millis: u32) {
    let cycles = Duration::from_millis(millis.into()).as_micros() / config.period.as_micros();
    (0..cycles).for_each(|_| _ = bench.cycle());
}

/// Guides the joints to a posture by hand, in rad and m, until they are at rest there.
fn guide(bench: &mut Bench<Wire>, config: &Config, q: [f64; 6]) {
    bench.world_mut().guide_to(q);
    run_for(bench, config, 2_500);
}

/// Returns the greatest target torque on the wire since `from`, in ‰.
fn greatest_target(bench: &mut Bench<Wire>) -> i16 {
    bench.cycle().targets.iter().map(|target| target.abs()).max().unwrap()
}

/// Returns the rest positions, or the second ones where there are, in rad and m.
fn posture(config: &Config, is_second: bool) -> [f64; 6] {
    config.joints.each_ref().map(|joint| {
        let rest = joint.second_rest.filter(|_| is_second).or(joint.rest);
        rest.unwrap().position()
    })
}

/// Sets all zeros of an arm in its rest posture, and verifies them where they must be.
fn set_zeros(bench: &mut Bench<Wire>, config: &Config) {
    run_for(bench, config, AT_REST);
    bench.ask(Request::Zero(None)).unwrap_or_else(|error| panic!("{error}"));
    if config.joints.iter().any(|joint| joint.second_rest.is_some()) {
        guide(bench, config, posture(config, true));
        guide(bench, config, posture(config, false));
    }
}

/// Returns the error of each joint's position, in rad or m.
pub(super) fn errors(bench: &mut Bench<Wire>) -> [f64; 6] {
    let read: [f64; 6] = bench.cycle().output.q.into();
    let truth: [f64; 6] = (*bench.world_mut().plant().q()).into();
    std::array::from_fn(|joint| read[joint] - truth[joint])
}

/// Powers up an arm that a person has laid within half of the tolerance of its rest posture, sets its zeros and arms it.
/// No torque may act before, and nothing may be refused then.
fn power_cycle(config: &Config, kind: &str, random: &mut SplitMix) {
    let what = config.file.display();
    let laid = config.joints.each_ref().map(|joint| {
        let rest = joint.rest.unwrap();
        rest.position() + rest.tolerance() / 2.0 * (2.0 * random.unit() - 1.0)
    });
    let world = config.clone().with_start(laid);
    let still = script("seconds = 60\n");
    let mut bench = Bench::in_world_of(&world, config, still, random.bits(), Wire::default());
    bench.bring_up().unwrap_or_else(|error| panic!("{what} {kind}: {error}"));
    run_for(&mut bench, config, AT_REST);
    let has_second = config.joints.iter().any(|joint| joint.second_rest.is_some());
    if kind != "single-turn" || has_second {
        let refused = bench.ask(Request::Arm).unwrap_err();
        let RequestError::Unfit(reasons) = &refused else { panic!("{refused}") };
        assert!(matches!(&reasons[..], [Unfit::UnknownZeros(_)]), "{what} {kind}: {refused}");
        assert!(refused.to_string().contains("then `frhc ctl zero --joint"), "{refused}");
        for _ in 0..100 {
            assert_eq!(greatest_target(&mut bench), 0, "{what} {kind}");
            assert!(bench.world_mut().torques().amax() < 1e-9, "{what} {kind}");
        }
        set_zeros(&mut bench, config);
    }
    let armed = bench.ask(Request::Arm);
    armed.unwrap_or_else(|error| panic!("{what} {kind}: {error}"));
    for (joint, error) in config.joints.iter().zip(errors(&mut bench)) {
        // A single-turn zero is exact; the others are those of the cradle.
        let share = if kind == "single-turn" { 0.1 } else { 0.75 };
        let most = joint.rest.unwrap().tolerance() * share;
        assert!(error.abs() < most, "{what} {kind}: {} off by {error}", joint.name);
    }
    run_for(&mut bench, config, 1_000);
    let record = bench.cycle();
    assert_eq!((record.mode, record.cause), (Mode::Armed, None), "{what} {kind}");
    assert_eq!(record.zeros, [ZeroState::Known; 6]);
}

/// Plays this many power cycles of each shipped file and kind; returns the number of all.
fn power_cycles(each: u32) -> u32 {
    let mut random = SplitMix::new(51);
    let mut count = 0;
    for file in HAND_CONTROLLERS {
        for kind in kinds(file) {
            let config = file_with(file, kind);
            (0..each).for_each(|_| power_cycle(&config, kind, &mut random));
            count += each;
        }
    }
    count
}

#[test]
fn hazard_51_no_torque_acts_before_the_zero_is_known() {
    assert_eq!(power_cycles(1), 29);
}

#[test]
#[ignore = "a minute"]
fn arm_within_half_of_its_tolerance_is_never_refused() {
    assert!(power_cycles(11) > 300);
}

/// Boots a shipped arm of this kind whose elbow lies `off` degrees from its rest posture.
fn misplaced(kind: &str, off: f64) -> (Bench<Wire>, Config) {
    let config = file_with(KRAFT, kind);
    let (mut bench, _) = powered_up(&config);
    let mut q = posture(&config, false);
    q[2] += off.to_radians();
    guide(&mut bench, &config, q);
    (bench, config)
}

#[test]
fn single_turn_posture_beyond_its_tolerance_is_refused() {
    // The revolution is 10° at the elbow, the tolerance 2°.
    for (off, is_armed) in [(0.9, true), (-0.9, true), (2.4, false), (-4.9, false), (6.0, false)] {
        let (mut bench, _) = misplaced("single-turn", off);
        match bench.ask(Request::Arm) {
            Ok(_) => assert!(is_armed, "{off}°"),
            Err(error) => {
                assert!(!is_armed, "{off}°: {error}");
                assert!(error.to_string().contains("joint 3 (elbow): reads "), "{error}");
            }
        }
    }
    // A whole revolution cannot be seen.
    let (mut bench, _) = misplaced("single-turn", 10.0);
    bench.ask(Request::Arm).unwrap();
    assert!((errors(&mut bench)[2].to_degrees() + 10.0).abs() < 0.3);
}

#[test]
fn miss_of_the_cradle_is_the_error_of_the_armed_arm() {
    for kind in ["rest", "homing"] {
        for off in [1.0, 3.0, 6.0, 20.0] {
            let (mut bench, _) = misplaced(kind, off);
            bench.ask(Request::Zero(None)).unwrap_or_else(|error| panic!("{kind}: {error}"));
            let error = errors(&mut bench)[2].to_degrees();
            assert!((error + off).abs() < 0.3, "{kind}: {error} for {off}");
        }
    }
}

#[test]
fn zero_is_not_set_while_moving_armed_or_held() {
    let config = file_with(KRAFT, "rest");
    let (mut bench, _) = powered_up(&config);
    let refusal = |bench: &mut Bench<Wire>| {
        bench.ask(Request::Zero(None)).map(|_| ()).unwrap_err().to_string()
    };
    bench.world_mut().guide_to(posture(&config, false).map(|q| q + 0.1));
    run_for(&mut bench, &config, 300);
    let moving = refusal(&mut bench);
    assert!(
        moving.contains("has been at rest for 0.") && moving.contains("joint 3 (elbow)"),
        "{moving}"
    );
    guide(&mut bench, &config, posture(&config, false));
    bench.ask(Request::Zero(None)).unwrap();
    bench.ask(Request::Arm).unwrap();
    assert!(refusal(&mut bench).contains("not ready: the node is armed"));
    bench.ask(Request::Disarm).unwrap();
    until(&mut bench, |record| record.mode == Mode::Ready);
    // The deadman, closed on the switch box.
    let held = script("seconds = 60\n[[switch]]\nat_s = 0.0\ndeadman = true\n");
    let mut bench = Bench::new(&config, held, 1, Wire::default());
    bench.bring_up().unwrap();
    run_for(&mut bench, &config, AT_REST);
    assert!(refusal(&mut bench).contains("the deadman is closed"));
}

#[test]
fn absolute_joint_has_no_zero_to_set() {
    let config = config(KRAFT);
    let (mut bench, _) = powered_up(&config);
    run_for(&mut bench, &config, AT_REST);
    let all = bench.ask(Request::Zero(None)).map(|_| ()).unwrap_err().to_string();
    assert_eq!(all, "nothing to set: every joint has zero = \"absolute\"");
    let one = bench.ask(Request::Zero(Some(ELBOW))).map(|_| ()).unwrap_err().to_string();
    assert_eq!(one, "joint 3 (elbow): nothing to set: zero = \"absolute\"");
}

/// Zeroes and arms an arm of this kind, applies `script`, and returns why the elbow's zero is unknown then.
fn lost_by(kind: &str, fault: &str) -> (Bench<Wire>, Config, ZeroState) {
    let config = file_with(KRAFT, kind);
    let text = format!("seconds = 60\n{fault}");
    let mut bench = Bench::new(&config, script(&text), 1, Wire::default());
    bench.bring_up().unwrap();
    if kind != "single-turn" {
        set_zeros(&mut bench, &config);
    }
    bench.ask(Request::Arm).unwrap();
    run_for(&mut bench, &config, 4_000);
    let record = bench.cycle();
    assert!(record.cause.is_some(), "{kind}: {fault}");
    let zero = record.zeros[2];
    (bench, config, zero)
}

#[test]
fn hazard_51_lost_position_makes_the_zero_unknown() {
    let reset = "[[fault]]\nat_s = 3.0\njoint = 3\nkind = \"reset\"\n";
    let sensor = "[[fault]]\nat_s = 3.0\njoint = 3\nkind = \"emergency\"\ncode = 0x7305\n";
    for kind in LOST {
        for (fault, why) in
            [(reset, UnknownZero::Rebooted), (sensor, UnknownZero::SensorFault { code: 0x7305 })]
        {
            let (_, _, zero) = lost_by(kind, fault);
            assert_eq!(zero, ZeroState::Unknown(why), "{kind}");
        }
    }
}

#[test]
fn reset_that_boots_asks_for_the_zero_again() {
    let reset = "[[fault]]\nat_s = 3.0\njoint = 3\nkind = \"reset\"\n";
    let (mut bench, config, _) = lost_by("rest", reset);
    bench.ask(Request::Reset).unwrap();
    run_for(&mut bench, &config, 2_500);
    let refused = bench.ask(Request::Arm).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("joint 3 (elbow): zero unknown: the drive has rebooted"), "{refused}");
    assert!(refused.contains("joint 1 (azimuth): zero unknown: the node has reset"), "{refused}");
    set_zeros(&mut bench, &config);
    bench.ask(Request::Arm).unwrap();
    assert!(errors(&mut bench)[2].to_degrees().abs() < 1.0);
}

#[test]
fn position_kept_over_82h_stays_known_until_a_drive_reboots() {
    let text = with_zero(&text(KRAFT), "rest")
        .replace("\nzero = \"rest\"", "\nzero = \"rest\"\nkeeps_position_over_82h = true");
    let config = parse(KRAFT, &text);
    let reset = "seconds = 60\n[[fault]]\nat_s = 5.0\njoint = 3\nkind = \"reset\"\n";
    let mut bench = Bench::new(&config, script(reset), 1, Wire::default());
    bench.bring_up().unwrap();
    set_zeros(&mut bench, &config);
    bench.bring_up().unwrap();
    assert_eq!(bench.cycle().zeros, [ZeroState::Known; 6], "the node has watched all the time");
    run_for(&mut bench, &config, 5_000);
    assert!(matches!(bench.node().cause(), Some(Cause::Rebooted { .. })));
    bench.ask(Request::Reset).unwrap();
    let zeros = bench.cycle().zeros;
    let unknown = zeros.map(|zero| zero != ZeroState::Known);
    assert_eq!(unknown, [false, false, true, false, false, false]);
}

#[test]
fn homing_moves_no_joint_and_exerts_five_percent_at_most() {
    for file in HAND_CONTROLLERS.into_iter().filter(|file| !NOT_HOMED.contains(file)) {
        let config = file_with(file, "homing");
        for quirk in [None, Some("homing-moves")] {
            let mut script = script("seconds = 60\n");
            if let Some(quirk) = quirk {
                script.quirks_mut().add(ELBOW, [quirk.parse::<Quirk>().unwrap()]);
            }
            let mut bench = Bench::new(&config, script, 1, Wire::default());
            bench.bring_up().unwrap();
            run_for(&mut bench, &config, AT_REST);
            let before = *bench.world_mut().plant().q();
            bench.world_mut().watch();
            let homed = bench.ask(Request::Zero(None));
            let extremes = *bench.world_mut().extremes().unwrap();
            let (most, moved) = (extremes.demand, extremes.motion);
            assert!(most <= LARGEST_DEMAND, "{file} {quirk:?}: {most} ‰");
            assert!(moved < LARGEST_MOTION, "{file} {quirk:?}: moved by {moved}");
            let after = *bench.world_mut().plant().q();
            assert!((after - before).amax() < LARGEST_MOTION);
            match quirk {
                None => {
                    homed.unwrap_or_else(|error| panic!("{file}: {error}"));
                    assert_eq!(bench.cycle().mode, Mode::Ready);
                    for drive in bench.world_mut().drives() {
                        assert_eq!(drive.mode(), 10, "{file}");
                    }
                }
                Some(_) => {
                    let error = homed.map(|_| ()).unwrap_err().to_string();
                    // 5 % of its torque may not move it at all.
                    let is_seen = error.contains(": 6064h is ")
                        && error.contains("the drive moves in spite of its method")
                        || error.contains(": homing not attained in time");
                    assert!(error.starts_with("joint 3 (") && is_seen, "{file}: {error}");
                    let record = bench.cycle();
                    assert_eq!(record.mode, Mode::DrivesOff, "{file}");
                    assert_ne!(record.zeros[2], ZeroState::Known);
                    bench.ask(Request::Reset).unwrap_or_else(|error| panic!("{file}: {error}"));
                }
            }
        }
    }
}

/// Returns the refusal of `kraft_like` with this section of the elbow in place of its zero.
fn elbow_refused(lines: &str) -> String {
    let (before, elbow) = KRAFT_TEXT.split_once("name = \"elbow\"").unwrap();
    let elbow = elbow.replacen("zero_counts = -3400\n", "", 1);
    let at = elbow.find("zero = \"absolute\"").unwrap();
    let end = at + elbow[at..].find('\n').unwrap();
    refusal(KRAFT, &format!("{before}name = \"elbow\"{}{lines}{}", &elbow[..at], &elbow[end..]))
}

#[test]
fn invalid_zeros_are_refused_by_key() {
    for (lines, words) in [
        (
            "zero_counts = 0",
            "joint[2].zero: missing field `zero`: where the zero of the joint comes from",
        ),
        ("zero = \"battery\"\nzero_counts = 0", "joint[2].zero: unknown value \"battery\""),
        ("zero = \"absolute\"", "joint[2].zero_counts: missing field `zero_counts`"),
        (
            "zero = \"rest\"\nzero_counts = 0",
            "joint[2].zero_counts: must be absent with zero = \"rest\"",
        ),
        (
            "zero = \"single-turn\"\nzero_counts = 9",
            "joint[2].zero: the tolerance of the rest position must be at most a quarter of the revolution that it selects, \
             2.5° of 10.0°, got 5.0°",
        ),
        (
            "zero = \"single-turn\"\nzero_counts = 16384\nrest_tolerance_deg = 2.0",
            "joint[2].zero_counts: must be the reading within a revolution",
        ),
        (
            "zero = \"single-turn\"\nzero_counts = 9\nrest_tolerance_deg = 2.0\nunique_turns = 0.5",
            "must be at most a quarter of the revolution that it selects, 1.2° of 5.0°, got 2.0°",
        ),
        (
            "zero = \"homing\"\nzero_counts = 0\nhoming_method = 34",
            "joint[2].homing_method: must be 37 or 35",
        ),
        (
            "zero = \"homing\"\nzero_counts = 0\nhoming_s = 0.0",
            "joint[2].homing_s: must be within 0.05..=60",
        ),
        (
            "zero = \"homing\"\nzero_counts = 0\nreferenced_bit = 3",
            "joint[2].referenced_bit: must be 8, 14 or 15",
        ),
        (
            "zero = \"rest\"\nrest_tolerance_deg = 1.5",
            "must be at most 1° with zero = \"rest\", got 1.5°",
        ),
        ("zero = \"absolute\"\nzero_counts = 0\nrest_tolerance_deg = 6.0", "must be at most 5°"),
        (
            "zero = \"absolute\"\nzero_counts = 0\nhoming_s = 1.0",
            "joint[2].homing_s: has a meaning only with zero = \"homing\"",
        ),
        (
            "zero = \"absolute\"\nzero_counts = 0\nsecond_rest_deg = 60.0",
            "joint[2].second_rest_deg: has a meaning only with zero = \"single-turn\", \"rest\" or \"homing\"",
        ),
        (
            "zero = \"rest\"\nsecond_rest_deg = 110.0",
            "joint[2].rest_deg: must be at least 20.0° from second_rest_deg (second_rest_m) at its actuator, got 15.0°",
        ),
        (
            "zero = \"rest\"\naccept_stated_only = [\"sign\"]",
            "must state a second position, such as a stop, which alone verifies sign with zero = \"rest\"",
        ),
    ] {
        let refused = elbow_refused(lines);
        assert!(refused.contains(words), "{lines}\n{refused}");
    }
    let ingenia = with_zero(&text(NOT_HOMED[0]), "homing");
    let refused = refusal(NOT_HOMED[0], &ingenia);
    assert!(refused.contains("\"homing\" requires 6098h in the data sheet, writable"), "{refused}");
    let elmo = with_zero(&text("config/drives/elmo_gold.toml"), "homing");
    let refused = refusal("config/drives/elmo_gold.toml", &elmo);
    assert!(
        refused.contains("6098h must be within") && refused.contains("homing_method = 35"),
        "{refused}"
    );
}

#[test]
fn recorded_configuration_without_the_key_is_absolute() {
    let files = config::files::Files::on_disk(config::trust::Trust::Any);
    Config::load_from(&files, Path::new(KRAFT)).unwrap();
    let mut copies = files.copies();
    let lines = KRAFT_TEXT.lines().filter(|line| !line.starts_with("zero = "));
    let former = lines.collect::<Vec<_>>().join("\n");
    copies.insert(KRAFT.into(), former.clone().into_bytes().into());
    let recorded = config::files::Files::copied(copies);
    let config = Config::load_from(&recorded, Path::new(KRAFT)).unwrap();
    assert!(config.joints.iter().all(|joint| joint.zero.source.is_absolute()));
    assert!(refusal(KRAFT, &former).contains("missing field `zero`"));
}

#[test]
fn tolerance_of_a_cradle_costs_newtons_at_the_grip() {
    let costs = config(KRAFT).zero_costs();
    let incremental = parse(KRAFT, &with_zero(&text(KRAFT), "rest")).zero_costs();
    // A fifth of the tolerance, and of the force.
    assert!((4.0..6.0).contains(&(costs[1] / incremental[1])), "{costs:?} {incremental:?}");
    assert!((0.15..0.4).contains(&incremental[1]), "{incremental:?}");
}
