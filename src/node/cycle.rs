//! One cycle, from SYNC to torque.
//!
//! ```text
//!  SYNC k                                                                  SYNC k+1
//!    │  TPDO 1 … TPDO 6         step           RPDOs                         │
//!    ├───────────────────────►├──────►├──────────────────────────────►       │
//!    │ drives sampled         │ pure  │ held by the drives until ────────────┤ torques act
//!    │ their positions        │       │                                      │
//!    └ gather until complete ─┘       └ record (its owner's queue)           │
//! ```
//!
//! A watch returns causes. Only [`raise`](Node::raise) passes them to safety, which keeps the first: of causes in one cycle,
//! the watch listed first wins.

use crate::Node;
use crate::cause::Cause;
use crate::park;
use crate::permit::Permit;
use crate::plausibility::Weight;
use crate::power::may_apply_torque;
use crate::push::Push;
use crate::record::{Mode, Record, RefusedPress, SdoCounters};
use crate::remote_side::SideState;
use crate::safety::causes;
use bus::Bus;
use canopen::drive::State;
use controller::{Input, Output};
use remote::{Command, Remote};
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

impl<B: Bus, R: Remote> Node<B, R> {
    /// Runs one cycle: waits for the next SYNC slot, sends SYNC, receives samples, steps the controller, sends targets.
    /// A fault is in the record as its cause.
    pub fn cycle(&mut self) -> Record {
        let due = self.await_sync();
        self.watch_start(due.skipped);

        let sync_at = self.send_sync(due.at);
        self.gather(sync_at);
        // The end of the window is the time of all that follows in this cycle.
        let now = self.wire.now();
        self.timing.readings.window_end = now;
        self.poll_master(now);
        self.watch_samples(now, sync_at);
        self.watch_drives(now);

        let refused_press = self.press_buttons();
        let permit = self.safety.advance(now, self.operator.is_held());
        self.advance_trial(now, &permit);
        let input = self.input(&permit, due.skipped);
        let output = self.control.step(permit.mode, &input);
        self.watch_step(now, &permit, &input, &output);

        let targets = self.command_drives(sync_at, &permit, &output);
        self.send_services(now, sync_at);
        self.wire.read_transmit_confirmation();
        let side = self.remote_side.state(sync_at);
        let gripper = self.operator.gripper_command(&permit, self.remote_side.newest.gripper());
        let command =
            Command { motion: output.command, gripper: gripper.and_then(|it| it.command) };
        self.remote_side.exchange(now, &command, self.safety.mode());

        self.timing.end_cycle();
        let record = self.record(now, sync_at, &input, &side, output, targets);
        Record { refused_press, gripper, ..record }
    }

    /// Raises these causes in order. Each step raises its causes at its end, because the next step needs the mode they
    /// lead to.
    pub(super) fn raise(&mut self, at: Instant, causes: impl IntoIterator<Item = Option<Cause>>) {
        for cause in causes.into_iter().flatten() {
            self.safety.raise(at, cause);
        }
    }

    /// Watches the loop and the SYNC of the previous cycle, when a cycle starts after `skipped` SYNC slots.
    fn watch_start(&mut self, skipped: u64) {
        let (now, suspended) = (self.wire.now(), self.wire.suspended());
        let [resumed, late] = self.timing.watch_start(now, suspended, skipped);
        let unconfirmed = self.wire.watch_transmit_confirmation();
        self.raise(now, [resumed, late, unconfirmed]);
    }

    /// Watches the samples of this cycle, and the age of event-driven ones.
    fn watch_samples(&mut self, now: Instant, sync_at: Instant) {
        self.watch_stall(sync_at);
        let missing = self.samples.end_window(now);
        let deadman = self.operator.update(now, self.samples.inputs(now));
        let link = self.remote_side.newest.lost(now);
        let far_side = self.remote_side.cause(self.safety.mode());
        let gripper =
            self.operator.watch_gripper(now, self.samples.inputs(now), self.samples.analogue(now));
        self.watch_zeros(now);
        self.raise(now, [missing, deadman, link, far_side, gripper]);
    }

    /// Watches that every drive is enabled; `Boot` then ends in `Ready`. Raises apart from the samples' causes, because the
    /// allowed statuswords depend on the mode after them. Reads the error history (1003h) of a drive that stopped the node.
    fn watch_drives(&mut self, now: Instant) {
        let Some((joint, statusword)) = self.not_enabled() else {
            if self.samples.is_complete() && self.proof_test.is_done() {
                self.safety.on_drives_enabled(now);
            }
            return;
        };
        let before = self.cause();
        let cause = self.safety.watch_enabled(now, joint, statusword);
        self.raise(now, [cause]);
        if before != self.cause() {
            self.network.master.read_error_history(now, joint.into(), &mut self.wire.out);
        }
    }

    /// Watches the controller, the operator, the arm, and the samples against the model.
    fn watch_step(&mut self, now: Instant, permit: &Permit, input: &Input, output: &Output) {
        let controller = output.invalid_value.as_ref().and_then(causes::of_controller);
        let held = park::cause(output, self.rest.kinds());
        let fresh = self.samples.fresh();
        let operator = self.operator.check(now, permit, output, input.restart, &fresh);
        let weight = match permit.gravity_share {
            // A joint that something blocks is no frozen encoder.
            _ if permit.hold || permit.trial => Weight::TakenOver,
            1.0.. => Weight::Carried,
            _ if permit.gravity_ramps_up => Weight::TakenOver,
            _ => Weight::NotCarried,
        };
        let known = self.zeros.known();
        let samples = self.plausibility.check(&self.samples.sampled(), output, weight, &known);
        self.keep_off_unfollowing(samples);
        let beyond = self.operator.check_limit(permit, samples);
        self.zeros.verify(now, &output.q);
        let unknown = self.unknown_zero();
        self.raise(now, [controller, operator, beyond, samples, held, unknown]);
    }

    /// Keeps off a drive that does not take its targets, or whose torque does not follow the zero torque of a stop. This
    /// does not wait for the end of the stop.
    pub(super) fn keep_off_unfollowing(&mut self, cause: Option<Cause>) {
        let is_stopping = self.safety.mode() == Mode::ZeroTorque;
        if let Some(joint) = cause.and_then(|cause| cause.unfollowing(is_stopping)) {
            self.drives.power.keep_off(joint);
        }
    }

    /// Returns the first joint whose drive should be enabled and is not, with its statusword.
    pub(super) fn not_enabled(&self) -> Option<(Joint, u16)> {
        let joints = Joint::each(self.samples.latest());
        let (joint, sample) = joints
            .filter(|(joint, _)| self.mode_check.is_enabling(*joint))
            .find(|(_, sample)| sample.statusword.state() != Some(State::OperationEnabled))?;
        Some((joint, sample.statusword.0))
    }

    /// Takes the adjustments of the buttons pressed in this cycle; returns the last that was refused.
    fn press_buttons(&mut self) -> Option<RefusedPress> {
        let pressed = self.operator.pressed_adjustments();
        pressed.filter_map(|button| self.control.press(button).err()).last()
    }

    /// Returns the input of the controller, which restarts after a gap, and when a zero was set.
    fn input(&mut self, permit: &Permit, skipped: u64) -> Input {
        let counts = self.zeros.counts(self.samples.latest());
        let restart = self.timing.follows_gap(skipped) || self.zeros.take_shifted();
        self.control.input(counts, &self.remote_side.newest, &self.operator, permit, restart)
    }

    /// Returns the push of each drive, if the target torques are zero. Before the end of the proof test it is excluded.
    fn pushes(&self) -> [Push; 6] {
        let has_timer = self.proof_test.has_rpdo_timer();
        let torques = self.plausibility.torques_at_zero();
        Joint::ALL.map(|joint| {
            let statusword = joint.entry(self.samples.latest()).statusword;
            let is_excluded = !self.proof_test.is_done()
                || *joint.entry(&has_timer)
                || !may_apply_torque(statusword);
            if is_excluded { Push::Excluded } else { Push::from_torque(*joint.entry(&torques)) }
        })
    }

    fn record(
        &self,
        now: Instant,
        sync_at: Instant,
        input: &Input,
        side: &SideState,
        output: Output,
        targets: [PerMille; 6],
    ) -> Record {
        Record {
            cycle: self.timing.cycle,
            at: sync_at,
            mode: self.safety.mode(),
            cause: self.safety.cause(),
            overruns: self.timing.lateness.overruns(),
            times: self.timing.readings.times(
                sync_at,
                self.samples.received_at(),
                self.wire.transmission.confirmed_at(),
            ),
            sampled: self.samples.fresh(),
            has_switch_box: self.operator.enable_state().is_some(),
            inputs: self.samples.inputs(now).map(|inputs| inputs.bits()),
            f_s: input.f_s,
            x_b_m: input.x_b_m,
            sample_age: side.sample_age,
            q_r: side.q_r,
            model: side.model,
            gripper: None,
            refused_press: None,
            output,
            targets: targets.map(|PerMille(target)| target),
            trial: self.trials.status(),
            not_off: self.power_off.not_off(),
            pushes: self.pushes(),
            counts: self.samples.latest().map(|sample| sample.position),
            zeros: *self.zeros.states(),
            sdo: SdoCounters {
                foreign_uploads: self.network.master.foreign_uploads(),
                unread_settings: self.proof_test.unread(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cause::CauseKind;
    use crate::silent_bus::node;
    use bus::SendError;
    use canopen::frame::{Channel, Frame, Telegram};

    #[test]
    fn sync_comes_first_and_once_a_period() {
        let mut node = node();
        let mut syncs = Vec::new();
        for _ in 0..20 {
            let from = node.bus().sent.len();
            let record = node.cycle();
            let (at, first) = node.bus().sent[from];
            assert_eq!((first.frame.cob_id, at), (0x80, record.at));
            syncs.push(at);
        }
        let apart = |pair: &[Instant]| pair[1].since(pair[0]);
        assert!(syncs.windows(2).all(|pair| apart(pair) == node.timing.period), "{syncs:?}");
        let count = node.bus_mut().identifiers().into_iter().filter(|cob_id| *cob_id == 0x80);
        assert_eq!(count.count(), 20);
    }

    #[test]
    fn rates_start_at_zero_after_every_boot() {
        let mut node = node();
        let mut moved = Vec::new();
        let mut last = node.bus().now;
        for (counts, boots) in [(0_i32, true), (50, false), (100_000, true), (100_000, false)] {
            if boots {
                node.samples.restart();
                last = node.bus().now;
                node.timing.restart(last);
            }
            let sampled = last + node.timing.period + node.timing.period / 10;
            // Actual position of joint 1.
            let frame = Frame::new(0x181, counts.to_le_bytes());
            let telegram = Telegram { channel: Channel(0), frame };
            node.bus_mut().received.push((sampled, telegram));
            let record = node.cycle();
            last = record.at;
            assert_eq!(record.sampled, [true, false, false, false, false, false]);
            moved.push(record.output.twist.v_g_raw.angular.norm() > 1e-9);
        }
        assert_eq!(moved, [false, true, false, false]);
    }

    #[test]
    fn first_raised_cause_is_kept() {
        let (late, resumed) = (Cause::Late, Cause::Suspended);
        for (causes, first) in [([None, Some(late)], late), ([Some(resumed), Some(late)], resumed)]
        {
            let mut node = node();
            node.raise(Instant::ZERO, causes);
            assert_eq!(node.cause(), Some(first));
            node.raise(Instant::ZERO, [Some(Cause::ForeignMaster)]);
            assert_eq!(node.cause(), Some(first), "raised later");
        }
    }

    #[test]
    fn unarmed_node_sends_zero_torque_after_each_sync() {
        let mut node = node();
        for _ in 0..10 {
            let record = node.cycle();
            assert_eq!(record.targets, [0; 6]);
            let sent: Vec<_> = node.bus_mut().sent.drain(..).collect();
            for cob_id in [0x201, 0x204] {
                let frames = sent.iter().filter(|(_, telegram)| telegram.frame.cob_id == cob_id);
                let data: Vec<_> = frames.map(|(_, telegram)| telegram.frame.data()).collect();
                assert_eq!(data, [[0; 6]], "{cob_id:03X}h");
            }
        }
    }

    #[test]
    fn missing_samples_stop_the_node_in_the_third_cycle() {
        let mut node = node();
        let causes: Vec<_> = (0..4).map(|_| node.cycle().cause.map(|cause| cause.kind())).collect();
        let missing = Some(CauseKind::SamplesMissing);
        assert_eq!(causes, [None, None, missing, missing]);
    }

    #[test]
    fn sync_window_leaves_time_for_the_targets() {
        let mut node = node();
        let record = node.cycle();
        let targets = node.bus().sent.iter().find(|(_, telegram)| telegram.frame.cob_id == 0x201);
        let after = targets.unwrap().0.since(record.at);
        // Two RPDOs of six bytes follow: 115 bits each at 1 Mbit/s.
        assert!(after + std::time::Duration::from_micros(230) <= node.timing.period, "{after:?}");
    }

    #[test]
    fn stall_of_eight_periods_stops_the_node() {
        let mut node = node();
        node.cycle();
        node.bus_mut().stall = node.timing.period * 8;
        let record = node.cycle();
        assert_eq!(record.cause.map(|cause| cause.kind()), Some(CauseKind::Overrun));
    }

    #[test]
    fn stall_after_sync_stops_the_node_in_the_same_cycle() {
        let mut node = node();
        node.cycle();
        node.bus_mut().stall_after_sync = node.timing.period * 8;
        let record = node.cycle();
        assert_eq!(record.cause.map(|cause| cause.kind()), Some(CauseKind::Overrun));
    }

    #[test]
    fn cycle_sends_the_heartbeat() {
        let mut node = node();
        (0..50).for_each(|_| _ = node.cycle());
        assert!(node.bus_mut().identifiers().contains(&0x77F));
    }

    #[test]
    fn full_transmit_queue_stops_and_shuts_the_bus_in_two_cycles() {
        let mut node = node();
        node.bus_mut().refuses = Some(SendError::Full);
        let first = node.cycle();
        assert_eq!(first.cause.map(|cause| cause.kind()), Some(CauseKind::QueueFull));
        node.cycle();
        node.bus_mut().refuses = None;
        let last = node.cycle();
        assert_eq!((last.mode, node.bus().sent.len()), (Mode::DrivesOff, 0));
    }
}
