//! Colours drawn from statistics, place by place, the same in every frame.
//!
//! The texel's first number, moved on by a fixed amount for each slice, is looked up in the inverse distribution function. Where it falls within
//! its step places the colour in the box, along a lattice that fills the box evenly even if only a few dozen texels show it. Between slices
//! each texel changes over at an angle of its own, told by its other two numbers: a flake lights up and goes out within one spacing of the slices,
//! which is the 6–7° that flakes live, and no frame shows a mixture that no slice holds.

use super::{FlakeStatistics, RandomTexture, STEPS};

/// What a place shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// Place among the slice's clusters.
    pub cluster: u16,
    /// Slice.
    pub slice: u32,
}

/// Steps of the additive recurrence from slice to slice: for the function and the three axes of a box (R₄: powers of the inverse root of x⁵ = x + 1).
pub(super) const MOVES: [f32; 4] = [0.856_674_9, 0.733_891_9, 0.628_706_7, 0.538_597_3];
/// Generators of the lattice in a box.
pub(super) const LATTICE: [f32; 3] = [1.0, 7.0, 13.0];
/// Shift of the lattice from step to step (R₃).
pub(super) const SHIFTS: [f32; 3] = [0.819_172_5, 0.671_043_6, 0.549_700_5];

fn fraction(x: f32) -> f32 {
    x - x.floor()
}

/// Step of a texel's number in a slice, and its place in the box on each axis, [0, 1).
fn place(number: f32, slice: u32) -> (usize, [f32; 3]) {
    // whole numbers beyond a few thousand would cost the fraction its digits
    let slice = (slice % 4096) as f32;
    let along = fraction(number + fraction(slice * MOVES[0])) * STEPS as f32;
    let step = along.floor().min(STEPS as f32 - 1.0);
    let inside = along - step;
    let at = |c: usize| {
        fraction(inside * LATTICE[c] + fraction(step * SHIFTS[c]) + fraction(slice * MOVES[c + 1]))
    };
    (step as usize, [at(0), at(1), at(2)])
}

impl FlakeStatistics {
    /// Cluster and colour (1/sr) of a texel's numbers in one slice.
    #[must_use]
    pub fn draw(&self, slice: u32, numbers: &[f32; 3]) -> (Drawn, [f64; 3]) {
        let (step, r) = place(numbers[0], slice);
        let cluster = self.inverse(slice as usize).get(step).copied().unwrap_or(0);
        let colour =
            self.clusters(slice as usize).get(usize::from(cluster)).map_or([0.0; 3], |c| Self::colour(c, r));
        (Drawn { cluster, slice }, colour)
    }

    /// Slice that a texel shows where `half` and `incidence` are the nodes below and the shares of the next ones.
    #[must_use]
    pub fn chosen(&self, half: (usize, f64), incidence: (usize, f64), numbers: &[f32; 3]) -> u32 {
        let h = half.0 + usize::from(f64::from(numbers[1]) < half.1);
        let i = incidence.0 + usize::from(f64::from(numbers[2]) < incidence.1);
        (h.min(self.half().len() - 1) * self.incidence().len() + i.min(self.incidence().len() - 1)) as u32
    }

    /// A texture of one slice, `size` texels, row by row, 1/sr.
    #[must_use]
    pub fn texture(&self, slice: u32, [width, height]: [usize; 2], numbers: &RandomTexture) -> Vec<[f32; 3]> {
        let mut out = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                out.push(self.draw(slice, numbers.at(x as i64, y as i64)).1.map(|v| v as f32));
            }
        }
        out
    }
}
