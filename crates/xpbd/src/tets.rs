//! [`TetSet`]: the tets of a solver at rest, their materials, and their layout for the kernel.
//!
//! Tets keep the numbers of the mesh. The order of solving is that of a [`Schedule`], from which the layout is updated.
//! Cost: an edit is O(1); the next step updates the layout of what was edited.

use glam::DVec3;
use incise_graph::Schedule;

use crate::layout::{Ingredients, Layout};
use crate::neo_hookean::TetConstraint;
use crate::particles::Particles;
use crate::{Float, Material, XpbdError};

/// A limit of the stiffness of tets; see [`crate::Solver::limit_kappa`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KappaLimit {
    /// Largest kappa of a tet.
    pub kappa: f64,
    /// The time of a substep in s.
    pub substep_time: f64,
}

/// Tets and materials.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct TetSet<R: Float> {
    pub(crate) list: Vec<TetConstraint<R>>,
    /// Volumes at rest in m³.
    pub(crate) rest_volumes: Vec<f64>,
    pub(crate) material_of: Vec<u16>,
    pub(crate) materials: Vec<Material>,
    pub(crate) kappa_limit: Option<KappaLimit>,
    /// The tets in solving order.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) layout: Layout<R>,
}

impl<R: Float> Default for TetSet<R> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            rest_volumes: Vec::new(),
            material_of: Vec::new(),
            materials: Vec::new(),
            kappa_limit: None,
            layout: Layout::default(),
        }
    }
}

/// Without the layout, which the next step rebuilds from tets and schedule.
impl<R: Float> Clone for TetSet<R> {
    fn clone(&self) -> Self {
        Self {
            list: self.list.clone(),
            rest_volumes: self.rest_volumes.clone(),
            material_of: self.material_of.clone(),
            materials: self.materials.clone(),
            kappa_limit: self.kappa_limit,
            layout: Layout::default(),
        }
    }
}

impl<R: Float> TetSet<R> {
    /// Number of tets.
    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    /// Bytes of the arrays that a clone has.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.list)
            + size_of_val(&*self.rest_volumes)
            + size_of_val(&*self.material_of)
    }

    /// Appends a tet and returns its number.
    pub(crate) fn push(&mut self, particles: [u32; 4], rest: [DVec3; 4], material: u16) -> usize {
        self.list.push(self.constraint(particles, rest, material));
        self.rest_volumes.push(signed_volume(rest));
        self.material_of.push(material);
        self.list.len() - 1
    }

    /// Replaces a tet by another one of the same material.
    pub(crate) fn replace(&mut self, tet: usize, particles: [u32; 4], rest: [DVec3; 4]) {
        self.list[tet] = self.constraint(particles, rest, self.material_of[tet]);
        self.rest_volumes[tet] = signed_volume(rest);
    }

    /// Replaces a tet by a copy of another one.
    pub(crate) fn copy_to(&mut self, from: usize, to: usize) {
        self.list[to] = self.list[from];
        self.rest_volumes[to] = self.rest_volumes[from];
        self.material_of[to] = self.material_of[from];
    }

    /// Removes the tets from number `count` on.
    pub(crate) fn truncate(&mut self, count: usize) {
        self.list.truncate(count);
        self.rest_volumes.truncate(count);
        self.material_of.truncate(count);
    }

    /// The material of a tet.
    pub(crate) fn material(&self, tet: usize) -> &Material {
        &self.materials[usize::from(self.material_of[tet])]
    }

    /// Whether a material is damped.
    pub(crate) fn is_damped(&self) -> bool {
        self.materials.iter().any(|m| m.damping > 0.0)
    }

    fn constraint(&self, particles: [u32; 4], rest: [DVec3; 4], material: u16) -> TetConstraint<R> {
        let material = &self.materials[usize::from(material)];
        let mut tet = TetConstraint::new(particles, rest, material);
        if let Some(limit) = self.kappa_limit {
            let kappa = tet.kappa(material, limit.substep_time);
            if kappa > limit.kappa {
                tet.soften(kappa / limit.kappa);
            }
        }
        tet
    }

    /// Puts the tets into the order of a schedule, in blocks of so many lanes; if they are, into fewer blocks where that pays.
    pub(crate) fn update_layout(
        &mut self,
        particles: &Particles<R>,
        schedule: &Schedule,
        lanes: usize,
    ) {
        let mut layout = std::mem::take(&mut self.layout);
        if layout.fits(schedule) {
            layout.compact(schedule, |t| self.ingredients(particles, t));
        } else {
            self.update(&mut layout, particles, schedule, lanes);
        }
        self.layout = layout;
    }

    fn update(
        &self,
        layout: &mut Layout<R>,
        particles: &Particles<R>,
        schedule: &Schedule,
        lanes: usize,
    ) {
        let uniform = self.has_one_set_of_constants();
        let positions = || (0..particles.len()).map(|p| particles.local(p)).collect();
        layout.update(schedule, lanes, uniform, positions, |t| {
            self.ingredients(particles, t)
        });
    }

    /// Compares what the layout becomes with the next schedule with schedule, tets and masses, to the bit. O(tets).
    pub(crate) fn check_layout(
        &self,
        particles: &Particles<R>,
        schedule: &Schedule,
        lanes: usize,
    ) -> Result<(), XpbdError> {
        let mut layout = self.layout.clone();
        self.update(&mut layout, particles, schedule, lanes);
        layout.check(schedule, |t| self.ingredients(particles, t))
    }

    /// Whether all materials are one to the layout: their densities do not matter to it, nor, but for rounding, their
    /// Young's moduli.
    fn has_one_set_of_constants(&self) -> bool {
        let constants = |material: &Material| {
            let [ratio, gamma] = TetConstraint::<R>::constants(material);
            [ratio, gamma, R::from_f64(material.damping)]
        };
        let mut pairs = self.materials.windows(2);
        pairs.all(|pair| constants(&pair[0]) == constants(&pair[1]))
    }

    /// What the layout needs of a tet.
    pub(crate) fn ingredients(&self, particles: &Particles<R>, t: u32) -> Ingredients<R> {
        let tet = self.list.get(t as usize);
        let tet = *tet.expect("the schedule belongs to these tets");
        Ingredients {
            tet,
            weights: tet.particles.map(|p| particles.weight(p as usize)),
            constants: [
                tet.ratio,
                tet.gamma,
                R::from_f64(self.material(t as usize).damping),
            ],
        }
    }
}

fn signed_volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second material that the kernel cannot tell from the first takes no room in the layout.
    #[test]
    fn materials_are_told_apart_by_what_the_kernel_needs() {
        let rubber = Material {
            young_modulus: 1e4,
            poisson_ratio: 0.45,
            density: 1e3,
            damping: 0.0,
        };
        let with = |second: Material| {
            let tets = TetSet::<f32> {
                materials: vec![rubber, second],
                ..TetSet::default()
            };
            tets.has_one_set_of_constants()
        };
        assert!(with(rubber));
        assert!(with(Material {
            young_modulus: 2e4,
            density: 2e3,
            ..rubber
        }));
        assert!(!with(Material {
            poisson_ratio: 0.4,
            ..rubber
        }));
        assert!(!with(Material {
            damping: 0.1,
            ..rubber
        }));
    }
}
