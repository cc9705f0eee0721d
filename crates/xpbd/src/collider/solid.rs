//! [`Solid`]: the nearest point of a plane, a sphere, a capsule or a box, with its distance and normal.
//!
//! A sphere is a capsule without length; a box is evaluated in its own axes. Where several points are nearest, a fixed
//! one of them is returned. Cost: 10 to 60 operations.

use glam::{DMat3, DVec3};

use super::ColliderShape;
use crate::Float;
use crate::direction::{absolute, direction};

/// A shape in the solver's precision, prepared for many questions.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Solid<R: Float> {
    Plane {
        normal: R::Vector,
        /// Of the surface from the origin, along the normal.
        offset: R,
    },
    /// A capsule; a sphere is one without length.
    Round {
        start: R::Vector,
        axis: R::Vector,
        /// One over the squared length of the axis; 0 for a sphere.
        per_squared: R,
        radius: R,
        /// The normal for points on the axis.
        aside: R::Vector,
    },
    Box {
        center: R::Vector,
        axes: [R::Vector; 3],
        half: [R; 3],
    },
}

/// What is nearest to a point on a surface.
pub(crate) struct Nearest<R: Float> {
    pub(crate) distance: R,
    pub(crate) normal: R::Vector,
    pub(crate) point: R::Vector,
}

impl<R: Float> Solid<R> {
    /// A distance from the origin that its numbers do not exceed: what rounding is relative to.
    pub(crate) fn reach(&self) -> R {
        let length = |v: R::Vector| R::dot(v, v).sqrt();
        match *self {
            Self::Plane { offset, .. } => absolute(offset),
            Self::Round {
                start,
                axis,
                radius,
                ..
            } => length(start) + length(axis) + radius,
            Self::Box { center, half, .. } => length(center) + (half[0] + half[1] + half[2]),
        }
    }

    pub(crate) fn new(shape: &ColliderShape) -> Self {
        match *shape {
            ColliderShape::Plane { point, normal } => {
                let normal = unit(normal);
                Self::Plane {
                    normal: R::from_dvec3(normal),
                    offset: R::from_f64(normal.dot(point)),
                }
            }
            ColliderShape::Sphere { center, radius } => Self::round([center; 2], radius),
            ColliderShape::Capsule { ends, radius } => Self::round(ends, radius),
            ColliderShape::Box {
                center,
                half_extents,
                rotation,
            } => {
                let axes = DMat3::from_quat(rotation.normalize());
                Self::Box {
                    center: R::from_dvec3(center),
                    axes: [axes.x_axis, axes.y_axis, axes.z_axis].map(R::from_dvec3),
                    half: half_extents.to_array().map(R::from_f64),
                }
            }
        }
    }

    fn round([start, end]: [DVec3; 2], radius: f64) -> Self {
        let axis = R::from_dvec3(end - start);
        let per_squared = R::ONE / R::dot(axis, axis);
        // Too short to be told from a sphere.
        let short = !per_squared.is_finite();
        let aside = if short {
            DVec3::Z
        } else {
            unit(end - start).any_orthonormal_vector()
        };
        Self::Round {
            start: R::from_dvec3(start),
            axis,
            per_squared: if short { R::ZERO } else { per_squared },
            radius: R::from_f64(radius),
            aside: R::from_dvec3(aside),
        }
    }

    /// True only if the distance of a point is not negative, also as [`Solid::nearest`] rounds it. False for some points
    /// that are outside but near. Cost: a few operations.
    #[inline(always)]
    pub(crate) fn clears(&self, x: R::Vector) -> bool {
        match *self {
            Self::Plane { normal, offset } => R::dot(normal, x) - offset >= R::ZERO,
            Self::Round {
                start,
                axis,
                per_squared,
                radius,
                ..
            } => {
                let part = clamp(R::dot(x - start, axis) * per_squared, R::ZERO, R::ONE);
                let way = R::components(x - (start + axis * part));
                // No vector is shorter than its largest component, also as `direction` computes it.
                way.iter().any(|&c| absolute(c) > radius) && way.iter().all(|c| c.is_finite())
            }
            Self::Box { center, axes, half } => {
                let way = x - center;
                (0..3).any(|k| absolute(R::dot(axes[k], way)) > half[k])
            }
        }
    }

    /// True only if no point of a box has a negative distance, also as [`Solid::nearest`] rounds it. False for some boxes that are outside. Cost: that of two boxes.
    pub(crate) fn clears_box(&self, low: [R; 3], high: [R; 3]) -> bool {
        let [own_low, own_high] = match *self {
            Self::Plane { normal, offset } => {
                // No corner is lower, also after rounding, which keeps the order of sums.
                let n = R::components(normal);
                let [x, y, z] = [0, 1, 2].map(|k| if n[k] < R::ZERO { high[k] } else { low[k] });
                return R::dot(normal, R::vector(x, y, z)) - offset >= R::ZERO;
            }
            Self::Round {
                start,
                axis,
                radius,
                ..
            } => {
                let (start, end) = (R::components(start), R::components(start + axis));
                let smaller = |a, b| if a < b { a } else { b };
                let larger = |a, b| if a > b { a } else { b };
                [
                    [0, 1, 2].map(|k| smaller(start[k], end[k]) - radius),
                    [0, 1, 2].map(|k| larger(start[k], end[k]) + radius),
                ]
            }
            Self::Box { center, axes, half } => {
                let center = R::components(center);
                let axes = axes.map(R::components);
                let reach = [0, 1, 2].map(|k| {
                    let parts = [0, 1, 2].map(|i| absolute(axes[i][k]) * half[i]);
                    parts[0] + parts[1] + parts[2]
                });
                [
                    [0, 1, 2].map(|k| center[k] - reach[k]),
                    [0, 1, 2].map(|k| center[k] + reach[k]),
                ]
            }
        };
        let rounding = self.reach() * R::EPSILON * R::from_f64(32.0);
        (0..3).any(|k| low[k] > own_high[k] + rounding || high[k] < own_low[k] - rounding)
    }

    #[inline]
    pub(crate) fn nearest(&self, x: R::Vector) -> Nearest<R> {
        match *self {
            Self::Plane { normal, offset } => {
                let along = R::dot(normal, x);
                Nearest {
                    distance: along - offset,
                    normal,
                    // Not `x` plus the depth: like this it lies on a level surface to the bit.
                    point: x - normal * along + normal * offset,
                }
            }
            Self::Round {
                start,
                axis,
                per_squared,
                radius,
                aside,
            } => {
                let part = clamp(R::dot(x - start, axis) * per_squared, R::ZERO, R::ONE);
                let center = start + axis * part;
                let (length, normal) = direction::<R>(x - center).unwrap_or((R::ZERO, aside));
                Nearest {
                    distance: length - radius,
                    normal,
                    point: center + normal * radius,
                }
            }
            Self::Box { center, axes, half } => {
                let local = axes.map(|axis| R::dot(axis, x - center));
                let (distance, normal, point) = nearest_on_box::<R>(local, half);
                let back = |v: [R; 3]| axes[0] * v[0] + axes[1] * v[1] + axes[2] * v[2];
                Nearest {
                    distance,
                    normal: back(normal),
                    point: center + back(point),
                }
            }
        }
    }
}

/// Signed distance, normal and nearest point of an axis-aligned box around the origin.
#[inline]
fn nearest_on_box<R: Float>(x: [R; 3], half: [R; 3]) -> (R, [R; 3], [R; 3]) {
    let beyond: [R; 3] = std::array::from_fn(|i| absolute(x[i]) - half[i]);
    let clamped: [R; 3] = std::array::from_fn(|i| clamp(x[i], -half[i], half[i]));
    let outside = R::vector(x[0] - clamped[0], x[1] - clamped[1], x[2] - clamped[2]);
    if let Some((distance, normal)) = direction::<R>(outside) {
        return (distance, R::components(normal), clamped);
    }
    let mut face = 0;
    for i in 1..3 {
        if beyond[i] > beyond[face] {
            face = i;
        }
    }
    let (mut normal, mut point) = ([R::ZERO; 3], x);
    let side = if x[face] < R::ZERO { -R::ONE } else { R::ONE };
    normal[face] = side;
    point[face] = side * half[face];
    (beyond[face], normal, point)
}

#[inline]
fn clamp<R: Float>(value: R, low: R, high: R) -> R {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// The vector of length 1 along another one that is not zero.
fn unit(v: DVec3) -> DVec3 {
    let scaled = v / v.abs().max_element();
    scaled / scaled.length()
}

impl Solid<f32> {
    /// The kind and the numbers of the solid, in the order of `Solver::collider_data`.
    pub(crate) fn numbers(&self) -> [f32; 20] {
        let mut numbers = [0.0; 20];
        let mut put = |at: usize, vectors: &[glam::Vec3]| {
            for (k, vector) in vectors.iter().enumerate() {
                numbers[at + 3 * k..at + 3 * k + 3].copy_from_slice(&vector.to_array());
            }
        };
        match *self {
            Self::Plane { normal, offset } => {
                put(8, &[normal]);
                numbers[2] = offset;
            }
            Self::Round {
                start,
                axis,
                per_squared,
                radius,
                aside,
            } => {
                put(8, &[start, axis, aside]);
                numbers[0] = 1.0;
                numbers[2] = radius;
                numbers[3] = per_squared;
            }
            Self::Box { center, axes, half } => {
                put(8, &[center, axes[0], axes[1], axes[2]]);
                numbers[0] = 2.0;
                [numbers[2], numbers[3], numbers[7]] = half;
            }
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn noise(number: u32) -> f64 {
        (f64::from(number) * 12.9898).sin() * 43_758.545 % 1.0
    }

    fn vector(number: u32) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|k| noise(3 * number + k)))
    }

    /// Points on and near surfaces of all sizes, some that are no points, and boxes that they are corners of; counts points
    /// outside that are cleared and that are not, then the boxes of these.
    fn compare<R: Float>(scales: &[f64]) -> [u32; 4] {
        let mut counts = [0; 4];
        for number in 0..1000 {
            let at = |k: u32| vector(7 * number + k);
            let scale = scales[number as usize % scales.len()];
            let (center, radius) = (at(0) * scale, scale * (0.1 + at(1).x.abs()));
            let shapes = [
                ColliderShape::Plane {
                    point: center,
                    normal: at(2),
                },
                ColliderShape::Sphere { center, radius },
                ColliderShape::Capsule {
                    ends: [center, center + at(2) * scale],
                    radius,
                },
                ColliderShape::Box {
                    center,
                    half_extents: (at(1).abs() + 0.1) * scale,
                    rotation: DQuat::from_vec4(at(3).extend(at(4).x)),
                },
            ];
            for shape in shapes {
                let solid = Solid::<R>::new(&shape);
                let start = center + at(5) * (3.0 * scale);
                let surface = solid.nearest(R::from_dvec3(start)).point;
                let mut points = vec![R::from_dvec3(start), surface];
                for by in [R::EPSILON, R::from_f64(1e-3)] {
                    points.push(surface + surface * by);
                    points.push(surface - surface * by);
                }
                let [x, y, _] = R::components(surface);
                points.push(R::vector(x, y, R::from_f64(f64::INFINITY)));
                points.push(R::vector(x, R::from_f64(f64::NAN), y));
                let size = R::from_dvec3(at(6).abs() * scale);
                for x in points {
                    let is_outside = solid.nearest(x).distance >= R::ZERO;
                    let clears = solid.clears(x);
                    assert!(is_outside || !clears, "{shape:?} {x:?}");
                    counts[usize::from(!clears)] += u32::from(is_outside);
                    if !R::components(x).iter().all(|c| c.is_finite()) {
                        continue;
                    }
                    for ends in [[x, x], [x, x + size], [x - size, x]] {
                        let [low, high] = ends.map(R::components);
                        let clears = solid.clears_box(low, high);
                        assert!(is_outside || !clears, "{shape:?} {x:?} {low:?} {high:?}");
                        counts[2 + usize::from(!clears)] += u32::from(is_outside);
                    }
                }
            }
        }
        counts
    }

    #[test]
    fn what_is_cleared_is_outside() {
        for [cleared, near, boxes, near_boxes] in [
            compare::<f32>(&[1.0, 1e-6, 1e6, 1e-22, 1e18]),
            compare::<f64>(&[1.0, 1e-6, 1e6, 1e-160, 1e150]),
        ] {
            assert!(cleared > near && near > 100, "{cleared} and {near}");
            assert!(boxes > 1000 && near_boxes > 100, "{boxes} and {near_boxes}");
        }
    }
}
