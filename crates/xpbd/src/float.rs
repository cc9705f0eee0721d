//! [`Float`]: the scalar of a solver, `f32` or `f64`, with its vector and its shared cell.
//!
//! One source serves both precisions. Particles live in atomic cells: within a color every particle belongs to at most
//! one cluster, so threads never meet, but the language cannot know that. Relaxed atomic loads and stores are plain
//! moves on every processor of interest; they make the sharing safe at no cost. A single-precision particle takes two
//! cells of 64 bits, not four of 32: half the moves.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use fearless_simd::{Simd, SimdFloat, SimdFloatElement};
use glam::{DVec3, Vec3};

use crate::transpose;

/// Types that can be serialized, with the feature `serde`; all types without it.
#[cfg(feature = "serde")]
pub trait Saved: serde::Serialize + serde::de::DeserializeOwned {}
#[cfg(feature = "serde")]
impl<T: serde::Serialize + serde::de::DeserializeOwned> Saved for T {}

/// What can be written and read, with the feature `serde`; everything without it.
#[cfg(not(feature = "serde"))]
pub trait Saved {}
#[cfg(not(feature = "serde"))]
impl<T> Saved for T {}

/// Arithmetic of a solver's scalar: `f32` or `f64`. Code that steps solvers requires [`crate::Real`].
pub trait Float:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + SimdFloatElement
    + Saved
    + 'static
{
    /// The vector of three such scalars.
    type Vector: Copy
        + Debug
        + Default
        + Send
        + Sync
        + Add<Output = Self::Vector>
        + AddAssign
        + Sub<Output = Self::Vector>
        + Neg<Output = Self::Vector>
        + Mul<Self, Output = Self::Vector>
        + Saved;
    /// A cell that threads may share.
    type Atomic: Debug + Send + Sync;
    /// Four scalars that threads may share: the position of a particle and its inverse mass.
    type Particle: Debug + Send + Sync + Saved;
    /// A SIMD vector: as many scalars as an instruction of a processor takes.
    #[doc(hidden)]
    type Lanes<S: Simd>: SimdFloat<S, Element = Self>;

    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// One half.
    const HALF: Self;
    /// The distance from one to the next larger number.
    const EPSILON: Self;

    /// Rounds a double to this precision.
    fn from_f64(value: f64) -> Self;
    /// The value in double precision.
    fn to_f64(self) -> f64;
    /// The square root.
    fn sqrt(self) -> Self;
    /// Whether the value is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// A vector from its components.
    fn vector(x: Self, y: Self, z: Self) -> Self::Vector;
    /// The components of a vector.
    fn components(v: Self::Vector) -> [Self; 3];
    /// The dot product.
    fn dot(a: Self::Vector, b: Self::Vector) -> Self;
    /// The cross product.
    fn cross(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// A cell that holds `self`.
    fn cell(self) -> Self::Atomic;
    /// The value in a cell.
    fn load(cell: &Self::Atomic) -> Self;
    /// Puts `self` into a cell.
    fn store(self, cell: &Self::Atomic);
    /// A particle's cell that holds `values`.
    fn particle(values: [Self; 4]) -> Self::Particle;
    /// The values in a particle's cell.
    fn read(particle: &Self::Particle) -> [Self; 4];
    /// The values in a particle's cell that no other thread sees: one move in place of several.
    fn read_alone(particle: &mut Self::Particle) -> [Self; 4];
    /// Puts values into a particle's cell that no other thread sees.
    fn write_alone(particle: &mut Self::Particle, values: [Self; 4]);
    /// Puts values into a particle's cell.
    fn write(particle: &Self::Particle, values: [Self; 4]);

    /// The place of the particle of one of `lanes` lanes in four vectors of consecutive particles that
    /// [`Float::columns`] takes.
    #[doc(hidden)]
    fn row(lane: usize, lanes: usize) -> usize;
    /// Four vectors of particles as vectors of x, y, z and inverse masses.
    #[doc(hidden)]
    fn columns<S: Simd>(simd: S, rows: [Self::Lanes<S>; 4]) -> [Self::Lanes<S>; 4];
    /// The inverse of [`Float::columns`].
    #[doc(hidden)]
    fn rows<S: Simd>(simd: S, columns: [Self::Lanes<S>; 4]) -> [Self::Lanes<S>; 4];

    /// Rounds a vector of doubles to this precision.
    #[inline]
    fn from_dvec3(v: DVec3) -> Self::Vector {
        Self::vector(
            Self::from_f64(v.x),
            Self::from_f64(v.y),
            Self::from_f64(v.z),
        )
    }

    /// The vector in double precision.
    #[inline]
    fn to_dvec3(v: Self::Vector) -> DVec3 {
        DVec3::from_array(Self::components(v).map(Self::to_f64))
    }
}

macro_rules! float {
    ($scalar:ty, $vector:ty, $atomic:ty, $lanes:ident, $from_f64:expr, $cells:literal, $pack:expr, $unpack:expr, $row:path, $columns:path, $rows:path) => {
        impl Float for $scalar {
            type Vector = $vector;
            type Atomic = $atomic;
            type Particle = [AtomicU64; $cells];
            type Lanes<S: Simd> = S::$lanes;

            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const HALF: Self = 0.5;
            const EPSILON: Self = <$scalar>::EPSILON;

            #[inline]
            fn from_f64(value: f64) -> Self {
                $from_f64(value)
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            fn vector(x: Self, y: Self, z: Self) -> $vector {
                <$vector>::new(x, y, z)
            }
            #[inline]
            fn components(v: $vector) -> [Self; 3] {
                v.to_array()
            }
            #[inline]
            fn dot(a: $vector, b: $vector) -> Self {
                a.dot(b)
            }
            #[inline]
            fn cross(a: $vector, b: $vector) -> $vector {
                a.cross(b)
            }
            #[inline]
            fn cell(self) -> $atomic {
                <$atomic>::new(self.to_bits())
            }
            #[inline]
            fn load(cell: &$atomic) -> Self {
                Self::from_bits(cell.load(Ordering::Relaxed))
            }
            #[inline]
            fn store(self, cell: &$atomic) {
                cell.store(self.to_bits(), Ordering::Relaxed);
            }
            #[inline(always)]
            fn particle(values: [Self; 4]) -> Self::Particle {
                $pack(values).map(AtomicU64::new)
            }
            #[inline(always)]
            fn read(particle: &Self::Particle) -> [Self; 4] {
                $unpack(std::array::from_fn(|i| particle[i].load(Ordering::Relaxed)))
            }
            #[inline(always)]
            fn write(particle: &Self::Particle, values: [Self; 4]) {
                let packed: [u64; $cells] = $pack(values);
                for (cell, bits) in particle.iter().zip(packed) {
                    cell.store(bits, Ordering::Relaxed);
                }
            }
            #[inline(always)]
            fn read_alone(particle: &mut Self::Particle) -> [Self; 4] {
                $unpack(particle.each_mut().map(|cell| *cell.get_mut()))
            }
            #[inline(always)]
            fn write_alone(particle: &mut Self::Particle, values: [Self; 4]) {
                *particle = $pack(values).map(AtomicU64::new);
            }
            #[inline(always)]
            fn row(lane: usize, lanes: usize) -> usize {
                $row(lane, lanes)
            }
            #[inline(always)]
            fn columns<S: Simd>(simd: S, rows: [Self::Lanes<S>; 4]) -> [Self::Lanes<S>; 4] {
                $columns(simd, rows)
            }
            #[inline(always)]
            fn rows<S: Simd>(simd: S, columns: [Self::Lanes<S>; 4]) -> [Self::Lanes<S>; 4] {
                $rows(simd, columns)
            }
        }
    };
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding to single precision is the purpose"
)]
#[inline]
fn round_to_f32(value: f64) -> f32 {
    value as f32
}

/// Two single-precision numbers in one cell, the first in the lower half.
#[inline(always)]
fn pack_f32(v: [f32; 4]) -> [u64; 2] {
    let pair = |a: f32, b: f32| u64::from(a.to_bits()) | (u64::from(b.to_bits()) << 32);
    [pair(v[0], v[1]), pair(v[2], v[3])]
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the lower half is what is wanted"
)]
#[inline(always)]
fn unpack_f32(cells: [u64; 2]) -> [f32; 4] {
    let [low, high] = cells.map(|c| [f32::from_bits(c as u32), f32::from_bits((c >> 32) as u32)]);
    [low[0], low[1], high[0], high[1]]
}

#[inline(always)]
fn pack_f64(v: [f64; 4]) -> [u64; 4] {
    v.map(f64::to_bits)
}

#[inline(always)]
fn unpack_f64(cells: [u64; 4]) -> [f64; 4] {
    cells.map(f64::from_bits)
}

float!(
    f32,
    Vec3,
    AtomicU32,
    f32s,
    round_to_f32,
    2,
    pack_f32,
    unpack_f32,
    transpose::row_f32,
    transpose::within_blocks,
    transpose::within_blocks
);
float!(
    f64,
    DVec3,
    AtomicU64,
    f64s,
    std::convert::identity,
    4,
    pack_f64,
    unpack_f64,
    transpose::row_f64,
    transpose::deinterleave,
    transpose::interleave
);

/// Whether all components are finite.
#[inline]
pub(crate) fn finite<R: Float>(v: R::Vector) -> bool {
    R::components(v).into_iter().all(R::is_finite)
}

/// The position of a particle.
#[inline]
pub(crate) fn load<R: Float>(particle: &R::Particle) -> R::Vector {
    let [x, y, z, _] = R::read(particle);
    R::vector(x, y, z)
}

/// The inverse mass of a particle in 1/kg; 0 if it does not move.
#[inline]
pub(crate) fn weight<R: Float>(particle: &R::Particle) -> R {
    R::read(particle)[3]
}

/// Moves a particle.
#[inline]
pub(crate) fn store<R: Float>(particle: &R::Particle, x: R::Vector) {
    let [a, b, c] = R::components(x);
    R::write(particle, [a, b, c, weight::<R>(particle)]);
}
