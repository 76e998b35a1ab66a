//! Position scale of a simulated drive against the joint angle of the node: `encoder_counts_per_rev`, `drive_encoder`,
//! `drive_gear`, `drive_feed`, `drive_position_unit`, and 608Fh, 6091h, 6092h, 60A8h in the drive.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::common::prelude::*;
use sim::random::SplitMix;

/// Arms immediately; closes the deadman 0.4 s after the first SYNC. The hand moves from then on.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n\
    [[move]]\nat_s = 0.8\nduration_s = 0.5\nto_m = [0.05, 0.0, 0.0]\n";

/// Largest difference between the node's sample and the plant, half a period later, in rad.
const TOLERANCE: f64 = 2e-3;

const FILE: &str = "config/test.toml";

/// Accepts a position scale that is stated only.
const ACCEPTED: &str = "accept_stated_only = [\"position_scale\"]\n";

/// Returns the text of a weak arm with `keys` in place of the elbow's encoder_counts_per_rev.
fn arm_text(keys: &str) -> String {
    let weak = KRAFT_500HZ_TEXT.replace("max_force_n = 40.0 ", "max_force_n = 5.0 ");
    let (before, elbow) = weak.split_once("name = \"elbow\"").unwrap();
    let elbow = elbow.replacen("encoder_counts_per_rev = 16384", keys, 1);
    format!("{before}name = \"elbow\"{elbow}")
}

/// Returns the arm with `keys` in place of the elbow's encoder_counts_per_rev. 1:1 in 608Fh verifies no scale, so that
/// is accepted.
fn arm(keys: &str) -> Config {
    parse(FILE, &arm_text(&format!("{ACCEPTED}{keys}")))
}

fn bench(keys: &str) -> Bench<Wire> {
    let scenario = script(SCRIPT);
    Bench::new(&arm(keys), scenario, 1, Wire::default())
}

/// Returns the elbow's angle in the node less that of the plant, in rad.
fn error(bench: &mut Bench<Wire>, record: &Record) -> f64 {
    record.output.q[ELBOW.index()] - bench.world_mut().plant().q()[ELBOW.index()]
}

#[test]
fn stated_factors_are_read_as_the_angle_of_the_joint() {
    for keys in [
        "encoder_counts_per_rev = 16384",
        // 608Fh, 6092h as usual: what the drive does before its gear.
        "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]",
        "encoder_counts_per_rev = 8192\ndrive_encoder = [16384, 1]\ndrive_gear = [2, 1]\ndrive_feed = [16384, 1]",
        "encoder_counts_per_rev = 8192\ndrive_encoder = [4096, 1]\ndrive_gear = [2, 1]",
        // Millidegrees of the joint, after a gear of 36.
        "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_feed = [360000, 1]",
        // Factors that the drive does not use, and one that multiplies.
        "encoder_counts_per_rev = 16384\ndrive_encoder = [1, 1]\ndrive_feed = [1, 1]",
        "encoder_counts_per_rev = 32768\ndrive_encoder = [1, 1]\ndrive_gear = [1, 2]",
        "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]\ndrive_feed = [1, 1]",
        "encoder_counts_per_rev = 5000\ndrive_encoder = [1, 1]\ndrive_feed = [5, 1]",
        "encoder_counts_per_rev = 3333\ndrive_gear = [7, 3]",
        // Millidegrees of the shaft, by 60A8h.
        "encoder_counts_per_rev = 360000\ndrive_encoder = [16384, 1]\ndrive_position_unit = 0xFD410000",
        "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_position_unit = 0xFD410000",
    ] {
        let mut bench = bench(keys);
        bench.bring_up().unwrap_or_else(|error| panic!("{keys}: {error}"));
        let record = until(&mut bench, |record| record.mode == Mode::Engaged);
        let start = record.output.q[ELBOW.index()];
        assert!(error(&mut bench, &record).abs() < TOLERANCE, "{keys}");
        let mut travel: f64 = 0.0;
        for _ in 0..800 {
            let record = bench.cycle();
            assert_eq!((record.mode, record.cause), (Mode::Engaged, None), "{keys}");
            let off = error(&mut bench, &record);
            assert!(off.abs() < TOLERANCE, "{keys}: {off} rad");
            travel = travel.max((record.output.q[ELBOW.index()] - start).abs());
        }
        assert!(travel > 0.1, "{keys}: the elbow moved by {travel} rad");
    }
}

#[test]
fn keys_that_contradict_the_counts_are_refused() {
    let counts = "joint[2].encoder_counts_per_rev: must be";
    for (keys, reason) in [
        (
            "encoder_counts_per_rev = 16384\ndrive_position_unit = 0xFE410000",
            format!(
                "{counts} 36000, the counts of 6064h per revolution of the motor by drive_gear 1:1 and \
                 drive_position_unit FE410000h (10^-2 °); got 16384"
            ),
        ),
        (
            "encoder_counts_per_rev = 36000\ndrive_position_unit = 0xFE410000\ndrive_gear = [36, 1]",
            format!("{counts} 1000, the counts of 6064h per revolution of the motor by drive_gear 36:1"),
        ),
        (
            "encoder_counts_per_rev = 16384\ndrive_encoder = [16384, 1]\ndrive_gear = [2, 1]\ndrive_feed = [16384, 1]",
            format!("{counts} 8192, the counts of 6064h per revolution of the motor by drive_gear 2:1 and drive_feed 16384:1;"),
        ),
        ("encoder_counts_per_rev = 16384\ndrive_feed = [360000, 1]", format!("{counts} 360000, the counts")),
        (
            "encoder_counts_per_rev = 6\ndrive_position_unit = 0x00100000",
            "joint[2].encoder_counts_per_rev: no integer is within 0.1 % of 6.283e0, the counts".to_owned(),
        ),
        (
            "encoder_counts_per_rev = 36000\ndrive_position_unit = 0xFE410000\ndrive_feed = [16384, 1]",
            "joint[2].drive_feed: must be 1:1 or 36000:1, as drive_position_unit FE410000h (10^-2 °) has 36000 units in a \
             revolution; got 16384:1"
                .to_owned(),
        ),
    ] {
        for accepted in ["", ACCEPTED] {
            let refused = refusal(FILE, &arm_text(&format!("{accepted}{keys}")));
            assert!(refused.contains(&reason), "{keys}: {refused}");
        }
    }
}

#[test]
fn unit_that_is_no_angle_is_stated_only() {
    // Millimetres; thousandths of an increment; an angle with a denominator, and with a fourth byte.
    for unit in ["0xFD010000", "0xFDB50000", "0xFE410300", "0xFE410001"] {
        let keys = format!("encoder_counts_per_rev = 16384\ndrive_position_unit = {unit}");
        let refused = refusal(FILE, &arm_text(&keys));
        assert!(
            refused.contains("joint[2].accept_stated_only: elbow: position scale is"),
            "{refused}"
        );
        let config = arm(&keys);
        assert!(config.force_cap().is_halved && config.joints[2].rest.is_some(), "{unit}");
    }
}

#[test]
fn angle_unit_is_named_as_what_verifies_the_scale() {
    let facts = |keys: &str| parse(FILE, &arm_text(keys)).facts()[2].to_string();
    let unit = "encoder_counts_per_rev = 36000\ndrive_position_unit = 0xFE410000";
    assert!(facts(unit).contains("position scale verified by 60A8h and 6091h"), "{}", facts(unit));
    let usual = "encoder_counts_per_rev = 16384";
    assert!(facts(usual).contains("position scale verified by 608Fh, 6091h and 6092h"));
    let unused = facts(&format!("{ACCEPTED}{usual}\ndrive_feed = [1, 1]"));
    assert!(unused.contains("position scale stated only"), "{unused}");
}

/// Velocity unit (60A9h) in which the speed limit of the file would be a thousandth of itself.
const MILLI_RPM: u32 = 0xFDB4_4700;

/// Elbow of one trial: keys of the configuration, and objects of the drive behind an encoder of 16384 increments.
struct Trial {
    keys: String,
    quirks: Vec<String>,
    sheet: &'static str,
}

impl Trial {
    /// Draws keys that fit each other in most trials, and objects that are those of the keys in most.
    fn draw(random: &mut SplitMix) -> Self {
        const UNITS: [u32; 8] = [
            0x00B5_0000,
            0xFF41_0000,
            0xFE41_0000,
            0xFD10_0000,
            0x00B4_0000,
            0xFDB5_0000,
            0xFD01_0000,
            0xFE41_0001,
        ];
        const GEARS: [[u32; 2]; 5] = [[1, 1], [2, 1], [36, 1], [1, 2], [7, 3]];
        const FEEDS: [u32; 5] = [1, 16_384, 36_000, 360_000, 10_000];
        const ENCODERS: [u32; 4] = [16_384, 4_096, 1, 65_536];
        const COUNTS: [u32; 8] = [16_384, 8_192, 4_096, 3_600, 36_000, 360_000, 10_000, 1_000];
        fn any<T: Copy>(random: &mut SplitMix, of: &[T]) -> T {
            of[usize::try_from(random.bits() % u64::try_from(of.len()).unwrap()).unwrap()]
        }
        let often = |random: &mut SplitMix| random.unit() < 0.8;
        let unit = if random.unit() < 0.5 { UNITS[0] } else { any(random, &UNITS) };
        let gear_place = if often(random) { 0 } else { any(random, &[0, 1, 2, 3, 4]) };
        let gear = GEARS[usize::try_from(gear_place).unwrap()];
        let feed = if often(random) { None } else { Some(any(random, &FEEDS)) };
        let encoder = match random.unit() {
            share if share < 0.5 => None,
            share if share < 0.9 => Some(16_384),
            _ => Some(any(random, &ENCODERS)),
        };
        let shaft = match (unit, feed) {
            (0xFF41_0000, _) => 3_600,
            (0xFE41_0000, _) => 36_000,
            (0xFD10_0000, _) => 6_283,
            (0x00B4_0000, _) => 1,
            (_, None | Some(1)) => 16_384,
            (_, Some(feed)) => feed,
        };
        let motors = shaft * gear[1];
        let counts = match often(random) && motors.is_multiple_of(gear[0]) {
            true => motors / gear[0],
            false => any(random, &COUNTS),
        };
        let mut keys = match random.unit() < 0.5 {
            true => ACCEPTED.to_owned(),
            false => String::new(),
        };
        writeln!(keys, "encoder_counts_per_rev = {counts}\ndrive_position_unit = {unit}").unwrap();
        writeln!(keys, "drive_gear = [{}, {}]", gear[0], gear[1]).unwrap();
        encoder.iter().for_each(|of| writeln!(keys, "drive_encoder = [{of}, 1]").unwrap());
        feed.iter().for_each(|of| writeln!(keys, "drive_feed = [{of}, 1]").unwrap());

        let mut own =
            |usual: u32, of: &[u32]| if random.unit() < 0.9 { usual } else { any(random, of) };
        let feed = own(feed.unwrap_or(shaft), &FEEDS);
        // The drive knows its encoder, or has no use for the object.
        let encoder = own(16_384, &[1]);
        let unit = own(unit, &UNITS);
        let gear = GEARS[usize::try_from(own(gear_place, &[0, 1, 2, 3, 4])).unwrap()];
        let quirks = vec![
            format!("stored:608Fh:1={encoder}"),
            format!("stored:6091h:1={}", gear[0]),
            format!("stored:6091h:2={}", gear[1]),
            format!("stored:6092h:1={feed}"),
            format!("stored:60A8h={unit:X}h"),
            format!("stored:60A9h={:X}h", own(0x00B4_4700, &[MILLI_RPM])),
            format!("stored:60AAh={:X}h", own(0x00C0_0300, &[0, u32::MAX])),
        ];
        let sheet = any(random, &["", "", "", "608F", "6091", "6092", "60A8"]);
        Self { keys, quirks, sheet }
    }

    /// Returns the data sheet of the elbow's drive; without the object of the trial, which is one of the maker in it.
    fn sheet(&self) -> String {
        let mut sheet = fs::read_to_string("eds/frhc_drive.eds").unwrap();
        if !self.sheet.is_empty() {
            let own = self.sheet.replacen('6', "2", 1);
            sheet = sheet.replace(&format!("=0x{}", self.sheet), &format!("=0x{own}"));
            sheet = sheet.replace(&format!("[{}", self.sheet), &format!("[{own}"));
        }
        let path = folder("position_scale", &format!("sheet{}", self.sheet)).join("drive.eds");
        fs::write(&path, sheet).unwrap();
        fs::canonicalize(path).unwrap().to_str().unwrap().to_owned()
    }

    /// Plays the trial. Returns its end: refused by `file`, `boot` or `arming`, or `armed`.
    fn play(&self) -> &'static str {
        let sheet = self.sheet();
        let text = |keys: &str| {
            let text = arm_text(keys).replace("zero_counts = -3400", "zero_counts = 0");
            let (before, elbow) = text.split_once("name = \"elbow\"").unwrap();
            format!(
                "{before}name = \"elbow\"{}",
                elbow.replacen("../eds/frhc_drive.eds", &sheet, 1)
            )
        };
        let Ok(node) = Config::parse(Path::new(FILE), &text(&self.keys)) else { return "file" };
        let encoder =
            format!("{ACCEPTED}encoder_counts_per_rev = 16384\ndrive_encoder = [16384, 1]");
        let world = parse(FILE, &text(&encoder));
        let mut scenario = script(SCRIPT);
        let quirks =
            self.quirks.iter().filter(|quirk| self.sheet.is_empty() || !quirk.contains(self.sheet));
        scenario.quirks_mut().add(ELBOW, quirks.map(|quirk| quirk.parse().unwrap()));
        let mut bench = Bench::in_world_of(&world, &node, scenario, 1, Wire::default());
        if bench.bring_up().is_err() {
            return "boot";
        }
        let mut end = "arming";
        for _ in 0..1_000 {
            let record = bench.cycle();
            if record.mode == Mode::Armed || record.mode == Mode::Engaged {
                end = "armed";
                let speed = format!("60A9h={MILLI_RPM:X}h");
                assert!(!self.quirks.iter().any(|quirk| quirk.ends_with(&speed)), "{}", self.keys);
                let off = error(&mut bench, &record).to_degrees();
                assert!(
                    off.abs() < 2.0,
                    "off by {off}°: {} {:?} {}",
                    self.keys,
                    self.quirks,
                    self.sheet
                );
            }
        }
        end
    }
}
#[test]
fn armed_elbow_is_read_where_it_is() {
    let mut random = SplitMix::new(55);
    let mut ends = BTreeMap::<_, u32>::new();
    for _ in 0..200 {
        *ends.entry(Trial::draw(&mut random).play()).or_default() += 1;
    }
    println!("200 combinations of keys and objects: {ends:?}");
    for (end, least) in [("file", 40), ("boot", 20), ("arming", 1), ("armed", 50)] {
        assert!(ends.get(end).is_some_and(|trials| *trials >= least), "{ends:?}");
    }
}

#[test]
fn gear_scales_the_usual_encoder_and_feed() {
    let refused = |keys: &str, quirk: &str| {
        let mut scenario = script(SCRIPT);
        scenario.quirks_mut().add(ELBOW, [quirk.parse().unwrap()]);
        let mut bench = Bench::new(&arm(keys), scenario, 1, Wire::default());
        bench.bring_up().map_or_else(|error| error.to_string(), |()| String::new())
    };
    let keys = "encoder_counts_per_rev = 8192\ndrive_gear = [2, 1]";
    // Without its gear in them they would be right for half the angle.
    let encoder = refused(keys, "stored:608Fh:1=8192");
    assert!(encoder.contains("608Fh) is 8192:1, expected 16384:1 or 1:1"), "{encoder}");
    let feed = refused(keys, "stored:6092h:1=8192");
    assert!(feed.contains("6092h) is 8192:1, expected 16384:1 or 1:1"), "{feed}");
}

#[test]
fn drive_that_counts_tenths_of_a_degree_is_refused() {
    let refusal = |config: &Config, quirk: &str| {
        let mut scenario = script(SCRIPT);
        scenario.quirks_mut().add(ELBOW, [quirk.parse().unwrap()]);
        let mut bench = Bench::new(config, scenario, 1, Wire::default());
        if let Err(error) = bench.bring_up() {
            return error.to_string();
        }
        let record = until(&mut bench, |record| record.mode == Mode::Armed);
        let angle = bench.world_mut().plant().q()[ELBOW.index()];
        format!(
            "armed: the elbow is at {angle} rad, and read as {}",
            record.output.q[ELBOW.index()]
        )
    };
    let nanotec = config("config/drives/nanotec_cl4e.toml");
    for config in [arm("encoder_counts_per_rev = 16384"), nanotec] {
        assert_eq!(
            refusal(&config, "stored:60A8h=FF410000h"),
            "joint 3 (elbow), node 3: position unit (60A8h) is FF410000h (10^-1 °), expected 00B50000h (increments): \
             set it with the maker's tool or [[joint.boot.write]], or state it as drive_position_unit and give \
             encoder_counts_per_rev in units of 6064h"
        );
    }
}

#[test]
fn drive_at_rest_holds_the_stated_factors() {
    let keys = "encoder_counts_per_rev = 10000\ndrive_encoder = [65536, 1]\ndrive_gear = [36, 1]\ndrive_feed = [360000, 1]";
    let mut bench = bench(keys);
    let dictionary = bench.world_mut().drive_mut(ELBOW).unwrap().dictionary().clone();
    for (object, value) in [
        (Object::ENCODER_INCREMENTS, 65_536),
        (Object::VELOCITY_INCREMENTS, 65_536),
        (Object::GEAR_MOTOR_REVOLUTIONS, 36),
        (Object::FEED, 360_000),
    ] {
        assert_eq!(dictionary.unsigned(object), value, "{object}");
    }
}
