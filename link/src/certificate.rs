//! Contents of a certificate, and check of the files that an end uses.

use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use x509_parser::pem::Pem;
use x509_parser::prelude::{FromDer, X509Certificate};

use crate::failure::Failure;
use crate::role::Role;

/// File of the authority's certificate.
pub const AUTHORITY: &str = "authority.pem";

/// Permissions of others in a mode.
const OTHERS: u32 = 0o077;

/// Files of one end.
#[derive(Clone, Debug)]
pub struct Files {
    /// Certificate of the authority.
    pub authority: PathBuf,
    /// Certificate of the end.
    pub certificate: PathBuf,
    /// Private key of the end.
    pub key: PathBuf,
}

impl Files {
    /// Returns the paths of the files in a folder, for the certificate `name`: near, far or router.
    pub fn in_folder(folder: &Path, name: &str) -> Self {
        Self {
            authority: folder.join(AUTHORITY),
            certificate: folder.join(format!("{name}.pem")),
            key: folder.join(format!("{name}.key")),
        }
    }

    /// Checks that the end of this role and arm can use the files now.
    ///
    /// # Errors
    /// Returns file and reason.
    pub fn check(&self, role: Role, arm: u16) -> Result<(), Failure> {
        let authority = Summary::read(&self.authority)?;
        let own = Summary::read(&self.certificate)?;
        let refused = |file: &Path, reason: String| {
            Err(Failure::configuration(format!("{}: {reason}", file.display())))
        };
        let expected = role.common_name(arm);
        if own.name != expected {
            let found = &own.name;
            let reason = format!(
                "certificate of {found:?}; {} of arm {arm} needs that of {expected:?}",
                role.name()
            );
            return refused(&self.certificate, reason);
        }
        for (file, summary) in [(&self.authority, &authority), (&self.certificate, &own)] {
            if let Some(reason) = summary.invalid_at(wall_clock()) {
                return refused(file, reason);
            }
        }
        if !own.is_signed_by(&authority) {
            let reason = format!("not signed by the authority of {}", self.authority.display());
            return refused(&self.certificate, reason);
        }
        self.check_key(&own)
    }

    /// Checks that the private key belongs to the certificate, and is readable for its owner only.
    fn check_key(&self, own: &Summary) -> Result<(), Failure> {
        let refused = |reason: String| {
            Err(Failure::configuration(format!("{}: {reason}", self.key.display())))
        };
        let text = match fs::read_to_string(&self.key) {
            Ok(text) => text,
            Err(error) => return refused(error.to_string()),
        };
        if let Some(reason) = open_to_others(&self.key).map_err(Failure::system)? {
            return refused(reason);
        }
        let Ok(key) = rcgen::KeyPair::from_pem(&text) else {
            return refused("no private key in PEM".to_owned());
        };
        if own.public_key != rcgen::PublicKeyData::subject_public_key_info(&key) {
            return refused(format!("not the key of {}", self.certificate.display()));
        }
        Ok(())
    }
}

/// Returns the reason if other users have permissions on a private key; `None` for valid permissions.
pub(crate) fn open_to_others(file: &Path) -> io::Result<Option<String>> {
    let mode = fs::metadata(file)?.permissions().mode();
    let is_open = mode & OTHERS != 0;
    Ok(is_open.then(|| format!("other users may use it (mode {:03o}): chmod 600", mode & 0o777)))
}

/// Contents of a certificate.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Common name (CN) of the subject.
    pub name: String,
    /// First second of its validity.
    pub from: OffsetDateTime,
    /// Last second of its validity.
    pub to: OffsetDateTime,
    /// Subject's public key info, in DER.
    public_key: Vec<u8>,
    /// Complete certificate, in DER.
    der: Vec<u8>,
}

impl Summary {
    /// Reads the certificate of a file.
    ///
    /// # Errors
    /// Returns file and reason.
    pub fn read(file: &Path) -> Result<Self, Failure> {
        let refused =
            |reason: String| Failure::configuration(format!("{}: {reason}", file.display()));
        let bytes = fs::read(file).map_err(|error| refused(error.to_string()))?;
        let pem = Pem::iter_from_buffer(&bytes).next().and_then(Result::ok);
        let pem = pem.ok_or_else(|| refused("no certificate in PEM".to_owned()))?;
        let certificate =
            pem.parse_x509().map_err(|_| refused("no X.509 certificate".to_owned()))?;
        Ok(Self::from_certificate(&certificate, &pem.contents))
    }

    fn from_certificate(certificate: &X509Certificate<'_>, der: &[u8]) -> Self {
        let subject = certificate.subject();
        let name = subject.iter_common_name().next().and_then(|name| name.as_str().ok());
        let validity = certificate.validity();
        Self {
            name: name.unwrap_or_default().to_owned(),
            from: validity.not_before.to_datetime(),
            to: validity.not_after.to_datetime(),
            public_key: certificate.public_key().raw.to_vec(),
            der: der.to_vec(),
        }
    }

    /// Returns the reason if the certificate is not valid at a time.
    pub fn invalid_at(&self, now: OffsetDateTime) -> Option<String> {
        let clock = "; is the clock of this machine right?";
        if now < self.from {
            Some(format!("not valid before {}, it is {}{clock}", date(self.from), date(now)))
        } else if now > self.to {
            Some(format!("expired at {}, it is {}{clock}", date(self.to), date(now)))
        } else {
            None
        }
    }

    /// Returns whether `authority` issued and signed the certificate; its validity in time is not checked.
    pub fn is_signed_by(&self, authority: &Self) -> bool {
        let (Ok((_, own)), Ok((_, other))) =
            (X509Certificate::from_der(&self.der), X509Certificate::from_der(&authority.der))
        else {
            return false;
        };
        own.issuer() == other.subject() && own.verify_signature(Some(other.public_key())).is_ok()
    }
}

/// Returns a time in UTC, to the second.
pub fn date(time: OffsetDateTime) -> String {
    time.format(&Rfc3339).unwrap_or_default()
}

/// Returns the time of the wall clock, to the second.
#[expect(clippy::disallowed_methods, reason = "validity of certificates is of the wall clock")]
pub fn wall_clock() -> OffsetDateTime {
    let now = OffsetDateTime::from(std::time::SystemTime::now());
    now.replace_nanosecond(0).unwrap_or(now)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys;

    /// Returns a folder of keys for an arm.
    fn made(arm: u16) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        keys::write(folder.path(), arm, true, 30).unwrap();
        folder
    }

    fn refusal(folder: &Path, role: Role, arm: u16) -> String {
        let files = Files::in_folder(folder, role.name());
        files.check(role, arm).unwrap_err().text().to_owned()
    }

    #[test]
    fn made_keys_are_good_for_their_role_and_arm_alone() {
        let folder = made(4);
        for role in [Role::Near, Role::Far] {
            Files::in_folder(folder.path(), role.name()).check(role, 4).unwrap();
            assert!(refusal(folder.path(), role, 5).contains("needs that of \"frhc-5-"));
        }
        fs::copy(folder.path().join("far.pem"), folder.path().join("near.pem")).unwrap();
        let refused = refusal(folder.path(), Role::Near, 4);
        assert!(refused.contains("near.pem: certificate of \"frhc-4-far\""), "{refused}");
    }

    #[test]
    fn files_of_another_authority_or_key_are_refused() {
        let (own, other) = (made(1), made(1));
        let swap = |name: &str| fs::copy(other.path().join(name), own.path().join(name)).unwrap();
        swap("near.key");
        assert!(refusal(own.path(), Role::Near, 1).contains("near.key: not the key of"));
        swap("near.pem");
        assert!(refusal(own.path(), Role::Near, 1).contains("near.pem: not signed by"));
    }

    #[test]
    fn absent_open_and_senseless_files_are_named() {
        let folder = made(1);
        let key = folder.path().join("far.key");
        fs::set_permissions(&key, fs::Permissions::from_mode(0o640)).unwrap();
        assert!(refusal(folder.path(), Role::Far, 1).contains("far.key: other users may use it"));
        fs::remove_file(&key).unwrap();
        assert!(refusal(folder.path(), Role::Far, 1).contains("far.key: No such file"));
        fs::write(folder.path().join("far.pem"), "1,2,3").unwrap();
        assert!(refusal(folder.path(), Role::Far, 1).contains("far.pem: no certificate in PEM"));
        fs::remove_file(folder.path().join(AUTHORITY)).unwrap();
        assert!(refusal(folder.path(), Role::Far, 1).contains("authority.pem: No such file"));
    }

    #[test]
    fn certificate_is_valid_from_a_day_before_until_its_end() {
        let folder = made(1);
        let summary = Summary::read(&folder.path().join("near.pem")).unwrap();
        let day = time::Duration::days(1);
        let now = wall_clock();
        assert!(summary.invalid_at(now + day * 29).is_none());
        assert!(summary.invalid_at(now - day + time::Duration::MINUTE).is_none());
        assert!(summary.invalid_at(now - day * 2).unwrap().starts_with("not valid before "));
        assert!(summary.invalid_at(now + day * 31).unwrap().starts_with("expired at "));
    }
}
