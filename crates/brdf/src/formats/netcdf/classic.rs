//! A bounded reader of NetCDF classic files: CDF-1, CDF-2 (64-bit offsets) and CDF-5 (64-bit sizes).
//!
//! ```text
//! "CDF" version | numrecs | dim_list | gatt_list | var_list
//! list = 0 0 | tag count entry…          tags: 10 dimension, 11 variable, 12 attribute
//! dim  = name length                     attr = name type count values, padded to 4
//! var  = name ndims dimid… attr_list type vsize begin
//! ```
//!
//! Everything is big-endian; counts take 4 bytes (CDF-5: 8), `begin` 4 (CDF-2 and 5: 8). Every count is held against the bytes left,
//! so a damaged header costs an error and no memory. `vsize` is not trusted: sizes follow from the dimensions.
//! Layout: NetCDF User's Guide, appendix "File Format Specifications" (Unidata).

use super::NAME;
use crate::formats::{Problem, cursor::Cursor};

/// A header and the bytes it describes.
#[derive(Clone, Debug)]
pub(crate) struct Classic<'a> {
    bytes: &'a [u8],
    records: u64,
    record_size: u64,
    /// Length of each dimension; 0 is the record dimension.
    pub dimensions: Vec<(String, u64)>,
    /// Global attributes.
    pub attributes: Vec<Attribute<'a>>,
    /// Variables.
    pub variables: Vec<Variable<'a>>,
}

/// An attribute, not decoded yet.
#[derive(Clone, Debug)]
pub(crate) struct Attribute<'a> {
    pub name: String,
    kind: Kind,
    values: &'a [u8],
    /// Where its values begin in the file.
    pub offset: usize,
}

/// A variable, not decoded yet.
#[derive(Clone, Debug)]
pub(crate) struct Variable<'a> {
    pub name: String,
    /// Indices into [`Classic::dimensions`].
    pub dimensions: Vec<usize>,
    pub attributes: Vec<Attribute<'a>>,
    kind: Kind,
    begin: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    I8,
    Char,
    I16,
    I32,
    F32,
    F64,
    U8,
    U16,
    U32,
    I64,
    U64,
}

impl Kind {
    fn from_code(code: u32, version: u8) -> Result<Self, Problem> {
        Ok(match code {
            1 => Self::I8,
            2 => Self::Char,
            3 => Self::I16,
            4 => Self::I32,
            5 => Self::F32,
            6 => Self::F64,
            7 if version == 5 => Self::U8,
            8 if version == 5 => Self::U16,
            9 if version == 5 => Self::U32,
            10 if version == 5 => Self::I64,
            11 if version == 5 => Self::U64,
            _ => return Err(Problem::malformed(NAME, "type", code, "1 to 6 (in CDF-5 to 11)")),
        })
    }

    const fn size(self) -> u64 {
        match self {
            Self::I8 | Self::Char | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    /// Big-endian values as f64; 64-bit integers beyond 2^53 lose their last digits.
    fn decode(self, bytes: &[u8], out: &mut Vec<f64>) {
        macro_rules! each {
            ($t:ty) => {{
                const N: usize = size_of::<$t>();
                out.extend(bytes.chunks_exact(N).map(|b| {
                    let mut a = [0; N];
                    a.copy_from_slice(b);
                    <$t>::from_be_bytes(a) as f64
                }));
            }};
        }
        match self {
            Self::I8 => each!(i8),
            Self::Char | Self::U8 => each!(u8),
            Self::I16 => each!(i16),
            Self::U16 => each!(u16),
            Self::I32 => each!(i32),
            Self::U32 => each!(u32),
            Self::F32 => each!(f32),
            Self::F64 => each!(f64),
            Self::I64 => each!(i64),
            Self::U64 => each!(u64),
        }
    }
}

impl Attribute<'_> {
    /// The text of a character attribute; `None` for numbers and for bytes that are not UTF-8.
    pub(crate) fn text(&self) -> Option<&str> {
        if self.kind == Kind::Char { std::str::from_utf8(self.values).ok() } else { None }
    }

    /// The numbers of a numeric attribute.
    pub(crate) fn numbers(&self) -> Vec<f64> {
        let mut out = Vec::new();
        if self.kind != Kind::Char {
            self.kind.decode(self.values, &mut out);
        }
        out
    }
}

/// Header fields whose width depends on the version.
struct Header<'a> {
    cursor: Cursor<'a>,
    version: u8,
}

impl<'a> Header<'a> {
    fn count(&mut self, what: &str) -> Result<u64, Problem> {
        if self.version == 5 { self.cursor.u64_be(what) } else { self.cursor.u32_be(what).map(u64::from) }
    }

    fn padded(&mut self, what: &str, n: u64) -> Result<&'a [u8], Problem> {
        let values = self.cursor.take(what, n)?;
        let padding = (4 - values.len() % 4) % 4;
        // the last attribute of a header may stand at the very end of a file without data
        self.cursor.take(what, padding as u64)?;
        Ok(values)
    }

    fn name(&mut self, what: &str) -> Result<String, Problem> {
        let n = self.count(what)?;
        let bytes = self.padded(what, n)?;
        String::from_utf8(bytes.to_vec())
            .map_err(|_| Problem::malformed(NAME, what, format!("{bytes:?}"), "a name in UTF-8"))
    }

    /// Number of entries of a list.
    fn list(&mut self, what: &str, tag: u32) -> Result<u64, Problem> {
        let found = self.cursor.u32_be(what)?;
        let n = self.count(what)?;
        if found == tag || (found == 0 && n == 0) {
            Ok(n)
        } else {
            Err(Problem::malformed(
                NAME,
                format!("{what} tag"),
                found,
                format!("{tag}, or 0 with a count of 0"),
            ))
        }
    }

    fn attributes(&mut self) -> Result<Vec<Attribute<'a>>, Problem> {
        let n = self.list("attribute list", 12)?;
        let mut out = Vec::new();
        for _ in 0..n {
            let name = self.name("attribute name")?;
            let kind = Kind::from_code(self.cursor.u32_be("attribute type")?, self.version)?;
            let count = self.count("attribute count")?;
            let offset = self.cursor.position();
            let values = self.padded("attribute values", count.saturating_mul(kind.size()))?;
            out.push(Attribute { name, kind, values, offset });
        }
        Ok(out)
    }
}

/// Reads the header; the data stay where they are.
pub(crate) fn parse(bytes: &[u8]) -> Result<Classic<'_>, Problem> {
    let mut cursor = Cursor::new(NAME, bytes);
    let magic = cursor.take("magic bytes", 4)?;
    let version = magic[3];
    if &magic[..3] != b"CDF" || !matches!(version, 1 | 2 | 5) {
        return Err(Problem::malformed(NAME, "magic", format!("{magic:?}"), "\"CDF\" and 1, 2 or 5"));
    }
    let mut header = Header { cursor, version };
    let streaming = if version == 5 { u64::MAX } else { u64::from(u32::MAX) };
    let records = header.count("number of records")?;

    let mut dimensions = Vec::new();
    for _ in 0..header.list("dimension list", 10)? {
        dimensions.push((header.name("dimension name")?, header.count("dimension length")?));
    }
    let attributes = header.attributes()?;
    let mut variables = Vec::new();
    for _ in 0..header.list("variable list", 11)? {
        variables.push(variable(&mut header, &dimensions)?);
    }

    let mut file = Classic { bytes, records, record_size: 0, dimensions, attributes, variables };
    let slabs = file.variables.iter().filter(|v| file.is_record(v)).map(|v| file.slab(v)).collect::<Vec<_>>();
    file.record_size = match slabs.as_slice() {
        // the one record variable of a file is not padded
        [only] => *only,
        many => many.iter().fold(0, |sum, s| sum.saturating_add(s.saturating_add(3) / 4 * 4)),
    };
    if records == streaming {
        return Err(Problem::malformed(NAME, "number of records", "\"streaming\"", "a finished file"));
    }
    Ok(file)
}

fn variable<'a>(header: &mut Header<'a>, dimensions: &[(String, u64)]) -> Result<Variable<'a>, Problem> {
    let name = header.name("variable name")?;
    let n = header.count("number of dimensions")?;
    let mut ids = Vec::new();
    for _ in 0..n {
        let id = header.count("dimension id")?;
        match usize::try_from(id) {
            Ok(k) if k < dimensions.len() => ids.push(k),
            _ => {
                let expected = format!("less than {}", dimensions.len());
                return Err(Problem::malformed(NAME, format!("dimension id of {name}"), id, expected));
            }
        }
    }
    let attributes = header.attributes()?;
    let kind = Kind::from_code(header.cursor.u32_be("variable type")?, header.version)?;
    header.count("variable size")?;
    let begin = if header.version == 1 {
        u64::from(header.cursor.u32_be("variable offset")?)
    } else {
        header.cursor.u64_be("variable offset")?
    };
    Ok(Variable { name, dimensions: ids, attributes, kind, begin })
}

impl<'a> Classic<'a> {
    pub(crate) fn variable(&self, name: &str) -> Option<&Variable<'a>> {
        self.variables.iter().find(|v| v.name == name)
    }

    pub(crate) fn attribute(&self, name: &str) -> Option<&Attribute<'a>> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// Names of a variable's dimensions.
    pub(crate) fn dimension_names(&self, v: &Variable<'_>) -> Vec<&str> {
        v.dimensions.iter().filter_map(|&d| self.dimensions.get(d)).map(|d| d.0.as_str()).collect()
    }

    /// Lengths of a variable's dimensions.
    pub(crate) fn shape(&self, v: &Variable<'_>) -> Vec<u64> {
        v.dimensions
            .iter()
            .filter_map(|&d| self.dimensions.get(d))
            .map(|d| if d.1 == 0 { self.records } else { d.1 })
            .collect()
    }

    fn is_record(&self, v: &Variable<'_>) -> bool {
        v.dimensions.first().and_then(|&d| self.dimensions.get(d)).is_some_and(|d| d.1 == 0)
    }

    /// Bytes of a variable, or of one record of it, without padding.
    fn slab(&self, v: &Variable<'_>) -> u64 {
        let skip = usize::from(self.is_record(v));
        self.shape(v).iter().skip(skip).fold(v.kind.size(), |n, &len| n.saturating_mul(len))
    }

    /// All values of a variable, the last dimension running fastest.
    ///
    /// # Errors
    /// [`Problem::Truncated`] before anything is allocated that the file does not hold.
    pub(crate) fn numbers(&self, v: &Variable<'_>) -> Result<Vec<f64>, Problem> {
        let slab = self.slab(v);
        let mut cursor = Cursor::new(NAME, self.bytes);
        let mut out = Vec::new();
        if !self.is_record(v) {
            cursor.seek(v.begin);
            v.kind.decode(cursor.take(&v.name, slab)?, &mut out);
        } else if slab > 0 {
            for k in 0..self.records {
                cursor.seek(v.begin.saturating_add(k.saturating_mul(self.record_size)));
                v.kind.decode(cursor.take(&v.name, slab)?, &mut out);
            }
        }
        Ok(out)
    }
}

impl Variable<'_> {
    pub(crate) fn attribute(&self, name: &str) -> Option<&Attribute<'_>> {
        self.attributes.iter().find(|a| a.name == name)
    }
}
