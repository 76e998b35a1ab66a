//! Log lines about connected peers, and whether one of them is the other end of the link.

use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::SampleKind;
use zenoh::session::{Link, LinkEventsListener};
use zenoh::{Session, Wait};

use crate::failure::Failure;
use crate::role::{Role, router_name};

/// Subscriptions to the other end, which end when dropped.
#[derive(Debug)]
pub(crate) struct Subscriptions {
    _token: LivelinessToken,
    _tokens: Subscriber<()>,
    _links: LinkEventsListener<()>,
}

/// Declares this end as alive, and logs other peers.
///
/// # Errors
/// Returns an error if zenoh refuses it.
pub(crate) fn watch(session: &Session, role: Role, arm: u16) -> Result<Subscriptions, Failure> {
    let failed = |error: zenoh::Error| Failure::system(format!("zenoh: {error}"));
    let other = role.other();
    let mut lines = LinkLines::new([other.common_name(arm), router_name(arm)]);
    let info = session.info();
    let links = info.link_events_listener().history(true).callback_mut(move |event| {
        lines.log(event.link(), event.kind());
    });
    let links = links.wait().map_err(failed)?;
    let liveliness = session.liveliness();
    let tokens = liveliness.declare_subscriber(other.alive(arm)).history(true);
    let tokens = tokens.callback(move |sample| match sample.kind() {
        SampleKind::Put => tracing::info!("{} end of arm {arm} is there", other.name()),
        SampleKind::Delete => tracing::warn!("{} end of arm {arm} is gone", other.name()),
    });
    let tokens = tokens.wait().map_err(failed)?;
    let token = liveliness.declare_token(role.alive(arm)).wait().map_err(failed)?;
    Ok(Subscriptions { _token: token, _tokens: tokens, _links: links })
}

/// Log lines about links. A QUIC link with streams and datagrams counts as two.
#[derive(Debug)]
struct LinkLines {
    /// Names of the other end and of a router.
    expected: [String; 2],
    newest: String,
}

impl LinkLines {
    const fn new(expected: [String; 2]) -> Self {
        Self { expected, newest: String::new() }
    }

    fn log(&mut self, link: &Link, kind: SampleKind) {
        let name = link.auth_identifier().unwrap_or("no name");
        let address = shown(link.dst().address().as_str());
        let is_expected = self.expected.iter().any(|one| one == name);
        let line = format!("{name} at {address} {kind}");
        if std::mem::replace(&mut self.newest, line.clone()) == line {
            return;
        }
        match kind {
            SampleKind::Put if is_expected => tracing::info!("connected to {name} at {address}"),
            SampleKind::Put => tracing::warn!(
                "{address} has the certificate of {name:?}, not of {:?}: nothing of it is taken",
                self.expected[0]
            ),
            SampleKind::Delete if is_expected => {
                tracing::warn!("connection to {name} at {address} ended");
            }
            SampleKind::Delete => {}
        }
    }
}

/// Returns an address without the prefix of IPv4 on a socket of IPv6.
fn shown(address: &str) -> String {
    let mapped = address.strip_prefix("[::ffff:").and_then(|rest| rest.split_once(']'));
    mapped.map_or_else(|| address.to_owned(), |(host, port)| format!("{host}{port}"))
}
