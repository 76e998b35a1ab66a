//! What would fit where this does not, and what would be quicker: other layouts of the same network,
//! each planned like the one in use. Nothing here is a rule of thumb.

use std::time::Duration;

use crate::canopen::layout::Direction;
use crate::canopen::layout::Mapped;
use crate::canopen::layout::Pdo;
use crate::canopen::layout::Service;
use crate::canopen::load::abilities::GROUP;
use crate::canopen::load::abilities::INTEGER16;
use crate::canopen::load::abilities::NoGroup;
use crate::canopen::load::network::Assumptions;
use crate::canopen::load::network::Bus;
use crate::canopen::load::network::Member;
use crate::canopen::load::network::Network;
use crate::canopen::load::utilisation::BusLoad;
use crate::canopen::object::Object;
use crate::canopen::plan::NodePlan;
use crate::canopen::sync::Transmission;

/// SYNC periods people use, in µs: 1 kHz and what divides it evenly, or nearly.
const PERIODS_US: [u32; 12] =
    [500, 625, 800, 1_000, 1_250, 1_600, 2_000, 2_500, 4_000, 5_000, 10_000, 20_000];

/// Emergencies moved behind everything of a cycle: free for use in CiA 301 (7.3.5), and above node
/// guarding.
const EMERGENCIES: u16 = 0x680;

/// One thing done differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Three drives listen to one torque RPDO; states go on change.
    Grouped,
    /// Statusword and controlword go on change, each in a PDO of its own.
    StatesOnChange,
    /// Half of the drives move to another bus.
    SecondBus,
    /// SYNC comes every so many µs.
    Period(u32),
    /// Emergencies have identifiers behind the cycle's.
    EmergenciesMoved,
}

/// A network that differs from the one in use, and what it comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// What is done differently.
    pub changes: Vec<Change>,
    /// The worst-case load of each bus.
    pub loads: Vec<BusLoad>,
    /// Whether it fits.
    pub fits: bool,
    /// The highest SYNC rate in the worst case, in Hz.
    pub highest_hz: f64,
    /// The longest response of the torques in the worst case; `None` where there is no bound.
    pub torque_response: Option<Duration>,
}

/// A drive that cannot do what would help.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// Its name.
    pub drive: String,
    /// Why it cannot listen to a shared RPDO.
    pub reason: NoGroup,
}

/// What could be done about `network`: where it does not fit, every layout that carries less, whether
/// it fits or not; where only emergencies make torques late, other identifiers for those.
pub fn proposals(network: &Network, assumed: &Assumptions) -> Vec<Proposal> {
    let propose = |changes: &[Change]| proposal(network, changes, assumed);
    if network.fits(assumed) {
        let moved = propose(&[Change::EmergenciesMoved]);
        let now = network.torque_response(assumed);
        return moved.filter(|moved| is_shorter(moved.torque_response, now)).into_iter().collect();
    }
    let tried = [
        vec![Change::Grouped],
        vec![Change::StatesOnChange],
        vec![Change::SecondBus],
        vec![Change::Grouped, Change::SecondBus],
    ];
    let slower = slower(network, assumed).map(|period_us| vec![Change::Period(period_us)]);
    let is_alone = |changes: &[Change]| changes.len() == 1;
    let mut found: Vec<Proposal> = Vec::new();
    for changes in tried.into_iter().chain(slower) {
        // Two changes only where one is not enough.
        let is_needed = is_alone(&changes) || !found.iter().any(|one| one.fits);
        let Some(proposal) = propose(&changes).filter(|_| is_needed) else { continue };
        let moved = [changes.as_slice(), &[Change::EmergenciesMoved]].concat();
        let moved = propose(&moved)
            .filter(|moved| is_shorter(moved.torque_response, proposal.torque_response));
        found.push(moved.filter(|_| proposal.fits).unwrap_or(proposal));
    }
    found
}

/// The drives that keep torques from being grouped.
pub fn obstacles(network: &Network) -> Vec<Obstacle> {
    let drives =
        network.buses.iter().flat_map(|bus| &bus.members).filter(|member| is_drive(member));
    let of = |member: &Member| {
        let name = member.plan.name.clone();
        let reasons = member.abilities.no_group.clone();
        reasons.into_iter().map(move |reason| Obstacle { drive: name.clone(), reason })
    };
    drives.flat_map(of).collect()
}

/// `network` with `changes` done to it, one after the other; `None` where one of them cannot be done or
/// changes nothing.
pub fn changed(network: &Network, changes: &[Change]) -> Option<Network> {
    changes.iter().try_fold(network.clone(), |network, change| {
        let done = match change {
            Change::Grouped => on_every_bus(&network, grouped).filter(|_| may_group(&network)),
            Change::StatesOnChange => on_every_bus(&network, states_on_change),
            Change::SecondBus => split(&network),
            Change::Period(period_us) => Some(Network { period_us: *period_us, ..network.clone() }),
            Change::EmergenciesMoved => Some(emergencies_moved(&network)),
        };
        done.filter(|done| *done != network)
    })
}

fn proposal(network: &Network, changes: &[Change], assumed: &Assumptions) -> Option<Proposal> {
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

/// The shortest usual period above the present one at which the network fits.
fn slower(network: &Network, assumed: &Assumptions) -> Option<u32> {
    let longer = PERIODS_US.into_iter().filter(|period_us| *period_us > network.period_us);
    let fits = |period_us: &u32| {
        changed(network, &[Change::Period(*period_us)]).is_some_and(|slower| slower.fits(assumed))
    };
    longer.into_iter().find(fits)
}

fn may_group(network: &Network) -> bool {
    obstacles(network).is_empty()
}

/// A node that takes a torque.
fn is_drive(member: &Member) -> bool {
    takes_torque(&member.plan)
}

fn takes_torque(plan: &NodePlan) -> bool {
    let services = plan.pdos.iter().filter_map(|pdo| pdo.service.as_ref());
    services.flat_map(|service| &service.mapping).any(|it| it.object == Object::TARGET_TORQUE)
}

fn on_every_bus(network: &Network, change: fn(&[NodePlan]) -> Vec<NodePlan>) -> Option<Network> {
    let mut changed = network.clone();
    for bus in &mut changed.buses {
        let plans: Vec<NodePlan> = bus.members.iter().map(|member| member.plan.clone()).collect();
        for (member, plan) in bus.members.iter_mut().zip(change(&plans)) {
            member.plan = plan;
        }
    }
    Some(changed)
}

/// Every bus with a drive too many, on two.
fn split(network: &Network) -> Option<Network> {
    let mut buses = Vec::new();
    for bus in &network.buses {
        let drives = bus.members.iter().filter(|member| is_drive(member)).count();
        let stay = drives.div_ceil(2);
        let (mut first, mut second) = (bus.clone(), bus.clone());
        first.members.clear();
        second.members.clear();
        let mut placed = 0;
        for member in &bus.members {
            placed += usize::from(is_drive(member));
            let bus = if is_drive(member) && placed <= stay { &mut first } else { &mut second };
            bus.members.push(member.clone());
        }
        second.name = format!("{} 2", bus.name);
        buses.extend([first, second].into_iter().filter(|bus: &Bus| !bus.members.is_empty()));
    }
    Some(Network { buses, ..network.clone() })
}

fn emergencies_moved(network: &Network) -> Network {
    let mut moved = network.clone();
    let members = moved.buses.iter_mut().flat_map(|bus| &mut bus.members);
    for member in members.filter(|member| member.abilities.moves_emergencies) {
        member.plan.emcy_cob_id = EMERGENCIES + u16::from(member.plan.node.raw());
    }
    moved
}

/// The nodes of one bus with torques in groups of [`GROUP`]; whatever is no drive stays as it is.
pub(super) fn grouped(plans: &[NodePlan]) -> Vec<NodePlan> {
    let drives: Vec<&NodePlan> = plans.iter().filter(|plan| takes_torque(plan)).collect();
    let mut changed = plans.to_vec();
    for group in drives.chunks(usize::from(GROUP)) {
        let Some(first) = group.first() else { continue };
        for (place, drive) in group.iter().enumerate() {
            let slot = |at: usize| {
                let dummy = Object { index: INTEGER16, sub: 0 };
                let object = if at == place { Object::TARGET_TORQUE } else { dummy };
                Mapped { object, bits: 16 }
            };
            let torques = (0..group.len()).map(slot).collect();
            let theirs = changed.iter_mut().find(|plan| plan.node == drive.node);
            if let Some(theirs) = theirs {
                let cob_id = 0x200 + u16::from(first.node.raw());
                theirs.pdos = apart(&theirs.pdos, cob_id, torques);
            }
        }
    }
    changed
}

/// The nodes of one bus with states apart from positions and torques.
fn states_on_change(plans: &[NodePlan]) -> Vec<NodePlan> {
    let apart = |plan: &NodePlan| {
        let cob_id = 0x200 + u16::from(plan.node.raw());
        let torque = vec![Mapped { object: Object::TARGET_TORQUE, bits: 16 }];
        NodePlan { pdos: apart(&plan.pdos, cob_id, torque), ..plan.clone() }
    };
    plans.iter().map(|plan| if takes_torque(plan) { apart(plan) } else { plan.clone() }).collect()
}

/// A drive's PDOs with its position and its torque at every SYNC, and its states on change: the
/// statusword no oftener than every 10 ms and no rarer than every 50 ms.
fn apart(pdos: &[Pdo], torque_cob_id: u16, torques: Vec<Mapped>) -> Vec<Pdo> {
    let service = |transmission, mapping| Service {
        transmission,
        inhibit_100us: None,
        event_timer_ms: None,
        mapping,
    };
    let position = vec![Mapped { object: Object::POSITION_ACTUAL, bits: 32 }];
    let status = vec![
        Mapped { object: Object::STATUSWORD, bits: 16 },
        Mapped { object: Object::TORQUE_ACTUAL, bits: 16 },
    ];
    let control = vec![Mapped { object: Object::CONTROLWORD, bits: 16 }];
    let on_event = Transmission::EVENT_OF_PROFILE;
    let changed = |pdo: &Pdo| {
        let (cob_id, service) = match (pdo.direction, pdo.number) {
            (Direction::Transmit, 1) => {
                (pdo.cob_id, service(Transmission::EVERY_SYNC, position.clone()))
            }
            (Direction::Transmit, 2) => {
                let times = (Some(100), Some(50));
                let (inhibit_100us, event_timer_ms) = times;
                let status = service(on_event, status.clone());
                (pdo.cob_id, Service { inhibit_100us, event_timer_ms, ..status })
            }
            (Direction::Receive, 1) => {
                let event_timer_ms = pdo.service.as_ref().and_then(|it| it.event_timer_ms);
                let torques = service(Transmission::EVERY_SYNC, torques.clone());
                (torque_cob_id, Service { event_timer_ms, ..torques })
            }
            (Direction::Receive, 2) => (pdo.cob_id, service(on_event, control.clone())),
            _ => return pdo.clone(),
        };
        Pdo { cob_id, service: Some(service), ..pdo.clone() }
    };
    pdos.iter().map(changed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::load::network::tests::network;
    use crate::canopen::load::network::tests::six_drives_and_switches;

    fn overloaded() -> Network {
        network(six_drives_and_switches(), 1_000)
    }

    fn of(network: &Network) -> Vec<Proposal> {
        proposals(network, &Assumptions::default())
    }

    #[test]
    fn what_does_not_fit_is_told_what_would() {
        let found = of(&overloaded());
        let changes: Vec<_> = found.iter().map(|one| (one.changes.clone(), one.fits)).collect();
        let expected = [
            (vec![Change::Grouped], false),
            (vec![Change::StatesOnChange], false),
            (vec![Change::SecondBus, Change::EmergenciesMoved], true),
            (vec![Change::Period(2_000), Change::EmergenciesMoved], true),
        ];
        assert_eq!(changes, expected);
    }

    #[test]
    fn every_proposal_is_computed() {
        for proposal in of(&overloaded()) {
            let network = changed(&overloaded(), &proposal.changes).unwrap();
            assert_eq!(proposal.loads, network.loads());
            assert_eq!(proposal.fits, network.fits(&Assumptions::default()));
        }
    }

    #[test]
    fn a_drive_that_cannot_share_is_named_and_nothing_is_grouped() {
        let mut network = overloaded();
        network.buses[0].members[2].abilities.no_group = vec![NoGroup::Dummy];
        let [obstacle] = &obstacles(&network)[..] else { panic!("one drive cannot") };
        assert_eq!(obstacle.reason, NoGroup::Dummy);
        assert!(of(&network).iter().all(|one| !one.changes.contains(&Change::Grouped)));
    }

    #[test]
    fn what_fits_is_left_alone_but_for_emergencies_in_front() {
        let slow = network(six_drives_and_switches(), 2_000);
        let found = of(&slow);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].changes, [Change::EmergenciesMoved]);
        let moved = changed(&slow, &[Change::EmergenciesMoved]).unwrap();
        assert_eq!(of(&moved), []);
    }

    #[test]
    fn two_buses_keep_every_node() {
        let two = changed(&overloaded(), &[Change::SecondBus]).unwrap();
        let sizes: Vec<_> = two.buses.iter().map(|bus| bus.members.len()).collect();
        assert_eq!(sizes, [3, 4], "the switch box goes with the wrist");
    }
}
