//! `frhc sim`: simulated drives, switch box, arm and operator on SocketCAN, for any master.

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
use crate::cli::print;
use crate::cli::rig;
use crate::cli::scenario;
use crate::cli::signals;
use crate::config::Config;
use crate::lab::attend::attend;
use crate::lab::world;
use crate::sim::world::World;

/// Lives on the bus until a signal ends it, then tells what each drive believes.
pub(super) fn run(args: &Sim) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    if let Some(joint) = &args.rig.calibrate {
        return rig::run(&args.rig, &config, joint, args.seed);
    }
    let mut scenario = scenario::load(&args.scenario)?;
    args.personalities.cast(&config, scenario.cast_mut())?;
    let names = interfaces::resolve(&config, &args.interfaces.interfaces)?;
    let bus = SocketCan::open(&names).and_then(SocketCan::with_guarding_requests);
    let mut bus = bus.or_fail(Kind::Bus)?;
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

/// What each drive believes.
fn report(world: &World) {
    for (joint, (drive, torque)) in (1..).zip(world.drives().iter().zip(&world.torques())) {
        print::line(&format!(
            "joint {joint} node {:3} {}, torque {torque:+.3} N·m, last error {:04X}h",
            drive.node().raw(),
            drive.state(),
            drive.last_error(),
        ));
    }
}
