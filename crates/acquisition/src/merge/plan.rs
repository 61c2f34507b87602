//! What a block is merged with: the weights of its exposures, and the straight lines that the parts of a variance follow.
//!
//! Both hang on the rate that is expected of the block and on how many exposures are clear in it, and near the best weights the variance is flat:
//! a rate told to a sixteenth loses less than a thousandth of the information. So all that can occur is worked out once a pose, for rates in steps of an
//! eighth of an octave, and a block looks it up.
//!
//! **What is not read.** Exposure j tells about a rate as much as `x_j w_j = x_j² / v_j`, and the variance of the merged rate is one over the sum of
//! that. The shortest exposures that together hold no more than [`SPARED`] of the sum are left out: the variance grows by that share at the most, and
//! a bracket's short frames need not be read where the long ones are clear. Which are left out follows from the rate that is expected of the block, as
//! the weights do, and not from what a pixel shows in them; so nothing is drawn to one side.

use super::shots::Shot;

/// Share of the information on a rate that may be left out.
pub(crate) const SPARED: f64 = 4e-3;

/// Bits of a rate's number below its step: eight steps to an octave.
const STEP_BITS: u32 = 20;
/// Rates that are told apart reach from where reading rules in the longest exposure to where light rules in the shortest, by so much.
const BEYOND_READING: f32 = 1.0 / 64.0;
const BEYOND_LIGHT: f32 = 1024.0;
/// Most octaves between both.
const OCTAVES: i32 = 60;

/// Variances of what is not light, as the sums need them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Floor {
    /// Of reading and rounding, electrons².
    pub(crate) read_e2: f64,
    /// Of the dark signal's mean, electrons².
    pub(crate) dark_mean_e2: f64,
    /// Of its current, (electrons/s)².
    pub(crate) dark_current_e2: f64,
    /// Electrons per entry of the level, and electrons at 0.
    pub(crate) ramp: [f64; 2],
}

/// All plans of a pose.
#[derive(Clone, Debug)]
pub(crate) struct Plans {
    shots: usize,
    /// Number of the lowest step, and how many there are.
    first: u32,
    steps: u32,
    /// By clear exposures, then by step.
    lines: Vec<Lines>,
    sums: Vec<Sums>,
    /// Plan by plan: what an entry of the level weighs in each exposure, over Σ w x; and the weights themselves.
    levels: Vec<f32>,
    weights: Vec<f32>,
}

/// A clear block: exposures that are taken, and a pixel's parts by its rate and dark current.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lines {
    /// First of the exposures that are taken, and the end of them.
    pub(super) from: u32,
    pub(super) end: u32,
    /// Σ w x; 0 where no exposure is clear.
    pub(super) den: f32,
    /// What is left of zero counts.
    pub(super) offset: f32,
    /// Σ w / den and Σ w (t − t̄) / den.
    pub(super) sum: f32,
    pub(super) sum_t: f32,
    /// Shot noise per rate and per dark current.
    pub(super) by_rate: f32,
    pub(super) by_current: f32,
    /// Variances from reading and from the dark signal's uncertainty.
    pub(super) read: f32,
    pub(super) dark: f32,
    /// Σ x.
    pub(super) exposure: f32,
}

/// Sums over the clear exposures that are taken, which a pixel of a mixed block adds to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// Rate of the plan.
    pub(super) rate: f32,
    /// Σ w² x, Σ w² t and Σ w².
    pub(super) by_rate: f32,
    pub(super) by_current: f32,
    pub(super) squares: f32,
    /// Σ w and Σ w (t − t̄).
    pub(super) sum: f32,
    pub(super) sum_t: f32,
}

impl Plans {
    /// The plans of exposures, shortest first.
    pub(crate) fn of(shots: &[Shot<'_>], floor: &Floor) -> Self {
        let noise = || shots.iter().map(|s| s.noise_rate).filter(|k| k.is_finite());
        let high = (noise().fold(0.0, f32::max) * BEYOND_LIGHT).clamp(1e-20, 1e30);
        let low = noise().fold(high, f32::min) * BEYOND_READING;
        let low = low.max(high * 2f32.powi(-OCTAVES));
        let first = low.to_bits() >> STEP_BITS;
        let steps = (high.to_bits() >> STEP_BITS).saturating_sub(first) + 1;
        let mut out = Self {
            shots: shots.len(),
            first,
            steps,
            lines: Vec::new(),
            sums: Vec::new(),
            levels: Vec::new(),
            weights: Vec::new(),
        };
        for clear in 0..=shots.len() {
            for step in 0..steps {
                let rate = f32::from_bits(((first + step) << STEP_BITS) | (1 << (STEP_BITS - 1)));
                out.add(shots, clear, rate, floor);
            }
        }
        out
    }

    fn add(&mut self, shots: &[Shot<'_>], clear: usize, rate: f32, floor: &Floor) {
        let start = self.weights.len();
        self.weights.resize(start + shots.len(), 0.0);
        let weights = &mut self.weights[start..];
        let mut information = 0.0;
        for (w, shot) in weights.iter_mut().zip(shots).take(clear) {
            *w = 1.0 / (rate + shot.noise_rate);
            information += f64::from(*w) * f64::from(shot.x);
        }
        let mut from = 0;
        let mut spared = 0.0;
        for (j, shot) in shots.iter().enumerate().take(clear) {
            spared += f64::from(weights[j]) * f64::from(shot.x);
            if spared > SPARED * information {
                break;
            }
            weights[j] = 0.0;
            from = j + 1;
        }
        let [mut den, mut by_rate, mut by_current, mut squares] = [0.0; 4];
        let [mut sum, mut sum_t, mut exposure] = [0.0; 3];
        for (w, shot) in weights.iter().zip(shots).take(clear).skip(from) {
            let (w, x) = (f64::from(*w), f64::from(shot.x));
            let square = w * w;
            den += w * x;
            by_rate += square * x;
            by_current += square * f64::from(shot.dark_s);
            squares += square;
            sum += w;
            sum_t += w * f64::from(shot.since_mean_s);
            exposure += x;
        }
        let per = if den > 0.0 { 1.0 / den } else { 0.0 };
        let (sum_per, sum_t_per, square) = (sum * per, sum_t * per, per * per);
        let [slope, zero] = floor.ramp;
        self.levels.extend(weights.iter().map(|w| (f64::from(*w) * per * slope) as f32));
        let dark = sum_per * sum_per * floor.dark_mean_e2 + sum_t_per * sum_t_per * floor.dark_current_e2;
        self.lines.push(Lines {
            from: from as u32,
            end: clear as u32,
            den: den as f32,
            offset: (sum_per * zero) as f32,
            sum: sum_per as f32,
            sum_t: sum_t_per as f32,
            by_rate: (by_rate * square) as f32,
            by_current: (by_current * square) as f32,
            read: (squares * square * floor.read_e2) as f32,
            dark: dark as f32,
            exposure: exposure as f32,
        });
        self.sums.push(Sums {
            rate,
            by_rate: by_rate as f32,
            by_current: by_current as f32,
            squares: squares as f32,
            sum: sum as f32,
            sum_t: sum_t as f32,
        });
    }

    /// The plan for a rate where so many exposures are clear.
    #[inline(always)]
    pub(super) const fn find(&self, rate: f32, clear: usize) -> usize {
        let bits = rate.to_bits() >> STEP_BITS;
        let step = if rate > 0.0 { bits.saturating_sub(self.first) } else { 0 };
        let last = self.steps - 1;
        clear * self.steps as usize + if step < last { step } else { last } as usize
    }

    #[inline(always)]
    pub(super) fn lines(&self, plan: usize) -> &Lines {
        &self.lines[plan]
    }

    #[inline(always)]
    pub(super) fn sums(&self, plan: usize) -> &Sums {
        &self.sums[plan]
    }

    /// What an entry of the level weighs in each exposure, over Σ w x.
    #[inline(always)]
    pub(super) fn levels(&self, plan: usize) -> &[f32] {
        &self.levels[plan * self.shots..(plan + 1) * self.shots]
    }

    /// Weights of the exposures that are taken.
    #[inline(always)]
    pub(super) fn weights(&self, plan: usize) -> &[f32] {
        &self.weights[plan * self.shots..(plan + 1) * self.shots]
    }
}
