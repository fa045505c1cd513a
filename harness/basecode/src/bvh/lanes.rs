//! Eight numbers at once: by AVX2 where the machine has it, otherwise twice four. Both give the same bits, because no
//! operation is fused and each rounds as IEEE 754 says.

use glam::Vec4;

/// Eight numbers in memory.
#[derive(Clone, Copy, bytemuck::Zeroable)]
#[repr(align(32))]
pub struct Eight(pub [f32; 8]);

/// Eight numbers in registers.
pub trait Lanes: Copy {
    fn load(values: &Eight) -> Self;
    fn splat(value: f32) -> Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    fn times(self, other: Self) -> Self;
    fn over(self, other: Self) -> Self;
    /// The smaller of two numbers; unspecified if one is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger of two numbers; unspecified if one is NaN.
    fn max(self, other: Self) -> Self;
    /// Bit i: number i is at most the other's; never with a NaN.
    fn at_most(self, other: Self) -> u32;
    /// The smallest of the numbers, eight times over. What it is of a NaN is not said.
    fn least(self) -> Self;
    /// The largest of the numbers, eight times over. What it is of a NaN is not said.
    fn most(self) -> Self;
    fn to_array(self) -> [f32; 8];
}

/// Twice four numbers, on every machine.
#[derive(Clone, Copy)]
pub struct Portable([Vec4; 2]);

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(Vec4, Vec4) -> Vec4) -> Self {
        Self([f(self.0[0], other.0[0]), f(self.0[1], other.0[1])])
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn load(values: &Eight) -> Self {
        let [a, b, c, d, e, f, g, h] = values.0;
        Self([Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)])
    }
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([Vec4::splat(value); 2])
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
    #[inline(always)]
    fn over(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, Vec4::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, Vec4::max)
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> u32 {
        let bits = |i: usize| self.0[i].cmple(other.0[i]).bitmask();
        bits(0) | bits(1) << 4
    }
    #[inline(always)]
    fn least(self) -> Self {
        Self::splat(self.0[0].min(self.0[1]).min_element())
    }
    #[inline(always)]
    fn most(self) -> Self {
        Self::splat(self.0[0].max(self.0[1]).max_element())
    }
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        let [[a, b, c, d], [e, f, g, h]] = self.0.map(|four| four.to_array());
        [a, b, c, d, e, f, g, h]
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::{Avx2, has_avx2};

/// The only intrinsics of ray casting.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::{Eight, Lanes};

    /// Whether this machine has AVX2.
    pub fn has_avx2() -> bool {
        std::arch::is_x86_feature_detected!("avx2")
    }

    /// Eight numbers in one register. Only functions with `#[target_feature(enable = "avx2")]` make and use its values,
    /// and they are called only if [`has_avx2`] is true.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256);

    impl Avx2 {
        /// The numbers with their halves, the pairs of each half, or the members of each pair exchanged.
        #[inline(always)]
        fn swapped<const STEP: u8>(self) -> Self {
            // SAFETY: the machine has AVX2, as the type's words say.
            unsafe {
                Self(match STEP {
                    0 => _mm256_permute2f128_ps::<1>(self.0, self.0),
                    1 => _mm256_permute_ps::<0b01_00_11_10>(self.0),
                    _ => _mm256_permute_ps::<0b10_11_00_01>(self.0),
                })
            }
        }
    }

    // SAFETY of every block: the machine has AVX2, as the type's words say; memory is touched by `load` and
    // `to_array` alone, through references to 32 bytes.
    impl Lanes for Avx2 {
        #[inline(always)]
        fn load(values: &Eight) -> Self {
            // SAFETY: as above; `Eight` lies at a multiple of 32 bytes.
            Self(unsafe { _mm256_load_ps(values.0.as_ptr()) })
        }
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_set1_ps(value) })
        }
        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn times(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn over(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn at_most(self, other: Self) -> u32 {
            // SAFETY: as above.
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
        }
        #[inline(always)]
        fn least(self) -> Self {
            let two = self.min(self.swapped::<0>());
            let four = two.min(two.swapped::<1>());
            four.min(four.swapped::<2>())
        }
        #[inline(always)]
        fn most(self) -> Self {
            let two = self.max(self.swapped::<0>());
            let four = two.max(two.swapped::<1>());
            four.max(four.swapped::<2>())
        }
        #[inline(always)]
        fn to_array(self) -> [f32; 8] {
            let mut values = Eight([0.0; 8]);
            // SAFETY: as above; `Eight` lies at a multiple of 32 bytes.
            unsafe { _mm256_store_ps(values.0.as_mut_ptr(), self.0) };
            values.0
        }
    }
}
