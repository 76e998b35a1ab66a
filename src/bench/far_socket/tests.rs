//! Connection to a node, which a listener of the test plays.

use std::io::Write;
use std::os::unix::net::UnixListener;

use tempfile::TempDir;

use super::*;

fn listener(path: &Path) -> Socket {
    let listener = Socket::new(Domain::UNIX, Type::SEQPACKET, None).unwrap();
    listener.bind(&SockAddr::unix(path).unwrap()).unwrap();
    listener.listen(4).unwrap();
    listener
}

fn at(millis: u64) -> Instant {
    Instant::from_micros(1_000 * millis)
}

fn folder() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("far.sock");
    (folder, path)
}

/// Returns the messages that are taken at once, and the events.
fn received(link: &mut FarSocket, millis: u64) -> (Vec<Vec<u8>>, Vec<SocketEvent>) {
    let mut messages = Vec::new();
    link.receive(at(millis), |message| messages.push(message.to_vec()));
    (messages, link.events().collect())
}

#[test]
fn absent_node_is_reported_once_and_found_later() {
    let (_folder, path) = folder();
    let mut link = FarSocket::open(&path).unwrap();
    assert_eq!(received(&mut link, 0).1, [SocketEvent::Absent(path.clone())]);
    assert_eq!(received(&mut link, 100).1, []);
    let listener = listener(&path);
    received(&mut link, 150);
    assert!(link.connection.is_none(), "tried every 100 ms");
    received(&mut link, 200);
    let (mut node, _) = listener.accept().unwrap();
    node.write_all(b"one").unwrap();
    node.write_all(b"two").unwrap();
    let (messages, events) = received(&mut link, 201);
    assert_eq!(messages, [b"one", b"two"]);
    assert_eq!(events, [SocketEvent::Connected(path)]);
    assert!(link.is_connected());
}

#[test]
fn missing_folder_is_named_until_it_exists() {
    let (folder, _) = folder();
    let runtime = folder.path().join("frhc");
    let path = runtime.join("far.sock");
    let mut link = FarSocket::open(&path).unwrap();
    assert_eq!(received(&mut link, 0).1, [SocketEvent::NoFolder(path.clone())]);
    assert_eq!(received(&mut link, 100).1, []);
    fs::create_dir(&runtime).unwrap();
    assert_eq!(received(&mut link, 200).1, [SocketEvent::Absent(path.clone())]);
    let listener = listener(&path);
    received(&mut link, 300);
    listener.accept().unwrap();
}

#[test]
fn sixteen_messages_are_taken_at_once() {
    let (_folder, path) = folder();
    let listener = listener(&path);
    let mut link = FarSocket::open(&path).unwrap();
    let (mut node, _) = listener.accept().unwrap();
    (0..20).for_each(|number| node.write_all(&[number; 188]).unwrap());
    assert_eq!(received(&mut link, 0).0.len(), 16);
    assert_eq!(received(&mut link, 1).0, (16..20).map(|number| [number; 188]).collect::<Vec<_>>());
}

#[test]
fn closed_connection_is_reported_and_made_again() {
    let (_folder, path) = folder();
    let listener = listener(&path);
    let mut link = FarSocket::open(&path).unwrap();
    let (mut node, _) = listener.accept().unwrap();
    node.write_all(b"one").unwrap();
    received(&mut link, 0);
    drop(node);
    assert_eq!(received(&mut link, 10).1, [SocketEvent::Closed]);
    received(&mut link, 110);
    assert!(link.connection.is_some());
}

#[test]
fn node_that_refuses_is_tried_again_slowly() {
    let (_folder, path) = folder();
    let listener = listener(&path);
    let mut link = FarSocket::open(&path).unwrap();
    drop(listener.accept().unwrap());
    assert_eq!(received(&mut link, 10).1, [SocketEvent::Refused(path.clone())]);
    received(&mut link, 2_009);
    assert!(link.connection.is_none());
    received(&mut link, 2_010);
    drop(listener.accept().unwrap());
    link.send(at(2_011), b"lost");
    assert_eq!(received(&mut link, 2_011).1, [], "reported once");
    assert!(link.connection.is_none());
}

#[test]
fn message_to_a_node_that_does_not_read_is_dropped() {
    let (_folder, path) = folder();
    let listener = listener(&path);
    let mut link = FarSocket::open(&path).unwrap();
    let (node, _) = listener.accept().unwrap();
    (0..5_000).for_each(|_| link.send(at(0), &[7; 196]));
    assert!(link.connection.is_some());
    assert_eq!(link.events().count(), 0);
    drop(node);
    link.send(at(1), &[7; 196]);
    assert!(link.connection.is_none(), "and no signal ended the process");
}

#[test]
fn paths_that_can_be_no_far_sides_socket_are_refused() {
    let (folder, path) = folder();
    let refusal = |path: &Path| FarSocket::open(path).unwrap_err().to_string();
    let long = folder.path().join("x".repeat(200));
    assert!(refusal(&long).contains("too long for a socket: at most 107 bytes, got "));
    assert!(refusal(folder.path()).contains(": not a socket"));
    fs::write(&path, "1,2,3").unwrap();
    assert!(refusal(&path).contains(": not a socket"));
    fs::remove_file(&path).unwrap();
    let _stream = UnixListener::bind(&path).unwrap();
    assert!(refusal(&path).contains("is it that of `frhc ctl`?"));
}

#[test]
fn denied_permission_names_the_group() {
    let error = io::Error::from(ErrorKind::PermissionDenied);
    let refusal = refusal(Path::new("/run/frhc/far.sock"), &error);
    assert!(refusal.starts_with("/run/frhc/far.sock: permission denied"), "{refusal}");
    assert!(refusal.contains("frhc-link"), "{refusal}");
}
