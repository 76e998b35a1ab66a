//! `[joint.boot]`, `[switches.boot]`: identity, boot and error control of a node, where they differ from the defaults.

use std::time::Duration;

use crate::boot_writes;
use crate::drive_object::ObjectWrite;
use crate::problem::Problems;
use crate::section::Sections;
use crate::torque_limit::TorqueLimit;
use crate::value::HasPlace;
use crate::{raw, shown_mode};
use canopen::ByteString;
use canopen::eds::Eds;
use canopen::guarding::Guarding;
use canopen::plan::{Admission, NodePlan, Revisions, Timeouts};

/// Boot of one node (CiA 302-2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BootSettings {
    /// Accepted revisions, serial number and software, besides vendor and product.
    pub admission: Admission,
    /// Node guarding; `None` for a node with a heartbeat.
    pub guarding: Option<Guarding>,
    /// Lets the network start without the node.
    pub is_optional: bool,
    /// Keeps the node running, without a reset, if it is already configured (CiA 302-2, keep alive).
    pub keep_alive: bool,
    /// Time limits of one SDO reply, and of the node to become ready.
    pub timeouts: Timeouts,
    /// Set if the drive displays its mode (6061h) only while it is enabled.
    pub shows_mode_when_enabled: bool,
    /// SDO downloads that precede those of the plan: `[[joint.boot.write]]`.
    pub writes: Vec<ObjectWrite>,
}

/// Values of other sections that the boot settings of a node depend on.
#[derive(Clone, Copy, Debug)]
pub(super) struct OtherSections<'a> {
    /// `safety.drive_lost_ms`.
    pub(super) lost_ms: Option<u16>,
    /// EDS of the node; `None` if it could not be read.
    pub(super) eds: Option<&'a Eds>,
    /// Communication cycle period (1006h).
    pub(super) period: Option<Duration>,
    /// Torque limit of the drive in place of 6072h.
    pub(super) limit: Option<&'a TorqueLimit>,
}

impl BootSettings {
    /// Returns `plan` with these settings.
    pub(super) fn apply(&self, plan: NodePlan) -> NodePlan {
        let plan = match self.guarding {
            Some(guarding) => plan.guarded(guarding),
            None => plan,
        };
        NodePlan {
            admission: self.admission.clone(),
            is_optional: self.is_optional,
            keep_alive: self.keep_alive,
            timeouts: self.timeouts,
            first_writes: self.writes.clone(),
            ..plan
        }
    }
}

/// Reads the boot settings of a drive. A drive exerts torque, so it must be mandatory and always reset.
pub(super) fn of_drive(
    raw: Option<&raw::Boot>,
    given: OtherSections<'_>,
    problems: &mut Problems<'_>,
) -> BootSettings {
    let settings = of_node(raw, given, problems);
    let Some(raw) = raw else { return settings };
    let OtherSections { limit, eds, period, .. } = given;
    let drive = shown_mode::Drive { limit, eds, period };
    let shows_mode_when_enabled = shown_mode::read(raw, drive, problems);
    if settings.is_optional {
        problems.add(&raw.optional, "an arm has all its joints");
    }
    if settings.keep_alive {
        problems.add(&raw.keep_alive, "what can push always begins anew");
    }
    BootSettings { shows_mode_when_enabled, ..settings }
}

/// Reads the boot settings of a node. Its node life time (100Ch times 100Dh) must not exceed `lost_ms`.
pub(super) fn of_node(
    raw: Option<&raw::Boot>,
    given: OtherSections<'_>,
    problems: &mut Problems<'_>,
) -> BootSettings {
    let Some(raw) = raw else { return BootSettings::default() };
    let policies = [("exact", Revisions::Exact), ("compatible", Revisions::Compatible)];
    let policy = raw.revisions.or("exact".to_owned());
    let revisions = problems.one_of(&policy, &policies).unwrap_or_default();
    let software = raw.software_version.as_ref().and_then(|version| {
        let text = ByteString::from_bytes(version.as_bytes());
        let text = text.map_err(|_| format!("\"{version}\" is longer than 32 bytes"));
        problems.take(&raw.software_version, text)
    });
    let (serial, program) = (raw.serial.get(), raw.program_id.get());
    BootSettings {
        admission: Admission { revisions, serial, software, program },
        guarding: guarding(raw, given.lost_ms, problems),
        is_optional: raw.optional.get().unwrap_or_default(),
        keep_alive: raw.keep_alive.get().unwrap_or_default(),
        timeouts: timeouts(raw, problems),
        shows_mode_when_enabled: false,
        writes: boot_writes::read(
            raw.write.as_ref().map(Sections::all).unwrap_or_default(),
            given.eds,
            given.limit.map(TorqueLimit::writes).unwrap_or_default(),
            problems,
        ),
    }
}

/// Reads the time limits of the boot.
fn timeouts(raw: &raw::Boot, problems: &mut Problems<'_>) -> Timeouts {
    let usual = Timeouts::default();
    let millis = |millis: u32| Duration::from_millis(u64::from(millis));
    let reply = problems.within(&raw.reply_ms, 10..=10_000).map_or(usual.reply, millis);
    let boot = problems.within(&raw.boot_ms, 100..=60_000).map_or(usual.boot, millis);
    Timeouts { reply, boot }
}

/// Reads node guarding, which needs both keys or neither.
fn guarding(
    raw: &raw::Boot,
    lost_ms: Option<u16>,
    problems: &mut Problems<'_>,
) -> Option<Guarding> {
    let (time, factor) = (&raw.guard_time_ms, &raw.life_time_factor);
    if time.get().is_some() && factor.is_absent() {
        problems.add(time, format_args!("needs a {} beside it", factor.place().name()));
    }
    if factor.get().is_some() && time.is_absent() {
        problems.add(factor, format_args!("needs a {} beside it", time.place().name()));
    }
    let (guard_time_ms, life_time_factor) = time.get().zip(factor.get())?;
    problems.within(time, 1..=10_000);
    problems.within(factor, 2..=u8::MAX);
    let life_time = u32::from(guard_time_ms) * u32::from(life_time_factor);
    if lost_ms.is_some_and(|lost_ms| life_time > u32::from(lost_ms)) {
        let reason = format!("{life_time} ms in all: more than safety.drive_lost_ms");
        problems.add(factor, reason);
    }
    Some(Guarding { guard_time_ms, life_time_factor })
}
