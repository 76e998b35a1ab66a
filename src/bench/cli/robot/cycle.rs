//! Thread of the robot: a cycle per period, with the messages of the node in between.

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

/// Number of cycles after a stop signal in which the robot reports its end.
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

/// Robot with its connections.
#[derive(Debug)]
pub(super) struct Ends {
    /// Simulated robot.
    pub(super) robot: FarRobot,
    /// Connection to the node.
    pub(super) link: FarSocket,
    /// Real force/torque sensor, if configured.
    pub(super) sensor: Option<NetFt>,
}

impl Ends {
    /// Returns the status at `now`.
    pub(super) fn report(&self, now: Instant) -> Report {
        Report {
            status: self.robot.status(),
            is_connected: self.link.is_connected(),
            sensor: self.sensor.as_ref().map(|sensor| SensorStatus::new(sensor, now)),
        }
    }

    /// Performs a cycle of the robot, with the reading of a real sensor if configured.
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

/// Runs cycles of `period` until an end is requested, and [`LAST_CYCLES`] more that report it.
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
        // The time is read after the arrival: a message that waited during a stop of this process is stale.
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
