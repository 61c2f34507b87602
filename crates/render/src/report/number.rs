//! Numbers as a report writes them.

/// `value ± sigma` with two significant digits of the uncertainty and the value to the same place; without a usable uncertainty the
/// value to four significant digits.
#[must_use]
pub fn plus_minus(value: f64, sigma: Option<f64>) -> String {
    match sigma {
        // an uncertainty at the level of rounding says that the data hold no more equations than parameters
        Some(s) if s > 1e-9 * value.abs() && s > 0.0 && s.is_finite() && value.is_finite() => {
            let place = place_of(s) - 1;
            let largest = value.abs().max(s);
            if !(1e-4..1e6).contains(&largest) {
                let e = place_of(largest);
                let scale = 10f64.powi(e);
                let decimals = (e - place).clamp(0, 15) as usize;
                let text = format!(
                    "({:.decimals$} ± {:.decimals$}) × 10{}",
                    value / scale,
                    s / scale,
                    superscript(e)
                );
                return text.replace('-', "−");
            }
            let decimals = (-place).clamp(0, 15) as usize;
            format!("{value:.decimals$} ± {s:.decimals$}").replace('-', "−")
        }
        _ => significant(value, 4),
    }
}

/// A number with so many significant digits.
#[must_use]
pub fn significant(x: f64, digits: u8) -> String {
    if !x.is_finite() {
        return "–".into();
    }
    if x == 0.0 {
        return "0".into();
    }
    let e = place_of(x.abs());
    if !(-4..6).contains(&e) {
        let decimals = usize::from(digits.saturating_sub(1));
        return format!("{:.decimals$} × 10{}", x / 10f64.powi(e), superscript(e)).replace('-', "−");
    }
    let decimals = (i32::from(digits) - 1 - e).clamp(0, 15) as usize;
    format!("{x:.decimals$}").replace('-', "−")
}

/// Power of ten of the first digit.
fn place_of(x: f64) -> i32 {
    x.log10().floor() as i32
}

fn superscript(e: i32) -> String {
    let digits = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    e.to_string()
        .chars()
        .filter_map(|c| if c == '-' { Some('⁻') } else { digits.get(c.to_digit(10)? as usize).copied() })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainties_decide_the_digits() {
        for (value, sigma, text) in [
            (0.281_234, Some(0.001_23), "0.2812 ± 0.0012"),
            (1302.4, Some(12.3), "1302 ± 12"),
            (-0.5, Some(0.25), "−0.50 ± 0.25"),
            (0.281_234, None, "0.2812"),
            (0.281_234, Some(f64::NAN), "0.2812"),
            (2.5e8, Some(1.0e6), "(2.500 ± 0.010) × 10⁸"),
            (3e-7, Some(2e-8), "(3.00 ± 0.20) × 10⁻⁷"),
            (f64::NAN, Some(1.0), "–"),
            (0.0, Some(0.0), "0"),
        ] {
            assert_eq!(plus_minus(value, sigma), text);
        }
    }

    #[test]
    fn significant_digits_are_kept() {
        for (x, text) in [
            (0.123_456, "0.123"),
            (12.0, "12.0"),
            (1234.0, "1234"),
            (1.5e9, "1.50 × 10⁹"),
            (-2e-6, "−2.00 × 10⁻⁶"),
        ] {
            assert_eq!(significant(x, 3), text);
        }
    }
}
