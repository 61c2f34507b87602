//! How a representation is made from a material.

use gonio_brdf::maps::{
    self, Aspecular, ColourMap, FitError, FlakeFitOptions, FlakeMap, LookupTable, Region, Sample,
};
use gonio_brdf::{Brdf, Meaning};
use gonio_fitter::ModelChoice;
use gonio_optics::{Angle, Vec3};

use super::built::Evaluator;
use super::{Built, Representation};
use crate::{Finding, GlossChoice, GlossError, Material, without_gloss};

/// Light of the aspecular-only map (Kirchner's refs. 4–6: portable instruments light at 45°).
const ASPECULAR_LIGHT: Angle = Angle::from_degrees(45.0);
/// Fewer measurements than this are taken for those of a portable multi-angle instrument.
const HANDFUL: usize = 30;
/// Half angle of the cone about the mirror direction in which such an instrument sees gloss.
const HANDFUL_CONE: Angle = Angle::from_degrees(10.0);
/// Fewer measurements than this are called sparse.
const SPARSE: usize = 100;

/// How representations are built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Refractive index of the coat, 1 for none.
    pub index: f64,
    /// Geometries that maps hold: steeper ones are taken at this angle by colour maps and continued by flake maps.
    pub largest: Angle,
    /// Nodes of a colour map along each angle.
    pub nodes: usize,
    /// Nodes of the trilinear table over θi, θo, φ.
    pub table: [usize; 3],
    /// What happens to the gloss before a colour map is drawn.
    pub gloss: GlossChoice,
}

impl Options {
    /// For a coat of `index`: to 75°, 64 nodes, Sopp's 19 × 37 × 36.
    #[must_use]
    pub const fn new(index: f64) -> Self {
        Self {
            index,
            largest: Angle::from_degrees(75.0),
            nodes: 64,
            table: [19, 37, 36],
            gloss: GlossChoice::Auto,
        }
    }

    /// The geometries that flake maps are fitted to.
    #[must_use]
    pub fn region(&self) -> Region {
        Region { largest: self.largest, ..Region::default() }
    }

    fn flake(&self, harmonics: usize) -> FlakeFitOptions {
        FlakeFitOptions { index: self.index, harmonics, region: self.region(), ..FlakeFitOptions::default() }
    }
}

/// A representation that cannot be built from a material.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// It needs f between measurements.
    #[error(
        "{representation} needs values between the measurements, and scattered geometries have none: use flake-map:K, or fit a model first"
    )]
    Scattered {
        /// Which.
        representation: String,
    },
    /// Nothing in the plane of incidence.
    #[error(
        "no in-plane measurement (φ = 0° or 180°) within {largest_deg}° and more than {mirror_deg}° from the mirror direction: a colour map is made of these; \
         measure some, or use flake-map:K"
    )]
    NoInPlane {
        /// Limit of the polar angles, degrees.
        largest_deg: f64,
        /// Cone left out, degrees.
        mirror_deg: f64,
    },
    /// Harmonics that the data cannot determine.
    #[error(
        "all {count} measurements lie in the plane of incidence, which leaves harmonics undetermined: use flake-map:0, or measure other azimuths too"
    )]
    AllInPlane {
        /// Measurements.
        count: usize,
    },
    /// A flake map that is asked to become another one.
    #[error("flake maps of {asked} harmonics cannot be made from a map of {has}: go back to the measurement")]
    FewerHarmonics {
        /// K asked for.
        asked: usize,
        /// K there is.
        has: usize,
    },
    /// The fit of a flake map.
    #[error(transparent)]
    Flake(#[from] FitError),
    /// Gloss.
    #[error(transparent)]
    Gloss(#[from] GlossError),
    /// A lobe whose means over the cells of a whole table take too long here.
    #[error(
        "{model} was not tried: its means over the cells of a whole table take minutes and gigabytes; fit it with `gonio fit --model {model}` to see"
    )]
    Costly {
        /// Which.
        model: String,
    },
    /// The fit of a model.
    #[error("{model} could not be fitted: {status}")]
    Model {
        /// Which.
        model: String,
        /// Status of the fit.
        status: String,
    },
}

impl Representation {
    /// Builds it.
    ///
    /// # Errors
    /// [`BuildError`]: what the material lacks for it, and what to use instead.
    pub fn build(self, material: &Material, options: &Options) -> Result<Built, BuildError> {
        let mut findings = Vec::new();
        let evaluator = match self {
            Self::Table => {
                let brdf = material
                    .brdf()
                    .ok_or_else(|| BuildError::Scattered { representation: self.to_string() })?;
                Evaluator::Table(LookupTable::from_brdf(brdf, options.table))
            }
            Self::ColourMap(method) => {
                let make = |f: &dyn Brdf| {
                    ColourMap::from_brdf(f, options.index, method, options.largest, options.nodes)
                };
                Evaluator::Colour(with_in_plane(material, options, &mut findings, make)?)
            }
            Self::Aspecular => {
                let make = |f: &dyn Brdf| Aspecular::from_brdf(f, ASPECULAR_LIGHT, options.largest);
                Evaluator::Aspecular(with_in_plane(material, options, &mut findings, make)?)
            }
            Self::FlakeMap(harmonics) => {
                Evaluator::Flake(flake_map(material, options, harmonics, &mut findings)?)
            }
            Self::Model(choice) => model(material, options, choice, &self.to_string())?,
        };
        Ok(Built { representation: self, findings, evaluator, largest: options.largest })
    }
}

/// The samples that count for a map, with what is to say about them.
fn samples(material: &Material, options: &Options, findings: &mut Vec<Finding>) -> Vec<Sample> {
    let samples = material.samples(options.region());
    if (1..SPARSE).contains(&samples.len()) {
        findings.push(Finding::Sparse { count: samples.len() });
    }
    samples
}

fn flake_map(
    material: &Material,
    options: &Options,
    harmonics: usize,
    findings: &mut Vec<Finding>,
) -> Result<FlakeMap, BuildError> {
    if let Some(map) = material.flake_map() {
        // the map in the file is what was measured; a smaller one can be fitted to it, a larger one would be made up
        if map.harmonics() == harmonics {
            return Ok(map.clone());
        }
        if map.harmonics() < harmonics {
            return Err(BuildError::FewerHarmonics { asked: harmonics, has: map.harmonics() });
        }
    }
    let few = material.scattered().filter(|s| s.points.len() < HANDFUL);
    let samples = match few {
        Some(points) => handful_region(options).of_scattered(points),
        None => samples(material, options, findings),
    };
    if !samples.is_empty() && samples.iter().all(is_in_plane) {
        if harmonics > 0 {
            return Err(BuildError::AllInPlane { count: samples.len() });
        }
        findings.push(Finding::AllInPlane { count: samples.len() });
    }
    if harmonics == 0
        && let Some(map) = handful(material, options)?
    {
        findings.extend(map.findings().iter().cloned().map(Finding::Map));
        return Ok(map);
    }
    let wanted = options.flake(harmonics);
    // cells of a table are met by means over them, points at themselves
    let map = match material.table() {
        Some(table) => FlakeMap::fit_table(&material.name, table, &wanted)?,
        None => FlakeMap::fit(&material.name, &samples, &wanted)?,
    };
    // whoever states a coat knows better than what the measurements seem to say
    let stated = material.stated_index().is_some_and(|n| n > 1.0);
    let told = map.findings().iter().filter(|f| !(stated && matches!(f, maps::Finding::CoatNotSeen { .. })));
    findings.extend(told.cloned().map(Finding::Map));
    Ok(map)
}

/// Portable instruments measure at 15° from the mirror direction, which maps of full data leave out.
fn handful_region(options: &Options) -> Region {
    Region { largest: options.largest, from_mirror: HANDFUL_CONE }
}

/// The estimate from a portable instrument's few geometries, with its uncertainty; `None` for materials with more than a handful.
fn handful(material: &Material, options: &Options) -> Result<Option<FlakeMap>, BuildError> {
    let Some(points) = material.scattered().filter(|s| s.points.len() < HANDFUL) else { return Ok(None) };
    let region = handful_region(options);
    let samples = region.of_scattered(points);
    if samples.len() < 3 {
        return Err(BuildError::Flake(FitError::Data {
            found: samples.len(),
            expected: 3,
            largest_deg: region.largest.degrees().round(),
            mirror_deg: region.from_mirror.degrees().round(),
        }));
    }
    Ok(Some(FlakeMap::from_multi_angle(&material.name, &samples, options.index)?))
}

/// Whether light, view and normal lie in one plane, to half a degree of azimuth.
fn is_in_plane(s: &Sample) -> bool {
    let flat = |d: Vec3| d.x.hypot(d.y);
    let cross = (s.light.x * s.view.y - s.light.y * s.view.x).abs();
    cross <= Angle::from_degrees(0.5).sin() * (flat(s.light) * flat(s.view)).max(1e-12)
}

/// Makes something from f in the plane of incidence without gloss. Of scattered measurements those in the plane are joined by a smooth surface in
/// flake space, where the in-plane geometries of light and view exchanged are one place; of a handful the surface is an estimate.
fn with_in_plane<T>(
    material: &Material,
    options: &Options,
    findings: &mut Vec<Finding>,
    make: impl Fn(&dyn Brdf) -> T,
) -> Result<T, BuildError> {
    if material.brdf().is_some() {
        let (body, _) = without_gloss(material, options.index, options.gloss)?;
        return Ok(make(&*body));
    }
    if let Some(map) = handful(material, options)? {
        findings.extend(map.findings().iter().cloned().map(Finding::Map));
        return Ok(make(&map));
    }
    let region = options.region();
    let in_plane: Vec<Sample> = material.samples(region).into_iter().filter(is_in_plane).collect();
    if in_plane.is_empty() {
        return Err(BuildError::NoInPlane {
            largest_deg: region.largest.degrees(),
            mirror_deg: region.from_mirror.degrees(),
        });
    }
    if in_plane.len() < SPARSE {
        findings.push(Finding::Sparse { count: in_plane.len() });
    }
    let surface = FlakeMap::fit(&material.name, &in_plane, &options.flake(0))?;
    Ok(make(&surface))
}

fn model(
    material: &Material,
    options: &Options,
    choice: ModelChoice,
    name: &str,
) -> Result<Evaluator, BuildError> {
    let means = material.table().is_some_and(|t| matches!(t.meaning, Meaning::CellMean { .. }));
    // these lobes are summed over every cell's nodes, and some need many nodes everywhere
    let summed = matches!(choice, ModelChoice::Lafortune(_) | ModelChoice::Ggx(2..));
    if means && summed {
        return Err(BuildError::Costly { model: name.to_owned() });
    }
    let fail = |status: &str| BuildError::Model { model: name.to_owned(), status: status.to_owned() };
    let observations = material.observations().ok_or_else(|| fail("there is nothing to fit it to"))?;
    let wanted = gonio_fitter::Options {
        model: choice,
        max_angle: options.largest,
        ..gonio_fitter::Options::default()
    };
    let fit = gonio_fitter::fit(&observations, &wanted);
    if !fit.status.is_fitted() {
        return Err(fail(fit.status.name()));
    }
    Ok(Evaluator::Model(Box::new(fit.to_model_file()), 4 * fit.parameters.len()))
}
