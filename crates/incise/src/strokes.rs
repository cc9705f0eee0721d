//! [`Timeline`]: the strokes of a scene, carried out frame by frame.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_cutting::{
    BoundaryTriangle, CutDelta, CutOptions, FaceTag, StrokeRegistry, Sweep, carve, cut_level_set,
    cut_plane, cut_surface_joining, join_ends,
};

use crate::island::Island;
use crate::live_blade::LiveBlade;
use crate::pinned_cut::{find, meets_pinned};
use crate::recuts::Recuts;
use crate::report::CutWork;
use crate::scene::{Scene, SolidBladeSpec, StrokeSpec, pose};
use crate::solid_blade::{FrameBlade, SolidBlade};
use crate::tool::{MissedStroke, Tool, tool};
use crate::validate::value;
use crate::warning::Warning;
use crate::{Error, Event};

/// A stroke and its progress.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Stroke {
    field: String,
    tool: Tool,
    options: CutOptions,
    /// The frames in which it cuts first and last; a live one from the start on and for as long as it is held.
    frames: [u64; 2],
    /// One for each island of bodies once a blade has its first pose.
    sweeps: Vec<Sweep>,
    /// Whether it has changed a mesh.
    has_cut: bool,
    /// The body of its blade, if it has one.
    solid: Option<SolidBlade>,
    /// Whether it has opened a face with a pinned corner.
    meets_pinned: bool,
    /// Whether its blade has left and only the cut of the last frame is to be made.
    is_closing: bool,
}

/// The strokes that are not finished.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Timeline {
    strokes: Vec<Stroke>,
    added: u32,
    /// Smallest snap distance: rounding of the positions in the solver's precision.
    tolerance: f64,
    /// Largest volume of a crumb, as in [`CutOptions::crumbs`].
    crumbs: f64,
    /// Whether meshes are improved where strokes cut what earlier ones have cut.
    improves: bool,
    /// Whether strokes that end at each other are joined.
    joins_ends: bool,
    /// For each island what is cut again; empty before the first stroke.
    recuts: Vec<Recuts>,
    /// For each island what its strokes leave for later ones to join; empty before the first stroke.
    registries: Vec<StrokeRegistry>,
    /// The number of the stroke that has cut last.
    latest: u32,
    /// Strokes that began or ended to cut since the events were taken.
    events: Vec<Event>,
    /// Strokes that ended without a cut since they were taken.
    missed: Vec<MissedStroke>,
    /// Warnings about other strokes that ended since they were taken.
    warnings: Vec<Warning>,
    /// The blades with a body in the last frame.
    #[cfg_attr(feature = "save", serde(skip))]
    solids: Vec<FrameBlade>,
    /// Of the strokes whose blades have a toughness: what they have parted, by number.
    works: BTreeMap<u32, CutWork>,
    /// Work in J of the cuts since it was taken: toughness times new area.
    new_work: f64,
}

impl Timeline {
    pub(crate) fn new(tolerance: f64, scene: &Scene) -> Self {
        Self {
            tolerance,
            crumbs: scene.cutting.crumbs,
            improves: scene.cutting.improve,
            joins_ends: scene.cutting.join_ends,
            ..Self::default()
        }
    }

    /// Adds a stroke, if all its values are in their ranges. Faces that it opens are tagged with its number, counted
    /// from 0 in the order of adding.
    pub(crate) fn add(&mut self, spec: &StrokeSpec) -> Result<(), Error> {
        let field = self.next_field();
        let (tool, snap) = tool(&field, spec)?;
        let solid = match spec {
            StrokeSpec::Sweep {
                solid: Some(solid),
                blade,
                ..
            } => Some(SolidBlade::new(&field, solid, blade.len())?),
            _ => None,
        };
        self.push(
            field,
            tool,
            snap,
            solid,
            [spec.first_frame(), spec.last_frame()],
        )
    }

    fn next_field(&self) -> String {
        format!("stroke[{}]", self.added)
    }

    fn push(
        &mut self,
        field: String,
        tool: Tool,
        snap: f64,
        solid: Option<SolidBlade>,
        frames: [u64; 2],
    ) -> Result<(), Error> {
        let options = CutOptions {
            snap,
            tolerance: self.tolerance,
            crumbs: self.crumbs,
            tag: self.added,
            ..CutOptions::default()
        };
        options
            .check()
            .map_err(Error::cut(&format!("{field}.snap")))?;
        // Exact cuts leave slivers, which would come off with what is joined.
        let ends = matches!(
            tool,
            Tool::Surface { .. } | Tool::Sweep { .. } | Tool::Live(_)
        );
        self.joins_ends &= !(ends && snap == 0.0);
        self.strokes.push(Stroke {
            field,
            tool,
            options,
            frames,
            sweeps: Vec::new(),
            has_cut: false,
            solid,
            meets_pinned: false,
            is_closing: false,
        });
        if self.strokes.last().is_some_and(Stroke::is_tough) {
            self.works.insert(self.added, CutWork::default());
        }
        self.added += 1;
        Ok(())
    }

    /// Adds a stroke whose blade is moved by [`Timeline::move_blade`]; returns its number.
    pub(crate) fn begin(
        &mut self,
        pose: &[DVec3],
        snap: f64,
        solid: Option<&SolidBladeSpec>,
    ) -> Result<u32, Error> {
        let field = self.next_field();
        let blade = LiveBlade::new(&field, pose)?;
        let solid = solid.map(|spec| SolidBlade::new(&field, spec, pose.len()));
        let number = self.added;
        self.push(
            field,
            Tool::Live(blade),
            snap,
            solid.transpose()?,
            [0, u64::MAX],
        )?;
        Ok(number)
    }

    /// The key of a stroke with a solid blade that has not ended, if there is one.
    pub(crate) fn solid_field(&self) -> Option<&str> {
        let mut solid = self.strokes.iter().filter(|stroke| stroke.solid.is_some());
        solid.next().map(|stroke| stroke.field.as_str())
    }

    /// The blades with a body in the last frame.
    pub(crate) fn solids(&self) -> &[FrameBlade] {
        &self.solids
    }

    /// Notes that the solid blade of a stroke touches what it has cut.
    pub(crate) fn note_touch(&mut self, stroke: u32) {
        let mut strokes = self.strokes.iter_mut();
        let touching = strokes.find(|other| other.options.tag == stroke);
        if let Some(solid) = touching.and_then(|stroke| stroke.solid.as_mut()) {
            solid.note_touch();
        }
    }

    /// What the blade of a stroke has parted so far; `None` without a toughness.
    pub(crate) fn work(&self, stroke: u32) -> Option<CutWork> {
        self.works.get(&stroke).copied()
    }

    /// Adds the work in J that the edge of a stroke's blade has done in a frame.
    pub(crate) fn add_work(&mut self, stroke: u32, work: f64) {
        if let Some(sum) = self.works.get_mut(&stroke) {
            sum.work += work;
        }
    }

    /// Toughness times new area, in J, of the cuts since the last call; `None` if there is none.
    pub(crate) fn take_new_work(&mut self) -> Option<f64> {
        let work = std::mem::take(&mut self.new_work);
        (work > 0.0).then_some(work)
    }

    /// Sets the blade of a live stroke for the start of the next frame.
    pub(crate) fn move_blade(&mut self, stroke: u32, pose: &[DVec3]) -> Result<(), Error> {
        let (_, field, blade) = self.live(stroke)?;
        blade.go_to(field, pose)
    }

    /// Ends a live stroke: after the next frame if that has a pose to carry out, or else at once.
    pub(crate) fn end(&mut self, stroke: u32, islands: &[Island]) -> Result<(), Error> {
        let (place, _, blade) = self.live(stroke)?;
        if !blade.end() {
            let closing = &mut self.strokes[place];
            if closing.has_work_left() {
                closing.is_closing = true;
                return Ok(());
            }
            let stroke = self.strokes.remove(place);
            self.events.extend(stroke.end());
            self.missed.extend(stroke.missed());
            self.warnings.extend(stroke.pinned(islands));
        }
        Ok(())
    }

    /// Finds a live stroke that has not ended: its place in the list, its name and its blade.
    fn live(&mut self, number: u32) -> Result<(usize, &str, &mut LiveBlade), Error> {
        let strokes = self.strokes.iter_mut().enumerate();
        let mut live = strokes.filter_map(|(place, stroke)| match &mut stroke.tool {
            Tool::Live(blade)
                if stroke.options.tag == number && !blade.is_ended() && !stroke.is_closing =>
            {
                Some((place, stroke.field.as_str(), blade))
            }
            _ => None,
        });
        let range = "the number of a stroke that was begun and has not ended";
        live.next().ok_or_else(|| value("stroke", number, range))
    }

    /// About the bytes of what its strokes know of so many particles, of which some are on a cut.
    pub(crate) fn bytes(&self, particles: usize, on_cut: usize) -> usize {
        // Where a blade met them last, and in which tiles they are.
        const UNDER_WAY: usize = 70;
        // What earlier strokes know of them, in a table that is mostly half full.
        const REMEMBERED: usize = 250;
        let under_way = self
            .strokes
            .iter()
            .filter(|stroke| !stroke.sweeps.is_empty());
        let remembered = if self.registries.is_empty() {
            0
        } else {
            on_cut
        };
        // Which stroke made them.
        let made = if self.recuts.is_empty() { 0 } else { particles };
        UNDER_WAY * particles * under_way.count()
            + REMEMBERED * remembered
            + size_of::<Option<u32>>() * made
    }

    /// The strokes that began or ended to cut since the last call.
    pub(crate) fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// The strokes that have ended without a cut since the last call.
    pub(crate) fn take_missed(&mut self) -> Vec<MissedStroke> {
        std::mem::take(&mut self.missed)
    }

    /// The warnings about strokes that have ended since the last call, other than about missed ones.
    pub(crate) fn take_warnings(&mut self) -> Vec<Warning> {
        std::mem::take(&mut self.warnings)
    }

    /// Whether a stroke begins or continues in a frame.
    pub(crate) fn is_due(&self, frame: u64) -> bool {
        self.strokes.iter().any(|stroke| stroke.frames[0] <= frame)
            || self.has_recuts()
            || self.has_new_ends()
    }

    /// Whether strokes in an island have cut since their ends were joined, if they are.
    fn has_new_ends(&self) -> bool {
        self.joins_ends && self.registries.iter().any(StrokeRegistry::has_new_ends)
    }

    /// Whether an island waits for its improvement.
    fn has_recuts(&self) -> bool {
        self.recuts.iter().any(|recuts| !recuts.queue.is_empty())
    }

    /// Returns an error that names a stroke whose blade moves through the bodies, since it follows each island's mesh.
    pub(crate) fn check_join(&self) -> Result<(), Error> {
        let mut strokes = self.strokes.iter();
        match strokes.find(|stroke| !stroke.sweeps.is_empty()) {
            Some(stroke) => {
                let range = "a stroke that has ended when bodies are joined";
                Err(value(&stroke.field, "under way", range))
            }
            None => Ok(()),
        }
    }

    /// Notes that island `other` was appended to island `into`, which had so many particles.
    pub(crate) fn join(&mut self, into: usize, other: usize, particles: usize) {
        if other < self.recuts.len() {
            let of_other = self.recuts.remove(other);
            self.recuts[into].append(&of_other, particles);
        }
        if other < self.registries.len() {
            let of_other = self.registries.remove(other);
            self.registries[into].append(&of_other, particles);
        }
    }

    /// Applies a delta of an island that no stroke made to what strokes keep of its mesh.
    pub(crate) fn apply_delta(&mut self, number: usize, island: &Island, delta: &CutDelta) {
        for stroke in &mut self.strokes {
            if let Some(sweep) = stroke.sweeps.get_mut(number) {
                sweep.apply_delta(&island.cuttable, delta);
            }
        }
        if let Some(registry) = self.registries.get_mut(number) {
            registry.apply_delta(&island.cuttable, delta, &CutOptions::default());
        }
        if let Some(recuts) = self.recuts.get_mut(number) {
            recuts.apply_delta(delta, None);
        }
    }

    /// Carries out the strokes that are due in `frame` on every island. Passes each delta to `apply_delta` before the
    /// next stroke moves, and keeps the islands' positions current.
    pub(crate) fn advance(
        &mut self,
        frame: u64,
        islands: &mut [Island],
        mut apply_delta: impl FnMut(usize, &mut Island, &CutDelta) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.solids.clear();
        // A live stroke may have ended since the last frame and left its ends and its improvement.
        if self.strokes.is_empty() && !self.has_recuts() && !self.has_new_ends() {
            return Ok(());
        }
        self.registries
            .resize_with(islands.len(), StrokeRegistry::default);
        let island_count = islands.len();
        for i in 0..self.strokes.len() {
            for (g, island) in islands.iter_mut().enumerate() {
                let stroke = &mut self.strokes[i];
                let Some(delta) = stroke.advance(frame, g, island, &mut self.registries[g])? else {
                    continue;
                };
                if delta.is_empty() {
                    continue;
                }
                if !std::mem::replace(&mut stroke.has_cut, true) {
                    let stroke = stroke.options.tag;
                    self.events.push(Event::CutBegan { stroke });
                }
                self.latest = stroke.options.tag;
                delta.extend_particles(&mut island.positions);
                if self.improves {
                    self.recuts.resize_with(island_count, Recuts::default);
                    self.recuts[g].apply_delta(&delta, Some(stroke.options.tag));
                }
                for other in self.strokes.iter_mut().enumerate().filter(|(j, _)| *j != i) {
                    if let Some(sweep) = other.1.sweeps.get_mut(g) {
                        sweep.apply_delta(&island.cuttable, &delta);
                    }
                }
                apply_delta(g, island, &delta)?;
                let stroke = &mut self.strokes[i];
                stroke.meets_pinned |= meets_pinned(island, &delta, stroke.options.tag);
                if let Some(sum) = self.works.get_mut(&stroke.options.tag) {
                    let area = new_area(island, &delta, stroke.options.tag);
                    sum.area += area;
                    self.new_work += stroke.toughness() * area;
                }
            }
        }
        let has_blade = |stroke: &&mut Stroke| stroke.frames[0] <= frame && !stroke.is_closing;
        for stroke in self.strokes.iter_mut().filter(has_blade) {
            let pose = stroke.pose(frame);
            let (tag, toughness) = (stroke.options.tag, stroke.toughness());
            if let (Some(solid), Some(pose)) = (&mut stroke.solid, pose) {
                let done = self.works.get(&tag);
                let owes = done.is_some_and(|done| done.work < toughness * done.area);
                let blade = solid.advance(tag, &pose);
                self.solids
                    .extend(blade.map(|blade| FrameBlade { owes, ..blade }));
            }
        }
        let (events, missed) = (&mut self.events, &mut self.missed);
        let warnings = &mut self.warnings;
        self.strokes.retain_mut(|stroke| {
            let has_blade = !stroke.is_closing
                && match &mut stroke.tool {
                    Tool::Live(blade) => blade.arrive(),
                    _ => frame < stroke.frames[1],
                };
            stroke.is_closing = !has_blade && stroke.has_work_left();
            let goes_on = has_blade || stroke.is_closing;
            if !goes_on {
                events.extend(stroke.end());
                missed.extend(stroke.missed());
                warnings.extend(stroke.pinned(islands));
            }
            goes_on
        });
        // A blade on its way relies on the particles around its front.
        if self.strokes.iter().any(|stroke| !stroke.sweeps.is_empty()) {
            return Ok(());
        }
        for (g, registry) in self.registries.iter_mut().enumerate() {
            if !self.joins_ends || !registry.has_new_ends() {
                continue;
            }
            let island = &mut islands[g];
            let delta = join_ends(&mut island.cuttable, registry, self.latest);
            if delta.is_empty() {
                continue;
            }
            delta.extend_particles(&mut island.positions);
            if let Some(recuts) = self.recuts.get_mut(g) {
                recuts.apply_delta(&delta, Some(self.latest));
            }
            apply_delta(g, island, &delta)?;
        }
        for (g, recuts) in self.recuts.iter_mut().enumerate() {
            if recuts.queue.is_empty() {
                continue;
            }
            let island = &mut islands[g];
            let delta = island.improve(&mut recuts.queue, &self.registries[g])?;
            if !delta.is_empty() {
                apply_delta(g, island, &delta)?;
            }
        }
        Ok(())
    }
}

impl Stroke {
    /// Returns the event of the stroke's end, if it has cut.
    fn end(&self) -> Option<Event> {
        let stroke = self.options.tag;
        self.has_cut.then_some(Event::CutEnded { stroke })
    }

    /// Work in J that its blade needs to part a square meter.
    fn toughness(&self) -> f64 {
        self.solid.as_ref().map_or(0.0, SolidBlade::toughness)
    }

    /// Whether its cuts come a frame later than its blade.
    fn is_tough(&self) -> bool {
        self.solid.as_ref().is_some_and(SolidBlade::is_tough)
    }

    /// Whether the cut of the last frame is still to be made when its blade leaves.
    fn has_work_left(&self) -> bool {
        self.is_tough() && !self.is_closing && !self.sweeps.is_empty()
    }

    /// The pose of its blade in a frame, if it has a blade and has begun.
    fn pose(&self, frame: u64) -> Option<Vec<DVec3>> {
        match &self.tool {
            Tool::Sweep { blade, path } => {
                Some(pose(blade.iter().copied(), path, self.frames, frame))
            }
            Tool::Live(blade) => Some(blade.pose().to_vec()),
            _ => None,
        }
    }

    /// Returns warnings about cuts that pinned particles keep closed.
    fn pinned(&self, islands: &[Island]) -> Vec<Warning> {
        if !self.meets_pinned {
            return Vec::new();
        }
        let cuts = islands
            .iter()
            .filter_map(|island| find(island, self.options.tag));
        cuts.map(|cut| cut.warning(&self.field)).collect()
    }

    /// Returns the stroke as one that missed all bodies, if it has not cut. A live blade that was not moved did not miss.
    fn missed(&self) -> Option<MissedStroke> {
        let reach = self.tool.reach().filter(|_| !self.has_cut)?;
        let field = self.field.clone();
        Some(MissedStroke { field, reach })
    }

    /// Cuts, or moves, in the island of the given number.
    fn advance(
        &mut self,
        frame: u64,
        number: usize,
        island: &mut Island,
        registry: &mut StrokeRegistry,
    ) -> Result<Option<CutDelta>, Error> {
        let [first, last] = self.frames;
        if frame < first {
            return Ok(None);
        }
        let (cuttable, positions, options) =
            (&mut island.cuttable, &island.positions, &self.options);
        let sweeps = &mut self.sweeps;
        // Tissue has decided in the last frame how far a blade with a toughness got.
        let tough = self.solid.as_ref().filter(|solid| solid.is_tough());
        let arrived = tough.and_then(SolidBlade::last_pose);
        let mut sweep = |pose: &[DVec3]| match sweeps.get_mut(number) {
            Some(sweep) => sweep.advance_joining(cuttable, positions, pose, registry),
            None => Sweep::new(cuttable, positions, pose, *options).map(|sweep| {
                sweeps.push(sweep);
                CutDelta::default()
            }),
        };
        let cut = match &self.tool {
            Tool::Sweep { .. } | Tool::Live(_) if arrived.is_some() => {
                sweep(arrived.as_ref().map_or(&[], <[DVec3; 2]>::as_slice))
            }
            Tool::Sweep { blade, path } => {
                sweep(&pose(blade.iter().copied(), path, [first, last], frame))
            }
            Tool::Live(blade) => sweep(blade.pose()),
            Tool::Surface { surface, .. } => {
                cut_surface_joining(cuttable, positions, surface, options, registry)
            }
            Tool::Plane(plane) => cut_plane(cuttable, positions, plane, options),
            Tool::Punch(solid) => {
                cut_level_set(cuttable, positions, |x| solid.distance(x), options)
            }
            Tool::Remove(solid) => carve(cuttable, positions, |x| solid.contains(x), options.tag),
        };
        let delta = cut.map_err(Error::cut(&self.field))?;
        let joins = matches!(
            self.tool,
            Tool::Sweep { .. } | Tool::Live(_) | Tool::Surface { .. }
        );
        if !joins && !delta.is_empty() {
            registry.apply_delta(&island.cuttable, &delta, &self.options);
        }
        Ok(Some(delta))
    }
}

/// The area in m² at rest, of one side, that a delta of a stroke has opened.
fn new_area(island: &Island, delta: &CutDelta, stroke: u32) -> f64 {
    let rest = &island.cuttable.mesh().positions;
    let area = |triangles: &[BoundaryTriangle]| {
        let of_stroke = triangles
            .iter()
            .filter(|triangle| triangle.tag == FaceTag::Cut(stroke));
        let areas = of_stroke.map(|triangle| {
            let [a, b, c] = triangle.particles.map(|p| rest[p.index()]);
            0.5 * (b - a).cross(c - a).length()
        });
        areas.sum::<f64>()
    };
    0.5 * (area(&delta.surface_added) - area(&delta.surface_removed))
}
