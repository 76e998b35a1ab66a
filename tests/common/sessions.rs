//! Recorded sessions that a test changes.

use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};

/// Changes the copy of a file, and its checksum.
pub(crate) fn change_copy(session: &Path, name: &str, change: impl Fn(String) -> String) {
    let copy = fs::read_dir(session.join("files")).unwrap().map(|entry| entry.unwrap().path());
    let copy = copy.into_iter().find(|path| path.to_str().unwrap().ends_with(name)).unwrap();
    let hash = |path: &Path| {
        let digest = Sha256::digest(fs::read(path).unwrap());
        digest.iter().map(|byte| format!("{byte:02x}")).collect::<String>()
    };
    let before = hash(&copy);
    let text = fs::read_to_string(&copy).unwrap();
    let changed = change(text.clone());
    assert_ne!(changed, text);
    fs::write(&copy, changed).unwrap();
    let file = session.join("session.json");
    let description = fs::read_to_string(&file).unwrap();
    fs::write(file, description.replace(&before, &hash(&copy))).unwrap();
}
