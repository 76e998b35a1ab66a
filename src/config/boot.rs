//! `[joint.boot]`, `[switches.boot]`: what more a node must be, and how it is booted and watched, where
//! that is not as usual.

use crate::problem::Problems;
use crate::raw;
use canopen::ByteString;
use canopen::guarding::Guarding;
use canopen::plan::Admission;
use canopen::plan::NodePlan;
use canopen::plan::Revisions;

/// How one node is booted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BootSettings {
    /// What more it must say.
    pub admission: Admission,
    /// How it is guarded; `None` for a node with a heartbeat.
    pub guarding: Option<Guarding>,
    /// Whether the others start without it.
    pub is_optional: bool,
    /// Whether it is left alone where it runs as planned.
    pub keep_alive: bool,
}

impl BootSettings {
    /// `plan` with all of this.
    pub(super) fn apply(&self, plan: NodePlan) -> NodePlan {
        let plan = match self.guarding {
            Some(guarding) => plan.guarded(guarding),
            None => plan,
        };
        NodePlan {
            admission: self.admission.clone(),
            is_optional: self.is_optional,
            keep_alive: self.keep_alive,
            ..plan
        }
    }
}

/// Of a joint's drive, which must be there and always begins anew: it can push.
pub(super) fn of_drive(
    section: &str,
    raw: Option<&raw::Boot>,
    lost_ms: u16,
    problems: &mut Problems<'_>,
) -> BootSettings {
    let settings = of_node(section, raw, lost_ms, problems);
    if settings.is_optional {
        problems.add(&format!("{section}.optional"), "an arm has all its joints");
    }
    if settings.keep_alive {
        problems.add(&format!("{section}.keep_alive"), "what can push always begins anew");
    }
    settings
}

/// Of any node; one that is guarded must not be missed longer than `lost_ms`.
pub(super) fn of_node(
    section: &str,
    raw: Option<&raw::Boot>,
    lost_ms: u16,
    problems: &mut Problems<'_>,
) -> BootSettings {
    let Some(raw) = raw else { return BootSettings::default() };
    let key = |name: &str| format!("{section}.{name}");
    let policies = [("exact", Revisions::Exact), ("compatible", Revisions::Compatible)];
    let policy = raw.revisions.as_deref().unwrap_or("exact");
    let revisions = problems.one_of(&key("revisions"), policy, &policies).unwrap_or_default();
    let software = raw.software_version.as_deref().and_then(|version| {
        let text = ByteString::from_bytes(version.as_bytes());
        let text = text.map_err(|_| format!("\"{version}\" is longer than 32 bytes"));
        problems.take(&key("software_version"), text)
    });
    let admission = Admission { revisions, serial: raw.serial, software, program: raw.program_id };
    BootSettings {
        admission,
        guarding: guarding(&key, raw, lost_ms, problems),
        is_optional: raw.optional,
        keep_alive: raw.keep_alive,
    }
}

/// Both numbers or neither.
fn guarding(
    key: &dyn Fn(&str) -> String,
    raw: &raw::Boot,
    lost_ms: u16,
    problems: &mut Problems<'_>,
) -> Option<Guarding> {
    let (guard_time_ms, life_time_factor) = match (raw.guard_time_ms, raw.life_time_factor) {
        (None, None) => return None,
        (Some(guard_time), Some(factor)) => (guard_time, factor),
        (Some(_), None) => {
            problems.add(&key("guard_time_ms"), "needs a life_time_factor beside it");
            return None;
        }
        (None, Some(_)) => {
            problems.add(&key("life_time_factor"), "needs a guard_time_ms beside it");
            return None;
        }
    };
    problems.within(&key("guard_time_ms"), guard_time_ms, 1..=10_000);
    problems.within(&key("life_time_factor"), life_time_factor, 2..=u8::MAX);
    let life_time = u32::from(guard_time_ms) * u32::from(life_time_factor);
    if life_time > u32::from(lost_ms) {
        let reason = format!("{life_time} ms in all: more than safety.drive_lost_ms");
        problems.add(&key("life_time_factor"), reason);
    }
    Some(Guarding { guard_time_ms, life_time_factor })
}
