//! Simulated gripper of the virtual object and the simulated robot.
//!
//! Its fingers move at a limited speed and press an object like a spring, with at most the commanded force. The last
//! command remains in effect, so that a gripper without commands does not drop its object.

use contract::Gripper;

/// Parameters of a simulated gripper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripperSettings {
    /// Maximum opening, in m, which is also the initial one.
    pub stroke: f64,
    /// Maximum speed of opening and closing, in m/s.
    pub max_speed: f64,
    /// Object between the fingers.
    pub object: Option<GrippedObject>,
}

/// Object between the fingers of a gripper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrippedObject {
    /// Width, in m.
    pub width: f64,
    /// Stiffness of object and fingers, in N/m.
    pub stiffness: f64,
}

impl GrippedObject {
    /// Returns the force at an opening, in N.
    fn force(&self, opening: f64) -> f64 {
        (self.stiffness * (self.width - opening)).max(0.0)
    }

    /// Returns the opening in m at which a force in N presses the object; at least zero.
    fn opening(&self, force: f64) -> f64 {
        (self.width - force.max(0.0) / self.stiffness).max(0.0)
    }
}

/// Simulated gripper with its opening and command.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedGripper {
    settings: GripperSettings,
    /// Opening, in m.
    opening: f64,
    /// Newest command.
    command: Option<Gripper>,
}

impl SimulatedGripper {
    /// Creates a gripper, open and at rest.
    pub const fn new(settings: GripperSettings) -> Self {
        Self { settings, opening: settings.stroke, command: None }
    }

    /// Moves for `dt` s towards `command`, or the last one if it is `None`; returns opening and force.
    pub fn step(&mut self, dt: f64, command: Option<Gripper>) -> Gripper {
        self.command = command.or(self.command);
        if let Some(Gripper { position, force }) = self.command {
            let GripperSettings { stroke, max_speed, object } = self.settings;
            let travel = max_speed * dt;
            let least = object.map_or(0.0, |object| object.opening(force));
            let aim = position.max(least).min(stroke);
            let moved = aim.max(self.opening - travel).min(self.opening + travel);
            // A force above the commanded one is released at once, faster than the speed limit.
            self.opening = moved.max(least);
        }
        self.measured()
    }

    /// Returns opening in m and force in N.
    pub fn measured(&self) -> Gripper {
        let force = self.settings.object.map_or(0.0, |object| object.force(self.opening));
        Gripper { position: self.opening, force }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const OBJECT: GrippedObject = GrippedObject { width: 0.03, stiffness: 5_000.0 };

    const SETTINGS: GripperSettings =
        GripperSettings { stroke: 0.08, max_speed: 0.1, object: Some(OBJECT) };

    /// Follows a command for some milliseconds; returns opening and force.
    fn followed(gripper: &mut SimulatedGripper, millis: u32, command: Option<Gripper>) -> Gripper {
        (0..millis).for_each(|_| _ = gripper.step(1e-3, command));
        gripper.measured()
    }

    fn closed(force: f64) -> Option<Gripper> {
        Some(Gripper { position: 0.0, force })
    }

    #[test]
    fn gripper_closes_on_its_object_with_the_commanded_force() {
        let mut gripper = SimulatedGripper::new(SETTINGS);
        assert_eq!(followed(&mut gripper, 100, None), Gripper { position: 0.08, force: 0.0 });
        let Gripper { position, force } = followed(&mut gripper, 250, closed(20.0));
        assert!((position - 0.055).abs() < 1e-9 && force == 0.0, "0.1 m/s: {position}");
        let Gripper { position, force } = followed(&mut gripper, 500, closed(20.0));
        assert!((position - 0.026).abs() < 1e-9 && (force - 20.0).abs() < 1e-6, "{position}");
        let Gripper { force, .. } = followed(&mut gripper, 1, closed(5.0));
        assert!((force - 5.0).abs() < 1e-6, "{force} N");
    }

    #[test]
    fn gripper_without_commands_keeps_its_object() {
        let mut gripper = SimulatedGripper::new(SETTINGS);
        let held = followed(&mut gripper, 1_000, closed(20.0));
        assert_eq!(followed(&mut gripper, 1_000, None), held);
    }

    #[test]
    fn gripper_without_an_object_closes_without_force() {
        let settings = GripperSettings { object: None, ..SETTINGS };
        let mut gripper = SimulatedGripper::new(settings);
        let measured = followed(&mut gripper, 1_000, closed(20.0));
        assert_eq!(measured, Gripper { position: 0.0, force: 0.0 });
    }

    proptest! {
        #[test]
        fn force_and_speed_stay_within_their_limits(
            commands in prop::collection::vec((-1e3..1e3_f64, -1e3..1e3_f64, 0.0..0.01_f64), 1..50)
        ) {
            let mut gripper = SimulatedGripper::new(SETTINGS);
            for (position, limit, dt) in commands {
                let before = gripper.measured();
                let Gripper { position, force } =
                    gripper.step(dt, Some(Gripper { position, force: limit }));
                prop_assert!((0.0..=SETTINGS.stroke).contains(&position));
                prop_assert!(force <= limit.max(0.0) + 1e-9, "{force} of {limit} N");
                let travel = SETTINGS.max_speed * dt + 1e-12;
                prop_assert!(before.position - position <= travel);
                // The speed limit is exceeded only to release a force above the commanded one.
                prop_assert!(position - before.position <= travel || before.force > limit.max(0.0));
            }
        }
    }
}
