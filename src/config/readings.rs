//! `[controller] preset` and `[controller.readings]`: how the paper is read.

use crate::problem::Problems;
use crate::raw;
use controller::orientation::Orientation;
use controller::readings::Centring;
use controller::readings::Difference;
use controller::readings::Displaced;
use controller::readings::Felt;
use controller::readings::Readings;
use controller::readings::Scaling;
use controller::readings::Weight;

/// The preset, and over it what is said of single readings; `None` where a problem has been noted.
pub(super) fn readings(given: &raw::Controller, problems: &mut Problems<'_>) -> Option<Readings> {
    let presets = [("consistent", Readings::CONSISTENT), ("paper1997", Readings::PAPER_1997)];
    let preset = problems.one_of("controller.preset", &given.preset, &presets)?;
    let over = &given.readings;
    let mut choice = Choice { problems, is_wrong: false };
    let readings = Readings {
        orientation: choice.of(
            ("orientation", &over.orientation, preset.orientation),
            &[
                ("euler-zyx", Orientation::EulerZyx),
                ("rotation-vector", Orientation::RotationVector),
            ],
        ),
        displacement: choice.of(
            ("displacement", &over.displacement, preset.displacement),
            &[("reference", Displaced::InReference), ("base", Displaced::InBase)],
        ),
        centring: choice.of(
            ("centring", &over.centring, preset.centring),
            &[("conjugate", Centring::Conjugate), ("components", Centring::Components)],
        ),
        weight: choice.of(
            ("gravity", &over.gravity, preset.weight),
            &[("per-link", Weight::PerLink), ("at-grip", Weight::AtGrip)],
        ),
        scaling: choice.of(
            ("scaling", &over.scaling, preset.scaling),
            &[
                ("gravity-exempt", Scaling::GravityExempt),
                ("total", Scaling::Total),
                ("assist-with-gravity", Scaling::AssistWithGravity),
            ],
        ),
        damping: choice.of(
            ("damping", &over.damping, preset.damping),
            &[("twist", Difference::Twist), ("components", Difference::Components)],
        ),
        latches: over.latch_on_deadman.unwrap_or(preset.latches),
        task: choice.of(
            ("task_wrench", &over.task_wrench, preset.task),
            &[("grip", Felt::InGrip), ("reference", Felt::InReference)],
        ),
    };
    (!choice.is_wrong).then_some(readings)
}

/// Takes one name after the other.
struct Choice<'p, 't> {
    problems: &'p mut Problems<'t>,
    is_wrong: bool,
}

impl Choice<'_, '_> {
    /// What `name` stands for, or the preset's where nothing is said.
    fn of<T: Copy>(
        &mut self,
        (key, name, preset): (&str, &Option<String>, T),
        choices: &[(&str, T)],
    ) -> T {
        let Some(name) = name else { return preset };
        let found = self.problems.one_of(&format!("controller.readings.{key}"), name, choices);
        self.is_wrong |= found.is_none();
        found.unwrap_or(preset)
    }
}
