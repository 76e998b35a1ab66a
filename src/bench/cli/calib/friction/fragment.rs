//! `friction.toml`: the friction keys of every joint, with their origin.

use crate::calib::fragment::toml_string;
use crate::calib::friction::judgement::FrictionResult;
use crate::calib::friction::report;
use calibration::torque_data::SweepData;
use controller::arm::JointKind;
use telemetry::digits::significant;

/// Significant digits of a friction.
const DIGITS: usize = 4;

/// Returns the content of the file.
pub(super) fn text(files: &[SweepData], joints: &[FrictionResult<'_>]) -> String {
    let mut lines = vec![
        format!("# Friction by frhc {} calib friction.", env!("CARGO_PKG_VERSION")),
        "# For the [[joint]] of the same name: frhc config merge MY.toml FILE puts the keys in."
            .to_owned(),
        "#\n# Origin of the readings:".to_owned(),
    ];
    for data in files {
        let file = data.file.file_name().unwrap_or(data.file.as_os_str()).to_string_lossy();
        lines.push(format!("#   {file}"));
        lines.extend(data.provenance.iter().map(|comment| format!("#     {comment}")));
    }
    lines.extend(joints.iter().map(joint));
    lines.join("\n") + "\n"
}

fn joint(judged: &FrictionResult<'_>) -> String {
    let name = judged.name();
    let Some(friction) = judged.accepted() else {
        let reasons = judged.reasons.iter();
        return reasons.map(|reason| format!("\n# {name}: rejected: {reason}")).collect();
    };
    let [coulomb_key, viscous_key] = match judged.swept.parameters.plant.link.kind {
        JointKind::Revolute => ["coulomb_friction_nm", "viscous_friction_nms_per_rad"],
        JointKind::Prismatic => ["coulomb_friction_n", "viscous_friction_ns_per_m"],
    };
    let (coulomb, viscous) = (friction.both.coulomb, friction.both.viscous);
    // Accepted friction is negative only within noise.
    let [coulomb_value, viscous_value] =
        [coulomb.value, viscous.value.max(0.0)].map(|value| significant(value, DIGITS));
    let [coulomb_off, viscous_off] =
        [coulomb, viscous].map(|estimate| significant(estimate.deviation, 2));
    let lines = [
        "\n[[joint]]".to_owned(),
        format!("name = {}", toml_string(name)),
        format!("# {}", report::origin(judged)),
        format!("{coulomb_key} = {coulomb_value:?}    # ± {coulomb_off}"),
        format!("{viscous_key} = {viscous_value:?}    # ± {viscous_off}"),
    ];
    lines.join("\n")
}
