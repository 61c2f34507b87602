//! χ(θh̄, θī): how far the colour of the base departs from its lobes, as a factor per channel.

use gonio_brdf::Rgb;
use gonio_optics::Angle;

use super::{AngleAxis, CarPaintError, FlakePlace};

/// Factors per channel over half angle and angle of incidence, both inside the coat.
///
/// Both angles are the same for light and view exchanged, so χ keeps reciprocity. Bilinear in the sines; the outermost nodes hold beyond.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourTable {
    half: AngleAxis,
    incidence: AngleAxis,
    values: Vec<[f32; 3]>,
}

impl ColourTable {
    /// Values in order of half angle, then angle of incidence.
    ///
    /// # Errors
    /// [`CarPaintError`] for angles out of order, another number of values, negative ones or such that are not finite.
    pub fn new(
        half: Vec<Angle>,
        incidence: Vec<Angle>,
        values: Vec<[f32; 3]>,
    ) -> Result<Self, CarPaintError> {
        let half = AngleAxis::new("χ half", half)?;
        let incidence = AngleAxis::new("χ incidence", incidence)?;
        let expected = half.len() * incidence.len();
        if values.len() != expected {
            return Err(CarPaintError::Count { what: "χ", found: values.len(), expected });
        }
        if let Some((k, v)) = values
            .iter()
            .enumerate()
            .find_map(|(k, v)| v.iter().find(|v| !(v.is_finite() && **v >= 0.0)).map(|v| (k, v)))
        {
            return Err(CarPaintError::Value {
                key: format!("χ[{}, {}]", k / incidence.len(), k % incidence.len()),
                found: v.to_string(),
                expected: "finite numbers, none below 0",
            });
        }
        Ok(Self { half, incidence, values })
    }

    /// Half angles θh̄.
    #[must_use]
    pub fn half(&self) -> &AngleAxis {
        &self.half
    }

    /// Angles of incidence θī.
    #[must_use]
    pub fn incidence(&self) -> &AngleAxis {
        &self.incidence
    }

    /// Factors, in order of half angle, then angle of incidence.
    #[must_use]
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// The factors at a place.
    #[must_use]
    pub fn at(&self, place: FlakePlace) -> Rgb {
        bilinear(&self.half, &self.incidence, place, |k| self.values[k].map(f64::from))
    }
}

/// Bilinear in the sines of both angles among values in order of half angle, then angle of incidence.
pub(super) fn bilinear(
    half: &AngleAxis,
    incidence: &AngleAxis,
    place: FlakePlace,
    value: impl Fn(usize) -> Rgb,
) -> Rgb {
    let (h, s) = half.locate(place.sin_half);
    let (i, t) = incidence.locate(place.sin_incidence);
    let n = incidence.len();
    let row = |h: usize| {
        let a = value(h * n + i);
        if t == 0.0 {
            return a;
        }
        let b = value(h * n + i + 1);
        [0, 1, 2].map(|c| a[c] + t * (b[c] - a[c]))
    };
    let a = row(h);
    if s == 0.0 {
        return a;
    }
    let b = row(h + 1);
    [0, 1, 2].map(|c| a[c] + s * (b[c] - a[c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(deg: &[f64]) -> Vec<Angle> {
        deg.iter().map(|&d| Angle::from_degrees(d)).collect()
    }

    #[test]
    fn nodes_come_back_and_what_lies_between_is_linear_in_the_sines() {
        let values = (0..6).map(|k| [k as f32, 1.0, 0.5 * k as f32]).collect();
        let t = ColourTable::new(angles(&[0.0, 30.0]), angles(&[0.0, 10.0, 40.0]), values).expect("sound");
        for (k, v) in t.values().iter().enumerate() {
            let place = FlakePlace {
                sin_half: t.half().angles()[k / 3].sin(),
                sin_incidence: t.incidence().angles()[k % 3].sin(),
            };
            assert_eq!(t.at(place), v.map(f64::from));
        }
        let between = t.at(FlakePlace { sin_half: 0.25, sin_incidence: 0.0 });
        assert!((between[0] - 1.5).abs() < 1e-12, "{between:?}");
        assert_eq!(t.at(FlakePlace { sin_half: 1.0, sin_incidence: 1.0 })[0], 5.0);
    }

    #[test]
    fn what_is_no_factor_is_refused_with_its_place() {
        let new = |values: Vec<[f32; 3]>| {
            ColourTable::new(angles(&[0.0]), angles(&[0.0, 1.0]), values).expect_err("unsound")
        };
        assert!(new(vec![[1.0; 3]]).to_string().contains("expected 2"));
        assert!(new(vec![[1.0; 3], [1.0, -0.5, 1.0]]).to_string().contains("χ[0, 1] = -0.5"));
        assert!(new(vec![[f32::NAN; 3], [1.0; 3]]).to_string().contains("χ[0, 0] = NaN"));
    }
}
