//! The same network with something done differently: the layouts and moves that
//! [`proposals`](crate::canopen::load::proposals) weighs, and that one may ask for.

use std::fmt;

use crate::canopen::layout;
use crate::canopen::layout::Direction;
use crate::canopen::layout::Mapped;
use crate::canopen::layout::Pdo;
use crate::canopen::layout::Service;
use crate::canopen::load::abilities::GROUP;
use crate::canopen::load::abilities::INTEGER16;
use crate::canopen::load::abilities::NoGroup;
use crate::canopen::load::network::Bus;
use crate::canopen::load::network::Member;
use crate::canopen::load::network::Network;
use crate::canopen::object::Object;
use crate::canopen::plan::NodePlan;
use crate::canopen::sync::Transmission;

/// Emergencies moved behind everything of a cycle: free for use in CiA 301 (7.3.5), above the SDO's
/// and below the heartbeats' identifiers.
const EMERGENCIES: u16 = 0x680;

/// A heartbeat that suffices where a drive also watches its RPDO, in ms.
const SLOW_HEARTBEAT_MS: u16 = 100;

/// One thing done differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// One RPDO and one TPDO a drive, both at every SYNC.
    PerDrive,
    /// Three drives listen to one torque RPDO; states go on change.
    Grouped,
    /// Statusword and controlword go on change, each in a PDO of its own.
    StatesOnChange,
    /// Half of a bus's drives move to another one.
    SecondBus,
    /// SYNC comes every so many µs.
    Period(u32),
    /// Nodes that watch their RPDO, or nothing, send their heartbeat every 100 ms.
    SlowHeartbeats,
    /// Emergencies have identifiers behind the cycle's.
    EmergenciesMoved,
}

/// In words.
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PerDrive => f.write_str("one RPDO and one TPDO a drive"),
            Self::Grouped => f.write_str("three torques in one RPDO"),
            Self::StatesOnChange => f.write_str("statusword and controlword on change"),
            Self::SecondBus => f.write_str("a second bus for half of the drives"),
            Self::Period(period_us) => {
                write!(f, "{:.0} Hz", 1e6 / f64::from((*period_us).max(1)))
            }
            Self::SlowHeartbeats => {
                write!(f, "the nodes' heartbeats every {SLOW_HEARTBEAT_MS} ms")
            }
            Self::EmergenciesMoved => write!(f, "emergencies at {EMERGENCIES:X}h + node"),
        }
    }
}

/// A drive that cannot do what would help.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Obstacle {
    /// Its name.
    pub drive: String,
    /// Why it cannot listen to a shared RPDO.
    pub reason: NoGroup,
}

/// `network` with `changes` done to it, one after the other; `None` where one of them cannot be done or
/// changes nothing.
pub fn changed(network: &Network, changes: &[Change]) -> Option<Network> {
    changes.iter().try_fold(network.clone(), |network, change| {
        let done = match change {
            Change::PerDrive => Some(on_every_bus(&network, per_drive)),
            Change::Grouped => {
                obstacles(&network).is_empty().then(|| on_every_bus(&network, grouped))
            }
            Change::StatesOnChange => Some(on_every_bus(&network, states_on_change)),
            Change::SecondBus => Some(split(&network)),
            Change::Period(period_us) => Some(Network { period_us: *period_us, ..network.clone() }),
            Change::SlowHeartbeats => Some(on_every_bus(&network, slow_heartbeats)),
            Change::EmergenciesMoved => Some(emergencies_moved(&network)),
        };
        done.filter(|done| *done != network)
    })
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

/// A node that takes a torque.
fn is_drive(member: &Member) -> bool {
    takes_torque(&member.plan)
}

fn takes_torque(plan: &NodePlan) -> bool {
    let services = plan.pdos.iter().filter_map(|pdo| pdo.service.as_ref());
    services.flat_map(|service| &service.mapping).any(|it| it.object == Object::TARGET_TORQUE)
}

fn on_every_bus(network: &Network, change: fn(&[NodePlan]) -> Vec<NodePlan>) -> Network {
    let mut changed = network.clone();
    for bus in &mut changed.buses {
        let plans: Vec<NodePlan> = bus.members.iter().map(|member| member.plan.clone()).collect();
        for (member, plan) in bus.members.iter_mut().zip(change(&plans)) {
            member.plan = plan;
        }
    }
    changed
}

/// Every bus as two, the first half of its drives on one and everything else on the other.
fn split(network: &Network) -> Network {
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
    Network { buses, ..network.clone() }
}

fn emergencies_moved(network: &Network) -> Network {
    let mut moved = network.clone();
    let members = moved.buses.iter_mut().flat_map(|bus| &mut bus.members);
    for member in members.filter(|member| member.abilities.moves_emergencies) {
        member.plan.emcy_cob_id = EMERGENCIES + u16::from(member.plan.node.raw());
    }
    moved
}

/// Each drive's RPDO timer guards the torque, so the heartbeat is only for the rest of the node. How many
/// may be missed stays as it is.
fn slow_heartbeats(plans: &[NodePlan]) -> Vec<NodePlan> {
    let slow = |plan: &NodePlan| {
        let is_guarded = !takes_torque(plan) || rpdo_timer_ms(plan).is_some();
        if !is_guarded || plan.heartbeat_ms == 0 || plan.heartbeat_ms >= SLOW_HEARTBEAT_MS {
            return plan.clone();
        }
        let lost_after = plan.lost_after * u32::from(SLOW_HEARTBEAT_MS) / plan.heartbeat_ms.into();
        NodePlan { heartbeat_ms: SLOW_HEARTBEAT_MS, lost_after, ..plan.clone() }
    };
    plans.iter().map(slow).collect()
}

/// How long a drive waits for its first RPDO, if it has such a timer.
fn rpdo_timer_ms(plan: &NodePlan) -> Option<u16> {
    let mut rpdos = plan.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
    rpdos.find_map(|pdo| pdo.service.as_ref()?.event_timer_ms)
}

/// The nodes of one bus, each drive with a pair of PDOs of its own.
fn per_drive(plans: &[NodePlan]) -> Vec<NodePlan> {
    let paired = |plan: &NodePlan| NodePlan {
        pdos: layout::per_drive(plan.node, rpdo_timer_ms(plan)),
        ..plan.clone()
    };
    plans.iter().map(|plan| if takes_torque(plan) { paired(plan) } else { plan.clone() }).collect()
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

    fn plans(network: &Network) -> Vec<&NodePlan> {
        network.buses.iter().flat_map(|bus| &bus.members).map(|member| &member.plan).collect()
    }

    #[test]
    fn a_drive_that_cannot_share_is_named_and_nothing_is_grouped() {
        let mut network = overloaded();
        network.buses[0].members[2].abilities.no_group = vec![NoGroup::Dummy];
        let [obstacle] = &obstacles(&network)[..] else { panic!("one drive cannot") };
        assert_eq!(obstacle.reason, NoGroup::Dummy);
        assert_eq!(changed(&network, &[Change::Grouped]), None);
    }

    #[test]
    fn two_buses_keep_every_node() {
        let two = changed(&overloaded(), &[Change::SecondBus]).unwrap();
        let sizes: Vec<_> = two.buses.iter().map(|bus| bus.members.len()).collect();
        assert_eq!(sizes, [3, 4], "the switch box goes with the wrist");
        let nodes = |network| plans(network).iter().map(|plan| plan.node).collect::<Vec<_>>();
        assert_eq!(nodes(&two), nodes(&overloaded()));
    }

    #[test]
    fn a_pair_of_pdos_a_drive_is_where_one_came_from() {
        let there = changed(&overloaded(), &[Change::Grouped]).unwrap();
        assert_eq!(changed(&there, &[Change::PerDrive]), Some(overloaded()));
        assert_eq!(changed(&overloaded(), &[Change::PerDrive]), None, "nothing to change");
    }

    #[test]
    fn every_slot_of_a_group_is_one_drives_and_a_dummy_for_the_others() {
        let grouped = changed(&overloaded(), &[Change::Grouped]).unwrap();
        for (place, plan) in plans(&grouped).into_iter().take(6).enumerate() {
            let rpdo = plan.pdos.iter().find(|pdo| pdo.direction == Direction::Receive).unwrap();
            assert_eq!(rpdo.cob_id, if place < 3 { 0x201 } else { 0x204 });
            let service = rpdo.service.as_ref().unwrap();
            let own = service.mapping.iter().map(|slot| slot.object == Object::TARGET_TORQUE);
            let expected = (0..3).map(|slot| slot == place % 3);
            assert!(own.eq(expected));
            assert_eq!((service.bytes(), service.event_timer_ms), (6, Some(5)));
        }
    }

    #[test]
    fn a_drive_without_an_rpdo_timer_keeps_its_quick_heartbeat() {
        let mut network = overloaded();
        let pdos = &mut network.buses[0].members[0].plan.pdos;
        pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()).for_each(|service| {
            service.event_timer_ms = None;
        });
        let slow = changed(&network, &[Change::SlowHeartbeats]).unwrap();
        let periods: Vec<_> = plans(&slow).iter().map(|plan| plan.heartbeat_ms).collect();
        assert_eq!(periods, [25, 100, 100, 100, 100, 100, 100]);
        assert_eq!(plans(&slow)[1].lost_after.as_millis(), 240);
    }

    #[test]
    fn emergencies_move_where_they_may() {
        let mut network = overloaded();
        network.buses[0].members[0].abilities.moves_emergencies = false;
        let moved = changed(&network, &[Change::EmergenciesMoved]).unwrap();
        let ids: Vec<_> = plans(&moved).iter().map(|plan| plan.emcy_cob_id).collect();
        assert_eq!(ids, [0x81, 0x682, 0x683, 0x684, 0x685, 0x686, 0x690]);
    }
}
