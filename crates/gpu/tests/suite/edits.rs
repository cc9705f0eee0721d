//! Edits of a body on the device: it stays equal to a twin that was edited in the same way.

use glam::{DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuContext, GpuError};
use incise_graph::{Clustering, ColorId, Coloring, Incidence};
use incise_mesh::{TetId, kuhn_box};
use incise_xpbd::{Collider, Pose, Solver, StepSettings};
use proptest::prelude::*;
use proptest::sample::Index;

use crate::measures::agree;
use crate::solver::{SOFT, clusters, schedules, settings, tiled};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar, free};

/// Density of [`SOFT`] and a quarter: what a corner gets of a tet.
const SHARE: f64 = 250.0;

#[derive(Clone, Debug)]
enum Edit {
    Push(Index, [i8; 3]),
    Attach(Index, bool, bool),
    Detach(Index),
    Fix(Index, bool),
    /// A tet is separated from its neighbors at one corner.
    Tear(Index, usize),
    /// A tet grows or shrinks.
    Resize(Index, i8),
    /// A tet is halved through an edge.
    Halve(Index),
    /// A tet is removed and the last one takes its slot.
    Delete(Index),
    /// A tet becomes a cluster of its own.
    Part(Index),
}

fn edit() -> impl Strategy<Value = Edit> {
    let any_index = any::<Index>;
    prop_oneof![
        (any_index(), any::<[i8; 3]>()).prop_map(|(p, v)| Edit::Push(p, v)),
        (any_index(), any::<bool>(), any::<bool>()).prop_map(|(p, h, r)| Edit::Attach(p, h, r)),
        any_index().prop_map(Edit::Detach),
        (any_index(), any::<bool>()).prop_map(|(p, f)| Edit::Fix(p, f)),
        (any_index(), 0..4usize).prop_map(|(t, k)| Edit::Tear(t, k)),
        (any_index(), -9..9i8).prop_map(|(t, s)| Edit::Resize(t, s)),
        any_index().prop_map(Edit::Halve),
        any_index().prop_map(Edit::Delete),
        any_index().prop_map(Edit::Part),
    ]
}

/// Twins with what is needed to edit them.
struct Edited {
    twins: Twins,
    form: ClusterMapping,
    clustering: Clustering,
    coloring: Coloring,
    /// Tet -> corners at rest.
    rest: Vec<[DVec3; 4]>,
}

impl Edited {
    fn tets(&self) -> usize {
        self.twins.host.tet_count()
    }

    /// Gives a tet a cluster and a color of its own; says which.
    fn part(&mut self, tet: usize) {
        let color = ColorId(u32::try_from(self.coloring.color_count()).unwrap());
        let cluster = self.clustering.new_cluster(tet);
        if cluster.index() < self.coloring.vertex_count() {
            self.coloring.set(cluster.index(), color);
        } else {
            self.coloring.push(color);
        }
        self.reschedule(&[tet], &[cluster.index()]);
    }

    fn reschedule(&mut self, tets: &[usize], clusters: &[usize]) {
        let tets: Vec<u32> = tets.iter().map(|&t| u32::try_from(t).unwrap()).collect();
        let clusters: Vec<_> = clusters
            .iter()
            .map(|&k| incise_graph::ClusterId::new(k))
            .collect();
        let Self {
            twins,
            clustering,
            coloring,
            ..
        } = self;
        twins
            .schedule
            .update(clustering, coloring, &tets, &clusters);
    }

    /// Gives particles the mass that their tets make.
    fn weigh(&mut self, particles: &[u32]) {
        let host = &self.twins.host;
        let masses: Vec<(usize, f64, Vec<usize>)> = particles
            .iter()
            .map(|p| {
                let has = |&t: &usize| host.tet_particles(t).contains(p);
                let star: Vec<usize> = (0..host.tet_count()).filter(has).collect();
                let mass = star.iter().map(|&t| SHARE * volume(self.rest[t])).sum();
                (*p as usize, mass, star)
            })
            .collect();
        self.twins.edit(|solver| {
            for (p, mass, star) in &masses {
                solver.set_mass_in_star(*p, *mass, star.iter().copied());
            }
        });
    }

    fn apply(&mut self, edit: &Edit) {
        let (particles, tets) = (self.twins.host.particle_count(), self.tets());
        match *edit {
            Edit::Push(p, velocity) => {
                let velocity = DVec3::from_array(velocity.map(f64::from)) / 256.0;
                self.twins
                    .edit(|solver| solver.set_velocity(p.index(particles), velocity));
            }
            Edit::Attach(p, moving, rigid) => {
                let compliance = if rigid { 0.0 } else { 1e-3 };
                let handle = u32::from(moving);
                self.twins.edit(|solver| {
                    let attached = solver.attach(p.index(particles), handle, compliance, 0.01);
                    attached.unwrap();
                });
            }
            Edit::Detach(p) => self.twins.edit(|solver| solver.detach(p.index(particles))),
            Edit::Fix(p, fixed) => {
                self.twins
                    .edit(|solver| solver.set_fixed(p.index(particles), fixed));
            }
            Edit::Tear(tet, corner) => {
                let tet = tet.index(tets);
                let mut corners = self.twins.host.tet_particles(tet);
                let old = corners[corner];
                corners[corner] = u32::try_from(particles).unwrap();
                self.twins.edit(|solver| {
                    solver.push_copy(old as usize);
                    solver.relink_tet(tet, corners);
                });
                self.weigh(&[old, corners[corner]]);
            }
            Edit::Resize(tet, size) => {
                let tet = tet.index(tets);
                let scale = 1.0 + 0.01 * f64::from(size);
                self.rest[tet] = self.rest[tet].map(|x| x * scale);
                let (corners, rest) = (self.twins.host.tet_particles(tet), self.rest[tet]);
                self.twins
                    .edit(|solver| solver.replace_tet(tet, corners, rest));
                self.weigh(&corners);
            }
            Edit::Halve(tet) => {
                let tet = tet.index(tets);
                let [a, b, c, d] = self.twins.host.tet_particles(tet);
                let [p, q, r, s] = self.rest[tet];
                let (new, middle) = (u32::try_from(particles).unwrap(), (p + q) / 2.0);
                let (one, other) = ([p, middle, r, s], [middle, q, r, s]);
                self.twins.edit(|solver| {
                    solver.push_particle_between(a as usize, b as usize, 0.5);
                    solver.replace_tet(tet, [a, new, c, d], one);
                    solver.push_tet([new, b, c, d], other, 0);
                });
                self.rest[tet] = one;
                self.rest.push(other);
                self.part(tets);
                self.weigh(&[a, b, c, d, new]);
            }
            Edit::Delete(tet) => {
                let (tet, last) = (tet.index(tets), tets - 1);
                let corners = self.twins.host.tet_particles(tet);
                self.clustering.remove(tet);
                if tet < last {
                    self.clustering.renumber(last, tet);
                }
                self.clustering.truncate(last);
                self.rest.swap_remove(tet);
                self.twins.edit(|solver| {
                    solver.move_tet(last, tet);
                    solver.truncate_tets(last);
                });
                self.reschedule(&[tet, last], &[]);
                self.weigh(&corners);
            }
            Edit::Part(tet) => {
                let tet = tet.index(tets);
                self.clustering.remove(tet);
                self.part(tet);
            }
        }
    }

    /// Makes the host solve in the order of the device.
    fn sync(&mut self) {
        let host = &self.twins.host;
        let corners = (0..host.tet_count()).map(|t| host.tet_particles(t));
        let incidence = Incidence::from_constraints(host.particle_count(), corners).unwrap();
        self.twins
            .schedule
            .check(&incidence)
            .expect("the edits keep it proper");
        self.twins.order = match self.form {
            ClusterMapping::Threads => self.twins.schedule.clone(),
            ClusterMapping::Workgroups => tiled(&incidence, &self.clustering, &self.coloring),
        };
    }
}

fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

fn handles(solver: &mut Solver<f32>) {
    solver.add_handle(Pose::at(DVec3::ZERO));
    solver.add_handle(Pose::at(DVec3::ONE));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn edits_are_applied(
        rounds in prop::collection::vec(prop::collection::vec(edit(), 1..6), 4),
    ) {
        let Some(gpu) = gpu("edits_are_applied") else { return Ok(()) };
        for form in FORMS {
            let far = run(gpu, form, &rounds);
            // As without edits: rounding in another order, of halves of tets as well.
            prop_assert!(far < 1e-5, "{form:?}: {far}");
        }
    }
}

/// Applies the edits of each round before some frames; returns the distance of the twins.
fn run(gpu: &'static GpuContext, form: (&str, ClusterMapping), rounds: &[Vec<Edit>]) -> f64 {
    let mesh = bar();
    let (clustering, coloring) = clusters(&mesh, form.0);
    let rest = (0..mesh.tets.len()).map(|t| mesh.corners(TetId::new(t)));
    let mut edited = Edited {
        twins: Twins::new(gpu, &mesh, SOFT, form, handles),
        form: form.1,
        clustering,
        coloring,
        rest: rest.collect(),
    };
    let mut far = 0.0;
    for (frame, edits) in (1..).zip(rounds) {
        for edit in edits {
            edited.apply(edit);
        }
        edited.sync();
        let pose = Pose::at(DVec3::ONE + dvec3(0.002, -0.003, 0.004) * f64::from(frame));
        for _ in 0..2 {
            edited.twins.device.move_handle(1, pose);
            edited.twins.host.move_handle(1, pose);
            edited.twins.step(&settings());
        }
        agree(&mut edited.twins.device);
        far = f64::max(far, edited.twins.apart());
    }
    far
}

/// A body that has moved on gets a new origin, and all positions are sent relative to it.
#[test]
fn a_body_that_moves_on_gets_a_new_origin() {
    let Some(gpu) = gpu("a_body_that_moves_on_gets_a_new_origin") else {
        return;
    };
    let speed = dvec3(40.0, 0.0, 0.0);
    let mut twins = Twins::new(gpu, &bar(), SOFT, FORMS[0], |solver| {
        free(solver);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        for p in 0..solver.particle_count() {
            solver.set_velocity(p, speed);
            if solver.position(p).x > 0.9 {
                let compliance = if p % 2 == 0 { 0.0 } else { 1e-3 };
                solver.attach(p, handle, compliance, 0.01).unwrap();
            }
        }
    });
    let mut settings = StepSettings {
        colliders: vec![Collider {
            velocity: dvec3(0.0, 0.0, 0.5),
            ..Collider::ground(-0.01, 0.0)
        }],
        ..settings()
    };
    let start = twins.host.origin();
    for frame in 1..=8 {
        let pose = Pose::at(speed * settings.time_step * f64::from(frame));
        twins.device.move_handle(0, pose);
        twins.host.move_handle(0, pose);
        twins.step(&settings);
        settings.colliders[0] = settings.colliders[0].moved(settings.time_step);
        // Rounding in another order, of numbers up to three times the size of the body.
        let far = twins.apart();
        assert!(far < 1e-5, "frame {frame}: {far}");
    }
    twins.step(&settings);
    assert_eq!(twins.device.cached_host().origin(), twins.host.origin());
    assert!(twins.host.origin().distance(start) > 1.0);
}

/// After a step that was an error, earlier edits are still applied.
#[test]
fn a_refused_step_loses_no_edits() {
    let Some(gpu) = gpu("a_refused_step_loses_no_edits") else {
        return;
    };
    let mesh = bar();
    let mut twins = Twins::new(gpu, &mesh, SOFT, FORMS[1], handles);
    twins.step(&settings());
    twins.edit(|solver| {
        let last = solver.particle_count() - 1;
        solver.attach(last, 1, 0.0, 0.0).unwrap();
        solver.set_velocity(3, DVec3::Z);
        solver.replace_tet(7, solver.tet_particles(7), mesh.corners(TetId::new(8)));
    });
    // Of another body, refused for the size of its clusters.
    let (other, _) = schedules(&kuhn_box([5, 5, 4], DVec3::ONE), "pressure:300");
    let error = twins.device.step(&other, &settings());
    assert!(matches!(error, Err(GpuError::Block { .. })));
    for _ in 0..3 {
        twins.step(&settings());
    }
    // A few frames of rounding in another order.
    assert!(twins.apart() < 1e-5);
}
