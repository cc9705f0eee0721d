//! Handles of what a simulation holds: grabs, colliders, attachments, distances.
//!
//! A handle is valid in the simulation that returned it, until the thing is removed.

use incise::{AttachmentHandle, ColliderHandle, DistanceHandle};
use pyo3::prelude::*;

/// A class of Python around a handle of the facade.
macro_rules! handle {
    ($(#[doc = $doc:literal])* $name:ident, $inner:ty) => {
        $(#[doc = $doc])*
        #[pyclass(frozen, eq, hash, from_py_object, module = "incise")]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub(crate) struct $name(pub(crate) $inner);

        #[pymethods]
        impl $name {
            fn __repr__(&self) -> String {
                format!("<incise.{:?}>", self.0)
            }
        }
    };
}

handle!(
    /// Handle of a grab: see ``Simulation.grab``.
    Grab,
    incise::Grab
);
handle!(
    /// Handle of an obstacle: see ``Simulation.add_collider``.
    Collider,
    ColliderHandle
);
handle!(
    /// Handle of a part of a body that is held or moved: see ``Simulation.add_attachment``.
    Attachment,
    AttachmentHandle
);
handle!(
    /// Handle of a suture, spring or rod: see ``Simulation.add_distance``.
    Distance,
    DistanceHandle
);
