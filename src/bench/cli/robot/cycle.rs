//! The robot's thread: a cycle per period, with the messages of the node in between.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::robot::clock::{Clock, next_due};
use crate::robot::narrator::{Event, Narrator};
use crate::robot::outlet::Outlet;
use crate::robot::report::Report;
use crate::robot::sensor::SensorStatus;
use bus::realtime;
use far_socket::FarSocket;
use net_ft::reader::Reading;
use net_ft::socket::NetFt;
use testbench::far_robot::{FarRobot, Outgoing};
use units::time::Instant;

/// Cycles after a stop signal, in which the robot says that it ends.
const LAST_CYCLES: u32 = 10;

/// Requests to the robot's thread.
#[derive(Debug, Default)]
pub(super) struct Requests {
    stop: AtomicBool,
    report: AtomicBool,
}

impl Requests {
    /// Requests an end.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Requests a status line.
    pub(super) fn report(&self) {
        self.report.store(true, Ordering::Relaxed);
    }

    /// Passes the status on if it is requested and there is room.
    fn answer(&self, outlet: &Outlet, report: impl FnOnce() -> Report) {
        if self.report.load(Ordering::Relaxed) && outlet.report(report) {
            self.report.store(false, Ordering::Relaxed);
        }
    }

    /// Returns whether an end is requested.
    pub(super) fn is_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// The robot, and what it is connected to.
#[derive(Debug)]
pub(super) struct Ends {
    /// The robot.
    pub(super) robot: FarRobot,
    /// Its connection to the node.
    pub(super) link: FarSocket,
    /// Its force/torque sensor, if that is a real one.
    pub(super) sensor: Option<NetFt>,
}

impl Ends {
    /// Returns the status at `now`.
    pub(super) fn report(&self, now: Instant) -> Report {
        Report {
            status: self.robot.status(),
            is_connected: self.link.is_connected(),
            sensor: self.sensor.as_ref().map(|sensor| SensorStatus::of(sensor, now)),
        }
    }

    /// Performs the robot's cycle, with the reading of a real sensor if it has one.
    fn step(&mut self, now: Instant) -> Outgoing {
        match &mut self.sensor {
            None => self.robot.step(now),
            Some(sensor) => {
                let Reading { number, wrench } = sensor.read(now);
                self.robot.step_with_reading(now, number, wrench)
            }
        }
    }
}

/// Runs cycles of `period` until an end is requested, and a few more that say so.
pub(super) fn run(
    ends: &mut Ends,
    clock: Clock,
    period: Duration,
    requests: &Requests,
    outlet: &Outlet,
) {
    realtime::ask();
    let mut narrator = Narrator::default();
    let mut due = clock.now();
    let mut last_cycles = LAST_CYCLES;
    while last_cycles > 0 {
        if requests.is_stop() {
            ends.robot.end();
            last_cycles -= 1;
        }
        let Ends { robot, link, .. } = ends;
        // Each message gets a time after its arrival: after a stop of this process in between, it is old.
        link.receive(clock.now(), |bytes| robot.on_message(clock.now(), bytes));
        let now = clock.now();
        let outgoing = ends.step(now);
        let Ends { robot, link, sensor } = ends;
        link.send(now, &outgoing.feedback);
        if let Some(capability) = outgoing.capability {
            link.send(now, &capability);
        }
        link.events().for_each(|event| outlet.event(Event::Socket(event)));
        let changed = sensor.as_mut().and_then(NetFt::event);
        changed.into_iter().for_each(|event| outlet.event(Event::Sensor(event)));
        narrator.observe(robot.leader(), robot.reason()).for_each(|event| outlet.event(event));
        requests.answer(outlet, || ends.report(now));
        due = next_due(due, clock.now(), period);
        clock.wait(due);
    }
    ends.sensor.iter_mut().for_each(NetFt::stop);
}
