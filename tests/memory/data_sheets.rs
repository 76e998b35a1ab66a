//! Rehearsal: arms whose drives are made from the data sheets of real ones, at 500 Hz with one frame per drive.
#![allow(
    clippy::panic,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test"
)]

use std::path::Path;

use crate::common::bench::Wire;
use canopen::eds::Eds;
use config::Config;
use lab::bench::Bench;
use node::record::Mode;
use sim::quirks::Quirk;
use sim::scenario::Scenario;
use units::numbering::Joint;

const BASE: &str = include_str!("../../config/kraft_like_500hz.toml");

/// Identity of our own drive, as the base has it.
const OWN: &str = "eds = \"../eds/frhc_drive.eds\"\n\
    vendor_id = 0x0000_0F8C\nproduct_code = 0x0402_0010\nrevision = 0x0001_0000\n";

/// Arms at once; closes the deadman 0.4 s after the first SYNC, when the drives are enabled.
const SCRIPT: &str = "seconds = 5\n\
    [[console]]\nat_s = 0.02\nrequest = \"arm\"\n\
    [[switch]]\nat_s = 0.4\ndeadman = true\n";

/// Output current limit of EPOS4, in mA; its 6076h is in µN·m.
const EPOS4: (&str, &str, &str) = (
    "maxon-epos4",
    "rated_torque_unit = \"uNm\"\n",
    "[joint.torque_limit]\nobject = \"3001h:2\"\nvalue = 4000\n",
);

/// Returns the base with drives of the data sheet `name`, which have no RPDO timer: less force.
fn config((name, keys, section): (&str, &str, &str)) -> Config {
    let eds = Eds::parse(&std::fs::read(format!("eds/drives/{name}.eds")).unwrap()).unwrap();
    let (vendor, product, revision) = (eds.vendor(), eds.product(), eds.device().revision);
    let theirs = format!(
        "eds = \"../eds/drives/{name}.eds\"\n\
         vendor_id = {vendor}\nproduct_code = {product}\nrevision = {revision}\n{keys}"
    );
    let text = BASE
        .replace(OWN, &theirs)
        .replace("rpdo_timer_ms = 8 ", "rpdo_timer_ms = 0 ")
        .replace("max_force_n = 40.0", "max_force_n = 10.0")
        .replace("\n[[joint]]", &format!("\n{section}\n[[joint]]"))
        .replace("\n[switches]", &format!("\n{section}\n[switches]"));
    // The first joint has nothing before it.
    let text = text.replacen(&format!("\n{section}\n[[joint]]"), "\n[[joint]]", 1);
    Config::parse(Path::new("config/test.toml"), &text)
        .unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn bench(config: &Config, quirks: &[&str]) -> Bench<Wire> {
    let mut scenario = Scenario::parse(SCRIPT).unwrap();
    let quirks = quirks.iter().map(|quirk| quirk.parse::<Quirk>().unwrap());
    scenario.quirks_mut().add(Joint::of::<3>(), quirks);
    Bench::new(config, scenario, 1, false, Wire::default())
}

#[test]
fn arms_with_drives_of_real_data_sheets_engage() {
    for drive in [EPOS4, ("elmo-gold", "", ""), ("nanotec-cl4-e", "", ""), ("eyou-euservo", "", "")]
    {
        let mut bench = bench(&config(drive), &[]);
        bench.bring_up().unwrap_or_else(|error| panic!("{}: {error}", drive.0));
        let engaged = (0..500).map(|_| bench.cycle()).find(|it| it.mode == Mode::Engaged);
        assert!(engaged.is_some(), "{}", drive.0);
        let stops = (0..200).map(|_| bench.cycle()).find(|it| it.mode != Mode::Engaged);
        assert!(stops.is_none(), "{}: {:?}", drive.0, stops.unwrap().cause);
    }
}

#[test]
fn stored_values_of_real_drives_are_found() {
    let elmo = config(("elmo-gold", "", ""));
    for (quirk, object) in [
        ("polarity-reversed", "607Eh"),
        ("stored:6091h:1=2", "6091h"),
        ("stored:608Fh:1=8192", "608Fh"),
        ("stored:6076h=131000", "6076h"),
    ] {
        let booted = bench(&elmo, &[quirk]).bring_up();
        let error = booted.err().map_or(String::new(), |error| error.to_string());
        assert!(error.contains("joint 3 (elbow)") && error.contains(object), "{quirk}: {error}");
    }
}
