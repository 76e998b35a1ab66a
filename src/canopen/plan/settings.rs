//! Settings that a plan demands of its node, in the order of their writes.

use canopen_rs::Value;

use crate::emcy;
use crate::guarding::Guarding;
use crate::layout::Direction;
use crate::master::check::{COB_ID_INVALID, Check};
use crate::master::configuration::Stamp;
use crate::object::Object;
use crate::plan::{ErrorControl, NodePlan, ShownMode};
use crate::setting::{Need, OFFSETS, Setting};

/// Maps an integer by `of`, in the same data type. Returns `None` for other types, or if the result does not fit.
pub fn mapped(value: &Value, of: impl Fn(i64) -> Option<i64>) -> Option<Value> {
    Some(match *value {
        Value::Integer8(full) => Value::Integer8(of(full.into())?.try_into().ok()?),
        Value::Integer16(full) => Value::Integer16(of(full.into())?.try_into().ok()?),
        Value::Integer32(full) => Value::Integer32(of(full.into())?.try_into().ok()?),
        Value::Integer64(full) => Value::Integer64(of(full)?),
        Value::Unsigned8(full) => Value::Unsigned8(of(full.into())?.try_into().ok()?),
        Value::Unsigned16(full) => Value::Unsigned16(of(full.into())?.try_into().ok()?),
        Value::Unsigned32(full) => Value::Unsigned32(of(full.into())?.try_into().ok()?),
        Value::Unsigned64(full) => Value::Unsigned64(of(full.try_into().ok()?)?.try_into().ok()?),
        Value::Boolean(_)
        | Value::Real32(_)
        | Value::Real64(_)
        | Value::VisibleString(_)
        | Value::OctetString(_)
        | Value::Domain(_)
        | _ => return None,
    })
}

impl NodePlan {
    /// Objects that must be writable for the plan to succeed, those of PDOs excepted: [`lacks`](crate::load::lacks) checks
    /// these.
    pub fn demands(&self) -> impl Iterator<Item = Object> + '_ {
        let first = self.first_writes.iter().map(|(object, _)| *object);
        let safety = self.safety.iter().map(|(object, _)| *object);
        let safety = safety.filter(|object| !OFFSETS.contains(object));
        let mode = self.mode.map(|_| Object::MODE_OF_OPERATION);
        let watch = self.watch_settings();
        let watch = watch.into_iter().filter(|setting| setting.need.is_must());
        let watch = watch.map(|setting| setting.check.object);
        first.chain(safety).chain(mode).chain(watch)
    }

    /// Returns the settings in the order of their writes: those that the configuration adds, PDOs, emergencies,
    /// reactions and limits, error control. The mode is a command, not a setting.
    pub fn settings(&self) -> Vec<Setting> {
        let first = self.first_writes.iter();
        let mut settings: Vec<_> =
            first.map(|(object, value)| Setting::must(*object, *value)).collect();
        for pdo in &self.pdos {
            for (object, value) in pdo.writes() {
                let is_cob_id = object == pdo.communication(1);
                let check = if is_cob_id { Check::cob_id } else { Check::exactly };
                // The timer is optional here. Whether torques may be sent without it is decided before enabling.
                let is_timer =
                    pdo.direction == Direction::Receive && object == pdo.communication(5);
                let need = match (is_timer, &pdo.service) {
                    (true, _) => Need::IfAccepted,
                    (false, None) => Need::IfPresent,
                    (false, Some(_)) => Need::Must,
                };
                settings.push(Setting { check: check(object, value), need });
            }
        }
        if self.emcy_cob_id != emcy::default_cob_id(self.node) {
            let valid = u32::from(self.emcy_cob_id);
            for raw in [COB_ID_INVALID | valid, valid] {
                let check = Check::cob_id(Object::EMCY_COB_ID, Value::Unsigned32(raw));
                settings.push(Setting { check, need: Need::Must });
            }
        }
        settings.extend(self.error_behaviour.map(|behaviour| Setting {
            check: Check::exactly(Object::ERROR_BEHAVIOUR, Value::Unsigned8(behaviour)),
            need: Need::for_object(Object::ERROR_BEHAVIOUR),
        }));
        settings.extend(self.safety.iter().map(|(object, value)| Setting {
            check: Check::exactly(*object, *value),
            need: Need::for_object(*object),
        }));
        settings.extend(self.watch_settings());
        settings
    }

    /// Torque limits that replace the reduced ones once the mode is seen. They are among the settings.
    pub fn limits_to_raise(&self) -> Vec<Setting> {
        let ShownMode::WhenEnabled { reduced_limits } = &self.shown_mode else { return Vec::new() };
        self.planned(reduced_limits)
    }

    /// Torque limits that replace the reduced ones after a homing. They are among the settings.
    pub fn limits_after_homing(&self) -> Vec<Setting> {
        self.homing.as_ref().map(|homing| self.planned(&homing.reduced_limits)).unwrap_or_default()
    }

    /// Torque limits at a share of the planned ones, in ‰, rounded down; empty if no object limits the torque.
    pub fn limits_at(&self, share: u16) -> Vec<(Object, Value)> {
        let limits = self.safety.iter().filter(|(object, _)| self.torque_limits.contains(object));
        let at = |full: i64| full.checked_mul(share.into()).map(|scaled| scaled / 1_000);
        limits.filter_map(|(object, value)| Some((*object, mapped(value, at)?))).collect()
    }

    /// Settings of the objects that `reduced_limits` reduces.
    fn planned(&self, reduced_limits: &[(Object, Value)]) -> Vec<Setting> {
        let is_reduced = |setting: &Setting| {
            reduced_limits.iter().any(|(object, _)| *object == setting.check.object)
        };
        self.settings().into_iter().filter(is_reduced).collect()
    }

    /// Settings as bare writes.
    pub fn writes(&self) -> Vec<(Object, Value)> {
        let settings = self.settings().into_iter();
        settings.map(|Setting { check, .. }| (check.object, check.expected)).collect()
    }

    /// Stamp that 1020h contains once all settings are stored.
    pub fn stamp(&self) -> Stamp {
        Stamp::from_writes(&self.writes())
    }

    /// Settings of the error control service. A guarded node sends no heartbeat, which would take precedence.
    fn watch_settings(&self) -> Vec<Setting> {
        match self.error_control {
            ErrorControl::Heartbeat { period_ms, .. } => {
                vec![Setting::must(Object::PRODUCER_HEARTBEAT, Value::Unsigned16(period_ms))]
            }
            ErrorControl::Guarding(Guarding { guard_time_ms, life_time_factor }) => {
                let none = Check::exactly(Object::PRODUCER_HEARTBEAT, Value::Unsigned16(0));
                vec![
                    Setting { check: none, need: Need::IfPresent },
                    Setting::must(Object::GUARD_TIME, Value::Unsigned16(guard_time_ms)),
                    Setting::must(Object::LIFE_TIME_FACTOR, Value::Unsigned8(life_time_factor)),
                ]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plans::{elbow, guarded_elbow};

    #[test]
    fn moved_emcy_cob_id_is_disabled_first() {
        let moved = |plan: &NodePlan| -> Vec<Value> {
            let writes = plan.writes().into_iter();
            writes.filter(|(object, _)| *object == Object::EMCY_COB_ID).map(|(_, v)| v).collect()
        };
        let mut plan = elbow();
        assert_eq!(moved(&plan), []);
        plan.emcy_cob_id = 0x683;
        assert_eq!(moved(&plan), [Value::Unsigned32(0x8000_0683), Value::Unsigned32(0x0000_0683)]);
    }

    #[test]
    fn guarded_node_produces_and_consumes_no_heartbeat() {
        let writes = guarded_elbow().writes();
        let of = |object| writes.iter().find(|(o, _)| *o == object).map(|(_, value)| *value);
        assert_eq!(of(Object::CONSUMER_HEARTBEAT), None);
        assert_eq!(of(Object::PRODUCER_HEARTBEAT), Some(Value::Unsigned16(0)));
        assert_eq!(of(Object::GUARD_TIME), Some(Value::Unsigned16(10)));
        assert_eq!(of(Object::LIFE_TIME_FACTOR), Some(Value::Unsigned8(3)));
        assert!(guarded_elbow().demands().all(|o| o != Object::PRODUCER_HEARTBEAT));
    }
}
