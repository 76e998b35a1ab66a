//! Server over real connections: HTTP/1.1 by hand.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::server::hub::MAX_VIEWERS;
use crate::server::{NO_SEAT, Running, Server};

const READ_TIMEOUT: Duration = Duration::from_secs(20);
const DESCRIPTION: &str = r#"{"version":1,"kind":"description","hand":{"joints":[{"name":"<img src=x> & \u0000 \"é\""}]}}"#;
const MODE: &str = r#"{"version":1,"kind":"mode","mode":"ready"}"#;
const SNAPSHOT: &str =
    r#"{"version":1,"kind":"snapshot","cycle":7,"q":[null,0.10000000000000001]}"#;

/// Server, and the folder of its node's socket.
struct Bench {
    address: SocketAddr,
    socket: PathBuf,
    _running: Running,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("telemetry.sock");
        let server = Server::bind("127.0.0.1:0".parse().unwrap(), vec![socket.clone()]).unwrap();
        let address = server.address();
        Self { address, socket, _running: server.start().unwrap(), _folder: folder }
    }

    fn send(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(READ_TIMEOUT)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        stream
    }

    /// Returns the response to a request with these further lines of its head.
    fn answer(&self, first: &str, more: &str) -> String {
        let host = self.address;
        let mut text = String::new();
        let mut stream = self.send(&format!("{first} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n"));
        stream.read_to_string(&mut text).unwrap();
        text
    }

    fn viewer(&self) -> Viewer {
        let host = self.address;
        let stream = self.send(&format!("GET /feed HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        let mut viewer = Viewer(BufReader::new(stream));
        assert_eq!(viewer.line(), "HTTP/1.1 200 OK");
        while !viewer.line().is_empty() {}
        viewer
    }
}

/// Node that one reader is connected to.
struct Node(UnixStream);

impl Node {
    fn accept(listener: &UnixListener) -> Self {
        Self(listener.accept().unwrap().0)
    }

    fn write(&mut self, lines: &[&str]) {
        for line in lines {
            writeln!(self.0, "{line}").unwrap();
        }
    }
}

struct Viewer(BufReader<TcpStream>);

impl Viewer {
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.0.read_line(&mut line).unwrap();
        assert!(line.ends_with('\n'), "the stream has ended");
        line.trim_end_matches(['\r', '\n']).to_owned()
    }

    /// Returns kind and text of the next event; sizes of chunks and empty lines are passed over.
    fn event(&mut self) -> (String, String) {
        loop {
            let line = self.line();
            if let Some(kind) = line.strip_prefix("event: ") {
                let text = self.line();
                return (kind.to_owned(), text.strip_prefix("data: ").unwrap().to_owned());
            }
        }
    }
}

fn status(response: &str) -> &str {
    response.split(' ').nth(1).unwrap()
}

fn pair(kind: &str, text: &str) -> (String, String) {
    (kind.to_owned(), text.to_owned())
}

fn reason(path: &Path) -> String {
    serde_json::json!({ "reason": format!("No node offers {}.", path.display()) }).to_string()
}

#[test]
fn lines_pass_unchanged_and_late_viewers_get_the_description() {
    let bench = Bench::new();
    let mut early = bench.viewer();
    assert_eq!(early.event(), pair("absent", &reason(&bench.socket)));
    let listener = UnixListener::bind(&bench.socket).unwrap();
    let mut node = Node::accept(&listener);
    node.write(&[DESCRIPTION, MODE, SNAPSHOT]);
    let all = [("description", DESCRIPTION), ("mode", MODE), ("snapshot", SNAPSHOT)];
    for (kind, text) in all {
        assert_eq!(early.event(), pair(kind, text));
    }
    let mut late = bench.viewer();
    for (kind, text) in all {
        assert_eq!(late.event(), pair(kind, text));
    }
    std::fs::remove_file(&bench.socket).unwrap();
    drop((node, listener));
    for viewer in [&mut early, &mut late] {
        let (kind, text) = viewer.event();
        assert_eq!(kind, "absent");
        assert!(text.contains("the node has ended"), "{text}");
    }
}

#[test]
fn page_and_all_its_files_have_the_headers() {
    let bench = Bench::new();
    let page = bench.answer("GET /", "");
    assert!(page.contains("<title>frhc view</title>"));
    for asset in super::assets::ASSETS {
        let response = bench.answer(&format!("GET {}", asset.path), "");
        assert_eq!(status(&response), "200", "{}", asset.path);
        assert!(response.ends_with(asset.text), "{}", asset.path);
        let head = bench.answer(&format!("HEAD {}", asset.path), "");
        assert_eq!(status(&head), "200");
        assert!(head.ends_with("\r\n\r\n"), "{}", asset.path);
    }
    for response in [page, bench.answer("GET /absent", ""), bench.answer("POST /feed", "")] {
        let lower = response.to_ascii_lowercase();
        for header in [
            "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
             img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n",
            "x-content-type-options: nosniff\r\n",
            "referrer-policy: no-referrer\r\n",
            "cross-origin-resource-policy: same-origin\r\n",
            "cross-origin-opener-policy: same-origin\r\n",
            "cache-control: no-store\r\n",
        ] {
            assert!(lower.contains(header), "{header} in {response}");
        }
        assert!(!lower.contains("access-control"), "{response}");
    }
}

#[test]
fn page_is_light_names_no_host_and_has_nothing_inline() {
    let size: usize = super::assets::ASSETS.iter().map(|asset| asset.text.len()).sum();
    assert!(size <= 150_000, "{size} bytes");
    for asset in super::assets::ASSETS {
        let outside = asset.text.replace("http://www.w3.org/2000/svg", "");
        for foreign in ["http://", "https://", "innerHTML", "eval(", " style=", "onclick"] {
            assert!(!outside.contains(foreign), "{}: {foreign}", asset.path);
        }
    }
    let files = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/assets")).unwrap();
    assert_eq!(files.count(), super::assets::ASSETS.len());
}

#[test]
fn foreign_hosts_origins_and_methods_are_refused() {
    let bench = Bench::new();
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH"] {
        for path in ["/", "/feed", "/main.js", "/absent"] {
            let response = bench.answer(&format!("{method} {path}"), "Content-Length: 0\r\n");
            assert_eq!(status(&response), "405", "{method} {path}");
            assert!(response.to_ascii_lowercase().contains("allow: get, head\r\n"), "{response}");
        }
    }
    assert_eq!(status(&bench.answer("GET /feed", "Origin: http://evil.example\r\n")), "403");
    assert_eq!(status(&bench.answer("GET /feed", "Sec-Fetch-Site: cross-site\r\n")), "403");
    let mut refused = String::new();
    let evil = "GET /feed HTTP/1.1\r\nHost: evil.example\r\n\r\n";
    bench.send(evil).read_to_string(&mut refused).unwrap();
    assert_eq!(status(&refused), "403");
    assert!(!refused.contains("event:"), "{refused}");
}

#[test]
fn stream_beyond_the_last_seat_is_refused_with_a_reason() {
    let bench = Bench::new();
    let mut viewers: Vec<Viewer> = (0..MAX_VIEWERS).map(|_| bench.viewer()).collect();
    let refused = bench.answer("GET /feed", "");
    assert_eq!(status(&refused), "503");
    assert!(refused.ends_with(NO_SEAT), "{refused}");
    assert_eq!(status(&bench.answer("GET /", "")), "200");
    viewers.pop();
    // The server detects the end of that connection without a request.
    let mut tries = 0;
    while tries < 1_000 && status_of_feed(&bench) != "200" {
        tries += 1;
    }
    assert!(tries < 1_000, "no seat became free");
}

/// Returns the status of a stream that is closed at once.
fn status_of_feed(bench: &Bench) -> String {
    let host = bench.address;
    let stream = bench.send(&format!("GET /feed HTTP/1.1\r\nHost: {host}\r\n\r\n"));
    let mut first = String::new();
    BufReader::new(stream).read_line(&mut first).unwrap();
    status(&first).to_owned()
}

#[test]
fn stopped_viewer_delays_no_other() {
    let bench = Bench::new();
    let listener = UnixListener::bind(&bench.socket).unwrap();
    let mut node = Node::accept(&listener);
    node.write(&[DESCRIPTION]);
    let (stopped, mut reading) = (bench.viewer(), bench.viewer());
    assert_eq!(reading.event().0, "description");
    let padding = "x".repeat(20_000);
    for cycle in 0..2_000 {
        let line =
            format!(r#"{{"version":1,"kind":"snapshot","cycle":{cycle},"padding":"{padding}"}}"#);
        node.write(&[&line]);
        // 40 MB in all, which no buffer of the stopped one holds.
        assert_eq!(reading.event(), pair("snapshot", &line));
    }
    drop(stopped);
}

#[test]
fn taken_port_is_an_error_and_dropped_server_frees_it() {
    let bench = Bench::new();
    let address = bench.address;
    let error = Server::bind(address, Vec::new()).unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::AddrInUse);
    let _viewer = bench.viewer();
    drop(bench);
    Server::bind(address, Vec::new()).unwrap();
}
