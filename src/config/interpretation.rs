//! `[controller] preset` and `[controller.readings]`: how the paper is read.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use controller::interpretation::{
    Centring, Difference, DisplacementFrame, Interpretation, ReflectionFrame, Scaling, Weight,
};
use controller::orientation::Orientation;

/// The preset, and over it what is said of single readings; `None` where a problem has been noted.
pub(super) fn interpretation(
    given: &raw::Controller,
    problems: &mut Problems<'_>,
) -> Option<Interpretation> {
    let presets =
        [("consistent", Interpretation::CONSISTENT), ("paper1997", Interpretation::PAPER_1997)];
    let preset = problems.one_of(&given.preset, &presets);
    let is_known = preset.is_some();
    let preset = preset.unwrap_or(Interpretation::CONSISTENT);
    let over = &given.readings;
    let mut choice = Choice { problems, is_wrong: false };
    let interpretation = Interpretation {
        orientation: choice.of(
            (&over.orientation, preset.orientation),
            &[
                ("euler-zyx", Orientation::EulerZyx),
                ("rotation-vector", Orientation::RotationVector),
            ],
        ),
        displacement: choice.of(
            (&over.displacement, preset.displacement),
            &[("reference", DisplacementFrame::Reference), ("base", DisplacementFrame::Base)],
        ),
        centring: choice.of(
            (&over.centring, preset.centring),
            &[("conjugate", Centring::Conjugate), ("components", Centring::Components)],
        ),
        weight: choice.of(
            (&over.gravity, preset.weight),
            &[("per-link", Weight::PerLink), ("at-grip", Weight::AtGrip)],
        ),
        scaling: choice.of(
            (&over.scaling, preset.scaling),
            &[
                ("gravity-exempt", Scaling::GravityExempt),
                ("total", Scaling::Total),
                ("assist-with-gravity", Scaling::AssistWithGravity),
            ],
        ),
        damping: choice.of(
            (&over.damping, preset.damping),
            &[("twist", Difference::Twist), ("components", Difference::Components)],
        ),
        latches: over.latch_on_deadman.or(preset.latches).get()?,
        task: choice.of(
            (&over.task_wrench, preset.task),
            &[("grip", ReflectionFrame::Grip), ("reference", ReflectionFrame::Reference)],
        ),
    };
    (is_known && !choice.is_wrong).then_some(interpretation)
}

/// Takes one name after the other.
struct Choice<'p, 't> {
    problems: &'p mut Problems<'t>,
    is_wrong: bool,
}

impl Choice<'_, '_> {
    /// The choice called `name`, or the preset's where the key is absent.
    fn of<T: Copy>(&mut self, (name, preset): (&Optional<String>, T), choices: &[(&str, T)]) -> T {
        if name.is_absent() {
            return preset;
        }
        let found = self.problems.one_of(name, choices);
        self.is_wrong |= found.is_none();
        found.unwrap_or(preset)
    }
}
