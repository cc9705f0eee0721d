//! [`Island::joined_with`]: two islands as one, while the simulation runs.
//!
//! Particles, tets, materials, pieces and handles of the second follow those of the first, so what refers to the first
//! stays valid and what refers to the second is shifted. Positions, velocities, cuts, attachments, grabs and distances
//! are kept; substeps, method, clusters, colors and the data of a device are chosen and made as for a new island. A
//! rebuild of clusters in the background ends, since all are rebuilt here.
//!
//! Source: merging of islands as in rigid body engines. Cost: O(tets of both).

use incise_xpbd::StepSettings;

use super::judged::Judged;
use super::{Constraints, Island, adopt, kappa_limit};
use crate::compute_device::ComputeDevice;
use crate::contacts::Contacts;
use crate::island_builder::{TOO_MANY, substeps};
use crate::method::{leaves_open, resolve, settings};
use crate::partition::Partition;
use crate::recluster::Recluster;
use crate::scene::{Method, Substeps};
use crate::sleep::SleepState;
use crate::substeps::Choice;
use crate::validate::value;
use crate::volume::Volumes;
use crate::{Error, Scene};

impl Island {
    /// Returns this island and another one as one, awake, with the settings of a scene. On a device the state of both is
    /// that of the last readback.
    pub(crate) fn joined_with(
        &self,
        other: &Self,
        scene: &Scene,
        compute_device: &ComputeDevice,
    ) -> Result<Self, Error> {
        if self.body_of.len() + other.body_of.len() > usize::from(u16::MAX) + 1 {
            return Err(value("body", "too many", TOO_MANY));
        }
        let number = |n: usize| {
            u32::try_from(n).map_err(|_| Error::Inconsistent("too many particles".into()))
        };
        let particles = self.positions.len();
        let first_particle = number(particles)?;
        let first_piece = number(self.pieces.total())?;
        let first_frame = number(self.solver.host().handle_count())?;

        let (bodies, body_of) = self.bodies_with(other);
        let mut cuttable = self.cuttable.clone();
        cuttable.append(&other.cuttable);
        let mut pieces = self.pieces.clone();
        pieces.append(&other.pieces);
        let mut solver = self.solver.joined_with(&other.solver)?;
        let mut masses = self.masses.clone();
        masses.append(&other.masses);
        for softened in [self, other] {
            let limit = kappa_limit(&softened.spec, &softened.settings);
            solver.limit_kappa(limit, None, cuttable.mesh())?;
        }

        let asked: Vec<Substeps> = body_of
            .iter()
            .map(|&body: &usize| {
                let body = &scene.body[bodies[body]];
                body.substeps.unwrap_or(scene.solver.substeps)
            })
            .collect();
        let mut settings = StepSettings {
            gravity: self.settings.gravity,
            colliders: self.settings.colliders.clone(),
            ..settings(scene)?
        };
        let choice: Option<Choice>;
        (settings.substeps, choice) = substeps(&asked, &scene.solver, &solver, cuttable.mesh());
        let is_open = leaves_open(scene, &asked, &settings, compute_device.is_gpu());
        let (spec, choice) = resolve(&scene.solver, choice, is_open);
        if scene.solver.method == Method::Auto {
            adopt(&mut settings, &spec);
        }
        solver.limit_kappa(None, kappa_limit(&scene.solver, &settings), cuttable.mesh())?;

        let mut distances = self.constraints.distances.clone();
        distances.append(&other.constraints.distances, first_particle);
        if !distances.is_empty() {
            distances.hand_to(&mut solver)?;
        }
        let contacts = match (
            &scene.contact,
            &self.constraints.contacts,
            &other.constraints.contacts,
        ) {
            (Some(spec), Some(one), Some(other)) => {
                let joined = Contacts::joined(spec, &cuttable, one, other, first_piece)?;
                Some(Box::new(joined))
            }
            _ => None,
        };
        let partition = Partition::new(scene, cuttable.mesh())?;
        let volumes = Volumes::joined(
            (self.constraints.volumes.as_ref(), self.body_of.len()),
            (other.constraints.volumes.as_ref(), other.body_of.len()),
        );
        if let Some(volumes) = &volumes {
            volumes.constrain(&mut solver, &cuttable, &partition.schedule)?;
        }
        solver.prepare(&spec, compute_device)?;

        let mut attachments = self.constraints.attachments.clone();
        attachments.extend(other.constraints.attachments.iter().map(|attachment| {
            let mut attachment = attachment.clone();
            attachment.renumber(particles, first_frame);
            attachment
        }));
        let spare = other
            .constraints
            .spare_frames
            .iter()
            .map(|frame| first_frame + frame);
        let spare_frames = self
            .constraints
            .spare_frames
            .iter()
            .copied()
            .chain(spare)
            .collect();
        let mut grabs = self.constraints.grabs.clone();
        grabs.append(&other.constraints.grabs, first_frame);
        let mut judged = Judged::new(choice, settings.substeps, cuttable.mesh());
        judged.leaves_substeps_open = asked.iter().all(|s| *s == Substeps::Auto);
        judged.leaves_method_open = is_open;
        let mut island = Self {
            bodies,
            body_of,
            solver,
            partition,
            settings,
            spec,
            constraints: Constraints {
                attachments,
                spare_frames,
                distances,
                grabs,
                volumes,
                contacts,
                blades: Vec::new(),
                edge_work: Vec::new(),
            },
            forces: None,
            positions: Vec::new(),
            pieces,
            initial_volume: self.initial_volume + other.initial_volume,
            removed_volume: self.removed_volume + other.removed_volume,
            judged,
            cuttable,
            masses,
            sleep: scene.solver.sleep.map(SleepState::new),
            recluster: scene.solver.recluster.map(Recluster::new),
        };
        island.solver.host().positions(&mut island.positions);
        island.judge_settings();
        let before = self
            .judged
            .warnings
            .iter()
            .chain(&other.judged.warnings)
            .cloned();
        island.judged.warnings.splice(0..0, before);
        Ok(island)
    }

    /// The bodies of both, ascending, and for each material of both the index of its body there.
    fn bodies_with(&self, other: &Self) -> (Vec<usize>, Vec<usize>) {
        let mut bodies = [&*self.bodies, &*other.bodies].concat();
        bodies.sort_unstable();
        let of = |island: &Self| -> Vec<usize> {
            let materials = island.body_of.iter();
            let index = |&body: &usize| bodies.partition_point(|&b| b < island.bodies[body]);
            materials.map(index).collect()
        };
        let body_of = [of(self), of(other)].concat();
        (bodies, body_of)
    }
}
