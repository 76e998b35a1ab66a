//! Datagrams of the link, byte by byte. Numbers are little-endian.
//!
//! Every datagram begins with 16 bytes:
//!
//! ```text
//!  at  bytes
//!   0  4      "frhc"
//!   4  1      version: 1
//!   5  1      kind: 1 initiation, 2 cookie, 3 response, 4 content
//!   6  2      zero
//!   8  8      epoch of the session; part of the key derivation
//! ```
//!
//! A datagram with content has 112 bytes, in both directions:
//!
//! ```text
//!  16  8      counter, from 0; the nonce of the sealed part
//!  24  88     sealed (ChaCha20-Poly1305): 72 bytes and a tag of 16
//!             0   8   stamp: sample time on the sender's clock, in µs
//!             8   8   echo: newest stamp received from the peer by then, in µs
//!             16  4   flags: bit 0, echo present; bit 1, sender armed; bits 2 and 3, content:
//!                     0 hold, 1 rate, 2 pose, 3 sample; all others zero
//!             20  24  six binary32: of a sample, force and moment at {S} in N and N·m; of a rate, the
//!                     twist of {MRF} in m/s and rad/s; else zero
//!             44  12  three binary32: position of {MRF} in its base, in m; of a sample and of a pose
//!             56  16  four binary32: its rotation as w, x, y, z
//! ```
//!
//! Header and counter are authenticated too: epoch and counter determine keys and nonce, and every other byte of them
//! has one legal value.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::reject::Reject;
use remote::Sensed;
use units::spatial::{Motion, Twist, Wrench};
use units::time::Instant;

/// Bytes of a datagram with content.
pub const LENGTH: usize = 112;

/// Bytes of the header.
pub const HEADER: usize = 16;

/// Bytes of the content before sealing.
pub const PLAIN: usize = 72;

/// Magic bytes and version.
const MAGIC: [u8; 5] = [b'f', b'r', b'h', b'c', 1];

/// Maximum component of a commanded twist, in m/s or rad/s.
const MAX_RATE: f64 = 100.0;

/// Tolerance of a binary32 quaternion's norm.
const NORM_TOLERANCE: f64 = 1e-3;

const HAS_ECHO: u32 = 1;
const ARMED: u32 = 1 << 1;
const HOLD: u32 = 0;
const RATE: u32 = 1 << 2;
const POSE: u32 = 2 << 2;
const SAMPLE: u32 = 3 << 2;

/// Kind of datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Requests a session.
    Initiation,
    /// Requests the initiation again, with this cookie.
    Cookie,
    /// Grants a session.
    Response,
    /// Carries a command or a sample.
    Content,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Initiation, Self::Cookie, Self::Response, Self::Content];

    const fn code(self) -> u8 {
        match self {
            Self::Initiation => 1,
            Self::Cookie => 2,
            Self::Response => 3,
            Self::Content => 4,
        }
    }
}

/// Encodes a header.
pub fn header(kind: Kind, epoch: u64) -> [u8; HEADER] {
    let [f, r, h, c, version] = MAGIC;
    let [e0, e1, e2, e3, e4, e5, e6, e7] = epoch.to_le_bytes();
    [f, r, h, c, version, kind.code(), 0, 0, e0, e1, e2, e3, e4, e5, e6, e7]
}

/// Decodes kind and epoch.
///
/// # Errors
/// [`Reject::Length`] and [`Reject::Foreign`].
pub fn read_header(bytes: &[u8]) -> Result<(Kind, u64), Reject> {
    let (header, _) = bytes.split_first_chunk::<HEADER>().ok_or(Reject::Length)?;
    let [beginning @ .., code, 0, 0, e0, e1, e2, e3, e4, e5, e6, e7] = *header else {
        return Err(Reject::Foreign);
    };
    let kind = Kind::ALL.into_iter().find(|kind| kind.code() == code);
    let kind = kind.filter(|_| beginning == MAGIC).ok_or(Reject::Foreign)?;
    Ok((kind, u64::from_le_bytes([e0, e1, e2, e3, e4, e5, e6, e7])))
}

/// Command or sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Content {
    /// To the robot: command of its object.
    Command(Motion),
    /// From the robot: wrench of the environment on the object at {S}, and pose of the object.
    Sample { f_s: Wrench, x_b_m: Isometry3<f64> },
}

/// Content with its stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload {
    /// Sample time, on the sender's clock.
    pub stamp: Instant,
    /// Newest stamp received from the peer by then.
    pub echo: Option<Instant>,
    /// The sender is armed.
    pub armed: bool,
    /// Content.
    pub content: Content,
}

impl Payload {
    /// Encodes the payload.
    pub fn encode(&self) -> [u8; PLAIN] {
        let (what, six, pose) = match self.content {
            Content::Command(Motion::Hold) => (HOLD, [0.0; 6], None),
            Content::Command(Motion::Rate(v_m)) => (RATE, v_m.components(), None),
            Content::Command(Motion::Pose(x_b_d)) => (POSE, [0.0; 6], Some(x_b_d)),
            Content::Sample { f_s, x_b_m } => (SAMPLE, f_s.components(), Some(x_b_m)),
        };
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let flags = what | flag(self.echo.is_some(), HAS_ECHO) | flag(self.armed, ARMED);
        let echo = self.echo.map_or(0, Instant::as_micros);
        let numbers = six.into_iter().chain(pose.map_or([0.0; 7], numbers)).map(single);
        let bytes = self.stamp.as_micros().to_le_bytes().into_iter();
        let bytes = bytes.chain(echo.to_le_bytes()).chain(flags.to_le_bytes());
        let bytes = bytes.chain(numbers.flat_map(f32::to_le_bytes));
        let mut plain = [0; PLAIN];
        plain.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        plain
    }

    /// Decodes a payload.
    ///
    /// # Errors
    /// [`Reject::Impossible`]: values out of range, or undefined flags.
    pub fn decode(plain: &[u8; PLAIN]) -> Result<Self, Reject> {
        let mut reader = Reader(plain);
        let (stamp, echo) =
            (u64::from_le_bytes(reader.take()?), u64::from_le_bytes(reader.take()?));
        let flags = u32::from_le_bytes(reader.take()?);
        let six = reader.numbers()?;
        let pose = reader.numbers()?;
        let content = match flags & !(HAS_ECHO | ARMED) {
            HOLD => Content::Command(Motion::Hold),
            RATE => Content::Command(Motion::Rate(twist(six)?)),
            POSE => Content::Command(Motion::Pose(isometry(pose)?)),
            SAMPLE => Content::Sample { f_s: Wrench::from_components(six), x_b_m: isometry(pose)? },
            _ => return Err(Reject::Impossible),
        };
        let stamp = Instant::from_micros(stamp);
        if let Content::Sample { f_s, x_b_m } = content
            && !(Sensed { at: stamp, f_s, x_b_m }).is_possible()
        {
            return Err(Reject::Impossible);
        }
        let echo = (flags & HAS_ECHO != 0).then_some(Instant::from_micros(echo));
        Ok(Self { stamp, echo, armed: flags & ARMED != 0, content })
    }
}

/// Bytes not read yet.
struct Reader<'b>(&'b [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Reject> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(Reject::Length)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn numbers<const N: usize>(&mut self) -> Result<[f64; N], Reject> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from(f32::from_le_bytes(self.take()?));
        }
        Ok(numbers)
    }
}

/// Checks the range of a commanded twist.
fn twist(six: [f64; 6]) -> Result<Twist, Reject> {
    let is_possible = six.iter().all(|part| part.abs() <= MAX_RATE);
    is_possible.then_some(Twist::from_components(six)).ok_or(Reject::Impossible)
}

/// Returns position, then rotation as w, x, y, z.
fn numbers(x: Isometry3<f64>) -> [f64; 7] {
    let (p, r) = (x.translation.vector, x.rotation);
    [p.x, p.y, p.z, r.w, r.i, r.j, r.k]
}

/// Checks a pose.
fn isometry([x, y, z, w, i, j, k]: [f64; 7]) -> Result<Isometry3<f64>, Reject> {
    let rotation = Quaternion::new(w, i, j, k);
    let is_rotation = (rotation.norm() - 1.0).abs() <= NORM_TOLERANCE;
    let pose =
        Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_normalize(rotation));
    let sensed = Sensed { at: Instant::ZERO, f_s: Wrench::ZERO, x_b_m: pose };
    (is_rotation && sensed.is_possible()).then_some(pose).ok_or(Reject::Impossible)
}

/// Rounds to binary32.
#[expect(
    clippy::as_conversions,
    clippy::cast_possible_truncation,
    reason = "rounds; what is too large becomes infinite, and the receiver rejects it"
)]
const fn single(value: f64) -> f32 {
    value as f32
}
