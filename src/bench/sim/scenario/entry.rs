//! `[[fault]]` entry, read and written: `at_s`, `kind`, the keys of its kind, `for_s`.

use std::time::Duration;

use serde::{Serialize, Serializer};
use toml::Spanned;

use crate::scenario::fault_table::{self, seconds};
use crate::scenario::keys::{Entry, KeyList, Keys};
use crate::scenario::problem::{LocatedProblem, MIN_DURATION, follows};
use faults::{Fault, FaultKind};

/// Reads all of them. They may overlap, but none may start before the one before it.
pub(super) fn read_all(
    entries: Vec<Spanned<Entry>>,
    length: f64,
) -> Result<Vec<Fault>, LocatedProblem> {
    let mut started_s = 0.0;
    let mut faults = Vec::with_capacity(entries.len());
    for entry in entries {
        let (kind, mut keys) = Keys::from_entry(entry)?;
        let at_s = keys.value("at_s", |it| it.number(0.0..=length))?;
        let at_s = keys.needed("at_s", at_s)?;
        follows(at_s, started_s).map_err(|problem| keys.misplaced(problem))?;
        started_s = at_s;
        faults.push(read(&kind, at_s, length, &mut keys)?);
        keys.end()?;
    }
    Ok(faults)
}

fn read(kind: &str, at_s: f64, length: f64, keys: &mut Keys) -> Result<Fault, LocatedProblem> {
    let (target, kind) = fault_table::read(kind, keys)?;
    let mut fault = Fault::new(Duration::from_secs_f64(at_s), target, kind);
    if !kind.is_momentary() {
        // A host or an adapter may stall for a part of a cycle.
        let least =
            if matches!(kind, FaultKind::Host(_) | FaultKind::Bus(_)) { 0.0 } else { MIN_DURATION };
        let duration = keys.value("for_s", |it| it.number(least..=length - at_s))?;
        fault.duration = duration.map(Duration::from_secs_f64);
    }
    // Without an end, the process would never run again in virtual time.
    if matches!(kind, FaultKind::Host(_)) && !kind.is_momentary() {
        keys.needed("for_s", fault.duration)?;
    }
    Ok(fault)
}

/// Fault as a table of TOML, its keys in the order in which people write them.
#[derive(Debug)]
pub(super) struct FaultEntry<'a>(pub(super) &'a Fault);

impl Serialize for FaultEntry<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self(fault) = self;
        let mut keys: KeyList = vec![("at_s", seconds(fault.start).into())];
        fault_table::write(fault.target, fault.kind, &mut keys);
        keys.extend(fault.duration.map(|duration| ("for_s", seconds(duration).into())));
        serializer.collect_map(keys)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::scenario::Scenario;

    fn read(keys: &str) -> Result<Scenario, String> {
        let text = format!("seconds = 5\n[[fault]]\nat_s = 1\n{}\n", keys.replace(", ", "\n"));
        Scenario::parse(&text).map_err(|error| error.to_string())
    }

    #[test]
    fn fault_is_read_described_and_written_again() {
        for (keys, words) in [
            ("kind = \"unplug\", joint = 3", "joint 3: unplugged"),
            ("kind = \"reset\", joint = \"all\"", "every drive: reboots by itself"),
            ("kind = \"bus_off\", device = \"switches\"", "switch box: bus-off"),
            ("kind = \"wire_cut\", joint = 1", "joint 1: wire cut before it"),
            ("kind = \"drop\", joint = 1", "joint 1: frames lost"),
            ("kind = \"drop\", joint = 1, cob_id = 0x77F", "joint 1: 77Fh lost"),
            (
                "kind = \"drop\", joint = 1, frame = \"tpdo12\", share = 0.2",
                "joint 1: tpdo12 lost, 20 %",
            ),
            (
                "kind = \"duplicate\", joint = 1, frame = \"sdo\", count = 2",
                "joint 1: sdo twice, 2 times",
            ),
            (
                "kind = \"delay\", joint = 1, frame = \"rpdo1\", delay_ms = 1.5",
                "joint 1: rpdo1 1.5 ms late",
            ),
            (
                "kind = \"corrupt\", joint = 1, frame = \"emcy\", xor = \"01\"",
                "joint 1: emcy corrupted",
            ),
            ("kind = \"freeze\", joint = 1, frame = \"sync\"", "joint 1: sync frozen"),
            ("kind = \"resize\", joint = 1, bytes = 2", "joint 1: frames of 2 bytes"),
            ("kind = \"heartbeat_stop\", joint = 1", "joint 1: heartbeat lost"),
            (
                "kind = \"impersonate\", joint = 1, by = 2",
                "joint 1: tpdo1 sent twice, once with joint 2's data",
            ),
            ("kind = \"emergency\", joint = 1, code = 0x4210", "joint 1: emergency 4210h"),
            ("kind = \"fault\", joint = 1", "joint 1: fault 0000h"),
            ("kind = \"sto\", joint = 1", "joint 1: safe torque off"),
            (
                "kind = \"torque_offset\", joint = 1, per_mille = -300",
                "joint 1: torque offset of -300 ‰",
            ),
            ("kind = \"encoder_jump\", joint = 1, by_rad = 1", "joint 1: encoder off by 1 rad (m)"),
            ("kind = \"encoder_frozen\", joint = 1", "joint 1: encoder frozen"),
            (
                "kind = \"torque_actual_scale\", joint = 1, scale = 0.5",
                "joint 1: torque actual multiplied by 0.5",
            ),
            (
                "kind = \"switch_stuck\", switch = \"deadman_b\", level = \"low\"",
                "switch box: deadman_b stuck low",
            ),
            ("kind = \"switch_bounce\", switch = \"reference\"", "switch box: reference bounces"),
            ("kind = \"foreign_sync\", bus = 1", "bus 1: foreign frame 080#"),
            ("kind = \"foreign_nmt\", command = \"reset_node\"", "bus 0: foreign frame 000#8100"),
            (
                "kind = \"foreign_frame\", cob_id = 0x203, payload = \"0F00\"",
                "bus 0: foreign frame 203#0F00",
            ),
            ("kind = \"link_loss\", for_s = 4", "link: lost"),
            ("kind = \"link_frozen\"", "link: frozen"),
            ("kind = \"sensed_force\", force_n = -inf", "link: reports a force of -inf N"),
            ("kind = \"queue_full\", bus = 1", "bus 1: transmit queue full"),
            ("kind = \"adapter_stuck\"", "bus 0: adapter stuck"),
            ("kind = \"adapter_stalled\", for_s = 0.01", "bus 0: adapter stalled"),
            ("kind = \"adapter_unplugged\"", "bus 0: adapter unplugged"),
            ("kind = \"adapter_bus_off\"", "bus 0: adapter bus-off"),
            ("kind = \"error_passive\"", "bus 0: adapter error passive"),
            ("kind = \"error_warning\"", "bus 0: adapter error warning"),
            ("kind = \"interface_down\"", "bus 0: interface down"),
            ("kind = \"flood\", cob_id = 1, payload = \"00\"", "bus 0: flooded with 001#00"),
            ("kind = \"process_stopped\", for_s = 0.3", "host: process stopped"),
            (
                "kind = \"process_stopped\", cob_id = 0x80, for_s = 0.3",
                "host: process stopped after 080h",
            ),
            ("kind = \"host_suspended\", for_s = 0.1", "host: suspended"),
            ("kind = \"clock_set\", wall_s = 7", "host: wall clock set to 7 s"),
        ] {
            let script = read(keys).unwrap();
            let [fault] = script.faults() else { panic!("{keys}") };
            assert_eq!(format!("{}: {}", fault.target, fault.kind), words);
            assert_eq!(Scenario::parse(&script.to_toml()).unwrap(), script, "{keys}");
        }
    }

    #[test]
    fn invalid_faults_are_refused_in_one_line() {
        for (keys, reason) in [
            ("joint = 3", "2: fault[0].kind: missing; `fault` needs it"),
            ("kind = 3", "4: fault[0].kind: must be a word, got 3"),
            ("kind = \"burn\"", "2: fault[0].kind: must be a kind of fault, got burn"),
            ("kind = \"unplug\"", "2: fault[0].joint: missing; `unplug` needs it"),
            ("kind = \"unplug\", joint = 7", "5: fault[0].joint: must be 1 to 6 or \"all\", got 7"),
            (
                "kind = \"unplug\", device = \"me\"",
                "5: fault[0].device: must be \"switches\", got \"me\"",
            ),
            ("kind = \"sto\", device = \"switches\"", "2: fault[0].joint: missing; `sto` needs it"),
            (
                "kind = \"unplug\", joint = 1, code = 3",
                "6: fault[0].code: does not belong to `unplug`",
            ),
            (
                "kind = \"reset\", joint = 1, for_s = 1",
                "6: fault[0].for_s: does not belong to `reset`",
            ),
            (
                "kind = \"unplug\", joint = 1, for_s = 4.1",
                "6: fault[0].for_s: must be within 0.001..=4, got 4.1",
            ),
            ("kind = \"unplug\", joint = 1, for_s = nan", "6: fault[0].for_s: must be within"),
            (
                "kind = \"drop\", joint = 1, frame = \"tpdo0\"",
                "6: fault[0].frame: must be tpdo1 to",
            ),
            (
                "kind = \"drop\", joint = 1, frame = \"tpdo01\"",
                "6: fault[0].frame: must be tpdo1 to",
            ),
            (
                "kind = \"drop\", joint = 1, frame = \"sync\", cob_id = 128",
                "7: fault[0].cob_id: does not belong to `drop`",
            ),
            (
                "kind = \"drop\", joint = 1, cob_id = 0x800",
                "6: fault[0].cob_id: must be 0 to 0x7FF, got 2048",
            ),
            (
                "kind = \"drop\", joint = 1, share = 1.5",
                "6: fault[0].share: must be within 0..=1, got 1.5",
            ),
            (
                "kind = \"drop\", joint = 1, share = 1, count = 1",
                "7: fault[0].count: does not belong to `drop`",
            ),
            (
                "kind = \"drop\", joint = 1, count = 0",
                "6: fault[0].count: must be 1 or more, got 0",
            ),
            ("kind = \"delay\", joint = 1", "2: fault[0].delay_ms: missing; `delay` needs it"),
            (
                "kind = \"corrupt\", joint = 1, xor = \"1\"",
                "6: fault[0].xor: must be up to 8 bytes",
            ),
            (
                "kind = \"corrupt\", joint = 1, xor = \"+1\"",
                "6: fault[0].xor: must be up to 8 bytes",
            ),
            ("kind = \"foreign_nmt\"", "2: fault[0].command: missing; `foreign_nmt` needs it"),
            ("kind = \"link_loss\", at_s = 2", "5: duplicate key"),
            (
                "kind = \"process_stopped\"",
                "2: fault[0].for_s: missing; `process_stopped` needs it",
            ),
            ("kind = \"clock_set\"", "2: fault[0].wall_s: missing; `clock_set` needs it"),
            (
                "kind = \"sensed_force\", force_n = \"x\"",
                "5: fault[0].force_n: must be a number, got \"x\"",
            ),
            (
                "kind = \"link_loss\", [[fault]], kind = \"link_loss\", at_s = 0.5",
                "5: fault[1].at_s: must be at least 1, the end of the entry before, got 0.5",
            ),
        ] {
            let error = read(keys).unwrap_err();
            assert!(error.starts_with(reason), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    proptest! {
        #[test]
        fn any_entry_is_parsed_or_refused(
            kind in prop::sample::select(vec!["drop", "corrupt", "delay", "foreign_frame", "emergency"]),
            key in prop::sample::select(vec!["joint", "xor", "payload", "delay_ms", "code", "frame"]),
            value in prop_oneof!["\"[^\"\\\\\\n]*\"", "-?[1-9][0-9]{0,20}(\\.[0-9]+)?", "\\[\\]"],
        ) {
            drop(read(&format!("kind = \"{kind}\", {key} = {value}")));
        }
    }
}
