//! A picture, pixel by pixel, on all cores.

use gonio_brdf::{Brdf, Coat, Rgb};
use gonio_optics::Vec3;
use rayon::prelude::*;

use super::lobe::Mixture;
use super::sequence::Sequence;
use super::shade::{Shader, Vertex};
use crate::scene::{Scene, SceneError, View, plus};
use crate::sphere::LinearImage;

/// What the object is painted with.
#[derive(Clone, Copy)]
pub struct Paint<'a> {
    /// f in the sample's frame.
    pub brdf: &'a dyn Brdf,
    /// A smooth coat whose mirror image is added: F(θ) times what lies in the mirror direction. `brdf` is taken as it is, so that a base coat has to be one
    /// seen through its coat. Added at what the camera sees, not at what bounces show. `None` adds nothing.
    pub gloss: Option<Coat>,
}

/// A reflectance that differs from place to place.
pub trait PlacedBrdf: Sync {
    /// f in 1/sr at a place of the surface, mm in a plane laid onto it; directions as for [`Brdf`].
    fn eval_at(&self, light: Vec3, view: Vec3, position_mm: [f64; 2]) -> Rgb;
}

/// A placed reflectance with the size of the object.
#[derive(Clone, Copy)]
pub struct Placed<'a> {
    /// f by place.
    pub brdf: &'a dyn PlacedBrdf,
    /// Millimetres of a unit of the scene.
    pub mm_per_unit: f64,
}

impl Placed<'_> {
    /// A place in the plane laid onto the surface there: along the axis nearest to the normal, so that a texel is at most √3 times as long as it is wide.
    /// Planes of different axes and sides are shifted against each other: no mirrored flakes meet at their seams.
    fn position_mm(&self, v: &Vertex) -> [f64; 2] {
        let (p, n) = (v.position, v.geometric);
        let (x, y, side) = if n.z.abs() >= n.x.abs().max(n.y.abs()) {
            (p.x, p.y, n.z)
        } else if n.y.abs() >= n.x.abs() {
            (p.x, p.z, n.y)
        } else {
            (p.y, p.z, n.x)
        };
        let shift = if side > 0.0 { 0.0 } else { 17.3 };
        [x * self.mm_per_unit + shift, y * self.mm_per_unit - shift]
    }
}

/// How it is rendered.
#[derive(Clone, Copy)]
pub struct RenderOptions<'a> {
    /// Reflections of the object in itself: 0 for light straight from the lamps.
    pub bounces: u32,
    /// Whether irradiance falls with the cosine (projected solid angle); Kirchner's pictures leave it out.
    pub cosine: bool,
    /// Flakes that differ from place to place; bounces show their mean.
    pub placed: Option<Placed<'a>>,
    /// Called with the number of pixels of each finished row.
    pub progress: Option<&'a (dyn Fn(u64) + Sync)>,
}

impl Default for RenderOptions<'_> {
    fn default() -> Self {
        Self { bounces: 0, cosine: true, placed: None, progress: None }
    }
}

/// Rays of a pixel's sample through the picture.
pub(super) fn camera_ray(
    scene: &Scene,
    view: &View,
    [col, row]: [u32; 2],
    (fx, fy): (f64, f64),
) -> (Vec3, Vec3) {
    let [wide, high] = scene.size.map(f64::from);
    let x = (2.0 * (f64::from(col) + fx) / wide - 1.0) * wide / high;
    let y = 1.0 - 2.0 * (f64::from(row) + fy) / high;
    view.camera.ray(x, y)
}

/// Renders one view: linear radiance, the mean over what the object covers of each pixel; NaN where the reflectance is not known.
///
/// # Errors
/// [`SceneError::NothingVisible`] where no pixel shows the object.
pub fn render(
    scene: &Scene,
    view: &View,
    paint: Paint<'_>,
    options: RenderOptions<'_>,
) -> Result<LinearImage, SceneError> {
    let [wide, high] = scene.size;
    let shader =
        Shader { scene, view, mixture: Mixture::new(paint.brdf.sharpness()), cosine: options.cosine };
    let tracer = Tracer { shader, paint, placed: options.placed, bounces: options.bounces };
    let rows: Vec<Vec<([f32; 3], f32, bool)>> = (0..high)
        .into_par_iter()
        .map(|row| {
            let line = (0..wide).map(|col| tracer.pixel([col, row])).collect();
            if let Some(told) = options.progress {
                told(u64::from(wide));
            }
            line
        })
        .collect();
    let seen = rows.iter().flatten().any(|p| p.2);
    if !seen {
        return Err(nothing_visible(scene, view));
    }
    let (values, coverage) = rows.into_iter().flatten().map(|p| (p.0, p.1)).unzip();
    Ok(LinearImage { width: wide, height: high, values, coverage })
}

pub(super) fn nothing_visible(scene: &Scene, view: &View) -> SceneError {
    let (centre, radius) = scene.body.ball();
    let words = |v: Vec3| format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z);
    SceneError::NothingVisible {
        centre: words(centre),
        radius,
        camera: words(view.camera.from),
        look: words(view.camera.axes[2]),
    }
}

struct Tracer<'a> {
    shader: Shader<'a>,
    paint: Paint<'a>,
    placed: Option<Placed<'a>>,
    bounces: u32,
}

impl Tracer<'_> {
    /// Mean radiance, share covered, whether the object is seen.
    fn pixel(&self, at: [u32; 2]) -> ([f32; 3], f32, bool) {
        let scene = self.shader.scene;
        let place = u64::from(at[1]) * u64::from(scene.size[0]) + u64::from(at[0]);
        let (mut sum, mut covered, mut beside) = ([0.0; 3], 0u32, [0.0; 3]);
        for index in 0..scene.samples {
            let mut numbers = Sequence::new(place, index, scene.samples);
            let (from, direction) = camera_ray(scene, self.shader.view, at, numbers.pair());
            match self.radiance(from, direction, &mut numbers) {
                Some(l) => {
                    covered += 1;
                    sum = plus(sum, l);
                }
                None if scene.show_environment => {
                    beside = self.shader.environments().map(|e| e.radiance(direction)).fold(beside, plus);
                }
                None => {}
            }
        }
        // one unknown sample makes the pixel unknown: a mean over the rest would be biased
        let known = sum.iter().all(|v| v.is_finite());
        if scene.show_environment {
            let n = f64::from(scene.samples);
            let mean = plus(sum, beside).map(|v| if known { (v / n) as f32 } else { f32::NAN });
            return (mean, 1.0, covered > 0);
        }
        let mean = sum.map(|v| if known { (v / f64::from(covered.max(1))) as f32 } else { f32::NAN });
        (mean, (f64::from(covered) / f64::from(scene.samples)) as f32, covered > 0)
    }

    /// Radiance along a ray, backwards; `None` where it meets nothing.
    fn radiance(&self, from: Vec3, direction: Vec3, numbers: &mut Sequence) -> Option<Rgb> {
        let (s, body) = (&self.shader, &self.shader.scene.body);
        let hit = body.hit(from, direction)?;
        let mut v = Vertex::new(&hit, direction);
        let (mut sum, mut carried) = ([0.0; 3], [1.0; 3]);
        let around = s.environments().next().is_some();
        for depth in 0..=self.bounces {
            sum = plus(sum, times(self.straight(&v, numbers, depth == 0), carried));
            // farther on a lamp's small bright image would be met by chance: specks instead of light
            if depth == 0
                && let Some(coat) = self.paint.gloss
            {
                let f = coat.reflectance(v.view.z.clamp(0.0, 1.0));
                sum = plus(sum, times(self.mirror(&v, numbers), carried.map(|c| c * f)));
            }
            if !around && depth == self.bounces {
                break;
            }
            let Some(drawn) = s.draw(&v, numbers) else { break };
            let f = self.reflectance(drawn.local, &v, depth == 0);
            let Some(next) = body.hit(v.leave(body), drawn.world) else {
                sum = plus(sum, times(times(f, s.escaped(&drawn)), carried));
                break;
            };
            if depth == self.bounces {
                break;
            }
            let factor = s.carried(&drawn);
            carried = times(carried, f.map(|x| x * factor));
            v = Vertex::new(&next, drawn.world);
        }
        Some(sum)
    }

    /// f at a place: with its own flakes where the camera sees it, else their mean.
    fn reflectance(&self, light: Vec3, v: &Vertex, seen: bool) -> Rgb {
        match &self.placed {
            Some(p) if seen => p.brdf.eval_at(light, v.view, p.position_mm(v)),
            _ => self.paint.brdf.eval(light, v.view),
        }
    }

    /// Reflected light that came straight from the lamps.
    fn straight(&self, v: &Vertex, numbers: &mut Sequence, seen: bool) -> Rgb {
        let mut sum = [0.0; 3];
        self.shader.lamps(v, numbers, &mut |light, weight| {
            let f = self.reflectance(light, v, seen);
            for c in 0..3 {
                sum[c] += f[c] * weight[c];
            }
        });
        sum
    }

    /// What the coat mirrors: the surroundings, or the object itself in the light of the lamps.
    fn mirror(&self, v: &Vertex, numbers: &mut Sequence) -> Rgb {
        let world = v.world(Vec3::new(-v.view.x, -v.view.y, v.view.z));
        let body = &self.shader.scene.body;
        let from = v.leave(body);
        match body.hit(from, world) {
            None => self.shader.mirrored(v.position, world),
            Some(hit) => self.straight(&Vertex::new(&hit, world), numbers, false),
        }
    }
}

fn times(a: Rgb, b: Rgb) -> Rgb {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}
