//! [`ColliderSpec`]: the obstacles of a scene.

use glam::{DQuat, DVec3};
use incise_xpbd::{Collider, ColliderShape, StepSettings};
use serde::{Deserialize, Serialize};

use crate::limits::{LARGEST_COORDINATE, coordinates, direction, within};
use crate::scene::GroundSpec;
use crate::{Error, Scene};

/// A solid obstacle that particles do not enter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum ColliderSpec {
    /// A half space, free on the side that the normal points to.
    Plane {
        /// A point on its surface in m.
        point: [f64; 3],
        /// Its normal.
        normal: [f64; 3],
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Its center in m.
        center: [f64; 3],
        /// Its radius in m.
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// All points within the radius of a segment.
    Capsule {
        /// The ends of the segment in m.
        ends: [[f64; 3]; 2],
        /// Its radius in m.
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// A box.
    Box {
        /// Its center in m.
        center: [f64; 3],
        /// Half its edges in m.
        half_extents: [f64; 3],
        /// How it is turned; absent: its edges are along the axes.
        rotation: Option<RotationSpec>,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
}

/// A rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationSpec {
    /// The axis.
    pub axis: [f64; 3],
    /// The angle in degrees, against the clock as seen against the axis.
    pub angle_degrees: f64,
}

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

fn collider(field: &str, spec: &ColliderSpec) -> Result<Collider, Error> {
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
