//! A mixable set of paints as a shader holds it (`crates/render/shaders/flakes.wgsl`): filled once, blended by two vectors of weights.

use super::{Mixable, Part};
use crate::statistics::{RandomTexture, STEPS};

/// Buffers of the shader, in the order of its bindings after the header.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderFlakes {
    /// Sines of the half angles, then of the angles of incidence.
    pub sines: Vec<f32>,
    /// Box of each step, slice by slice, counted over all slices.
    pub inverse: Vec<u32>,
    /// Paint by paint, box by box: one corner in Lab, then the other; the fourth number is 0.
    pub corners: Vec<[f32; 4]>,
    /// Three random numbers a texel, row by row; the fourth is 0.
    pub random: Vec<[f32; 4]>,
    /// Half angles and angles of incidence.
    pub counts: [u32; 2],
    /// Texels along a side of the random texture.
    pub side: u32,
    /// Paints.
    pub paints: u32,
    /// Boxes of a paint over all slices.
    pub paths: u32,
}

impl Mixable {
    /// The buffers; `None` without flakes, or with more than four paints.
    #[must_use]
    pub fn shader_flakes(&self) -> Option<ShaderFlakes> {
        let paths = self.steps.len();
        if paths == 0 || self.paints.len() > 4 {
            return None;
        }
        let mut inverse = Vec::with_capacity(self.slices() * STEPS);
        for (path, steps) in self.steps.iter().enumerate() {
            inverse.extend(std::iter::repeat_n(path as u32, usize::from(*steps)));
        }
        let corner = |planes: &[f32], path: usize, from: usize| {
            [
                planes[from * paths + path],
                planes[(from + 1) * paths + path],
                planes[(from + 2) * paths + path],
                0.0,
            ]
        };
        let corners = self
            .corners
            .iter()
            .flat_map(|planes| (0..paths).flat_map(move |p| [corner(planes, p, 0), corner(planes, p, 3)]))
            .collect();
        let texture = RandomTexture::shared();
        Some(ShaderFlakes {
            sines: self.half.iter().chain(&self.incidence).map(|a| a.sin() as f32).collect(),
            inverse,
            corners,
            random: texture.numbers().iter().map(|n| [n[0], n[1], n[2], 0.0]).collect(),
            counts: [self.half.len() as u32, self.incidence.len() as u32],
            side: texture.side() as u32,
            paints: self.paints.len() as u32,
            paths: paths as u32,
        })
    }
}

impl Part {
    /// Weights for lightness and for hue as the shader's header takes them.
    #[must_use]
    pub fn shader_weights(self, weights: [f32; 4]) -> [[f32; 4]; 2] {
        let own = [1.0, 0.0, 0.0, 0.0];
        match self {
            Self::Everything => [weights, weights],
            Self::Lightness => [weights, own],
            Self::Hue => [own, weights],
            Self::GreySparkle => [weights, [0.0; 4]],
            Self::Base => [own, own],
        }
    }
}
