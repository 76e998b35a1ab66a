//! Link with delay between node and object: it transmits contact forces, an outage disables force reflection, and `check`
//! includes the delay.

use crate::common::bench::press_script;
use crate::common::prelude::*;
use config::RemoteLink;
use remote::delay::DelaySettings;

/// The node is armed by the script.
const ARM: &str = "[[console]]\nat_s = 0.1\nrequest = \"arm\"\n";

/// Returns a bench with a link and an object 0.1 mm from the wall.
fn pressing(settings: DelaySettings) -> Bench<()> {
    let text = KRAFT_TEXT.replace("start_m = [0.4,", "start_m = [0.4499,");
    let config = parse(KRAFT, &text);
    let link = RemoteLink { simulated: Some(settings), ..config.link };
    started(&config.with_link(link), script(&(press_script(0.2) + ARM)), ())
}

/// Presses for 2 s through a link with this delay in ms. Returns the time at which 0.1 N is first felt, and the largest
/// force in N.
fn felt(delay: u32) -> (Duration, f64) {
    let mut bench = pressing(DelaySettings { delay: MS * delay, ..DelaySettings::default() });
    let start = bench.now();
    let (mut first, mut largest) = (None, 0.0_f64);
    for _ in 0..2_000 {
        let record = bench.cycle();
        assert_eq!(record.cause, None);
        let at_drives = (record.output.tau - record.output.ledger.gravity).amax();
        let force = record.output.f_g_task.force.norm();
        assert!(force <= 0.1 || at_drives > 1e-3, "{force} N is {at_drives} N·m at the drives");
        first = first.or((force > 0.1).then(|| record.at.since(start)));
        largest = largest.max(force);
    }
    (first.unwrap(), largest)
}

#[test]
fn contact_is_felt_through_a_link_of_8_ms() {
    let ((direct, _), (first, largest)) = (felt(0), felt(8));
    assert!(largest > 1.0, "{largest} N");
    // The command takes 8 ms there, its contact 8 ms back.
    let later = first.saturating_sub(direct);
    assert!((MS * 15..=MS * 18).contains(&later), "{direct:?}, {first:?}");
}

#[test]
fn outage_ends_in_a_lost_link_without_reflection() {
    let start = Instant::ZERO + MS * 1_400;
    let outage = Some([MS * 1_400, MS * 1_900]);
    let mut bench = pressing(DelaySettings { delay: MS * 2, outage, ..DelaySettings::default() });
    let mut felt_for = Duration::ZERO;
    while bench.now() < start + MS * 450 {
        let record = bench.cycle();
        if record.at < start {
            assert_eq!(record.cause, None);
        } else if (record.output.tau - record.output.ledger.gravity).amax() > 1e-9 {
            felt_for = record.at.since(start);
        }
    }
    let record = bench.cycle();
    assert_eq!((record.mode, record.cause), (Mode::ReflectionOff, Some(Cause::LinkLost)));
    assert_eq!(record.output.command, Motion::Hold);
    assert!((MS * 15..=MS * 70).contains(&felt_for), "{felt_for:?}");
    while bench.now() < start + MS * 540 {
        assert_eq!(bench.cycle().mode, Mode::ReflectionOff, "it is latched");
    }
    assert_eq!(bench.ask(Request::Reset).unwrap(), Mode::Armed);
    assert_eq!(bench.cycle().cause, None);
}

#[test]
fn link_slower_than_the_maximum_age_is_never_armed() {
    let mut bench = pressing(DelaySettings { delay: MS * 12, ..DelaySettings::default() });
    for _ in 0..1_000 {
        let record = bench.cycle();
        assert_ne!(record.mode, Mode::Engaged);
        assert_eq!(record.output.command, Motion::Hold);
    }
}

fn read(link: &str, gain: &str) -> Result<Config, String> {
    let gains = format!("wrench_gain = [{gain}, {gain}, {gain}, {gain}, {gain}, {gain}]");
    let text = KRAFT_TEXT.replace("wrench_gain = [0.3, 0.3, 0.3, 0.15, 0.15, 0.15]", &gains);
    let text = format!("{text}\n[remote.link]\n{link}\n");
    Config::parse(Path::new(KRAFT), &text).map_err(|invalid| invalid.to_string())
}

#[test]
fn delay_is_accepted_with_gains_that_hold_with_it() {
    let slow = |delay: &str| format!("delay_ms = {delay}\nmax_age_ms = 100.0");
    for delay in ["20.0", "40.0"] {
        if let Err(invalid) = read(&slow(delay), "0.1") {
            panic!("{invalid}");
        }
        let refused = read(&slow(delay), "0.3").map(|_| ()).unwrap_err();
        assert!(refused.contains("controller.wrench_gain: pose reflection"), "{refused}");
    }
}

#[test]
fn gain_check_counts_the_cycles_of_the_link() {
    for (link, cycles) in [
        ("max_age_ms = 20.0", "3 T"),
        ("delay_ms = 0.0", "4 T"),
        ("delay_ms = 2.0", "8 T"),
        ("delay_ms = 2.0\njitter_ms = 1.5", "11 T"),
        ("delay_ms = 8.0", "20 T"),
    ] {
        let findings = read(link, "0.3").unwrap().findings();
        let pose = findings.iter().find(|finding| finding.name == "pose reflection").unwrap();
        let expected = format!("K_T K_P k_e (T/2 + {cycles} + τ_s)");
        assert_eq!(pose.left.symbols, expected, "{link}");
    }
}

#[test]
fn delay_lowers_the_gain_that_a_hand_holds_in_rate_mode() {
    let most = |link: &str| {
        let findings = read(link, "0.01").unwrap().findings();
        let held = findings.iter().filter(|finding| finding.name == "rate reflection, held");
        held.map(|finding| finding.right.value).fold(f64::INFINITY, f64::min)
    };
    let link = |delay: &str| most(&format!("delay_ms = {delay}\nmax_age_ms = 100.0"));
    let bounds = [most("max_age_ms = 100.0"), link("2.0"), link("8.0"), link("40.0")];
    assert!(bounds.is_sorted_by(|a, b| a > b), "{bounds:?}");
}

#[test]
fn keys_of_the_link_are_read_in_ms_and_percent() {
    let link = "max_age_ms = 60.0\ndelay_ms = 10.0\njitter_ms = 2.5\nloss_percent = 5.0\nreorder = true\n\
        outage_s = [2.0, 2.5]\nhold_after_ms = 80.0\nseed = 7";
    let RemoteLink { max_age, simulated } = read(link, "0.005").unwrap().link;
    assert_eq!(max_age, MS * 60);
    let expected = DelaySettings {
        delay: MS * 10,
        jitter: Duration::from_micros(2_500),
        loss: 0.05,
        reorders: true,
        outage: Some([MS * 2_000, MS * 2_500]),
        hold_after: MS * 80,
        seed: 7,
        ..DelaySettings::default()
    };
    assert_eq!(simulated, Some(expected));
    let alone = read("max_age_ms = 60.0", "0.3").unwrap().link;
    assert_eq!(alone, RemoteLink { max_age: MS * 60, simulated: None });
}

#[test]
fn invalid_links_are_refused_with_the_remedy() {
    for (link, reason) in [
        ("delay_ms = 10.0", "remote.link.delay_ms: samples would be up to 22.0 ms old"),
        ("delay_ms = 60.0\nmax_age_ms = 100.0", "or raise max_age_ms, at most to 100"),
        ("jitter_ms = 30.0", "remote.link.jitter_ms: samples would be up to 62.0 ms old"),
        (
            "delay_ms = 20.0\nmax_age_ms = 100.0\nhold_after_ms = 30.0",
            "remote.link.hold_after_ms: must be at least 42.0",
        ),
        ("max_age_ms = 101.0", "remote.link.max_age_ms: "),
        ("loss_percent = 95.0", "remote.link.loss_percent: "),
        ("delay_ms = -1.0", "remote.link.delay_ms: "),
        ("outage_s = [2.0, 1.0]", "remote.link.outage_s: must ascend within 0..=86400"),
        ("outage_s = [-1.0, 1.0]", "remote.link.outage_s: "),
        ("outage_s = [nan, 1.0]", "remote.link.outage_s: "),
        ("outage_s = [1.0]", "remote.link.outage_s: "),
        ("delay_s = 1.0", "delay_s"),
    ] {
        let refused = read(link, "0.005").map(|_| ()).unwrap_err();
        assert!(refused.contains(reason), "{link}: {refused}");
    }
}
