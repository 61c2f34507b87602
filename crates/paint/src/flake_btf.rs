//! What single flakes add: a texture for each pair of half angle and angle of incidence (Ξ of Golla & Klein 2018, eq. 7).

use gonio_optics::Angle;

/// Flake textures over the angles inside the coat.
///
/// Slice `(h, i)` belongs to half angle `half[h]` and angle of incidence `incidence[i]`, both inside the coat and rising; its texels
/// are linear RGB in 1/sr (Rec. 709, D65), row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct FlakeBtf {
    half: Vec<Angle>,
    incidence: Vec<Angle>,
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

/// Why textures are no flake BTF.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum FlakeBtfError {
    /// Angles that do not rise, or are outside [0°, 90°].
    #[error(
        "the {axis} angles must rise within 0° … 90°, found {found_deg}° at place {place}; sort the slices by angle"
    )]
    Angles {
        /// Which of the two.
        axis: &'static str,
        /// The first one out of order, degrees.
        found_deg: f64,
        /// Its place, from 0.
        place: usize,
    },
    /// No slice or no texel.
    #[error(
        "a flake BTF needs at least one slice of one texel, found {half} × {incidence} slices of {width} × {height} texels"
    )]
    Empty {
        /// Half angles.
        half: usize,
        /// Angles of incidence.
        incidence: usize,
        /// Texels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Another number of texels than the sizes ask for.
    #[error("{expected} texels are expected from the sizes, found {found}")]
    Size {
        /// By the sizes.
        expected: usize,
        /// Given.
        found: usize,
    },
    /// A texel that is not a finite number.
    #[error(
        "slice {half}, {incidence} holds a value that is not a finite number at x = {x}, y = {y}; mend or leave out the slice"
    )]
    NotFinite {
        /// Place of its half angle.
        half: usize,
        /// Place of its angle of incidence.
        incidence: usize,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
    },
}

impl FlakeBtf {
    /// Textures in order of half angle, then angle of incidence, then row.
    ///
    /// # Errors
    /// Angles out of order, nothing in it, a wrong number of texels, values that are not finite. Negative values are kept: noise around
    /// nothing is negative half of the time.
    pub fn new(
        half: Vec<Angle>,
        incidence: Vec<Angle>,
        [width, height]: [usize; 2],
        texels: Vec<[f32; 3]>,
    ) -> Result<Self, FlakeBtfError> {
        rising("half", &half)?;
        rising("incidence", &incidence)?;
        if half.is_empty() || incidence.is_empty() || width == 0 || height == 0 {
            return Err(FlakeBtfError::Empty { half: half.len(), incidence: incidence.len(), width, height });
        }
        let expected =
            half.len().saturating_mul(incidence.len()).saturating_mul(width).saturating_mul(height);
        if texels.len() != expected {
            return Err(FlakeBtfError::Size { expected, found: texels.len() });
        }
        if let Some(at) = texels.iter().position(|t| t.iter().any(|v| !v.is_finite())) {
            let (slice, texel) = (at / (width * height), at % (width * height));
            return Err(FlakeBtfError::NotFinite {
                half: slice / incidence.len(),
                incidence: slice % incidence.len(),
                x: texel % width,
                y: texel / width,
            });
        }
        Ok(Self { half, incidence, width, height, texels })
    }

    /// Half angles θh̄ inside the coat, rising.
    #[must_use]
    pub fn half(&self) -> &[Angle] {
        &self.half
    }

    /// Angles of incidence θī inside the coat, rising.
    #[must_use]
    pub fn incidence(&self) -> &[Angle] {
        &self.incidence
    }

    /// Texels in a row and rows of each slice.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Texels of slice `(h, i)`, row by row, linear RGB in 1/sr; `None` outside.
    #[must_use]
    pub fn slice(&self, h: usize, i: usize) -> Option<&[[f32; 3]]> {
        let n = self.width * self.height;
        let start = h.checked_mul(self.incidence.len())?.checked_add(i)?.checked_mul(n)?;
        if i >= self.incidence.len() {
            return None;
        }
        self.texels.get(start..start + n)
    }

    /// All slices, in order of half angle, then angle of incidence.
    pub fn slices(&self) -> impl ExactSizeIterator<Item = &[[f32; 3]]> {
        self.texels.chunks_exact(self.width * self.height)
    }
}

fn rising(axis: &'static str, angles: &[Angle]) -> Result<(), FlakeBtfError> {
    let mut before = f64::NEG_INFINITY;
    for (place, angle) in angles.iter().enumerate() {
        let found_deg = angle.degrees();
        if !(found_deg > before && (0.0..=90.0).contains(&found_deg)) {
            return Err(FlakeBtfError::Angles { axis, found_deg, place });
        }
        before = found_deg;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(deg: &[f64]) -> Vec<Angle> {
        deg.iter().map(|&d| Angle::from_degrees(d)).collect()
    }

    #[test]
    fn slices_lie_in_order_of_half_angle_then_incidence() {
        let texels = (0..24).map(|n| [n as f32, 0.0, -1.0]).collect();
        let btf =
            FlakeBtf::new(angles(&[0.0, 5.0]), angles(&[0.0, 10.0, 20.0]), [2, 2], texels).expect("sound");
        assert_eq!(btf.slice(1, 2).expect("inside")[0][0], 20.0);
        assert_eq!(btf.slice(0, 3), None);
        assert_eq!(btf.slice(2, 0), None);
        assert_eq!(btf.slices().len(), 6);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let one = || angles(&[0.0]);
        let error = |half, texels| FlakeBtf::new(half, one(), [1, 1], texels).expect_err("unsound");
        assert!(matches!(
            error(angles(&[0.0, 0.0]), vec![[0.0; 3]; 2]),
            FlakeBtfError::Angles { axis: "half", place: 1, .. }
        ));
        assert!(matches!(error(Vec::new(), Vec::new()), FlakeBtfError::Empty { .. }));
        assert_eq!(error(one(), vec![[0.0; 3]; 2]), FlakeBtfError::Size { expected: 1, found: 2 });
        assert_eq!(
            error(angles(&[0.0, 1.0]), vec![[0.0; 3], [f32::NAN; 3]]),
            FlakeBtfError::NotFinite { half: 1, incidence: 0, x: 0, y: 0 }
        );
    }
}
