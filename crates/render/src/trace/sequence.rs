//! Numbers in 0…1 for the samples of a pixel: evenly spread in every pair, independent between pairs, the same on any machine.
//!
//! A pair of a sample is a point of the R2 sequence (Roberts 2018), taken in an order shuffled for each pixel and pair (Kensler, Pixar technical memo
//! 13-01) and shifted around the square by a random step (Cranley and Patterson 1976): shuffling keeps different pairs independent.

/// The numbers of one sample.
#[derive(Clone, Debug)]
pub struct Sequence {
    key: u64,
    index: u32,
    count: u32,
    pair: u64,
}

impl Sequence {
    /// Of sample `index` of `count` in a pixel.
    #[must_use]
    pub const fn new(pixel: u64, index: u32, count: u32) -> Self {
        Self { key: pixel, index, count: if count == 0 { 1 } else { count }, pair: 0 }
    }

    /// The next two.
    pub fn pair(&mut self) -> (f64, f64) {
        let hash =
            mix(self.key.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ mix(self.pair.wrapping_add(0x51_7c_c1_b7)));
        self.pair += 1;
        let place = f64::from(permuted(self.index, self.count, hash as u32));
        let shift = |bits: u64| (bits >> 11) as f64 / (1u64 << 53) as f64;
        let (a, b) = (shift(mix(hash)), shift(mix(hash ^ 0x5bf0_3635)));
        ((a + place * 0.754_877_666_246_692_7).fract(), (b + place * 0.569_840_290_998_053_2).fract())
    }
}

/// SplitMix64's finaliser.
const fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Place of `i` in a random order of 0…n, without a table: a hash that permutes the next power of two, walked until it falls within.
fn permuted(i: u32, n: u32, key: u32) -> u32 {
    if n <= 1 {
        return 0;
    }
    let mask = n.next_power_of_two() - 1;
    let mut x = i % n;
    loop {
        // each step is a bijection on the masked bits: an odd factor, an addition, a shift inwards
        x = x.wrapping_add(key) & mask;
        x = x.wrapping_mul(0xe170_893d) & mask;
        x ^= x >> ((32 - mask.leading_zeros()).div_ceil(2));
        x = x.wrapping_mul(0x0929_eb3f | 1) & mask;
        x ^= x >> ((32 - mask.leading_zeros()).div_ceil(2));
        x = x.wrapping_add(key >> 16) & mask;
        if x < n {
            return x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_a_permutation() {
        for n in [2u32, 3, 16, 37, 1000] {
            for key in [0, 7, 0xdead_beef] {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    let p = permuted(i, n, key) as usize;
                    assert!(!seen[p], "{n} {key} {i}");
                    seen[p] = true;
                }
            }
        }
    }

    #[test]
    fn pairs_are_even_and_different_pairs_independent() {
        let n = 256;
        let (mut product, mut square) = (0.0, 0.0);
        for pixel in 0..64u64 {
            for i in 0..n {
                let mut s = Sequence::new(pixel, i, n);
                let (a, b) = (s.pair(), s.pair());
                assert!((0.0..1.0).contains(&a.0) && (0.0..1.0).contains(&a.1));
                product += (a.0 - 0.5) * (b.0 - 0.5);
                square += a.0 * a.0 * a.1;
            }
        }
        let count = 64.0 * f64::from(n);
        assert!((product / count).abs() < 0.004, "{}", product / count);
        assert!((square / count - 1.0 / 6.0).abs() < 0.002, "{}", square / count);
    }
}
