//! The fixed random texture: the same numbers at the same place of the surface in every frame.
//!
//! Three numbers a texel: one for the distribution function and the place in the box, two that say at which angle the texel changes over to
//! the next slice. Each takes all values (k + ½)/n once in a block of texels, in an order of its own, so that a block of texels is an even sample.

use std::sync::OnceLock;

/// Random numbers in (0, 1), three a texel.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomTexture {
    side: usize,
    numbers: Vec<[f32; 3]>,
}

/// Side of a block of the texture that paints use, as large as measured textures, and blocks along its side.
const BLOCK: usize = 128;
const BLOCKS: usize = 2;

impl RandomTexture {
    /// The texture of all paints, 256 × 256.
    #[must_use]
    pub fn shared() -> &'static Self {
        static SHARED: OnceLock<RandomTexture> = OnceLock::new();
        SHARED.get_or_init(|| Self::new(BLOCK, BLOCKS, 1))
    }

    /// A texture of `blocks`² blocks of `block`² texels, each an even sample; `seed` chooses the orders.
    #[must_use]
    pub fn new(block: usize, blocks: usize, seed: u32) -> Self {
        let (block, blocks) = (block.max(1), blocks.max(1));
        let (side, n) = (block * blocks, block * block);
        let mut numbers = vec![[0.0; 3]; side * side];
        let mut order: Vec<u32> = (0..n as u32).collect();
        for part in 0..blocks * blocks {
            let corner = (part / blocks * side + part % blocks) * block;
            for channel in 0..3 {
                let mut state = hash(seed.wrapping_mul(31).wrapping_add((3 * part + channel) as u32));
                for k in (1..n).rev() {
                    state = hash(state ^ k as u32);
                    order.swap(k, ((u64::from(state) * (k as u64 + 1)) >> 32) as usize);
                }
                for (k, rank) in order.iter().enumerate() {
                    let texel = &mut numbers[corner + k / block * side + k % block];
                    texel[channel] = ((f64::from(*rank) + 0.5) / n as f64) as f32;
                }
            }
        }
        Self { side, numbers }
    }

    /// Texels along a side; the texture repeats.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    /// Numbers of a texel; any column and row.
    #[must_use]
    pub fn at(&self, x: i64, y: i64) -> &[f32; 3] {
        let side = self.side as i64;
        &self.numbers[(y.rem_euclid(side) * side + x.rem_euclid(side)) as usize]
    }

    /// All texels, row by row.
    #[must_use]
    pub fn numbers(&self) -> &[[f32; 3]] {
        &self.numbers
    }
}

/// A well mixed word of another (the finaliser of MurmurHash3, made sure not to stay at 0).
fn hash(x: u32) -> u32 {
    let x = x.wrapping_add(0x9e37_79b9);
    let x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    let x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}
