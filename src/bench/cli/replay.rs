//! `frhc replay`: a recorded session, or the part in a fault record, computed again from its inputs.

mod difference;
mod extent;
mod frame_file;
mod open_loop;
mod trip_comparison;
mod verdict;

use std::path::PathBuf;

use clap::Args;

use crate::replay::difference::end;
use crate::replay::extent::Extent;
use crate::replay::frame_file::FrameFile;
use crate::replay::trip_comparison::TripComparison;
use crate::replay::verdict::Verdict;
use crate::session_config::{configuration, equipped};
use crate::session_progress;
use crate::span::Place;
use ::replay::{FaultRecord, Replay, Session};
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use units::wording::counted;

/// `frhc replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Folder of the session, or of a fault record in it.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Fail as well where a killed node has left the recording, or it has a gap: exit code 1.
    #[arg(long)]
    verify: bool,
    /// Write the frames that the node sends into this file, in candump's format; those of a fault record from 2 s before it.
    #[arg(long, value_name = "FILE")]
    emit: Option<PathBuf>,
    /// First cycle whose frames are written, by its number in bus.log, or the time since time zero in s, as `2.5s`.
    #[arg(long, value_name = "PLACE", requires = "emit")]
    from: Option<Place>,
    /// Last cycle that is replayed, or its time [default: the last one].
    #[arg(long, value_name = "PLACE")]
    to: Option<Place>,
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
    let fault = FaultRecord::open(&args.session).or_fail(Kind::File)?;
    let folder = fault.as_ref().map_or(&args.session, |fault| &fault.session);
    let session = Session::open(folder).or_fail(Kind::File)?;
    session.check_log().or_fail(Kind::File)?;
    let config = configuration(&session)?;
    let extent = Extent::new(args.from, args.to, fault.as_ref());
    let remark = || session.remarks().iter().for_each(|remark| print::note(remark));
    if let Some(file) = &args.with {
        remark();
        let other = Config::load(file).or_fail(Kind::Configuration)?;
        let other = equipped(&session, other)?;
        let progress = session_progress::start(session.folder(), None, is_quiet)?;
        return open_loop::compare(&session, [&config, &other], &extent, args.json, &progress);
    }
    let mut replay = session.replay(&config).or_fail(Kind::File)?;
    remark();
    let mut trip = fault.map(TripComparison::new);
    let frame_file = args.emit.as_deref().map(|path| FrameFile::create(path, session.manifest()));
    let mut frame_file = frame_file.transpose()?;
    let progress = session_progress::start(session.folder(), None, is_quiet)?;
    let mut at = None;
    while replay.outcome().end.is_none() {
        let record = replay.step();
        at = record.as_ref().map(|record| record.at).or(at);
        let reached = (replay.outcome().last_cycle, at);
        if let Some(frame_file) = frame_file.as_mut().filter(|_| extent.is_begun(reached)) {
            frame_file.write(replay.sent())?;
        }
        for (trip, record) in trip.iter_mut().zip(&record) {
            trip.on_cycle(record);
        }
        if extent.is_over(reached) {
            break;
        }
        progress.check().or_fail(Kind::Interrupted)?;
        progress.advance(u64::from(record.is_some()));
    }
    progress.finish();
    frame_file.map_or(Ok(()), FrameFile::finish)?;
    report(args, &session, &replay, trip.as_ref())
}

/// Prints the result; returns a failure for a difference.
fn report(
    args: &ReplayArgs,
    session: &Session,
    replay: &Replay,
    trip: Option<&TripComparison>,
) -> Result<(), Failure> {
    let outcome = replay.outcome();
    let verdict = Verdict::new(outcome, session);
    let end = verdict.words(&end(session, replay)?);
    if args.json {
        let intermediate = outcome
            .intermediate
            .map(|(cycle, name)| serde_json::json!({ "cycle": cycle, "name": name }));
        let document = serde_json::json!({
            "cycle_count": outcome.cycles,
            "frame_count": outcome.frames,
            "last_cycle": outcome.last_cycle,
            "is_equal": outcome.is_equal(),
            "is_complete": outcome.is_complete(),
            "verdict": verdict,
            "end": end,
            "intermediate": intermediate,
            "trip": trip,
        });
        print::line(&document.to_string());
    } else {
        let manifest = session.manifest();
        print::line(&format!("session   {}, {}", manifest.configuration, manifest.program));
        print::line(&format!(
            "replayed  {}, the last is {}, and {}: {end}",
            counted(outcome.cycles, "cycle"),
            outcome.last_cycle,
            counted(outcome.frames, "frame")
        ));
        if let Some((cycle, name)) = outcome.intermediate {
            print::line(&format!(
                "law       {name} is the first intermediate that differs, in cycle {cycle}"
            ));
        }
        trip.iter().for_each(|trip| print::line(&trip.to_string()));
    }
    if let Some(kind) = verdict.failure(args.verify) {
        return Err(Failure::new(kind, end));
    }
    trip.map_or(Ok(()), TripComparison::ensure_found)
}
