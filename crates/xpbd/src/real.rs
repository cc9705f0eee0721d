//! [`Real`]: the scalar of a solver, `f32` or `f64`, with its vector and its shared cell.
//!
//! One source serves both precisions. Positions live in atomic cells: within a color every particle belongs to at most
//! one cluster, so threads never meet, but the language cannot know that. Relaxed atomic loads and stores are plain
//! moves on every processor of interest; they make the sharing safe at no cost.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use glam::{DVec3, Vec3};

/// A scalar that the solver can compute with: `f32` or `f64`.
pub trait Real:
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
        + Mul<Self, Output = Self::Vector>;
    /// A cell that threads may share.
    type Atomic: Debug + Send + Sync;

    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;

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

macro_rules! real {
    ($scalar:ty, $vector:ty, $atomic:ty, $from_f64:expr) => {
        impl Real for $scalar {
            type Vector = $vector;
            type Atomic = $atomic;

            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;

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

real!(f32, Vec3, AtomicU32, round_to_f32);
real!(f64, DVec3, AtomicU64, std::convert::identity);

/// Whether all components are finite.
pub(crate) fn finite<R: Real>(v: R::Vector) -> bool {
    R::components(v).into_iter().all(R::is_finite)
}

/// The position of a particle.
#[inline]
pub(crate) fn load<R: Real>(particle: &[R::Atomic; 4]) -> R::Vector {
    R::vector(
        R::load(&particle[0]),
        R::load(&particle[1]),
        R::load(&particle[2]),
    )
}

/// The inverse mass of a particle in 1/kg; 0 if it does not move.
#[inline]
pub(crate) fn weight<R: Real>(particle: &[R::Atomic; 4]) -> R {
    R::load(&particle[3])
}

/// Moves a particle.
#[inline]
pub(crate) fn store<R: Real>(particle: &[R::Atomic; 4], x: R::Vector) {
    let [a, b, c] = R::components(x);
    a.store(&particle[0]);
    b.store(&particle[1]);
    c.store(&particle[2]);
}
