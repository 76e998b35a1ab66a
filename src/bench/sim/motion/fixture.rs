//! Test fixture: the modes of operation move a [`Rotor`].

use crate::motion::rotor::Rotor;
use crate::motion::{Motion, Ramp, SERVO_PERIOD, TorqueDemand, Tuning};
use canopen::NodeId;
use canopen::drive::Controlword;
use canopen::eds::Eds;
use canopen::object::Object;
use canopen_device::dictionary::Dictionary;

/// Returns the object dictionary of a drive with default values.
pub(super) fn drive() -> Dictionary {
    let eds = Eds::parse(include_bytes!("../../../../eds/frhc_drive.eds")).unwrap();
    Dictionary::new(&eds, NodeId::new(1).unwrap())
}

/// Increments per revolution of the encoder, as 608Fh has them.
pub(super) const INCREMENTS: f64 = 16_384.0;

/// Sets an object to the low bytes of `number`.
pub(super) fn put(dictionary: &mut Dictionary, object: Object, number: u32) {
    let size = dictionary.get(object).unwrap().len();
    assert!(dictionary.set(object, &number.to_le_bytes()[..size]));
}

/// Controlword: enable operation.
pub(super) const ENABLED: u16 = 0x0F;
/// Controlword bit 4: new set-point, start homing, enable interpolation.
pub(super) const START: u16 = 1 << 4;
/// Controlword bit 5: change set immediately.
pub(super) const IMMEDIATELY: u16 = 1 << 5;
/// Controlword bit 6: relative.
pub(super) const RELATIVE: u16 = 1 << 6;
/// Controlword bit 8: halt.
pub(super) const HALT: u16 = 1 << 8;

#[derive(Debug)]
pub(super) struct Fixture {
    pub(super) motion: Motion,
    pub(super) rotor: Rotor,
    pub(super) dictionary: Dictionary,
    pub(super) demand: TorqueDemand,
}

impl Fixture {
    /// Creates the fixture in `mode`, with the motor at rest at zero.
    pub(super) fn new(mode: i8) -> Self {
        Self::with(mode, Rotor::default(), |_| {})
    }

    /// Creates the fixture in `mode`; `set_up` changes objects first.
    pub(super) fn with(mode: i8, rotor: Rotor, set_up: impl Fn(&mut Dictionary)) -> Self {
        let mut dictionary = drive();
        set_up(&mut dictionary);
        let motion = Motion::new(Tuning::default(), INCREMENTS, &dictionary);
        let mut fixture = Self { motion, rotor, dictionary, demand: TorqueDemand::default() };
        fixture.begin(mode);
        fixture.set_controlword(ENABLED);
        fixture
    }

    pub(super) fn begin(&mut self, mode: i8) {
        self.motion.begin(mode, &self.rotor.feedback(), &self.dictionary);
    }

    pub(super) fn put(&mut self, object: Object, number: i32) {
        put(&mut self.dictionary, object, number.cast_unsigned());
    }

    pub(super) fn read(&self, object: Object) -> i32 {
        self.dictionary.unsigned(object).cast_signed()
    }

    pub(super) fn position(&mut self) -> i32 {
        self.motion.position(&self.rotor.feedback())
    }

    pub(super) fn set_controlword(&mut self, word: u16) {
        self.motion.on_controlword(Controlword(word), &self.rotor.feedback(), &self.dictionary);
        self.sync();
    }

    /// Applies the objects as a SYNC does, with no time elapsed.
    pub(super) fn sync(&mut self) -> TorqueDemand {
        self.demand = self.motion.step(0.0, &self.rotor.feedback(), &mut self.dictionary);
        self.demand
    }

    /// Runs one servo period.
    pub(super) fn tick(&mut self) -> TorqueDemand {
        self.demand = self.motion.step(SERVO_PERIOD, &self.rotor.feedback(), &mut self.dictionary);
        self.rotor.step(SERVO_PERIOD, self.demand.per_mille);
        self.demand
    }

    /// Runs `millis` servo periods.
    pub(super) fn run(&mut self, millis: u32) {
        (0..millis).for_each(|_| {
            self.tick();
        });
    }

    /// Runs one servo period of a stop.
    pub(super) fn brake(&mut self, ramp: Ramp) -> Option<TorqueDemand> {
        let feedback = self.rotor.feedback();
        let demand = self.motion.stop(SERVO_PERIOD, ramp, &feedback, &mut self.dictionary);
        self.rotor.step(SERVO_PERIOD, demand.unwrap_or_default().per_mille);
        demand
    }

    pub(super) fn has(&self, bit: u16) -> bool {
        self.demand.status & bit != 0
    }

    /// Runs until `is_so` and returns the time in ms; panics after `most`.
    pub(super) fn until(&mut self, most: u32, is_so: impl Fn(&mut Self) -> bool) -> u32 {
        for millis in 0..most {
            if is_so(self) {
                return millis;
            }
            self.tick();
        }
        panic!("not within {most} ms: {self:?}", self = (self.demand, self.rotor));
    }
}
