//! `frhc demo`: node and simulation in one process, in virtual time.
#![forbid(unsafe_code)]

pub mod args;
pub mod event_narrator;
pub mod parsers;
pub mod quirks;
pub mod scenario;
pub mod session_inputs;
mod viewers;

use std::cell::{Cell, RefCell};
use std::path::Path;
use std::time::Duration;

use crate::args::Demo;
use crate::event_narrator::EventNarrator;
use crate::session_inputs::SessionInputs;
use crate::viewers::{DemoTelemetry, RunTelemetry};
use bus::Tap;
use canopen::frame::Telegram;
use canopen::master::event::Event;
use config::Config;
use config::files::Files;
use config::robots::RobotArm;
use config::trust::Trust;
use inputs::InputSink;
use node::cause::Cause;
use node::record::Record;
use progress::Progress;
use run::check::{contact, refuse_far_side, require_switch_box};
use run::exit::{Failure, Kind, OrFail};
use run::limits::Limits;
use run::provenance::Provenance;
use run::run_recorder::RunRecorder;
use run::sources::Sources;
use run::{gains, print, session};
use sim::scenario::Scenario;
use telemetry::contact_posture::ContactPostures;
use telemetry::fidelity::{Fidelity, WrenchSource};
use telemetry::manifest::SessionKind;
use telemetry::origin::Origin;
use telemetry::summary::Summary;
use testbench::bench::{Bench, Course};
use testbench::comparison::{self, Comparison};
use testbench::linked_robot::LinkedRobot;
use testbench::robot_site::{Equipment, RobotSite};
use testbench::side::Side;
use testbench::truth::Truth;
use units::time::Instant;

/// Cycles between two updates of the mode beside the progress bar.
const MODE_EVERY: u64 = 500;

/// Runs the scenario and prints its summary.
///
/// # Errors
/// Returns the failure, with its exit code: of the configuration, of a file, or of a run that stopped.
pub fn run(args: &Demo, quiet: bool) -> Result<(), Failure> {
    let files = Files::on_disk(Trust::Any);
    let config = Config::load_from(&files, &args.config).or_fail(Kind::Configuration)?;
    let config = match &args.robot {
        Some(file) => {
            config.with_robot(RobotArm::load_from(&files, file).or_fail(Kind::Configuration)?)
        }
        None => config,
    };
    if config.robot.is_none() {
        refuse_far_side(&config, "demo")?;
    }
    let (scenario, path, text) = scenario::load_with_text(&args.scenario)?;
    let mut copies = files.copies();
    copies.insert(path.clone(), text.as_bytes().into());
    let sources = Sources {
        kind: SessionKind::Demo,
        configuration: args.config.clone(),
        robot: args.robot.clone(),
        scenario: Some(path),
        case: None,
        without_passivity: false,
        copies,
        is_anonymous: false,
    };
    quirks::check(&config, scenario.quirks())?;
    let seconds = args.seconds.unwrap_or_else(|| scenario.seconds());
    if scenario.needs_switch_box() {
        require_switch_box(&config)?;
    }
    let config = comparison::surrounded(&config, &scenario);
    // Fails for a robot that cannot be simulated before results are replaced.
    side(args, &config).map(drop)?;
    gains::log(&config);
    contact::warn(&config);
    let telemetry = DemoTelemetry::start(&args.telemetry, &config)?;
    let telemetry = telemetry.as_ref();
    let play = Play { args, quiet, config: &config, seconds, sources: &sources, telemetry };
    if scenario.compares_passivity() {
        return compare(&play, &scenario);
    }
    let out = args.out.as_deref();
    out.map_or(Ok(()), |folder| session::make_room(folder, args.force))?;
    let summary = play.recorded(out, scenario)?;
    if args.json {
        print::line(&serde_json::to_string(&summary).or_fail(Kind::File)?);
    } else {
        print::line(&summary.to_string());
    }
    refuse_interrupted(&summary)?;
    match &summary.stopped_by {
        Some(cause) => Err(Failure::new(Kind::Stopped, format!("stopped by {cause}"))),
        None => Ok(()),
    }
}

/// Returns a failure if the run was interrupted.
fn refuse_interrupted(summary: &Summary) -> Result<(), Failure> {
    match summary.is_interrupted {
        false => Ok(()),
        true => {
            let reason = format!("interrupted after {:.3} s", summary.seconds);
            Err(Failure::new(Kind::Interrupted, reason))
        }
    }
}

/// Runs the scenario without and with the passivity layer.
fn compare(play: &Play<'_>, scenario: &Scenario) -> Result<(), Failure> {
    let Play { args, config, sources, .. } = *play;
    if config.controller.extensions.passivity.is_none() {
        let reason = "the scenario compares passivity layers; add [controller.passivity]";
        let file = args.config.display();
        return Err(Failure::new(Kind::Configuration, format!("{file}: {reason}")));
    }
    let without = comparison::without_passivity(config);
    let folder = |name| args.out.as_ref().map(|folder| folder.join(name));
    for folder in ["without", "with"].into_iter().filter_map(folder) {
        session::make_room(&folder, args.force)?;
    }
    let run = |config, name, without_passivity| {
        let sources = &Sources { without_passivity, ..sources.clone() };
        let play = Play { config, sources, ..*play };
        let summary = play.recorded(folder(name).as_deref(), scenario.clone())?;
        refuse_interrupted(&summary).map(|()| summary)
    };
    let wall_stiffness = config.remote.wall.map_or(0.0, |(.., wall)| wall.stiffness);
    let comparison = Comparison::new(
        wall_stiffness,
        run(&without, "without", true)?,
        run(config, "with", false)?,
    );
    if args.json {
        print::line(&serde_json::to_string(&comparison).or_fail(Kind::File)?);
    } else {
        print::line(&comparison.to_string());
    }
    let verdict = comparison.verdict;
    if verdict.is_good() { Ok(()) } else { Err(Failure::new(Kind::Negative, verdict.to_string())) }
}

/// Returns the commanded side: that of the configuration, with its link, or the robot of `--robot` with the tool and scene
/// of the free object.
fn side(args: &Demo, config: &Config) -> Result<Side, Failure> {
    if config.far_side.agreement.is_some() {
        let linked = LinkedRobot::new(config, args.seed);
        return linked.or_fail(Kind::Configuration).map(Side::from);
    }
    if args.robot.is_none() {
        return Ok(Side::from_config(config));
    }
    let equipment = Equipment::from_remote(&config.remote);
    let site = RobotSite::in_free_space(config, &equipment, args.seed);
    site.or_fail(Kind::Configuration).map(Side::from)
}

/// Settings of one run.
#[derive(Clone, Copy)]
struct Play<'a> {
    args: &'a Demo,
    quiet: bool,
    config: &'a Config,
    seconds: f64,
    sources: &'a Sources,
    telemetry: Option<&'a DemoTelemetry>,
}

impl Play<'_> {
    /// Runs the scenario once, and records it in `folder` if given.
    fn recorded(&self, folder: Option<&Path>, scenario: Scenario) -> Result<Summary, Failure> {
        let Self { config, sources, .. } = self;
        let interfaces: Vec<_> = config.buses.iter().map(|bus| bus.interface.clone()).collect();
        let provenance = Provenance::new(config, &interfaces, Origin::default());
        let part_bytes = self.args.part_size.unwrap_or(u64::MAX);
        let limits = Limits { part_bytes, ..Limits::NONE };
        let recorder =
            folder.map(|folder| RunRecorder::with_session(folder, &provenance, sources, limits));
        let mut recorder = recorder.transpose().or_fail(Kind::File)?.unwrap_or_default();
        let summary = self.simulate(scenario, &mut recorder)?;
        let (records, finished) = recorder.finish(&summary);
        records.iter().for_each(|line| print::note(line));
        finished.or_fail(Kind::File)?;
        Ok(summary)
    }

    fn simulate(&self, scenario: Scenario, recorder: &mut RunRecorder) -> Result<Summary, Failure> {
        let Self { args, quiet, config, seconds, .. } = self;
        let cycles = cycles(config, *seconds)?;
        let progress = &Progress::start(cycles, "cycles", *quiet).or_fail(Kind::System)?;
        let recorder = RefCell::new(recorder);
        let telemetry = self.telemetry.map(|telemetry| telemetry.of_run(config)).transpose()?;
        let telemetry = RefCell::new(telemetry);
        let mut narrator = (!scenario.faults().is_empty()).then(|| EventNarrator::new(config));
        let is_booting = Cell::new(true);
        let tap = Observer {
            recorder: &recorder,
            telemetry: &telemetry,
            narrator: narrator.clone(),
            is_booting: &is_booting,
            progress,
        };
        let side = side(args, config)?;
        let course = Course { scenario, seed: args.seed, speed: args.telemetry.speed() };
        let mut bench = Bench::recorded(config, side, course, tap, SessionInputs(&recorder));
        bench.bring_up().or_fail(Kind::Drive)?;
        is_booting.set(false);
        narrator.iter_mut().for_each(|narrator| print_events(narrator, &mut bench));
        let postures = ContactPostures::new(config.contact_bounds, config.dry_friction());
        let mut summary = Summary::judging(postures);
        let (mut truth, mut at_hand) = (Truth::new(config), Fidelity::new(WrenchSource::Hand));
        let mut was_too_fast = false;
        for cycle in 1..=cycles {
            let record = bench.cycle();
            summary.add(&record);
            at_hand.add(truth.sample(&bench, &record).as_ref());
            let is_too_fast = record.cause == Some(Cause::GripOverspeed);
            if is_too_fast && !std::mem::replace(&mut was_too_fast, is_too_fast) {
                progress.suspend(|| print::note(&overspeed(&record, config)));
            }
            if let Some(narrator) = &mut narrator {
                progress.suspend(|| print_cycle(narrator, &mut bench, &record));
            }
            recorder.borrow_mut().on_cycle(&record);
            if let Some(telemetry) = telemetry.borrow_mut().as_mut() {
                telemetry.on_record(&record, &summary);
            }
            while let Some(message) = recorder.borrow_mut().next_message() {
                progress.suspend(|| print::note(&message));
            }
            progress.advance(1);
            if cycle % MODE_EVERY == 0 {
                progress.set_state(record.mode.name());
            }
            if progress.is_interrupted() {
                summary.is_interrupted = true;
                break;
            }
        }
        progress.finish();
        summary.fidelity = at_hand.report();
        let carried = bench.carried();
        summary.bus_load_percent = carried.iter().map(|bus| bus.percent).collect();
        summary.bus_frames = carried.iter().map(|bus| bus.frames).collect();
        match bench.shut_down() {
            // A drive with an injected fault may be unable to confirm the stop.
            Err(error) if narrator.is_some() => print::note(&error.to_string()),
            stopped => stopped.or_fail(Kind::Drive)?,
        }
        Ok(summary)
    }
}

/// Returns the number of cycles in `seconds`.
fn cycles(config: &Config, seconds: f64) -> Result<u64, Failure> {
    let length = Duration::try_from_secs_f64(seconds).or_fail(Kind::Usage)?;
    let cycles = length.as_micros().div_ceil(config.period.as_micros().max(1));
    u64::try_from(cycles).or_fail(Kind::Usage)
}

/// Records frames, and prints network events during the boot. Those of a cycle are printed after it.
struct Observer<'a, 'r> {
    recorder: &'a RefCell<&'r mut RunRecorder>,
    telemetry: &'a RefCell<Option<RunTelemetry>>,
    narrator: Option<EventNarrator>,
    is_booting: &'a Cell<bool>,
    progress: &'a Progress,
}

impl Tap for Observer<'_, '_> {
    fn on_wire(&mut self, at: Instant, telegram: &Telegram) {
        self.recorder.borrow_mut().on_frame(at, telegram);
        if let Some(telemetry) = self.telemetry.borrow_mut().as_mut() {
            telemetry.on_frame(at, telegram);
        }
    }

    fn on_event(&mut self, at: Instant, event: Event) -> Option<Event> {
        if !self.is_booting.get() {
            return Some(event);
        }
        if let Some(narrator) = &self.narrator {
            self.progress.suspend(|| print::note(&narrator.event(at, &event)));
        }
        None
    }
}

/// Prints faults injected since the last cycle, a mode change, and events on the network.
fn print_cycle<T: Tap, S: InputSink + Clone>(
    narrator: &mut EventNarrator,
    bench: &mut Bench<T, S>,
    record: &Record,
) {
    while let Some(notice) = bench.fault_notice() {
        print::note(&narrator.fault(bench.begun(), &notice));
    }
    if let Some(line) = narrator.withdrawal(record) {
        print::note(&line);
    }
    if let Some(line) = narrator.mode_change(record) {
        print::note(&line);
    }
    print_events(narrator, bench);
}

/// Returns the text about a stop by the grip's speed: speed, limit and remedies. The hand may overshoot its script.
fn overspeed(record: &Record, config: &Config) -> String {
    let speed = record.output.twist.v_g_raw.linear.norm();
    let limit = config.plausibility.max_grip_speed;
    format!(
        "the scripted hand moved the grip at {speed:.2} m/s, above safety.max_grip_speed_m_per_s = {limit}: \
         give its moves more time, or raise damping_ns_per_m of [controller] or [hand]"
    )
}

/// Prints network events detected by the node.
fn print_events<T: Tap, S: InputSink + Clone>(
    narrator: &mut EventNarrator,
    bench: &mut Bench<T, S>,
) {
    narrator.scenario_start(bench.begun()).iter().for_each(|line| print::note(line));
    let now = bench.now();
    while let Some(event) = bench.next_event() {
        print::note(&narrator.event(now, &event));
    }
}
