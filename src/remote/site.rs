//! Virtual commanded side in this process: an object, and a scene in contact with it.

use std::time::Duration;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::scene::{Block, Scene, Sphere, Surface, Wall};
use crate::{Remote, Sensed};
use robot::accommodation::Accommodation;
use robot::object::{Object, Servo};
use robot::payload::Payload;
use units::spatial::{Motion, Wrench};
use units::time::Instant;

/// Gravity in the object's base, in m/s².
pub const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Parameters of a virtual object and its scene.
#[derive(Clone, Debug)]
pub struct Virtual {
    /// Initial pose of the object in its base.
    pub x_b_m: Isometry3<f64>,
    /// Pose of the force sensor in the frame under control.
    pub x_m_s: Isometry3<f64>,
    /// Payload beyond the sensor.
    pub payload: Payload,
    /// Servo of the object.
    pub servo: Servo,
    /// Force accommodation in rate mode.
    pub accommodation: Accommodation,
    /// Wall: point, normal, surface.
    pub wall: Option<(Vector3<f64>, Unit<Vector3<f64>>, Contact)>,
    /// Box: centre, half the edge lengths, surface.
    pub block: Option<(Vector3<f64>, Vector3<f64>, Contact)>,
    /// Sphere: centre, radius, surface.
    pub sphere: Option<(Vector3<f64>, f64, Contact)>,
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

/// State of the link to the commanded side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// Works.
    Up,
    /// Repeats the same sample with its old time.
    Frozen,
    /// Transmits nothing in either direction.
    Lost,
}

/// A virtual object under command, in a scene.
#[derive(Clone, Debug)]
pub struct VirtualSite {
    object: Object,
    scene: Scene,
    before: Option<Instant>,
    max_step: f64,
    link: Link,
    /// Last sample over the link.
    known: Option<Sensed>,
    /// Value of a broken sensor.
    sensor_fault: Option<Wrench>,
}

impl VirtualSite {
    /// Creates the object and scene of `remote`, at rest, with one exchange per `period`.
    pub fn new(remote: &Virtual, period: Duration) -> Self {
        let Virtual { x_b_m, x_m_s, payload, servo, accommodation, .. } = *remote;
        let object = Object::new(servo, x_b_m).with_accommodation(accommodation).with_payload(
            x_m_s,
            payload,
            Vector3::from(GRAVITY),
        );
        let max_step = 10.0 * period.as_secs_f64();
        let scene = scene(remote);
        Self {
            object,
            scene,
            before: None,
            max_step,
            link: Link::Up,
            known: None,
            sensor_fault: None,
        }
    }

    /// Sets the state of the link.
    pub const fn set_link(&mut self, link: Link) {
        self.link = link;
    }

    /// Sets the wrench that a broken sensor reports; `None` repairs it.
    pub const fn set_sensor_fault(&mut self, reported: Option<Wrench>) {
        self.sensor_fault = reported;
    }

    /// Returns the pose of the object in its base.
    pub const fn pose(&self) -> &Isometry3<f64> {
        self.object.pose()
    }
}

impl Remote for VirtualSite {
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed> {
        let command = if self.link == Link::Lost { &Motion::Hold } else { command };
        let f_m = self.scene.wrench(self.object.pose(), self.object.twist());
        let f_s = self.object.contact(&self.object.sensed(&f_m));
        // Time since the last exchange, limited after an overrun so that the contact model stays stable.
        let dt = self.before.map_or(0.0, |before| now.since(before).as_secs_f64());
        self.object.step(dt.min(self.max_step), command, &f_m);
        self.before = Some(now);
        let f_s = self.sensor_fault.unwrap_or(f_s);
        let sensed = Sensed { at: now, f_s, x_b_m: *self.object.pose() };
        let known = self.known.filter(|_| self.link != Link::Up).unwrap_or(sensed);
        self.known = Some(known);
        self.known
    }
}

/// Builds the scene.
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
