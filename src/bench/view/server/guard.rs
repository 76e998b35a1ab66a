//! Check of requests: only those of the page itself are answered. Pages of other origins, and host names that resolve to this
//! server by DNS rebinding, are refused.

use std::net::{IpAddr, SocketAddr};

use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};

/// Headers of every response.
const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    (header::CACHE_CONTROL, "no-store"),
];

/// Port that a browser leaves out of the name of a host.
const HTTP_PORT: u16 = 80;

/// Path of the page, which a link on any other page may open.
const PAGE: &str = "/";

/// Refusal of a request: status, and the reason as a sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Refusal(pub(super) StatusCode, pub(super) &'static str);

const FOREIGN_HOST: Refusal = Refusal(
    StatusCode::FORBIDDEN,
    "The name of this host is not one that frhc view answers to: use the address that it has printed.",
);
const FOREIGN_ORIGIN: Refusal =
    Refusal(StatusCode::FORBIDDEN, "A page of another origin cannot read this one.");
const FOREIGN_METHOD: Refusal =
    Refusal(StatusCode::METHOD_NOT_ALLOWED, "Only GET and HEAD are allowed: nothing can be sent.");

/// Check of requests against the address of the server.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guard {
    /// Address on which the server listens.
    listen: SocketAddr,
}

impl Guard {
    pub(super) fn new(listen: SocketAddr) -> Self {
        Self { listen }
    }

    /// Returns the refusal of a request; `None` if it is answered.
    pub(super) fn refusal(&self, request: &Parts) -> Option<Refusal> {
        let headers = &request.headers;
        let named = request.uri.authority().map(|authority| authority.as_str());
        let Some(host) = single(headers, header::HOST).filter(|host| self.is_own(host)) else {
            return Some(FOREIGN_HOST);
        };
        if named.is_some_and(|named| !named.eq_ignore_ascii_case(host)) {
            return Some(FOREIGN_HOST);
        }
        if request.method != Method::GET && request.method != Method::HEAD {
            return Some(FOREIGN_METHOD);
        }
        if headers.contains_key(header::ORIGIN) {
            let own =
                single(headers, header::ORIGIN).and_then(|origin| origin.strip_prefix("http://"));
            if !own.is_some_and(|own| own.eq_ignore_ascii_case(host)) {
                return Some(FOREIGN_ORIGIN);
            }
        }
        (!is_of_own_site(request)).then_some(FOREIGN_ORIGIN)
    }

    /// Returns whether this is a name of the server itself, with its port.
    fn is_own(&self, host: &str) -> bool {
        let port = self.listen.port();
        let name = match host.rsplit_once(':') {
            Some((name, text)) if !text.ends_with(']') => {
                if text.parse() != Ok(port) {
                    return false;
                }
                name
            }
            _ if port == HTTP_PORT => host,
            _ => return false,
        };
        if name.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let bare = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let Ok(address) = bare.parse::<IpAddr>() else { return false };
        // A numeric address needs no name server, so DNS rebinding is impossible.
        address.is_loopback() || self.listen.ip().is_unspecified() || address == self.listen.ip()
    }
}

/// Returns whether the headers of a browser name this page, or a link to it, as origin; other programs send no such headers.
fn is_of_own_site(request: &Parts) -> bool {
    let fetch = |name: &'static str| single(&request.headers, HeaderName::from_static(name));
    match fetch("sec-fetch-site") {
        None | Some("same-origin" | "none") => true,
        Some(_) => {
            let is_navigation = fetch("sec-fetch-mode").is_none_or(|mode| mode == "navigate");
            let is_document = fetch("sec-fetch-dest").is_none_or(|dest| dest == "document");
            request.uri.path() == PAGE && is_navigation && is_document
        }
    }
}

/// Returns the value of a header that comes once, as text.
fn single(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    if values.next().is_some() { None } else { value.to_str().ok() }
}

/// Adds the headers of every response.
pub(super) fn add_headers(headers: &mut HeaderMap) {
    for (name, value) in HEADERS {
        headers.insert(name, HeaderValue::from_static(value));
    }
}

#[cfg(test)]
mod tests {
    use axum::http::Request;

    use super::*;

    fn status(listen: &str, path: &str, headers: &[(&str, &str)]) -> u16 {
        let mut request = Request::builder().uri(path);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let (parts, ()) = request.body(()).unwrap().into_parts();
        let guard = Guard::new(listen.parse().unwrap());
        guard.refusal(&parts).map_or(200, |refusal| refusal.0.as_u16())
    }

    #[test]
    fn only_own_names_with_the_port_are_answered() {
        for (listen, host, expected) in [
            ("127.0.0.1:8020", "127.0.0.1:8020", 200),
            ("127.0.0.1:8020", "LOCALHOST:8020", 200),
            ("127.0.0.1:8020", "[::1]:8020", 200),
            ("127.0.0.1:80", "localhost", 200),
            ("127.0.0.1:8020", "localhost", 403),
            ("127.0.0.1:8020", "localhost:8021", 403),
            ("127.0.0.1:8020", "10.0.0.7:8020", 403),
            ("127.0.0.1:8020", "evil.example:8020", 403),
            ("127.0.0.1:8020", "localhost.evil.example:8020", 403),
            ("127.0.0.1:8020", "[::1]", 403),
            ("127.0.0.1:8020", "", 403),
            ("10.0.0.7:8020", "10.0.0.7:8020", 200),
            ("10.0.0.7:8020", "10.0.0.8:8020", 403),
            ("0.0.0.0:8020", "10.0.0.8:8020", 200),
            ("0.0.0.0:8020", "rig.example:8020", 403),
        ] {
            assert_eq!(status(listen, "/", &[("host", host)]), expected, "{listen} {host}");
        }
        assert_eq!(status("127.0.0.1:8020", "/", &[]), 403);
        let twice = [("host", "localhost:8020"), ("host", "localhost:8020")];
        assert_eq!(status("127.0.0.1:8020", "/", &twice), 403);
        let absolute = "http://evil.example/";
        assert_eq!(status("127.0.0.1:8020", absolute, &[("host", "localhost:8020")]), 403);
    }

    #[test]
    fn pages_of_other_origins_get_only_a_link_to_the_page() {
        let asked = |path: &str, more: &[(&str, &str)]| {
            let headers = [&[("host", "localhost:8020")], more].concat();
            status("127.0.0.1:8020", path, &headers)
        };
        assert_eq!(asked("/feed", &[("origin", "http://localhost:8020")]), 200);
        for origin in
            ["http://evil.example", "null", "https://localhost:8020", "http://127.0.0.1:8020"]
        {
            assert_eq!(asked("/feed", &[("origin", origin)]), 403, "{origin}");
            assert_eq!(asked("/", &[("origin", origin)]), 403, "{origin}");
        }
        assert_eq!(asked("/feed", &[("sec-fetch-site", "same-origin")]), 200);
        for site in ["cross-site", "same-site"] {
            assert_eq!(asked("/feed", &[("sec-fetch-site", site)]), 403, "{site}");
            assert_eq!(asked("/main.js", &[("sec-fetch-site", site)]), 403, "{site}");
            let link = [
                ("sec-fetch-site", site),
                ("sec-fetch-mode", "navigate"),
                ("sec-fetch-dest", "document"),
            ];
            assert_eq!(asked("/", &link), 200, "{site}");
            let frame = [
                ("sec-fetch-site", site),
                ("sec-fetch-mode", "navigate"),
                ("sec-fetch-dest", "iframe"),
            ];
            assert_eq!(asked("/", &frame), 403, "{site}");
        }
    }
}
