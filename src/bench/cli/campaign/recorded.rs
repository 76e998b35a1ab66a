//! Recording of the session of one case, played from its own boot.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use campaign::case::Case;
use campaign::monitor::Monitor;
use campaign::run::{Campaign, Replay};
use canopen::frame::Telegram;
use config::Config;
use config::files::Files;
use config::trust::Trust;
use demo::session_inputs::SessionInputs;
use node::record::Record;
use run::exit::{Failure, Kind, OrFail};
use run::limits::Limits;
use run::provenance::Provenance;
use run::results::Force;
use run::run_recorder::RunRecorder;
use run::session;
use run::sources::Sources;
use telemetry::manifest::{CampaignCase, SessionKind};
use telemetry::origin::Origin;
use telemetry::summary::Summary;
use testbench::bench::Bench;
use units::time::Instant;

/// Bench of a case whose session is recorded.
pub(super) type CaseBench<'a, 'r> = Bench<Monitor, SessionInputs<'a, 'r>>;

/// Returns the folder of the session of a case.
pub(super) fn folder(parent: &Path, number: u32) -> PathBuf {
    parent.join(format!("case-{number}"))
}

/// Plays the only case of `cases` from its own boot, and records its session in a folder of `parent`. `on_cycle` is called
/// after every cycle since the boot.
pub(super) fn play(
    parent: &Path,
    (seed, force): (u64, Force),
    cases: &Campaign,
    on_cycle: &mut dyn FnMut(&mut CaseBench<'_, '_>, &Record),
) -> Result<Option<Replay>, Failure> {
    let Some(case) = cases.cases().first() else { return Ok(None) };
    let config = cases.config(case).or_fail(Kind::Configuration)?;
    let folder = folder(parent, case.number);
    session::make_room(&folder, force)?;
    let interfaces: Vec<_> = config.buses.iter().map(|bus| bus.interface.clone()).collect();
    let provenance = Provenance::new(&config, &interfaces, Origin::default());
    let sources = sources(seed, case, &config)?;
    let recorder = RunRecorder::with_session(&folder, &provenance, &sources, Limits::NONE);
    let mut recorder = recorder.or_fail(Kind::File)?;
    let (mut summary, mut taken) = (Summary::default(), 0);
    let recorded = RefCell::new(&mut recorder);
    let played = cases.replay(SessionInputs(&recorded), &mut |bench, record, _| {
        let frames = bench.tap_mut().frames();
        on_frames(&mut recorded.borrow_mut(), frames.get(taken..).unwrap_or_default());
        taken = frames.len();
        recorded.borrow_mut().on_cycle(record);
        summary.add(record);
        on_cycle(bench, record);
    });
    let played = played.or_fail(Kind::Drive)?;
    let frames = played.as_ref().map(|(_, frames)| &**frames).unwrap_or_default();
    on_frames(&mut recorder, frames.get(taken..).unwrap_or_default());
    let (_, finished) = recorder.finish(&summary);
    finished.or_fail(Kind::File)?;
    Ok(played)
}

fn on_frames(recorder: &mut RunRecorder, frames: &[(Instant, Telegram)]) {
    frames.iter().for_each(|(at, telegram)| recorder.on_frame(*at, telegram));
}

/// Returns the files of a case: those of its hand controller, and its scenario.
fn sources(seed: u64, case: &Case, config: &Config) -> Result<Sources, Failure> {
    let files = match case.injection.zeros {
        None => Files::on_disk(Trust::Any),
        Some(zeros) => zeros.files(config).or_fail(Kind::Configuration)?,
    };
    Config::load_from(&files, &config.file).or_fail(Kind::Configuration)?;
    let mut copies = files.copies();
    let scenario = PathBuf::from(format!("case-{}.toml", case.number));
    let text = case.scenario().or_fail(Kind::Configuration)?.to_toml();
    copies.insert(scenario.clone(), text.into_bytes().into());
    Ok(Sources {
        kind: SessionKind::Campaign,
        configuration: config.file.clone(),
        robot: None,
        scenario: Some(scenario),
        case: Some(CampaignCase { seed, number: case.number }),
        without_passivity: false,
        copies,
        is_anonymous: false,
    })
}
