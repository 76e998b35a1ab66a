//! Facts of each drive, verified or stated only. A fact that is stated only must be accepted by key, halves the allowed
//! force, and forbids friction compensation if it is the torque unit.

use std::fmt;

use thiserror::Error;

use crate::joints::JointParameters;
use crate::parameters::Parameters;
use crate::problem::Problems;
use crate::raw;
use crate::torque_limit::{StatedLimit, TorqueLimit};
use canopen::fact::{Evidence, Fact};
use canopen::nameplate::{Nameplate, StoredValue};

/// Facts of the drive of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Facts {
    /// Name of the joint.
    pub joint: String,
    /// Torque limit set by the maker's tool, which the master cannot read.
    pub torque_limit: Option<StatedLimit>,
    nameplate: Nameplate,
    accepted: Vec<Fact>,
    /// Evidence for each of [`Fact::ALL`].
    evidence: [Option<Evidence>; 3],
}

impl Facts {
    /// Returns the facts of a joint with the evidence that its EDS promises.
    fn planned(joint: &JointParameters) -> Self {
        let has = |object| joint.eds.object(object).is_some();
        Self {
            joint: joint.name.clone(),
            torque_limit: joint.torque_limit.as_ref().and_then(TorqueLimit::stated),
            accepted: joint.accepted.clone(),
            evidence: Fact::ALL.map(|fact| joint.nameplate.planned_evidence(fact, has)),
            nameplate: joint.nameplate.clone(),
        }
    }

    /// Returns the facts with the evidence that the boot has read. A drive may abort the upload of an object in its EDS.
    #[must_use]
    pub fn found(&self, held: &[StoredValue]) -> Self {
        let evidence = Fact::ALL.map(|fact| self.nameplate.found_evidence(fact, held));
        Self { evidence, ..self.clone() }
    }

    /// Returns the facts without evidence, the torque limit excepted.
    pub fn stated_only(&self) -> Vec<Fact> {
        let facts = Fact::ALL.into_iter().zip(&self.evidence);
        facts.filter(|(_, evidence)| evidence.is_none()).map(|(fact, _)| fact).collect()
    }

    /// Returns whether every fact has evidence, and no torque limit is stated only.
    pub fn is_verified(&self) -> bool {
        self.stated_only().is_empty() && self.torque_limit.is_none()
    }

    fn unaccepted(&self) -> Vec<Fact> {
        let stated = self.stated_only().into_iter();
        stated.filter(|fact| !self.accepted.contains(fact)).collect()
    }
}

/// `sign verified by 607Eh, position scale stated only, torque unit verified by 6076h`
impl fmt::Display for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, (fact, evidence)) in Fact::ALL.iter().zip(&self.evidence).enumerate() {
            let comma = if place > 0 { ", " } else { "" };
            match evidence {
                Some(evidence) => write!(f, "{comma}{fact} verified by {evidence}")?,
                None => write!(f, "{comma}{fact} stated only")?,
            }
        }
        match &self.torque_limit {
            Some(limit) => write!(f, ", limit of the maker's tool stated only: {limit}"),
            None => Ok(()),
        }
    }
}

/// Reason why facts of the drives forbid arming.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FactsError {
    /// Facts stated only and not accepted, the same for all of `joints`.
    #[error(
        "{}: {} stated only, as no object of the drive verifies this ({}); check by hand, then \
         accept by accept_stated_only = [{}]{} in each [[joint]]: at most half of the force is then allowed",
        joints.join(", "), names(facts), objects(facts), keys(facts), rest(facts)
    )]
    NotAccepted {
        /// Names of the joints.
        joints: Vec<String>,
        /// Facts that are not accepted.
        facts: Vec<Fact>,
    },
    /// Friction compensation of joints whose torque unit is stated only.
    #[error(
        "friction compensation must be off while a torque unit is stated only ({}): remove [controller.friction], or \
         use a drive with {}",
        joints.join(", "), Fact::TorqueUnit.objects()
    )]
    Friction {
        /// Names of the joints.
        joints: Vec<String>,
    },
}

/// Checks that the facts of all drives allow arming, with friction compensation if `has_friction`.
///
/// # Errors
/// Returns every reason against arming. Equal reasons of several joints are merged.
pub fn check(facts: &[Facts], has_friction: bool) -> Result<(), Vec<FactsError>> {
    let mut groups: Vec<(Vec<Fact>, Vec<String>)> = Vec::new();
    for one in facts {
        let unaccepted = one.unaccepted();
        match groups.iter_mut().find(|(facts, _)| *facts == unaccepted) {
            _ if unaccepted.is_empty() => {}
            Some((_, joints)) => joints.push(one.joint.clone()),
            None => groups.push((unaccepted, vec![one.joint.clone()])),
        }
    }
    let groups = groups.into_iter();
    let mut refused: Vec<_> =
        groups.map(|(facts, joints)| FactsError::NotAccepted { joints, facts }).collect();
    let is_unknown = |one: &&Facts| one.stated_only().contains(&Fact::TorqueUnit);
    let unknown: Vec<_> = facts.iter().filter(is_unknown).map(|one| one.joint.clone()).collect();
    if has_friction && !unknown.is_empty() {
        refused.push(FactsError::Friction { joints: unknown });
    }
    if refused.is_empty() { Ok(()) } else { Err(refused) }
}

impl Parameters {
    /// Returns the facts of each drive with the evidence that its EDS promises, in the order of the joints.
    pub fn facts(&self) -> Vec<Facts> {
        self.joints.iter().map(Facts::planned).collect()
    }

    /// Returns whether friction compensation is configured.
    pub const fn has_friction_compensation(&self) -> bool {
        self.controller.extensions.friction.is_some()
    }
}

/// Refuses facts that are stated only and not accepted, once for all joints with the same facts.
pub(super) fn check_config(config: &Parameters, raw: &raw::File, problems: &mut Problems<'_>) {
    let Err(refused) = check(&config.facts(), config.has_friction_compensation()) else { return };
    for reason in refused {
        match &reason {
            FactsError::NotAccepted { joints, .. } => {
                let mut all = config.joints.iter().zip(raw.joint.all());
                let first = all.find(|(joint, _)| joints.first() == Some(&joint.name));
                if let Some((_, joint)) = first {
                    problems.add(&joint.accept_stated_only, &reason);
                }
            }
            FactsError::Friction { .. } => match &raw.controller.friction {
                Some(friction) => problems.add(friction, &reason),
                None => problems.add(&raw.controller, &reason),
            },
        }
    }
}

fn names(facts: &[Fact]) -> String {
    let names: Vec<_> = facts.iter().map(Fact::to_string).collect();
    let verb = if facts.len() == 1 { "is" } else { "are" };
    format!("{} {verb}", names.join(" and "))
}

fn objects(facts: &[Fact]) -> String {
    let objects: Vec<_> = facts.iter().map(|fact| fact.objects()).collect();
    objects.join("; ")
}

/// Returns the phrase for `rest_deg`, which acceptance of a sign or position scale requires; empty for others.
fn rest(facts: &[Fact]) -> &'static str {
    let is_position = |fact: &Fact| matches!(fact, Fact::Sign | Fact::PositionScale);
    if facts.iter().any(is_position) { ", with rest_deg (rest_m)," } else { "" }
}

fn keys(facts: &[Fact]) -> String {
    let keys: Vec<_> = facts.iter().map(|fact| format!("\"{}\"", fact.key())).collect();
    keys.join(", ")
}
