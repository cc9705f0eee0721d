//! Obstacles of a running scene, and [`ColliderHandle`].

use glam::{DQuat, DVec3};
use incise_xpbd::{Collider, ColliderShape, StepSettings};

use crate::scene::{ColliderSpec, GroundSpec};
use crate::validate::{LARGEST_COORDINATE, coordinates, direction, within};
use crate::{Error, Scene};

/// The rotation about an axis by an angle.
pub(crate) fn rotation(field: &str, axis: [f64; 3], degrees: f64) -> Result<DQuat, Error> {
    let axis = direction(&format!("{field}.axis"), axis)?.normalize();
    let degrees = within(&format!("{field}.angle_degrees"), degrees, -1e6, 1e6)?;
    Ok(DQuat::from_axis_angle(axis, degrees.to_radians()))
}

/// The obstacles of a scene, its ground first.
pub(crate) fn colliders(scene: &Scene) -> Result<Vec<Collider>, Error> {
    let ground = scene.world.ground.map(ground).transpose()?;
    let others = scene.collider.iter().enumerate();
    let others = others.map(|(i, spec)| collider(&format!("collider[{i}]"), spec));
    ground.into_iter().map(Ok).chain(others).collect()
}

/// Handle of a collider of a simulation, valid until the collider is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub struct ColliderHandle(u32);

impl ColliderHandle {
    /// The handle of the collider of a scene with this index in its list.
    pub(crate) fn of_scene(index: usize) -> Self {
        Self(u32::try_from(index).expect("colliders are numbered in 32 bits"))
    }

    /// Its number, in the order of the scene and then of addition.
    pub(crate) fn number(self) -> usize {
        self.0 as usize
    }
}

/// Handle -> index of the collider in the settings of all islands.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Colliders {
    /// In the order of the settings; the ground has none.
    handles: Vec<Option<ColliderHandle>>,
    /// The handle of the next collider: none is given twice.
    next: u32,
    /// Targets of colliders that move in the next frame.
    moves: Vec<(ColliderHandle, DVec3)>,
}

impl Colliders {
    /// Those of a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let ground = scene.world.ground.map(|_| None);
        let others = (0..scene.collider.len()).map(|i| Some(ColliderHandle::of_scene(i)));
        Self {
            handles: ground.into_iter().chain(others).collect(),
            next: ColliderHandle::of_scene(scene.collider.len()).0,
            moves: Vec::new(),
        }
    }

    /// The index of a collider in the settings, unless it was removed.
    pub(crate) fn index(&self, handle: ColliderHandle) -> Option<usize> {
        self.handles.iter().position(|h| *h == Some(handle))
    }

    /// The index of the ground in the settings, if there is one.
    pub(crate) fn ground(&self) -> Option<usize> {
        self.handles.iter().position(Option::is_none)
    }

    /// The handles of all colliders, in the order of the settings.
    pub(crate) fn all(&self) -> impl Iterator<Item = ColliderHandle> + '_ {
        self.handles.iter().filter_map(|handle| *handle)
    }

    /// Names a collider that goes to the end of the settings.
    pub(crate) fn add(&mut self) -> ColliderHandle {
        let handle = ColliderHandle(self.next);
        self.next += 1;
        self.handles.push(Some(handle));
        handle
    }

    /// Removes the handle of a collider that leaves the settings.
    pub(crate) fn remove(&mut self, index: usize) {
        self.handles.remove(index);
    }

    /// Notes where a collider goes in the next frame.
    pub(crate) fn go_to(&mut self, handle: ColliderHandle, to: DVec3) {
        self.stay(handle);
        self.moves.push((handle, to));
    }

    /// Forgets where a collider was to go.
    pub(crate) fn stay(&mut self, handle: ColliderHandle) {
        self.moves.retain(|(h, _)| *h != handle);
    }

    /// Returns the colliders that move in this frame, by index in the settings, with their targets.
    pub(crate) fn take_moves(&mut self) -> Vec<(usize, DVec3)> {
        let moves = std::mem::take(&mut self.moves).into_iter();
        moves
            .filter_map(|(h, to)| Some((self.index(h)?, to)))
            .collect()
    }

    /// Gives no handle that others have given: handles of colliders that are gone stay void.
    pub(crate) fn keep_numbers_of(&mut self, others: &Self) {
        self.next = self.next.max(others.next);
    }
}

/// Returns the position of a collider: the point of a plane, the center of a sphere or a box, the middle of a capsule.
pub(crate) fn position(shape: &ColliderShape) -> DVec3 {
    match *shape {
        ColliderShape::Plane { point, .. } => point,
        ColliderShape::Sphere { center, .. } | ColliderShape::Box { center, .. } => center,
        ColliderShape::Capsule { ends: [a, b], .. } => 0.5 * (a + b),
    }
}

/// Sets the velocity of a collider so that it reaches a target within `time` s.
pub(crate) fn send(collider: &mut Collider, to: DVec3, time: f64) {
    collider.velocity = (to - position(&collider.shape)) / time;
}

/// Puts a collider at rest where it was sent: not next to it by the rounding of its way.
pub(crate) fn arrive(collider: &mut Collider, to: DVec3) {
    send(collider, to, 1.0);
    *collider = collider.moved(1.0);
    collider.velocity = DVec3::ZERO;
}

/// Takes the colliders to where they are after a frame.
pub(crate) fn advance(settings: &mut StepSettings) {
    for collider in &mut settings.colliders {
        *collider = collider.moved(settings.time_step);
    }
}

fn ground(ground: GroundSpec) -> Result<Collider, Error> {
    let GroundSpec { height, friction } = ground;
    let far = LARGEST_COORDINATE;
    Ok(Collider::ground(
        within("world.ground.height", height, -far, far)?,
        within("world.ground.friction", friction, 0.0, 1e3)?,
    ))
}

/// The collider of a spec, if all its values are in their ranges.
pub(crate) fn collider(field: &str, spec: &ColliderSpec) -> Result<Collider, Error> {
    let at = |key: &str, v| coordinates(&format!("{field}.{key}"), v);
    let size = |key: &str, v| within(&format!("{field}.{key}"), v, 1e-9, LARGEST_COORDINATE);
    let (shape, friction, velocity) = match *spec {
        ColliderSpec::Plane {
            point,
            normal,
            friction,
            velocity,
        } => {
            let shape = ColliderShape::Plane {
                point: at("point", point)?,
                normal: direction(&format!("{field}.normal"), normal)?,
            };
            (shape, friction, velocity)
        }
        ColliderSpec::Sphere {
            center,
            radius,
            friction,
            velocity,
        } => {
            let shape = ColliderShape::Sphere {
                center: at("center", center)?,
                radius: size("radius", radius)?,
            };
            (shape, friction, velocity)
        }
        ColliderSpec::Capsule {
            ends,
            radius,
            friction,
            velocity,
        } => {
            let shape = ColliderShape::Capsule {
                ends: [at("ends", ends[0])?, at("ends", ends[1])?],
                radius: size("radius", radius)?,
            };
            (shape, friction, velocity)
        }
        ColliderSpec::Box {
            center,
            half_extents,
            rotation: turned,
            friction,
            velocity,
        } => {
            for half in half_extents {
                size("half_extents", half)?;
            }
            let field = format!("{field}.rotation");
            let turned = turned.map(|spec| rotation(&field, spec.axis, spec.angle_degrees));
            let shape = ColliderShape::Box {
                center: at("center", center)?,
                half_extents: DVec3::from_array(half_extents),
                rotation: turned.transpose()?.unwrap_or(DQuat::IDENTITY),
            };
            (shape, friction, velocity)
        }
    };
    Ok(Collider {
        shape,
        friction: within(&format!("{field}.friction"), friction, 0.0, 1e3)?,
        velocity: at("velocity", velocity)?,
    })
}
