//! SHA-256 of a frame's pixels, as 16-bit little-endian values, row by row.

use sha2::{Digest, Sha256};

/// Digest of pixels that are already bytes.
pub(crate) fn pixels(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// Pixels as little-endian bytes.
pub(crate) fn to_bytes(pixels: &[u16]) -> Vec<u8> {
    let mut out = vec![0; pixels.len() * 2];
    for (to, from) in out.chunks_exact_mut(2).zip(pixels) {
        to.copy_from_slice(&from.to_le_bytes());
    }
    out
}

/// Pixels from little-endian bytes; an odd last byte is dropped, the caller has checked the length.
pub(crate) fn from_bytes(bytes: &[u8]) -> Vec<u16> {
    let (pairs, _) = bytes.as_chunks::<2>();
    pairs.iter().map(|&b| u16::from_le_bytes(b)).collect()
}
