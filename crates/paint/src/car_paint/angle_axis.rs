//! Rising angles inside the coat as an axis of a table: found by their sine, so that a look-up needs no inverse function.

use gonio_optics::Angle;

use super::CarPaintError;

/// Rising angles within 0° … 90°, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct AngleAxis {
    angles: Vec<Angle>,
    sines: Vec<f64>,
    /// For each of [`GUIDES`] equal steps of the sine, the last node at or below its lower end.
    guide: Vec<u16>,
}

/// Steps of the guide table.
const GUIDES: usize = 64;
/// Nodes that an axis may have.
const MAX_NODES: usize = 4096;

impl AngleAxis {
    /// An axis; `name` goes into the message.
    ///
    /// # Errors
    /// [`CarPaintError::Axis`] for none, too many, angles that do not rise or leave 0° … 90°.
    pub fn new(name: &'static str, angles: Vec<Angle>) -> Result<Self, CarPaintError> {
        if angles.is_empty() || angles.len() > MAX_NODES {
            return Err(CarPaintError::Axis {
                name,
                found: format!("{} angles", angles.len()),
                expected: "1 to 4096 angles",
            });
        }
        let mut before = f64::NEG_INFINITY;
        for (place, a) in angles.iter().enumerate() {
            // tolerates the rounding of 90° in radians, refuses what is not a number
            if !(a.degrees() > before && a.degrees() >= 0.0 && a.degrees() <= 90.0 + 1e-9) {
                return Err(CarPaintError::Axis {
                    name,
                    found: format!("{}° at place {place}", a.degrees()),
                    expected: "angles that rise within 0° … 90°",
                });
            }
            before = a.degrees();
        }
        let sines: Vec<f64> = angles.iter().map(|a| a.sin()).collect();
        let guide = (0..GUIDES)
            .map(|g| {
                let low = g as f64 / GUIDES as f64;
                sines.partition_point(|&s| s <= low).saturating_sub(1) as u16
            })
            .collect();
        Ok(Self { angles, sines, guide })
    }

    /// The angles.
    #[must_use]
    pub fn angles(&self) -> &[Angle] {
        &self.angles
    }

    /// Number of angles, at least 1.
    #[must_use]
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len(&self) -> usize {
        self.angles.len()
    }

    /// The node below a sine and the share of the next one, linear in the sine; the outermost nodes hold beyond.
    ///
    /// The node after the one given exists wherever the share is not 0.
    #[must_use]
    pub fn locate(&self, sine: f64) -> (usize, f64) {
        let last = self.sines.len() - 1;
        if sine.is_nan() || sine <= self.sines[0] {
            return (0, 0.0);
        }
        if sine >= self.sines[last] {
            return (last, 0.0);
        }
        let mut k = usize::from(self.guide[((sine * GUIDES as f64) as usize).min(GUIDES - 1)]);
        while self.sines[k + 1] <= sine {
            k += 1;
        }
        (k, (sine - self.sines[k]) / (self.sines[k + 1] - self.sines[k]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(deg: &[f64]) -> Result<AngleAxis, CarPaintError> {
        AngleAxis::new("half", deg.iter().map(|&d| Angle::from_degrees(d)).collect())
    }

    #[test]
    fn the_guide_finds_what_a_search_finds() {
        for deg in [
            vec![0.0, 0.1, 0.2, 5.0, 40.0, 41.8],
            vec![10.0],
            vec![3.0, 90.0],
            (0..91).map(f64::from).collect(),
        ] {
            let a = axis(&deg).expect("sound");
            for step in 0..=2000 {
                let s = f64::from(step) / 2000.0;
                let (k, t) = a.locate(s);
                assert!((0.0..1.0).contains(&t));
                let clamped = s.clamp(a.sines[0], a.sines[a.len() - 1]);
                let next = a.sines[(k + 1).min(a.len() - 1)];
                assert!((a.sines[k] + t * (next - a.sines[k]) - clamped).abs() < 1e-15, "{s}");
            }
            assert_eq!(a.locate(f64::NAN), (0, 0.0));
        }
    }

    #[test]
    fn angles_that_make_no_axis_are_refused() {
        for deg in [&[][..], &[1.0, 1.0], &[2.0, 1.0], &[-1.0], &[91.0], &[f64::NAN]] {
            let message = axis(deg).expect_err("unsound").to_string();
            assert!(message.contains("half") && message.contains("expected"), "{message}");
        }
    }
}
