//! `frhc sim`: simulated drives, switch box, arm and operator on SocketCAN, for any master.

use std::fs;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering;
use std::thread;

use anyhow::Context;

use crate::bus::SocketCan;
use crate::bus::realtime;
use crate::cli::args::Sim;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::interfaces;
use crate::cli::measurements;
use crate::cli::print;
use crate::cli::scenario;
use crate::cli::signals;
use crate::config::Config;
use crate::controller::arm::JointKind;
use crate::lab::attend::attend;
use crate::lab::world;
use crate::sim::rig;
use crate::sim::world::World;

/// Lives on the bus until a signal ends it, then tells what each drive believes.
pub(super) fn run(args: &Sim) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    if let Some(joint) = &args.calibrate {
        return calibrate(args, &config, joint);
    }
    let scenario = scenario::load(&args.scenario)?;
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let mut bus = SocketCan::open(&names).or_fail(Kind::Bus)?;
    let mut world = world::build(&config, scenario, args.seed);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.context("no runtime").or_fail(Kind::Bus)?;

    tracing::info!(interfaces = names.join(" "), "simulated drives are on the bus");
    let over = AtomicBool::new(false);
    thread::scope(|threads| {
        let live = || {
            realtime::ask();
            attend(&mut bus, &mut world, &mut |_| over.load(Ordering::Relaxed));
        };
        threads.spawn(live);
        runtime.block_on(signals::wait());
        over.store(true, Ordering::Relaxed);
    });
    report(&world);
    Ok(())
}

/// Measures one joint's torque on the rig.
fn calibrate(args: &Sim, config: &Config, name: &str) -> Result<(), Failure> {
    let joint = config.joints.iter().find(|joint| joint.name == name).ok_or_else(|| {
        let names: Vec<_> = config.joints.iter().map(|joint| joint.name.as_str()).collect();
        let reason =
            format!("--calibrate: no joint is called \"{name}\": there is {}", names.join(", "));
        Failure::new(Kind::Usage, reason)
    })?;
    let run = rig::measure(&world::rig(joint, args.seed));
    let comments = [
        format!("simulated rig, {}, joint {name}, seed {}", config.file.display(), args.seed),
        "joint held against a load cell, target torque stepped slowly up and down".to_owned(),
    ];
    let slides = joint.link.kind == JointKind::Prismatic;
    let text = measurements::write(name, slides, &comments, &run.readings);
    match &args.out {
        Some(file) => {
            let named = |error| format!("{}: {error}", file.display());
            fs::write(file, text).map_err(|error| Failure::new(Kind::Bus, named(error)))?;
        }
        None => print::line(text.trim_end()),
    }
    if args.reveal {
        let [c1, c3, c5] = run.curve;
        print::note(&format!("the unknown curve is {c1:.4} t {c3:+.5} t³ {c5:+.6} t⁵"));
    }
    Ok(())
}

/// What each drive believes.
fn report(world: &World) {
    for (joint, drive) in (1..).zip(world.drives()) {
        print::line(&format!(
            "joint {joint} node {:3} {}, torque {:+.3} N·m, last error {:04X}h",
            drive.node().raw(),
            drive.state(),
            drive.torque(),
            drive.last_error(),
        ));
    }
}
