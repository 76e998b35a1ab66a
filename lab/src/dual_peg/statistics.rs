//! Statistics of all trials of an operator in a condition, and the ratio of the paper's two conditions.

use serde::Serialize;

use crate::dual_peg::condition::Condition;
use crate::dual_peg::trial::{Outcome, Trial};
use crate::pool;

/// Statistics of the trials of one operator in one condition.
#[derive(Clone, Debug, Serialize)]
pub struct TrialStatistics {
    /// Name of the operator's preset.
    pub operator: String,
    /// Positions of the switches.
    pub condition: Condition,
    /// Number of trials.
    pub trials: usize,
    /// Number of trials in which both pegs were inserted.
    pub inserted: usize,
    /// Mean of Eq. 11 as printed, in J.
    pub literal_j: f64,
    /// Standard deviation of Eq. 11 as printed, in J.
    pub literal_deviation_j: f64,
    /// Means of `|∫ F_i dξ_i|` per component of {MRF}, in J.
    pub literal_parts_j: [f64; 6],
    /// Mean of `Σ ∫ |F dξ|`, in J.
    pub absolute_j: f64,
    /// Mean of the trials' largest contact force, in N.
    pub peak_n: f64,
    /// Mean of the trials' mean contact force, in N.
    pub mean_n: f64,
    /// Mean duration, in s.
    pub seconds: f64,
}

/// Ratio of an operator's work with both switches on to that with both off.
#[derive(Clone, Debug, Serialize)]
pub struct Ratio {
    /// Name of the operator's preset.
    pub operator: String,
    /// Ratio of Eq. 11 as printed.
    pub ratio: f64,
}

impl TrialStatistics {
    /// Pools trials of one operator in one condition; `None` if `trials` is empty.
    pub fn from_trials(trials: &[&Trial]) -> Option<Self> {
        let first = trials.first()?;
        let mean =
            |value: &dyn Fn(&Trial) -> f64| pool::mean(trials.iter().map(|trial| value(trial)));
        let literal_j = mean(&Trial::literal);
        let variance = mean(&|trial| (trial.literal() - literal_j).powi(2));
        let parts = [0, 1, 2, 3, 4, 5];
        Some(Self {
            operator: first.operator.clone(),
            condition: first.condition,
            trials: trials.len(),
            inserted: trials.iter().filter(|trial| trial.outcome == Outcome::Inserted).count(),
            literal_j,
            literal_deviation_j: variance.sqrt(),
            literal_parts_j: parts
                .map(|part| mean(&|trial| trial.literal_j.get(part).copied().unwrap_or_default())),
            absolute_j: mean(&Trial::absolute),
            peak_n: mean(&|trial| trial.peak_n),
            mean_n: mean(&|trial| trial.mean_n),
            seconds: mean(&|trial| trial.seconds),
        })
    }

    /// Returns the number of successful trials and that of all trials.
    pub(crate) fn counts<'p>(pooled: impl IntoIterator<Item = &'p Self>) -> (u32, u32) {
        let count = |trials: usize| u32::try_from(trials).unwrap_or(u32::MAX);
        pooled.into_iter().fold((0, 0), |(inserted, trials), one| {
            (inserted + count(one.inserted), trials + count(one.trials))
        })
    }

    /// Pools trials by operator and condition, in the order of `operators` and of [`Condition::ALL`].
    pub fn all(trials: &[Trial], operators: &[String]) -> Vec<Self> {
        let groups = operators.iter().flat_map(|operator| {
            Condition::ALL.map(|condition| {
                let is_of =
                    |trial: &&Trial| trial.operator == *operator && trial.condition == condition;
                Self::from_trials(&trials.iter().filter(is_of).collect::<Vec<_>>())
            })
        });
        groups.flatten().collect()
    }
}

/// Returns the ratio of Eq. 11 with both switches on to that with both off, per operator.
pub fn ratios(pooled: &[TrialStatistics], operators: &[String]) -> Vec<Ratio> {
    let of = |operator: &str, condition: Condition| {
        let is_of = |one: &&TrialStatistics| one.operator == operator && one.condition == condition;
        pooled.iter().find(is_of).map(|one| one.literal_j)
    };
    let ratio = |operator: &String| {
        let (both, neither) = (of(operator, Condition::BOTH)?, of(operator, Condition::NEITHER)?);
        (neither > 0.0).then(|| Ratio { operator: operator.clone(), ratio: both / neither })
    };
    operators.iter().filter_map(ratio).collect()
}
