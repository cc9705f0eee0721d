//! Errors of bodies, steps and solutions.

/// Error of a body, of the arguments of a step, or of its solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// A material constant outside its range.
    #[error("the material's {what} is {value}; it must be {range}")]
    Material {
        /// Name of the constant.
        what: &'static str,
        /// Value given.
        value: f64,
        /// Allowed range.
        range: &'static str,
    },
    /// A tet with a particle index that does not exist.
    #[error("tet {tet} names particle {particle}, but there are only {particles}")]
    NoParticle {
        /// The tet.
        tet: usize,
        /// Index given.
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
        /// `position` or `velocity`.
        what: &'static str,
        /// The particle.
        particle: usize,
    },
    /// An argument of a step outside its range.
    #[error("the {what} is {value}; it must be {range}")]
    Setting {
        /// Name of the argument.
        what: &'static str,
        /// Value given.
        value: f64,
        /// Allowed range.
        range: &'static str,
    },
    /// A piece without a unique equilibrium because it has too few fixed particles.
    #[error(
        "the piece of particle {particle} can turn or drift; fix three of its particles that are not on one line"
    )]
    NotHeld {
        /// One of its particles.
        particle: usize,
    },
    /// Newton's method did not reach the required residual. The body is unchanged.
    #[error(
        "after {iterations} iterations a force of {residual:e} N is left, of {scale:e} N at play; use a smaller step or approach the load in parts"
    )]
    NotConverged {
        /// Iterations taken.
        iterations: usize,
        /// Norm of the unbalanced forces in N.
        residual: f64,
        /// Norm of the acting forces in N.
        scale: f64,
    },
    /// Forces or energies exceed the range of double precision.
    #[error("the forces or energies of this state leave the range of double precision")]
    Range,
    /// The matrix is too large for memory or for its index type.
    #[error("the matrix of {particles} particles does not fit into memory")]
    Memory {
        /// The number of particles.
        particles: usize,
    },
}
