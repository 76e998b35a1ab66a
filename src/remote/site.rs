//! The commanded side in this process: a virtual object, and a scene it can touch.

use std::time::Duration;

use nalgebra::Isometry3;
use nalgebra::Unit;
use nalgebra::Vector3;

use crate::Remote;
use crate::Sensed;
use crate::scene::Block;
use crate::scene::Scene;
use crate::scene::Sphere;
use crate::scene::Surface;
use crate::scene::Wall;
use robot::accommodation::Accommodation;
use robot::object::Object;
use robot::object::Servo;
use robot::payload::Payload;
use units::spatial::Motion;
use units::spatial::Wrench;
use units::time::Instant;

/// Gravity in the object's base, in m/s².
pub const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// A virtual object and what it can touch.
#[derive(Clone, Debug)]
pub struct Virtual {
    /// First pose of the object in its base.
    pub x_b_m: Isometry3<f64>,
    /// Pose of the force sensor in the frame under control.
    pub x_m_s: Isometry3<f64>,
    /// What the sensor carries.
    pub payload: Payload,
    /// How the object follows.
    pub servo: Servo,
    /// How it gives way in rate mode.
    pub accommodation: Accommodation,
    /// A plane to push against.
    pub wall: Option<(Vector3<f64>, Unit<Vector3<f64>>, Contact)>,
    /// A box to bump into: its centre and half its sides.
    pub block: Option<(Vector3<f64>, Vector3<f64>, Contact)>,
    /// A ball to slide over: its centre and its radius.
    pub sphere: Option<(Vector3<f64>, f64, Contact)>,
}

/// How a surface yields, and how it holds back what slides on it.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// In N/m.
    pub stiffness: f64,
    /// In N·s/m.
    pub damping: f64,
    /// Coefficient of dry friction.
    pub friction: f64,
}

/// How the site is reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// As it should be.
    Up,
    /// The same sample again and again, with the time it had.
    Frozen,
    /// Nothing comes through, either way.
    Lost,
}

/// An object under command in a scene.
#[derive(Clone, Debug)]
pub struct VirtualSite {
    object: Object,
    scene: Scene,
    before: Option<Instant>,
    longest: f64,
    link: Link,
    /// What came over the link last.
    known: Option<Sensed>,
    /// What its sensor says in place of what it feels.
    senses: Option<Wrench>,
}

impl VirtualSite {
    /// The object and the scene of `remote`, at rest, exchanged with once a `period`.
    pub fn new(remote: &Virtual, period: Duration) -> Self {
        let Virtual { x_b_m, x_m_s, payload, servo, accommodation, .. } = *remote;
        let object = Object::new(servo, x_b_m).giving_way(accommodation).carrying(
            x_m_s,
            payload,
            Vector3::from(GRAVITY),
        );
        let longest = 10.0 * period.as_secs_f64();
        let scene = scene(remote);
        Self { object, scene, before: None, longest, link: Link::Up, known: None, senses: None }
    }

    /// How it is reached from now on.
    pub const fn set_link(&mut self, link: Link) {
        self.link = link;
    }

    /// Its sensor is broken from now on, and says this.
    pub const fn pretend(&mut self, f_s: Wrench) {
        self.senses = Some(f_s);
    }

    /// The pose of the object in its base.
    pub const fn pose(&self) -> &Isometry3<f64> {
        self.object.pose()
    }
}

impl Remote for VirtualSite {
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed> {
        let command = if self.link == Link::Lost { &Motion::Hold } else { command };
        let f_m = self.scene.wrench(self.object.pose(), self.object.twist());
        let f_s = self.object.contact(&self.object.sensed(&f_m));
        // The time since the last exchange; after an overrun, no more than the world can bear.
        let dt = self.before.map_or(0.0, |before| now.since(before).as_secs_f64());
        self.object.step(dt.min(self.longest), command, &f_m);
        self.before = Some(now);
        let f_s = self.senses.unwrap_or(f_s);
        let sensed = Sensed { at: now, f_s, x_b_m: *self.object.pose() };
        let known = self.known.filter(|_| self.link != Link::Up).unwrap_or(sensed);
        self.known = Some(known);
        self.known
    }
}

/// What there is to touch.
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
