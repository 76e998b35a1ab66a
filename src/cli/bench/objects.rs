//! One object of one node, read or written on any bus.

use std::fmt;

use crate::cli::bench::Session;
use crate::cli::bench::SessionError;
use bus::Bus;
use canopen::NodeId;
use canopen::object::Object;
use canopen::sdo::Content;
use canopen::sdo::SdoError;
use canopen::sdo::Terms;
use canopen::sdo::Transfer;
use canopen::value::Octets;

/// Which object of which node, and on which terms it is carried.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// The node.
    pub node: NodeId,
    /// The object.
    pub object: Object,
    /// How long the node has for each answer, in segments or in blocks.
    pub terms: Terms,
}

/// Why it was not read or written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ObjectError {
    /// The bus.
    Session(SessionError),
    /// The node.
    Node {
        /// Which.
        node: NodeId,
        /// About which object.
        object: Object,
        /// What it said.
        error: SdoError,
    },
    /// The node took it, and holds something else.
    Differs {
        /// Which.
        node: NodeId,
        /// Which object.
        object: Object,
        /// What was written.
        written: Vec<u8>,
        /// What it holds.
        read: Vec<u8>,
    },
}

/// `node 3: 6071h refused: 06090030h value is invalid`.
impl fmt::Display for ObjectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Session(error) => error.fmt(f),
            Self::Node { node, object, error: error @ SdoError::Timeout } => {
                write!(f, "node {}: {object}: {error}", node.raw())
            }
            Self::Node { node, object, error } => {
                write!(f, "node {}: {object} {error}", node.raw())
            }
            Self::Differs { node, object, written, read } => {
                let (written, read) = (Octets(written), Octets(read));
                write!(f, "node {}: {object} is {read}, expected {written}", node.raw())
            }
        }
    }
}

impl std::error::Error for ObjectError {}

/// Reads what an object holds.
///
/// # Errors
/// When bus or node do not give it.
pub fn read<B: Bus>(session: &mut Session<B>, target: Target) -> Result<Content, ObjectError> {
    let Target { node, object, terms } = target;
    let outcome = session.run(|now, out| Transfer::read_on(terms, node, object, now, out));
    outcome.map_err(ObjectError::Session)?.map_err(|error| target.failed(error))
}

/// Writes `bytes`, and reads them back if they are to be verified.
///
/// # Errors
/// When bus or node do not take it, or the object then holds something else.
pub fn write<B: Bus>(
    session: &mut Session<B>,
    target: Target,
    bytes: &[u8],
    verify: bool,
) -> Result<(), ObjectError> {
    let Target { node, object, terms } = target;
    let mut out = Vec::new();
    let transfer = Transfer::write_on(terms, node, object, bytes.to_vec(), session.now(), &mut out);
    let mut transfer = transfer.map_err(|error| target.failed(error))?;
    session.queue(out);
    let outcome = session.carry(&mut transfer);
    outcome.map_err(ObjectError::Session)?.map_err(|error| target.failed(error))?;
    if !verify {
        return Ok(());
    }
    let content = read(session, target)?;
    // A reply without a size has four bytes, of which the type decides how many count.
    if content.exactly(bytes.len()) == Some(bytes) {
        return Ok(());
    }
    let (written, read) = (bytes.to_vec(), content.bytes().to_vec());
    Err(ObjectError::Differs { node, object, written, read })
}

impl Target {
    const fn failed(self, error: SdoError) -> ObjectError {
        ObjectError::Node { node: self.node, object: self.object, error }
    }
}
