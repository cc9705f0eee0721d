//! [`Pictures`]: images of a run: one for each saved frame, a contact sheet and an animation.
//!
//! An animation has about 25 images for each second of simulated time, or the number of `--fps`, independent of the frames
//! that are saved. It shows the simulated time as it is: an image stands for the first frame at or after its time.
//!
//! Without `--view` the camera steps back where bodies would leave the image. What falls far away is given up: the camera
//! returns to the rest.

use std::path::{Path, PathBuf};

use incise::mesh::glam::DVec3;
use incise::scene::StrokeSpec;
use incise::{Scene, Simulation};
use incise_render::{
    Animation, Camera, ColorBy, Image, RenderError, RenderScene, Renderer, Style, contact_sheet,
};

use crate::args::RunArguments;
use crate::failure::Failure;
use crate::files::{require_file, save_every};

/// Width and height of an image in pixels.
const SIZE: [u32; 2] = [640, 480];
/// Default azimuth and elevation in degrees, and zoom.
const VIEW: [f64; 3] = [-60.0, 22.0, 1.0];
/// Smallest number of images of an animation for each second.
const PER_SECOND: f64 = 25.0;
/// Images on the contact sheet and in its rows.
const ON_SHEET: u64 = 12;
const COLUMNS: usize = 4;
/// Largest width of an image on the contact sheet in pixels.
const SHEET_WIDTH: u32 = 360;
/// Part of the particles outside of the image from which bodies have left it.
const LEFT: f64 = 0.1;
/// Part of the particles outside of the image from which the camera steps back.
const FEW: f64 = 0.01;
/// How near to the side of the image, in half images, particles are when it has.
const CLOSEST: f64 = 0.9;
/// What is further from the middle of the start than this many diagonals of the box that the camera shows then is given up.
const FARTHEST: f64 = 2.0;
/// Smallest zoom at which a body is still more than a dot.
const SMALLEST_ZOOM: f64 = 0.05;
/// A ground deeper below the bodies than this many of their diagonals is not included in the view.
const DEEPEST: f64 = 3.0;

/// Draws the images of a run.
#[derive(Debug)]
pub(crate) struct Pictures {
    renderer: Renderer,
    note: Option<String>,
    render_scene: RenderScene,
    camera: Camera,
    /// Azimuth and elevation in degrees, and zoom.
    view: [f64; 3],
    /// The box that the camera shows, at the start and now.
    start: [DVec3; 2],
    shown: [DVec3; 2],
    /// Whether the camera steps back.
    follows: bool,
    /// The number of particles that were given up.
    lost: usize,
    style: Style,
    size: [u32; 2],
    strokes: Vec<StrokeSpec>,
    /// True if saved frames get an image file.
    saved: bool,
    animation: Option<PathBuf>,
    writer: Option<Animation>,
    /// Seconds from one image of the animation to the next.
    image_time: f64,
    /// Images of the animation so far.
    images: u64,
    time_step: f64,
    /// The frames on the sheet, ascending.
    on_sheet: Vec<u64>,
    sheet: Vec<(Image, String)>,
    count: u64,
    /// The first picture that bodies have left, and how far from the middle they are at most, in half images.
    left: Option<u64>,
    widest: f64,
}

impl Pictures {
    /// Images as requested by the arguments; `None` without any.
    pub(crate) fn of(
        arguments: &RunArguments,
        scene: &Scene,
        simulation: &Simulation,
        frames: u64,
    ) -> Result<Option<Self>, Failure> {
        if !arguments.draws() {
            return Ok(None);
        }
        let (renderer, note) = Renderer::for_simulation(simulation);
        let render_scene = RenderScene::new(simulation, scene);
        let time_step = scene.solver.time_step;
        let image_time = match arguments.fps {
            Some(rate) if rate * time_step > 1.0 + 1e-9 => {
                return Err(Failure::Input(anyhow::anyhow!(
                    "--fps {rate}: the scene has {} frames per second (solver.time_step = {time_step}); give no more",
                    (1e4 / time_step).round() / 1e4
                )));
            }
            Some(rate) => 1.0 / rate,
            None => animation_every(time_step) as f64 * time_step,
        };
        let view = arguments.view.unwrap_or(VIEW);
        let size = arguments.size.unwrap_or(SIZE);
        let shown = with_ground(scene, render_scene.bounds(simulation));
        Ok(Some(Self {
            renderer,
            note,
            camera: camera(shown, view, size),
            view,
            start: shown,
            shown,
            follows: arguments.view.is_none(),
            lost: 0,
            render_scene,
            style: Style {
                color_by: arguments.color_by,
                wireframe: arguments.wireframe,
                ..Style::default()
            },
            size,
            strokes: scene.stroke.clone(),
            saved: !arguments.no_pictures,
            animation: arguments.animation.clone(),
            writer: None,
            image_time,
            images: 0,
            time_step,
            on_sheet: if arguments.no_pictures {
                Vec::new()
            } else {
                on_sheet(frames)
            },
            sheet: Vec::new(),
            count: 0,
            left: None,
            widest: 0.0,
        }))
    }

    /// Creates the file of the animation, if one is requested, so that a path that cannot be written fails before the run.
    pub(crate) fn begin_animation(&mut self) -> anyhow::Result<()> {
        if let Some(path) = &self.animation {
            // The folder of the run exists by now.
            require_file(path)?;
            self.writer = Some(Animation::create(path, self.size, self.image_time)?);
        }
        Ok(())
    }

    /// Updates the render scene after a frame and draws the frame if it is saved or part of the animation. `saved` is
    /// true if files of this frame are written.
    pub(crate) fn frame(
        &mut self,
        simulation: &mut Simulation,
        saved: bool,
        folder: &Path,
    ) -> anyhow::Result<()> {
        self.render_scene.sync(simulation);
        let frame = simulation.report().frame;
        let saved = saved && self.saved;
        let animated =
            self.writer.is_some() && is_due(frame, self.time_step, self.images, self.image_time);
        if !(saved || animated) {
            return Ok(());
        }
        let picture = self.draw(simulation)?;
        self.note_view(simulation);
        if saved {
            picture.write_png(folder.join(format!("frame_{frame:05}.png")))?;
            self.count += 1;
        }
        if let Some(animation) = self.writer.as_mut().filter(|_| animated) {
            animation.push(&picture)?;
            self.images += 1;
        }
        if saved && self.on_sheet.binary_search(&frame).is_ok() {
            let report = simulation.report();
            let pieces = match report.pieces {
                1 => "1 piece".to_owned(),
                pieces => format!("{pieces} pieces"),
            };
            let caption = format!("frame {frame}  {:.2} s  {pieces}", report.time_s);
            let smaller = picture.shrunk(self.size[0].div_ceil(SHEET_WIDTH));
            self.sheet.push((smaller, caption));
        }
        Ok(())
    }

    fn draw(&mut self, simulation: &mut Simulation) -> Result<Image, RenderError> {
        if self
            .renderer
            .needs_read_back(&self.render_scene, simulation)
        {
            simulation.read_back()?;
        }
        if self.follows {
            self.step_back(simulation.positions());
        }
        let frame = simulation.report().frame;
        self.render_scene.set_blade(None);
        for blade in self
            .strokes
            .iter()
            .filter_map(|stroke| stroke.blade_at(frame))
        {
            self.render_scene.add_blade(&blade);
        }
        let by = self.style.color_by;
        let wanted = by == ColorBy::Residual;
        let residuals = wanted.then(|| simulation.residuals_of_tets()).flatten();
        self.render_scene
            .color(simulation, by, residuals.as_deref())?;
        let (render_scene, camera) = (&self.render_scene, &self.camera);
        self.renderer
            .picture(render_scene, simulation, camera, &self.style, self.size)
    }

    /// How far a point is from the middle of the image, in half images; more than 1 outside.
    fn across(&self, x: DVec3) -> f64 {
        let size = self.size.map(f64::from);
        let pixel = self.camera.project(x, size);
        pixel.map_or(f64::INFINITY, |p| {
            let [right, down] = [p.x / size[0], p.y / size[1]].map(|part| (2.0 * part - 1.0).abs());
            right.max(down)
        })
    }

    /// Whether more than a part of the particles is outside of the image.
    fn have_left(&self, positions: &[DVec3], part: f64) -> bool {
        let outside = positions.iter().filter(|x| self.across(**x) > 1.0).count();
        outside as f64 > part * positions.len() as f64
    }

    /// Moves the camera away where particles are outside of the image, so that it shows all but a few of those that are not
    /// given up, and back to the start where more are given up.
    fn step_back(&mut self, all: &[DVec3]) {
        let [low, high] = self.start;
        let (middle, farthest) = ((low + high) / 2.0, FARTHEST * low.distance(high));
        let near = |x: &DVec3| x.distance(middle) <= farthest;
        let positions: Vec<DVec3> = all.iter().copied().filter(near).collect();
        let lost = all.len() - positions.len();
        if lost > self.lost {
            self.shown = self.start;
            self.camera = camera(self.start, self.view, self.size);
        }
        self.lost = lost;
        if !self.have_left(&positions, FEW) {
            return;
        }
        let [low, high] = middle_of(&positions, FEW / 8.0);
        let [shown_low, shown_high] = self.shown;
        self.shown = [low.min(shown_low), high.max(shown_high)];
        self.camera = camera(self.shown, self.view, self.size);
        let farthest = self.camera.distance;
        // The corners of the box may be empty. What is near the eye moves out faster than the rest.
        for _ in 0..4 {
            let mut across: Vec<f64> = positions.iter().map(|x| self.across(*x)).collect();
            across.sort_unstable_by(f64::total_cmp);
            let widest = across[part_of(1.0 - FEW / 8.0, across.len())];
            self.camera.zoom(widest / CLOSEST);
            // What lies outside of the box does not count.
            self.camera.distance = self.camera.distance.min(farthest);
        }
    }

    /// Notes whether bodies have left the image.
    fn note_view(&mut self, simulation: &Simulation) {
        let positions = simulation.positions();
        let distances = positions.iter().map(|x| self.across(*x));
        self.widest = distances.fold(self.widest, f64::max);
        if self.have_left(positions, LEFT) {
            self.left.get_or_insert(simulation.report().frame);
        }
    }

    /// A line about bodies that have left the picture.
    fn view_note(&self) -> Option<String> {
        let frame = self.left?;
        let [azimuth, elevation, zoom] = self.view;
        let zoom = 0.95 * zoom / self.widest;
        let fix = if zoom < SMALLEST_ZOOM {
            String::new()
        } else {
            format!(": --view={azimuth},{elevation},{zoom:.2} shows them")
        };
        Some(format!("bodies leave the picture at frame {frame}{fix}"))
    }

    /// Completes the contact sheet and the animation; returns lines about them.
    pub(crate) fn finish(self, folder: &Path) -> anyhow::Result<String> {
        let view_note = self.view_note();
        let mut written = Vec::new();
        if self.saved {
            contact_sheet(&self.sheet, COLUMNS).write_png(folder.join("contact_sheet.png"))?;
            written.push(format!(
                "{} pictures and contact_sheet.png are in {}",
                self.count,
                folder.display()
            ));
        }
        if let (Some(animation), Some(path)) = (self.writer, &self.animation) {
            animation.finish()?;
            written.push(format!("animation: {}", path.display()));
        }
        let renderer = self.renderer.describe();
        let why = self.note.map(|note| format!(": {note}"));
        let why = why.unwrap_or_default();
        let line = format!("{}, drawn by {renderer}{why}", written.join(", "));
        Ok(match view_note {
            Some(note) => format!("{line}\n{note}"),
            None => line,
        })
    }
}

/// A box around the bodies and, if it is near, the ground below them.
fn with_ground(scene: &Scene, [mut low, high]: [DVec3; 2]) -> [DVec3; 2] {
    let deepest = low.z - DEEPEST * (high - low).length();
    if let Some(ground) = scene.world.ground.filter(|ground| ground.height > deepest) {
        low.z = low.z.min(ground.height);
    }
    [low, high]
}

/// The number of the first of `count` sorted things beyond a part of them.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a count"
)]
fn part_of(part: f64, count: usize) -> usize {
    (part * (count - 1) as f64) as usize
}

/// A box around all points but a part of them at either side of each axis.
fn middle_of(points: &[DVec3], part: f64) -> [DVec3; 2] {
    let out = part_of(part, points.len());
    let mut bounds = [DVec3::ZERO; 2];
    for axis in 0..3 {
        let mut along: Vec<f64> = points.iter().map(|x| x[axis]).collect();
        along.sort_unstable_by(f64::total_cmp);
        bounds[0][axis] = along[out];
        bounds[1][axis] = along[along.len() - 1 - out];
    }
    bounds
}

/// A camera that shows a box.
fn camera([low, high]: [DVec3; 2], [azimuth, elevation, zoom]: [f64; 3], size: [u32; 2]) -> Camera {
    let mut camera = Camera::fit(low, high);
    camera.azimuth = azimuth.to_radians();
    camera.elevation = elevation.to_radians();
    let [width, height] = size.map(f64::from);
    // Wide images keep room at the sides for pieces that fall off.
    camera.fit_distance(low, high, (width / height).min(1.0));
    camera.zoom(1.0 / zoom);
    camera
}

/// True if a frame is at or after the time of an image, up to rounding.
fn is_due(frame: u64, time_step: f64, image: u64, image_time: f64) -> bool {
    let (now, wanted) = (frame as f64 * time_step, image as f64 * image_time);
    now >= wanted - 1e-9 * time_step.max(wanted)
}

/// Frames from one image of an animation to the next.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at least 1; what is beyond all frames is as good as any other"
)]
fn animation_every(time_step: f64) -> u64 {
    // The small term keeps exact fractions from being rounded down.
    (1.0 / (PER_SECOND * time_step) + 1e-9).floor().max(1.0) as u64
}

/// The frames on the contact sheet: evenly spread over those that are saved.
fn on_sheet(frames: u64) -> Vec<u64> {
    let every = save_every(frames);
    let last = frames - 1;
    // The last frame is always saved.
    let saved = last.div_ceil(every) + 1;
    let count = saved.min(ON_SHEET);
    (0..count)
        .map(|i| (i * (saved - 1) + (count - 1) / 2) / (count - 1).max(1))
        .map(|saved| (saved * every).min(last))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_have_the_first_and_the_last_frame() {
        assert_eq!(on_sheet(1), [0]);
        assert_eq!(on_sheet(2), [0, 1]);
        assert_eq!(on_sheet(12), (0..12).collect::<Vec<_>>());
        for frames in 1..400 {
            let sheet = on_sheet(frames);
            let saved =
                (0..frames).filter(|f| f.is_multiple_of(save_every(frames)) || f + 1 == frames);
            assert_eq!(sheet.len(), saved.count().min(12), "{frames}");
            assert_eq!((sheet[0], sheet.last()), (0, Some(&(frames - 1))));
            assert!(
                sheet.windows(2).all(|pair| pair[0] < pair[1]),
                "{frames}: {sheet:?}"
            );
            let kept = |f: &u64| f.is_multiple_of(save_every(frames)) || f + 1 == frames;
            assert!(sheet.iter().all(kept), "{frames}: {sheet:?}");
        }
    }

    /// The number of images is that of a clock of this rate, and each is at most a frame late.
    #[test]
    fn images_keep_their_rate() {
        for (time_step, rate) in [
            (0.016, 30.0),
            (0.01, 50.0),
            (0.016, 62.5),
            (0.001, 24.0),
            (0.02, 0.7),
        ] {
            let mut images = 0;
            for frame in 0..20_000_u64 {
                if is_due(frame, time_step, images, 1.0 / rate) {
                    let late = frame as f64 * time_step - images as f64 / rate;
                    assert!(
                        (-1e-6..time_step).contains(&late),
                        "{time_step} {rate}: {late}"
                    );
                    images += 1;
                }
            }
            let expected = 19_999.0 * time_step * rate;
            assert!(
                (images as f64 - expected).abs() <= 1.0 + 1e-6,
                "{images} {expected}"
            );
        }
    }

    #[test]
    fn animations_have_25_images_a_second() {
        assert_eq!(
            [0.001, 0.01, 0.016, 0.02, 0.04, 0.5].map(animation_every),
            [40, 4, 2, 2, 1, 1]
        );
    }
}
