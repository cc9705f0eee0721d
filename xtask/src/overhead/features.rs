//! Scenes of the comparison: a bare one, and for each feature one with it declared but idle, and one with it in use.
//!
//! The bare scene is a beam of soft material that floats at rest, in two substeps of one iteration: no forces, no fixed
//! particles, no reports, no limit of kappa. A case names its base scene: usually the bare one. A feature that requires
//! another one is compared with that alone.

use incise::Scene;
use incise::scene::{
    AttachmentSpec, BodySpec, ColliderSpec, ContactSpec, DistanceSpec, EndSpec, GroundSpec, Method,
    Precision, Quantity, ReclusterSpec, Region, ReportSpec, ShapeSpec, SleepSpec, SolverSpec,
    StrokeSpec, Substeps, TetSolve,
};

/// State of a feature in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    /// Base of comparisons.
    Base,
    /// Declared, but without effect.
    Idle,
    /// Declared and in use.
    Used,
}

impl State {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Idle => "idle",
            Self::Used => "used",
        }
    }
}

/// A scene of the comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case {
    pub(crate) feature: &'static str,
    pub(crate) state: State,
    /// Feature of the base scene.
    pub(crate) base: &'static str,
    /// Description of the scene.
    pub(crate) what: &'static str,
    pub(crate) change: fn(&mut Scene),
}

impl Case {
    /// Unique among the cases.
    pub(crate) fn id(&self) -> String {
        id(self.feature, self.state.name())
    }

    pub(crate) fn scene(&self, tets: usize) -> Scene {
        let mut scene = bare(tets);
        (self.change)(&mut scene);
        scene
    }
}

/// The name of a case.
pub(crate) fn id(feature: &str, state: &str) -> String {
    format!("{}-{state}", feature.replace(' ', "-"))
}

/// Name of the base without features.
pub(crate) const BARE: &str = "bare";

fn bare(tets: usize) -> Scene {
    let mut scene = Scene::default();
    scene.solver.substeps = Substeps::Fixed(2);
    scene.solver.kappa_limit = f64::INFINITY;
    scene.body.push(beam(tets, 0.0));
    scene
}

/// Beam of length 1 along x, with its center at a height.
fn beam(tets: usize, height: f64) -> BodySpec {
    BodySpec::default().with(|spec| {
        spec.shape = Some(ShapeSpec::new("beam", tets));
        spec.scale = 1.0;
        spec.position = [0.0, 0.0, height];
        spec.young_modulus = 1e4;
        spec.poisson_ratio = 0.45;
        spec.density = 1000.0;
    })
}

/// Distance that is never reached, in m.
const FAR: f64 = 1e3;
/// Frame that is never reached.
const LATE: u64 = 1_000_000;
/// The end of the beam.
const END: Region = Region::half_space([-0.49, 0.0, 0.0], [-1.0, 0.0, 0.0]);

fn handle(frames: [u64; 2], way: f64, compliance: f64) -> AttachmentSpec {
    AttachmentSpec::new(0, vec![END]).with(|spec| {
        spec.frames = frames;
        spec.path = vec![[0.0; 3], [way, 0.0, 0.0]];
        spec.compliance = compliance;
    })
}

fn ball(at: f64, velocity: f64) -> ColliderSpec {
    ColliderSpec::sphere([0.0, 0.0, at], 0.2)
        .with_friction(0.3)
        .with_velocity([velocity, 0.0, 0.0])
}

fn link(tension_only: bool, length: Option<f64>) -> DistanceSpec {
    let end = |x| EndSpec::new(0, [x, 0.125, 0.125]);
    DistanceSpec::new(end(-0.5), end(0.5)).with(|spec| {
        spec.length = length;
        spec.tension_only = tension_only;
    })
}

/// Two beams, one above the other, held together by a rod.
fn two_linked(scene: &mut Scene) {
    let mut second = scene.body[0].clone();
    second.position = [0.0, 0.0, 0.5];
    scene.body.push(second);
    scene.distance.push(DistanceSpec::new(
        EndSpec::new(0, [0.0, 0.0, 0.125]),
        EndSpec::new(1, [0.0, 0.0, 0.375]),
    ));
}

fn plane(snap: f64) -> StrokeSpec {
    StrokeSpec::plane(LATE, [0.013, 0.0, 0.0], [1.0, 0.0, 0.0]).with_snap(snap)
}

/// A blade that moves beside the beam.
fn blade(frames: [u64; 2]) -> StrokeSpec {
    StrokeSpec::sweep(
        frames,
        vec![[0.0, 2.0, -1.0], [0.0, 2.0, 1.0]],
        vec![[0.0; 3], [0.0, 1.0, 0.0]],
    )
}

fn report(quantity: Quantity, every: u64) -> ReportSpec {
    ReportSpec::default().with(|spec| {
        spec.every = every;
        spec.quantities = vec![quantity];
    })
}

/// All scenes, bases first.
pub(crate) fn cases() -> Vec<Case> {
    use State::{Base, Idle, Used};
    let case = |feature, state, what, change: fn(&mut Scene)| Case {
        feature,
        state,
        base: BARE,
        what,
        change,
    };
    let with = |base, case| Case { base, ..case };
    vec![
        case(BARE, Base, "a floating beam", |_| ()),
        case("two linked bodies", Base, "of one material", two_linked),
        case("gravity", Idle, "zero", |s| {
            s.world.gravity = Some([0.0; 3]);
        }),
        case("gravity", Used, "9.81 m/s²", |s| {
            s.world.gravity = Some([0.0, 0.0, -9.81]);
        }),
        case("ground", Idle, "far below", |s| {
            s.world.ground = Some(GroundSpec::default().with(|spec| {
                spec.height = -FAR;
                spec.friction = 0.5;
            }));
        }),
        case("ground", Used, "in the lowest layer of the beam", |s| {
            s.world.ground = Some(GroundSpec::default().with(|spec| {
                spec.height = -0.1249;
                spec.friction = 0.5;
            }));
        }),
        case("collider", Idle, "a ball far away", |s| {
            s.collider.push(ball(FAR, 0.0));
        }),
        case("collider", Used, "a ball in contact", |s| {
            s.collider.push(ball(0.324, 0.0));
        }),
        case("moving collider", Used, "a ball that moves far away", |s| {
            s.collider.push(ball(FAR, 1.0));
        }),
        case("fixed particles", Idle, "a region without particles", |s| {
            s.body[0].fixed.push(Region::Particles(Vec::new()));
        }),
        case("fixed particles", Used, "one end", |s| {
            s.body[0].fixed.push(END);
        }),
        case("attachment", Idle, "one end, not yet moving", |s| {
            s.attachment.push(handle([LATE, LATE + 1], 0.1, 0.0));
        }),
        case("attachment", Used, "one end, moving", |s| {
            s.attachment.push(handle([0, 1000], 0.01, 0.0));
        }),
        case("soft handle", Used, "one end, moving", |s| {
            s.attachment.push(handle([0, 1000], 0.01, 1e-4));
        }),
        case("distance", Idle, "a slack thread", |s| {
            s.distance.push(link(true, Some(2.0)));
        }),
        case("distance", Used, "a rod", |s| {
            s.distance.push(link(false, None));
        }),
        case("contact", Idle, "a beam that touches nothing", |s| {
            s.contact = Some(ContactSpec::default());
        }),
        with(
            "two linked bodies",
            case("contact", Used, "two beams that press on each other", |s| {
                let mut second = s.body[0].clone();
                second.position = [0.0, 0.0, 0.2495];
                s.body.push(second);
                s.contact = Some(ContactSpec::default());
            }),
        ),
        case("volume constraints", Used, "one a tet", |s| {
            s.body[0].volume_compliance = Some(1e-7);
        }),
        case("damping", Used, "0.01 s", |s| s.body[0].damping = 0.01),
        with(
            "two linked bodies",
            case("other stiffness", Used, "a second Young's modulus", |s| {
                two_linked(s);
                s.body[1].young_modulus *= 2.0;
            }),
        ),
        with(
            "two linked bodies",
            case("other material", Used, "a second Poisson's ratio", |s| {
                two_linked(s);
                s.body[1].poisson_ratio = 0.3;
            }),
        ),
        case("plane stroke", Idle, "not due, snapping off", |s| {
            s.stroke.push(plane(0.0));
        }),
        with(
            "plane stroke",
            case("snapping", Idle, "of a plane that is not due", |s| {
                s.stroke.push(plane(0.1));
            }),
        ),
        case("blade", Idle, "not due", |s| {
            s.stroke.push(blade([LATE, LATE + 9]));
        }),
        case("blade", Used, "moving beside the beam", |s| {
            s.stroke.push(blade([0, 1000]));
        }),
        case("report residual", Idle, "in frame 0 only", |s| {
            s.report = report(Quantity::Residual, LATE);
        }),
        case("report residual", Used, "every frame", |s| {
            s.report = report(Quantity::Residual, 1);
        }),
        case("report energy", Idle, "in frame 0 only", |s| {
            s.report = report(Quantity::Energy, LATE);
        }),
        case("report energy", Used, "every frame", |s| {
            s.report = report(Quantity::Energy, 1);
        }),
        case("report volume", Idle, "in frame 0 only", |s| {
            s.report = report(Quantity::Volume, LATE);
        }),
        case("report volume", Used, "every frame", |s| {
            s.report = report(Quantity::Volume, 1);
        }),
        case("report speed", Used, "every frame", |s| {
            s.report = report(Quantity::Speed, 1);
        }),
        case("report kappa", Used, "every frame", |s| {
            s.report = report(Quantity::Kappa, 1);
        }),
        case("sleep", Idle, "awake, at rest for 1000 s", |s| {
            s.solver.sleep = Some(SleepSpec::new(1e-3, 1000.0));
        }),
        case("sleep", Used, "asleep after a frame", |s| {
            s.solver.sleep = Some(SleepSpec::new(1e-3, 1e-3));
        }),
        case("iterations", Used, "2 a substep", |s| {
            s.solver.iterations = 2;
        }),
        case("relaxation", Used, "0.9", |s| s.solver.relaxation = 0.9),
        case("double precision", Used, "f64", |s| {
            s.solver.precision = Precision::F64;
        }),
        case("sequential form", Used, "as in the paper", |s| {
            s.solver.tet_solve = TetSolve::Sequential;
        }),
        case("jacobi", Used, "1 iteration", |s| {
            s.solver.method = Method::Jacobi;
            s.solver.relaxation = 0.1;
        }),
        case("chebyshev", Used, "1 iteration", |s| {
            s.solver.method = Method::Chebyshev;
            s.solver.relaxation = 0.1;
        }),
        case("vbd", Used, "one substep of 20 iterations", |s| {
            s.solver = SolverSpec::of(Method::Vbd);
        }),
        case("kappa limit", Idle, "1e9, nothing is softened", |s| {
            s.solver.kappa_limit = 1e9;
        }),
        case("kappa limit", Used, "1e-6, all are softened", |s| {
            s.solver.kappa_limit = 1e-6;
        }),
        case("substeps auto", Used, "which takes 2 as well", |s| {
            s.solver.substeps = Substeps::Auto;
            s.solver.method = Method::GaussSeidel;
            s.solver.max_substeps = 2;
            s.body[0].young_modulus = 1e8;
        }),
        case("recluster", Idle, "nothing is worn", |s| {
            s.solver.recluster = Some(ReclusterSpec::default().with(|spec| {
                spec.threshold = 1.25;
                spec.frames = std::num::NonZeroU32::MIN;
            }));
        }),
        case("no merging", Used, "clusters of cut tets stay apart", |s| {
            s.solver.merge_clusters = false;
        }),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each case has another id, its base is there, and its scene is not that of its base.
    #[test]
    fn cases_are_distinct() {
        let cases = cases();
        let mut ids: Vec<_> = cases.iter().map(Case::id).collect();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), cases.len());
        for case in &cases {
            let first = cases.iter().find(|other| other.feature == case.base);
            let base = first.expect("the base is a case").scene(100);
            if case.state != State::Base {
                assert_ne!(case.scene(100), base, "{}", case.id());
            }
        }
    }
}
