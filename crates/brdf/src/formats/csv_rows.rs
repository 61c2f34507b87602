//! Rows of a CSV with a header, every refusal told with line, column, what was found and what was expected.

use super::Problem;
use crate::Flag;

/// The row at hand.
pub(super) struct Rows<'a> {
    reader: csv::Reader<&'a [u8]>,
    header: Vec<String>,
    record: csv::StringRecord,
    line: u64,
}

impl<'a> Rows<'a> {
    pub(super) fn new(text: &'a [u8]) -> Result<Self, Problem> {
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(text);
        let header = reader.headers().map_err(|e| syntax(&e))?.iter().map(str::to_owned).collect();
        let mut rows = Self { reader, header, record: csv::StringRecord::new(), line: 1 };
        rows.line =
            rows.reader.headers().ok().and_then(csv::StringRecord::position).map_or(1, csv::Position::line);
        Ok(rows)
    }

    /// Line of the row at hand, from 1.
    pub(super) const fn line(&self) -> u64 {
        self.line
    }

    /// Place of a column.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|h| h == name)
    }

    pub(super) fn required<const N: usize>(&self, names: [&str; N]) -> Result<[usize; N], Problem> {
        let mut out = [0; N];
        for (slot, name) in out.iter_mut().zip(names) {
            *slot = self.find(name).ok_or_else(|| {
                let mut found = self.header.join(", ");
                if let Some((end, _)) = found.char_indices().nth(200) {
                    found.truncate(end);
                    found.push('…');
                }
                Problem::line(self.line, name, format!("the columns {found}"), "a column of this name")
            })?;
        }
        Ok(out)
    }

    /// All of the columns or none.
    pub(super) fn optional<const N: usize>(&self, names: [&str; N]) -> Result<Option<[usize; N]>, Problem> {
        if names.iter().any(|n| self.find(n).is_some()) { self.required(names).map(Some) } else { Ok(None) }
    }

    /// Goes to the next row; false at the end.
    pub(super) fn advance(&mut self) -> Result<bool, Problem> {
        if !self.reader.read_record(&mut self.record).map_err(|e| syntax(&e))? {
            return Ok(false);
        }
        self.line = self.record.position().map_or(self.line, csv::Position::line);
        if self.record.len() == self.header.len() {
            return Ok(true);
        }
        let last = self.record.len().min(self.header.len().saturating_sub(1));
        let column = self.header.get(last).cloned().unwrap_or_default();
        let found = format!("{} fields", self.record.len());
        Err(Problem::line(self.line, column, found, format!("{} fields as in the header", self.header.len())))
    }

    fn text(&self, column: usize) -> &str {
        self.record.get(column).unwrap_or_default()
    }

    fn refuse(&self, column: usize, expected: &str) -> Problem {
        let name = self.header.get(column).cloned().unwrap_or_default();
        let found = self.text(column).chars().take(40).collect::<String>();
        Problem::line(self.line, name, format!("\"{found}\""), expected)
    }

    pub(super) fn number(
        &self,
        column: usize,
        expected: &str,
        accept: impl Fn(f64) -> bool,
    ) -> Result<f64, Problem> {
        self.text(column).parse().ok().filter(|&x| accept(x)).ok_or_else(|| self.refuse(column, expected))
    }

    /// A number that may be infinite or NaN, or nothing at all (NaN).
    pub(super) fn any_number(&self, column: usize) -> Result<f64, Problem> {
        if self.text(column).is_empty() {
            Ok(f64::NAN)
        } else {
            self.number(column, "a number or nothing", |_| true)
        }
    }

    /// θi, θo within 0…90° and φ within a turn to either side, degrees.
    pub(super) fn angles(&self, columns: [usize; 3]) -> Result<[f64; 3], Problem> {
        let polar = |k: usize| self.number(k, "degrees, 0 to 90", |x| (0.0..=90.0).contains(&x));
        let azimuth = |k: usize| self.number(k, "degrees, -360 to 360", |x| (-360.0..=360.0).contains(&x));
        Ok([polar(columns[0])?, polar(columns[1])?, azimuth(columns[2])?])
    }

    pub(super) fn flag(&self, column: usize) -> Result<Flag, Problem> {
        self.text(column)
            .parse()
            .ok()
            .and_then(Flag::from_byte)
            .ok_or_else(|| self.refuse(column, "0 measured, 1 filled, 2 extrapolated or 3 invalid"))
    }
}

fn syntax(e: &csv::Error) -> Problem {
    let line = e.position().map_or(1, csv::Position::line);
    Problem::line(line, "any", e.to_string(), "comma-separated text in UTF-8")
}
