//! The Rust side of `contract_ends.py`: random messages, and what this contract makes of the messages and events of another program.
//!
//! ```text
//! contract_ends messages SEED COUNT     prints random messages of each kind: their fields and bytes, a JSON object a line
//! contract_ends decode                  reads messages in hexadecimal; prints what each decoder makes of them
//! contract_ends far-end ARM SESSION     reads events of a far side, with times in µs; prints the outcome of each
//! ```

use std::error::Error;
use std::fmt::Write as _;
use std::io::{BufRead, Write, stdin, stdout};
use std::time::Duration;

use contract::{
    Capability, Command, Echo, FarEnd, Feedback, Gripper, Head, Measurements, Motion,
    PayloadRemoval, Pose, Reason, Reject,
};
use units::time::Instant;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let mut out = stdout().lock();
    match words.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["messages", seed, count] => {
            let mut random = Random(seed.parse()?);
            for number in 0..count.parse::<u32>()? {
                writeln!(out, "{}", message(&mut random, number % 3))?;
            }
        }
        ["decode"] => {
            for line in stdin().lock().lines() {
                writeln!(out, "{}", decoded(&bytes(&line?)?))?;
            }
        }
        ["far-end", arm, session] => {
            let mut far = FarEnd::new(arm.parse()?, session.parse()?, Duration::from_millis(100));
            for line in stdin().lock().lines() {
                writeln!(out, "{}", outcome(&mut far, &line?)?)?;
            }
        }
        _ => {
            return Err(
                "usage: contract_ends messages SEED COUNT | decode | far-end ARM SESSION".into()
            );
        }
    }
    Ok(out.flush()?)
}

/// Random numbers: SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// Returns a number below `end`.
    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn is(&mut self) -> bool {
        self.below(2) == 1
    }

    /// Returns a number of 32 bits.
    fn word(&mut self) -> u32 {
        u32::try_from(self.next() >> 32).unwrap_or_default()
    }

    /// Returns a number within 0 and 1.
    fn share(&mut self) -> f64 {
        (f64::from(self.word()) + f64::from(self.word()) / 4_294_967_296.0) / 4_294_967_296.0
    }

    /// Returns a number within ±`limit`, now and then its bound, a zero or the least there is.
    fn within(&mut self, limit: f64) -> f64 {
        let sign = if self.is() { 1.0 } else { -1.0 };
        sign * match self.below(10) {
            0 => limit,
            1 => 0.0,
            2 => f64::from_bits(1),
            _ => limit * self.share(),
        }
    }

    fn all_within<const N: usize>(&mut self, limit: f64) -> [f64; N] {
        std::array::from_fn(|_| self.within(limit))
    }

    /// Returns a workspace whose minimum is not above its maximum.
    fn workspace(&mut self) -> [[f64; 3]; 2] {
        let axes = [(); 3].map(|()| {
            let [one, other] = self.all_within(2e9);
            (f64::min(one, other), f64::max(one, other))
        });
        [axes.map(|(low, _)| low), axes.map(|(_, high)| high)]
    }

    fn pose(&mut self) -> Pose {
        let position = self.all_within(1_000.0);
        let parts: [f64; 4] = self.all_within(1.0);
        let norm = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        let orientation =
            if norm > 0.01 { parts.map(|part| part / norm) } else { [0.0, 0.0, 0.0, -1.0] };
        Pose { position, orientation }
    }

    fn gripper(&mut self) -> Option<Gripper> {
        let [position, force] = self.all_within(1_000.0);
        self.is().then_some(Gripper { position, force })
    }

    fn head(&mut self) -> Head {
        let arm = u16::try_from(self.below(65_536)).unwrap_or_default();
        let own = Echo { session: self.next().max(1), sequence: self.next().max(1) };
        let echo = Echo { session: self.next(), sequence: self.next() };
        Head { arm, epoch: self.word(), own, echo }
    }
}

/// Returns a random message of a kind as a JSON object.
fn message(random: &mut Random, kind: u32) -> String {
    let head = random.head();
    let Head { arm, epoch, own, echo } = head;
    let (name, fields, bytes) = match kind {
        0 => command(random, head),
        1 => feedback(random, head),
        _ => capability(random, head),
    };
    format!(
        "{{\"kind\": \"{name}\", \"head\": [{arm}, {epoch}, {}, {}, {}, {}], {fields}, \"bytes\": \"{}\"}}",
        own.session,
        own.sequence,
        echo.session,
        echo.sequence,
        hexadecimal(&bytes)
    )
}

fn command(random: &mut Random, head: Head) -> (&'static str, String, Vec<u8>) {
    let motion = match random.below(3) {
        0 => Motion::Hold,
        1 => Motion::Rate(random.all_within(100.0)),
        _ => Motion::Pose(random.pose()),
    };
    let (is_engaged, asks_capability) = (random.is(), random.is());
    let gripper = random.gripper();
    let (rate, pose) = match motion {
        Motion::Hold => (None, None),
        Motion::Rate(rate) => (Some(rate), None),
        Motion::Pose(pose) => (None, Some(pose)),
    };
    let fields = format!(
        "\"rate\": {}, \"pose\": {}, \"engaged\": {is_engaged}, \"asks_capability\": {asks_capability}, \"gripper\": {}",
        array(rate.as_ref().map(<[f64; 6]>::as_slice)),
        of_pose(pose),
        of_gripper(gripper)
    );
    let command = Command { head, motion, is_engaged, asks_capability, gripper };
    ("Command", fields, command.encode().to_vec())
}

fn feedback(random: &mut Random, head: Head) -> (&'static str, String, Vec<u8>) {
    let code = u8::try_from(random.below(9)).unwrap_or_default();
    let reason = Reason::from_code(code).unwrap_or(Reason::None);
    let wrench: [f64; 6] = random.all_within(100_000.0);
    let (has_wrench, pose, has_pose) = (random.is(), random.pose(), random.is());
    let measured = Measurements {
        wrench: has_wrench.then_some(wrench),
        pose: has_pose.then_some(pose),
        gripper: random.gripper(),
    };
    let (obeyed_session, acted_sequence) = (random.next(), random.next());
    let fields = format!(
        "\"reason\": {code}, \"obeyed_session\": {obeyed_session}, \"acted_sequence\": {acted_sequence}, \"wrench\": {}, \
         \"pose\": {}, \"gripper\": {}",
        array(measured.wrench.as_ref().map(<[f64; 6]>::as_slice)),
        of_pose(measured.pose),
        of_gripper(measured.gripper)
    );
    let feedback = Feedback { head, reason, obeyed_session, acted_sequence, measured };
    ("Feedback", fields, feedback.encode().to_vec())
}

fn capability(random: &mut Random, head: Head) -> (&'static str, String, Vec<u8>) {
    let removal = u8::try_from(random.below(3)).unwrap_or_default();
    let capability = Capability {
        senses_wrench: random.is(),
        senses_pose: random.is(),
        has_gripper: random.is(),
        follows_rates: random.is(),
        follows_poses: random.is(),
        payload_removal: PayloadRemoval::from_code(removal).unwrap_or(PayloadRemoval::None),
        accommodation: random.all_within(1e9).map(f64::abs),
        deadband: random.all_within(1e9).map(f64::abs),
        servo_lag: random.within(1e9).abs(),
        sample_period: random.within(1e9).abs(),
        hold_after: random.within(1e9).abs(),
        // Infinity is sent as the largest figure.
        sensor_range: random.all_within(2e9).map(f64::abs),
        stiffest_contact: if random.is() { f64::INFINITY } else { random.within(1e9).abs() },
        max_speed: random.all_within(1e9).map(f64::abs),
        workspace: random.workspace(),
    };
    let [low, high] = &capability.workspace;
    let fields = format!(
        "\"flags\": [{}, {}, {}, {}, {}], \"payload_removal\": {removal}, \"accommodation\": {}, \"deadband\": {}, \
         \"times\": {}, \"sensor_range\": {}, \"stiffest_contact\": {}, \"max_speed\": {}, \"workspace_low\": {}, \
         \"workspace_high\": {}",
        capability.senses_wrench,
        capability.senses_pose,
        capability.has_gripper,
        capability.follows_rates,
        capability.follows_poses,
        array(Some(&capability.accommodation)),
        array(Some(&capability.deadband)),
        array(Some(&[capability.servo_lag, capability.sample_period, capability.hold_after])),
        array(Some(&capability.sensor_range)),
        number(capability.stiffest_contact),
        array(Some(&capability.max_speed)),
        array(Some(low)),
        array(Some(high)),
    );
    ("Capability", fields, capability.encode(&head).to_vec())
}

/// Returns a number as Python's JSON has it: `Infinity`, and the shortest text that reads as the same bits.
fn number(value: f64) -> String {
    if value.is_infinite() { "Infinity".to_owned() } else { format!("{value:?}") }
}

fn array(values: Option<&[f64]>) -> String {
    let Some(values) = values else { return "null".to_owned() };
    format!("[{}]", values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "))
}

fn of_pose(pose: Option<Pose>) -> String {
    let numbers =
        pose.map(|Pose { position: [x, y, z], orientation: [i, j, k, w] }| [x, y, z, i, j, k, w]);
    array(numbers.as_ref().map(<[f64; 7]>::as_slice))
}

fn of_gripper(gripper: Option<Gripper>) -> String {
    let numbers = gripper.map(|Gripper { position, force }| [position, force]);
    array(numbers.as_ref().map(<[f64; 2]>::as_slice))
}

/// Returns the result of each decoder for a message: its bytes encoded again, or the reason to reject it.
fn decoded(bytes: &[u8]) -> String {
    let words = |result: Result<Vec<u8>, Reject>| {
        result.map_or_else(|reject| reject.words().to_owned(), |again| hexadecimal(&again))
    };
    let command = words(Command::decode(bytes).map(|it| it.encode().to_vec()));
    let feedback = words(Feedback::decode(bytes).map(|it| it.encode().to_vec()));
    let capability = Capability::decode(bytes).map(|(head, it)| it.encode(&head).to_vec());
    let capability = capability.map_err(Reject::from);
    format!(
        "{{\"Command\": \"{command}\", \"Feedback\": \"{feedback}\", \"Capability\": \"{}\"}}",
        words(capability)
    )
}

/// Performs an event of a far side; returns its outcome, `-` for none.
fn outcome(far: &mut FarEnd, line: &str) -> Outcome<String> {
    let words: Vec<&str> = line.split(' ').collect();
    let at = |micros: &str| micros.parse().map(Instant::from_micros);
    let none = || "-".to_owned();
    Ok(match words.as_slice() {
        ["take", micros, message] => {
            let before = *far.rejects();
            far.on_message(at(micros)?, &bytes(message)?);
            let counted = far.rejects().iter().find(|(reject, count)| before.get(*reject) < *count);
            counted.map_or_else(none, |(reject, _)| reject.words().to_owned())
        }
        ["command", micros] => match far.motion(at(micros)?) {
            Motion::Hold => "hold".to_owned(),
            Motion::Rate(rate) => array(Some(&rate)),
            Motion::Pose(pose) => of_pose(Some(pose)),
        },
        ["hold", code] => {
            far.hold(Reason::from_code(code.parse()?).ok_or("no such reason")?);
            none()
        }
        ["feedback", micros] => hexadecimal(&far.feedback(at(micros)?, &Measurements::default())),
        ["capability", micros] => {
            far.capability(at(micros)?, &FIGURES).map_or_else(none, |message| hexadecimal(&message))
        }
        _ => return Err(format!("no such event: {line}").into()),
    })
}

/// Figures of a far side without limits.
const FIGURES: Capability = Capability {
    senses_wrench: true,
    senses_pose: true,
    has_gripper: false,
    follows_rates: true,
    follows_poses: true,
    payload_removal: PayloadRemoval::None,
    accommodation: [0.0; 6],
    deadband: [0.0; 6],
    servo_lag: 0.0,
    sample_period: 0.002,
    hold_after: 0.1,
    sensor_range: [f64::INFINITY; 2],
    stiffest_contact: f64::INFINITY,
    max_speed: [f64::INFINITY; 2],
    workspace: [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]],
};

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").ok();
        text
    })
}

/// Reads bytes in hexadecimal.
fn bytes(text: &str) -> Outcome<Vec<u8>> {
    let digits: Vec<u8> = text.bytes().collect();
    digits.chunks(2).map(|pair| Ok(u8::from_str_radix(std::str::from_utf8(pair)?, 16)?)).collect()
}
