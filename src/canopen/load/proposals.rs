//! Proposals: other layouts of the same network that fit or are faster, each computed like the one in use.

use std::time::Duration;

use crate::load::alternatives::{Change, changed};
use crate::load::network::{Assumptions, Network};
use crate::load::utilisation::BusLoad;

/// Usual SYNC periods, in µs.
const PERIODS_US: [u32; 12] =
    [500, 625, 800, 1_000, 1_250, 1_600, 2_000, 2_500, 4_000, 5_000, 10_000, 20_000];

/// Variant of a network, and its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Changes against the network in use, applied in order.
    pub changes: Vec<Change>,
    /// Worst-case load of each bus.
    pub loads: Vec<BusLoad>,
    /// Set if the variant fits.
    pub fits: bool,
    /// Maximum SYNC rate in the worst case, in Hz.
    pub highest_hz: f64,
    /// Worst-case response time of the torques; `None` if unbounded.
    pub torque_response: Option<Duration>,
}

/// Proposes changes to `network`: every layout of lower load if it does not fit, else other EMCY COB-IDs if
/// emergencies delay torques.
pub fn proposals(network: &Network, assumed: &Assumptions) -> Vec<Proposal> {
    if network.fits(assumed) {
        let moved = proposal_of(network, &[Change::EmergenciesMoved], assumed);
        let now = network.torque_response(assumed);
        return moved.filter(|moved| is_shorter(moved.torque_response, now)).into_iter().collect();
    }
    let now = network.highest_hz(assumed);
    let tried = [
        vec![Change::SlowHeartbeats],
        vec![Change::Grouped],
        vec![Change::StatesOnChange],
        vec![Change::SecondBus],
        vec![Change::Grouped, Change::SecondBus],
    ];
    let slower = slower(network, assumed).map(|period_us| vec![Change::Period(period_us)]);
    let mut found: Vec<Proposal> = Vec::new();
    for changes in tried.into_iter().chain(slower) {
        // Two large changes are proposed only if one is not enough.
        let is_needed = changes.len() == 1 || !found.iter().any(|one| one.fits);
        let proposal = is_needed.then(|| refined(network, &changes, assumed)).flatten();
        // Slower heartbeats alone are proposed only if they are enough.
        let is_worth_it = |one: &Proposal| {
            one.fits || one.highest_hz > now && one.changes != [Change::SlowHeartbeats]
        };
        found.extend(proposal.filter(is_worth_it));
    }
    found
}

/// Adds slower heartbeats to `changes` if the variant fits only with them, and moved emergencies if they shorten
/// the torque response.
fn refined(network: &Network, changes: &[Change], assumed: &Assumptions) -> Option<Proposal> {
    let with = |proposal: &Proposal, change| {
        proposal_of(network, &[proposal.changes.as_slice(), &[change]].concat(), assumed)
    };
    let plain = proposal_of(network, changes, assumed)?;
    let slower = if plain.fits { None } else { with(&plain, Change::SlowHeartbeats) };
    let fitting = slower.filter(|slower| slower.fits).unwrap_or(plain);
    let moved = if fitting.fits { with(&fitting, Change::EmergenciesMoved) } else { None };
    let sooner = moved.filter(|it| is_shorter(it.torque_response, fitting.torque_response));
    Some(sooner.unwrap_or(fitting))
}

fn proposal_of(network: &Network, changes: &[Change], assumed: &Assumptions) -> Option<Proposal> {
    let network = changed(network, changes)?;
    Some(Proposal {
        changes: changes.to_vec(),
        loads: network.loads(),
        fits: network.fits(assumed),
        highest_hz: network.highest_hz(assumed),
        torque_response: network.torque_response(assumed),
    })
}

fn is_shorter(this: Option<Duration>, that: Option<Duration>) -> bool {
    this.is_some_and(|this| that.is_none_or(|that| this < that))
}

/// Returns the present period if the network fits, else the shortest usual one above it at which it does.
pub fn fitting_period(network: &Network, assumed: &Assumptions) -> Option<u32> {
    if network.fits(assumed) { Some(network.period_us) } else { slower(network, assumed) }
}

/// Shortest usual period, above the present one, at which the network fits.
fn slower(network: &Network, assumed: &Assumptions) -> Option<u32> {
    let longer = PERIODS_US.into_iter().filter(|period_us| *period_us > network.period_us);
    let fits = |period_us: &u32| {
        changed(network, &[Change::Period(*period_us)]).is_some_and(|slower| slower.fits(assumed))
    };
    longer.into_iter().find(fits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::lacks::Lack;
    use crate::load::network::Bus;
    use crate::object::Object;
    use crate::testing::networks::{network, six_drives_and_switches};

    fn overloaded() -> Network {
        network(six_drives_and_switches(), 1_000)
    }

    fn proposed(network: &Network) -> Vec<Proposal> {
        proposals(network, &Assumptions::default())
    }

    #[test]
    fn overloaded_network_gets_proposals_that_fit() {
        let percent = |load: &BusLoad| format!("{:.1}", load.percent());
        let found = proposed(&overloaded());
        let found = found.iter().map(|one| {
            let loads: Vec<String> = one.loads.iter().map(percent).collect();
            (one.changes.clone(), loads.join(" "), one.fits)
        });
        let moved = Change::EmergenciesMoved;
        let expected = [
            (vec![Change::Grouped, Change::SlowHeartbeats, moved], "89.9", true),
            (vec![Change::StatesOnChange], "113.2", false),
            (vec![Change::SecondBus, moved], "76.6 78.1", true),
            (vec![Change::Period(2_000), moved], "76.2", true),
        ];
        let expected = expected.map(|(changes, loads, fits)| (changes, loads.to_owned(), fits));
        assert_eq!(found.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn small_overload_gets_small_changes() {
        let grouped = changed(&overloaded(), &[Change::Grouped]).unwrap();
        let found = proposed(&grouped);
        let expected = [Change::SlowHeartbeats, Change::EmergenciesMoved];
        assert_eq!(found.first().unwrap().changes, expected);
        assert!(found.iter().all(|one| !one.changes.contains(&Change::StatesOnChange)));
    }

    #[test]
    fn unable_drives_are_not_grouped() {
        let mut network = overloaded();
        network.buses[0].members[2].abilities.no_group = vec![Lack::Dummy(Object::DUMMY_INTEGER16)];
        let found = proposed(&network);
        assert!(found.iter().any(|one| one.fits));
        assert!(found.iter().all(|one| !one.changes.contains(&Change::Grouped)));
    }

    #[test]
    fn fitting_period_is_the_present_one_or_the_next_usual() {
        let at = |period_us| network(six_drives_and_switches(), period_us);
        let fitting = |network| fitting_period(&network, &Assumptions::default());
        assert_eq!(fitting(at(1_000)), Some(2_000));
        assert_eq!(fitting(at(2_200)), Some(2_200));
        let crawling = Network {
            buses: vec![Bus { bitrate: 10_000, ..at(1_000).buses[0].clone() }],
            ..at(1_000)
        };
        assert_eq!(fitting(crawling), None);
    }

    #[test]
    fn fitting_network_gets_moved_emergencies_only() {
        let slow = network(six_drives_and_switches(), 2_000);
        let found = proposed(&slow);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].changes, [Change::EmergenciesMoved]);
        let moved = changed(&slow, &[Change::EmergenciesMoved]).unwrap();
        assert_eq!(proposed(&moved), []);
    }

    #[test]
    fn every_proposed_rate_fits() {
        for proposal in proposed(&overloaded()).into_iter().filter(|one| one.fits) {
            let mut network = changed(&overloaded(), &proposal.changes).unwrap();
            let shortest = (1e6 / proposal.highest_hz).ceil();
            network.period_us = (1..).find(|us| f64::from(*us) >= shortest).unwrap();
            assert!(network.fits(&Assumptions::default()), "{:?}", proposal.changes);
        }
    }
}
