//! Bodies that threads join while the simulation runs, in any order with cuts, grabs, attachments and snapshots: they do
//! what bodies do that one solver had from the start, whatever solves them.

use glam::{DQuat, DVec3, dvec3};
use incise::mesh::kuhn_box;
use incise::scene::{
    AttachmentSpec, CuttingSpec, DistanceSpec, EndSpec, Method, Precision, Region, SolverSpec,
    StrokeSpec,
};
use incise::{Body, DistanceHandle, Grab, Simulation, SimulationBuilder, Snapshot};
use proptest::prelude::*;

/// What a program does between two frames. Bodies are counted modulo their number.
#[derive(Clone, Debug)]
enum Act {
    /// Ties two bodies by a thread of a part of its length at rest and a compliance.
    Tie(usize, usize, f64, f64),
    /// Cuts a body through its middle, across a direction.
    Cut(usize, [f64; 3]),
    /// Grabs the side of a body.
    Grab(usize),
    /// Moves all grabs and attachments.
    Pull([f64; 3]),
    /// Releases the first grab.
    Release,
    /// Attaches the top of a body.
    Hold(usize),
    /// Goes on for two frames, back, and on again.
    Again,
    Step,
}

fn act(is_free: bool) -> impl Strategy<Value = Act> {
    let point = || proptest::array::uniform3(-1.0..1.0);
    let compliance = prop_oneof![Just(0.0), 1e-5..1e-3];
    let hands = u32::from(!is_free);
    prop_oneof![
        4 => (0..4_usize, 1..4_usize, 0.99..1.05, compliance).prop_map(|(a, by, l, c)| Act::Tie(a, by, l, c)),
        2 => (0..4_usize, point()).prop_map(|(body, n)| Act::Cut(body, n)),
        2 * hands => (0..4_usize).prop_map(Act::Grab),
        2 * hands => point().prop_map(Act::Pull),
        hands => Just(Act::Release),
        hands => (0..4_usize).prop_map(Act::Hold),
        1 => Just(Act::Again),
        5 => Just(Act::Step),
    ]
}

/// A corner of a body at rest, of eight.
fn corner(body: usize, number: usize) -> [f64; 3] {
    let side = |axis: usize| if number >> axis & 1 == 0 { -0.5 } else { 0.5 };
    [2.0 * body as f64 + side(0), side(1), side(2)]
}

/// Threads in the order in which acts tie them. Each ends at particles of its own, so that their order does not matter.
fn threads(acts: &[Act], bodies: usize) -> Vec<(DistanceSpec, f64)> {
    let mut threads = Vec::new();
    for act in acts {
        if let Act::Tie(a, by, part, compliance) = *act {
            let (a, number) = (a % bodies, threads.len());
            // Never to itself; two corners are for the threads without effect.
            let b = (a + 1 + by % (bodies - 1)) % bodies;
            if number < 6 {
                let end = |body| EndSpec::new(body, corner(body, number));
                let rest = DVec3::from(corner(a, number)).distance(corner(b, number).into());
                let mut thread = DistanceSpec::new(end(a), end(b));
                (thread.compliance, thread.tension_only) = (compliance, true);
                threads.push((thread, part * rest));
            }
        }
    }
    threads
}

/// A simulation, and what a program holds of it.
struct Player {
    simulation: Simulation,
    /// The threads that were there from the start; empty if they are added.
    declared: Vec<DistanceHandle>,
    tied: usize,
    grabs: Vec<(Grab, DVec3)>,
    attachments: Vec<incise::AttachmentHandle>,
    /// Particles of a body at first.
    particles: usize,
}

/// Much longer than any distance: a thread of this length has no effect.
const SLACK: f64 = 1e6;

impl Player {
    /// Boxes in a row that turn and fly apart, `speed` times as fast as usual. `is_tied`: all are solved together and have
    /// all threads, without effect.
    fn new(
        bodies: usize,
        mut builder: SimulationBuilder,
        is_tied: bool,
        speed: f64,
        threads: &[(DistanceSpec, f64)],
    ) -> Self {
        // Its corners are particles, so no cut makes one that is nearer to them.
        let mesh = kuhn_box([3; 3], DVec3::ONE);
        let particles = mesh.positions.len();
        for body in 0..bodies {
            let position = DVec3::from(corner(body, 0));
            builder.add_body(Body::new(mesh.clone()).position(position));
        }
        let mut declared = Vec::new();
        if is_tied {
            let slack = |thread: &DistanceSpec| {
                thread.clone().with(|thread| {
                    (thread.length, thread.tension_only) = (Some(SLACK), true);
                })
            };
            for (thread, _) in threads {
                declared.push(builder.add_distance(slack(thread)));
            }
            for body in 1..bodies {
                let end = |body, number| EndSpec::new(body, corner(body, number));
                let thread = DistanceSpec::new(end(body - 1, 7), end(body, 6));
                builder.add_distance(slack(&thread));
            }
        }
        let mut simulation = builder.build().unwrap();
        simulation
            .set_velocities(|x| speed * dvec3(0.15 * x.x, 0.2 * x.z, -0.2 * x.y))
            .unwrap();
        Self {
            simulation,
            declared,
            tied: 0,
            grabs: Vec::new(),
            attachments: Vec::new(),
            particles,
        }
    }

    /// The mean of the particles that a body had at first.
    fn middle(&self, body: usize) -> DVec3 {
        let of_body = body * self.particles..(body + 1) * self.particles;
        self.simulation.positions()[of_body].iter().sum::<DVec3>() / self.particles as f64
    }

    /// Carries out an act; `middle` is the middle of a body in all simulations that are compared.
    fn play(&mut self, act: &Act, bodies: usize, threads: &[(DistanceSpec, f64)], middle: DVec3) {
        let simulation = &mut self.simulation;
        match *act {
            Act::Tie(..) => {
                let Some((thread, length)) = threads.get(self.tied) else {
                    return;
                };
                if let Some(&handle) = self.declared.get(self.tied) {
                    let compliance = thread.compliance;
                    simulation
                        .set_distance(handle, *length, compliance)
                        .unwrap();
                } else {
                    let (mesh, numbers) = (simulation.mesh().clone(), simulation.piece_numbers());
                    let positions = simulation.positions().to_vec();
                    let thread = thread.clone().with(|thread| thread.length = Some(*length));
                    simulation.add_distance(&thread).unwrap();
                    assert_eq!(
                        (&mesh, numbers),
                        (simulation.mesh(), simulation.piece_numbers())
                    );
                    let joined = [thread.from.body, thread.to.body]
                        .map(|body| incise::mesh::ParticleId::new(body * self.particles))
                        .map(|particle| simulation.location_of(particle).0);
                    assert_eq!(joined[0], joined[1]);
                    // Single precision rounds to another origin.
                    let moved = farthest(&positions, simulation.positions());
                    assert!(moved < 1e-5, "a join moved a particle by {moved}");
                }
                self.tied += 1;
            }
            Act::Cut(_, normal) => {
                let normal = (DVec3::from(normal) + dvec3(0.01, 0.02, 2.0)).normalize();
                let u = normal.any_orthonormal_vector();
                let [u, v] = [u, normal.cross(u)].map(|side| (0.8 * side).to_array());
                let middle = middle + dvec3(0.013, 0.017, 0.019);
                simulation
                    .cut(StrokeSpec::rectangle(0, middle.to_array(), u, v))
                    .unwrap();
                simulation.step().unwrap();
            }
            Act::Grab(_) => {
                let point = middle + 0.4 * DVec3::Y;
                let grab = simulation.grab(point, 0.25, 0.0).unwrap();
                self.grabs.extend(grab.map(|grab| (grab, point)));
            }
            Act::Pull(by) => {
                let by = 0.02 * DVec3::from(by);
                for (grab, point) in &mut self.grabs {
                    *point += by;
                    simulation.move_grab(*grab, *point).unwrap();
                }
                for &attachment in &self.attachments {
                    simulation
                        .move_attachment(attachment, by, DQuat::from_rotation_z(by.x))
                        .unwrap();
                }
            }
            Act::Release => {
                if !self.grabs.is_empty() {
                    let (grab, _) = self.grabs.remove(0);
                    simulation.release(grab).unwrap();
                    assert!(simulation.move_grab(grab, DVec3::ZERO).is_err());
                }
            }
            Act::Hold(body) => {
                let top = Region::half_space([0.0, 0.0, 0.3], [0.0, 0.0, 1.0]);
                let top = AttachmentSpec::new(body % bodies, vec![top]);
                // Refused where an earlier attachment or a grab has particles of it.
                self.attachments.extend(simulation.add_attachment(&top));
            }
            Act::Again => {
                let before = simulation.snapshot().unwrap();
                let there = self.go_on();
                self.simulation.restore(&before).unwrap();
                assert!(there == self.go_on(), "a snapshot continued otherwise");
                self.simulation.restore(&before).unwrap();
            }
            Act::Step => {
                simulation.step().unwrap();
            }
        }
        self.simulation.read_back().unwrap();
        // A device gets an edit with the next frame.
        if self.simulation.report().backend == "cpu" || matches!(act, Act::Step | Act::Cut(..)) {
            let checked = self.simulation.check();
            assert!(checked.is_ok(), "after {act:?}: {checked:?}");
        }
        assert!(self.simulation.positions().iter().all(|x| x.is_finite()));
    }

    /// The positions after two frames.
    fn go_on(&mut self) -> Vec<DVec3> {
        self.simulation.step().unwrap();
        self.simulation.step().unwrap();
        self.simulation.read_back().unwrap();
        self.simulation.positions().to_vec()
    }
}

/// The center of mass of bodies of one density.
fn center(simulation: &Simulation) -> DVec3 {
    mean(simulation, simulation.positions())
}

/// The mean of vectors of all particles by mass.
fn mean(simulation: &Simulation, vectors: &[DVec3]) -> DVec3 {
    let masses = simulation.masses();
    let moments = vectors.iter().zip(&masses).map(|(x, mass)| *mass * *x);
    moments.sum::<DVec3>() / masses.iter().sum::<f64>()
}

fn farthest(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distances = a.iter().zip(b).map(|(a, b)| a.distance(*b));
    distances.fold(0.0, f64::max)
}

/// The body that an act is about, if it is about one.
fn body_of(act: &Act, bodies: usize) -> usize {
    match *act {
        Act::Cut(body, _) | Act::Grab(body) | Act::Hold(body) => body % bodies,
        _ => 0,
    }
}

/// A builder with settings of a method.
fn builder(method: Method, precision: Precision, substeps: u32) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    // The work of improvement in a frame is limited by island, so meshes of joined bodies differ for some frames.
    builder
        .threads(1)
        .cutting(CuttingSpec::default().with(|spec| spec.improve = false))
        .solver(SolverSpec::of(method).with(|spec| {
            spec.substeps = substeps.into();
            spec.precision = precision;
        }));
    builder
}

/// Plays acts to bodies that are joined while the simulation runs, and to bodies that were tied from the start. Jacobi does
/// not depend on the order of constraints but for rounding, so both have the same tets, the same pieces, and positions that
/// differ as if the first velocities had been rounded otherwise.
fn joined_equal_tied(bodies: usize, acts: &[Act]) {
    let threads = threads(acts, bodies);
    let player = |is_tied, speed| {
        let builder = builder(Method::Jacobi, Precision::F64, 4);
        Player::new(bodies, builder, is_tied, speed, &threads)
    };
    let (mut joined, mut tied) = (player(false, 1.0), player(true, 1.0));
    let mut disturbed = player(true, 1.0 + 1e-13);
    let mut sensitivity = 0.0_f64;
    for act in acts {
        let middle = joined.middle(body_of(act, bodies));
        for player in [&mut joined, &mut tied, &mut disturbed] {
            player.play(act, bodies, &threads, middle);
        }
        let [a, b] = [&joined.simulation, &tied.simulation];
        for other in [a, &disturbed.simulation] {
            assert_eq!(other.mesh().tets.len(), b.mesh().tets.len());
            let mut pairs = other.mesh().tets.iter().zip(&b.mesh().tets);
            assert_eq!(pairs.position(|(a, b)| a != b), None, "after {act:?}");
            assert_eq!(other.piece_numbers(), b.piece_numbers());
            let rest = farthest(&other.mesh().positions, &b.mesh().positions);
            assert!(rest < 1e-9, "after {act:?}: {rest:e} at rest");
        }
        assert_eq!(joined.grabs.len(), tied.grabs.len());
        assert_eq!(joined.attachments, tied.attachments);
        // In slivers the differences grow by orders in a substep, and go again.
        sensitivity = sensitivity.max(farthest(disturbed.simulation.positions(), b.positions()));
        let apart = farthest(a.positions(), b.positions());
        assert!(sensitivity < 1e-4, "after {act:?}: {sensitivity:e}");
        let most = f64::max(1e-9, 100.0 * sensitivity);
        assert!(apart < most, "after {act:?}: {apart:e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn joined_bodies_are_bodies_tied_from_the_start(
        bodies in 2..5_usize,
        acts in proptest::collection::vec(act(false), 8..20),
    ) {
        joined_equal_tied(bodies, &acts);
    }
}

/// Between the first two cuts lie particles in the plane of the first that are not marked as such; rounding decided on which
/// side of the third they were.
#[test]
fn rounding_does_not_choose_sides_of_a_cut_beside_an_earlier_one() {
    let cuts = [
        [0.6441783792399297, 0.4187466922743952, 0.7939300996261225],
        [0.0, 0.8099102713015045, -0.9023106840952457],
        [0.42710198820560147, 0.5387095674273501, 0.5910978841633808],
    ];
    let ties = [(0, 0.99), (0, 0.99), (3, 1.000_382_267_674_325_3)];
    let cuts = cuts.map(|normal| Act::Cut(1, normal));
    let ties = ties.map(|(body, part)| Act::Tie(body, 1, part, 0.0));
    joined_equal_tied(2, &[cuts, ties].concat());
}

/// The particles of one stroke near its meeting with another lie in the plane of the other, so that rounding decided on
/// which side of it the stroke ends.
#[test]
fn rounding_does_not_choose_the_side_on_which_a_stroke_ends() {
    let cuts = [
        [
            0.388_884_907_133_127_57,
            0.114_453_014_012_486,
            -0.212_108_082_678_001_85,
        ],
        [-0.455_940_954_653_700_7, 0.397_137_970_764_463_44, 0.0],
        [-0.615_607_694_988_086_5, 0.0, 0.0],
        [0.0, 0.626_125_838_015_265_7, 0.708_871_808_958_560_6],
    ];
    let [a, b, c, d] = cuts.map(|normal| Act::Cut(0, normal));
    let tie = Act::Tie(0, 1, 0.99, 0.0);
    joined_equal_tied(4, &[a, b, c, tie.clone(), tie, d]);
}

/// Which part of a split piece keeps its number does not depend on what else is solved with it.
#[test]
fn bodies_beside_a_piece_do_not_choose_its_number() {
    let cuts = [
        (
            0,
            [
                -0.962_108_444_607_719,
                -0.587_310_092_899_085_3,
                -0.380_652_219_017_513_2,
            ],
        ),
        (0, [0.0, 0.641_967_443_557_670_9, 0.0]),
        (
            0,
            [
                0.462_589_418_427_962_5,
                -0.117_836_786_306_852_82,
                -0.266_798_338_455_811_2,
            ],
        ),
        (1, [-0.347_749_953_479_221_05, 0.0, 0.0]),
        (
            1,
            [
                0.922_502_884_967_860_1,
                -0.733_531_707_395_178_6,
                0.420_859_545_604_920_17,
            ],
        ),
        (
            0,
            [
                0.143_038_507_217_570_78,
                0.274_564_905_960_997_5,
                -0.492_341_779_377_843_35,
            ],
        ),
    ];
    let [a, b, c, d, e, f] = cuts.map(|(body, normal)| Act::Cut(body, normal));
    joined_equal_tied(2, &[a, Act::Step, b, Act::Step, c, d, e, f]);
}

/// Plays acts without hands; the center of mass moves on as at the start, with the same momentum. Where a cut lends mass from
/// particle to particle, the center is another one, but not the momentum.
fn keeps_momentum(bodies: usize, acts: &[Act], builder: SimulationBuilder, tolerance: f64) {
    let threads = threads(acts, bodies);
    let mut player = Player::new(bodies, builder, false, 1.0, &threads);
    let mut states: Vec<(Snapshot, Vec<DVec3>)> = Vec::new();
    let (mut start, mut masses) = (center(&player.simulation), player.simulation.masses());
    player.play(&Act::Step, bodies, &threads, DVec3::ZERO);
    let way = center(&player.simulation) - start;
    let time_step = player.simulation.time_step();
    for act in acts {
        let middle = player.middle(body_of(act, bodies));
        player.play(act, bodies, &threads, middle);
        let simulation = &player.simulation;
        let speed = mean(simulation, &simulation.velocities());
        let frames = simulation.next_frame() as f64;
        // What rounding adds to a velocity stays in it.
        let off = (speed * time_step - way).length();
        assert!(
            off < tolerance * frames,
            "after {act:?}: {off:e} by velocities"
        );
        let now = center(simulation) - way * frames;
        if masses == simulation.masses() {
            let off = (now - start).length();
            assert!(off < tolerance * frames, "after {act:?}: {off:e}");
        } else {
            masses = simulation.masses();
            start = now;
        }
        states.push((
            player.simulation.snapshot().unwrap(),
            player.simulation.positions().to_vec(),
        ));
    }
    // Back through all joins.
    for (state, positions) in states.iter().rev() {
        player.simulation.restore(state).unwrap();
        assert!(farthest(player.simulation.positions(), positions) == 0.0);
        player.play(&Act::Step, bodies, &threads, DVec3::ZERO);
    }
}

/// Ties, cuts and snapshots without hands.
fn acts_of_free_bodies() -> impl Strategy<Value = (usize, Vec<Act>)> {
    (2..5_usize, proptest::collection::vec(act(true), 6..14))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, failure_persistence: None, ..ProptestConfig::default() })]

    /// In single precision each of 8 substeps rounds positions of up to 8 m by 2.4e-7 m, in the first frame, whose motion
    /// is continued, and in each later one.
    #[test]
    fn gauss_seidel_keeps_momentum_through_joins(
        (bodies, acts) in acts_of_free_bodies(),
        single in any::<bool>(),
    ) {
        let (precision, tolerance) = if single { (Precision::F32, 4e-6) } else { (Precision::F64, 1e-11) };
        keeps_momentum(bodies, &acts, builder(Method::GaussSeidel, precision, 8), tolerance);
    }

    /// VBD keeps momentum to the error that its sweeps leave.
    #[test]
    fn vbd_goes_on_through_joins((bodies, acts) in acts_of_free_bodies(), two_level in any::<bool>()) {
        let solver = SolverSpec::of(Method::Vbd).with(|spec| {
            spec.two_level = two_level;
            spec.precision = Precision::F64;
        });
        let mut builder = Simulation::builder();
        builder.threads(1).solver(solver);
        keeps_momentum(bodies, &acts, builder, 1e-4);
    }
}

#[cfg(feature = "gpu")]
proptest! {
    #![proptest_config(ProptestConfig { cases: 4, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_device_keeps_momentum_through_joins((bodies, acts) in acts_of_free_bodies()) {
        let Some(gpu) = crate::gpu::gpu("a_device_keeps_momentum_through_joins") else {
            return Ok(());
        };
        let solver = SolverSpec::of(Method::GaussSeidel).with(|spec| {
            spec.substeps = 4.into();
            spec.backend = incise::scene::Backend::Gpu;
        });
        let mut builder = Simulation::builder();
        builder.device(gpu).solver(solver);
        keeps_momentum(bodies, &acts, builder, 4e-6);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, failure_persistence: None, ..ProptestConfig::default() })]

    /// Without cuts, the joined mesh is the mesh of a scene that had all bodies, and so is its partition. Where contact is
    /// declared for all pairs, a body that is added before the first frame does to the bit what one of the scene does.
    /// After some frames the origin differs, and contacts amplify that rounding: momentum is kept.
    #[test]
    fn an_added_body_touches_the_others_like_a_body_of_the_start(
        frames in 0..6,
        places in proptest::collection::vec((-0.3..0.3, 1.05..1.1), 1..4),
        speed in 0.5..2.0_f64,
    ) {
        let mesh = kuhn_box([3; 3], DVec3::ONE);
        let body = |i: usize| {
            let (aside, up) = places[i];
            Body::new(mesh.clone()).position(dvec3(aside, 0.1 * aside, (i + 1) as f64 * up))
        };
        let play = |is_added: bool| {
            let mut builder = builder(Method::GaussSeidel, Precision::F64, 5);
            builder.contact(incise::scene::ContactSpec::default());
            builder.add_body(Body::new(mesh.clone()));
            if !is_added {
                (0..places.len()).for_each(|i| { builder.add_body(body(i)); });
            }
            let mut simulation = builder.build().unwrap();
            for _ in 0..frames {
                simulation.step().unwrap();
            }
            if is_added {
                for i in 0..places.len() {
                    simulation.add_body(body(i)).unwrap();
                    simulation.check().unwrap();
                }
            }
            simulation.set_velocities(|x| DVec3::Z * if x.z > 1.02 { -speed } else { 0.0 }).unwrap();
            let (mut contacts, start) = (0, center(&simulation));
            let mut way = DVec3::ZERO;
            for frame in 1..=25 {
                let report = simulation.step().unwrap();
                contacts += report.contact.as_ref().map_or(0, |contact| contact.active);
                simulation.check().unwrap();
                let moved = center(&simulation) - start;
                if frame == 1 {
                    way = moved;
                }
                let off = (moved - way * f64::from(frame)).length();
                assert!(off < 1e-11, "frame {frame}: {off:e}");
            }
            assert!(contacts > 0, "the bodies met");
            simulation.positions().to_vec()
        };
        let (added, declared) = (play(true), play(false));
        if frames == 0 {
            assert!(added == declared);
        }
    }
}
