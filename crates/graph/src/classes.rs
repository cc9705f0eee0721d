//! Numbers sorted into classes: the vertices of each color, or the constraints of each cluster.

use crate::csr::Csr;

/// For each class the ascending list of its members, in one flat array.
///
/// Made by [`Coloring::classes`](crate::Coloring::classes) and
/// [`Clustering::members`](crate::Clustering::members).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Classes {
    csr: Csr,
}

impl Classes {
    /// Groups positions by label; labels from `count` on are left out.
    pub(crate) fn group(count: usize, labels: impl Iterator<Item = u32> + Clone) -> Self {
        Self {
            csr: Csr::group(count, labels),
        }
    }

    /// The number of classes, empty ones included.
    #[must_use]
    pub fn count(&self) -> usize {
        self.csr.row_count()
    }

    /// The members of one class, ascending.
    ///
    /// # Panics
    /// If `class` is not below [`count`](Self::count).
    #[must_use]
    pub fn members(&self, class: usize) -> &[u32] {
        self.csr.row(class)
    }

    /// The classes in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        self.csr.rows()
    }

    /// The raw offsets: class `i` is `values()[offsets()[i]..offsets()[i + 1]]`.
    #[must_use]
    pub fn offsets(&self) -> &[u32] {
        &self.csr.offsets
    }

    /// All members, class after class.
    #[must_use]
    pub fn values(&self) -> &[u32] {
        &self.csr.values
    }
}
