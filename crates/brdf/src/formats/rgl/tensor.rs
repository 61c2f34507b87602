//! The tensor container: named arrays with their places.
//!
//! ```text
//! "tensor_file\0", u8 × 2 version (1, 0), u32 number of fields
//! field: u16 length, name, u16 dimensions, u8 type, u64 place in the file, u64 × dimensions size           all LE
//! types: 1 u8, 2 i8, 3 u16, 4 i16, 5 u32, 6 i32, 7 u64, 8 i64, 9 f16, 10 f32, 11 f64
//! ```

use super::NAME;
use crate::formats::{Problem, cursor::Cursor, cursor::all_finite};

/// First bytes of a file.
pub(in crate::formats) const MAGIC: &[u8] = b"tensor_file\0";

/// The fields of a file, data left where they are.
#[derive(Debug)]
pub(super) struct Tensors<'a> {
    bytes: &'a [u8],
    fields: Vec<Field>,
}

#[derive(Debug)]
struct Field {
    name: String,
    kind: u8,
    place: u64,
    shape: Vec<u64>,
}

/// An array of f32 with its sizes, the last running fastest.
#[derive(Debug)]
pub(super) struct Array {
    pub values: Vec<f32>,
    pub shape: Vec<usize>,
}

impl<'a> Tensors<'a> {
    pub(super) fn parse(bytes: &'a [u8]) -> Result<Self, Problem> {
        let mut cursor = Cursor::new(NAME, bytes);
        let magic = cursor.take("magic", MAGIC.len() as u64)?;
        if magic != MAGIC {
            return Err(Problem::malformed(NAME, "magic", format!("{magic:?}"), "tensor_file"));
        }
        let version = [cursor.u8("version")?, cursor.u8("version")?];
        if version != [1, 0] {
            return Err(Problem::malformed(NAME, "version", format!("{version:?}"), "[1, 0]"));
        }
        let mut fields = Vec::new();
        for _ in 0..cursor.u32_le("number of fields")? {
            let length = cursor.u16_le("length of a name")?;
            let name = String::from_utf8_lossy(cursor.take("name", u64::from(length))?).into_owned();
            let dimensions = cursor.u16_le(&name)?;
            let kind = cursor.u8(&name)?;
            let place = cursor.u64_le(&name)?;
            let mut shape = Vec::new();
            for _ in 0..dimensions {
                shape.push(cursor.u64_le(&name)?);
            }
            fields.push(Field { name, kind, place, shape });
        }
        Ok(Self { bytes, fields })
    }

    fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name)
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.field(name).is_some()
    }

    /// A field of text; empty where there is none.
    pub(super) fn text(&self, name: &str) -> String {
        let Some(field) = self.field(name).filter(|f| f.kind <= 2) else { return String::new() };
        let mut cursor = Cursor::new(NAME, self.bytes);
        cursor.seek(field.place);
        let length = field.shape.iter().fold(1u64, |n, &s| n.saturating_mul(s));
        let bytes = cursor.take(name, length).unwrap_or_default();
        String::from_utf8_lossy(bytes).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
    }

    /// A field of finite f32 with so many dimensions.
    pub(super) fn f32s(&self, name: &str, dimensions: usize) -> Result<Array, Problem> {
        let field = self
            .field(name)
            .ok_or_else(|| Problem::malformed(NAME, format!("field {name}"), "absent", "an array"))?;
        if field.kind != 10 || field.shape.len() != dimensions {
            let found = format!("of type {} with {} dimensions", field.kind, field.shape.len());
            let expected = format!("type 10 (f32) with {dimensions} dimensions");
            return Err(Problem::malformed(NAME, format!("field {name}"), found, expected));
        }
        let mut cursor = Cursor::new(NAME, self.bytes);
        cursor.seek(field.place);
        let count = field.shape.iter().fold(1u64, |n, &s| n.saturating_mul(s));
        let values = cursor.f32s_le(name, count)?;
        all_finite(NAME, name, &values)?;
        if values.is_empty() {
            return Err(Problem::malformed(NAME, format!("field {name}"), "empty", "numbers"));
        }
        // each size is at most their product, which the file holds
        let shape = field.shape.iter().map(|&s| usize::try_from(s).unwrap_or(usize::MAX)).collect();
        Ok(Array { values, shape })
    }
}
