//! Proof test (IEC 61508-4, 3.8.5) of the drives' watchdogs at each bring-up, before arming.
//!
//! The drives are enabled at zero torque. First SYNC and RPDOs are withheld while the heartbeat is sent, then the
//! heartbeat while SYNC and RPDOs are sent, then node guarding. Each time every drive with that watchdog must switch its
//! power stage off. Its fault is then reset, and it is enabled again. The measured times bound the forces: [`ForceCap`].
//!
//! | file            | content                                               |
//! |-----------------|-------------------------------------------------------|
//! | `mod`           | phase of the test, and its view of network events     |
//! | `run`           | withholding of frames in a bring-up                   |
//! | `watchdog_test` | test of one watchdog on all drives                    |
//! | `report`        | results                                               |
//! | `recheck`       | tested settings, read back while the node runs        |

mod recheck;
mod report;
mod run;
mod watchdog_test;

pub use report::{DriveResult, NoExpiry, ProofTestFailure, ProofTestReport, WatchdogExpiry};

use crate::proof_test::recheck::Recheck;
use crate::proof_test::watchdog_test::WatchdogTest;
use canopen::emcy::Emergency;
use canopen::frame::Channel;
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::object::Object;
use canopen::pdo::DriveSample;
use canopen::plan::NodePlan;
use canopen::watchdog::{LifeSign, Watchdog};
use canopen::{NmtState, error_codes};
use config::facts::{self, Facts, FactsError};
use config::force_cap::{ForceAboveCap, ForceCap, UNPROVEN_REACTION_TIME};
use config::{Config, Stopping};
use units::numbering::{Joint, NodeIndex};
use units::time::Instant;

/// Phase and results of the proof test.
#[derive(Clone, Debug)]
pub(super) struct ProofTest {
    is_enabled: bool,
    cap: ForceCap,
    /// Plans of the six drives.
    plans: Vec<NodePlan>,
    /// Timers of the six drives, by the plan.
    stopping: Vec<Stopping>,
    phase: Phase,
    report: ProofTestReport,
    /// Drives with an RPDO timer, by plan and boot; each cycle asks.
    has_rpdo_timer: [bool; 6],
    /// Drives that reported another NMT state than operational.
    has_left_operational: [bool; 6],
    recheck: Recheck,
    /// Facts of the drives, by their EDS, and after a boot by the values that it read.
    facts: Vec<Facts>,
    has_friction: bool,
}

/// Relation of a network event to the proof test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// Expected in the test: not a cause. Emergencies are logged as part of the test, all else is not.
    Part,
    /// Possible in the test: not a cause, but logged.
    Tolerated,
    /// Independent of the test.
    Unrelated,
}

/// Phase of the proof test.
#[derive(Clone, Debug)]
enum Phase {
    /// The network boots.
    Pending,
    /// Frames are withheld.
    Running(Box<WatchdogTest>),
    /// The drives are enabled again; emergencies of their watchdogs may still arrive.
    Recovering,
    /// The test has ended; `Ready` may follow.
    Done,
}

impl ProofTest {
    /// Returns the proof test of the drives among `plans`, before it starts.
    pub(super) fn new(config: &Config, plans: &[(Channel, NodePlan)]) -> Self {
        let plans = plans.iter().map(|(_, plan)| plan).filter(|plan| plan.is_drive());
        Self {
            is_enabled: config.safety.protection.proves_drives,
            cap: config.force_cap(),
            plans: plans.cloned().collect(),
            stopping: config.stopping(),
            phase: Phase::Pending,
            report: ProofTestReport::default(),
            has_rpdo_timer: [false; 6],
            has_left_operational: [false; 6],
            recheck: Recheck::default(),
            facts: config.facts(),
            has_friction: config.has_friction_compensation(),
        }
    }

    /// Drops all results, before a boot of the network.
    pub(super) fn restart(&mut self) {
        self.phase = Phase::Pending;
        self.report = ProofTestReport::default();
        self.has_rpdo_timer = [false; 6];
        self.has_left_operational = [false; 6];
        self.recheck = Recheck::default();
    }

    /// Returns the results; empty before a test.
    pub(super) const fn report(&self) -> &ProofTestReport {
        &self.report
    }

    /// Returns the number of settings whose last reading back failed.
    pub(super) fn unread(&self) -> u32 {
        self.recheck.unread()
    }

    /// Returns whether the test has ended, so that `Ready` may follow.
    pub(super) const fn is_done(&self) -> bool {
        matches!(self.phase, Phase::Done)
    }

    /// Returns the facts of the drives, in the order of the joints.
    pub(super) fn facts(&self) -> &[Facts] {
        &self.facts
    }

    /// Checks the facts of the drives, as the boot found them.
    ///
    /// # Errors
    /// When a fact is stated only and not accepted, or friction compensation has no torque unit.
    pub(super) fn check_facts(&self) -> Result<(), Vec<FactsError>> {
        facts::check(&self.facts, self.has_friction)
    }

    /// Checks the configured force against the cap that follows from the results.
    ///
    /// # Errors
    /// When the force exceeds the cap.
    pub(super) fn check_force(&self) -> Result<(), ForceAboveCap> {
        self.cap.check(self.report.reaction_time().unwrap_or(UNPROVEN_REACTION_TIME))
    }

    /// Starts the test after the boot. `master` knows which objects each drive lacks.
    fn start(&mut self, master: &Master) {
        let drive = |(node, plan): (NodeIndex, &NodePlan)| DriveResult {
            name: plan.name.clone(),
            node: plan.node,
            rpdo: None,
            heartbeat: None,
            guarding: None,
            missing: master.missing_objects(node).to_vec(),
            held: master.nameplate(node).to_vec(),
        };
        self.report.drives = NodeIndex::each(&self.plans).map(drive).collect();
        self.has_rpdo_timer = self.watchdogs(LifeSign::Rpdo).map(|watchdog| watchdog.is_some());
        self.recheck = Recheck::new(&self.plans, master);
        for (node, facts) in NodeIndex::each(&mut self.facts) {
            *facts = facts.found(master.nameplate(node));
        }
        self.cap.is_halved = !self.facts.iter().all(Facts::is_verified);
    }

    /// Returns a failure for every drive without a watchdog.
    fn without_watchdog(&self) -> Vec<ProofTestFailure> {
        let watchdogs = LifeSign::ALL.map(|awaited| self.watchdogs(awaited));
        let has_none =
            |joint: &Joint| watchdogs.iter().all(|of_drives| joint.entry(of_drives).is_none());
        let drives = Joint::ALL.into_iter().zip(&self.report.drives);
        drives
            .filter(|(joint, _)| has_none(joint))
            .map(|(_, drive)| drive.failure(NoExpiry::NoTimer))
            .collect()
    }

    /// Returns whether a drive has a watchdog for this message.
    fn has_any(&self, awaited: LifeSign) -> bool {
        self.watchdogs(awaited).iter().any(Option::is_some)
    }

    /// Returns the drives whose RPDO timers stop them without RPDOs.
    pub(super) const fn has_rpdo_timer(&self) -> [bool; 6] {
        self.has_rpdo_timer
    }

    /// Returns the watchdog of each drive for this frame, if it is planned and the drive has its object.
    fn watchdogs(&self, awaited: LifeSign) -> [Option<Watchdog>; 6] {
        let watchdog = |joint: Joint| {
            let watchdog = self.plans.get(joint.index())?.watchdog(awaited)?;
            let missing: &[Object] = &self.report.drives.get(joint.index())?.missing;
            (!missing.contains(&watchdog.object)).then_some(watchdog)
        };
        Joint::ALL.map(watchdog)
    }

    /// Starts the test of the watchdogs for this frame, which is withheld from `now` on.
    fn start_watchdog_test(&mut self, awaited: LifeSign, now: Instant) {
        let watchdogs = self.watchdogs(awaited);
        let planned = |joint: Joint| {
            let watchdog = (*joint.entry(&watchdogs))?;
            Some((watchdog, self.stopping.get(joint.index())?.time_of(&watchdog)))
        };
        let test = WatchdogTest::new(awaited, now, Joint::ALL.map(planned));
        self.phase = Phase::Running(Box::new(test));
    }

    /// Returns the running watchdog test.
    fn running_test(&mut self) -> Option<&mut WatchdogTest> {
        match &mut self.phase {
            Phase::Running(test) => Some(test),
            Phase::Pending | Phase::Recovering | Phase::Done => None,
        }
    }

    /// Ends the running watchdog test, keeps its results, and returns its failures.
    fn end_watchdog_test(&mut self) -> Vec<ProofTestFailure> {
        let Phase::Running(test) = std::mem::replace(&mut self.phase, Phase::Recovering) else {
            return Vec::new();
        };
        let mut failures = Vec::new();
        for (drive, outcome) in self.report.drives.iter_mut().zip(test.outcome()) {
            let result = match test.awaited() {
                LifeSign::Rpdo => &mut drive.rpdo,
                LifeSign::Heartbeat => &mut drive.heartbeat,
                LifeSign::Guarding => &mut drive.guarding,
            };
            let expiry = outcome.and_then(Result::ok);
            // Of two tests of one watchdog the longer time counts.
            *result = [*result, expiry].into_iter().flatten().max_by_key(|it| it.measured);
            failures.extend(outcome.and_then(Result::err).map(|reason| drive.failure(reason)));
        }
        failures
    }

    /// Ends the proof test.
    fn finish(&mut self) {
        self.phase = Phase::Done;
    }

    /// Takes an event of the master, and returns its relation to the test. While it runs, emergencies of watchdogs, read
    /// statuswords and changes of the NMT state (1029h) are part of it.
    pub(super) fn on_event(&mut self, now: Instant, event: &Event) -> Relation {
        let is_running = matches!(self.phase, Phase::Running(_) | Phase::Recovering);
        let is_part = if let Event::Emergency { node, emergency } = event {
            if let Some(joint) = node.joint().filter(|_| is_running) {
                return self.on_emergency(now, joint, emergency);
            }
            false
        } else if let Event::Statusword { node, statusword } = event {
            if let Some((test, joint)) = self.running_test().zip(node.joint()) {
                test.on_sdo_answer(now, joint, *statusword);
            }
            is_running
        } else if let Event::StateChanged { node, state } = event {
            let is_operational = *state == NmtState::Operational;
            // The heartbeat that reports operational again may arrive after the test.
            let left = node.joint().map(|joint| joint.entry_mut(&mut self.has_left_operational));
            let returns = left.map(|left| std::mem::replace(left, !is_operational));
            returns.is_some_and(|returns| is_running || returns && is_operational)
        } else {
            self.recheck.on_event(event)
        };
        if is_part { Relation::Part } else { Relation::Unrelated }
    }

    /// Takes an emergency of a drive during the test, and returns its relation to it. After one of its watchdog a drive
    /// may send others; they stay warnings, as the node does not know whether the test has caused them.
    fn on_emergency(&mut self, now: Instant, joint: Joint, emergency: &Emergency) -> Relation {
        let is_of_watchdog = error_codes::is_of_communication(emergency.code);
        let is_tolerated = match self.running_test() {
            None => error_codes::is_device_specific(emergency.code),
            Some(test) => {
                if is_of_watchdog {
                    test.on_emergency(now, joint);
                }
                test.has_reported(joint)
            }
        };
        if is_of_watchdog || emergency.is_reset() {
            Relation::Part
        } else if is_tolerated {
            Relation::Tolerated
        } else {
            Relation::Unrelated
        }
    }

    /// Takes the statuswords that the drives sent by TPDO.
    fn on_samples(&mut self, now: Instant, samples: &[DriveSample; 6]) {
        let Some(test) = self.running_test() else { return };
        for (joint, sample) in Joint::each(samples) {
            test.on_statusword(now, joint, sample.statusword);
        }
    }

    /// Returns the next drive whose statusword must be read by SDO now.
    fn next_to_read(&mut self, now: Instant) -> Option<Joint> {
        self.running_test()?.next_to_read(now)
    }

    /// Records that the statusword of this drive is requested now.
    fn on_requested(&mut self, now: Instant, joint: Joint) {
        if let Some(test) = self.running_test() {
            test.on_requested(now, joint);
        }
    }

    /// Returns the time of the next action of the watchdog test; `None` once it has ended.
    fn deadline(&mut self, now: Instant) -> Option<Instant> {
        self.running_test()?.deadline(now)
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
    fn read_statuswords_are_part_of_the_test() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let mut proof_test = ProofTest::new(&config, &config.node_plans());
        let statusword = canopen::drive::Statusword(0x0208);
        for (phase, relation) in [
            (Phase::Pending, Relation::Unrelated),
            (Phase::Recovering, Relation::Part),
            (Phase::Done, Relation::Unrelated),
        ] {
            proof_test.phase = phase;
            let answer = Event::Statusword { node: NodeIndex(2), statusword };
            assert_eq!(proof_test.on_event(Instant::ZERO, &answer), relation);
        }
    }

    #[test]
    fn emergencies_of_watchdogs_are_part_and_others_are_warnings() {
        use Relation::{Part, Tolerated, Unrelated};
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let mut proof_test = ProofTest::new(&config, &config.node_plans());
        proof_test.start(&Master::new(config.node_plans()));
        proof_test.start_watchdog_test(LifeSign::Rpdo, Instant::ZERO);
        let running = proof_test.phase.clone();
        for (phase, codes) in [
            (&Phase::Pending, [(0x8250, Unrelated), (0xFF00, Unrelated), (0x3210, Unrelated)]),
            (&running, [(0xFF00, Unrelated), (0x3210, Unrelated), (0x0000, Part)]),
            (&running, [(0x8250, Part), (0xFF00, Tolerated), (0x3210, Tolerated)]),
            (&Phase::Recovering, [(0x8130, Part), (0xFF00, Tolerated), (0x3210, Unrelated)]),
            (&Phase::Recovering, [(0x0000, Part), (0x2310, Unrelated), (0x8250, Part)]),
            (&Phase::Done, [(0x8250, Unrelated), (0xFF00, Unrelated), (0x3210, Unrelated)]),
        ] {
            proof_test.phase = phase.clone();
            for (code, relation) in codes {
                assert_eq!(
                    proof_test.on_event(Instant::ZERO, &emergency(code)),
                    relation,
                    "{code:04X}h"
                );
            }
        }
    }
}
