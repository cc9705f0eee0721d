//! [`Constraints`]: all constraints of a solver besides its tets, kind by kind.
//!
//! A kind is a type that implements [`ConstraintKind`] in a file of its own, and a line in the list below, which says
//! in which order kinds are solved: each iteration goes over the tets, then over the kinds. A kind that holds no
//! constraints takes no memory and no pass.

mod attachments;
mod blades;
mod colliders;
mod contacts;
mod distances;
mod scalar;
mod volumes;

use crate::Float;
use crate::particles::Particles;
use crate::substep::Substep;

pub use attachments::AttachmentData;
pub(crate) use attachments::Attachments;
pub(crate) use blades::Blades;
pub use blades::{EdgePoint, SolidBlade};
pub(crate) use colliders::{Colliders, Obstacle, kept_depth, outside};
pub(crate) use contacts::Contacts;
pub use contacts::{
    ContactData, ContactFactors, ContactLaw, ContactRound, ContactState, EdgeContact, FaceContact,
    FaceLimit, PairContact, SurfaceContact,
};
pub(crate) use distances::{Distance, Distances};
pub use distances::{DistanceConstraint, DistanceData};
pub(crate) use scalar::ScalarConstraint;
pub(crate) use volumes::{TetVolume, Volumes};
pub use volumes::{VolumeConstraint, VolumeData};

/// Constraints of one kind: what a step calls, in this order.
///
/// Particles are moved through their cells, so passes share them.
pub(crate) trait ConstraintKind<R: Float> {
    /// Begins a substep, after the particles were predicted; returns how many held particles could not be moved because
    /// the target is out of the range of numbers.
    fn begin(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) -> usize;

    /// Moves particles so that each constraint is met, once.
    fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>);

    /// Ends a substep, after velocities were taken from the motion.
    fn end(&mut self, _particles: &mut Particles<R>, _substep: &Substep<'_, R>) {}

    /// Ends a frame.
    fn end_frame(&mut self) {}

    /// Moves what is relative to the origin of the particles, after the origin has moved by `by`.
    fn shift(&mut self, _by: R::Vector) {}

    /// Bytes of the arrays that a clone has.
    fn bytes(&self) -> usize;
}

/// Makes [`Constraints`] of a list of kinds.
macro_rules! kinds {
    ($($name:ident: $kind:ident,)*) => {
        /// The constraints of each kind, in solving order.
        #[derive(Clone, Debug, Default)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[cfg_attr(feature = "serde", serde(bound = ""))]
        pub(crate) struct Constraints<R: Float> {
            $(pub(crate) $name: $kind<R>,)*
        }

        impl<R: Float> Constraints<R> {
            fn each(&self) -> impl Iterator<Item = &dyn ConstraintKind<R>> {
                [$(&self.$name as &dyn ConstraintKind<R>),*].into_iter()
            }

            fn each_mut(&mut self) -> impl Iterator<Item = &mut dyn ConstraintKind<R>> {
                [$(&mut self.$name as &mut dyn ConstraintKind<R>),*].into_iter()
            }
        }
    };
}

kinds! {
    attachments: Attachments,
    distances: Distances,
    volumes: Volumes,
    contacts: Contacts,
    blades: Blades,
    colliders: Colliders,
}

impl<R: Float> Constraints<R> {
    /// [`ConstraintKind::begin`] of each kind.
    pub(crate) fn begin(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        self.each_mut()
            .map(|kind| kind.begin(particles, substep))
            .sum()
    }

    /// [`ConstraintKind::solve`] of each kind.
    pub(crate) fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) {
        self.each_mut()
            .for_each(|kind| kind.solve(particles, substep));
    }

    /// [`ConstraintKind::end`] of each kind.
    pub(crate) fn end(&mut self, particles: &mut Particles<R>, substep: &Substep<'_, R>) {
        self.each_mut()
            .for_each(|kind| kind.end(particles, substep));
    }

    /// [`ConstraintKind::end_frame`] of each kind.
    pub(crate) fn end_frame(&mut self) {
        self.each_mut().for_each(ConstraintKind::end_frame);
    }

    /// [`ConstraintKind::shift`] of each kind.
    pub(crate) fn shift(&mut self, by: R::Vector) {
        self.each_mut().for_each(|kind| kind.shift(by));
    }

    /// [`ConstraintKind::bytes`] of all kinds.
    pub(crate) fn bytes(&self) -> usize {
        self.each().map(ConstraintKind::bytes).sum()
    }
}
