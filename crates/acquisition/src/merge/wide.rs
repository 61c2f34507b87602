//! Eight numbers at a time: by the vector instructions of x86-64 machines that have AVX2, else one after the other.
//!
//! Both ways do the same operations in the same order, without fused multiplications, so both give the same bits.

/// Numbers in a vector.
pub(crate) const WIDE: usize = 8;

/// What the merge asks of a machine.
pub(crate) trait Wide: Copy {
    /// Eight f32.
    type F: Copy;
    /// Sixteen u16.
    type U: Copy;

    fn load(self, from: &[f32; WIDE]) -> Self::F;
    fn store(self, v: Self::F) -> [f32; WIDE];
    /// Two numbers in turns.
    fn pattern(self, of: [f32; 2]) -> Self::F;
    /// Counts as numbers.
    fn counts(self, from: &[u16; WIDE]) -> Self::F;
    /// Steps of either sign as numbers.
    fn steps(self, from: &[i16; WIDE]) -> Self::F;
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// a where `test` is above zero, else b.
    fn where_above_zero(self, test: Self::F, a: Self::F, b: Self::F) -> Self::F;
    /// 1 where a < b, else 0.
    fn below(self, a: Self::F, b: Self::F) -> Self::F;
    fn load_counts(self, from: &[u16; 2 * WIDE]) -> Self::U;
    fn least(self, a: Self::U, b: Self::U) -> Self::U;
    fn most(self, a: Self::U, b: Self::U) -> Self::U;
    /// Whether all lie below a bound above 0.
    fn all_below(self, v: Self::U, bound: u16) -> bool;
    /// Whether all reach a bound.
    fn all_from(self, v: Self::U, bound: u16) -> bool;
    /// Lowest of the even lanes and of the odd ones.
    fn least_by_parity(self, v: Self::U) -> [u16; 2];
    /// Highest of the even lanes and of the odd ones.
    fn most_by_parity(self, v: Self::U) -> [u16; 2];
    /// Whether all are above 0.
    fn all_above_zero(self, v: Self::F) -> bool;
    /// Asks for what will soon be read, where a machine takes such a hint; nothing where there is no such place.
    fn ahead<T>(self, of: &[T], at: usize);

    #[inline(always)]
    fn splat(self, v: f32) -> Self::F {
        self.pattern([v; 2])
    }

    /// max(a, 0).
    #[inline(always)]
    fn positive(self, a: Self::F) -> Self::F {
        self.where_above_zero(a, a, self.splat(0.0))
    }
}

/// One after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain;

impl Wide for Plain {
    type F = [f32; WIDE];
    type U = [u16; 2 * WIDE];

    #[inline(always)]
    fn load(self, from: &[f32; WIDE]) -> Self::F {
        *from
    }

    #[inline(always)]
    fn store(self, v: Self::F) -> [f32; WIDE] {
        v
    }

    #[inline(always)]
    fn pattern(self, of: [f32; 2]) -> Self::F {
        std::array::from_fn(|k| of[k % 2])
    }

    #[inline(always)]
    fn counts(self, from: &[u16; WIDE]) -> Self::F {
        from.map(f32::from)
    }

    #[inline(always)]
    fn steps(self, from: &[i16; WIDE]) -> Self::F {
        from.map(f32::from)
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| a[k] + b[k])
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| a[k] - b[k])
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| a[k] * b[k])
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| a[k] / b[k])
    }

    #[inline(always)]
    fn where_above_zero(self, test: Self::F, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| if test[k] > 0.0 { a[k] } else { b[k] })
    }

    #[inline(always)]
    fn below(self, a: Self::F, b: Self::F) -> Self::F {
        std::array::from_fn(|k| f32::from(a[k] < b[k]))
    }

    #[inline(always)]
    fn load_counts(self, from: &[u16; 2 * WIDE]) -> Self::U {
        *from
    }

    #[inline(always)]
    fn least(self, a: Self::U, b: Self::U) -> Self::U {
        std::array::from_fn(|k| a[k].min(b[k]))
    }

    #[inline(always)]
    fn most(self, a: Self::U, b: Self::U) -> Self::U {
        std::array::from_fn(|k| a[k].max(b[k]))
    }

    #[inline(always)]
    fn all_below(self, v: Self::U, bound: u16) -> bool {
        v.iter().all(|v| *v < bound)
    }

    #[inline(always)]
    fn all_from(self, v: Self::U, bound: u16) -> bool {
        v.iter().all(|v| *v >= bound)
    }

    #[inline(always)]
    fn least_by_parity(self, v: Self::U) -> [u16; 2] {
        [0, 1].map(|k| v.iter().skip(k).step_by(2).fold(u16::MAX, |a, v| a.min(*v)))
    }

    #[inline(always)]
    fn most_by_parity(self, v: Self::U) -> [u16; 2] {
        [0, 1].map(|k| v.iter().skip(k).step_by(2).fold(0, |a, v| a.max(*v)))
    }

    #[inline(always)]
    fn all_above_zero(self, v: Self::F) -> bool {
        v.iter().all(|v| *v > 0.0)
    }

    #[inline(always)]
    fn ahead<T>(self, _: &[T], _: usize) {}
}

/// AVX2.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(pulp::x86::V3);

#[cfg(target_arch = "x86_64")]
impl Wide for Avx2 {
    type F = pulp::f32x8;
    type U = pulp::u16x16;

    #[inline(always)]
    fn load(self, from: &[f32; WIDE]) -> Self::F {
        pulp::cast(*from)
    }

    #[inline(always)]
    fn store(self, v: Self::F) -> [f32; WIDE] {
        pulp::cast(v)
    }

    #[inline(always)]
    fn pattern(self, of: [f32; 2]) -> Self::F {
        pulp::cast(self.0.splat_f64x4(pulp::cast(of)))
    }

    #[inline(always)]
    fn counts(self, from: &[u16; WIDE]) -> Self::F {
        self.0.convert_i32x8_to_f32x8(self.0.convert_u16x8_to_i32x8(pulp::cast(*from)))
    }

    #[inline(always)]
    fn steps(self, from: &[i16; WIDE]) -> Self::F {
        self.0.convert_i32x8_to_f32x8(self.0.convert_i16x8_to_i32x8(pulp::cast(*from)))
    }

    #[inline(always)]
    fn add(self, a: Self::F, b: Self::F) -> Self::F {
        self.0.add_f32x8(a, b)
    }

    #[inline(always)]
    fn sub(self, a: Self::F, b: Self::F) -> Self::F {
        self.0.sub_f32x8(a, b)
    }

    #[inline(always)]
    fn mul(self, a: Self::F, b: Self::F) -> Self::F {
        self.0.mul_f32x8(a, b)
    }

    #[inline(always)]
    fn div(self, a: Self::F, b: Self::F) -> Self::F {
        self.0.div_f32x8(a, b)
    }

    #[inline(always)]
    fn where_above_zero(self, test: Self::F, a: Self::F, b: Self::F) -> Self::F {
        self.0.select_f32x8(self.0.cmp_gt_f32x8(test, self.0.splat_f32x8(0.0)), a, b)
    }

    #[inline(always)]
    fn below(self, a: Self::F, b: Self::F) -> Self::F {
        let (one, none) = (self.0.splat_f32x8(1.0), self.0.splat_f32x8(0.0));
        self.0.select_f32x8(self.0.cmp_lt_f32x8(a, b), one, none)
    }

    #[inline(always)]
    fn load_counts(self, from: &[u16; 2 * WIDE]) -> Self::U {
        pulp::cast(*from)
    }

    #[inline(always)]
    fn least(self, a: Self::U, b: Self::U) -> Self::U {
        self.0.min_u16x16(a, b)
    }

    #[inline(always)]
    fn most(self, a: Self::U, b: Self::U) -> Self::U {
        self.0.max_u16x16(a, b)
    }

    #[inline(always)]
    fn all_below(self, v: Self::U, bound: u16) -> bool {
        bound > 0 && self.all(self.0.cmp_le_u16x16(v, self.0.splat_u16x16(bound - 1)))
    }

    #[inline(always)]
    fn all_from(self, v: Self::U, bound: u16) -> bool {
        self.all(self.0.cmp_ge_u16x16(v, self.0.splat_u16x16(bound)))
    }

    #[inline(always)]
    fn least_by_parity(self, v: Self::U) -> [u16; 2] {
        let [a, b]: [pulp::u16x8; 2] = pulp::cast(v);
        let pairs: [[u16; 2]; 4] = pulp::cast(self.0.min_u16x8(a, b));
        let of = |k: usize| pairs[0][k].min(pairs[1][k]).min(pairs[2][k].min(pairs[3][k]));
        [of(0), of(1)]
    }

    #[inline(always)]
    fn most_by_parity(self, v: Self::U) -> [u16; 2] {
        let [a, b]: [pulp::u16x8; 2] = pulp::cast(v);
        let pairs: [[u16; 2]; 4] = pulp::cast(self.0.max_u16x8(a, b));
        let of = |k: usize| pairs[0][k].max(pairs[1][k]).max(pairs[2][k].max(pairs[3][k]));
        [of(0), of(1)]
    }

    #[inline(always)]
    fn all_above_zero(self, v: Self::F) -> bool {
        let mask = self.0.cmp_gt_f32x8(v, self.0.splat_f32x8(0.0));
        self.0.avx2._mm256_movemask_epi8(pulp::cast(mask)) == -1
    }

    #[inline(always)]
    fn ahead<T>(self, of: &[T], at: usize) {
        if let Some(there) = of.get(at) {
            self.0.sse._mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(std::ptr::from_ref(there).cast());
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl Avx2 {
    #[inline(always)]
    fn all(self, mask: pulp::m16x16) -> bool {
        self.0.avx2._mm256_movemask_epi8(pulp::cast(mask)) == -1
    }
}

/// Something to do with whatever vectors there are.
pub(crate) trait Task {
    /// What comes out.
    type Output;

    fn run<W: Wide>(self, wide: W) -> Self::Output;
}

/// Runs a task with the best that the machine has.
pub(crate) fn run<T: Task>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = pulp::x86::V3::try_new() {
        return v3.vectorize(
            #[inline(always)]
            || task.run(Avx2(v3)),
        );
    }
    task.run(Plain)
}
