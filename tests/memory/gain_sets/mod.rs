//! Gains that `check` accepts or refuses, against 20 s of simulated contact at the posture it finds the worst.
//!
//! All 300 sets, with a table: `cargo test --test memory -- --ignored --nocapture gain_sets`.

mod contact;
mod set;

use std::fmt;

use controller::gains::AXES;
use controller::stability::finding::{Finding, Verdict};
use sim::random::SplitMix;

use contact::{CommandMode, HANDS, Outcome, Play};
use set::GainSet;

/// Share of the bound up to which a refusal is not false.
const NEAR: f64 = 1.2;

/// Friction that an arm has at the least, as a share of the identified one.
const LEAST_FRICTION: f64 = 0.3;

/// Gain set in one mode: result of the gate, and outcome of contact with each hand.
struct Case {
    set: GainSet,
    mode: CommandMode,
    /// Worst of the gate's findings of this mode.
    worst: Finding,
    played: Vec<Outcome>,
    /// Played again with the least friction, if the refused were calm.
    slippery: Vec<Outcome>,
}

/// Names of the gate's findings that refuse a mode.
const fn names(mode: CommandMode) -> &'static [&'static str] {
    match mode {
        CommandMode::Pose => &["damping, held", "pose reflection, held"],
        CommandMode::Rate => &[
            "damping, held",
            "return to centre, held",
            "rate reflection, held",
            "accommodation",
            "accommodation, damper",
        ],
    }
}

/// Returns the joint that is moved from the start, and by which share of its range, from the words of a finding.
fn moved(finding: &Finding) -> Option<(String, f64)> {
    let (_, after) = finding.reason.split_once(", with ")?;
    let (joint, after) = after.split_once(" moved by ")?;
    let (percent, _) = after.split_once(" %")?;
    Some((joint.to_owned(), percent.parse::<f64>().ok()? / 100.0))
}

impl Case {
    fn new(set: GainSet, mode: CommandMode) -> Self {
        let findings = set.config(None).findings();
        let judged = findings.into_iter().filter(|finding| names(mode).contains(&finding.name));
        let (linear, all): (Vec<_>, Vec<_>) = judged.map(|f| (f.clone(), f)).unzip();
        let worst =
            |of: Vec<Finding>| of.into_iter().max_by(|a, b| a.share().total_cmp(&b.share()));
        let linear = linear.into_iter().filter(|finding| AXES[..3].contains(&finding.axis));
        let played = worst(linear.collect()).unwrap();
        let worst = worst(all).unwrap();
        let axis = AXES.iter().position(|axis| *axis == played.axis).unwrap();
        let config = set.config(moved(&played).as_ref());
        let play = |friction| {
            let hands = 0..HANDS.len();
            hands
                .map(|hand| Play { config: &config, mode, hand, axis, friction }.outcome())
                .collect()
        };
        let mut case = Self { set, mode, worst, played: play(1.0), slippery: Vec::new() };
        if case.is_false_refusal() {
            case.slippery = play(LEAST_FRICTION);
        }
        case
    }

    fn is_refused(&self) -> bool {
        self.worst.verdict == Verdict::Refuses
    }

    fn is_calm(&self) -> bool {
        self.played.iter().all(Outcome::is_calm)
    }

    fn is_false_accept(&self) -> bool {
        !self.is_refused() && !self.is_calm()
    }

    fn is_false_refusal(&self) -> bool {
        self.worst.share() > NEAR && self.is_calm()
    }

    fn word(&self) -> &'static str {
        match (self.is_refused(), self.is_calm()) {
            (true, true) => "refused, calm",
            (true, false) => "refused, wild",
            (false, true) => "accepted, calm",
            (false, false) => "ACCEPTED, WILD",
        }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { set, mode, worst, played, slippery } = self;
        writeln!(f, "{mode:?} {:.2} {}: {set}", worst.share(), self.word())?;
        writeln!(f, "    {worst}")?;
        played.iter().chain(slippery).try_for_each(|outcome| writeln!(f, "    {outcome}"))
    }
}

/// Plays the sets in both modes, on every core.
fn cases(sets: &[GainSet]) -> Vec<Case> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let parts: Vec<_> = (0..cores)
            .map(|core| {
                scope.spawn(move || {
                    let mine = sets.iter().skip(core).step_by(cores);
                    let modes = [CommandMode::Pose, CommandMode::Rate];
                    let played = mine.flat_map(|set| modes.map(|mode| Case::new(*set, mode)));
                    played.inspect(|case| print!("{case}")).collect::<Vec<_>>()
                })
            })
            .collect();
        parts.into_iter().flat_map(|part| part.join().unwrap()).collect()
    })
}

/// Returns the first `number` sets.
fn sets(number: usize) -> Vec<GainSet> {
    let mut random = SplitMix::new(1);
    (0..number).map(|_| GainSet::random(&mut random)).collect()
}

#[test]
fn gains_beyond_the_bound_swing_and_those_within_do_not() {
    use CommandMode::{Pose, Rate};
    let sets = sets(100);
    for (number, mode, is_refused) in
        [(39, Pose, false), (44, Rate, false), (63, Rate, false), (6, Rate, true), (93, Pose, true)]
    {
        let case = Case::new(sets[number], mode);
        assert_eq!((case.is_refused(), case.is_calm()), (is_refused, !is_refused), "{case}");
    }
}

#[test]
#[ignore = "25 minutes on two cores"]
fn random_gain_sets_are_calm_if_accepted() {
    let cases = cases(&sets(300));
    let count = |is: &dyn Fn(&Case) -> bool| cases.iter().filter(|case| is(case)).count();
    println!("cases: {}, refused: {}", cases.len(), count(&Case::is_refused));
    println!("refused and wild: {}", count(&|case| case.is_refused() && !case.is_calm()));
    println!("false accepts: {}", count(&Case::is_false_accept));
    println!("false refusals beyond {NEAR} of the bound: {}", count(&Case::is_false_refusal));
    let still_calm =
        |case: &Case| case.is_false_refusal() && case.slippery.iter().all(Outcome::is_calm);
    println!("of which calm with {LEAST_FRICTION} of the friction, too: {}", count(&still_calm));
    let hard = |case: &Case| !case.is_refused() && case.played.iter().any(Outcome::has_hard_impact);
    println!("accepted, first impact above 100 mJ: {}", count(&hard));
    let untouched = |case: &Case| case.played.iter().any(|outcome| outcome.contact_s < 1.0);
    println!(
        "accepted, contact below 1 s: {}",
        count(&|case| !case.is_refused() && untouched(case))
    );
    assert_eq!(count(&Case::is_false_accept), 0);
    assert!(20 * count(&Case::is_false_refusal) <= cases.len());
}
