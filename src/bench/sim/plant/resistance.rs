//! Resistance of one joint: friction and end stops.

/// Stiffness of an end stop, in N·m/rad (N/m for a prismatic joint).
pub(super) const STOP_STIFFNESS: f64 = 20e3;

/// Damping of an end stop, in N·m·s/rad (N·s/m).
const STOP_DAMPING: f64 = 60.0;

/// Speed at which the excess of static friction has fallen to 1/e, in rad/s (m/s).
const STRIBECK_SPEED: f64 = 0.05;

/// Friction and end stops of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// Dry friction, in N·m (N).
    pub coulomb: f64,
    /// Excess of static over dry friction, in N·m (N); it vanishes with the speed (Stribeck 1902).
    pub stiction: f64,
    /// Viscous friction, in N·m·s/rad (N·s/m).
    pub viscous: f64,
    /// Positions of the end stops, in rad (m).
    pub range: [f64; 2],
}

impl Resistance {
    /// Returns whether dry friction can hold the joint.
    pub(super) fn can_hold(&self) -> bool {
        self.coulomb + self.stiction > 0.0
    }

    /// Returns the dry friction at velocity `qd`: `f_c + f_s exp(-(qd/v_s)²)`.
    pub(crate) fn dry(&self, qd: f64) -> f64 {
        self.coulomb + self.stiction * (-(qd / STRIBECK_SPEED).powi(2)).exp()
    }

    /// Returns the velocity after `h` s of a joint at `q` with `inertia` and `momentum`. [Dry](Self::dry) and viscous
    /// friction and an end stop within reach oppose it. A stop never pulls.
    pub(super) fn velocity(&self, h: f64, q: f64, dry: f64, [inertia, momentum]: [f64; 2]) -> f64 {
        let dry = h * dry;
        let inertia = inertia + h * self.viscous;
        let free = beyond(momentum, dry) / inertia;
        let end = self.past_stop(q + h * free);
        if end.abs() <= 0.0 {
            return free;
        }
        let to_stop = end - h * free; // distance past the stop without motion; negative before it
        let push = beyond(momentum - h * STOP_STIFFNESS * to_stop, dry);
        let is_pressed = self.past_stop(q) * push > 0.0;
        let damping = if is_pressed { STOP_DAMPING } else { 0.0 };
        push / (inertia + h * damping + h * h * STOP_STIFFNESS)
    }

    /// Returns the distance of `q` past the upper stop, or negative past the lower one; zero between them.
    pub(super) fn past_stop(&self, q: f64) -> f64 {
        let [low, high] = self.range;
        if q > high {
            q - high
        } else if q < low {
            q - low
        } else {
            0.0
        }
    }
}

/// Returns the part of `value` outside ±`dry`: dry friction takes the rest.
fn beyond(value: f64, dry: f64) -> f64 {
    if value.abs() <= dry {
        0.0
    } else if value > 0.0 {
        value - dry
    } else {
        value + dry
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 250e-6;

    #[test]
    fn joint_at_rest_breaks_away_above_its_sliding_friction() {
        let range = [-1.0, 1.0];
        let resistance = Resistance { coulomb: 0.1, stiction: 0.05, viscous: 0.0, range };
        let after = |qd, torque: f64| {
            resistance.velocity(H, 0.0, resistance.dry(qd), [1.0, qd + H * torque]) - qd
        };
        assert!(after(0.0, 0.149).abs() <= 0.0 && after(0.0, 0.151) > 0.0);
        // Sliding fast, only the dry friction is left.
        assert!(after(1.0, 0.1).abs() < 1e-12 && after(1.0, 0.12) > 0.0);
    }

    #[test]
    fn end_stop_never_pulls() {
        let leaving = |range| {
            let resistance = Resistance { coulomb: 0.0, stiction: 0.0, viscous: 0.0, range };
            resistance.velocity(H, 1e-4, resistance.dry(-1.0), [0.1, -0.1])
        };
        assert!((leaving([-1.0, 0.0]) - leaving([-1.0, 1.0])).abs() < 1e-12);
    }
}
