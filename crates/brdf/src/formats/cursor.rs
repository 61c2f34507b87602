//! Reads numbers from bytes that nobody has checked: every count is held against the bytes that are left before anything is allocated.

use super::Problem;

/// A place in a file's bytes.
#[derive(Clone, Debug)]
pub(crate) struct Cursor<'a> {
    format: &'static str,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(crate) const fn new(format: &'static str, bytes: &'a [u8]) -> Self {
        Self { format, bytes, at: 0 }
    }

    /// The same bytes from another place; beyond the end nothing is left.
    pub(crate) fn seek(&mut self, at: u64) {
        self.at = usize::try_from(at).map_or(self.bytes.len(), |a| a.min(self.bytes.len()));
    }

    pub(crate) const fn position(&self) -> usize {
        self.at
    }

    pub(crate) const fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `n` bytes.
    pub(crate) fn take(&mut self, what: &str, n: u64) -> Result<&'a [u8], Problem> {
        let fits = usize::try_from(n).ok().filter(|&n| n <= self.left());
        let Some(n) = fits else {
            return Err(Problem::Truncated {
                format: self.format,
                what: what.to_owned(),
                offset: self.at as u64,
                needed: n,
                available: self.left() as u64,
            });
        };
        let out = &self.bytes[self.at..self.at + n];
        self.at += n;
        Ok(out)
    }

    fn array<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Problem> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(what, N as u64)?);
        Ok(out)
    }

    pub(crate) fn u8(&mut self, what: &str) -> Result<u8, Problem> {
        Ok(self.array::<1>(what)?[0])
    }

    pub(crate) fn u16_le(&mut self, what: &str) -> Result<u16, Problem> {
        self.array(what).map(u16::from_le_bytes)
    }

    pub(crate) fn u32_le(&mut self, what: &str) -> Result<u32, Problem> {
        self.array(what).map(u32::from_le_bytes)
    }

    pub(crate) fn u64_le(&mut self, what: &str) -> Result<u64, Problem> {
        self.array(what).map(u64::from_le_bytes)
    }

    pub(crate) fn u32_be(&mut self, what: &str) -> Result<u32, Problem> {
        self.array(what).map(u32::from_be_bytes)
    }

    pub(crate) fn u64_be(&mut self, what: &str) -> Result<u64, Problem> {
        self.array(what).map(u64::from_be_bytes)
    }

    /// `n` little-endian f32.
    pub(crate) fn f32s_le(&mut self, what: &str, n: u64) -> Result<Vec<f32>, Problem> {
        let bytes = self.take(what, n.saturating_mul(4))?;
        Ok(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }

    /// `n` little-endian f64.
    pub(crate) fn f64s_le(&mut self, what: &str, n: u64) -> Result<Vec<f64>, Problem> {
        let bytes = self.take(what, n.saturating_mul(8))?;
        Ok(bytes
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
            .collect())
    }
}

/// The refusal of a value that is not finite, with its place in the array.
pub(crate) fn all_finite(format: &'static str, what: &str, values: &[f32]) -> Result<(), Problem> {
    values.iter().position(|v| !v.is_finite()).map_or(Ok(()), |k| {
        Err(Problem::malformed(format, format!("{what}[{k}]"), values[k], "a finite number"))
    })
}
