//! Cookies: whoever asks for a session must first show that it is at the address it writes from.
//!
//! A cookie is a keyed hash of address and time, so that nothing is kept of those who never come back. It is
//! asked for always, not only in a flood: that costs one round trip at arming, and no state is ever bought
//! with a forged address.

use std::fmt;

use snow::params::HashChoice;
use snow::resolvers::CryptoResolver;
use snow::resolvers::DefaultResolver;

use units::time::Instant;

/// Bytes of a cookie.
pub const COOKIE: usize = 16;

/// A cookie is good for one to two of these, in µs.
const BUCKET: u64 = 60_000_000;

/// Makes cookies and knows them again.
#[derive(Clone)]
pub struct Cookies {
    secret: [u8; 32],
}

impl fmt::Debug for Cookies {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Cookies")
    }
}

impl Cookies {
    /// From a secret that nobody else has.
    pub const fn new(secret: [u8; 32]) -> Self {
        Self { secret }
    }

    /// The cookie of an address now.
    pub fn of(&self, now: Instant, address: &[u8]) -> [u8; COOKIE] {
        self.in_bucket(now.as_micros() / BUCKET, address)
    }

    /// Whether this is a cookie of that address, of now or of the bucket before.
    pub fn is_good(&self, now: Instant, address: &[u8], cookie: &[u8; COOKIE]) -> bool {
        let bucket = now.as_micros() / BUCKET;
        let is_of = |bucket| is_same(&self.in_bucket(bucket, address), cookie);
        is_of(bucket) || bucket.checked_sub(1).is_some_and(is_of)
    }

    /// HMAC-BLAKE2s of address and bucket, cut to length.
    fn in_bucket(&self, bucket: u64, address: &[u8]) -> [u8; COOKIE] {
        let mut digest = [0; 32];
        if let Some(mut hash) = DefaultResolver.resolve_hash(&HashChoice::Blake2s) {
            let text: Vec<u8> =
                bucket.to_le_bytes().into_iter().chain(address.iter().copied()).collect();
            hash.hmac(&self.secret, &text, &mut digest);
        }
        let (cookie, _) = digest.split_first_chunk().unwrap_or((&[0; COOKIE], &[]));
        *cookie
    }
}

/// Compares in a time that does not tell where they differ.
fn is_same(one: &[u8; COOKIE], other: &[u8; COOKIE]) -> bool {
    one.iter().zip(other).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cookie_is_of_one_address_one_secret_and_two_minutes() {
        let cookies = Cookies::new([7; 32]);
        let at = |seconds: u64| Instant::from_micros(seconds * 1_000_000);
        let cookie = cookies.of(at(119), b"here");
        assert_ne!(cookie, [0; COOKIE]);
        assert!(cookies.is_good(at(119), b"here", &cookie));
        assert!(cookies.is_good(at(179), b"here", &cookie));
        assert!(!cookies.is_good(at(180), b"here", &cookie));
        assert!(!cookies.is_good(at(119), b"there", &cookie));
        assert!(!Cookies::new([8; 32]).is_good(at(119), b"here", &cookie));
        for bit in 0..128 {
            let mut forged = cookie;
            forged[bit / 8] ^= 1 << (bit % 8);
            assert!(!cookies.is_good(at(119), b"here", &forged));
        }
    }
}
