//! One place of the surface and the light that reaches it.
//!
//! Lights from one direction or a point are summed as they are. An environment is drawn from twice, by its own brightness and by the likely shape of the
//! reflectance, and both are weighted by the balance heuristic: `w = 1/(p_light + p_lobe)` each (Veach 1997).

use gonio_brdf::Rgb;
use gonio_optics::Vec3;

use super::body::{Body, Hit};
use super::lobe::Mixture;
use super::sequence::Sequence;
use crate::light::{Environment, Lamp};
use crate::scene::{Scene, View};

/// A view is never lower than this over the normal it is meant to have: facets seen from the side would be black.
const LOWEST: f64 = 0.01;

/// A place that is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub(super) position: Vec3,
    pub(super) geometric: Vec3,
    tangents: (Vec3, Vec3),
    normal: Vec3,
    /// Towards the viewer, local.
    pub(super) view: Vec3,
}

impl Vertex {
    pub(super) fn new(hit: &Hit, direction: Vec3) -> Self {
        let back = -direction;
        let low = back.dot(hit.normal);
        let normal = if low < LOWEST && low < back.dot(hit.geometric) {
            (hit.normal + back * (LOWEST - low)).normalized()
        } else {
            hit.normal
        };
        let tangents = normal.orthonormal_basis();
        let mut v =
            Self { position: hit.position, geometric: hit.geometric, tangents, normal, view: Vec3::Z };
        v.view = v.local(back);
        v
    }

    /// Into the frame of the sample: z along the normal.
    pub(super) fn local(&self, d: Vec3) -> Vec3 {
        Vec3::new(d.dot(self.tangents.0), d.dot(self.tangents.1), d.dot(self.normal))
    }

    pub(super) fn world(&self, d: Vec3) -> Vec3 {
        self.tangents.0 * d.x + self.tangents.1 * d.y + self.normal * d.z
    }

    /// Where rays leave it.
    pub(super) fn leave(&self, body: &Body) -> Vec3 {
        self.position + self.geometric * body.step_off()
    }

    fn faces(&self, world: Vec3) -> bool {
        world.dot(self.geometric) > 0.0
    }
}

/// Everything that light needs to know.
#[derive(Clone, Copy)]
pub(super) struct Shader<'a> {
    pub(super) scene: &'a Scene,
    pub(super) view: &'a View,
    pub(super) mixture: Mixture,
    /// Whether irradiance falls with the cosine.
    pub(super) cosine: bool,
}

/// A direction drawn after the reflectance.
pub(super) struct Drawn {
    pub(super) local: Vec3,
    pub(super) world: Vec3,
    pub(super) density: f64,
}

impl Shader<'_> {
    fn weight(&self, cos: f64) -> f64 {
        if self.cosine { cos } else { 1.0 }
    }

    pub(super) fn environments(&self) -> impl Iterator<Item = &Environment> {
        self.view.lamps.iter().filter_map(|l| if let Lamp::Environment(e) = l { Some(e) } else { None })
    }

    /// Light that reaches `v` straight from the lamps: local direction and radiance × cosine over the density, one call for each.
    pub(super) fn lamps(&self, v: &Vertex, numbers: &mut Sequence, sink: &mut dyn FnMut(Vec3, Rgb)) {
        let from = v.leave(&self.scene.body);
        let mut add = |world: Vec3, distance: f64, light: Rgb, weight: f64| {
            let local = v.local(world);
            if local.z > 0.0 && v.faces(world) && !self.scene.body.blocks(from, world, distance) {
                let w = weight * self.weight(local.z);
                sink(local, light.map(|x| x * w));
            }
        };
        for lamp in &self.view.lamps {
            match lamp {
                Lamp::Directional { towards, irradiance, .. } => {
                    add(*towards, f64::INFINITY, *irradiance, 1.0);
                }
                Lamp::Point { position, intensity, .. } => {
                    let d = *position - v.position;
                    let r = d.norm();
                    if r > 0.0 {
                        add(d * (1.0 / r), r, *intensity, 1.0 / (r * r));
                    }
                }
                Lamp::Environment(e) => {
                    let (a, b) = numbers.pair();
                    let (world, radiance, density) = e.draw(a, b);
                    let other = self.mixture.density(v.local(world), v.view);
                    add(world, f64::INFINITY, radiance, 1.0 / (density + other));
                }
            }
        }
    }

    /// A direction drawn after the reflectance; `None` below the surface.
    pub(super) fn draw(&self, v: &Vertex, numbers: &mut Sequence) -> Option<Drawn> {
        let local = self.mixture.draw(v.view, numbers.pair());
        let world = v.world(local);
        let density = self.mixture.density(local, v.view);
        (local.z > 0.0 && v.faces(world) && density > 0.0).then_some(Drawn { local, world, density })
    }

    /// What a drawn direction that meets nothing brings of the environments, as [`Self::lamps`] counts it.
    pub(super) fn escaped(&self, d: &Drawn) -> Rgb {
        let mut sum = [0.0; 3];
        for e in self.environments() {
            let w = self.weight(d.local.z) / (d.density + e.density(d.world));
            let l = e.radiance(d.world);
            for c in 0..3 {
                sum[c] += l[c] * w;
            }
        }
        sum
    }

    /// Factor of a drawn direction for light that comes from the object itself.
    pub(super) fn carried(&self, d: &Drawn) -> f64 {
        self.weight(d.local.z) / d.density
    }

    /// Radiance that a mirror at `v` shows where nothing of the object stands in its way: environments and the discs of lamps.
    pub(super) fn mirrored(&self, from: Vec3, world: Vec3) -> Rgb {
        let mut sum = [0.0; 3];
        let mut add = |l: Rgb, w: f64| (0..3).for_each(|c| sum[c] += l[c] * w);
        for lamp in &self.view.lamps {
            match lamp {
                Lamp::Environment(e) => add(e.radiance(world), 1.0),
                Lamp::Directional { towards, irradiance, half_angle } => {
                    let s = half_angle.sin();
                    if s > 0.0 && world.angle_to(*towards) <= *half_angle {
                        add(*irradiance, 1.0 / (std::f64::consts::PI * s * s));
                    }
                }
                Lamp::Point { position, intensity, radius } => {
                    let d = *position - from;
                    let along = d.dot(world);
                    if *radius > 0.0 && along > 0.0 && (d - world * along).norm() <= *radius {
                        add(*intensity, 1.0 / (std::f64::consts::PI * radius * radius));
                    }
                }
            }
        }
        sum
    }
}
