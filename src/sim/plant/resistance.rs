//! Resistance of one joint: friction and end stops.

/// Stiffness of an end stop, in N·m/rad (N/m for a prismatic joint).
pub(super) const STOP_STIFFNESS: f64 = 20e3;

/// Damping of an end stop, in N·m·s/rad (N·s/m).
const STOP_DAMPING: f64 = 60.0;

/// Friction and end stops of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
    /// Positions of the end stops, in rad (m).
    pub range: [f64; 2],
}

impl Resistance {
    /// Returns whether dry friction can hold the joint.
    pub(super) fn can_hold(&self) -> bool {
        self.coulomb > 0.0
    }

    /// Returns the velocity after `h` s of a joint at `q` with `inertia` and `momentum`, against friction and an end
    /// stop within reach. A stop never pulls.
    pub(super) fn velocity(&self, h: f64, q: f64, inertia: f64, momentum: f64) -> f64 {
        let inertia = inertia + h * self.viscous;
        let free = beyond(momentum, h * self.coulomb) / inertia;
        let end = self.past_stop(q + h * free);
        if end.abs() <= 0.0 {
            return free;
        }
        let to_stop = end - h * free; // distance past the stop without motion; negative before it
        let push = beyond(momentum - h * STOP_STIFFNESS * to_stop, h * self.coulomb);
        let is_pressed = self.past_stop(q) * push > 0.0;
        let damping = if is_pressed { STOP_DAMPING } else { 0.0 };
        push / (inertia + h * damping + h * h * STOP_STIFFNESS)
    }

    /// Returns the distance of `q` past the upper stop, or negative past the lower one; zero between them.
    pub(super) fn past_stop(&self, q: f64) -> f64 {
        let [low, high] = self.range;
        (q - high).max(0.0) + (q - low).min(0.0)
    }
}

/// Returns the part of `value` outside ±`dry`: dry friction takes the rest.
fn beyond(value: f64, dry: f64) -> f64 {
    value - value.clamp(-dry, dry)
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 250e-6;

    #[test]
    fn end_stop_never_pulls() {
        let leaving = |range| {
            let resistance = Resistance { coulomb: 0.0, viscous: 0.0, range };
            resistance.velocity(H, 1e-4, 0.1, -0.1)
        };
        assert!((leaving([-1.0, 0.0]) - leaving([-1.0, 1.0])).abs() < 1e-12);
    }
}
