//! [`ErasedSolver`]: a solver whose precision is chosen at run time.
//!
//! One list names the functions of [`Solver`] that take and return the same types in both precisions. Steps are not
//! among them: they stay functions of a solver of a known precision. Cost: a call through a table.

use std::fmt::Debug;

use glam::DVec3;
use incise_graph::{Coloring, Schedule};

use crate::{
    ContactLaw, ContactState, DistanceConstraint, Float, Forces, KappaLimit, Material, PairContact,
    Pose, Residuals, Softened, SolidBlade, Solver, SurfaceContact, VolumeConstraint, XpbdError,
};

/// Declares [`ErasedSolver`] and implements it for each solver by the functions of the same names.
macro_rules! erased {
    (
        reads: $(fn $read:ident(&self $(, $input:ident: $of:ty)*) $(-> $result:ty)?;)*
        edits: $(fn $edit:ident(&mut self $(, $value:ident: $with:ty)*) $(-> $outcome:ty)?;)*
    ) => {
        /// A [`Solver`] in either precision: its edits and measurements.
        ///
        /// # Example
        /// ```
        /// use glam::DVec3;
        /// use incise_xpbd::{ErasedSolver, Solver};
        ///
        /// let (single, mut double) = (Solver::<f32>::new(&[DVec3::ZERO]), Solver::<f64>::new(&[DVec3::ZERO]));
        /// double.set_mass(0, 2.0);
        /// assert_eq!([&single as &dyn ErasedSolver, &double].map(|solver| solver.mass(0)), [0.0, 2.0]);
        /// ```
        pub trait ErasedSolver: Debug + Send + Sync {
            /// Calls a function with each of [`Solver::contacts`].
            fn for_each_contact(&self, visit: &mut dyn FnMut(ContactState));
            $(#[doc = concat!("Calls [`Solver::", stringify!($read), "`].")]
            fn $read(&self $(, $input: $of)*) $(-> $result)?;)*
            $(#[doc = concat!("Calls [`Solver::", stringify!($edit), "`].")]
            fn $edit(&mut self $(, $value: $with)*) $(-> $outcome)?;)*
        }

        impl<R: Float> ErasedSolver for Solver<R> {
            fn for_each_contact(&self, visit: &mut dyn FnMut(ContactState)) {
                self.contacts().for_each(visit);
            }
            $(fn $read(&self $(, $input: $of)*) $(-> $result)? {
                Self::$read(self $(, $input)*)
            })*
            $(fn $edit(&mut self $(, $value: $with)*) $(-> $outcome)? {
                Self::$edit(self $(, $value)*)
            })*
        }
    };
}

erased! {
    reads:
    fn is_single(&self) -> bool;
    fn particle_count(&self) -> usize;
    fn position(&self, particle: usize) -> DVec3;
    fn positions(&self, out: &mut Vec<DVec3>);
    fn velocity(&self, particle: usize) -> DVec3;
    fn velocities(&self, out: &mut Vec<DVec3>);
    fn mass(&self, particle: usize) -> f64;
    fn is_fixed(&self, particle: usize) -> bool;
    fn is_free(&self, particle: usize) -> bool;
    fn held(&self, out: &mut Vec<bool>);
    fn tet_count(&self) -> usize;
    fn tet_particles(&self, tet: usize) -> [u32; 4];
    fn rest_volume(&self, tet: usize) -> f64;
    fn materials(&self) -> &[Material];
    fn material_of(&self, tet: usize) -> u16;
    fn density_of(&self, tet: usize) -> f64;
    fn kappa_of(&self, tet: usize, substep_time: f64) -> f64;
    fn max_speed(&self) -> f64;
    fn inverted_fraction(&self) -> f64;
    fn softened(&self) -> Softened;
    fn handle_count(&self) -> usize;
    fn handle(&self, handle: u32) -> Pose;
    fn handle_of(&self, particle: usize) -> Option<u32>;
    fn contact_counts(&self) -> [usize; 2];
    fn contact_color_count(&self) -> usize;
    fn forces(&self) -> Option<Forces>;
    fn blade_work(&self) -> &[f64];
    fn load(&self, gravity: DVec3) -> f64;
    fn residuals(&self, substep_time: f64) -> Option<Residuals>;
    fn residuals_of_tets(&self, substep_time: f64) -> Option<Vec<f64>>;
    fn check_layout(&self, schedule: &Schedule) -> Result<(), XpbdError>;
    fn bytes(&self) -> usize;

    edits:
    fn push_particle_between(&mut self, a: usize, b: usize, parameter: f64);
    fn push_copy(&mut self, of: usize);
    fn set_position(&mut self, particle: usize, position: DVec3);
    fn set_velocity(&mut self, particle: usize, velocity: DVec3);
    fn set_mass(&mut self, particle: usize, mass: f64);
    fn set_mass_in_star(&mut self, particle: usize, mass: f64, star: &mut dyn Iterator<Item = usize>);
    fn set_fixed(&mut self, particle: usize, fixed: bool);
    fn add_material(&mut self, material: Material) -> Result<u16, XpbdError>;
    fn push_tet(&mut self, particles: [u32; 4], rest: [DVec3; 4], material: u16);
    fn replace_tet(&mut self, tet: usize, particles: [u32; 4], rest: [DVec3; 4]);
    fn relink_tet(&mut self, tet: usize, particles: [u32; 4]);
    fn move_tet(&mut self, from: usize, to: usize);
    fn truncate_tets(&mut self, count: usize);
    fn limit_kappa(&mut self, limit: Option<KappaLimit>);
    fn add_handle(&mut self, pose: Pose) -> u32;
    fn move_handle(&mut self, handle: u32, pose: Pose);
    fn set_handle(&mut self, handle: u32, pose: Pose);
    fn attach(&mut self, particle: usize, handle: u32, compliance: f64, damping: f64) -> Result<(), XpbdError>;
    fn set_compliance(&mut self, handle: u32, compliance: f64) -> Result<(), XpbdError>;
    fn detach_all(&mut self, handle: u32);
    fn set_distances(&mut self, constraints: &[DistanceConstraint], schedule: Schedule) -> Result<(), XpbdError>;
    fn set_volumes(&mut self, constraints: &[VolumeConstraint], schedule: Schedule) -> Result<(), XpbdError>;
    fn put_volume(&mut self, index: usize, constraint: VolumeConstraint) -> Result<(), XpbdError>;
    fn relink_volume(&mut self, constraint: usize, particles: [u32; 4]);
    fn reschedule_volumes(&mut self, schedule: &Schedule);
    fn set_contacts(&mut self, law: &ContactLaw, pairs: (&[PairContact], &Coloring), surfaces: (&[SurfaceContact], &Coloring)) -> Result<(), XpbdError>;
    fn set_blades(&mut self, blades: Vec<SolidBlade>) -> Result<(), XpbdError>;
}
