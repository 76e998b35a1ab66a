//! What one joint's motion meets: friction and end stops.

/// An end stop's spring, in N·m/rad (N/m for a sliding joint).
pub(super) const STOP_STIFFNESS: f64 = 20e3;

/// An end stop's damper, in N·m·s/rad (N·s/m).
const STOP_DAMPING: f64 = 60.0;

/// What one joint's motion meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
    /// Where its end stops are, in rad (m).
    pub range: [f64; 2],
}

impl Resistance {
    /// Whether there is dry friction, which can hold a joint where it is.
    pub(super) fn can_hold(&self) -> bool {
        self.coulomb > 0.0
    }

    /// The velocity after `h` s of a joint at `q` whose `inertia` has got `momentum`, against friction
    /// and, if it would end up beyond one, an end stop. A stop never pulls.
    pub(super) fn velocity(&self, h: f64, q: f64, inertia: f64, momentum: f64) -> f64 {
        let inertia = inertia + h * self.viscous;
        let free = beyond(momentum, h * self.coulomb) / inertia;
        let end = self.past_stop(q + h * free);
        if end.abs() <= 0.0 {
            return free;
        }
        let to_stop = end - h * free; // how far past it is without moving; negative if not yet there
        let push = beyond(momentum - h * STOP_STIFFNESS * to_stop, h * self.coulomb);
        let is_pressed = self.past_stop(q) * push > 0.0;
        let damping = if is_pressed { STOP_DAMPING } else { 0.0 };
        push / (inertia + h * damping + h * h * STOP_STIFFNESS)
    }

    /// How far `q` is past the upper stop or, negative, the lower one; zero between them.
    pub(super) fn past_stop(&self, q: f64) -> f64 {
        let [low, high] = self.range;
        (q - high).max(0.0) + (q - low).min(0.0)
    }
}

/// How far `value` reaches out of the band ±`dry`: dry friction takes the rest.
fn beyond(value: f64, dry: f64) -> f64 {
    value - value.clamp(-dry, dry)
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 250e-6;

    #[test]
    fn an_end_stop_lets_go_at_once() {
        let leaving = |range| {
            let resistance = Resistance { coulomb: 0.0, viscous: 0.0, range };
            resistance.velocity(H, 1e-4, 0.1, -0.1)
        };
        assert!((leaving([-1.0, 0.0]) - leaving([-1.0, 1.0])).abs() < 1e-12);
    }
}
