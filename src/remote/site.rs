//! Virtual commanded side in this process: an object in a scene.

use std::time::Duration;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::gripper::{GripperSettings, SimulatedGripper};
use crate::scene::{Block, Scene, Sphere, Surface, Wall};
use crate::{Command, Remote, RemoteSample, RobotJoints};
use robot::following_arm::FollowingArm;
use robot::god_object::{Coupling, GodObject};
use robot::interaction::Interaction;
use robot::object::{Object, Servo};
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

/// Gravity in the object's base, in m/s².
pub const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Parameters of a virtual object and its scene.
#[derive(Clone, Debug)]
pub struct Virtual {
    /// Initial pose of the object in its base.
    pub x_b_m: Isometry3<f64>,
    /// Arm that holds the object, at its initial posture; `None` for a free object.
    pub arm: Option<FollowingArm>,
    /// Sensor, payload, force accommodation and shared control.
    pub interaction: Interaction,
    /// Servo of the object.
    pub servo: Servo,
    /// Virtual coupling that draws the object in pose mode, so that surfaces stop it; `None` moves it by its servo.
    pub coupling: Option<Coupling>,
    /// Wall: point, normal, surface.
    pub wall: Option<(Vector3<f64>, Unit<Vector3<f64>>, Contact)>,
    /// Box: centre, half the edge lengths, surface.
    pub block: Option<(Vector3<f64>, Vector3<f64>, Contact)>,
    /// Sphere: centre, radius, surface.
    pub sphere: Option<(Vector3<f64>, f64, Contact)>,
    /// Gripper of the object; `None` without one.
    pub gripper: Option<GripperSettings>,
}

impl Virtual {
    /// Computes the contact wrench on the object at its initial pose, at {MRF}.
    pub fn contact_at_start(&self) -> Wrench {
        scene(self).wrench(&self.x_b_m, &Twist::ZERO)
    }
}

/// Stiffness, damping and friction of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Stiffness, in N/m.
    pub stiffness: f64,
    /// Damping, in N·s/m.
    pub damping: f64,
    /// Friction coefficient.
    pub friction: f64,
}

/// Virtual object under command, in a scene.
#[derive(Clone, Debug)]
pub struct VirtualSite {
    object: Object,
    drawn: Option<GodObject>,
    scene: Scene,
    gripper: Option<SimulatedGripper>,
    before: Option<Instant>,
    max_step: f64,
}

impl VirtualSite {
    /// Creates the object and scene of `remote`, at rest, with one exchange per `period`.
    pub fn new(remote: &Virtual, period: Duration) -> Self {
        let Virtual { x_b_m, arm, interaction, servo, .. } = *remote;
        let free = Object::new(servo, x_b_m).with_interaction(interaction);
        let object = arm.map_or(free, |arm| free.held_by(arm));
        let max_step = 10.0 * period.as_secs_f64();
        let scene = scene(remote);
        Self {
            object,
            drawn: remote.coupling.map(GodObject::new),
            scene,
            gripper: remote.gripper.map(SimulatedGripper::new),
            before: None,
            max_step,
        }
    }

    /// Returns the pose of the object in its base.
    pub const fn pose(&self) -> &Isometry3<f64> {
        self.object.pose()
    }

    /// Moves the object for `dt` s with the contact wrench `f_m`; in pose mode by its coupling, if configured.
    fn follow(&mut self, dt: f64, command: &Motion, f_m: &Wrench) {
        let Self { object, drawn, scene, .. } = self;
        match (drawn, command) {
            (Some(drawn), Motion::Pose(x_b_d)) if dt > 0.0 => {
                let contact = |x_b_m: &Isometry3<f64>, v_m: &Twist| scene.wrench(x_b_m, v_m);
                object.advance(dt, drawn.twist(dt, x_b_d, object.pose(), contact));
                drawn.reached(x_b_d, object.pose());
            }
            (drawn, command) => {
                drawn.iter_mut().for_each(GodObject::release);
                object.step(dt, command, f_m);
            }
        }
    }
}

impl Remote for VirtualSite {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        let f_m = self.scene.wrench(self.object.pose(), self.object.twist());
        let f_s = self.object.operator_wrench(&self.object.reading(&f_m));
        // Time since the last exchange, limited after an overrun so that the contact model stays stable.
        let dt = self.before.map_or(0.0, |before| now.since(before).as_secs_f64());
        let dt = dt.min(self.max_step);
        self.follow(dt, &command.motion, &f_m);
        let gripper = self.gripper.as_mut().map(|gripper| gripper.step(dt, command.gripper));
        self.before = Some(now);
        Some(RemoteSample { at: now, f_s, x_b_m: *self.object.pose(), gripper })
    }

    fn joints(&self) -> Option<RobotJoints> {
        self.object.arm().map(|arm| RobotJoints((*arm.q()).into()))
    }
}

/// Builds the scene of a virtual commanded side.
fn scene(remote: &Virtual) -> Scene {
    let surface =
        |Contact { stiffness, damping, friction }| Surface { stiffness, damping, friction };
    Scene {
        wall: remote.wall.map(|(point, normal, contact)| Wall {
            point,
            normal,
            surface: surface(contact),
        }),
        block: remote.block.map(|(centre, half_size, contact)| Block {
            centre,
            half_size,
            surface: surface(contact),
        }),
        sphere: remote.sphere.map(|(centre, radius, contact)| Sphere {
            centre,
            radius,
            surface: surface(contact),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::spatial::Twist;

    const STIFFNESS: f64 = 5_000.0;

    /// Returns a coupled object at `x`, 0.3 m above the base, with a wall at 0.55 m and a box from 0.8 m to 0.9 m.
    fn site(x: f64, contact: Contact) -> VirtualSite {
        let coupling = Coupling::new([STIFFNESS, STIFFNESS, STIFFNESS, 20.0, 20.0, 20.0], [0.0; 6]);
        let remote = Virtual {
            x_b_m: Isometry3::translation(x, 0.0, 0.3),
            arm: None,
            interaction: Interaction::default(),
            servo: Servo::new(0.01, 0.5, 2.0).unwrap(),
            coupling: Some(coupling.unwrap()),
            wall: (x < 0.55).then_some((Vector3::new(0.55, 0.0, 0.0), -Vector3::x_axis(), contact)),
            block: Some((Vector3::new(0.85, 0.0, 0.3), Vector3::new(0.05, 0.1, 0.1), contact)),
            sphere: None,
            gripper: None,
        };
        VirtualSite::new(&remote, Duration::from_millis(1))
    }

    /// Follows commands, one per millisecond; returns the last sample and the stretch of the coupling.
    fn followed(
        site: &mut VirtualSite,
        commands: impl Iterator<Item = Isometry3<f64>>,
    ) -> (RemoteSample, Twist) {
        let mut last = None;
        for (cycle, x_b_d) in (1..).zip(commands) {
            let at = Instant::ZERO + Duration::from_millis(1) * cycle;
            let sensed = site.exchange(at, &Motion::Pose(x_b_d).into()).unwrap();
            last = Some((sensed, Twist::reaching(&(x_b_d.inverse() * sensed.x_b_m), 1.0)));
        }
        last.unwrap()
    }

    #[test]
    fn rough_wall_carries_the_coupling_while_the_object_slides() {
        let rough = Contact { stiffness: 20_000.0, damping: 20.0, friction: 0.4 };
        let slide = (0..2_000).map(|cycle| {
            Isometry3::translation(0.54, 5e-5 * f64::from(cycle), 0.3) // 5 cm/s along the wall
        });
        let (RemoteSample { f_s, .. }, stretch) = followed(&mut site(0.5, rough), slide);
        assert!(f_s.force.x < -20.0 && f_s.force.y < -8.0, "{f_s:?}");
        assert!((f_s.force - stretch.linear * STIFFNESS).norm() < 0.01, "{f_s:?} {stretch:?}");
    }

    #[test]
    fn coupled_object_stays_on_its_side_of_a_box() {
        let stiff = Contact { stiffness: 50_000.0, damping: 20.0, friction: 0.0 };
        let through = (0..4_000).map(|_| Isometry3::translation(0.95, 0.0, 0.3));
        let (RemoteSample { x_b_m, .. }, _) = followed(&mut site(0.7, stiff), through);
        // The command is beyond the box, which yields by a tenth of the depth.
        assert!((0.78..0.80).contains(&x_b_m.translation.x), "{x_b_m}");
    }
}
