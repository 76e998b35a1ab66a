//! Quirks of simulated drives that a configuration cannot have.

use canopen::eds::EdsObject;
use config::Config;
use run::exit::{Failure, Kind};
use sim::quirks::QuirkAssignment;
use units::numbering::Joint;

/// Checks that each drive has the objects in which its quirks store a value.
///
/// # Errors
/// Returns the first object that is missing or too small.
pub fn check(config: &Config, assignment: &QuirkAssignment) -> Result<(), Failure> {
    for (number, joint) in Joint::ALL.into_iter().zip(&config.joints) {
        for quirk in assignment.for_joint(number).iter() {
            let Some((object, value)) = quirk.stores() else { continue };
            let file = config.file.display();
            let refuse = |reason: String| {
                let words =
                    format!("{file}: joint {number} ({}), quirk {quirk}: {reason}", joint.name);
                Err(Failure::new(Kind::Configuration, words))
            };
            let described = joint.eds.object(object);
            let Some(bits) = described.and_then(EdsObject::bits) else {
                return refuse(format!(
                    "its EDS has no integer at {object}; choose an object of the drive"
                ));
            };
            if u64::from(value).checked_shr(bits.into()).unwrap_or(0) != 0 {
                return refuse(format!("{object} has {bits} bits, got {value}"));
            }
        }
    }
    Ok(())
}
