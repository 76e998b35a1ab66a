//! Reading and writing one object of one node.

use thiserror::Error;

use crate::live_bus::{Session, SessionError};
use bus::Bus;
use canopen::NodeId;
use canopen::object::Object;
use canopen::sdo::{Content, SdoError, SdoOptions, Transfer};
use canopen_tools::value::Octets;

/// Object of a node, and the options of its SDO transfer.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub node: NodeId,
    pub object: Object,
    /// Response timeout, and segmented or block transfer.
    pub options: SdoOptions,
}

/// Error of reading or writing an object.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ObjectError {
    /// Failure of the bus, or an interrupted session.
    #[error("{0}")]
    Session(SessionError),
    /// Transfer that the node aborted or did not answer: `node 3: 6071h refused: 06090030h value is invalid`.
    #[error("node {}: {object}{} {error}", node.raw(), if *error == SdoError::Timeout { ":" } else { "" })]
    Node {
        node: NodeId,
        object: Object,
        /// Error of the transfer.
        error: SdoError,
    },
    /// Value read back that differs from the one written.
    #[error("node {}: {object} is {}, expected {}", node.raw(), Octets(read), Octets(written))]
    Differs {
        node: NodeId,
        object: Object,
        /// Bytes written.
        written: Vec<u8>,
        /// Bytes read back.
        read: Vec<u8>,
    },
}

/// Reads the value of an object.
///
/// # Errors
/// Returns an error if the bus fails, or the node aborts the transfer or does not respond.
pub fn read<B: Bus>(session: &mut Session<B>, target: Target) -> Result<Content, ObjectError> {
    let Target { node, object, options } = target;
    let outcome = session.run(|now, out| Transfer::read_with(options, node, object, now, out));
    outcome.map_err(ObjectError::Session)?.map_err(|error| target.failed(error))
}

/// Writes `bytes`; with `verify` reads them back and compares.
///
/// # Errors
/// As [`read`], or the value read back differs.
pub fn write<B: Bus>(
    session: &mut Session<B>,
    target: Target,
    bytes: &[u8],
    verify: bool,
) -> Result<(), ObjectError> {
    let Target { node, object, options } = target;
    let mut out = Vec::new();
    let transfer =
        Transfer::write_with(options, node, object, bytes.to_vec(), session.now(), &mut out);
    let mut transfer = transfer.map_err(|error| target.failed(error))?;
    session.queue(out);
    let outcome = session.resume(&mut transfer);
    outcome.map_err(ObjectError::Session)?.map_err(|error| target.failed(error))?;
    if !verify {
        return Ok(());
    }
    let content = read(session, target)?;
    // An expedited response without size has four bytes; the type may use fewer.
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
