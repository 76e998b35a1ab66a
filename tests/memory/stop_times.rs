//! Time until a drive stops without frames from the node: the proof test finds the value that `frhc check` reads from the
//! data sheet, so both refuse arming at the same force.

use crate::common::prelude::*;

/// Returns a configuration of drives that send no emergencies by their data sheet, with this RPDO timer and force.
fn without_emergencies(name: &str, rpdo_timer_ms: u16, max_force_n: u16) -> Result<Config, String> {
    let sheet = fs::read_to_string("eds/frhc_drive.eds").unwrap();
    let sheet = sheet.replace("=0x1014\n", "=0x2014\n").replace("[1014]", "[2014]");
    let path = folder("stop_times", name).join("drive.eds");
    fs::write(&path, sheet).unwrap();
    let path = fs::canonicalize(path).unwrap();
    let text = KRAFT_500HZ_TEXT.replace("../eds/frhc_drive.eds", path.to_str().unwrap());
    let text = text.replace("rpdo_timer_ms = 8", &format!("rpdo_timer_ms = {rpdo_timer_ms}"));
    let text = text.replace("max_force_n = 40.0", &format!("max_force_n = {max_force_n}"));
    let text = without_passivity(&text);
    let file = Path::new(KRAFT_500HZ);
    Config::parse(file, &text).map_err(|invalid| invalid.to_string())
}

/// Without the damper, which in 36 ms would reverse the motion of the hand.
fn without_passivity(text: &str) -> String {
    let (before, section) = text.split_once("[controller.passivity]").unwrap();
    format!("{before}{}", &section[section.find("\n[").unwrap()..])
}

#[test]
fn force_without_emergencies_is_refused_by_check_as_at_arming() {
    let refusal = without_emergencies("refused", 0, 8).unwrap_err();
    for part in ["controller.max_force_n: 17.5 N", "for the 36.0 ms", "at most 13.8 N in all"] {
        assert!(refusal.contains(part), "{part}: {refusal}");
    }
    let config = without_emergencies("accepted", 0, 4).unwrap();
    let said = config.stopping().remove(5).to_string();
    assert_eq!(said, "heartbeat 22 ms (read from 6041h within 36 ms, as it has no 1014h)");
    let mut bench = Bench::new(&config, script("seconds = 5"), 1, Wire::default());
    bench.bring_up().unwrap();
    bench.ask(Request::Arm).unwrap();
}

#[test]
fn proof_test_without_emergencies_keeps_to_the_planned_time() {
    for (rpdo_timer_ms, heartbeat_is_slower) in [(0, false), (8, true)] {
        let config = without_emergencies(&format!("{rpdo_timer_ms}"), rpdo_timer_ms, 4).unwrap();
        let mut bench = Bench::new(&config, script("seconds = 5"), 1, Wire::default());
        bench.bring_up().unwrap();
        let report = bench.node().proof_test_report();
        for expiry in report.drives.iter().flat_map(|drive| drive.expiries()) {
            assert!(expiry.measured <= expiry.planned, "{expiry:?}");
            assert_eq!(expiry.reaction_time(), expiry.planned, "{expiry:?}");
        }
        let longest = report.reaction_time().unwrap();
        assert_eq!(longest, config.planned_reaction_time());
        assert_eq!(longest < Duration::from_millis(22), heartbeat_is_slower);
    }
}
