//! Facts of drives that only the configuration states: accepted by key, at half of the force, without friction
//! compensation; and what may limit torque in place of 6072h.

use crate::common::prelude::*;
use crate::common::rest::{KRAFT_LIKE, at_rest};
use canopen::fact::Fact;
use config::facts::FactsError;
use config::{StatedLimit, TorqueLimit};
use node::{RequestError, Unfit};

const FILE: &str = "config/drives/elmo_gold.toml";
const TEXT: &str = include_str!("../../config/drives/elmo_gold.toml");

const SIGN: &str = "607E";
const ENCODER: &str = "608F";
const RATED_TORQUE: &str = "6076";
const RATED_CURRENT: &str = "6075";
const MAX_TORQUE: &str = "6072";

/// Returns [`TEXT`] with drives that lack these objects: they are of the maker in this data sheet.
fn lacking(test: &str, objects: &[&str]) -> String {
    let mut sheet = fs::read_to_string("eds/drives/elmo-gold.eds").unwrap();
    for object in objects {
        let own = object.replacen('6', "2", 1);
        sheet = sheet.replace(&format!("=0x{object}"), &format!("=0x{own}"));
        sheet = sheet.replace(&format!("[{object}"), &format!("[{own}"));
    }
    let path: PathBuf = folder("stated", test).join("drive.eds");
    fs::write(&path, sheet).unwrap();
    let path = fs::canonicalize(path).unwrap();
    TEXT.replace("../../eds/drives/elmo-gold.eds", path.to_str().unwrap())
}

/// Returns `text` whose joints accept facts by this line, with the rest posture that these need.
fn accepting(text: &str, line: &str) -> String {
    at_rest(&in_each_joint(text, line), KRAFT_LIKE)
}

/// Returns `text` with weak forces: 10 N and less in all.
fn weak(text: &str) -> String {
    let text = text.replace("max_force_n = 10.0 ", "max_force_n = 3.0 ");
    text.replace("push = 0.2 ", "push = 0.1 ")
}

fn without_friction(text: &str) -> String {
    let (before, after) = text.split_once("[controller.friction]\n").unwrap();
    format!("{before}{}", after.split_once('\n').unwrap().1)
}

#[test]
fn stated_facts_are_refused_once_for_all_joints_alike() {
    let refusal = refusal(FILE, &weak(&lacking("refused-once", &[SIGN, ENCODER])));
    assert_eq!(refusal.lines().count(), 1, "{refusal}");
    for part in [
        "joint[0].accept_stated_only: azimuth, elevation, elbow, pitch, yaw, roll: sign and position scale are",
        "(607Eh; 6091h, with 608Fh and 6092h other than 1:1 or an angle in 60A8h)",
        "accept_stated_only = [\"sign\", \"position_scale\"], with rest_deg (rest_m), in each [[joint]]",
    ] {
        assert!(refusal.contains(part), "{part}: {refusal}");
    }
    // Another joint that lacks less is named by itself.
    let elbow = accepting(&lacking("refused-apart", &[SIGN]), "accept_stated_only = [\"sign\"]");
    let mut joints: Vec<_> = elbow.split("name = ").map(str::to_owned).collect();
    joints[4] = joints[4].replacen("accept_stated_only", "#", 1);
    let apart = self::refusal(FILE, &weak(&joints.join("name = ")));
    assert!(apart.contains("joint[2].accept_stated_only: elbow: sign is stated only"), "{apart}");
    assert_eq!(apart.lines().count(), 1, "{apart}");
}

#[test]
fn drive_without_evidence_gets_half_the_force_no_friction() {
    let none = lacking("none", &[SIGN, ENCODER, RATED_CURRENT, RATED_TORQUE]);
    let all = "accept_stated_only = [\"sign\", \"position_scale\", \"torque_unit\"]";
    let first = refusal(FILE, &none);
    assert!(first.contains("[\"sign\", \"position_scale\", \"torque_unit\"]"), "{first}");
    let accepted = accepting(&none, all);
    let strong = refusal(FILE, &without_friction(&accepted));
    assert!(strong.contains("controller.max_force_n: "), "{strong}");
    assert!(strong.contains("half of 0.5 m/s, as facts of a drive are stated only"), "{strong}");
    assert!(strong.contains("at most 10.0 N in all"), "{strong}");
    let rubbing = refusal(FILE, &weak(&accepted));
    assert!(
        rubbing.contains("controller.friction: friction compensation must be off"),
        "{rubbing}"
    );
    assert_eq!((strong.lines().count(), rubbing.lines().count()), (1, 1));
    let config = parse(FILE, &weak(&without_friction(&accepted)));
    assert!(config.force_cap().is_halved);
    let text = config.facts()[2].to_string();
    assert_eq!(text, "sign stated only, position scale stated only, torque unit stated only");
}

#[test]
fn unused_encoder_resolution_is_a_stated_scale() {
    let unused = in_each_joint(TEXT, "drive_encoder = [1, 1]");
    let refusal = refusal(FILE, &weak(&unused));
    assert!(refusal.contains("roll: position scale is stated only"), "{refusal}");
    let accepted = accepting(&unused, "accept_stated_only = [\"position_scale\"]");
    parse(FILE, &weak(&accepted));
}

#[test]
fn unknown_fact_is_refused_by_key() {
    let refusal = refusal(FILE, &in_each_joint(TEXT, "accept_stated_only = [\"scale\"]"));
    let expected = "joint[0].accept_stated_only: unknown fact \"scale\"; expected \"sign\", \"position_scale\" or \"torque_unit\"";
    assert!(refusal.contains(expected), "{refusal}");
}

#[test]
fn shipped_files_accept_what_their_drives_lack() {
    let arms = ["kraft_like", "kraft_like_500hz", "jpl_like", "jpl_like_1538hz", "sixr_spherical"];
    let mut files = arms.map(|name| PathBuf::from(format!("config/{name}.toml"))).to_vec();
    files.extend(fs::read_dir("config/drives").unwrap().map(|entry| entry.unwrap().path()));
    let (sign, scale, unit) = (Fact::Sign, Fact::PositionScale, Fact::TorqueUnit);
    for file in files {
        let config = Config::load(&file).unwrap();
        let expected = match file.file_stem().unwrap().to_str().unwrap() {
            "maxon_epos4" | "ingenia_eve" => vec![sign, scale],
            "technosoft_ipos" => vec![scale, unit],
            _ => vec![],
        };
        for (facts, joint) in config.facts().iter().zip(&config.joints) {
            assert_eq!(facts.stated_only(), expected, "{}", file.display());
            assert_eq!(joint.accepted, expected, "{}", file.display());
        }
        assert_eq!(config.force_cap().is_halved, !expected.is_empty(), "{}", file.display());
    }
}

/// Returns a bench of `config` with the drives of `world`, after its boot.
fn booted(world: &Config, config: &Config) -> Bench<()> {
    let scenario = script("seconds = 5\n");
    let mut bench = Bench::in_world_of(world, config, scenario, 1, ());
    bench.bring_up().unwrap();
    (0..50).for_each(|_| _ = bench.cycle());
    bench
}

#[test]
fn fact_that_the_drive_aborts_is_stated_only_after_the_boot() {
    let accepted = accepting(&lacking("aborts", &[SIGN]), "accept_stated_only = [\"sign\"]");
    let world = parse(FILE, &weak(&accepted));
    let listed = parse(FILE, &at_rest(&weak(TEXT), KRAFT_LIKE));
    let mut bench = booted(&world, &listed);
    let Err(RequestError::Unfit(refused)) = bench.ask(Request::Arm) else { panic!("armed") };
    let [Unfit::Facts(FactsError::NotAccepted { joints, facts })] = &refused[..] else {
        panic!("{refused:?}")
    };
    assert_eq!((joints.len(), &facts[..]), (6, &[Fact::Sign][..]));
    assert_eq!(bench.node().mode(), Mode::Ready);
    // Accepted, it halves the force all the same.
    let strong = parse(FILE, &accepting(TEXT, "accept_stated_only = [\"sign\"]"));
    assert!(!strong.force_cap().is_halved);
    let refused = booted(&world, &strong).ask(Request::Arm).unwrap_err();
    assert!(refused.to_string().contains("half of 0.5 m/s"), "{refused}");
    let weak = parse(FILE, &weak(&accepting(TEXT, "accept_stated_only = [\"sign\"]")));
    let mut bench = booted(&world, &weak);
    bench.ask(Request::Arm).unwrap();
    assert!(
        bench.node().facts()[0]
            .to_string()
            .starts_with("sign stated only, position scale verified")
    );
}

#[test]
fn arming_is_refused_by_all_its_reasons_at_once() {
    let sign = "accept_stated_only = [\"sign\"]";
    let world = parse(FILE, &weak(&accepting(&lacking("at-once", &[SIGN]), sign)));
    // Too much force for a fact that is stated only, which is not accepted, and the elbow rests elsewhere.
    let mut elsewhere = KRAFT_LIKE;
    elsewhere[2] -= 10.0;
    let strong = at_rest(TEXT, elsewhere);
    let mut bench = booted(&world, &parse(FILE, &strong));
    let refused = bench.ask(Request::Arm).unwrap_err();
    let RequestError::Unfit(reasons) = &refused else { panic!("{refused}") };
    let kinds = reasons.iter().map(|reason| match reason {
        Unfit::Facts(_) => "facts",
        Unfit::Force(_) => "force",
        Unfit::NotAtRest(_) => "rest",
        Unfit::UnknownZeros(_) => "zero",
        Unfit::FarSide(_) => "far side",
    });
    assert_eq!(kinds.collect::<Vec<_>>(), ["facts", "force", "rest"], "{refused}");
    for part in [sign, "half of 0.5 m/s", "; joint 3 (elbow): reads "] {
        assert!(refused.to_string().contains(part), "{part}: {refused}");
    }
}

#[test]
fn friction_in_a_unit_that_the_drive_aborts_is_not_armed() {
    let key = "accept_stated_only = [\"torque_unit\"]";
    let world = lacking("unit", &[RATED_CURRENT, RATED_TORQUE]);
    let world = parse(FILE, &weak(&without_friction(&in_each_joint(&world, key))));
    let listed = parse(FILE, &weak(&in_each_joint(TEXT, key)));
    let refused = booted(&world, &listed).ask(Request::Arm).unwrap_err();
    assert!(refused.to_string().starts_with("friction compensation must be off"), "{refused}");
}

/// Returns [`TEXT`] with this `[joint.torque_limit]` of the azimuth.
fn limited(text: &str, lines: &str) -> String {
    text.replacen(
        "\n[[joint]]\nname = \"elevation\"",
        &format!("\n[joint.torque_limit]\n{lines}\n\n[[joint]]\nname = \"elevation\""),
        1,
    )
}

#[test]
fn object_that_limits_no_torque_is_refused() {
    for object in ["6087h", "6071h", "6080h", "605Ah", "1017h"] {
        let refusal = refusal(FILE, &limited(TEXT, &format!("object = \"{object}\"\nvalue = 1")));
        let expected =
            format!("joint[0].torque_limit.object: {object} limits no torque; name 6072h, 6073h,");
        assert!(refusal.contains(&expected), "{refusal}");
        assert_eq!(refusal.lines().count(), 1, "{refusal}");
    }
    for object in ["6072h", "6073h"] {
        parse(FILE, &limited(TEXT, &format!("object = \"{object}\"\nvalue = 900")));
    }
    let zero = refusal(FILE, &limited(TEXT, "object = \"6073h\"\nvalue = 0"));
    assert!(zero.contains("joint[0].torque_limit.value: must be within 1..="), "{zero}");
}

#[test]
fn limit_of_one_direction_is_written_for_both() {
    let kraft = KRAFT;
    let text = limited(&fs::read_to_string(kraft).unwrap(), "object = \"60E0h\"\nvalue = 900");
    let config = parse(kraft, &text);
    let Some(TorqueLimit::Objects(writes)) = &config.joints[0].torque_limit else { panic!() };
    let objects: Vec<_> = writes.iter().map(|(object, _)| *object).collect();
    assert_eq!(objects, [Object::POSITIVE_TORQUE_LIMIT, Object::NEGATIVE_TORQUE_LIMIT]);
}

#[test]
fn limit_of_the_makers_tool_halves_the_force() {
    let tool = |text: &str, line: &str| {
        text.replace(
            "\n[[joint]]\nname",
            &format!("\n[joint.torque_limit]\n{line}\n\n[[joint]]\nname"),
        )
        .replacen(&format!("[joint.torque_limit]\n{line}\n\n"), "", 1)
        .replacen(
            "\n[switches]\n",
            &format!("\n[joint.torque_limit]\n{line}\n\n[switches]\n"),
            1,
        )
    };
    let drive = lacking("tool", &[MAX_TORQUE]);
    let without = refusal(FILE, &drive);
    assert!(without.contains("[joint.torque_limit]"), "{without}");
    let strong = refusal(FILE, &tool(&drive, "makers_tool_per_mille = 900"));
    assert!(strong.contains("max_force_n") && strong.contains("at most 10.0 N"), "{strong}");
    let config = parse(FILE, &weak(&tool(&drive, "makers_tool_per_mille = 900")));
    assert_eq!(config.facts()[5].torque_limit, Some(StatedLimit::PerMille(900.0)));
    let text = config.facts()[0].to_string();
    assert!(
        text.ends_with("limit of the maker's tool stated only: 900 ‰ of rated torque"),
        "{text}"
    );
    let plans = config.node_plans();
    let limits = |object: Object| plans[0].1.demands().any(|demand| demand == object);
    assert!(!limits(Object::MAX_TORQUE));
    booted(&config, &config).ask(Request::Arm).unwrap();
    parse(FILE, &weak(&tool(&drive, "makers_tool_ma = 3000")));
    for (lines, reason) in [
        (
            "makers_tool_ma = 3000\nmakers_tool_per_mille = 900",
            "joint[0].torque_limit: must have one of",
        ),
        ("object = \"6073h\"", "joint[0].torque_limit.object: needs a value beside it"),
        ("makers_tool_ma = 0", "joint[0].torque_limit.makers_tool_ma: must be within"),
    ] {
        let refusal = refusal(FILE, &limited(&weak(&drive), lines));
        assert!(refusal.contains(reason), "{lines}: {refusal}");
    }
    let listed = refusal(FILE, &limited(TEXT, "makers_tool_ma = 3000"));
    assert!(
        listed.contains("joint[0].torque_limit: must be absent, as 6072h is in the EDS"),
        "{listed}"
    );
}
