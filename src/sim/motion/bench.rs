//! A drive on a test bench: its modes move a [`Rotor`].

use crate::motion::Asked;
use crate::motion::Motion;
use crate::motion::Ramp;
use crate::motion::SERVO_PERIOD;
use crate::motion::Tuning;
use crate::motion::rotor::Rotor;
use crate::motion::tests::drive;
use crate::motion::tests::put;
use canopen::dictionary::Dictionary;
use canopen::drive::Controlword;
use canopen::object::Object;

/// Enable operation, and nothing else.
pub(super) const ENABLED: u16 = 0x0F;
/// Bit 4.
pub(super) const START: u16 = 1 << 4;
/// Bit 5.
pub(super) const IMMEDIATELY: u16 = 1 << 5;
/// Bit 6.
pub(super) const RELATIVE: u16 = 1 << 6;
/// Bit 8.
pub(super) const HALT: u16 = 1 << 8;

#[derive(Debug)]
pub(super) struct Bench {
    pub(super) motion: Motion,
    pub(super) rotor: Rotor,
    pub(super) dictionary: Dictionary,
    pub(super) asked: Asked,
}

impl Bench {
    /// In `mode`, with the motor at rest at zero.
    pub(super) fn new(mode: i8) -> Self {
        Self::with(mode, Rotor::default(), |_| {})
    }

    /// In `mode`, with objects set up.
    pub(super) fn with(mode: i8, rotor: Rotor, set_up: impl Fn(&mut Dictionary)) -> Self {
        let mut dictionary = drive();
        set_up(&mut dictionary);
        let motion = Motion::new(Tuning::default(), &dictionary);
        let mut bench = Self { motion, rotor, dictionary, asked: Asked::default() };
        bench.begin(mode);
        bench.word(ENABLED);
        bench
    }

    pub(super) fn begin(&mut self, mode: i8) {
        self.motion.begin(mode, &self.rotor.feedback(), &self.dictionary);
    }

    pub(super) fn put(&mut self, object: Object, number: i32) {
        put(&mut self.dictionary, object, number.cast_unsigned());
    }

    pub(super) fn shown(&self, object: Object) -> i32 {
        self.dictionary.unsigned(object).cast_signed()
    }

    pub(super) fn position(&mut self) -> i32 {
        self.motion.position(&self.rotor.feedback())
    }

    pub(super) fn word(&mut self, word: u16) {
        self.motion.on_controlword(Controlword(word), &self.rotor.feedback(), &self.dictionary);
        self.sync();
    }

    /// A set-point has come.
    pub(super) fn sync(&mut self) -> Asked {
        self.asked = self.motion.step(0.0, &self.rotor.feedback(), &mut self.dictionary);
        self.asked
    }

    /// One servo period.
    pub(super) fn tick(&mut self) -> Asked {
        self.asked = self.motion.step(SERVO_PERIOD, &self.rotor.feedback(), &mut self.dictionary);
        self.rotor.turn(SERVO_PERIOD, self.asked.per_mille);
        self.asked
    }

    /// So many ms.
    pub(super) fn run(&mut self, millis: u32) {
        (0..millis).for_each(|_| {
            self.tick();
        });
    }

    /// One servo period of a stop.
    pub(super) fn brake(&mut self, ramp: Ramp) -> Option<Asked> {
        let feedback = self.rotor.feedback();
        let asked = self.motion.stop(SERVO_PERIOD, ramp, &feedback, &mut self.dictionary);
        self.rotor.turn(SERVO_PERIOD, asked.unwrap_or_default().per_mille);
        asked
    }

    pub(super) fn has(&self, bit: u16) -> bool {
        self.asked.status & bit != 0
    }

    /// How many ms it takes, at most `most`, until `is_so`.
    pub(super) fn until(&mut self, most: u32, is_so: impl Fn(&mut Self) -> bool) -> u32 {
        for millis in 0..most {
            if is_so(self) {
                return millis;
            }
            self.tick();
        }
        panic!("not within {most} ms: {self:?}", self = (self.asked, self.rotor));
    }
}
