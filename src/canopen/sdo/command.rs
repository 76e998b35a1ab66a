//! Bits of the first byte of an SDO frame (CiA 301, 7.2.4.3): the specifier in its three highest bits, and flags.

/// Client: a segment of a download.
pub(crate) const CCS_DOWNLOAD_SEGMENT: u8 = 0;
/// Client: initiates a download.
pub(crate) const CCS_DOWNLOAD: u8 = 1;
/// Client: initiates an upload.
pub(crate) const CCS_UPLOAD: u8 = 2;
/// Client: block upload.
pub(crate) const CCS_BLOCK_UPLOAD: u8 = 5;
/// Client: block download.
pub(crate) const CCS_BLOCK_DOWNLOAD: u8 = 6;

/// Server: confirms a download.
pub(crate) const SCS_DOWNLOAD: u8 = 3;
/// Server: answers the initiation of an upload.
pub(crate) const SCS_UPLOAD: u8 = 2;
/// Server: block download.
pub(crate) const SCS_BLOCK_DOWNLOAD: u8 = 5;

/// Either side: aborts the transfer.
pub(crate) const CS_ABORT: u8 = 4;
/// First byte of an abort.
pub(crate) const ABORT: u8 = CS_ABORT << 5;

/// Bit e: the frame carries the value; bits 2 and 3 count its unused bytes.
pub(crate) const EXPEDITED: u8 = 1 << 1;
/// Bit s: the size is indicated.
pub(crate) const SIZE_INDICATED: u8 = 1;
