//! Noise_IK handshake over datagrams.
//!
//! ```text
//!  initiation, 128 bytes                    response, 64 bytes          cookie, 48 bytes
//!    0  16  header                            0  16  header               0  16  header
//!   16  96  Noise: e, es, s, ss              16  48  Noise: e, ee, se    16  16  first bytes of `e`
//!  112  16  cookie, or zero                                              32  16  cookie
//! ```
//!
//! No response is longer than its request, so the link amplifies nothing. The prologue is the header of the initiation:
//! both sides agree on version and epoch, or authentication fails.

use std::fmt;

use snow::{Builder, HandshakeState, StatelessTransportState};
use thiserror::Error;

use crate::datagram::{self, HEADER, Kind};

/// Bytes of an initiation.
pub const INITIATION: usize = 128;

/// Bytes of a response.
pub const RESPONSE: usize = 64;

/// The handshake and its primitives (Noise, revision 34).
const PATTERN: &str = "Noise_IK_25519_ChaChaPoly_BLAKE2s";

/// Bytes of a key of X25519.
pub const KEY: usize = 32;

/// Static keys: our own, and the only accepted peer's.
#[derive(Clone)]
pub struct Keys {
    /// Our secret key.
    pub secret: [u8; KEY],
    /// The peer's public key.
    pub peer: [u8; KEY],
}

impl fmt::Debug for Keys {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Keys")
    }
}

/// A key pair.
#[derive(Clone)]
pub struct Pair {
    /// Secret key.
    pub secret: [u8; KEY],
    /// Public key, for the peer.
    pub public: [u8; KEY],
}

impl fmt::Debug for Pair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pair({:02x?})", self.public)
    }
}

/// Cryptographic failure: no randomness, or an invalid message.
#[derive(Debug, Error)]
#[error("handshake failed: {0}")]
pub struct Failed(#[from] pub snow::Error);

impl Pair {
    /// Generates a pair from the operating system's randomness.
    ///
    /// # Errors
    /// The system provides no randomness.
    pub fn generate() -> Result<Self, Failed> {
        let pair = Builder::new(PATTERN.parse()?).generate_keypair()?;
        let key = |bytes: &[u8]| bytes.try_into().map_err(|_| snow::Error::Input);
        Ok(Self { secret: key(&pair.private)?, public: key(&pair.public)? })
    }
}

/// Starts a handshake; returns its state and the initiation.
///
/// # Errors
/// No randomness, or an invalid key.
pub fn initiate(keys: &Keys, epoch: u64) -> Result<(HandshakeState, [u8; INITIATION]), Failed> {
    let prologue = datagram::header(Kind::Initiation, epoch);
    let builder = Builder::new(PATTERN.parse()?).prologue(&prologue)?;
    let builder = builder.local_private_key(&keys.secret)?.remote_public_key(&keys.peer)?;
    let mut state = builder.build_initiator()?;
    let mut bytes = [0; INITIATION];
    let (header, rest) = bytes.split_at_mut(HEADER);
    header.copy_from_slice(&prologue);
    state.write_message(&[], rest)?;
    Ok((state, bytes))
}

/// Answers an initiation; returns the session's ciphers and the response. `message` is the Noise part of the
/// initiation.
///
/// # Errors
/// The initiation is not authentic, or not from the peer.
pub fn respond(
    keys: &Keys,
    epoch: u64,
    message: &[u8],
) -> Result<(StatelessTransportState, [u8; RESPONSE]), Failed> {
    let prologue = datagram::header(Kind::Initiation, epoch);
    let builder = Builder::new(PATTERN.parse()?).prologue(&prologue)?;
    let mut state = builder.local_private_key(&keys.secret)?.build_responder()?;
    state.read_message(message, &mut [])?;
    if state.get_remote_static() != Some(&keys.peer) {
        return Err(Failed(snow::Error::Decrypt));
    }
    let mut bytes = [0; RESPONSE];
    let (header, rest) = bytes.split_at_mut(HEADER);
    header.copy_from_slice(&datagram::header(Kind::Response, epoch));
    state.write_message(&[], rest)?;
    Ok((state.into_stateless_transport_mode()?, bytes))
}
