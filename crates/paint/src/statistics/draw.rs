//! Colours drawn from statistics, place by place, the same in every frame.
//!
//! The texel's first number, moved on by a fixed amount for each slice, is looked up in the inverse distribution function; three more place
//! the colour in its box. Between slices each texel changes over at an angle of its own, told by its last two numbers: a flake lights up and goes
//! out within one spacing of the slices, which is the 6–7° that flakes live, and no frame shows a mixture that no slice holds.

use super::{FlakeStatistics, RandomTexture, STEPS};

/// What a place shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// Place among the slice's clusters.
    pub cluster: u16,
    /// Slice.
    pub slice: u32,
}

/// Steps of the additive recurrence between slices, for the function and the three axes (powers of the fourth root of the plastic family: R₄).
const MOVES: [f32; 4] = [0.856_674_9, 0.733_891_9, 0.628_706_7, 0.538_597_3];

/// The texel's number in a slice.
#[inline]
fn moved(number: f32, slice: u32, axis: usize) -> f32 {
    let x = number + (slice % 4096) as f32 * MOVES[axis];
    x - x.floor()
}

impl FlakeStatistics {
    /// Cluster and colour (1/sr) of a texel's numbers in one slice.
    #[must_use]
    pub fn draw(&self, slice: u32, numbers: &[f32; 6]) -> (Drawn, [f64; 3]) {
        let step = ((moved(numbers[0], slice, 0) * STEPS as f32) as usize).min(STEPS - 1);
        let cluster = self.inverse(slice as usize).get(step).copied().unwrap_or(0);
        let r = [1, 2, 3].map(|c: usize| moved(numbers[c], slice, c));
        let colour =
            self.clusters(slice as usize).get(usize::from(cluster)).map_or([0.0; 3], |c| Self::colour(c, r));
        (Drawn { cluster, slice }, colour)
    }

    /// Slice that a texel shows where `half` and `incidence` are the nodes below and the shares of the next ones.
    #[must_use]
    pub fn chosen(&self, half: (usize, f64), incidence: (usize, f64), numbers: &[f32; 6]) -> u32 {
        let h = half.0 + usize::from(f64::from(numbers[4]) < half.1);
        let i = incidence.0 + usize::from(f64::from(numbers[5]) < incidence.1);
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
