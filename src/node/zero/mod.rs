//! Zero of each joint: known or unknown, and why (`[[joint]] zero`, docs/zero.md).
//!
//! ```text
//!  boot, reboot, lost heartbeat, missing samples, 73xxh, jump, bit of 6041h cleared
//!          │
//!          ▼           ctl zero, at rest                     second rest position read
//!       unknown ──────────────────────────► not verified ──────────────────────────────► known
//!          │                                                                               ▲
//!          ├── ctl zero, at rest: no second rest position ─────────────────────────────────┤
//!          └── arm, at rest: single-turn, or homing whose bit of 6041h is set ─────────────┘
//! ```
//!
//! A joint whose zero is unknown forbids arming. The zero is a shift of the counts; raw positions, their filters and the
//! recorded frames are not changed by it. Counts kept on disk would not help: a drive that was switched off, moved and
//! switched on looks like the arm in its cradle (ADR 49).

mod refusal;
mod request;
mod standstill;
mod unknown;
mod watch;

pub use refusal::{MOVING, Moving, ZeroError};
pub use unknown::{UnknownZero, UnknownZeros, ZeroState};

use std::time::Duration;

use crate::zero::standstill::Standstill;
use canopen::drive::Statusword;
use canopen::frame::{Channel, Telegram};
use canopen::master::event::Event;
use canopen::nmt::heartbeat_cob_id;
use canopen::pdo::DriveSample;
use config::zero::{Homing, ZeroSource};
use config::zeroing::Zeroing;
use config::{Config, JointParameters};
use controller::JointVector;
use controller::arm::JointKind;
use units::drive::Counts;
use units::numbering::Joint;
use units::time::Instant;

/// Standstill that precedes the setting of a zero, and its verification.
const STANDSTILL_TIME: Duration = Duration::from_secs(1);

/// Maximum motion of a revolute joint during its homing, in rad: 0.3°.
const MAX_HOMING_ROTATION: f64 = 0.3_f64.to_radians();

/// Maximum motion of a prismatic joint during its homing, in m.
const MAX_HOMING_TRAVEL: f64 = 5e-4;

/// Error codes of a sensor of the drive: 73xxh (CiA 402-2, 301).
const SENSOR_ERRORS: u16 = 0x73;

/// Zeros of all joints.
#[derive(Clone, Debug)]
pub(super) struct Zeros {
    zeroing: Zeroing,
    states: [ZeroState; 6],
    /// Numbers to add to the counts of each drive; wrap.
    shifts: [i32; 6],
    standstill: Standstill,
    /// Bus and boot-up COB-ID of each drive.
    boot_ups: [(Channel, u16); 6],
    /// Boot-up messages of each drive in this boot: one answers the node's own reset.
    booted: [u32; 6],
    /// Motion of each joint that ends a homing, in counts.
    max_motion: [u32; 6],
    /// Set if each boot resets the whole node (81h).
    resets_nodes: bool,
    /// Set if every drive keeps its zero: then nothing is watched.
    are_absolute: bool,
    /// Set if a shift has changed since the last cycle: positions step without a motion.
    has_shifted: bool,
}

impl Zeros {
    /// Returns the zeros before the first boot.
    pub(super) fn new(config: &Config) -> Self {
        let zeroing = Zeroing::new(config);
        let states = Joint::ALL.map(|joint| match zeroing.zero(joint).source {
            ZeroSource::Absolute => ZeroState::Known,
            ZeroSource::SingleTurn { .. } | ZeroSource::Rest | ZeroSource::Homing(_) => {
                ZeroState::Unknown(UnknownZero::NotSet)
            }
        });
        let joints = config.joints.each_ref();
        Self {
            states,
            shifts: [0; 6],
            standstill: Standstill::new(config),
            boot_ups: joints.map(|joint| (joint.channel, heartbeat_cob_id(joint.node))),
            booted: [0; 6],
            max_motion: joints.map(max_motion),
            resets_nodes: config.restores_defaults,
            are_absolute: Joint::ALL.iter().all(|joint| zeroing.zero(*joint).source.is_absolute()),
            zeroing,
            has_shifted: false,
        }
    }

    /// Returns the state of each joint's zero.
    pub(super) const fn states(&self) -> &[ZeroState; 6] {
        &self.states
    }

    /// Returns the joints whose zero is known.
    pub(super) fn known(&self) -> [bool; 6] {
        self.states.map(|state| state == ZeroState::Known)
    }

    /// Returns the counts of the newest samples, shifted to the zeros.
    pub(super) fn counts(&self, samples: &[DriveSample; 6]) -> [Counts; 6] {
        shifted(samples, &self.shifts)
    }

    /// Returns whether positions step in the next cycle because a zero was set.
    pub(super) const fn has_shifted(&self) -> bool {
        self.has_shifted
    }

    /// Returns whether positions have stepped since the last call because a zero was set.
    pub(super) const fn take_shifted(&mut self) -> bool {
        std::mem::replace(&mut self.has_shifted, false)
    }

    /// Marks the zero of a joint as unknown, unless its drive is absolute. The first reason is kept.
    pub(super) fn lose(&mut self, joint: Joint, why: UnknownZero) {
        let state = joint.entry_mut(&mut self.states);
        let is_lost = matches!(state, ZeroState::Unknown(why) if *why != UnknownZero::NotVerified);
        if !is_lost && !self.zeroing.zero(joint).source.is_absolute() {
            *state = ZeroState::Unknown(why);
        }
    }

    /// Marks the zeros as unknown that a boot loses. A node that `is_watching` its drives may reset their communication
    /// (82h) without the loss of a zero, if the drive keeps it (`keeps_position_over_82h`).
    pub(super) fn on_boot(&mut self, is_watching: bool) {
        for joint in Joint::ALL {
            let keeps = self.zeroing.zero(joint).keeps_position_over_82h && !self.resets_nodes;
            if !(is_watching && keeps) {
                self.lose(joint, UnknownZero::Reset);
            }
        }
        self.standstill.restart();
        self.booted = [0; 6];
    }

    /// Takes a frame of a boot. A second boot-up message is of a drive that has rebooted by itself.
    pub(super) fn on_boot_frame(&mut self, Telegram { channel, frame }: &Telegram) {
        let is_of = |(on, cob_id): (Channel, u16)| on == *channel && cob_id == frame.cob_id;
        let Some((joint, _)) = Joint::each(self.boot_ups).find(|(_, of)| is_of(*of)) else {
            return;
        };
        if frame.data() != [0] {
            return;
        }
        let booted = joint.entry_mut(&mut self.booted);
        *booted = booted.saturating_add(1);
        if *booted > 1 {
            self.lose(joint, UnknownZero::Rebooted);
        }
    }

    /// Takes an event of the master; returns the joint whose position it makes doubtful.
    pub(super) fn on_event(&mut self, event: &Event) -> Option<Joint> {
        let (node, why) = if let Event::Rebooted { node } = event {
            (*node, UnknownZero::Rebooted)
        } else if let Event::HeartbeatLost { node } = event {
            (*node, UnknownZero::HeartbeatLost)
        } else {
            let (Event::Emergency { node, emergency }
            | Event::EmergencyWarning { node, emergency }) = event
            else {
                return None;
            };
            let code = emergency.code;
            (code >> 8 == SENSOR_ERRORS).then_some((*node, UnknownZero::SensorFault { code }))?
        };
        let joint = node.joint()?;
        self.lose(joint, why);
        Some(joint)
    }

    /// Watches the samples of a cycle, where a zero may be set or lost: standstill, and the bit by which a drive says that it knows its home.
    pub(super) fn on_samples(
        &mut self,
        now: Instant,
        samples: &[DriveSample; 6],
        fresh: &[bool; 6],
    ) {
        if self.are_absolute {
            return;
        }
        self.standstill.on_samples(now, samples, fresh);
        for (joint, sample) in Joint::each(samples) {
            if let Some(false) = self.is_referenced(joint, sample.statusword) {
                self.lose(joint, UnknownZero::NotReferenced);
            }
        }
    }

    /// Returns whether a drive says that it knows its home; `None` without a bit for it.
    pub(super) fn is_referenced(&self, joint: Joint, Statusword(word): Statusword) -> Option<bool> {
        let bit = self.homing(joint)?.referenced_bit?;
        Some(word >> bit & 1 == 1)
    }

    /// Returns the time allowed for the homing of a joint.
    pub(super) fn homing_timeout(&self, joint: Joint) -> Duration {
        self.homing(joint).map_or(Duration::ZERO, |homing| homing.timeout)
    }

    /// Returns the counts that 6064h reads at home.
    pub(super) fn home_counts(&self, joint: Joint) -> i32 {
        self.zeroing.rest_counts(joint).0
    }

    /// Returns whether a drive that read `before` reads the same, or its home.
    pub(super) fn is_still_or_home(&self, joint: Joint, before: i32, found: i32) -> bool {
        let is_near =
            |to: i32| found.wrapping_sub(to).unsigned_abs() <= *joint.entry(&self.max_motion);
        is_near(before) || is_near(self.home_counts(joint))
    }

    fn homing(&self, joint: Joint) -> Option<Homing> {
        match self.zeroing.zero(joint).source {
            ZeroSource::Homing(homing) => Some(homing),
            ZeroSource::Absolute | ZeroSource::SingleTurn { .. } | ZeroSource::Rest => None,
        }
    }

    /// Ends the verification of joints that read their second rest position at `q`, in rad or m, at rest, all tied ones at once. A
    /// joint with a wrong scale passes that reading on its way.
    pub(super) fn verify(&mut self, now: Instant, q: &JointVector) {
        let awaits = |state: ZeroState| state == ZeroState::Unknown(UnknownZero::NotVerified);
        if !self.states.iter().copied().any(awaits) {
            return;
        }
        let zeroing = &self.zeroing;
        let is_there = Joint::ALL.map(|joint| {
            let q = q.iter().nth(joint.index()).copied().unwrap_or(f64::NAN);
            let is_at_rest = self.standstill.time(joint, now) >= STANDSTILL_TIME;
            zeroing.second_rest(joint).is_none_or(|rest| is_at_rest && rest.contains(q))
        });
        for (joint, state) in Joint::each(&mut self.states) {
            if !awaits(*state) {
                continue;
            }
            let group = Joint::each(zeroing.group(joint));
            if group.filter(|(_, is_in)| *is_in).all(|(tied, _)| *tied.entry(&is_there)) {
                *state = ZeroState::Known;
            }
        }
    }

    /// Returns the joints whose zero an arming in the rest posture sets.
    pub(super) fn set_by_arming(&self, samples: &[DriveSample; 6]) -> [bool; 6] {
        Joint::ALL.map(|joint| {
            let is_unknown = matches!(
                joint.entry(&self.states),
                ZeroState::Unknown(why) if *why != UnknownZero::NotVerified
            );
            let is_selected = match self.zeroing.zero(joint).source {
                ZeroSource::SingleTurn { .. } => true,
                ZeroSource::Homing(_) => {
                    self.is_referenced(joint, joint.entry(samples).statusword) == Some(true)
                }
                ZeroSource::Absolute | ZeroSource::Rest => false,
            };
            is_unknown && is_selected && !self.has_second_rest(joint)
        })
    }

    fn has_second_rest(&self, joint: Joint) -> bool {
        self.zeroing.second_rest(joint).is_some()
    }

    /// Returns the shifts with those of `joints` by the rest posture.
    fn shifts_of(&self, joints: &[bool; 6], samples: &[DriveSample; 6]) -> [i32; 6] {
        Joint::ALL.map(|joint| {
            if *joint.entry(joints) {
                self.zeroing.shift(joint, joint.entry(samples).position)
            } else {
                *joint.entry(&self.shifts)
            }
        })
    }

    /// Returns the joint positions, in rad or m, with the zeros of `joints` set by the rest posture.
    pub(super) fn positions_with(
        &self,
        joints: &[bool; 6],
        samples: &[DriveSample; 6],
    ) -> JointVector {
        self.zeroing.positions(&shifted(samples, &self.shifts_of(joints, samples)))
    }

    /// Sets the zeros of `joints` by the rest posture.
    pub(super) fn set(&mut self, joints: &[bool; 6], samples: &[DriveSample; 6]) {
        let shifts = self.shifts_of(joints, samples);
        self.has_shifted |= shifts != self.shifts;
        self.shifts = shifts;
        for (joint, _) in Joint::each(joints).filter(|(_, is_set)| **is_set) {
            let is_verified = !self.has_second_rest(joint);
            *joint.entry_mut(&mut self.states) = if is_verified {
                ZeroState::Known
            } else {
                ZeroState::Unknown(UnknownZero::NotVerified)
            };
        }
    }
}

/// Returns the motion of a joint that ends its homing, in counts.
fn max_motion(joint: &JointParameters) -> u32 {
    joint.calibration.span(match joint.plant.link.kind {
        JointKind::Revolute => MAX_HOMING_ROTATION,
        JointKind::Prismatic => MAX_HOMING_TRAVEL,
    })
}

fn shifted(samples: &[DriveSample; 6], shifts: &[i32; 6]) -> [Counts; 6] {
    Joint::ALL.map(|joint| {
        let Counts(counts) = joint.entry(samples).position;
        Counts(counts.wrapping_add(*joint.entry(shifts)))
    })
}
