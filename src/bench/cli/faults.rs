//! `frhc explain faults`: the fault table as text or JSON.

use clap::Args;
use serde_json::{Value as Json, json};

use node::cause::CauseKind;
use node::reaction::{FaultTableRow, Reaction};
use node::record::Mode;
use node::safety::table;
use run::print;

/// `frhc explain faults`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  frhc explain faults | less -S\n  frhc explain faults --json | jq -r .cause"
)]
pub(crate) struct Faults {
    /// Print one JSON object per cause and line.
    #[arg(long)]
    json: bool,
}

/// Prints the table.
pub(crate) fn run(args: &Faults) {
    let lines = if args.json { objects() } else { text() };
    print::line(&lines.join("\n"));
}

/// Returns one JSON object per cause: the mode it leads to from every mode, and the rest of its row.
fn objects() -> Vec<String> {
    let object = |kind: CauseKind| {
        let row = kind.row();
        let reactions = Mode::ALL.map(|mode| {
            let after = table::reaction(kind, mode).mode();
            (mode.name().to_owned(), after.map_or(Json::Null, |after| json!(after.name())))
        });
        json!({
            "cause": format!("{kind:?}"),
            "words": kind.description(),
            "leads_to": Json::Object(reactions.into_iter().collect()),
            "torque_ends_within_ms": row.armed.ramp().as_millis(),
            "first_by": row.initiator.description(),
            "reset": reset(row),
            "hazards": row.hazards,
        })
    };
    CauseKind::ALL.into_iter().map(|kind| object(kind).to_string()).collect()
}

/// Returns the table and its legend.
fn text() -> Vec<String> {
    let heads = ["cause", "ready", "armed", "first by", "reset", "hazards", "what is wrong"];
    let mut lines = vec![line(heads.map(str::to_owned))];
    lines.extend(CauseKind::ALL.into_iter().map(|kind| {
        let row = kind.row();
        let hazards: Vec<String> = row.hazards.iter().map(u8::to_string).collect();
        line([
            format!("{kind:?}"),
            short(row.unarmed).to_owned(),
            short(row.armed).to_owned(),
            row.initiator.description().to_owned(),
            reset(row).to_owned(),
            hazards.join(" "),
            kind.description().to_owned(),
        ])
    }));
    lines.extend(
        ["", "ready: reaction in modes boot and ready; armed: reaction in armed and engaged"]
            .map(str::to_owned),
    );
    let all =
        [Reaction::NoStop, Reaction::ReflectionOff, Reaction::ZeroTorque, Reaction::DrivesOff];
    lines.extend(all.map(|reaction| {
        let ramp = match reaction.ramp().as_millis() {
            0 => String::new(),
            millis => format!(" within {millis} ms"),
        };
        format!("{:5}  {}{ramp}", short(reaction), reaction.description())
    }));
    lines.extend(
        [
            "A stop keeps its first cause; a worse cause makes the stop stricter, never milder. A reset ends it and",
            "boots the network where the table says so. The deadman must then be released and pressed again.",
        ]
        .map(str::to_owned),
    );
    lines
}

fn line([cause, ready, armed, first, reset, hazards, words]: [String; 7]) -> String {
    format!("{cause:20}{ready:6} {armed:6} {first:15}{reset:15}{hazards:8} {words}")
}

/// Returns the number of the safe state (docs/safety.md).
const fn short(reaction: Reaction) -> &'static str {
    match reaction {
        Reaction::NoStop => "-",
        Reaction::ReflectionOff => "S1",
        Reaction::ZeroTorque => "S2",
        Reaction::DrivesOff => "S3",
    }
}

/// Returns the condition under which a reset ends the stop.
const fn reset(row: FaultTableRow) -> &'static str {
    match (row.reset_boots, row.is_reset_in_drive()) {
        (true, _) => "by a boot",
        (false, true) => "in the drive",
        (false, false) => "when gone",
    }
}
