//! Geometry of obstacles, ground and blade: triangles and planes relative to the eye.
//!
//! Rebuilt for each image: obstacles move, and there are a few thousand triangles at most. Round shapes have enough
//! facets to look smooth at usual sizes. Infinite planes are drawn as patches that fade out.

use glam::{DQuat, DVec3, Vec3};
use incise::scene::{ColliderSpec, RotationSpec};

use crate::RenderScene;
use crate::palette::nice;
use crate::view::{View, single};

/// sRGB and gloss of obstacles and of blades.
const STONE: [u8; 4] = [150, 154, 160, 70];
const STEEL: [u8; 4] = [168, 174, 184, 255];

/// Facets around round obstacles.
const AROUND: usize = 48;
/// Facets around a blade.
const AROUND_BLADE: usize = 12;
/// Radius of a blade and of the patch of the ground, in diagonals of the bodies' box.
const BLADE: f64 = 0.006;
const PATCH: f64 = 2.2;

/// A corner of a triangle.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "gpu", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[repr(C)]
pub(crate) struct PropCorner {
    /// Position relative to the eye.
    pub(crate) position: [f32; 3],
    pub(crate) normal: [f32; 3],
    /// sRGB and gloss.
    pub(crate) color: [u8; 4],
}

/// Patch of a plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    /// Center relative to the eye.
    pub(crate) center: Vec3,
    pub(crate) radius: f32,
    /// Grid axes; their cross product is the normal.
    pub(crate) u: Vec3,
    pub(crate) v: Vec3,
    /// Offsets along the axes that put grid lines at multiples of the spacing.
    pub(crate) offsets: [f32; 2],
    pub(crate) spacing: f32,
    pub(crate) opacity: f32,
    /// True if it receives contact shadows.
    pub(crate) ground: bool,
}

/// Drawn geometry other than bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct Props {
    /// Three corners per triangle.
    pub(crate) corners: Vec<PropCorner>,
    /// Planes, the farthest first.
    pub(crate) planes: Vec<Plane>,
}

impl Props {
    pub(crate) fn new(render_scene: &RenderScene, view: &View) -> Self {
        let mut props = Self::default();
        let [low, high] = render_scene.start();
        let (middle, size) = ((low + high) * 0.5, (high - low).length().max(1e-6));
        let time = render_scene.time();
        if let Some(ground) = render_scene.ground() {
            let point = DVec3::Z * ground.height;
            props.plane(view, point, DVec3::Z, middle, size, true);
        }
        for obstacle in render_scene.obstacles() {
            props.obstacle(view, obstacle, time, middle, size);
        }
        for blade in render_scene.blades().filter(|blade| blade.len() > 1) {
            props.tube(view, blade, BLADE * size, AROUND_BLADE, STEEL);
        }
        let distance = |plane: &Plane| plane.center.length();
        props
            .planes
            .sort_by(|a, b| distance(b).total_cmp(&distance(a)));
        props
    }

    fn obstacle(
        &mut self,
        view: &View,
        obstacle: &ColliderSpec,
        time: f64,
        middle: DVec3,
        size: f64,
    ) {
        let at = |x: [f64; 3], velocity: [f64; 3]| {
            DVec3::from_array(x) + DVec3::from_array(velocity) * time
        };
        match *obstacle {
            ColliderSpec::Plane {
                point,
                normal,
                velocity,
                ..
            } => {
                let normal = DVec3::from_array(normal).normalize();
                self.plane(view, at(point, velocity), normal, middle, size, false);
            }
            ColliderSpec::Sphere {
                center,
                radius,
                velocity,
                ..
            } => {
                let center = at(center, velocity);
                self.tube(view, &[center, center], radius, AROUND, STONE);
            }
            ColliderSpec::Capsule {
                ends,
                radius,
                velocity,
                ..
            } => {
                let ends = ends.map(|end| at(end, velocity));
                self.tube(view, &ends, radius, AROUND, STONE);
            }
            ColliderSpec::Box {
                center,
                half_extents,
                rotation,
                velocity,
                ..
            } => {
                let turn = rotation.map_or(DQuat::IDENTITY, turned);
                let half = DVec3::from_array(half_extents);
                self.cuboid(view, at(center, velocity), half, turn);
            }
            // A kind that the renderer does not know acts unseen.
            _ => {}
        }
    }

    /// Adds a patch of a plane around the point nearest to the center of the bodies.
    fn plane(
        &mut self,
        view: &View,
        point: DVec3,
        normal: DVec3,
        middle: DVec3,
        size: f64,
        ground: bool,
    ) {
        let center = middle - normal * normal.dot(middle - point);
        // Grid axis along x for a floor.
        let aside = if normal.z.abs() > 0.9 {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let u = aside.cross(normal).normalize();
        let v = normal.cross(u);
        let spacing = nice(size * 0.15);
        let offset = |axis: DVec3| single(view.eye.dot(axis).rem_euclid(spacing));
        let in_front = normal.dot(view.eye - point) > 0.0;
        let opacity = if ground { 0.55 } else { 0.25 };
        self.planes.push(Plane {
            center: view.relative(center),
            radius: single(size * PATCH),
            u: u.as_vec3(),
            v: v.as_vec3(),
            offsets: [offset(u), offset(v)],
            spacing: single(spacing),
            opacity: if in_front { opacity } else { 0.2 * opacity },
            ground,
        });
    }

    fn corner(&mut self, view: &View, position: DVec3, normal: DVec3, color: [u8; 4]) {
        self.corners.push(PropCorner {
            position: view.relative(position).to_array(),
            normal: normal.as_vec3().to_array(),
            color,
        });
    }

    fn cuboid(&mut self, view: &View, center: DVec3, half: DVec3, turn: DQuat) {
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let mut normal = DVec3::ZERO;
                normal[axis] = side;
                let (mut a, mut b) = (DVec3::ZERO, DVec3::ZERO);
                (a[(axis + 1) % 3], b[(axis + 2) % 3]) = (1.0, side);
                let corner = |x: f64, y: f64| center + turn * ((normal + a * x + b * y) * half);
                let (one, two) = (corner(-1.0, -1.0), corner(1.0, -1.0));
                let (three, four) = (corner(1.0, 1.0), corner(-1.0, 1.0));
                for position in [one, two, three, one, three, four] {
                    self.corner(view, position, turn * normal, STONE);
                }
            }
        }
    }

    /// Adds a tube around a polyline, whose ends may coincide: half balls at both ends, and rounded corners at the
    /// points between.
    fn tube(&mut self, view: &View, line: &[DVec3], radius: f64, around: usize, color: [u8; 4]) {
        for ends in line.windows(2) {
            let along = (ends[1] - ends[0]).normalize_or(DVec3::Z);
            let side = along.any_orthonormal_vector();
            let other = along.cross(side);
            // Rings from one pole to the other; the middle ring is used twice, once at each end.
            let half = around / 4;
            let ring = |i: usize| {
                let (end, step) = if i <= half { (0, i) } else { (1, i - 1) };
                let angle = std::f64::consts::FRAC_PI_2 * (step as f64 / half as f64 - 1.0);
                (ends[end], angle)
            };
            let normal = |angle: f64, j: usize| {
                let turn = std::f64::consts::TAU * j as f64 / around as f64;
                (side * turn.cos() + other * turn.sin()) * angle.cos() + along * angle.sin()
            };
            for i in 0..2 * half + 1 {
                let ((below, low), (above, high)) = (ring(i), ring(i + 1));
                for j in 0..around {
                    let corners = [(below, low, j), (below, low, j + 1), (above, high, j + 1)];
                    let others = [(below, low, j), (above, high, j + 1), (above, high, j)];
                    for (end, angle, j) in corners.into_iter().chain(others) {
                        let normal = normal(angle, j);
                        self.corner(view, end + normal * radius, normal, color);
                    }
                }
            }
        }
    }
}

/// Rotation from its description in a scene.
fn turned(spec: RotationSpec) -> DQuat {
    let axis = DVec3::from_array(spec.axis).normalize_or(DVec3::Z);
    DQuat::from_axis_angle(axis, spec.angle_degrees.to_radians())
}
