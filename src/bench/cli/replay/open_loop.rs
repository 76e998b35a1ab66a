//! `frhc replay --with`: torques of another configuration, computed from the same inputs.

use serde::Serialize;

use crate::replay::difference::end;
use crate::replay::extent::Extent;
use ::replay::Session;
use config::Config;
use controller::JointVector;
use controller::arm::JointKind;
use progress::Progress;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use units::wording::counted;

/// First line of the result.
const OPEN_LOOP: &str = "open loop: the recorded person and arm did not feel these torques";

/// Difference of the torques of one joint, in N·m or N.
#[derive(Debug, Default, Serialize)]
struct JointDifference {
    name: String,
    unit: &'static str,
    rms: f64,
    max: f64,
    /// Cycle of the maximum.
    cycle: u64,
}

/// Computes a session with both configurations, and prints the differences of their torques.
pub(super) fn compare(
    session: &Session,
    [recorded, other]: [&Config; 2],
    extent: &Extent,
    as_json: bool,
    progress: &Progress,
) -> Result<(), Failure> {
    let mut base = session.replay(recorded).or_fail(Kind::File)?;
    let mut changed = session.open_loop(other).or_fail(Kind::File)?;
    let mut joints = recorded.joints.each_ref().map(|joint| JointDifference {
        name: joint.name.clone(),
        unit: match joint.plant.link.kind {
            JointKind::Revolute => "N·m",
            JointKind::Prismatic => "N",
        },
        ..JointDifference::default()
    });
    let (mut squares, mut compared) = (JointVector::zeros(), 0_u32);
    while base.outcome().end.is_none() && changed.outcome().end.is_none() {
        progress.check().or_fail(Kind::Interrupted)?;
        let Some((was, is)) = base.step().zip(changed.step()) else { continue };
        progress.advance(1);
        let difference = is.output.tau - was.output.tau;
        squares += difference.component_mul(&difference);
        compared = compared.saturating_add(1);
        for (joint, torque) in joints.iter_mut().zip(&difference) {
            if torque.abs() > joint.max {
                (joint.max, joint.cycle) = (torque.abs(), was.cycle);
            }
        }
        if extent.is_over((was.cycle, Some(was.at))) {
            break;
        }
    }
    progress.finish();
    for (joint, squares) in joints.iter_mut().zip(&squares) {
        joint.rms = (squares / f64::from(compared.max(1))).sqrt();
    }
    let end = end(session, &changed)?;
    if as_json {
        let document = serde_json::json!({
            "remark": OPEN_LOOP, "cycle_count": compared, "torque_difference": joints, "end": end,
        });
        print::line(&document.to_string());
        return Ok(());
    }
    print::line(OPEN_LOOP);
    print::line(&format!("computed  {}: {end}", counted(compared, "cycle")));
    for JointDifference { name, unit, rms, max, cycle } in &joints {
        let torque = format!("{rms:8.4} {unit} rms, {max:8.4} {unit} at most");
        let place = if *max > 0.0 { format!(", in cycle {cycle}") } else { String::new() };
        print::line(&format!("{name:16} {torque}{place}"));
    }
    Ok(())
}
