//! What can be wrong with a body, a step, or its solution.

/// A body that cannot be, a step that cannot be taken, or one that was not solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// A number of a material outside its range.
    #[error("the material's {what} is {value}; it must be {range}")]
    Material {
        /// Which number.
        what: &'static str,
        /// What it was.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// A tet that names a particle that does not exist.
    #[error("tet {tet} names particle {particle}, but there are only {particles}")]
    NoParticle {
        /// The tet.
        tet: usize,
        /// What it names.
        particle: u32,
        /// The number of particles.
        particles: usize,
    },
    /// A tet whose rest shape is flat, inverted or too small for double precision.
    #[error(
        "tet {tet} has a volume of {volume} m³ at rest; it must be positive, with edges whose inverse is finite"
    )]
    Volume {
        /// The tet.
        tet: usize,
        /// Its signed volume at rest in m³.
        volume: f64,
    },
    /// A position or velocity that is infinite or not a number.
    #[error("the {what} of particle {particle} is not finite")]
    NotFinite {
        /// Position or velocity.
        what: &'static str,
        /// The particle.
        particle: usize,
    },
    /// A number of a step outside its range.
    #[error("the {what} is {value}; it must be {range}")]
    Setting {
        /// Which number.
        what: &'static str,
        /// What it was.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// A piece that has no unique equilibrium because it is not held.
    #[error(
        "the piece of particle {particle} can turn or drift; fix three of its particles that are not on one line"
    )]
    NotHeld {
        /// One of its particles.
        particle: usize,
    },
    /// Newton's method did not reach the residual that it promises. The body is as it was.
    #[error(
        "after {iterations} iterations a force of {residual:e} N is left, of {scale:e} N at play; use a smaller step or approach the load in parts"
    )]
    NotConverged {
        /// Iterations taken.
        iterations: usize,
        /// Norm of the forces out of balance in N.
        residual: f64,
        /// Norm of the forces at play in N.
        scale: f64,
    },
    /// Forces or energies leave the range of double precision.
    #[error("the forces or energies of this state leave the range of double precision")]
    Range,
    /// The matrix is too large for the memory or its indices.
    #[error("the matrix of {particles} particles does not fit into memory")]
    Memory {
        /// The number of particles.
        particles: usize,
    },
}
