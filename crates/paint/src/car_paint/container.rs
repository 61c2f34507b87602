//! The box a paint is stored in: a header in JSON, arrays after it, a digest at the end.
//!
//! ```text
//! "gonio-paint\n" | version u32 | length of the header u32 | header (JSON, UTF-8) | arrays | SHA-256 of all before (32 bytes)
//! ```
//!
//! The header's key `"sections"` lists the arrays in their order: `[{"name": …, "type": "f32" | "f64" | "u8", "count": N}, …]`; everything is little-endian and
//! nothing is padded. Numbers that must come back to the bit stand in arrays, not in the header. Readers ignore sections and keys they do not know, so
//! that a file may carry more than its first version did.

use serde_json::{Map, Value, json};
use sha2::{Digest as _, Sha256};

/// First bytes.
pub(super) const MAGIC: &[u8] = b"gonio-paint\n";
/// Newest version.
const VERSION: u32 = 1;
const DIGEST: usize = 32;

/// A header and arrays by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Container {
    /// What the file says of itself, `"sections"` left out.
    pub header: Map<String, Value>,
    sections: Vec<(String, Section)>,
}

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub enum Section {
    /// Double precision.
    F64(Vec<f64>),
    /// Single precision.
    F32(Vec<f32>),
    /// Bytes.
    U8(Vec<u8>),
}

/// A box that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum ContainerError {
    /// Other first bytes.
    #[error("not a car-paint file: it does not begin with \"gonio-paint\"")]
    Magic,
    /// From a later program.
    #[error("car-paint file of version {found}, this program reads up to {known}; update gonio")]
    Version {
        /// In the file.
        found: u32,
        /// Read here.
        known: u32,
    },
    /// Shorter or longer than it says.
    #[error("car-paint file is cut short or damaged: {what} needs {needed} bytes, the file has {left} left")]
    Truncated {
        /// What was being read.
        what: String,
        /// Bytes it takes.
        needed: u64,
        /// Bytes there are.
        left: u64,
    },
    /// Something after the last array.
    #[error("car-paint file is damaged: {0} bytes follow its last array")]
    Trailing(usize),
    /// The digest does not belong to the content.
    #[error(
        "car-paint file is damaged: its digest is not that of its content; take it from its source again"
    )]
    Digest,
    /// The header is no JSON object, or a section in it is none.
    #[error("car-paint file with an unreadable header: {0}; take it from its source again")]
    Header(String),
    /// More than the format's own length can say.
    #[error("the header of a car-paint file may take 4 GiB, this one takes {0} bytes; shorten its notes")]
    TooLong(usize),
}

impl Section {
    fn kind(&self) -> &'static str {
        match self {
            Self::F64(_) => "f64",
            Self::F32(_) => "f32",
            Self::U8(_) => "u8",
        }
    }

    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F64(v) => v.len(),
            Self::F32(v) => v.len(),
            Self::U8(v) => v.len(),
        }
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn write(&self, out: &mut Vec<u8>) {
        match self {
            Self::F64(v) => v.iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::F32(v) => v.iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes())),
            Self::U8(v) => out.extend_from_slice(v),
        }
    }

    fn size(kind: &str) -> Option<u64> {
        match kind {
            "f64" => Some(8),
            "f32" => Some(4),
            "u8" => Some(1),
            _ => None,
        }
    }

    fn read(kind: &str, bytes: &[u8]) -> Option<Self> {
        Some(match kind {
            "f64" => Self::F64(
                bytes
                    .chunks_exact(8)
                    .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]))
                    .collect(),
            ),
            "f32" => Self::F32(
                bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
            ),
            "u8" => Self::U8(bytes.to_vec()),
            _ => return None,
        })
    }
}

impl Container {
    /// A box with this header and no array.
    #[must_use]
    pub fn new(header: Map<String, Value>) -> Self {
        Self { header, sections: Vec::new() }
    }

    /// Puts an array in; one of the same name is replaced.
    pub fn put(&mut self, name: &str, section: Section) {
        match self.sections.iter_mut().find(|(n, _)| n == name) {
            Some(there) => there.1 = section,
            None => self.sections.push((name.to_owned(), section)),
        }
    }

    /// The array of a name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Section> {
        self.sections.iter().find(|(n, _)| n == name).map(|(_, s)| s)
    }

    /// The array of a name, in double precision.
    #[must_use]
    pub fn f64s(&self, name: &str) -> Option<&[f64]> {
        match self.get(name) {
            Some(Section::F64(v)) => Some(v),
            _ => None,
        }
    }

    /// The array of a name, in single precision.
    #[must_use]
    pub fn f32s(&self, name: &str) -> Option<&[f32]> {
        match self.get(name) {
            Some(Section::F32(v)) => Some(v),
            _ => None,
        }
    }

    /// Takes an array of single precision out without copying it.
    pub fn take_f32s(&mut self, name: &str) -> Option<Vec<f32>> {
        let at = self.sections.iter().position(|(n, s)| n == name && matches!(s, Section::F32(_)))?;
        match self.sections.swap_remove(at).1 {
            Section::F32(v) => Some(v),
            _ => None,
        }
    }

    /// The file's bytes; the same box gives the same bytes.
    ///
    /// # Errors
    /// [`ContainerError::TooLong`] for a header beyond 4 GiB, [`ContainerError::Header`] for one that JSON cannot hold.
    pub fn to_bytes(&self) -> Result<Vec<u8>, ContainerError> {
        let mut header = self.header.clone();
        let list: Vec<Value> = self
            .sections
            .iter()
            .map(|(name, s)| json!({"name": name, "type": s.kind(), "count": s.len()}))
            .collect();
        header.insert("sections".to_owned(), Value::Array(list));
        let text = serde_json::to_string(&Value::Object(header))
            .map_err(|e| ContainerError::Header(e.to_string()))?;
        let length = u32::try_from(text.len()).map_err(|_| ContainerError::TooLong(text.len()))?;
        let arrays: usize = self.sections.iter().map(|(_, s)| 8 * s.len()).sum();
        let mut out = Vec::with_capacity(MAGIC.len() + 8 + text.len() + arrays + DIGEST);
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&length.to_le_bytes());
        out.extend_from_slice(text.as_bytes());
        for (_, s) in &self.sections {
            s.write(&mut out);
        }
        let digest = Sha256::digest(&out);
        out.extend_from_slice(&digest);
        Ok(out)
    }

    /// Opens a box; the digest is checked before anything is believed.
    ///
    /// # Errors
    /// [`ContainerError`]; no count in the file makes it allocate more than the file's own size.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ContainerError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(ContainerError::Magic)?;
        let (version, rest) = take(rest, 4, "version")?;
        let version = word(version);
        if version == 0 || version > VERSION {
            return Err(ContainerError::Version { found: version, known: VERSION });
        }
        if rest.len() < DIGEST {
            return Err(truncated("digest", DIGEST as u64, rest.len()));
        }
        let (rest, digest) = rest.split_at(rest.len() - DIGEST);
        let (length, rest) = take(rest, 4, "length of the header")?;
        let (text, mut rest) = take(rest, u64::from(word(length)), "header")?;
        if Sha256::digest(&bytes[..bytes.len() - DIGEST]).as_slice() != digest {
            return Err(ContainerError::Digest);
        }
        let bad = |what: String| ContainerError::Header(what);
        let mut header: Map<String, Value> = serde_json::from_slice(text).map_err(|e| bad(e.to_string()))?;
        let Some(Value::Array(list)) = header.remove("sections") else {
            return Err(bad("it lists no sections".to_owned()));
        };
        let mut sections = Vec::with_capacity(list.len());
        for entry in &list {
            let name = entry.get("name").and_then(Value::as_str);
            let kind = entry.get("type").and_then(Value::as_str);
            let count = entry.get("count").and_then(Value::as_u64);
            let (Some(name), Some(kind), Some(count)) = (name, kind, count) else {
                return Err(bad(format!("a section is {entry}, expected name, type and count")));
            };
            let size = Section::size(kind).ok_or_else(|| {
                bad(format!("section \"{name}\" has type \"{kind}\", expected f64, f32 or u8"))
            })?;
            let (values, after) = take(rest, count.saturating_mul(size), name)?;
            rest = after;
            sections.extend(Section::read(kind, values).map(|s| (name.to_owned(), s)));
        }
        if !rest.is_empty() {
            return Err(ContainerError::Trailing(rest.len()));
        }
        Ok(Self { header, sections })
    }
}

fn word(b: &[u8]) -> u32 {
    b.iter().rev().fold(0, |all, &x| all << 8 | u32::from(x))
}

fn truncated(what: &str, needed: u64, left: usize) -> ContainerError {
    ContainerError::Truncated { what: what.to_owned(), needed, left: left as u64 }
}

fn take<'a>(bytes: &'a [u8], n: u64, what: &str) -> Result<(&'a [u8], &'a [u8]), ContainerError> {
    match usize::try_from(n) {
        Ok(k) if k <= bytes.len() => Ok(bytes.split_at(k)),
        _ => Err(truncated(what, n, bytes.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Container {
        let mut c = Container::default();
        c.header.insert("name".to_owned(), json!("a"));
        c.put("x", Section::F64(vec![0.1, f64::MIN_POSITIVE]));
        c.put("y", Section::F32(vec![1.5; 3]));
        c.put("z", Section::U8(vec![7]));
        c
    }

    #[test]
    fn what_was_put_in_comes_out() {
        let bytes = sample().to_bytes().expect("small");
        let mut back = Container::from_bytes(&bytes).expect("sound");
        assert_eq!(back, sample());
        assert_eq!(back.take_f32s("y"), Some(vec![1.5; 3]));
        assert_eq!((back.take_f32s("y"), back.f64s("z"), back.f32s("x")), (None, None, None));
    }

    #[test]
    fn any_changed_bit_and_any_cut_is_found() {
        let bytes = sample().to_bytes().expect("small");
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bad = bytes.clone();
                bad[at] ^= 1 << bit;
                assert!(Container::from_bytes(&bad).is_err(), "byte {at} bit {bit}");
            }
            assert!(Container::from_bytes(&bytes[..at]).is_err(), "cut at {at}");
        }
        let mut long = bytes;
        long.push(0);
        assert!(Container::from_bytes(&long).is_err());
    }

    #[test]
    fn counts_larger_than_the_file_are_refused_even_with_a_right_digest() {
        let header = r#"{"sections":[{"name":"x","type":"f64","count":18446744073709551615}]}"#;
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&1u32.to_le_bytes());
        bytes.extend_from_slice(&(header.len() as u32).to_le_bytes());
        bytes.extend_from_slice(header.as_bytes());
        let digest = Sha256::digest(&bytes);
        bytes.extend_from_slice(&digest);
        let message = Container::from_bytes(&bytes).expect_err("too large").to_string();
        assert!(message.contains("x needs"), "{message}");
    }
}
