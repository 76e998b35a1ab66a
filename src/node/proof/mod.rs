//! Before anything may be armed, every drive shows that it stops by itself when its master does.
//!
//! The drives are enabled at zero torque. First SYNC and RPDOs stay away while the heartbeat goes on, then
//! the heartbeat while they go on; each time every drive that has the timer must take its own power off.
//! Then its fault is reset and it is enabled again. What was measured bounds the force that may be felt:
//! [`ForceCap`].
//!
//! | file     | what                                                |
//! |----------|-----------------------------------------------------|
//! | `mod`    | how far the proof is, and what follows from it      |
//! | `run`    | who stays away, and what is listened to meanwhile   |
//! | `trial`  | one timer of all drives: heard, asked, over         |
//! | `report` | what was found                                      |
//! | `recheck`| what it rests on, read again while the node runs    |

mod recheck;
mod report;
mod run;
mod trial;

pub use report::DriveProof;
pub use report::NoTrip;
pub use report::NotProven;
pub use report::ProofReport;
pub use report::Trip;

use crate::proof::recheck::Recheck;
use crate::proof::trial::Trial;
use canopen::NmtState;
use canopen::emcy::Emergency;
use canopen::error_codes;
use canopen::frame::Channel;
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::object::Object;
use canopen::pdo::DriveSample;
use canopen::plan::NodePlan;
use canopen::watchdog::Awaited;
use canopen::watchdog::Watchdog;
use config::Config;
use config::force_cap::ForceCap;
use config::force_cap::TooMuchForce;
use config::force_cap::UNPROVEN;
use units::numbering::Joint;
use units::numbering::NodeIndex;
use units::time::Instant;

/// How far the proof is, and what it has found.
#[derive(Clone, Debug)]
pub(super) struct Proof {
    is_wanted: bool,
    cap: ForceCap,
    /// Of the six drives.
    plans: Vec<NodePlan>,
    phase: Phase,
    report: ProofReport,
    /// Which drives have said that they are no longer operational.
    has_left: [bool; 6],
    recheck: Recheck,
}

/// What an event of the master is to the proof.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// Part of it: neither a cause to stop nor news.
    Part,
    /// Not a cause to stop while the proof is under way, but news.
    Tolerated,
    /// Not of it.
    Unrelated,
}

/// How far it is.
#[derive(Clone, Debug)]
enum Phase {
    /// The network comes up.
    Before,
    /// Something stays away.
    Trying(Box<Trial>),
    /// The drives are enabled again; what they reported of their timers may still be on its way.
    Between,
    /// The drives may become ready.
    Over,
}

impl Proof {
    /// None yet, of the drives among `plans`.
    pub(super) fn new(config: &Config, plans: &[(Channel, NodePlan)]) -> Self {
        let plans = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
        Self {
            is_wanted: config.safety.protection.proves_drives,
            cap: config.force_cap(),
            plans: plans.cloned().collect(),
            phase: Phase::Before,
            report: ProofReport::default(),
            has_left: [false; 6],
            recheck: Recheck::default(),
        }
    }

    /// The network starts anew: nothing is proven.
    pub(super) fn restart(&mut self) {
        self.phase = Phase::Before;
        self.report = ProofReport::default();
        self.has_left = [false; 6];
    }

    /// What was found; empty where nothing was proven.
    pub(super) const fn report(&self) -> &ProofReport {
        &self.report
    }

    /// Number of objects that could not be read again.
    pub(super) fn unread(&self) -> usize {
        self.recheck.unread()
    }

    /// Whether the drives may become ready.
    pub(super) const fn is_over(&self) -> bool {
        matches!(self.phase, Phase::Over)
    }

    /// Whether the force that may be felt fits what was proven.
    ///
    /// # Errors
    /// When it does not.
    pub(super) fn allows_force(&self) -> Result<(), TooMuchForce> {
        self.cap.allows(self.report.lasting().unwrap_or(UNPROVEN))
    }

    /// The boot is over: what each drive does not have is known.
    fn begin(&mut self, master: &Master) {
        let drive = |(node, plan): (NodeIndex, &NodePlan)| DriveProof {
            name: plan.name.clone(),
            node: plan.node,
            rpdo: None,
            heartbeat: None,
            missing: master.missing_objects(node).to_vec(),
        };
        self.report.drives = NodeIndex::each(&self.plans).map(drive).collect();
        self.recheck = Recheck::new(&self.plans, master);
    }

    /// Every drive that has nothing to prove.
    fn untimed(&self) -> Vec<NotProven> {
        let [rpdo, heartbeat] = [Awaited::Rpdo, Awaited::Heartbeat].map(|it| self.timers(it));
        let drives = self.report.drives.iter().zip(rpdo.iter().zip(heartbeat));
        drives
            .filter(|(_, (rpdo, heartbeat))| rpdo.or(*heartbeat).is_none())
            .map(|(drive, _)| drive.refused(NoTrip::NoTimer))
            .collect()
    }

    /// The timer of each drive that waits for this: planned, and not missing in the drive.
    fn timers(&self, awaited: Awaited) -> [Option<Watchdog>; 6] {
        let timer = |joint: Joint| {
            let dog = self.plans.get(joint.index())?.watchdog(awaited)?;
            let missing: &[Object] = &self.report.drives.get(joint.index())?.missing;
            (!missing.contains(&dog.object)).then_some(dog)
        };
        Joint::ALL.map(timer)
    }

    /// From `now` on this stays away.
    fn try_timer(&mut self, awaited: Awaited, now: Instant) {
        let trial = Trial::new(awaited, now, self.timers(awaited));
        self.phase = Phase::Trying(Box::new(trial));
    }

    /// The trial under way.
    fn trial(&mut self) -> Option<&mut Trial> {
        match &mut self.phase {
            Phase::Trying(trial) => Some(trial),
            Phase::Before | Phase::Between | Phase::Over => None,
        }
    }

    /// The trial is over: keeps what it found, and says who went on.
    fn end_trial(&mut self) -> Vec<NotProven> {
        let Phase::Trying(trial) = std::mem::replace(&mut self.phase, Phase::Between) else {
            return Vec::new();
        };
        let mut refused = Vec::new();
        for (drive, outcome) in self.report.drives.iter_mut().zip(trial.outcome()) {
            let found = match trial.awaited() {
                Awaited::Rpdo => &mut drive.rpdo,
                Awaited::Heartbeat => &mut drive.heartbeat,
            };
            *found = outcome.and_then(Result::ok);
            refused.extend(outcome.and_then(Result::err).map(|fault| drive.refused(fault)));
        }
        refused
    }

    /// Nothing is waited for any more.
    fn finish(&mut self) {
        self.phase = Phase::Over;
    }

    /// Takes what the master says, and returns what it is to the proof: that a drive misses its master, what
    /// it answers, that it leaves and enters operational.
    pub(super) fn takes(&mut self, now: Instant, event: &Event) -> Relation {
        let is_under_way = matches!(self.phase, Phase::Trying(_) | Phase::Between);
        let is_part = match event {
            Event::Emergency { node, emergency } if is_under_way => match node.joint() {
                Some(joint) => return self.take_emergency(now, joint, emergency),
                None => false,
            },
            Event::ReadBack { .. } => self.recheck.takes(event),
            Event::Statusword { node, statusword } => {
                if let Some((trial, joint)) = self.trial().zip(node.joint()) {
                    trial.on_answer(now, joint, *statusword);
                }
                true
            }
            Event::StateChanged { node, state } => {
                let is_operational = *state == NmtState::Operational;
                // Its next heartbeat may tell of its return when all is over.
                let has_left = node.joint().map(|joint| joint.entry_mut(&mut self.has_left));
                let returns = has_left.map(|left| std::mem::replace(left, !is_operational));
                returns.is_some_and(|returns| is_under_way || returns && is_operational)
            }
            Event::Emergency { .. }
            | Event::Booted
            | Event::BootFailed(_)
            | Event::FoundEnabled { .. }
            | Event::Configured { .. }
            | Event::Absent { .. }
            | Event::Joined { .. }
            | Event::ErrorHistory { .. }
            | Event::HeartbeatLost { .. }
            | Event::Rebooted { .. }
            | Event::Duplicate { .. }
            | Event::ReadByAnother { .. }
            | Event::UnknownNode { .. }
            | Event::ForeignMaster { .. } => false,
        };
        if is_part { Relation::Part } else { Relation::Unrelated }
    }

    /// Takes an emergency of a drive while the proof is under way. Once a drive misses its master, or has been off
    /// for that, it may say more in words of its own: nobody but a person knows what they mean.
    fn take_emergency(&mut self, now: Instant, joint: Joint, emergency: &Emergency) -> Relation {
        let misses_master = error_codes::is_of_communication(emergency.code);
        let tolerates = match self.trial() {
            None => error_codes::is_device_specific(emergency.code),
            Some(trial) => {
                if misses_master {
                    trial.on_emergency(now, joint);
                }
                trial.has_cried(joint)
            }
        };
        if misses_master || emergency.is_reset() {
            Relation::Part
        } else if tolerates {
            Relation::Tolerated
        } else {
            Relation::Unrelated
        }
    }

    /// Takes what the drives tell of themselves by TPDO.
    fn look(&mut self, now: Instant, samples: &[DriveSample; 6]) {
        let Some(trial) = self.trial() else { return };
        for (joint, sample) in Joint::each(samples) {
            trial.on_statusword(now, joint, sample.statusword);
        }
    }

    /// The next drive to be asked for its statusword now.
    fn asks(&mut self, now: Instant) -> Option<Joint> {
        self.trial()?.asks(now)
    }

    /// When the trial wants something done; `None` once it is over.
    fn deadline(&mut self, now: Instant) -> Option<Instant> {
        self.trial()?.deadline(now)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn emergency(code: u16) -> Event {
        let [low, high] = code.to_le_bytes();
        let emergency = Emergency::decode(&[low, high, 1, 0, 0, 0, 0, 0]).unwrap();
        Event::Emergency { node: NodeIndex(2), emergency }
    }

    #[test]
    fn statuswords_asked_for_are_no_news() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let mut proof = Proof::new(&config, &config.node_plans());
        let statusword = canopen::drive::Statusword(0x0208);
        for phase in [Phase::Before, Phase::Between, Phase::Over] {
            proof.phase = phase;
            let answer = Event::Statusword { node: NodeIndex(2), statusword };
            assert_eq!(proof.takes(Instant::ZERO, &answer), Relation::Part);
        }
    }

    #[test]
    fn emergencies_of_the_proof_are_those_of_timers_and_others_are_reported() {
        use Relation::Part;
        use Relation::Tolerated;
        use Relation::Unrelated;
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let mut proof = Proof::new(&config, &config.node_plans());
        proof.begin(&Master::new(config.node_plans()));
        proof.try_timer(Awaited::Rpdo, Instant::ZERO);
        let trying = proof.phase.clone();
        for (phase, codes) in [
            (&Phase::Before, [(0x8250, Unrelated), (0xFF00, Unrelated), (0x3210, Unrelated)]),
            (&trying, [(0xFF00, Unrelated), (0x3210, Unrelated), (0x0000, Part)]),
            (&trying, [(0x8250, Part), (0xFF00, Tolerated), (0x3210, Tolerated)]),
            (&Phase::Between, [(0x8130, Part), (0xFF00, Tolerated), (0x3210, Unrelated)]),
            (&Phase::Between, [(0x0000, Part), (0x2310, Unrelated), (0x8250, Part)]),
            (&Phase::Over, [(0x8250, Unrelated), (0xFF00, Unrelated), (0x3210, Unrelated)]),
        ] {
            proof.phase = phase.clone();
            for (code, relation) in codes {
                assert_eq!(proof.takes(Instant::ZERO, &emergency(code)), relation, "{code:04X}h");
            }
        }
    }
}
