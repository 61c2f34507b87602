//! SHA-256 of a whole file with its own 64 digits written as zeros.

use sha2::{Digest as _, Sha256};

/// What stands in the place of the digest while it is computed.
pub(super) const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Hexadecimal digest of `bytes` with the 64 bytes at `place` taken as `0`; `None` where these lie outside.
pub(super) fn compute(bytes: &[u8], place: usize) -> Option<String> {
    let end = place.checked_add(BLANK.len()).filter(|&e| e <= bytes.len())?;
    let mut hash = Sha256::new();
    hash.update(&bytes[..place]);
    hash.update(BLANK.as_bytes());
    hash.update(&bytes[end..]);
    Some(hash.finalize().iter().map(|b| format!("{b:02x}")).collect())
}
