//! [`software_picture`]: images drawn on the processor.
//!
//! Triangles are clipped and cut into rows of pixels (`raster.rs`).
//!
//! The rasterizer only decides which triangle is in front at each of four samples of a pixel, at the positions that
//! devices use. A pixel is then shaded once for each visible triangle, at the center of its samples, as in four-sample
//! MSAA on a device. Bands of rows are drawn in parallel; each pixel is computed by one thread in one order, so an
//! image is the same for any number of threads. Cost: each band visits each triangle, O(bands x triangles); four passes
//! over the rows of those in it, and one or two shadings per pixel.

use glam::{DVec3, Vec2, Vec3, Vec4};
use incise::cutting::FaceTag;
use rayon::prelude::*;

use crate::contact_shadow::ContactShadow;
use crate::normals::normal_sums;
use crate::props::{Plane, PropCorner, Props};
use crate::raster::{clip, fill};
use crate::shading::{self, Surface, direction};
use crate::srgb::{decode, encode};
use crate::view::{LARGEST_SIDE, View};
use crate::{Camera, Image, RenderError, RenderScene, Style};

/// Sample positions in a pixel: the standard ones of Vulkan, Metal and Direct3D.
const SAMPLES: [Vec2; 4] = [
    Vec2::new(0.375, 0.125),
    Vec2::new(0.875, 0.375),
    Vec2::new(0.125, 0.625),
    Vec2::new(0.625, 0.875),
];
/// Rows per parallel task.
const BAND: usize = 16;
/// Triangles per parallel task of the projection.
const CHUNK: usize = 512;
/// Distance in pixels from an edge that is not drawn.
const FAR: f32 = 1e6;
/// Index of an empty sample.
const NOTHING: u32 = u32::MAX;

/// Draws an image on the processor from the positions of all particles, usually those of
/// [`Simulation::positions`](incise::Simulation::positions). A copy of both is enough to draw while the simulation steps
/// on another thread.
///
/// Equal input gives equal bytes for any number of threads.
///
/// # Errors
/// If a side of the image is 0 or more than [`LARGEST_SIDE`].
///
/// # Panics
/// If a particle of the render scene has no position.
///
/// # Example
/// See [`RenderScene`].
pub fn software_picture(
    render_scene: &RenderScene,
    positions: &[DVec3],
    camera: &Camera,
    style: &Style,
    size: [u32; 2],
) -> Result<Image, RenderError> {
    let view = View::new(camera, size, LARGEST_SIDE)?;
    let frame = Frame::new(view, render_scene, positions, *style);
    let placed = frame.place();
    let [width, height] = size.map(|side| side as usize);
    let mut rgba = vec![0; 4 * width * height];
    rgba.par_chunks_mut(4 * width * BAND)
        .enumerate()
        .for_each_init(Band::default, |band, (number, rows)| {
            band.draw(&frame, &placed, number * BAND, rows);
        });
    Ok(Image {
        width: size[0],
        height: size[1],
        rgba,
    })
}

/// Everything drawn in an image.
struct Frame<'a> {
    view: View,
    style: Style,
    render_scene: &'a RenderScene,
    colors: &'a [u32],
    /// Positions of the skin's vertices relative to the eye.
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    props: Props,
    contact_shadow: Option<ContactShadow>,
}

/// Triangle on the screen: pixels from the upper left, and the reciprocal of the depth.
#[derive(Clone, Copy, Debug)]
struct Placed {
    corners: [Vec3; 3],
    /// Index of the triangle: the skin's triangles come first, then those of obstacles.
    triangle: u32,
}

/// Surface data of a triangle.
struct Corners<'a> {
    positions: [Vec3; 3],
    kind: Kind<'a>,
}

enum Kind<'a> {
    Skin(usize),
    Prop(&'a [PropCorner]),
}

impl<'a> Frame<'a> {
    fn new(view: View, render_scene: &'a RenderScene, positions: &[DVec3], style: Style) -> Self {
        let skin = render_scene.skin();
        let origin = positions.first().copied().unwrap_or_default();
        let vertices = skin.vertices().par_iter().with_min_len(CHUNK);
        let local: Vec<Vec3> = vertices
            .map(|vertex| (positions[vertex.particle.index()] - origin).as_vec3())
            .collect();
        let normals = if style.smooth {
            let sums = normal_sums(skin.triangles(), &local);
            let unit = |sum: &[i32; 3]| direction(Vec3::from_array(sum.map(|part| part as f32)));
            sums.iter().map(unit).collect()
        } else {
            vec![Vec3::Z; local.len()]
        };
        let from_eye = view.relative(origin);
        let positions: Vec<Vec3> = local
            .into_iter()
            .map(|position| position + from_eye)
            .collect();
        let props = Props::new(render_scene, &view);
        let ground = props.planes.iter().find(|plane| plane.ground);
        let contact_shadow =
            ground.map(|plane| ContactShadow::new(*plane, skin.triangles(), &positions));
        Self {
            style,
            colors: render_scene.colors_for(style.color_by),
            render_scene,
            positions,
            normals,
            props,
            contact_shadow,
            view,
        }
    }

    fn triangles(&self) -> usize {
        self.render_scene.skin().triangles().len() + self.props.corners.len() / 3
    }

    fn corners(&self, triangle: usize) -> Corners<'_> {
        let skin = self.render_scene.skin().triangles();
        match skin.get(triangle) {
            Some(corners) => Corners {
                positions: corners.map(|v| self.positions[v as usize]),
                kind: Kind::Skin(triangle),
            },
            None => {
                let first = 3 * (triangle - skin.len());
                let corners = &self.props.corners[first..first + 3];
                Corners {
                    positions: [0, 1, 2].map(|i| Vec3::from_array(corners[i].position)),
                    kind: Kind::Prop(corners),
                }
            }
        }
    }

    /// Clips and projects all triangles, in their order.
    fn place(&self) -> Vec<Placed> {
        let triangles: Vec<u32> = (0..self.triangles()).map(number).collect();
        let chunks = triangles.par_chunks(CHUNK);
        chunks
            .flat_map_iter(|chunk| {
                let mut placed = Vec::with_capacity(chunk.len());
                for &triangle in chunk {
                    self.place_one(triangle, &mut placed);
                }
                placed
            })
            .collect()
    }

    fn place_one(&self, triangle: u32, placed: &mut Vec<Placed>) {
        let positions = self.corners(triangle as usize).positions;
        clip(
            positions.map(|position| self.view.clip * position.extend(1.0)),
            |part| {
                placed.push(Placed {
                    corners: part.map(|corner| self.screen(corner)),
                    triangle,
                });
            },
        );
    }

    fn screen(&self, clip: Vec4) -> Vec3 {
        let [x, y, _, w] = clip.to_array();
        let [width, height] = self.view.size.map(|side| side as f32);
        Vec3::new(
            (x / w * 0.5 + 0.5) * width,
            (0.5 - y / w * 0.5) * height,
            1.0 / w,
        )
    }

    /// Color of a triangle at a position in the image, in linear light.
    fn shade(&self, triangle: u32, at: Vec2) -> Vec3 {
        let Corners { positions, kind } = self.corners(triangle as usize);
        let shares = shares(positions, self.view.ray(at.x, at.y));
        let mix = |of: [Vec3; 3]| of[0] * shares.x + of[1] * shares.y + of[2] * shares.z;
        let position = mix(positions);
        match kind {
            Kind::Skin(triangle) => {
                let skin = self.render_scene.skin();
                let corners = skin.triangles()[triangle];
                let cut = skin.tag(triangle) != FaceTag::Outer;
                let word = self.colors.get(triangle).copied().unwrap_or(0);
                let (base, gloss) = shading::skin_base(word, cut);
                let [ab, ac] = [positions[1] - positions[0], positions[2] - positions[0]];
                let face = direction(direction(ab).cross(direction(ac)));
                let normal = mix(corners.map(|v| self.normals[v as usize]));
                let surface = Surface {
                    base,
                    gloss,
                    position,
                    normal: shading::skin_normal(normal, face, cut, self.style.smooth),
                    face,
                };
                let color = shading::shade(surface, self.view.light);
                let rims = self.render_scene.rims()[triangle];
                if rims == 0 && !self.style.wireframe {
                    return color;
                }
                let mut distances = self.distances(positions, at);
                for k in 0..3 {
                    if rims & 1 << k != 0 {
                        distances[k] *= shading::RIM;
                    } else if !self.style.wireframe {
                        distances[k] = FAR;
                    }
                }
                shading::wire(color, distances)
            }
            Kind::Prop(corners) => {
                let normal = direction(mix([0, 1, 2].map(|i| Vec3::from_array(corners[i].normal))));
                let [r, g, b, gloss] = corners[0].color;
                let surface = Surface {
                    base: Vec3::from_array([r, g, b].map(decode)),
                    gloss: f32::from(gloss) / 255.0,
                    position,
                    normal,
                    face: normal,
                };
                shading::shade(surface, self.view.light)
            }
        }
    }

    /// Distances in pixels from the edges of a triangle; a large value if a corner is not in front of the eye.
    fn distances(&self, positions: [Vec3; 3], at: Vec2) -> Vec3 {
        let [Some(a), Some(b), Some(c)] = positions.map(|position| self.view.pixel(position))
        else {
            return Vec3::splat(FAR);
        };
        let from = |p: Vec2, q: Vec2| (q - p).perp_dot(at - p).abs() / (q - p).length().max(1e-6);
        Vec3::new(from(b, c), from(c, a), from(a, b))
    }

    /// Color of a pixel from its samples.
    fn pixel(&self, x: usize, y: usize, samples: [(u32, f32); 4], sky: Sky) -> [u8; 4] {
        let corner = Vec2::new(x as f32, y as f32);
        let middle = corner + 0.5;
        let empty = samples.iter().all(|sample| sample.0 == NOTHING);
        let mut colors = [sky.color; 4];
        // One sample is enough for an empty pixel.
        let colors = if empty {
            &mut colors[..1]
        } else {
            for i in 0..4 {
                let triangle = samples[i].0;
                let same = samples[..i].iter().position(|other| other.0 == triangle);
                if let Some(same) = same {
                    colors[i] = colors[same];
                } else if triangle != NOTHING {
                    let color = self.shade(triangle, corner + middle_of(triangle, samples));
                    // A device clamps its samples to this range.
                    colors[i] = color.clamp(Vec3::ZERO, Vec3::ONE);
                }
            }
            &mut colors[..]
        };
        let ray = self.view.ray(middle.x, middle.y);
        let mut veiled = false;
        for plane in &self.props.planes {
            veiled |= self.blend(plane, ray, samples, colors);
        }
        if empty && !veiled {
            return sky.encoded;
        }
        opaque(colors.iter().sum::<Vec3>() / colors.len() as f32)
    }

    /// Blends a plane over the samples that show something behind it; returns true if there are any.
    fn blend(
        &self,
        plane: &Plane,
        ray: Vec3,
        samples: [(u32, f32); 4],
        colors: &mut [Vec3],
    ) -> bool {
        let contact_shadow = self.contact_shadow.as_ref().filter(|_| plane.ground);
        let seen = shading::plane(&self.view, plane, ray, |position| {
            contact_shadow.map_or(0.0, |contact_shadow| contact_shadow.at(position))
        });
        let Some((color, cover, depth)) = seen else {
            return false;
        };
        for (behind, (_, nearness)) in colors.iter_mut().zip(samples) {
            if 1.0 / depth > nearness {
                *behind = behind.lerp(color, cover);
            }
        }
        true
    }
}

/// Background of a row.
#[derive(Clone, Copy)]
struct Sky {
    color: Vec3,
    encoded: [u8; 4],
}

/// Encodes a color in linear light as opaque sRGB bytes.
fn opaque(color: Vec3) -> [u8; 4] {
    let [r, g, b] = color.to_array().map(encode);
    [r, g, b, 255]
}

/// Center of the samples of a pixel that show a triangle.
fn middle_of(triangle: u32, samples: [(u32, f32); 4]) -> Vec2 {
    let shown = SAMPLES.iter().zip(samples);
    let shown = shown.filter(|(_, sample)| sample.0 == triangle);
    let (sum, count) = shown.fold((Vec2::ZERO, 0.0), |(sum, count), (position, _)| {
        (sum + *position, count + 1.0)
    });
    sum / count
}

/// Barycentric coordinates of the intersection of a ray with a triangle's plane, clamped to the triangle.
fn shares([a, b, c]: [Vec3; 3], ray: Vec3) -> Vec3 {
    let (ab, ac) = (b - a, c - a);
    let across = ray.cross(ac);
    let determinant = ab.dot(across);
    let v = -a.dot(across) / determinant;
    let w = -ray.dot(a.cross(ab)) / determinant;
    if !(v.is_finite() && w.is_finite()) {
        // Seen edge-on.
        return Vec3::splat(1.0 / 3.0);
    }
    let shares = Vec3::new(1.0 - v - w, v, w).max(Vec3::ZERO);
    shares / shares.element_sum()
}

/// Band of pixel rows, four samples per pixel.
#[derive(Default)]
struct Band {
    /// Triangle and reciprocal depth.
    samples: Vec<[(u32, f32); 4]>,
}

impl Band {
    /// Draws the rows from `top` on.
    fn draw(&mut self, frame: &Frame<'_>, placed: &[Placed], top: usize, rows: &mut [u8]) {
        let width = frame.view.size[0] as usize;
        let height = rows.len() / (4 * width);
        self.samples.clear();
        self.samples.resize(width * height, [(NOTHING, 0.0); 4]);
        let (above, below) = (top as f32 - 1.0, (top + height) as f32 + 1.0);
        for triangle in placed {
            let [a, b, c] = triangle.corners.map(|corner| corner.y);
            if a.max(b).max(c) >= above && a.min(b).min(c) <= below {
                self.fill(triangle, top, width);
            }
        }
        let samples = self.samples.chunks_exact(width);
        for ((row, samples), y) in rows.chunks_exact_mut(4 * width).zip(samples).zip(top..) {
            let color = shading::background((y as f32 + 0.5) / frame.view.size[1] as f32);
            let encoded = opaque(color);
            let sky = Sky { color, encoded };
            for (x, (pixel, samples)) in row.chunks_exact_mut(4).zip(samples).enumerate() {
                pixel.copy_from_slice(&frame.pixel(x, y, *samples, sky));
            }
        }
    }

    /// Writes a triangle into the samples where it is in front; at equal depth the first triangle stays.
    fn fill(&mut self, placed: &Placed, top: usize, width: usize) {
        let height = self.samples.len() / width;
        for (sample, position) in SAMPLES.iter().enumerate() {
            // The rasterizer samples at pixel centers.
            let shift = 0.5 - *position;
            let corners = placed.corners.map(|corner| corner + shift.extend(0.0));
            fill(corners, width, top..top + height, |row| {
                let first = (row.y - top) * width;
                let pixels = &mut self.samples[first + row.start..first + row.end];
                for (pixel, nearness) in pixels.iter_mut().zip(row.depths()) {
                    if nearness > pixel[sample].1 {
                        pixel[sample] = (placed.triangle, nearness);
                    }
                }
            });
        }
    }
}

fn number(triangle: usize) -> u32 {
    u32::try_from(triangle).unwrap_or(NOTHING)
}
