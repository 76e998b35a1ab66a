//! Certificates, sessions of zenoh other than `frhc-link`, and the program with the test at its local socket.
#![allow(
    clippy::disallowed_methods,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    dead_code,
    reason = "what a test cannot do without has failed the test; each test file uses a part of this"
)]

pub(crate) mod peer;
pub(crate) mod program;

use std::fs;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, IsCa, Issuer, KeyPair,
};
use time::OffsetDateTime;

/// Maximum wait for a line, or for an expected message.
const RECEIVE_TIMEOUT: Duration = Duration::from_secs(20);

/// Authority of a test.
pub(crate) struct Authority {
    issuer: Issuer<'static, KeyPair>,
    pem: String,
}

impl Authority {
    pub(crate) fn new() -> Self {
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        // The same name for all: that another one signed is to be found by its key.
        params.distinguished_name = named("authority");
        let pem = params.self_signed(&key).unwrap().pem();
        Self { issuer: Issuer::new(params, key), pem }
    }

    /// Writes keys of a file name and common name into a folder.
    pub(crate) fn write(
        &self,
        folder: &Path,
        file: &str,
        name: &str,
        from: OffsetDateTime,
        to: OffsetDateTime,
    ) {
        fs::create_dir_all(folder).unwrap();
        let key = KeyPair::generate().unwrap();
        let mut params = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        params.distinguished_name = named(name);
        (params.not_before, params.not_after) = (from, to);
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        let private = |name: String, text: String| {
            let mut options = fs::OpenOptions::new();
            let file = options.write(true).create(true).mode(0o600).open(folder.join(name));
            std::io::Write::write_all(&mut file.unwrap(), text.as_bytes()).unwrap();
        };
        private("authority.pem".to_owned(), self.pem.clone());
        private(format!("{file}.pem"), certificate.pem());
        private(format!("{file}.key"), key.serialize_pem());
    }
}

fn named(name: &str) -> DistinguishedName {
    let mut distinguished = DistinguishedName::new();
    distinguished.push(DnType::CommonName, name);
    distinguished
}

/// Keys of a peer: the authority that it trusts, and the folder of its own keys, if any.
pub(crate) struct PeerKeys {
    pub(crate) authority: PathBuf,
    pub(crate) own: Option<PathBuf>,
}

/// Returns a UDP port that was free a moment ago.
pub(crate) fn free_port() -> u16 {
    std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}
