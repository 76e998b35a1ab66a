//! Transforms between the frames of the arm and of the object.

use nalgebra::Isometry3;

use crate::messages::{Header, Time, TransformStamped, Transforms};
use crate::topics::{GRIP, LINKS, OBJECT, OBJECT_BASE, SENSOR};
use controller::arm::{Arm, Posture};

/// Returns the transforms of the arm, each link in the one before it and {G} in the last, and of the object in {b}.
pub(crate) fn moving(
    stamp: Time,
    arm: Option<(&Arm<6>, &Posture<6>)>,
    x_b_m: Option<Isometry3<f64>>,
) -> Transforms {
    let mut transforms = Vec::with_capacity(LINKS.len() + 1);
    if let Some((arm, posture)) = arm {
        let mut x_0_before = Isometry3::identity();
        let parents = LINKS.iter().zip(LINKS.iter().skip(1));
        for ((parent, child), x_0_i) in parents.zip(&posture.x_0_links) {
            transforms.push(transform(stamp, parent, child, x_0_before.inv_mul(x_0_i)));
            x_0_before = *x_0_i;
        }
        let last = LINKS.last().copied().unwrap_or_default();
        transforms.push(transform(stamp, last, GRIP, *arm.grip()));
    }
    transforms.extend(x_b_m.map(|x_b_m| transform(stamp, OBJECT_BASE, OBJECT, x_b_m)));
    Transforms { transforms }
}

/// Returns the transform of the force sensor in {MRF}.
pub(crate) fn fixed(stamp: Time, x_m_s: Isometry3<f64>) -> Transforms {
    Transforms { transforms: vec![transform(stamp, OBJECT, SENSOR, x_m_s)] }
}

fn transform(
    stamp: Time,
    frame_id: &'static str,
    child_frame_id: &'static str,
    x: Isometry3<f64>,
) -> TransformStamped {
    TransformStamped { header: Header { stamp, frame_id }, child_frame_id, transform: x.into() }
}
