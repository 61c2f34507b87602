//! Scales, their ticks and how numbers are written on them.

/// How a value becomes a place on an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    Linear { low: f64, high: f64 },
    Log { low: f64, high: f64 },
}

/// A mark on an axis; minor ones carry no label.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub value: f64,
    pub label: Option<String>,
}

impl Scale {
    /// A linear scale; an empty or unusable range is widened to something drawable.
    pub(crate) fn linear(low: f64, high: f64) -> Self {
        match (low.is_finite() && high.is_finite(), high > low) {
            (false, _) => Self::Linear { low: 0.0, high: 1.0 },
            (true, true) => Self::Linear { low, high },
            (true, false) => Self::Linear { low, high: low + low.abs().max(1.0) },
        }
    }

    /// A logarithmic scale over whole steps of 1, 2, 5 that hold `low`…`high`, both above zero.
    pub(crate) fn log(low: f64, high: f64) -> Self {
        if !(low > 0.0 && high.is_finite() && high >= low) {
            return Self::Log { low: 0.1, high: 10.0 };
        }
        let (low, high) = (step_down(low), step_up(high));
        Self::Log { low, high: if high > low { high } else { low * 10.0 } }
    }

    /// 0 at the low end, 1 at the high end; outside it goes on; not finite for values a logarithm cannot take.
    pub(crate) fn fraction(self, x: f64) -> f64 {
        match self {
            Self::Linear { low, high } => (x - low) / (high - low),
            Self::Log { low, high } => (x / low).ln() / (high / low).ln(),
        }
    }

    /// Marks: about `wanted` labelled ones on a linear scale; powers of ten (and 2, 5 where there is room) on a logarithmic one.
    pub(crate) fn ticks(self, wanted: usize) -> Vec<Tick> {
        match self {
            Self::Linear { low, high } => linear_ticks(low, high, wanted),
            Self::Log { low, high } => log_ticks(low, high, wanted),
        }
    }
}

fn linear_ticks(low: f64, high: f64, wanted: usize) -> Vec<Tick> {
    let step = step_up((high - low) / wanted.max(1) as f64 * 0.999);
    let decimals = (-step.log10()).ceil().clamp(0.0, 12.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last.min(first + 100))
        .map(|k| {
            let value = k as f64 * step;
            Tick { value, label: Some(minus(&format!("{value:.decimals$}"))) }
        })
        .collect()
}

fn log_ticks(low: f64, high: f64, wanted: usize) -> Vec<Tick> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (high / low).log10();
    let every = ((decades / wanted.max(1) as f64).ceil() as i32).max(1);
    let plain = first >= -3 && last <= 4;
    let mut ticks = Vec::new();
    for e in first..=last {
        for m in 1..10 {
            let value = f64::from(m) * 10f64.powi(e);
            if value < low * (1.0 - 1e-9) || value > high * (1.0 + 1e-9) {
                continue;
            }
            let labelled = match m {
                1 => e.rem_euclid(every) == 0,
                2 | 5 => decades * 3.0 <= wanted as f64,
                _ => false,
            };
            if m > 1 && decades > 8.0 {
                continue;
            }
            ticks.push(Tick { value, label: labelled.then(|| power(m, e, plain)) });
        }
    }
    ticks
}

fn power(m: i32, e: i32, plain: bool) -> String {
    if plain {
        let decimals = (-e).max(0) as usize;
        return format!("{:.decimals$}", f64::from(m) * 10f64.powi(e));
    }
    let digits = "⁰¹²³⁴⁵⁶⁷⁸⁹";
    let exponent: String = e
        .to_string()
        .chars()
        .filter_map(|c| if c == '-' { Some('⁻') } else { digits.chars().nth(c.to_digit(10)? as usize) })
        .collect();
    if m == 1 { format!("10{exponent}") } else { format!("{m}·10{exponent}") }
}

/// A number with three significant digits at most, as people write it.
pub(crate) fn short(x: f64) -> String {
    if !x.is_finite() {
        return "–".into();
    }
    let size = x.abs();
    if size == 0.0 {
        return "0".into();
    }
    let e = size.log10().floor() as i32;
    if !(-3..=5).contains(&e) {
        let m = x / 10f64.powi(e);
        return format!("{}·{}", minus(&format!("{m:.1}")), power(1, e, false));
    }
    let decimals = (2 - e).max(0) as usize;
    let text = format!("{x:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    minus(text)
}

/// The true minus sign.
pub(crate) fn minus(text: &str) -> String {
    text.replace('-', "−")
}

/// The next of 1, 2, 5 × 10ⁿ at or above a positive number.
pub(crate) fn step_up(x: f64) -> f64 {
    steps(x).find(|&s| s >= x * (1.0 - 1e-9)).unwrap_or(x)
}

/// The next of 1, 2, 5 × 10ⁿ at or below a positive number.
pub(crate) fn step_down(x: f64) -> f64 {
    steps(x).take_while(|&s| s <= x * (1.0 + 1e-9)).last().unwrap_or(x)
}

fn steps(x: f64) -> impl Iterator<Item = f64> {
    let e = if x > 0.0 && x.is_finite() { x.log10().floor() as i32 } else { 0 };
    let decade = move |m: f64, e: i32| if e < 0 { m / 10f64.powi(-e) } else { m * 10f64.powi(e) };
    [decade(1.0, e), decade(2.0, e), decade(5.0, e), decade(1.0, e + 1)].into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(s: Scale, n: usize) -> Vec<String> {
        s.ticks(n).into_iter().filter_map(|t| t.label).collect()
    }

    #[test]
    fn linear_ticks_are_round_numbers_inside_the_range() {
        assert_eq!(
            labels(Scale::linear(-90.0, 90.0), 10),
            ["−80", "−60", "−40", "−20", "0", "20", "40", "60", "80"]
        );
        assert_eq!(
            labels(Scale::linear(0.0, 0.3), 6),
            ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25", "0.30"]
        );
    }

    #[test]
    fn log_ticks_are_powers_of_ten_and_more_where_there_is_room() {
        assert_eq!(labels(Scale::log(0.013, 80.0), 6), ["0.01", "0.1", "1", "10", "100"]);
        assert_eq!(labels(Scale::log(1e-6, 3e5), 6), ["10⁻⁶", "10⁻⁴", "10⁻²", "10⁰", "10²", "10⁴"]);
        assert_eq!(labels(Scale::log(0.1, 0.9), 6), ["0.1", "0.2", "0.5", "1"]);
    }

    #[test]
    fn a_scale_without_data_is_still_a_scale() {
        for s in [
            Scale::linear(0.0, 0.0),
            Scale::linear(f64::NAN, 1.0),
            Scale::log(0.0, 0.0),
            Scale::log(5.0, 5.0),
        ] {
            assert!(s.fraction(1.0).is_finite(), "{s:?}");
            assert!(!s.ticks(5).is_empty(), "{s:?}");
        }
    }

    #[test]
    fn numbers_are_written_short() {
        let cases = [
            (0.0, "0"),
            (0.123456, "0.123"),
            (-12.34, "−12.3"),
            (1234.5, "1234"),
            (2.5e-7, "2.5·10⁻⁷"),
            (3.0, "3"),
        ];
        for (x, text) in cases {
            assert_eq!(short(x), text);
        }
        assert_eq!(short(f64::NAN), "–");
    }
}
