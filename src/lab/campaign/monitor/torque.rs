//! What torques the node asks for: I1 to I4, and I11.

use std::time::Duration;

use crate::campaign::monitor::law::Breaches;
use crate::campaign::monitor::law::Law;
use crate::campaign::monitor::sheet::Sheet;
use canopen::exchange::Told as Heard;
use config::switch_inputs::Deadman;
use config::switch_inputs::SwitchInputs;
use units::numbering::Joint;
use units::time::Instant;

/// What was felt may take so long to end when the deadman opens.
const LETS_GO: Duration = Duration::from_millis(20);

/// The weight of the arm may be laid down by a ramp of this length when a person asks for it.
const LAYS_DOWN: Duration = Duration::from_millis(50);

/// Carrying the arm is known to within this share of capacity: friction is not carried, tools are.
const UNKNOWN: f64 = 0.1;

/// So many in a row are more than a position that jumped for the judge and was refused by the node.
const IN_A_ROW: u32 = 3;

/// What carries each joint, in N·m (N), and whether it is near an end of its range.
type Weight = ([f64; 6], [bool; 6]);

/// What is known of the torques.
#[derive(Clone, Debug)]
pub(super) struct Torque {
    told: [i16; 6],
    /// When that was given away.
    told_at: [Option<Instant>; 6],
    /// Since when each joint is told zero.
    zero_since: [Option<Instant>; 6],
    /// When it was last torn from a torque to none, faster than it may change.
    torn: [Option<Instant>; 6],
    cycle: u64,
    counts: [i32; 6],
    /// What carries the arm, and who is near an end of its range; of which cycle.
    weight: Option<(u64, Weight)>,
    /// Targets in a row that are more than the weight.
    heavy: [u32; 6],
    /// The deadman as the switch box tells it, and since when it is open.
    deadman: Option<Deadman>,
    open_since: Option<Instant>,
    /// It was seen open since arming: only then does closing it mean anything.
    has_edge: bool,
    state: State,
    /// Targets that were not zero although nothing is armed.
    pub(super) unarmed: u64,
}

/// What the console and the node have said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nothing is armed, and torque has ended by then.
    Idle(Instant),
    /// Armed.
    Armed,
    /// The node says since then that it has stopped.
    Tripped(Instant),
}

impl Torque {
    pub(super) const fn new() -> Self {
        Self {
            told: [0; 6],
            told_at: [None; 6],
            zero_since: [Some(Instant::ZERO); 6],
            torn: [None; 6],
            cycle: 0,
            counts: [0; 6],
            weight: None,
            heavy: [0; 6],
            deadman: None,
            open_since: Some(Instant::ZERO),
            has_edge: false,
            state: State::Idle(Instant::ZERO),
            unarmed: 0,
        }
    }

    /// A SYNC of the node's on the first bus.
    pub(super) const fn on_sync(&mut self) {
        self.cycle += 1;
    }

    /// A TPDO: where a drive is, or what the switches are.
    pub(super) fn on_tpdo(&mut self, at: Instant, heard: &Heard) {
        if let Some((joint, position)) = heard.node.joint().zip(heard.position) {
            *joint.entry_mut(&mut self.counts) = position.0;
        }
        if let Some(inputs) = heard.inputs.map(SwitchInputs::from_bits) {
            let deadman = inputs.deadman();
            match deadman {
                Deadman::Pressed if self.state == State::Armed => self.open_since = None,
                Deadman::Pressed => {}
                Deadman::Released => {
                    self.has_edge = true;
                    self.open_since.get_or_insert(at);
                }
                Deadman::Disagreeing => _ = self.open_since.get_or_insert(at),
            }
            self.deadman = Some(deadman);
        }
    }

    /// The console was told that it is armed. I4: not with a closed deadman.
    pub(super) fn armed(&mut self, at: Instant, breaches: &mut Breaches) {
        if self.deadman != Some(Deadman::Released) {
            breaches.add(Law::Latched, at, "armed although the deadman is not open".to_owned());
        }
        if matches!(self.state, State::Tripped(_)) {
            breaches.add(Law::Latched, at, "armed after a trip without a reset".to_owned());
        }
        self.go_on();
    }

    /// A reset has led back to carrying the arm.
    pub(super) const fn go_on(&mut self) {
        self.state = State::Armed;
        self.has_edge = matches!(self.deadman, Some(Deadman::Released));
        self.torn = [None; 6];
    }

    /// A person has asked for the end of torque: the weight of the arm is laid down, nothing else is felt.
    pub(super) fn idle(&mut self, at: Instant) {
        match self.state {
            State::Armed => self.state = State::Idle(at + LAYS_DOWN),
            State::Tripped(_) => self.state = State::Idle(at),
            State::Idle(_) => {}
        }
        self.open_since.get_or_insert(at);
        self.torn = [None; 6];
    }

    /// The node says that it has stopped.
    pub(super) const fn tripped(&mut self, at: Instant) {
        if !matches!(self.state, State::Tripped(_)) {
            self.state = State::Tripped(at);
        }
    }

    /// A target on the wire at `at` that was given away at `since`, in ‰ of rated torque.
    /// `is_off` is that its drive says it acts on none.
    pub(super) fn on_target(
        &mut self,
        sheet: &Sheet,
        (at, since): (Instant, Instant),
        ((joint, target), is_off): ((Joint, i16), bool),
        breaches: &mut Breaches,
    ) {
        let bounds = joint.entry(&sheet.joints);
        let before = std::mem::replace(joint.entry_mut(&mut self.told), target);
        let size = target.unsigned_abs();
        if size > bounds.cap.unsigned_abs() {
            let what = format!("joint {joint} is told {target} of {} per mille", bounds.cap);
            breaches.add(Law::Cap, at, what);
        }
        let is_same_way = before.signum() == target.signum();
        let from = if is_same_way { before } else { 0 };
        // A cycle whose targets did not get out counts as well.
        let told_at = joint.entry_mut(&mut self.told_at).replace(since);
        let half = sheet.period / 2;
        let is_second = told_at.is_some_and(|told_at| since.since(told_at) > sheet.period + half);
        let cycles = if is_second { 2.0 } else { 1.0 };
        let may_grow = cycles * bounds.growth + 2.0 * bounds.resolution();
        let is_growth = size > from.unsigned_abs();
        if is_growth && bounds.torque(target) - bounds.torque(from) > may_grow {
            let what = format!("joint {joint}: from {before} to {target} per mille");
            breaches.add(Law::Slew, at, what);
        }
        let is_torn =
            target == 0 && bounds.torque(before) > 2.5 * bounds.growth + 2.0 * bounds.resolution();
        self.note((at, since), joint, target == 0, is_torn);
        // What an adapter held back comes out at last, and moves no drive that is off.
        if target != 0 && !is_off {
            self.judge(sheet, since, (joint, target), breaches);
        }
    }

    fn note(
        &mut self,
        (at, given): (Instant, Instant),
        joint: Joint,
        is_zero: bool,
        is_torn: bool,
    ) {
        if is_torn {
            *joint.entry_mut(&mut self.torn) = Some(given);
        }
        let since = joint.entry_mut(&mut self.zero_since);
        *since = is_zero.then(|| since.unwrap_or(at));
    }

    /// Whether a target that is not zero might be given away at `at`.
    fn judge(
        &mut self,
        sheet: &Sheet,
        at: Instant,
        (joint, target): (Joint, i16),
        breaches: &mut Breaches,
    ) {
        match self.state {
            State::Idle(since) if at > since + sheet.period => {
                self.unarmed += 1;
                let what = format!("joint {joint} is told {target} per mille, not armed");
                breaches.add(Law::Permitted, at, what);
            }
            State::Tripped(since) if at > since + sheet.period => {
                self.unarmed += 1;
                let what = format!("joint {joint} is told {target} per mille after a trip");
                breaches.add(Law::Latched, at, what);
            }
            State::Armed | State::Idle(_) if !self.is_held(at, sheet.period) => {
                let (weight, ends) = self.weight(sheet);
                if *joint.entry(&ends) {
                    return;
                }
                let (bounds, weight) = (joint.entry(&sheet.joints), joint.entry(&weight));
                let most = weight.abs() + UNKNOWN * bounds.capacity();
                let is_heavy = bounds.torque(target) > most;
                let heavy = joint.entry_mut(&mut self.heavy);
                *heavy = if is_heavy { *heavy + 1 } else { 0 };
                if *heavy >= IN_A_ROW {
                    let what = format!(
                        "joint {joint} is told {target} per mille, and only {weight:.3} N·m (N) carry it"
                    );
                    breaches.add(Law::Permitted, at, what);
                }
            }
            State::Idle(_) | State::Armed | State::Tripped(_) => {}
        }
        if let Some(torn) = self.torn.iter().flatten().max()
            && at > *torn + sheet.period * 3 / 2
        {
            let what =
                format!("joint {joint} is told {target} per mille, and another was torn off");
            breaches.add(Law::Together, at, what);
        }
    }

    fn weight(&mut self, sheet: &Sheet) -> Weight {
        let known = self.weight.filter(|(cycle, _)| *cycle == self.cycle);
        let (_, weight) = known.unwrap_or_else(|| (self.cycle, sheet.weight(&self.counts)));
        self.weight = Some((self.cycle, weight));
        weight
    }

    /// Whether somebody holds the deadman, or let it go so lately that what was felt may still end.
    fn is_held(&self, at: Instant, period: Duration) -> bool {
        let has_let_go = |since: Instant| at.since(since) > LETS_GO + period * 2;
        self.has_edge && !self.open_since.is_some_and(has_let_go)
    }

    /// Since when every joint is told zero, if it is.
    pub(super) fn all_zero_since(&self) -> Option<Instant> {
        let since = self.zero_since.iter().copied().collect::<Option<Vec<_>>>()?;
        since.into_iter().max()
    }

    /// Cycles between the first and the last joint that was torn from a torque to none.
    pub(super) fn spread(&self, period: Duration) -> Option<u64> {
        let torn = || self.torn.iter().flatten();
        let apart = torn().max()?.since(*torn().min()?) + period / 2;
        u64::try_from(apart.as_micros() / period.as_micros().max(1)).ok()
    }

    /// The largest share of a capacity that is told, 0 to 1.
    pub(super) fn peak(&self, sheet: &Sheet) -> f64 {
        let shares = self.told.iter().zip(&sheet.joints);
        let shares = shares.map(|(told, joint)| f64::from(*told).abs() / f64::from(joint.cap));
        shares.fold(0.0, f64::max)
    }
}
