//! Cookies: an initiator must prove that it receives at the address it sends from.
//!
//! A cookie is a keyed hash of address and time, so the responder stores nothing per address. It is always required,
//! not only in a flood: one more round trip at arming, and no state for forged addresses.

use std::fmt;

use snow::params::HashChoice;
use snow::resolvers::{CryptoResolver, DefaultResolver};

use units::time::Instant;

/// Bytes of a cookie.
pub const COOKIE: usize = 16;

/// Validity of a cookie: one to two of these, in µs.
const BUCKET_US: u64 = 60_000_000;

/// Creates and verifies cookies.
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
    /// Creates a generator from a random secret.
    pub const fn new(secret: [u8; 32]) -> Self {
        Self { secret }
    }

    /// Returns the cookie of an address at `now`.
    pub fn of(&self, now: Instant, address: &[u8]) -> [u8; COOKIE] {
        self.in_bucket(now.as_micros() / BUCKET_US, address)
    }

    /// Returns whether this is a valid cookie of the address: of the present or the previous bucket.
    pub fn is_valid(&self, now: Instant, address: &[u8], cookie: &[u8; COOKIE]) -> bool {
        let bucket = now.as_micros() / BUCKET_US;
        let is_of = |bucket| is_same(&self.in_bucket(bucket, address), cookie);
        is_of(bucket) || bucket.checked_sub(1).is_some_and(is_of)
    }

    /// Computes HMAC-BLAKE2s of address and bucket, truncated.
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

/// Compares in constant time.
fn is_same(one: &[u8; COOKIE], other: &[u8; COOKIE]) -> bool {
    one.iter().zip(other).fold(0, |differing, (a, b)| differing | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cookie_is_valid_for_one_address_and_secret_for_two_minutes() {
        let cookies = Cookies::new([7; 32]);
        let at = |seconds: u64| Instant::from_micros(seconds * 1_000_000);
        let cookie = cookies.of(at(119), b"here");
        assert_ne!(cookie, [0; COOKIE]);
        assert!(cookies.is_valid(at(119), b"here", &cookie));
        assert!(cookies.is_valid(at(179), b"here", &cookie));
        assert!(!cookies.is_valid(at(180), b"here", &cookie));
        assert!(!cookies.is_valid(at(119), b"there", &cookie));
        assert!(!Cookies::new([8; 32]).is_valid(at(119), b"here", &cookie));
        for bit in 0..128 {
            let mut forged = cookie;
            forged[bit / 8] ^= 1 << (bit % 8);
            assert!(!cookies.is_valid(at(119), b"here", &forged));
        }
    }
}
