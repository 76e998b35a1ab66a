//! Age of the samples in use: over slow networks up to and beyond the limit, and after a flood of messages.

use contract::Reason;

use crate::common::prelude::*;
use crate::linked_node::{Network, ask, booted, cycles};

/// Time engaged after which a link counts as good.
const ENGAGED_FOR: Duration = Duration::from_secs(10);

/// Result of an engagement over a network.
#[derive(Debug)]
enum Outcome {
    /// Arming was refused.
    Refused(String),
    /// A stop, at this time after arming.
    Stop(Cause, Duration),
    /// Ten seconds without a stop.
    Engaged,
}

/// Delays of one link.
#[derive(Clone, Copy, Debug)]
struct Ways {
    there: Network,
    back: Network,
}

impl Ways {
    /// Returns three links with the same mean round trip: equal constant delays, the complete delay in the return
    /// direction, and equal delays with jitter, losses and duplicates.
    fn with_delay(delay: Duration) -> [Self; 3] {
        let steady = Network { delay, ..Network::default() };
        let back = Network { delay: delay * 2, ..Network::default() };
        let uneven = Network { jitter: delay / 10, loss: 0.01, duplicates: 0.05, ..steady };
        [[steady; 2], [Network::default(), back], [uneven; 2]]
            .map(|[there, back]| Self { there, back })
    }
}

/// Engages over a link for ten seconds; the far side writes the time of each sample into its force. Returns the greatest age
/// at which one acted.
fn engaged(max_age: u32, ways: Ways) -> (Outcome, Duration) {
    let keys = format!(
        "round_trip_ms = {max_age}.0\nmax_age_ms = {max_age}.0\nstiffest_contact_n_per_m = 20.0"
    );
    let (mut node, handle) = booted("kraft_like", &keys, Network::default());
    (node.remote_mut().there.network, node.remote_mut().back.network) = (ways.there, ways.back);
    handle.writes_its_time.set(true);
    cycles(&mut node, 150);
    let mut oldest = Duration::ZERO;
    if let Err(refused) = ask(&mut node, Request::Arm) {
        return (Outcome::Refused(refused), oldest);
    }
    let armed = node.cycle().at;
    let mut from = None;
    loop {
        let record = node.cycle();
        if let Some(cause) = node.cause() {
            return (Outcome::Stop(cause, record.at.since(armed)), oldest);
        }
        if record.mode == Mode::Engaged {
            let sampled = Duration::from_secs_f64(record.f_s.force.x);
            oldest = oldest.max(record.at.since(Instant::ZERO + sampled));
            if record.at.since(*from.get_or_insert(record.at)) >= ENGAGED_FOR {
                return (Outcome::Engaged, oldest);
            }
        }
    }
}

/// Returns a cell of the table in docs/link.md.
fn cell(max_age: u32, ways: Ways) -> String {
    let (outcome, oldest) = engaged(max_age, ways);
    let age = oldest.as_secs_f64() * 1e3;
    println!("{max_age} ms, {ways:?}: {outcome:?}, {age:.1} ms");
    assert!(oldest <= MS * (max_age + 2), "{oldest:?}: {ways:?}");
    match outcome {
        Outcome::Refused(reason) => {
            assert_ne!(reason, "", "{ways:?}");
            "refused".to_owned()
        }
        // The far side may be the first that receives too late.
        Outcome::Stop(cause, after) => {
            let silent = Cause::FarSideHolds { reason: Reason::Silence };
            let is_expected = cause == Cause::LinkLost || cause == silent;
            assert!(is_expected && after < ENGAGED_FOR, "{cause} {after:?}: {ways:?}");
            "stop".to_owned()
        }
        Outcome::Engaged => format!("{:.0} ms", age.ceil()),
    }
}

/// Engages over each link, prints the rows, and compares them with docs/link.md.
fn rows_are_those_of_the_page(max_age: u32, delays: &[u32]) {
    let rows = delays.iter().map(|delay| {
        let cells = Ways::with_delay(MS * *delay).map(|ways| cell(max_age, ways)).join(" | ");
        format!("| {max_age} ms | {delay} ms | {cells} |")
    });
    let rows: Vec<String> = rows.collect();
    println!("{}", rows.join("\n"));
    let page = fs::read_to_string("docs/link.md").unwrap();
    let missing: Vec<&String> = rows.iter().filter(|row| !page.contains(*row)).collect();
    assert!(missing.is_empty(), "docs/link.md lacks {missing:#?}");
}

#[test]
fn hazard_36_delays_up_to_and_beyond_20_ms_of_age() {
    rows_are_those_of_the_page(20, &[5, 7, 8, 9, 10, 12, 15, 20]);
}

#[test]
fn hazard_36_delays_up_to_and_beyond_100_ms_of_age() {
    rows_are_those_of_the_page(100, &[40, 45, 50, 60]);
}
