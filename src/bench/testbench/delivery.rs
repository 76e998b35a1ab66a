//! Delivery state of a simulated drive: stored objects that the configuration states, and an encoder for which 6064h counts
//! as configured.
//!
//! 6064h is `encoder · 6092h / (608Fh · 6091h)` per revolution of the motor (CiA 402-2). A stated 608Fh is that of the
//! encoder; the drive then counts by its factors, independently of `encoder_counts_per_rev`. Factors that are not stated
//! are chosen to fit.

use canopen::nameplate::position_scale::PositionScale;
use canopen::nameplate::{Nameplate, Ratio};
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;
use config::JointParameters;
use sim::drive::Delivery;

/// Delivery state of a drive and its encoder.
pub(super) struct DeliveryState {
    /// Values stored in the drive.
    pub(super) delivery: Delivery,
    /// Encoder increments per revolution of the motor.
    pub(super) increments: f64,
}

impl DeliveryState {
    /// Computes the delivery state of the drive of `joint`, with the objects of `dictionary`.
    pub(super) fn new(joint: &JointParameters, dictionary: &Dictionary) -> Self {
        let Nameplate { polarity, scale, rated_torque, rated_current, modes, .. } =
            &joint.nameplate;
        let Factors { increments, encoder, feed } = Factors::new(joint, dictionary);
        let mut stored = vec![
            (Object::POLARITY, u32::from(*polarity)),
            (Object::ENCODER_INCREMENTS, encoder.0),
            (Object::ENCODER_REVOLUTIONS, encoder.1),
            (Object::VELOCITY_INCREMENTS, encoder.0),
            (Object::VELOCITY_REVOLUTIONS, encoder.1),
            (Object::GEAR_MOTOR_REVOLUTIONS, scale.gear.0),
            (Object::GEAR_SHAFT_REVOLUTIONS, scale.gear.1),
            (Object::FEED, feed.0),
            (Object::FEED_REVOLUTIONS, feed.1),
            (Object::RATED_TORQUE, rated_torque.rounded()),
            (Object::POSITION_UNIT, scale.unit.0),
        ];
        stored.extend(rated_current.map(|current| (Object::RATED_CURRENT, current.rounded())));
        stored.extend(modes.map(|modes| (Object::SUPPORTED_MODES, modes)));
        let delivery = Delivery { stored, has_unlisted_torque_mode: modes.is_some() };
        Self { delivery, increments }
    }
}

/// Encoder, and the stored factors between it and 6064h.
struct Factors {
    /// Increments per revolution of the motor.
    increments: f64,
    /// Encoder resolution (608Fh).
    encoder: Ratio,
    /// Feed constant (6092h).
    feed: Ratio,
}

impl Factors {
    fn new(joint: &JointParameters, dictionary: &Dictionary) -> Self {
        let has = |object| dictionary.entry(object).is_some();
        let PositionScale { counts, encoder, gear, feed, .. } = joint.nameplate.scale;
        let gear = if has(Object::GEAR_MOTOR_REVOLUTIONS) { gear } else { Ratio::ONE };
        // Position units per revolution of the shaft.
        let shaft = gear.times(counts).unwrap_or(Ratio::ONE);
        // 1:1 is a factor that is not used.
        let (encoder, feed) = match (encoder, feed) {
            (Some(encoder), Some(feed)) => (encoder, feed),
            (Some(one), None) | (None, Some(one)) if one == Ratio::ONE => (one, one),
            (encoder, feed) => (encoder.unwrap_or(shaft), feed.unwrap_or(shaft)),
        };
        let is_scaled = has(Object::ENCODER_INCREMENTS) && has(Object::FEED);
        let increments = if encoder == Ratio::ONE {
            let feed = if is_scaled { feed.value() } else { 1.0 };
            f64::from(counts) * gear.value() / feed
        } else {
            encoder.value()
        };
        Self { increments, encoder, feed }
    }
}
