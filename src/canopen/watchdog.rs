//! Timers by which a drive detects the loss of its master, with the object and time of each.
//!
//! Derived from the plan. The boot shows whether a drive has them; the watchdog test, whether they work.

use std::fmt;

use canopen_rs::Value;
use derive_more::Display;

use crate::layout::Direction;
use crate::master::check::Check;
use crate::object::Object;
use crate::plan::{ErrorControl, NodePlan};
use crate::setting::Setting;

/// Message a drive waits for.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq, Hash)]
pub enum LifeSign {
    /// RPDO with its targets (event timer of an RPDO, CiA 301, 7.5.2.36).
    #[display("RPDOs")]
    Rpdo,
    /// Heartbeat of the master (1016h, CiA 301, 7.5.2.13).
    #[display("heartbeats")]
    Heartbeat,
    /// Remote frames of node guarding (life guarding, CiA 301, 7.2.8.2.2.1).
    #[display("guarding")]
    Guarding,
}

impl LifeSign {
    /// All messages, in the order of the proof test.
    pub const ALL: [Self; 3] = [Self::Rpdo, Self::Heartbeat, Self::Guarding];
}

/// Configured timer of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watchdog {
    /// Message that the drive waits for.
    pub awaited: LifeSign,
    /// Object that holds the time.
    pub object: Object,
    /// Time in ms, at least 1.
    pub millis: u16,
}

/// `RPDO timer 8 ms`
impl fmt::Display for Watchdog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.awaited {
            LifeSign::Rpdo => "RPDO timer",
            LifeSign::Heartbeat => "heartbeat",
            LifeSign::Guarding => "guarding",
        };
        write!(f, "{name} {} ms", self.millis)
    }
}

impl NodePlan {
    /// Planned timer for a message; `None` without one. A guarded node waits for no heartbeat.
    pub fn watchdog(&self, awaited: LifeSign) -> Option<Watchdog> {
        let (object, millis) = match awaited {
            LifeSign::Rpdo => self.rpdo_timer()?,
            LifeSign::Heartbeat => self.master_watch()?,
            LifeSign::Guarding => self.life_guarding()?,
        };
        (millis > 0).then_some(Watchdog { awaited, object, millis })
    }

    /// All planned timers.
    pub fn watchdogs(&self) -> impl Iterator<Item = Watchdog> + '_ {
        LifeSign::ALL.into_iter().filter_map(|awaited| self.watchdog(awaited))
    }

    /// Reactions to errors and limits, as read back in the boot.
    pub fn protections(&self) -> Vec<Check> {
        let timer = self.watchdog(LifeSign::Rpdo).map(|dog| dog.object);
        let is_protection = |object: Object| {
            let safety = self.safety.iter().map(|(object, _)| *object);
            let rest = [Object::ERROR_BEHAVIOUR, Object::GUARD_TIME, Object::LIFE_TIME_FACTOR];
            safety.chain(timer).chain(rest).any(|protection| protection == object)
        };
        let mut checks: Vec<Check> = Vec::new();
        for Setting { check, .. } in self.settings() {
            if is_protection(check.object) {
                // The last value counts.
                checks.retain(|before| before.object != check.object);
                checks.push(check);
            }
        }
        checks
    }

    fn rpdo_timer(&self) -> Option<(Object, u16)> {
        let rpdos = self.pdos.iter().filter(|pdo| pdo.direction == Direction::Receive);
        let mut timers = rpdos.filter_map(|pdo| {
            let millis = pdo.service.as_ref()?.event_timer_ms?;
            Some((pdo.communication(5), millis))
        });
        timers.next()
    }

    fn life_guarding(&self) -> Option<(Object, u16)> {
        let ErrorControl::Guarding(guarding) = self.error_control else { return None };
        let millis = u16::try_from(guarding.life_time().as_millis()).unwrap_or(u16::MAX);
        Some((Object::LIFE_TIME_FACTOR, millis))
    }

    fn master_watch(&self) -> Option<(Object, u16)> {
        let is_it = |(object, _): &&(Object, Value)| *object == Object::CONSUMER_HEARTBEAT;
        match self.safety.iter().find(is_it)? {
            (object, Value::Unsigned32(raw)) => {
                Some((*object, u16::try_from(raw & 0xFFFF).unwrap_or(u16::MAX)))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::{elbow, guarded_elbow, switch_box};

    #[test]
    fn guarded_drive_waits_for_rpdos_and_guarding() {
        let timers = |plan: NodePlan| {
            LifeSign::ALL.map(|awaited| plan.watchdog(awaited).map(|dog| (dog.object, dog.millis)))
        };
        let rpdo = Some((Object::rpdo_communication(1, 5), 5));
        let guarding = Some((Object::LIFE_TIME_FACTOR, 30));
        assert_eq!(timers(elbow()), [rpdo, Some((Object::CONSUMER_HEARTBEAT, 22)), None]);
        assert_eq!(timers(guarded_elbow()), [rpdo, None, guarding]);
        assert_eq!(timers(switch_box()), [None; 3]);
    }

    #[test]
    fn protections_are_timers_stop_options_and_limits() {
        let objects = |plan: NodePlan| -> Vec<String> {
            plan.protections().iter().map(|check| check.object.to_string()).collect()
        };
        let of_all = ["6007h", "605Ah", "605Bh", "605Ch", "605Dh", "605Eh", "6072h"];
        let elbow = objects(elbow().no_faster_than(3_000));
        let rest = ["1400h:5", "1016h:1", "1029h:1", "6080h", "60B0h", "60B1h", "60B2h"];
        for object in of_all.iter().chain(&rest) {
            assert!(elbow.iter().any(|protection| protection == object), "{object}: {elbow:?}");
        }
        assert_eq!(elbow.len(), 14);
        let guarded = objects(guarded_elbow());
        for object in of_all.iter().chain(&["1400h:5", "1029h:1", "100Ch", "100Dh"]) {
            assert!(guarded.iter().any(|protection| protection == object), "{object}");
        }
    }

    #[test]
    fn timer_of_zero_is_disabled() {
        let mut plan = elbow();
        for service in plan.pdos.iter_mut().filter_map(|pdo| pdo.service.as_mut()) {
            service.event_timer_ms = service.event_timer_ms.map(|_| 0);
        }
        assert_eq!(plan.watchdog(LifeSign::Rpdo), None);
    }
}
