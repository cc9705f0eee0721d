//! [`Sweep`]: a blade moved through the body, cutting as it goes.
//!
//! Each frame, every edge that the blade met since the last frame gets a particle there, and a face opens as soon as
//! all three of its particles lie on the swept surface (see the module `stroke`). So the cut stays behind the blade by
//! less than one tet, and a stroke may stop anywhere. The blade is followed in the material's own time (see the module
//! `ccd`), so a body that moves or deforms between frames leaves no gap.
//!
//! A bent blade traces a surface with a bend. An edge that runs through it close to the bend may meet one segment and end
//! beyond the other, so the sides of its ends, and of the tets there, are those of the whole surface that the blade would
//! trace if it moved on as it does.
//!
//! Source: paper section 4.3, with the moving front as described here. Cost: a pass over particles and tets at the
//! start; in each frame a copy of the positions, the boxes of the boundary triangles (see the module `broad_phase`) and the
//! cut.

use glam::DVec3;

use crate::blade::Blade;
use crate::broad_phase::{Search, SweptSegment};
use crate::ccd::{EdgeHit, MovingSegment, meetings};
use crate::finite::{require_finite, require_positions};
use crate::motion::Motion;
use crate::stroke::Stroke;
use crate::stroke_registry::StrokeRegistry;
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// Points of two segments this close to each other, against the distance to them, are the bend between them.
const SAME_POINT: f64 = 1e-9;

/// A blade on its way from one pose to the next.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct MovingBlade(Vec<SweptSegment>);

impl MovingBlade {
    /// On which side of the whole blade a point lies, if the blade moves on as it does at a time. The material there
    /// moves with `drift`.
    ///
    /// Of the surface that the blade would trace, the closest part decides: where it is bent, the sum of the normals on
    /// both sides of the bend.
    fn side_at(&self, time: f64, x: DVec3, drift: DVec3) -> Option<bool> {
        let nearest = self.0.iter().map(|swept| {
            let ends = swept.segment.at(time);
            let (at, offset) = from_segment(ends, x);
            (offset.length_squared(), swept.segment.velocity(at))
        });
        let (_, velocity) = nearest.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let motion = velocity - drift;
        let across = |v: DVec3| v - motion * (v.dot(motion) / motion.length_squared());
        let (mut closest, mut above) = (f64::INFINITY, 0.0);
        for swept in &self.0 {
            let [p, q] = swept.segment.at(time);
            let (along, from_start) = (across(q - p), across(x - p));
            let Some(normal) = along.cross(motion).try_normalize() else {
                continue;
            };
            let at = (from_start.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            let offset = from_start - along * at;
            let (distance, height) = (offset.length(), normal.dot(offset));
            if distance < closest * (1.0 - SAME_POINT) {
                (closest, above) = (distance, height);
            } else if distance <= closest * (1.0 + SAME_POINT) {
                above += height;
            }
        }
        (above != 0.0 && above.is_finite()).then_some(above > 0.0)
    }

    fn is_bent(&self) -> bool {
        self.0.len() > 1
    }
}

impl Blade for MovingBlade {
    const IS_SWEPT: bool = true;

    fn first_meeting(
        &self,
        edge: &MovingSegment,
        keep: impl Fn(&EdgeHit) -> bool,
    ) -> Option<(EdgeHit, usize)> {
        let near = self.0.iter().enumerate();
        let near = near.filter(|(_, swept)| !swept.misses(edge));
        let all = near.flat_map(|(segment, swept)| {
            meetings(edge, &swept.segment).map(move |m| EdgeHit { segment, ..m })
        });
        let mut first = all.filter(keep).min_by(|m, n| m.time.total_cmp(&n.time))?;
        if self.is_bent() {
            // Past a bend an end may be on another side than the segment that was met says.
            let drift = edge.velocity(first.parameter);
            for (side, end) in first.sides.iter_mut().zip(edge.at(first.time)) {
                *side = self.side_at(first.time, end, drift).or(*side);
            }
        }
        Some((first, 1))
    }

    /// Three roots of a cubic a segment.
    fn most_meetings(&self) -> usize {
        3 * self.0.len()
    }

    /// Where it is straight, the particles remember.
    fn side(&self, x: DVec3, _: f64, drift: DVec3) -> Option<bool> {
        self.is_bent()
            .then(|| self.side_at(1.0, x, drift))
            .flatten()
    }

    fn is_straight(&self) -> bool {
        !self.is_bent()
    }

    fn is_beyond(&self, x: DVec3, distance: f64) -> bool {
        self.0.iter().all(|swept| {
            let (_, offset) = from_segment(swept.segment.now, x);
            offset.length() > distance
        })
    }

    fn touches(&self, _: DVec3, _: f64) -> Option<DVec3> {
        None
    }
}

/// A stroke of a moving blade (a polyline), which cuts frame by frame.
///
/// Faces open only where all three particles lie on this stroke's surface. To join an earlier stroke, a stroke must
/// overlap it by a tet or share a [`StrokeRegistry`] with it. To cross its own path it needs a registry, too.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, Sweep};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([3, 3, 3], DVec3::ONE))?;
/// let blade = |z: f64| [DVec3::new(0.4, -1.0, z), DVec3::new(0.5, 2.0, z)];
/// let positions = body.mesh().positions.clone();
/// let mut stroke = Sweep::new(&body, &positions, &blade(1.2), CutOptions::default())?;
/// for frame in 1..=14 {
///     let positions = body.mesh().positions.clone(); // a body at rest
///     stroke.advance(&mut body, &positions, &blade(1.2 - 0.1 * f64::from(frame)))?;
///     body.check()?;
/// }
/// assert_eq!(body.mesh().pieces().count, 2);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sweep {
    blade: Vec<DVec3>,
    /// Positions of the particles at the last pose.
    before: Vec<DVec3>,
    /// Room for those at the next one.
    room: Vec<DVec3>,
    search: Search,
    /// Number of tets of the mesh, to notice changes that the stroke did not follow.
    tets: usize,
    stroke: Stroke,
}

impl Sweep {
    /// Starts a stroke with the blade (a polyline of at least two points) in its first pose, which does not cut yet.
    ///
    /// # Errors
    /// If the blade or the options are not valid or `positions` has another length than the mesh or is not finite.
    pub fn new(
        cuttable: &CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
        options: CutOptions,
    ) -> Result<Self, CutError> {
        options.check()?;
        blade
            .iter()
            .try_for_each(|&point| require_finite("a blade point", point))?;
        let length: f64 = blade.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        if blade.len() < 2 || length < f64::MIN_POSITIVE {
            return Err(CutError::ShortBlade {
                points: blade.len(),
                // A sum of nothing is -0.
                length: length.abs(),
            });
        }
        require_positions(cuttable.mesh(), positions)?;
        Ok(Self {
            blade: blade.to_vec(),
            before: positions.to_vec(),
            room: Vec::new(),
            search: Search::new(cuttable.mesh(), positions, &between(blade, blade)),
            tets: cuttable.mesh.tets.len(),
            stroke: Stroke::new(options),
        })
    }

    /// Moves the blade to its next pose and cuts the tets that it passes.
    ///
    /// # Arguments
    /// `positions` are the particles' present positions. Between two calls particles and points of the blade are
    /// assumed to move on straight lines.
    ///
    /// # Returns
    /// Returns the changes; none if the blade met no edge.
    ///
    /// # Errors
    /// If the blade or `positions` are not finite or have another number of points than before or than the mesh, if the
    /// mesh was changed without [`Sweep::apply_delta`], or if it would grow beyond the options' limit. Mesh and stroke
    /// are unchanged then.
    ///
    /// # Determinism
    /// Equal histories give the same bits on every machine.
    pub fn advance(
        &mut self,
        cuttable: &mut CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
    ) -> Result<CutDelta, CutError> {
        self.advance_by(cuttable, positions, blade, None)
    }

    /// Moves the blade to its next pose and cuts, for a stroke that joins earlier strokes of the same surface: it may
    /// continue where one stopped, or meet one from another side, up to a quarter of an edge beside it.
    ///
    /// `registry` holds the earlier strokes, and this one is added to it. Use it for every frame of the stroke or for
    /// none.
    ///
    /// # Errors
    /// The errors of [`Sweep::advance`].
    pub fn advance_joining(
        &mut self,
        cuttable: &mut CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
        registry: &mut StrokeRegistry,
    ) -> Result<CutDelta, CutError> {
        self.advance_by(cuttable, positions, blade, Some(registry))
    }

    fn advance_by(
        &mut self,
        cuttable: &mut CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
        registry: Option<&mut StrokeRegistry>,
    ) -> Result<CutDelta, CutError> {
        let _span = tracing::debug_span!("cutting::sweep").entered();
        blade
            .iter()
            .try_for_each(|&point| require_finite("a blade point", point))?;
        if blade.len() != self.blade.len() {
            return Err(CutError::BladeChanged {
                before: self.blade.len(),
                now: blade.len(),
            });
        }
        let mesh = cuttable.mesh();
        if (self.before.len(), self.tets) != (mesh.positions.len(), mesh.tets.len()) {
            return Err(CutError::NotFollowed {
                particles: self.before.len(),
                tets: self.tets,
            });
        }
        require_positions(mesh, positions)?;

        let segments = between(&self.blade, blade);
        let near = self
            .search
            .find(cuttable, &self.before, positions, &segments);
        let mut motion = Motion {
            before: std::mem::take(&mut self.before),
            now: std::mem::take(&mut self.room),
        };
        motion.now.clear();
        motion.now.extend_from_slice(positions);
        let blade_between = MovingBlade(segments);
        let result = self
            .stroke
            .cut(cuttable, &mut motion, near, &blade_between, registry);
        match result {
            Ok(delta) => {
                (self.before, self.room) = (motion.now, motion.before);
                self.tets = cuttable.mesh.tets.len();
                self.blade.copy_from_slice(blade);
                self.search.keep(&delta);
                Ok(delta)
            }
            Err(error) => {
                (self.before, self.room) = (motion.before, motion.now);
                self.search.forget();
                Err(error)
            }
        }
    }

    #[cfg(test)]
    pub(crate) fn search_mut(&mut self) -> &mut Search {
        &mut self.search
    }

    /// Updates the stroke after a cut or a removal made outside of it since the last call of [`Sweep::advance`].
    ///
    /// A stroke cannot be updated after an undo: edges that it met in the undone cut are not met again. Continue with a
    /// clone of the stroke from before that cut.
    ///
    /// Two strokes at the same time must keep their fronts more than a tet apart where they cross: an edge that one
    /// creates just behind the other's front is not met again, and the body may stay connected there.
    ///
    /// # Panics
    /// If `cuttable` is not the mesh as `delta` left it.
    pub fn apply_delta(&mut self, cuttable: &CuttableMesh, delta: &CutDelta) {
        delta.extend_particles(&mut self.before);
        self.search.apply_delta(delta);
        self.tets = delta.tets_after();
        self.stroke.apply_delta(cuttable, delta);
    }
}

/// Where on a segment, from 0 to 1, the point closest to another one lies, and the way from it to that one.
fn from_segment([p, q]: [DVec3; 2], x: DVec3) -> (f64, DVec3) {
    let (along, from_start) = (q - p, x - p);
    let at = (from_start.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    let at = if at.is_nan() { 0.0 } else { at };
    (at, from_start - along * at)
}

/// The segments of a blade that moves from one pose to another.
fn between(before: &[DVec3], now: &[DVec3]) -> Vec<SweptSegment> {
    let pairs = before.windows(2).zip(now.windows(2));
    let segments = pairs.map(|(b, n)| {
        SweptSegment::new(MovingSegment {
            before: [b[0], b[1]],
            now: [n[0], n[1]],
        })
    });
    segments.collect()
}
