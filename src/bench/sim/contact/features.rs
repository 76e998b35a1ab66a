//! Numbers of points in contact, by the part of the solid that they touch.

use serde::Serialize;

use crate::contact::surface::Feature;

/// Numbers of points in contact.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq, Serialize)]
pub struct Features {
    /// Points on the face of the plate.
    pub face: u16,
    /// Points on a chamfer of a hole.
    pub cone: u16,
    /// Points on a bore.
    pub bore: u16,
    /// Points of the edge of a hole on the end of a peg.
    pub peg_end: u16,
    /// Points of the edge of a hole on the chamfer of a peg.
    pub peg_chamfer: u16,
    /// Points of the edge of a hole on the side of a peg.
    pub peg_side: u16,
    /// Points on wall, box or sphere, or on sides and lower face of the plate.
    #[serde(rename = "other")]
    pub solid: u16,
}

impl Features {
    /// Returns whether there is any contact.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }

    /// Returns the number of points.
    pub const fn total(&self) -> u16 {
        let Self { solid, face, cone, bore, peg_end, peg_chamfer, peg_side } = *self;
        solid + face + cone + bore + peg_end + peg_chamfer + peg_side
    }

    /// Returns whether a peg touches the bore and the edge of a hole simultaneously: two-point contact, which can jam.
    pub const fn is_two_point(&self) -> bool {
        self.bore > 0 && self.peg_side > 0
    }

    /// Counts a point.
    pub(super) const fn add(&mut self, feature: Feature) {
        let count = match feature {
            Feature::Solid => &mut self.solid,
            Feature::Face => &mut self.face,
            Feature::Cone => &mut self.cone,
            Feature::Bore => &mut self.bore,
            Feature::PegEnd => &mut self.peg_end,
            Feature::PegChamfer => &mut self.peg_chamfer,
            Feature::PegSide => &mut self.peg_side,
        };
        *count = count.saturating_add(1);
    }
}
