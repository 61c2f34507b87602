//! Cornell `.brdf`: spectral measurements at scattered geometries, as text.
//!
//! ```text
//! # comments
//! n                    number of wavelengths
//! λ1 … λn              nm, over any number of lines
//! θi φi θs φs f1 … fn  one geometry a line; radians, f in 1/sr
//! ```
//!
//! φs − φi = 0 is the light's side (the mirror peak stands at π). Spectra become linear RGB by the CIE 1931 observer under D65.

use gonio_optics::{Angle, Geometry, colour::SpectralWeights};

use super::Problem;
use crate::{Flag, Scattered, ScatteredPoint};

/// Most wavelengths that are believed.
const MOST: u64 = 10_000;

/// The measurements with their colours.
///
/// # Errors
/// [`Problem::Line`] with line, column, what was found and what would be accepted.
pub fn read(bytes: &[u8]) -> Result<Scattered, Problem> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|&&b| b == b'\n').count() as u64;
        Problem::line(line, "any", "bytes that are not text", "text")
    })?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(k, l)| (k as u64 + 1, l.split('#').next().unwrap_or_default().trim()))
        .filter(|(_, l)| !l.is_empty());
    let end = text.lines().count() as u64;

    let (line, word) = lines.next().unwrap_or((end, ""));
    let n = word.parse::<u64>().ok().filter(|n| (1..=MOST).contains(n)).ok_or_else(|| {
        Problem::line(line, "number of wavelengths", quote(word), format!("a whole number, 1 to {MOST}"))
    })?;
    let mut wavelengths: Vec<f64> = Vec::new();
    while (wavelengths.len() as u64) < n {
        let Some((line, words)) = lines.next() else {
            let found = format!("the end of the file after {}", wavelengths.len());
            return Err(Problem::line(end, "wavelengths", found, format!("{n} numbers, nm")));
        };
        for word in words.split_whitespace() {
            wavelengths.push(number(line, "wavelengths", word, "a wavelength in nm", f64::is_finite)?);
        }
        if wavelengths.len() as u64 > n {
            let found = format!("{} numbers", wavelengths.len());
            return Err(Problem::line(line, "wavelengths", found, format!("{n} numbers, nm")));
        }
    }
    let weights = SpectralWeights::new(&wavelengths)
        .map_err(|e| Problem::line(line, "wavelengths", e.to_string(), "increasing numbers of nm"))?;

    let mut out = Scattered::default();
    for (line, words) in lines {
        out.points.push(row(line, words, &weights)?);
    }
    if out.points.is_empty() {
        return Err(Problem::line(end, "theta_i", "the end of the file", "at least one row of numbers"));
    }
    Ok(out)
}

fn row(line: u64, words: &str, weights: &SpectralWeights) -> Result<ScatteredPoint, Problem> {
    const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_s", "phi_s"];
    // a little over a right angle is rounding
    const LIMIT: f64 = std::f64::consts::FRAC_PI_2 + 1e-5;
    let mut angles = [0.0; 4];
    let mut spectrum = Vec::with_capacity(weights.len());
    let mut count = 0;
    for (k, word) in words.split_whitespace().enumerate() {
        count = k + 1;
        if let (Some(slot), Some(name)) = (angles.get_mut(k), ANGLES.get(k)) {
            *slot = if k % 2 == 0 {
                number(line, name, word, "radians, 0 to pi/2", |x| (-1e-5..=LIMIT).contains(&x))?
            } else {
                number(line, name, word, "radians within a turn", |x| {
                    x.abs() <= std::f64::consts::TAU + 1e-4
                })?
            };
        } else if spectrum.len() < weights.len() {
            spectrum.push(number(
                line,
                &format!("sample {}", k - 3),
                word,
                "a finite number",
                f64::is_finite,
            )?);
        }
    }
    let expected = weights.len() + ANGLES.len();
    if count != expected {
        let name =
            if count < ANGLES.len() { ANGLES[count].to_owned() } else { format!("sample {}", count - 3) };
        return Err(Problem::line(line, name, format!("{count} numbers"), format!("{expected} numbers")));
    }
    let polar = |x: f64| Angle::from_radians(x.clamp(0.0, std::f64::consts::FRAC_PI_2));
    let phi = Angle::from_radians(angles[3] - angles[1]).folded();
    let geometry = Geometry { theta_i: polar(angles[0]), theta_o: polar(angles[2]), phi };
    Ok(ScatteredPoint { geometry, value: weights.rgb(&spectrum), sigma: None, flag: Flag::Measured })
}

fn number(
    line: u64,
    column: &str,
    word: &str,
    expected: &str,
    accept: impl Fn(f64) -> bool,
) -> Result<f64, Problem> {
    word.parse().ok().filter(|&x| accept(x)).ok_or_else(|| Problem::line(line, column, quote(word), expected))
}

fn quote(word: &str) -> String {
    format!("\"{}\"", word.chars().take(40).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "# a paint\n\n3\n# wls\n400 550\n700\n0.5 0 0.5 3.14159265 0.25 0.25 0.25\n0.5 3.0 1.5708 -3.0 0.1 0.2 0.3 # last\n";

    #[test]
    fn spectra_become_colours_and_azimuths_are_folded() {
        let s = read(FILE.as_bytes()).unwrap();
        assert_eq!(s.points.len(), 2);
        assert!((s.points[0].geometry.phi.degrees() - 180.0).abs() < 1e-6);
        assert!(s.points[0].value.iter().all(|v| (v - 0.25).abs() < 1e-12));
        let phi = s.points[1].geometry.phi.radians();
        assert!(
            (phi - (std::f64::consts::TAU - 6.0)).abs() < 1e-12
                && s.points[1].geometry.theta_o == Angle::RIGHT
        );
        let [r, g, b] = s.points[1].value;
        assert!(r > g && g > b, "{:?}", s.points[1].value);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let message =
            |from: &str, to: &str| read(FILE.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
        assert_eq!(
            message("\n3\n", "\nthree\n"),
            "line 3, column number of wavelengths: found \"three\", expected a whole number, 1 to 10000"
        );
        assert_eq!(
            message("\n3\n", "\n4000000000\n").split(':').next(),
            Some("line 3, column number of wavelengths")
        );
        assert_eq!(
            message("0.2 0.3 #", "0.2 #"),
            "line 8, column sample 3: found 6 numbers, expected 7 numbers"
        );
        assert_eq!(
            message("0.2 0.3", "nan 0.3"),
            "line 8, column sample 2: found \"nan\", expected a finite number"
        );
        assert_eq!(
            message("1.5708", "1.6"),
            "line 8, column theta_s: found \"1.6\", expected radians, 0 to pi/2"
        );
        assert!(message("700", "500").contains("500 nm"));
        assert!(read(b"3\n400 500").unwrap_err().to_string().contains("after 2"));
        assert!(read(b"").is_err() && read(b"# \xff").is_err() && read(b"1\n500\n").is_err());
    }
}
