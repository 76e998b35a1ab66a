//! `frhc replay`: a recorded session, computed again from its inputs.

mod emitted;
mod open_loop;

use std::path::PathBuf;

use clap::Args;

use crate::replay::emitted::Emitted;
use crate::session_config::{configuration, equipped};
use crate::session_progress;
use ::replay::{Difference, End, Outcome, Replay, Session};
use canopen::frame::{Channel, TEXT_LENGTH, Telegram};
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use telemetry::manifest::Manifest;

/// `frhc replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Folder of the session.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Fail as well where the recording ends early or has a gap: exit code 1.
    #[arg(long)]
    verify: bool,
    /// Write the frames that the node sends into this file, in candump's format.
    #[arg(long, value_name = "FILE")]
    emit: Option<PathBuf>,
    /// First cycle whose frames are written.
    #[arg(long, value_name = "CYCLE", requires = "emit", default_value_t = 0)]
    from: u64,
    /// Last cycle that is replayed [default: the last one].
    #[arg(long, value_name = "CYCLE")]
    to: Option<u64>,
    /// Compute the torques of another configuration beside those of the session: open loop, since the recorded person and arm
    /// did not feel them.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["verify", "emit"])]
    with: Option<PathBuf>,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Replays a session, compares what the node sends, and prints the result.
pub(super) fn run(args: &ReplayArgs, is_quiet: bool) -> Result<(), Failure> {
    let session = Session::open(&args.session).or_fail(Kind::File)?;
    let config = configuration(&session)?;
    if let Some(file) = &args.with {
        let other = Config::load(file).or_fail(Kind::Configuration)?;
        return open_loop::compare(args, is_quiet, &session, &config, &equipped(&session, other)?);
    }
    let mut replay = session.replay(&config).or_fail(Kind::File)?;
    let mut emitted = args.emit.as_deref().map(|path| Emitted::create(path, session.manifest()));
    let mut emitted = emitted.take().transpose()?;
    let progress = session_progress::start(&args.session, args.to, is_quiet)?;
    loop {
        let cycle = replay.outcome().cycles;
        if let Some(emitted) = emitted.as_mut().filter(|_| cycle >= args.from) {
            emitted.write(replay.sent())?;
        }
        if replay.outcome().end.is_some() || args.to.is_some_and(|last| cycle >= last) {
            break;
        }
        progress.check().or_fail(Kind::Interrupted)?;
        replay.step();
        progress.advance(replay.outcome().cycles - cycle);
    }
    progress.finish();
    emitted.map_or(Ok(()), Emitted::finish)?;
    report(args, &session, &replay)
}

/// Prints the result; a difference is a failure.
fn report(args: &ReplayArgs, session: &Session, replay: &Replay) -> Result<(), Failure> {
    let outcome = replay.outcome();
    let end = end(session, replay)?;
    if args.json {
        let intermediate = outcome
            .intermediate
            .map(|(cycle, name)| serde_json::json!({ "cycle": cycle, "name": name }));
        let document = serde_json::json!({
            "cycles": outcome.cycles,
            "frames": outcome.frames,
            "is_equal": is_equal(outcome),
            "is_complete": is_complete(outcome),
            "end": end,
            "intermediate": intermediate,
        });
        print::line(&document.to_string());
    } else {
        let manifest = session.manifest();
        print::line(&format!("session   {}, {}", manifest.configuration, manifest.program));
        print::line(&format!(
            "replayed  {} cycles, {} frames: {end}",
            outcome.cycles, outcome.frames
        ));
        if let Some((cycle, name)) = outcome.intermediate {
            print::line(&format!(
                "law       {name} is the first intermediate that differs, in cycle {cycle}"
            ));
        }
    }
    let is_negative = !is_equal(outcome) || args.verify && !is_complete(outcome);
    if is_negative { Err(Failure::new(Kind::Negative, end)) } else { Ok(()) }
}

/// Returns whether every compared frame was equal.
const fn is_equal(outcome: &Outcome) -> bool {
    !matches!(outcome.end, Some(End::Differs(_)))
}

/// Returns whether the whole session was replayed, or as much of it as was to be.
const fn is_complete(outcome: &Outcome) -> bool {
    matches!(outcome.end, None | Some(End::Complete))
}

/// Returns the end of a replay in words.
fn end(session: &Session, replay: &Replay) -> Result<String, Failure> {
    let cycles = replay.outcome().cycles;
    Ok(match &replay.outcome().end {
        None | Some(End::Complete) => "all as recorded".to_owned(),
        Some(End::Cut) => format!("as recorded; the recording ends in cycle {}", cycles + 1),
        Some(End::Lost(inputs)) => {
            format!(
                "as recorded; {inputs} inputs are missing after cycle {cycles}, so the rest cannot be replayed"
            )
        }
        Some(End::Unreadable(error)) => format!("as recorded until cycle {cycles}; {error}"),
        Some(End::Differs(difference)) => differing(session, replay, difference)?,
    })
}

/// Returns a difference in words, with its first frame.
fn differing(
    session: &Session,
    replay: &Replay,
    difference: &Difference,
) -> Result<String, Failure> {
    let recorded = session.frames_of_cycle(difference.cycle).or_fail(Kind::File)?;
    let sent = replay.sent().iter().map(|(_, telegram)| telegram);
    let frame = first_difference(&recorded, sent.copied().collect()).map(|(was, is)| {
        let text = |telegram: Option<Telegram>| match telegram {
            Some(telegram) => shown(session.manifest(), &telegram),
            None => "nothing".to_owned(),
        };
        format!("; recorded {}, now {}", text(was), text(is))
    });
    Ok(format!("{difference}{}", frame.unwrap_or_default()))
}

/// Returns the first frame that is sent now and was not then, with the one recorded in its place.
fn first_difference(
    recorded: &[Telegram],
    sent: Vec<Telegram>,
) -> Option<(Option<Telegram>, Option<Telegram>)> {
    let mut recorded = recorded.to_vec();
    for telegram in sent {
        let key = |of: &Telegram| (of.channel, of.frame.cob_id);
        match recorded.iter().position(|it| key(it) == key(&telegram)) {
            Some(place) if recorded.get(place) == Some(&telegram) => _ = recorded.remove(place),
            Some(place) => return Some((recorded.get(place).copied(), Some(telegram))),
            None => return Some((None, Some(telegram))),
        }
    }
    None
}

/// Returns a frame as candump writes it.
fn shown(manifest: &Manifest, Telegram { channel: Channel(place), frame }: &Telegram) -> String {
    let interface = manifest.interfaces.get(usize::from(*place)).map_or("can?", String::as_str);
    let mut text = [0; TEXT_LENGTH];
    format!("{interface} {}", String::from_utf8_lossy(frame.text(&mut text)))
}
