//! All that is not the node: six drives and a switch box on their buses, the arm they move, and the
//! hand that holds it.
//!
//! At every SYNC the arm is brought up to date first, with the torques that acted until then; then the
//! drives see where it is, and the SYNC. Without SYNCs the arm moves all the same, a millisecond at a time.

use std::time::Duration;

use nalgebra::Isometry3;
use nalgebra::Translation3;

use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::station::Station;
use crate::canopen::sync;
use crate::sim::arm::Joints;
use crate::sim::drive::Drive;
use crate::sim::hand::Hand;
use crate::sim::plant::Plant;
use crate::sim::scenario::Scenario;
use crate::sim::switches::SwitchBox;
use crate::sim::tremor::Tremor;
use crate::time::Instant;

/// The arm is never older than this.
const TICK: Duration = Duration::from_millis(1);

/// The most the arm moves at once.
const LONGEST: Duration = Duration::from_millis(100);

/// The bus whose SYNC the arm and the scenario follow; the others' come microseconds later.
const LEADING: Channel = Channel(0);

/// Everything on the buses but the node, and behind them.
#[derive(Clone, Debug)]
pub struct World {
    drives: [Drive; 6],
    switches: SwitchBox,
    plant: Plant,
    hand: Hand,
    scenario: Scenario,
    tremor: Tremor,
    /// Where the grip was at the start: what the scenario's movements are relative to.
    x_0_start: Isometry3<f64>,
    /// The first SYNC: time zero of the scenario.
    begun: Option<Instant>,
    /// Up to when the arm has moved.
    now: Instant,
}

impl World {
    /// With the arm at rest where `plant` is, held by the hand.
    pub fn new(
        drives: [Drive; 6],
        switches: SwitchBox,
        plant: Plant,
        scenario: Scenario,
        seed: u64,
    ) -> Self {
        let mut world = Self {
            drives,
            switches,
            x_0_start: *plant.x_0_g(),
            plant,
            hand: Hand::default(),
            scenario,
            tremor: Tremor::new(seed),
            begun: None,
            now: Instant::ZERO,
        };
        world.show();
        world
    }

    /// The drives, base first.
    pub const fn drives(&self) -> &[Drive; 6] {
        &self.drives
    }

    /// One drive, to break it; joints count from 1.
    pub fn drive_mut(&mut self, joint: usize) -> Option<&mut Drive> {
        self.drives.get_mut(joint.checked_sub(1)?)
    }

    /// The arm.
    pub const fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Lets the arm move until `now`, and operator and encoders follow.
    fn advance(&mut self, now: Instant) {
        // A simulation that was stopped does not make up for it.
        let dt = now.since(self.now).min(LONGEST).as_secs_f64();
        if dt <= 0.0 {
            return;
        }
        let t = self.begun.map_or(0.0, |begun| now.since(begun).as_secs_f64());
        let operator = self.scenario.operator(t);
        let shaking = self.tremor.next(dt);
        let place = self.x_0_start.translation.vector + operator.translation + shaking;
        let x_0_d = Isometry3::from_parts(
            Translation3::from(place),
            self.x_0_start.rotation * operator.rotation,
        );
        let mut tau = Joints::zeros();
        for (tau, drive) in tau.iter_mut().zip(&self.drives) {
            *tau = drive.torque();
        }
        self.plant.advance(dt, &tau, operator.is_holding.then_some((&self.hand, &x_0_d)));
        self.switches.set(operator.inputs);
        self.now = now;
        self.show();
    }

    /// Shows every encoder its joint.
    fn show(&mut self) {
        let joints = self.plant.q().iter().zip(self.plant.qd().iter());
        for (drive, (q, qd)) in self.drives.iter_mut().zip(joints) {
            drive.set_motion(*q, *qd);
        }
    }
}

impl Station for World {
    fn on_frame(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        if frame.cob_id == sync::COB_ID && channel == LEADING {
            self.begun.get_or_insert(now);
            self.advance(now);
        }
        for drive in &mut self.drives {
            drive.on_frame(now, channel, frame, out);
        }
        self.switches.on_frame(now, channel, frame, out);
    }

    fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        if self.now + TICK <= now {
            self.advance(now);
        }
        let is_due = |due: Option<Instant>| due.is_some_and(|due| due <= now);
        for drive in self.drives.iter_mut().filter(|drive| is_due(drive.deadline())) {
            drive.on_time(now, out);
        }
        if is_due(self.switches.deadline()) {
            self.switches.on_time(now, out);
        }
    }

    fn deadline(&self) -> Option<Instant> {
        let drives = self.drives.iter().filter_map(Drive::deadline);
        drives.chain(self.switches.deadline()).chain([self.now + TICK]).min()
    }
}
