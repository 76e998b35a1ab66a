//! `[controller] preset` and `[controller.readings]`: interpretation of the paper where it allows several.

use crate::problem::Problems;
use crate::raw;
use crate::value::Optional;
use controller::interpretation::{
    Centring, Difference, DisplacementFrame, Interpretation, ReflectionFrame, TorqueScaling, Weight,
};
use controller::orientation::Orientation;

/// Reads the preset and the readings that override it. Returns `None` after a problem.
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
        orientation: choice.read(
            (&over.orientation, preset.orientation),
            &[
                ("euler-zyx", Orientation::EulerZyx),
                ("rotation-vector", Orientation::RotationVector),
            ],
        ),
        displacement: choice.read(
            (&over.displacement, preset.displacement),
            &[("reference", DisplacementFrame::Reference), ("base", DisplacementFrame::Base)],
        ),
        centring: choice.read(
            (&over.centring, preset.centring),
            &[("conjugate", Centring::Conjugate), ("components", Centring::Components)],
        ),
        weight: choice.read(
            (&over.gravity, preset.weight),
            &[("per-link", Weight::PerLink), ("at-grip", Weight::AtGrip)],
        ),
        scaling: choice.read(
            (&over.scaling, preset.scaling),
            &[
                ("gravity-exempt", TorqueScaling::GravityExempt),
                ("total", TorqueScaling::Total),
                ("assist-with-gravity", TorqueScaling::AssistWithGravity),
            ],
        ),
        damping: choice.read(
            (&over.damping, preset.damping),
            &[("twist", Difference::Twist), ("components", Difference::Components)],
        ),
        latches: over.latch_on_deadman.or(preset.latches).get()?,
        task: choice.read(
            (&over.task_wrench, preset.task),
            &[("grip", ReflectionFrame::Grip), ("reference", ReflectionFrame::Reference)],
        ),
    };
    (is_known && !choice.is_wrong).then_some(interpretation)
}

/// Reader of one key after the other, which remembers problems.
struct Choice<'p, 't> {
    problems: &'p mut Problems<'t>,
    is_wrong: bool,
}

impl Choice<'_, '_> {
    /// Returns the value of `names` for this key, or `preset` if the key is absent or invalid.
    fn read<T: Copy>(&mut self, (key, preset): (&Optional<String>, T), names: &[(&str, T)]) -> T {
        if key.is_absent() {
            return preset;
        }
        let found = self.problems.one_of(key, names);
        self.is_wrong |= found.is_none();
        found.unwrap_or(preset)
    }
}
