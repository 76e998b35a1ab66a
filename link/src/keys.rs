//! `frhc-link key`: an authority and the certificates of both ends, in one folder.

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use time::{Duration, OffsetDateTime};

use crate::certificate::{self, AUTHORITY, Files, Summary, date, wall_clock};
use crate::failure::Failure;
use crate::role::common_name;

/// Names of certificates and of their files.
const NAMES: [&str; 3] = ["near", "far", "router"];

/// Private key of the authority.
const AUTHORITY_KEY: &str = "authority.key";

/// Makes the keys of an arm, and prints the placement of the files.
///
/// # Errors
/// As [`write()`], and when standard output cannot be written.
pub fn make(folder: &Path, arm: u16, router: bool, days: u32) -> Result<(), Failure> {
    write(folder, arm, router, days)?;
    print(&placement(folder, router))
}

/// Writes the keys of an arm into a folder that is new or empty.
///
/// # Errors
/// Returns an error if the folder has files, or cannot be written. No file is left in it then.
pub fn write(folder: &Path, arm: u16, router: bool, days: u32) -> Result<(), Failure> {
    let shown = folder.display();
    let failed = |error: &dyn std::fmt::Display| Failure::system(format!("{shown}: {error}"));
    DirBuilder::new().recursive(true).mode(0o700).create(folder).map_err(|error| failed(&error))?;
    if fs::read_dir(folder).map_err(|error| failed(&error))?.next().is_some() {
        return Err(failed(&"has files already; keys are never overwritten: name another folder"));
    }
    let mut written = Vec::new();
    let names = if router { &NAMES[..] } else { &NAMES[..2] };
    let made = generate(folder, arm, names, days, &mut written);
    made.map_err(|error| {
        // An incomplete set of keys is useless.
        written.iter().for_each(|file| drop(fs::remove_file(file)));
        failed(&error)
    })
}

/// Makes the files, and adds each to `written`.
fn generate(
    folder: &Path,
    arm: u16,
    names: &[&str],
    days: u32,
    written: &mut Vec<PathBuf>,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut write = |name: &str, text: &str| -> io::Result<()> {
        let path = folder.join(name);
        let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path)?;
        written.push(path);
        file.write_all(text.as_bytes())?;
        file.sync_all()
    };
    let key = KeyPair::generate()?;
    let mut authority = params(&common_name(arm, "authority"), days)?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    write(AUTHORITY, &authority.self_signed(&key)?.pem())?;
    write(AUTHORITY_KEY, &key.serialize_pem())?;
    let issuer = Issuer::new(authority, key);
    for name in names {
        let key = KeyPair::generate()?;
        let mut own = params(&common_name(arm, name), days)?;
        own.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        own.extended_key_usages =
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        write(&format!("{name}.pem"), &own.signed_by(&key, &issuer)?.pem())?;
        write(&format!("{name}.key"), &key.serialize_pem())?;
    }
    Ok(())
}

/// Returns the parameters of a certificate, valid from a day ago, because clocks differ.
fn params(name: &str, days: u32) -> Result<CertificateParams, rcgen::Error> {
    let now: OffsetDateTime = wall_clock();
    // Hosts are not verified; the name is for clients that demand one.
    let mut params = CertificateParams::new(vec![name.to_owned()])?;
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    params.not_before = now - Duration::DAY;
    params.not_after = now + Duration::DAY * days;
    Ok(params)
}

/// Returns lines that name the machine for each file.
fn placement(folder: &Path, router: bool) -> String {
    let shown = folder.display();
    let mut text = format!(
        "{shown}: made, each file for its owner alone. Copy, and keep the permissions:\n\
        \x20 to the node's machine    {AUTHORITY} near.pem near.key\n\
        \x20 to the robot's machine   {AUTHORITY} far.pem far.key\n"
    );
    if router {
        text += &format!("\x20 to the router            {AUTHORITY} router.pem router.key\n");
    }
    text + &format!(
        "Keep {AUTHORITY_KEY} off both, or delete it: with it anybody can pass for either end.\n"
    )
}

/// Prints name, validity and defects of each certificate in a folder.
///
/// # Errors
/// Returns an error if there is no authority, or a certificate or key is invalid.
pub fn show(folder: &Path) -> Result<(), Failure> {
    let authority = Summary::read(&folder.join(AUTHORITY))?;
    let mut text = row(AUTHORITY, &authority, &complaints(&authority, &authority, None));
    let mut is_good = complaints(&authority, &authority, None).is_empty();
    for name in NAMES {
        let files = Files::in_folder(folder, name);
        if !files.certificate.exists() {
            continue;
        }
        let own = Summary::read(&files.certificate)?;
        let key = files.key.exists().then_some(&*files.key);
        let wrong = complaints(&own, &authority, key);
        is_good &= wrong.is_empty();
        text += &row(&format!("{name}.pem"), &own, &wrong);
    }
    if folder.join(AUTHORITY_KEY).exists() {
        text += &format!("{AUTHORITY_KEY} is here: with it anybody can pass for either end\n");
    }
    print(&text)?;
    if is_good {
        Ok(())
    } else {
        Err(Failure::configuration(format!("{}: see above", folder.display())))
    }
}

/// Returns the defects of a certificate and, if present, of its private key.
fn complaints(own: &Summary, authority: &Summary, key: Option<&Path>) -> Vec<String> {
    let mut found: Vec<String> = own.invalid_at(wall_clock()).into_iter().collect();
    if !own.is_signed_by(authority) {
        found.push(format!("not signed by {AUTHORITY}"));
    }
    let open = key.and_then(|key| certificate::open_to_others(key).ok().flatten());
    found.extend(open.map(|reason| format!("private key: {reason}")));
    found
}

fn row(file: &str, summary: &Summary, wrong: &[String]) -> String {
    let state = if wrong.is_empty() { "good".to_owned() } else { wrong.join("; ") };
    let (from, to) = (date(summary.from), date(summary.to));
    format!("{file:<14} {:<18} {from} to {to}  {state}\n", summary.name)
}

/// Prints data.
fn print(text: &str) -> Result<(), Failure> {
    let printed = io::stdout().write_all(text.as_bytes());
    printed.map_err(|error| Failure::system(format!("stdout: {error}")))
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn files(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
        let mut names: Vec<_> =
            entries.map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn keys_are_their_owners_alone_and_never_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/keys");
        make(&path, 1, false, 10).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o700);
        let names = files(&path);
        let expected =
            ["authority.key", "authority.pem", "far.key", "far.pem", "near.key", "near.pem"];
        assert_eq!(names, expected);
        let mut texts = Vec::new();
        for name in &names {
            let file = path.join(name);
            assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600, "{name}");
            texts.push(fs::read_to_string(file).unwrap());
        }
        let refused = make(&path, 1, true, 10).unwrap_err();
        assert!(refused.text().contains("never overwritten"), "{}", refused.text());
        assert_eq!(files(&path), expected);
        let again = names.iter().map(|name| fs::read_to_string(path.join(name)).unwrap());
        assert_eq!(again.collect::<Vec<_>>(), texts);
        show(&path).unwrap();
    }

    #[test]
    fn folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let refused = make(&file.join("keys"), 1, false, 10).unwrap_err();
        assert!(refused.text().starts_with(&file.display().to_string()), "{}", refused.text());
    }

    #[test]
    fn shown_keys_that_are_wrong_fail() {
        let (own, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        make(own.path(), 1, true, 10).unwrap();
        make(other.path(), 1, true, 10).unwrap();
        show(own.path()).unwrap();
        fs::copy(other.path().join("router.pem"), own.path().join("router.pem")).unwrap();
        show(own.path()).unwrap_err();
        assert!(show(&own.path().join("none")).is_err());
    }
}
