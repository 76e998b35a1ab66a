//! `frhc campaign`: thousands of faults, with a verdict on each.

mod played;
mod recorded;
mod verified;

use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use demo::event_narrator::EventNarrator;
use serde_json::json;
use tempfile::TempDir;

use crate::campaign::played::{CampaignResult, Task};
use crate::campaign::recorded::CaseBench;
use bus::log_writer::LogWriter;
use campaign::case::Case;
use campaign::run::Campaign as Cases;
use campaign::table::Table;
use campaign::verdict::Verdict;
use campaign::{catalogue, soak};
use canopen::frame::Telegram;
use config::Config;
use config::shipped::HAND_CONTROLLERS;
use node::record::Record;
use progress::Progress;
use run::check::{refuse_far_side, require_switch_box};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};
use telemetry::fidelity::{Fidelity, WrenchSource};
use units::time::Instant;
use units::wording::counted;

/// Maximum number of failed cases with a log.
const MAX_LOGS: usize = 20;

/// `frhc campaign`.
#[derive(Debug, Args)]
pub struct Campaign {
    /// Seed of all random numbers: the same seed is the same campaign, bit for bit.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of faults to inject.
    #[arg(long, value_name = "N", default_value = "200")]
    faults: NonZero<usize>,
    /// A configuration; repeatable. Default: the ten in config/ and config/drives/.
    #[arg(short, long, value_name = "FILE")]
    config: Vec<PathBuf>,
    /// Only kinds of fault whose name contains this.
    #[arg(long, value_name = "KIND", conflicts_with_all = ["replay", "soak"])]
    only: Option<String>,
    /// Plays one case again, alone; prints its events and leaves its session.
    #[arg(long, value_name = "CASE", conflicts_with_all = ["faults", "soak"])]
    replay: Option<u32>,
    /// Plays each case once more from its own boot, and replays that from the recorded inputs of its node: every frame must be
    /// the same.
    #[arg(long, conflicts_with_all = ["replay", "soak"])]
    verify_replay: bool,
    /// Plays this many cycles with lost samples and a bad link instead, in which nothing may stop.
    #[arg(long, value_name = "CYCLES", conflicts_with = "faults")]
    soak: Option<NonZero<u64>>,
    /// Folder for the logs of failed cases. Default: a new one in the system's temporary folder.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Number of threads; changes nothing but the time. Default: one for each core.
    #[arg(long, value_name = "N", value_parser = thread_count)]
    threads: Option<NonZero<usize>>,
    /// Prints table and failures as one JSON object.
    #[arg(long)]
    json: bool,
    /// Prints the table as Markdown.
    #[arg(long, conflicts_with_all = ["json", "replay", "soak"])]
    markdown: bool,
}

/// Plays the campaign and prints its verdicts.
pub(super) fn run(args: &Campaign, quiet: bool) -> Result<(), Failure> {
    let configs = match &*args.config {
        [] => HAND_CONTROLLERS.iter().map(PathBuf::from).collect(),
        named => named.to_vec(),
    };
    let configs: Result<Vec<Config>, _> = configs.iter().map(|file| Config::load(file)).collect();
    let configs = configs.or_fail(Kind::Configuration)?;
    configs.iter().try_for_each(|config| refuse_far_side(config, "campaign"))?;
    configs.iter().try_for_each(require_switch_box)?;
    args.out.as_deref().map_or(Ok(()), results::ensure_writable)?;
    match (args.soak, args.replay) {
        (Some(cycles), _) => soak(args, quiet, &configs, cycles.get()),
        (None, Some(number)) => replay(args, configs, number),
        (None, None) => play(args, quiet, configs),
    }
}

fn play(args: &Campaign, quiet: bool, configs: Vec<Config>) -> Result<(), Failure> {
    let configs: Arc<[Config]> = configs.into();
    let task = Task {
        seed: args.seed,
        configs: &configs,
        faults: args.faults,
        only: args.only.as_deref(),
        threads: threads(args),
        is_replayed: args.verify_replay,
    };
    let Some(played) = task.play(quiet)? else { return Err(unknown_kind(args)) };
    let CampaignResult { tally, count, bad, replays, played_for, replayed_for } = played;
    let (table, seconds) = (tally.table(), played_for.as_secs_f64());
    let verified = replays.map(|replays| {
        print::note(&format!("replayed in {:.1} s", replayed_for.as_secs_f64()));
        replays.report(&|number| command(args, number))
    });
    if args.json {
        let failures: Vec<_> = bad.iter().map(|verdict| failure(args, verdict)).collect();
        let document = json!({ "seed": args.seed, "table": table, "failures": failures, "replayed": verified });
        print::line(&document.to_string());
    } else {
        let text = if args.markdown { table.markdown() } else { table.to_string() };
        print::line(&text);
        let rate = f64::from(u32::try_from(count).unwrap_or(u32::MAX)) / seconds.max(1e-3);
        let seed = args.seed;
        print::note(&format!(
            "{} of seed {seed} in {seconds:.1} s: {rate:.0} a second",
            counted(count, "fault")
        ));
        bad.iter().for_each(|verdict| print::line(&description(args, verdict)));
        verified.iter().for_each(|verified| print::line(&verified.to_string()));
    }
    if bad.is_empty() {
        return verified.map_or(Ok(()), |verified| verified.ensure_equal());
    }
    let folder = folder(args)?;
    for verdict in bad.iter().take(MAX_LOGS) {
        let one = Cases::of_one(args.seed, configs.clone(), verdict.number);
        if let Some(one) = one {
            export(&folder, args, &one, &mut |_, _| {})?;
        }
    }
    let reason =
        format!("{} of {}; logs in {}", bad.len(), counted(count, "fault"), folder.display());
    Err(Failure::new(Kind::Negative, reason))
}

/// Returns the failure of `--only` with a kind that is unknown.
fn unknown_kind(args: &Campaign) -> Failure {
    let names: Vec<&str> = catalogue::kinds().map(|kind| kind.name).collect();
    let only = args.only.as_deref().unwrap_or_default();
    let renamed = catalogue::RENAMED.iter().find(|(former, _)| *former == only);
    let reason = match renamed {
        Some((_, kind)) => format!("--only {only}: the kind was renamed to \"{kind}\""),
        None => {
            let names = names.join(", ");
            format!("--only {only}: unknown kind of fault; expected one of: {names}")
        }
    };
    Failure::new(Kind::Usage, reason)
}

/// Returns `case 137 (hazard 3, TPDO lost): late`, with the required reaction and the command that replays the case.
fn description(args: &Campaign, verdict: &Verdict) -> String {
    let Verdict { number, hazard, kind, criterion, outcome, observed, .. } = verdict;
    let cause = observed.cause.map_or_else(String::new, |cause| format!(", stopped by {cause}"));
    let mut text =
        format!("case {number} (hazard {hazard}, {kind}): {outcome}{cause}; demanded: {criterion}");
    for violation in &observed.violations {
        text.push_str(&format!("\n  {violation}"));
    }
    format!("{text}\n  {}", command(args, *number))
}

fn failure(args: &Campaign, verdict: &Verdict) -> serde_json::Value {
    let violations = verdict.observed.violations.iter();
    let violations: Vec<String> = violations.map(ToString::to_string).collect();
    json!({
        "case": verdict.number,
        "row": verdict.hazard,
        "kind": verdict.kind,
        "outcome": verdict.outcome.to_string(),
        "demanded": verdict.criterion.to_string(),
        "cause": verdict.observed.cause.map(|cause| cause.to_string()),
        "breaches": violations,
        "replay": command(args, verdict.number),
    })
}

/// Returns the command that replays a case.
fn command(args: &Campaign, number: u32) -> String {
    let configs = args.config.iter().map(|file| format!(" --config {}", file.display()));
    let configs: String = configs.collect();
    format!("frhc campaign --seed {}{configs} --replay {number}", args.seed)
}

fn replay(args: &Campaign, configs: Vec<Config>, number: u32) -> Result<(), Failure> {
    let Some(cases) = Cases::of_one(args.seed, configs, number) else {
        return Err(Failure::new(
            Kind::Usage,
            format!("--replay must be a case from 1, got {number}"),
        ));
    };
    let Some(case) = cases.cases().first() else { return Ok(()) };
    let config = cases.configs().get(case.config);
    let file = config.map_or_else(String::new, |config| config.file.display().to_string());
    let mut narrator = config.map(EventNarrator::new);
    print::line(&format!(
        "case {number} of seed {}: hazard {}, {}; {file}, {}",
        args.seed, case.kind.hazard, case.kind.name, case.situation
    ));
    for fault in case.injection.faults().filter(|fault| fault.is_of_host()) {
        let at = fault.start.as_secs_f64();
        print::line(&format!("scenario + {at:.6} s: {fault}"));
    }
    let mut print_events = |bench: &mut CaseBench<'_, '_>, record: &Record| {
        if let Some(narrator) = &mut narrator {
            print_new(narrator, bench, record);
        }
    };
    let folder = folder(args)?;
    let verdict = export(&folder, args, &cases, &mut print_events)?;
    let Some(verdict) = verdict else { return Ok(()) };
    print::line(&description(args, &verdict));
    print::line(&figures(&verdict));
    print::line(&format!("log and scenario: {}", folder.display()));
    print::line(&format!("session: {}", recorded::folder(&folder, number).display()));
    match verdict.is_good() {
        true => Ok(()),
        false => Err(Failure::new(Kind::Negative, format!("case {number}: {}", verdict.outcome))),
    }
}

fn figures(verdict: &Verdict) -> String {
    let Table { total, .. } = Table::from_verdicts(std::slice::from_ref(verdict));
    let millis = |time: Option<Duration>| {
        time.map_or_else(|| "-".to_owned(), |time| format!("{:.3} ms", time.as_secs_f64() * 1e3))
    };
    format!(
        "latched after {}, target torques zero after {}, drives torque-free after {}, reflection off after {}; \
         impulse {:.2} mN·m·s, grip {:.3} m/s and {:.2} mm",
        millis(verdict.observed.detected),
        millis(verdict.observed.zero),
        millis(verdict.observed.torque_free),
        millis(verdict.observed.reflection_off),
        1e3 * verdict.observed.impulse,
        total.grip_speed_m_per_s,
        total.grip_travel_mm
    )
}

/// Prints the faults and the node's events since the last cycle, in the order of their times, which are those of `bus.log`.
fn print_new(narrator: &mut EventNarrator, bench: &mut CaseBench<'_, '_>, record: &Record) {
    let begun = bench.begun();
    let mut lines: Vec<_> =
        narrator.scenario_start(begun).map(|line| (begun, line)).into_iter().collect();
    while let Some(notice) = bench.fault_notice() {
        lines.push((begun + notice.at, narrator.fault(begun, &notice)));
    }
    while let Some((at, event)) = bench.tap_mut().next_event() {
        lines.push((at, narrator.event(at, &event)));
    }
    let changes = narrator.withdrawal(record).into_iter().chain(narrator.mode_change(record));
    lines.extend(changes.map(|line| (record.at, line)));
    lines.sort_by_key(|(at, _)| *at);
    lines.iter().for_each(|(_, line)| print::line(line));
}

/// Replays the only case, and writes its session, its frames and its scenario.
fn export(
    folder: &Path,
    args: &Campaign,
    cases: &Cases,
    on_cycle: &mut dyn FnMut(&mut CaseBench<'_, '_>, &Record),
) -> Result<Option<Verdict>, Failure> {
    let force = args.force;
    let played = recorded::play(folder, (args.seed, force), cases, on_cycle)?;
    let Some((verdict, frames)) = played else { return Ok(None) };
    let files = || -> anyhow::Result<_> {
        let name = format!("case-{}", verdict.number);
        let config = cases.configs().get(verdict.config);
        let buses = config.map(|config| &*config.buses).unwrap_or_default();
        let interfaces: Vec<String> = buses.iter().map(|bus| bus.interface.clone()).collect();
        let scenario = cases.cases().first().map(Case::scenario).transpose()?;
        let scenario = scenario.map(|scenario| scenario.to_toml()).unwrap_or_default();
        let file = |extension| folder.join(&name).with_extension(extension);
        let log = log(&interfaces, &frames)?;
        Ok([(file("log"), log), (file("toml"), scenario.into_bytes())])
    };
    let files = files().with_context(|| folder.display().to_string()).or_fail(Kind::File)?;
    results::record_all(&files, force)?;
    Ok(Some(verdict))
}

/// Returns the frames in candump's format.
fn log(interfaces: &[String], frames: &[(Instant, Telegram)]) -> anyhow::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut writer = LogWriter::new(&mut text, interfaces, 0);
    frames.iter().try_for_each(|(at, telegram)| writer.frame(*at, telegram))?;
    writer.flush()?;
    Ok(text)
}

/// Returns the folder for logs: the one of `--out`, or a new one.
fn folder(args: &Campaign) -> Result<PathBuf, Failure> {
    let made = match &args.out {
        Some(out) => {
            let made = results::private_folder(out).map(|()| out.clone());
            made.with_context(|| out.display().to_string())
        }
        None => {
            let prefix = format!("frhc-campaign-{}-", args.seed);
            let folder = tempfile::Builder::new().prefix(&prefix).tempdir();
            folder.map(TempDir::keep).context("no temporary folder")
        }
    };
    made.or_fail(Kind::File)
}

fn soak(args: &Campaign, quiet: bool, configs: &[Config], cycles: u64) -> Result<(), Failure> {
    let progress = Progress::start(cycles, "cycles", quiet).or_fail(Kind::System)?;
    let on_lap = |cycles| progress.advance(cycles);
    let laps = || soak::soak(args.seed, configs, cycles, threads(args), &on_lap);
    let laps = progress.abandonable(print::error, laps).or_fail(Kind::Drive)?;
    progress.finish();
    let played: u64 = laps.iter().map(|lap| lap.cycles).sum();
    let bad: Vec<_> = laps.iter().filter(|lap| !lap.is_good()).collect();
    for lap in bad.iter().take(MAX_LOGS) {
        let file = configs.get(lap.config).map(|config| config.file.display().to_string());
        let file = file.unwrap_or_default();
        if let Some((at, cause)) = lap.trip {
            let at = at.as_secs_f64();
            print::line(&format!("lap {} ({file}): {at:.3} s: stopped by {cause}", lap.number));
        }
        lap.violation.iter().for_each(|violation| {
            print::line(&format!("lap {} ({file}): {violation}", lap.number));
        });
    }
    let mut at_hand = Fidelity::new(WrenchSource::Hand);
    laps.iter().for_each(|lap| at_hand.join(&lap.at_hand));
    let fidelity = at_hand.report();
    if args.json {
        let found = json!({ "seed": args.seed, "cycles": played, "laps": laps.len(), "bad": bad.len(), "fidelity": fidelity });
        print::line(&found.to_string());
    } else {
        fidelity.iter().for_each(|fidelity| print::line(&format!("felt at the hand  {fidelity}")));
        print::line(&format!(
            "{} in {}, {} with a stop or a violation",
            counted(played, "cycle"),
            counted(laps.len(), "lap"),
            bad.len()
        ));
    }
    match bad.len() {
        0 => Ok(()),
        count => {
            Err(Failure::new(Kind::Negative, format!("{count} of {}", counted(laps.len(), "lap"))))
        }
    }
}

/// Maximum number of threads: each has its own bench, and more threads than cores do not help.
const MAX_THREADS: usize = 256;

fn thread_count(word: &str) -> Result<NonZero<usize>, String> {
    let wrong = || format!("must be 1 to {MAX_THREADS}, got {word}");
    let count = word.parse::<NonZero<usize>>().map_err(|_| wrong())?;
    if count.get() <= MAX_THREADS { Ok(count) } else { Err(wrong()) }
}

fn threads(args: &Campaign) -> NonZero<usize> {
    let all = || thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    args.threads.unwrap_or_else(all)
}
