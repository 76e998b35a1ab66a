//! Writes a fault as the `[[fault]]` entry that [`entry`](super::entry) reads.

use std::time::Duration;

use serde::{Serialize, Serializer};
use toml::Value;

use crate::scenario::entry::DISTURBANCES;
use canopen::frame::{Channel, Frame};
use faults::{
    ContactFault, DeviceFault, Disconnection, Disturbance, Effect, Extent, Fault, FrameFault,
    HostFault, Kind, LinkFault, Selection, SensorFault, Target,
};

/// A fault as a table of TOML, its keys in the order in which people write them.
#[derive(Debug)]
pub(super) struct FaultEntry<'a>(pub(super) &'a Fault);

impl Serialize for FaultEntry<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(keys(self.0))
    }
}

fn keys(fault: &Fault) -> Vec<(&'static str, Value)> {
    let mut keys = vec![("at_s", seconds(fault.start).into())];
    let (kind, its) = kind_and_keys(&fault.kind);
    keys.push(("kind", kind.into()));
    match fault.target {
        Target::Joint(joint) => keys.push(("joint", i64::from(joint.number()).into())),
        Target::Drives => keys.push(("joint", "all".into())),
        Target::SwitchBox if !matches!(fault.kind, Kind::Contact(..)) => {
            keys.push(("device", "switches".into()));
        }
        Target::Bus(Channel(bus)) => keys.push(("bus", i64::from(bus).into())),
        Target::SwitchBox | Target::Link | Target::Host => {}
    }
    keys.extend(its);
    keys.extend(fault.duration.map(|duration| ("for_s", seconds(duration).into())));
    keys
}

fn kind_and_keys(kind: &Kind) -> (&'static str, Vec<(&'static str, Value)>) {
    match kind {
        Kind::Disconnection(how) => {
            let word = match how {
                Disconnection::Unplugged => "unplug",
                Disconnection::WireCut => "wire_cut",
                Disconnection::BusOff => "bus_off",
            };
            (word, Vec::new())
        }
        Kind::Frames(fault) => written_frames(fault),
        Kind::Imitation { by, service } => {
            let by = i64::from(by.number());
            ("impersonate", vec![("by", by.into()), ("frame", service.to_string().into())])
        }
        Kind::Device(DeviceFault::Reboot) => ("reset", Vec::new()),
        Kind::Device(DeviceFault::Emergency { code, register }) => {
            let (code, register) = (i64::from(*code), i64::from(*register));
            ("emergency", vec![("code", code.into()), ("register", register.into())])
        }
        Kind::Device(DeviceFault::DriveFault(code)) => {
            ("fault", vec![("code", i64::from(*code).into())])
        }
        Kind::Device(DeviceFault::SafeTorqueOff) => ("sto", Vec::new()),
        Kind::Device(DeviceFault::ControlwordIgnored) => ("controlword_ignored", Vec::new()),
        Kind::Device(DeviceFault::TorqueOffset(per_mille)) => {
            ("torque_offset", vec![("per_mille", i64::from(*per_mille).into())])
        }
        Kind::Sensor(SensorFault::PositionOffset(by)) => {
            ("encoder_jump", vec![("by_rad", (*by).into())])
        }
        Kind::Sensor(SensorFault::PositionFrozen) => ("encoder_frozen", Vec::new()),
        Kind::Sensor(SensorFault::TorqueScaled(factor)) => {
            ("torque_actual_scale", vec![("scale", (*factor).into())])
        }
        Kind::Contact(input, fault) => {
            let switch = ("switch", input.to_string().into());
            match fault {
                ContactFault::StuckHigh => ("switch_stuck", vec![switch, ("level", "high".into())]),
                ContactFault::StuckLow => ("switch_stuck", vec![switch, ("level", "low".into())]),
                ContactFault::Bouncing => ("switch_bounce", vec![switch]),
            }
        }
        Kind::ForeignFrame { frame, period } => {
            let mut keys = written_frame(frame);
            keys.extend(period.map(|period| ("every_ms", millis(period).into())));
            ("foreign_frame", keys)
        }
        Kind::Link(LinkFault::Lost) => ("link_loss", Vec::new()),
        Kind::Link(LinkFault::Frozen) => ("link_frozen", Vec::new()),
        Kind::SensedForce(force) => ("sensed_force", vec![("force_n", (*force).into())]),
        Kind::Bus(Disturbance::Flood(frame)) => ("flood", written_frame(frame)),
        Kind::Bus(disturbance) => {
            let named = DISTURBANCES.iter().find(|(_, one)| one == disturbance);
            (named.map_or("", |(word, _)| word), Vec::new())
        }
        Kind::Host(HostFault::ProcessStopped) => ("process_stopped", Vec::new()),
        Kind::Host(HostFault::ProcessStoppedAfter(cob_id)) => {
            ("process_stopped", vec![("cob_id", i64::from(*cob_id).into())])
        }
        Kind::Host(HostFault::Suspended) => ("host_suspended", Vec::new()),
        Kind::Host(HostFault::ClockSet(wall)) => {
            ("clock_set", vec![("wall_s", seconds(*wall).into())])
        }
    }
}

fn written_frames(fault: &FrameFault) -> (&'static str, Vec<(&'static str, Value)>) {
    let FrameFault { selection, effect, extent } = *fault;
    let mut keys: Vec<(&'static str, Value)> = match selection {
        Selection::All => Vec::new(),
        Selection::Service(service) => vec![("frame", service.to_string().into())],
        Selection::CobId(cob_id) => vec![("cob_id", i64::from(cob_id).into())],
    };
    let word = match effect {
        Effect::Drop => "drop",
        Effect::Duplicate => "duplicate",
        Effect::Delay { by, reorders } => {
            keys.push(("delay_ms", millis(by).into()));
            keys.extend(reorders.then(|| ("reorder", true.into())));
            "delay"
        }
        Effect::Corrupt(mask) => {
            keys.push(("xor", digits(&mask).into()));
            "corrupt"
        }
        Effect::Freeze => "freeze",
        Effect::Resize(bytes) => {
            keys.push(("bytes", i64::from(bytes).into()));
            "resize"
        }
    };
    match extent {
        Extent::Always => {}
        Extent::Share(share) => keys.push(("share", share.into())),
        Extent::First(count) => keys.push(("count", i64::from(count).into())),
    }
    (word, keys)
}

fn written_frame(frame: &Frame) -> Vec<(&'static str, Value)> {
    let cob_id = i64::from(frame.cob_id);
    vec![("cob_id", cob_id.into()), ("payload", digits(frame.data()).into())]
}

fn digits(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// Returns the shortest number that is read as this duration, in s.
fn seconds(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e9).round() / 1e9
}

fn millis(duration: Duration) -> f64 {
    (duration.as_secs_f64() * 1e9).round() / 1e6
}
