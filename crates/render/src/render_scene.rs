//! [`RenderScene`]: drawable state of a simulation, kept up to date.
//!
//! It holds the skin, which is updated after cuts, the colors of its triangles, obstacles and ground of the scene, and
//! the blades. It holds no positions: those stay in the simulation, on the processor or on a device. Changes are marked
//! by revisions that are unique in the process, so that each renderer uploads only what it lacks. Cost per frame: a pass
//! over the triangles in frames with a cut; nothing without one.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use incise::cutting::Skin;
use incise::scene::{ColliderSpec, GroundSpec};
use incise::{Scene, Simulation};

use crate::palette::{self, Legend, decades, legend_from};
use crate::rims::rims;
use crate::{ColorBy, RenderError, stretch};

/// Color word of a triangle that is drawn as tissue.
const NONE: u32 = 0;

/// Drawable state of a simulation.
///
/// # Example
/// ```
/// use incise::{Scene, Simulation};
/// use incise_render::{Camera, RenderScene, Style, software_picture};
///
/// let scene = Scene::from_toml(
///     r#"
///     [[body]]
///     shape = { kind = "sphere", tets = 300 }
///     [[stroke]]
///     kind = "plane"
///     frame = 1
///     point = [0.05, 0.0, 0.0]
///     normal = [1.0, 0.0, 0.0]
///     "#,
/// )?;
/// let mut simulation = Simulation::new(&scene)?;
/// let mut render_scene = RenderScene::new(&simulation, &scene);
/// let [low, high] = render_scene.bounds(&simulation);
/// let camera = Camera::fit(low, high);
/// for _ in 0..3 {
///     simulation.step()?;
///     render_scene.sync(&simulation);
///     let size = [64, 48];
///     let positions = simulation.positions();
///     let picture = software_picture(&render_scene, positions, &camera, &Style::default(), size)?;
///     assert_eq!(picture.rgba.len(), 64 * 48 * 4);
/// }
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Clone, Debug)]
pub struct RenderScene {
    skin: Skin,
    /// For each triangle its edges on the rim of a cut: see [`rims`].
    rims: Vec<u32>,
    /// Color of each triangle; empty if all are drawn as tissue.
    colors: Vec<u32>,
    shown: ColorBy,
    /// Coloring and revision of the current colors, if they stay valid without changes.
    made_for: Option<(ColorBy, u64)>,
    /// Revision of the skin.
    pub(crate) topology: u64,
    /// Revision of clusters and colors, which change with each cut and each rebuild.
    plan: u64,
    /// Revision of the triangles' colors.
    pub(crate) coloring: u64,
    /// Simulated time of the last update, in s.
    time: f64,
    /// True if a device has made a step since the last topology change other than by its own cuts.
    pub(crate) device_is_current: bool,
    ground: Option<GroundSpec>,
    obstacles: Vec<ColliderSpec>,
    /// Points of all blades, and the end of each blade in them.
    blade_points: Vec<DVec3>,
    blade_ends: Vec<usize>,
    /// Bounding box of the bodies at the start.
    start: [DVec3; 2],
}

impl RenderScene {
    /// Creates the render scene of a simulation in its current state; ground and obstacles come from `scene`, which the
    /// simulation was made from. O(tets).
    #[must_use]
    pub fn new(simulation: &Simulation, scene: &Scene) -> Self {
        let mut render_scene = Self {
            skin: Skin::default(),
            rims: Vec::new(),
            colors: Vec::new(),
            shown: ColorBy::Tissue,
            made_for: None,
            topology: 0,
            plan: 0,
            coloring: revision(),
            time: 0.0,
            device_is_current: false,
            ground: scene.world.ground,
            obstacles: scene.collider.clone(),
            blade_points: Vec::new(),
            blade_ends: Vec::new(),
            start: [DVec3::ZERO; 2],
        };
        render_scene.reset(simulation);
        render_scene.start = render_scene.bounds(simulation);
        render_scene
    }

    /// Updates the render scene after a step of the simulation. Call it after each step; a second call for one step
    /// does nothing.
    ///
    /// # Panics
    /// If a step with a cut was skipped: use [`RenderScene::reset`] then.
    pub fn sync(&mut self, simulation: &Simulation) {
        let now = simulation.report().time_s;
        if now == self.time {
            return;
        }
        self.time = now;
        self.device_is_current = true;
        if simulation.report().reclustered > 0 {
            self.plan = revision();
        }
        let deltas = simulation.deltas();
        if deltas.is_empty() {
            return;
        }
        let colored = !self.colors.is_empty();
        for delta in deltas {
            let change = self.skin.apply_delta(delta);
            if colored {
                self.colors.resize(self.skin.triangles().len(), NONE);
                for triangle in change.triangles {
                    self.colors[triangle] = NONE;
                }
            }
        }
        if colored {
            self.coloring = revision();
        }
        self.rims = rims(&self.skin);
        self.topology = revision();
        self.plan = self.topology;
    }

    /// Rebuilds everything from the current state of the simulation: after a jump to another state, or a change of
    /// solver settings. Until the next step, positions are those of the host. O(tets).
    pub fn reset(&mut self, simulation: &Simulation) {
        self.skin = Skin::new(simulation.boundary());
        self.rims = rims(&self.skin);
        self.topology = revision();
        self.plan = self.topology;
        self.coloring = self.topology;
        self.colors.clear();
        self.made_for = None;
        self.time = simulation.report().time_s;
        self.device_is_current = false;
    }

    /// Colors the triangles for the current state; returns the legend if the colors show values.
    ///
    /// Colors, clusters and pieces are recomputed only when they or `by` changed. Stretch reads positions from a device
    /// and takes O(triangles) each time; `residuals` has a value for each tet and is shown on a logarithmic scale.
    ///
    /// # Errors
    /// If residuals are to be shown and their number is not that of the tets; if a device is lost.
    pub fn color(
        &mut self,
        simulation: &mut Simulation,
        by: ColorBy,
        residuals: Option<&[f64]>,
    ) -> Result<Option<Legend>, RenderError> {
        let stays = !matches!(by, ColorBy::Stretch | ColorBy::Residual);
        if stays && self.made_for == Some((by, self.plan)) {
            return Ok(None);
        }
        let legend = match by {
            ColorBy::Tissue => {
                self.colors.clear();
                None
            }
            ColorBy::Color => {
                let (clustering, coloring) = (simulation.clustering(), simulation.coloring());
                self.paint(|tet| {
                    let cluster = clustering.labels()[tet];
                    palette::distinct(coloring.color(cluster.index()).0)
                });
                None
            }
            ColorBy::Cluster => {
                let clustering = simulation.clustering();
                self.paint(|tet| palette::distinct(clustering.labels()[tet].0));
                None
            }
            ColorBy::Piece => {
                let pieces = simulation.piece_numbers();
                self.paint(|tet| palette::distinct(pieces[tet]));
                None
            }
            ColorBy::Stretch => {
                simulation.read_back()?;
                let (mesh, now) = (simulation.mesh(), simulation.positions());
                let of_tet = |tet: usize| {
                    let corners = mesh.tets[tet];
                    let rest = corners.map(|p| mesh.positions[p.index()]);
                    stretch(rest, corners.map(|p| now[p.index()]))
                };
                let values: Vec<f64> = (0..self.skin.triangles().len())
                    .map(|triangle| of_tet(self.skin.tet(triangle).index()))
                    .collect();
                let legend = legend_from(1.0, values.clone(), "");
                self.paint_values(&legend, values);
                Some(legend)
            }
            ColorBy::Residual => {
                let residuals = residuals.ok_or(RenderError::NoResiduals)?;
                let tets = simulation.mesh().tets.len();
                if residuals.len() != tets {
                    let given = residuals.len();
                    return Err(RenderError::Residuals { given, tets });
                }
                let values: Vec<f64> = (0..self.skin.triangles().len())
                    .map(|triangle| residuals[self.skin.tet(triangle).index()])
                    .collect();
                let legend = decades(&values, "");
                self.paint_values(&legend, values);
                Some(legend)
            }
        };
        self.shown = by;
        self.made_for = stays.then_some((by, self.plan));
        self.coloring = revision();
        Ok(legend)
    }

    /// Colors each triangle by its tet.
    fn paint(&mut self, of_tet: impl Fn(usize) -> [u8; 3]) {
        let tets = (0..self.skin.triangles().len()).map(|triangle| self.skin.tet(triangle));
        self.colors = tets.map(|tet| palette::pack(of_tet(tet.index()))).collect();
    }

    fn paint_values(&mut self, legend: &Legend, values: Vec<f64>) {
        let color = |value| palette::pack(legend.color(legend.fraction(value)));
        self.colors = values.into_iter().map(color).collect();
    }

    /// Sets the blade, drawn as a thin tube along a polyline; `None` or a single point removes it.
    pub fn set_blade(&mut self, blade: Option<&[DVec3]>) {
        self.blade_points.clear();
        self.blade_ends.clear();
        self.add_blade(blade.unwrap_or_default());
    }

    /// Adds another blade until the next [`RenderScene::set_blade`].
    pub fn add_blade(&mut self, blade: &[DVec3]) {
        self.blade_points.extend_from_slice(blade);
        self.blade_ends.push(self.blade_points.len());
    }

    /// Bounding box of all bodies at the host's positions: see [`Simulation::read_back`]. O(triangles).
    #[must_use]
    pub fn bounds(&self, simulation: &Simulation) -> [DVec3; 2] {
        let positions = simulation.positions();
        let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for v in self.skin.triangles().iter().flatten() {
            let x = positions[self.skin.vertices()[*v as usize].particle.index()];
            bounds = [bounds[0].min(x), bounds[1].max(x)];
        }
        if bounds[0].is_finite() {
            bounds
        } else {
            [DVec3::ZERO; 2]
        }
    }

    /// Triangles of the skin.
    #[must_use]
    pub fn skin(&self) -> &Skin {
        &self.skin
    }

    /// For each triangle its edges on the rim of a cut: bit k for the edge opposite to corner k.
    pub(crate) fn rims(&self) -> &[u32] {
        &self.rims
    }

    /// Color of each triangle in sRGB from the last [`RenderScene::color`]; `None` for one that is drawn as tissue.
    #[must_use]
    pub fn color_of(&self, triangle: usize) -> Option<[u8; 3]> {
        let word = self.colors.get(triangle).copied().unwrap_or(NONE);
        let [r, g, b, alpha] = word.to_le_bytes();
        (alpha > 0).then_some([r, g, b])
    }

    /// Colors for a style: one per triangle, or an empty slice.
    pub(crate) fn colors_for(&self, by: ColorBy) -> &[u32] {
        if by == self.shown { &self.colors } else { &[] }
    }

    pub(crate) fn time(&self) -> f64 {
        self.time
    }

    pub(crate) fn ground(&self) -> Option<GroundSpec> {
        self.ground
    }

    pub(crate) fn obstacles(&self) -> &[ColliderSpec] {
        &self.obstacles
    }

    /// Polylines of all blades.
    pub(crate) fn blades(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(&0).chain(&self.blade_ends);
        let ranges = starts.zip(&self.blade_ends);
        ranges.map(|(start, end)| &self.blade_points[*start..*end])
    }

    /// Bounding box of the bodies at the start.
    pub(crate) fn start(&self) -> [DVec3; 2] {
        self.start
    }
}

/// Returns a revision that is unique in the process.
fn revision() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}
