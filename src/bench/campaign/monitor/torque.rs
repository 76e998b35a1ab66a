//! Target torques: I1 to I4, and I11.

use std::time::Duration;

use crate::monitor::invariant::{Invariant, Moment};
use crate::monitor::sheet::Sheet;
use canopen::exchange::TpdoSample;
use config::switch_inputs::{Contacts, SwitchInputs};
use units::numbering::Joint;
use units::time::Instant;

/// Time in which reflection may end after the deadman opens.
const RELEASE_TIME: Duration = Duration::from_millis(20);

/// Maximum time of the ramp of gravity compensation to zero after disarming.
const RAMP_DOWN: Duration = Duration::from_millis(50);

/// Uncertainty of the arm's weight, as a share of capacity: friction and tools.
const WEIGHT_UNCERTAINTY: f64 = 0.1;

/// Targets in a row that violate I3: fewer may come from a position that the node discards and the monitor does not.
const MIN_HEAVY: u32 = 3;

/// Torque that carries each joint, in N·m (N), and whether it is near an end of its range.
type Weight = ([f64; 6], [bool; 6]);

/// Targets of all joints.
#[derive(Clone, Debug)]
pub(super) struct Torque {
    /// Last target of each joint.
    targets: [i16; 6],
    /// Time at which it was sent.
    sent_at: [Option<Instant>; 6],
    /// Time since which each target is zero.
    zero_since: [Option<Instant>; 6],
    /// Time at which a torque was last cut to zero, faster than its slew rate.
    cut: [Option<Instant>; 6],
    cycle: u64,
    counts: [i32; 6],
    /// Torques that carry the arm, and the cycle for which they were computed.
    weight: Option<(u64, Weight)>,
    /// Number of targets in a row that exceed the weight.
    heavy: [u32; 6],
    /// Deadman as the switch box reports it, and the time since which it is open.
    deadman: Option<Contacts>,
    open_since: Option<Instant>,
    /// Set if the deadman was open since arming: only then may closing it engage.
    has_edge: bool,
    state: State,
    /// Number of non-zero targets without arming.
    pub(super) unarmed: u64,
}

/// State of the node by its console and its mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Not armed; torque has ended by this time.
    Disarmed(Instant),
    /// Armed by the console, and not stopped since.
    Armed,
    /// Stopped since this time.
    Stopped(Instant),
}

impl Torque {
    pub(super) const fn new() -> Self {
        Self {
            targets: [0; 6],
            sent_at: [None; 6],
            zero_since: [Some(Instant::ZERO); 6],
            cut: [None; 6],
            cycle: 0,
            counts: [0; 6],
            weight: None,
            heavy: [0; 6],
            deadman: None,
            open_since: Some(Instant::ZERO),
            has_edge: false,
            state: State::Disarmed(Instant::ZERO),
            unarmed: 0,
        }
    }

    /// Takes a SYNC on the first bus.
    pub(super) const fn on_sync(&mut self) {
        self.cycle += 1;
    }

    /// Takes a TPDO with a position or with inputs.
    pub(super) fn on_tpdo(&mut self, at: Instant, sample: &TpdoSample) {
        if let Some((joint, position)) = sample.node.joint().zip(sample.position) {
            *joint.entry_mut(&mut self.counts) = position.0;
        }
        if let Some(inputs) = sample.inputs.map(SwitchInputs::from_bits) {
            let deadman = inputs.deadman();
            match deadman {
                Contacts::Pressed if self.state == State::Armed => self.open_since = None,
                Contacts::Pressed => {}
                Contacts::Released => {
                    self.has_edge = true;
                    self.open_since.get_or_insert(at);
                }
                Contacts::Disagreeing => _ = self.open_since.get_or_insert(at),
            }
            self.deadman = Some(deadman);
        }
    }

    /// Takes the arming by the console. I4: not with a closed deadman.
    pub(super) fn on_armed(&mut self, moment: &mut Moment<'_>) {
        if self.deadman != Some(Contacts::Released) {
            moment.violates(Invariant::Latched, "armed although the deadman is not open");
        }
        if matches!(self.state, State::Stopped(_)) {
            moment.violates(Invariant::Latched, "armed after a stop without a reset");
        }
        self.resume();
    }

    /// Takes a reset that leads back to gravity compensation.
    pub(super) const fn resume(&mut self) {
        self.state = State::Armed;
        self.has_edge = matches!(self.deadman, Some(Contacts::Released));
        self.cut = [None; 6];
    }

    /// Takes the disarming by the console: gravity compensation ramps to zero.
    pub(super) fn on_disarmed(&mut self, at: Instant) {
        match self.state {
            State::Armed => self.state = State::Disarmed(at + RAMP_DOWN),
            State::Stopped(_) => self.state = State::Disarmed(at),
            State::Disarmed(_) => {}
        }
        self.open_since.get_or_insert(at);
        self.cut = [None; 6];
    }

    /// Takes a stop of the node.
    pub(super) const fn on_stop(&mut self, at: Instant) {
        if !matches!(self.state, State::Stopped(_)) {
            self.state = State::Stopped(at);
        }
    }

    /// Takes a target on the wire that was sent at `since`, in ‰ of rated torque. `is_off` is set if its drive exerts no
    /// torque.
    pub(super) fn on_target(
        &mut self,
        moment: &mut Moment<'_>,
        since: Instant,
        (joint, target): (Joint, i16),
        is_off: bool,
    ) {
        let (sheet, at) = (moment.sheet, moment.at);
        let bounds = joint.entry(&sheet.joints);
        let before = std::mem::replace(joint.entry_mut(&mut self.targets), target);
        let size = target.unsigned_abs();
        if size > bounds.cap.unsigned_abs() {
            let what = format!("joint {joint}: target {target} exceeds {} per mille", bounds.cap);
            moment.violates(Invariant::Cap, what);
        }
        let is_same_way = before.signum() == target.signum();
        let from = if is_same_way { before } else { 0 };
        // A cycle whose targets were not sent counts as well.
        let sent_at = joint.entry_mut(&mut self.sent_at).replace(since);
        let half = sheet.period / 2;
        let is_second = sent_at.is_some_and(|sent_at| since.since(sent_at) > sheet.period + half);
        let cycles = if is_second { 2.0 } else { 1.0 };
        let may_grow = cycles * bounds.growth + 2.0 * bounds.resolution;
        let is_growth = size > from.unsigned_abs();
        if is_growth && bounds.torque(target) - bounds.torque(from) > may_grow {
            let what = format!("joint {joint}: target from {before} to {target} per mille");
            moment.violates(Invariant::Slew, what);
        }
        let is_cut =
            target == 0 && bounds.torque(before) > 2.5 * bounds.growth + 2.0 * bounds.resolution;
        if target != 0 && self.all_zero_since().is_some() {
            // All six were zero together: targets withdrawn after a stall may rise again.
            self.cut = [None; 6];
        }
        if is_cut {
            *joint.entry_mut(&mut self.cut) = Some(since);
        }
        let zero_since = joint.entry_mut(&mut self.zero_since);
        *zero_since = (target == 0).then(|| zero_since.unwrap_or(at));
        // A frame that an adapter held back moves no drive that is off.
        if target != 0 && !is_off {
            self.check(
                &mut Moment { sheet, at: since, violations: moment.violations },
                joint,
                target,
            );
        }
    }

    /// Checks a non-zero target at the time at which it was sent.
    fn check(&mut self, moment: &mut Moment<'_>, joint: Joint, target: i16) {
        let (sheet, at) = (moment.sheet, moment.at);
        match self.state {
            State::Disarmed(since) if at > since + sheet.period => {
                self.unarmed += 1;
                let what = format!("joint {joint}: target {target} per mille, not armed");
                moment.violates(Invariant::Permitted, what);
            }
            State::Stopped(since) if at > since + sheet.period => {
                self.unarmed += 1;
                let what = format!("joint {joint}: target {target} per mille after a stop");
                moment.violates(Invariant::Latched, what);
            }
            State::Armed | State::Disarmed(_) if !self.is_pressed(at, sheet.period) => {
                let (weight, ends) = self.weight(sheet);
                if *joint.entry(&ends) {
                    return;
                }
                let (bounds, weight) = (joint.entry(&sheet.joints), joint.entry(&weight));
                let most = weight.abs() + WEIGHT_UNCERTAINTY * bounds.capacity;
                let is_heavy = bounds.torque(target) > most;
                let heavy = joint.entry_mut(&mut self.heavy);
                *heavy = if is_heavy { *heavy + 1 } else { 0 };
                if *heavy >= MIN_HEAVY {
                    let what = format!(
                        "joint {joint}: target {target} per mille, with {weight:.3} N·m (N) to carry it"
                    );
                    moment.violates(Invariant::Permitted, what);
                }
            }
            State::Disarmed(_) | State::Armed | State::Stopped(_) => {}
        }
        if let Some(cut) = self.cut.iter().flatten().max()
            && at > *cut + sheet.period * 3 / 2
        {
            let what =
                format!("joint {joint}: target {target} per mille after another was cut to zero");
            moment.violates(Invariant::Together, what);
        }
    }

    fn weight(&mut self, sheet: &Sheet) -> Weight {
        let known = self.weight.filter(|(cycle, _)| *cycle == self.cycle);
        let (_, weight) = known.unwrap_or_else(|| (self.cycle, sheet.weight(&self.counts)));
        self.weight = Some((self.cycle, weight));
        weight
    }

    /// Returns whether the deadman is pressed, or was released less than the release time ago.
    fn is_pressed(&self, at: Instant, period: Duration) -> bool {
        let is_over = |since: Instant| at.since(since) > RELEASE_TIME + period * 2;
        self.has_edge && !self.open_since.is_some_and(is_over)
    }

    /// Returns the time since which every target is zero.
    pub(super) fn all_zero_since(&self) -> Option<Instant> {
        let since = self.zero_since.iter().copied().collect::<Option<Vec<_>>>()?;
        since.into_iter().max()
    }

    /// Returns the cycles between the first and the last joint whose torque was cut to zero.
    pub(super) fn spread(&self, period: Duration) -> Option<u64> {
        let cut = || self.cut.iter().flatten();
        let apart = cut().max()?.since(*cut().min()?) + period / 2;
        u64::try_from(apart.as_micros() / period.as_micros().max(1)).ok()
    }

    /// Returns the largest target as a share of its joint's capacity, 0 to 1.
    pub(super) fn peak(&self, sheet: &Sheet) -> f64 {
        let shares = self.targets.iter().zip(&sheet.joints);
        let shares = shares.map(|(target, joint)| f64::from(*target).abs() / f64::from(joint.cap));
        shares.fold(0.0, f64::max)
    }
}
