//! Greatest torque demand and motion of an arm since a watch began: ground truth for tests.

use crate::arm::Joints;

/// Extremes since the watch began.
#[derive(Clone, Copy, Debug)]
pub struct Extremes {
    from: Joints,
    /// Greatest torque demand of any drive, in ‰ of rated torque.
    pub demand: f64,
    /// Greatest distance of any joint from its start, in rad or m.
    pub motion: f64,
}

impl Extremes {
    /// Begins a watch with the joints at `q`, in rad or m.
    pub(crate) const fn new(q: Joints) -> Self {
        Self { from: q, demand: 0.0, motion: 0.0 }
    }

    pub(crate) fn on_demands(&mut self, demands: &[f64; 6]) {
        let greatest = demands.iter().fold(0.0, |most: f64, demand| most.max(demand.abs()));
        self.demand = self.demand.max(greatest);
    }

    pub(crate) fn on_motion(&mut self, q: &Joints) {
        self.motion = self.motion.max((q - self.from).amax());
    }
}
