//! Carriers: zenoh's endpoints, and a session over one of them.

use std::path::Path;

use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
use zenoh::{Config, Session, Wait};

use crate::Outcome;
use crate::options::Options;

/// Carrier of the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Carrier {
    /// QUIC: reliable messages in a stream, the others in datagrams.
    QuicMixed,
    /// QUIC: all messages in datagrams.
    QuicDatagram,
    /// TLS over TCP.
    Tls,
    /// UDP, without identity.
    Udp,
}

impl Carrier {
    const ALL: [Self; 4] = [Self::QuicMixed, Self::QuicDatagram, Self::Tls, Self::Udp];

    /// Name in arguments and rows.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::QuicMixed => "quic-mixed",
            Self::QuicDatagram => "quic-datagram",
            Self::Tls => "tls",
            Self::Udp => "udp",
        }
    }

    /// Returns the carrier with this name in the arguments.
    pub(crate) fn from_name(name: &str) -> Outcome<Self> {
        let carrier = Self::ALL.into_iter().find(|carrier| carrier.name() == name);
        carrier.ok_or(format!("unknown carrier {name}").into())
    }

    fn endpoint(self, port: u16) -> String {
        match self {
            Self::QuicMixed => format!("quic/127.0.0.1:{port}?mixed_rel=1"),
            Self::QuicDatagram => format!("quic/127.0.0.1:{port}?rel=0"),
            Self::Tls => format!("tls/127.0.0.1:{port}"),
            Self::Udp => format!("udp/127.0.0.1:{port}"),
        }
    }
}

/// Makes an authority and both ends' certificates in `folder`.
pub(crate) fn make_certificates(folder: &Path) -> Outcome<()> {
    let key = KeyPair::generate()?;
    let mut params = CertificateParams::new(Vec::new())?;
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.distinguished_name.push(DnType::CommonName, "authority");
    std::fs::write(folder.join("authority.pem"), params.self_signed(&key)?.pem())?;
    let issuer = Issuer::new(params, key);
    for name in ["near", "far"] {
        let key = KeyPair::generate()?;
        let mut params = CertificateParams::new(vec!["127.0.0.1".to_owned()])?;
        params.distinguished_name.push(DnType::CommonName, name);
        std::fs::write(folder.join(format!("{name}.pem")), params.signed_by(&key, &issuer)?.pem())?;
        std::fs::write(folder.join(format!("{name}.key")), key.serialize_pem())?;
    }
    Ok(())
}

/// Opens the session of one end: the far side listens, the node connects.
pub(crate) fn open(options: &Options) -> Outcome<Session> {
    let (name, uses) = if options.is_far { ("far", "listen") } else { ("near", "connect") };
    let folder = &options.folder;
    let mut config = Config::default();
    let mut set = |key: &str, value: &str| -> Outcome<()> {
        config.insert_json5(key, value).map_err(|error| format!("{key}: {error}").into())
    };
    set("mode", "\"peer\"")?;
    set("scouting/multicast/enabled", "false")?;
    set("scouting/gossip/enabled", "false")?;
    set("timestamping/enabled", "false")?;
    set("listen/endpoints", "[]")?;
    set(
        &format!("{uses}/endpoints"),
        &format!("[\"{}\"]", options.carrier.endpoint(options.port)),
    )?;
    set("transport/unicast/max_links", "1")?;
    if options.open_timeout > 0 {
        let timeout = options.open_timeout.to_string();
        set("transport/unicast/open_timeout", &timeout)?;
        set("transport/unicast/accept_timeout", &timeout)?;
        set("transport/link/tx/lease", &timeout)?;
        set("connect/retry", "{ period_init_ms: 100, period_max_ms: 500 }")?;
    }
    if options.carrier != Carrier::Udp {
        set("transport/link/tls/enable_mtls", "true")?;
        set("transport/link/tls/root_ca_certificate", &format!("\"{folder}/authority.pem\""))?;
        set(
            &format!("transport/link/tls/{uses}_certificate"),
            &format!("\"{folder}/{name}.pem\""),
        )?;
        set(
            &format!("transport/link/tls/{uses}_private_key"),
            &format!("\"{folder}/{name}.key\""),
        )?;
    }
    zenoh::open(config).wait()
}
