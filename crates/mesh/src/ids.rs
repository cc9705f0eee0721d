//! The two index types of a mesh: [`ParticleId`] and [`TetId`].
//!
//! Both are transparent `u32`s: 4 billion elements are enough, and memory traffic is half that of
//! `usize`. The types are distinct because no other check finds a tet index used as a particle
//! index.

use std::borrow::Borrow;
use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id of the element at `index`.
            ///
            /// # Panics
            /// If `index` does not fit in 32 bits.
            #[must_use]
            pub fn new(index: usize) -> Self {
                Self(u32::try_from(index).expect("element index fits in 32 bits"))
            }

            /// The position of this element in arrays over all elements.
            #[must_use]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}", self.0)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}", self.0)
            }
        }

        impl Borrow<u32> for $name {
            fn borrow(&self) -> &u32 {
                &self.0
            }
        }

        impl Borrow<u32> for &$name {
            fn borrow(&self) -> &u32 {
                &self.0
            }
        }

        impl From<$name> for u32 {
            fn from(id: $name) -> Self {
                id.0
            }
        }
    };
}

id! {
    /// Index of a particle (a mesh vertex).
    ParticleId
}

id! {
    /// Index of a tetrahedron.
    TetId
}
