//! [`Contacts`]: pairs, vertices against triangles and edges against edges on the device.
//!
//! The host finds contacts, colors them and hands them to its solver; here they are stored in solving order, each color
//! padded to whole groups of 64. A color is a dispatch, and consecutive colors of one group are one dispatch together.
//! The contacts of a tail, which one thread of the host solves in order, are divided into steps: a contact comes one step
//! after the last one before it that has a particle of it. So contacts that meet are solved in the order of the host, and
//! each step runs in parallel. Only what differs from the last list is sent. Twin: `constraints/contacts.rs` of
//! incise-xpbd. Cost: 64 bytes a contact, 16 more with several iterations.

use incise_graph::Rows;
use incise_xpbd::{Solver, StepSettings};
use wgpu::{Buffer, BufferUsages};

use super::check::differs;
use super::colors::{Colors, SyncedArray};
use super::gpu_types::ContactUniform;
use super::kernels::{BoundKernel, CLEAR, Kernels, SOLVE_CONTACTS, SOLVE_CONTACTS_TAIL, Variant};
use super::layout::THREADS;
use crate::array::{Array, Copy};
use crate::index::index;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// In place of a particle that a contact does not have.
const NONE: u32 = u32::MAX;
/// Words of a contact in each array but that of its numbers.
const WORDS: usize = 4;
/// Words of the numbers that describe a contact.
const NUMBERS: usize = 8;

/// All contacts of a solver.
#[derive(Debug)]
pub(crate) struct Contacts {
    corners: SyncedArray,
    numbers: SyncedArray,
    uniform: Array<ContactUniform>,
    sent: Option<ContactUniform>,
    /// The sums of a frame.
    impulses: Array<[f32; 4]>,
    /// Empty with one iteration.
    multipliers: Array<[f32; 4]>,
    colors: Colors,
    /// Contact in the host's solving order -> its place here.
    places: Vec<u32>,
    /// Whether the host has set contacts since the last step.
    fresh: bool,
    /// The settings of the last step, for the forces of its impulses.
    stepped: Option<StepSettings>,
}

impl Contacts {
    fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            corners: SyncedArray::new(gpu, "particles of contacts", BufferUsages::STORAGE)?,
            numbers: SyncedArray::new(gpu, "contacts", BufferUsages::STORAGE)?,
            uniform: Array::with_usage(gpu, "law of contacts", 1, BufferUsages::UNIFORM)?,
            sent: None,
            impulses: Array::zeros(gpu, "impulses of contacts", 0)?,
            multipliers: Array::zeros(gpu, "multipliers of contacts", 0)?,
            colors: Colors::new(gpu)?,
            places: Vec::new(),
            fresh: true,
            stepped: None,
        })
    }

    /// Takes the contacts of the host; where none are declared no memory is kept.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        solver: &Solver<f32>,
    ) -> Result<(), GpuError> {
        if !solver.has_contacts() {
            *this = None;
            return Ok(());
        }
        let contacts = match this {
            Some(contacts) => contacts,
            None => this.insert(Self::new(gpu)?),
        };
        contacts.send(gpu, solver)
    }

    fn send(&mut self, gpu: &GpuContext, solver: &Solver<f32>) -> Result<(), GpuError> {
        let rows = steps(solver);
        let count: usize = solver.contact_counts().iter().sum();
        self.places.clear();
        self.places.resize(count, 0);
        let (mut groups, mut end) = (Vec::new(), 0);
        for color in 0..rows.row_count() {
            for contacts in rows.row(color).chunks(THREADS) {
                groups.push((color, index(end / THREADS)));
                for (place, &contact) in (end..).zip(contacts) {
                    self.places[contact as usize] = index(place);
                }
                end += THREADS;
            }
        }
        let mut corners = vec![NONE; WORDS * end];
        let mut numbers = vec![0; NUMBERS * end];
        for (contact, &place) in solver.contact_data().zip(&self.places) {
            corners[words::<WORDS>(place)].copy_from_slice(&contact.particles);
            numbers[words::<NUMBERS>(place)].copy_from_slice(&contact.numbers.map(f32::to_bits));
        }
        self.corners.set(gpu, corners)?;
        self.numbers.set(gpu, numbers)?;
        self.impulses.resize(gpu, end)?;
        let mut rows = Rows::default();
        let colors = groups.last().map_or(0, |&(color, _)| color + 1);
        rows.refill(colors, groups.into_iter());
        self.colors.sync(gpu, &rows)?;
        self.fresh = true;
        Ok(())
    }

    /// Sends the law unless the device has it, and makes room for multipliers. Returns whether the sums of impulses begin
    /// with a part of a frame that starts at a substep.
    pub(crate) fn prepare(
        &mut self,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        settings: &StepSettings,
        first_substep: u32,
    ) -> Result<bool, GpuError> {
        if let Some(factors) = solver.contact_factors(settings) {
            let uniform = ContactUniform {
                friction: factors.friction,
                kept: factors.kept,
                margin: factors.margin,
                unused: 0.0,
            };
            if self.sent != Some(uniform) {
                self.uniform.write(gpu, 0, &[uniform]);
                self.sent = Some(uniform);
            }
        }
        if settings.iterations > 1 {
            self.multipliers.resize(gpu, self.impulses.len())?;
        }
        let begins = std::mem::take(&mut self.fresh) || first_substep == 0;
        if self.stepped.as_ref() != Some(settings) {
            self.stepped = Some(settings.clone());
        }
        Ok(begins)
    }

    /// The kernels of a part of a frame; `begins` says that the sums of impulses do.
    pub(crate) fn bind<'a>(
        &'a self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        [settings, particles, previous]: [&Buffer; 3],
        keeps: bool,
        begins: bool,
    ) -> Result<Option<ContactKernels<'a>>, GpuError> {
        if self.places.is_empty() {
            return Ok(None);
        }
        let variant = Variant {
            keeps,
            ..Variant::default()
        };
        let buffers = [
            settings,
            self.colors.ranges.array.buffer(),
            particles,
            previous,
            self.corners.array.buffer(),
            self.numbers.array.buffer(),
            self.uniform.buffer(),
            self.impulses.buffer(),
            self.multipliers.buffer(),
            self.colors.lists.array.buffer(),
        ];
        let mut clear = |array: &Array<[f32; 4]>, wanted: bool| {
            let bind = || kernels.bind(gpu, &CLEAR, Variant::default(), &[array.buffer()]);
            wanted.then(bind).transpose()
        };
        Ok(Some(ContactKernels {
            begin_frame: clear(&self.impulses, begins)?,
            begin_substep: clear(&self.multipliers, keeps)?,
            words: WORDS * self.impulses.len(),
            one: kernels.bind(gpu, &SOLVE_CONTACTS, variant, &buffers)?,
            several: kernels.bind(gpu, &SOLVE_CONTACTS_TAIL, variant, &buffers)?,
            colors: &self.colors,
        }))
    }

    /// Records a copy of the sums of impulses, if a step has made some of these contacts.
    pub(crate) fn copy_impulses(
        &self,
        gpu: &GpuContext,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<Option<Copy<[f32; 4]>>, GpuError> {
        if self.places.is_empty() || self.fresh || self.stepped.is_none() {
            return Ok(None);
        }
        let count = self.impulses.len();
        self.impulses.copy_out(gpu, encoder, count).map(Some)
    }

    /// Hands the sums of impulses to the host in its order.
    pub(crate) fn load(&self, solver: &mut Solver<f32>, impulses: &[[f32; 4]]) {
        let Some(settings) = &self.stepped else {
            return;
        };
        let places = self.places.iter();
        let ordered: Vec<_> = places.map(|&place| impulses[place as usize]).collect();
        solver.load_contact_impulses(&ordered, settings);
    }

    /// Checks that the device has the contacts of the host, solves each once, and those that share a particle one after
    /// the other in the order of the host. A host whose contacts have ended has nothing to compare with.
    pub(crate) fn check(&self, gpu: &GpuContext, solver: &Solver<f32>) -> Result<(), GpuError> {
        let data: Vec<_> = solver.contact_data().collect();
        if data.is_empty() {
            return Ok(());
        }
        if data.len() != self.places.len() {
            return differs("the number of contacts");
        }
        let [corners, numbers, lists, ranges] = [
            self.corners.array.read(gpu)?,
            self.numbers.array.read(gpu)?,
            self.colors.lists.array.read(gpu)?,
            self.colors.ranges.array.read(gpu)?,
        ];
        // Group -> when it is solved.
        let (mut turns, mut now) = (vec![None; self.impulses.len() / THREADS], 0);
        for run in &self.colors.runs {
            let at = run.offset as usize / size_of::<u32>();
            let [first, count] = [ranges[at], ranges[at + 1]].map(|n| n as usize);
            for (number, &group) in lists[first..first + count].iter().enumerate() {
                let turn = if run.tail { now + number } else { now };
                if turns[group as usize].replace(turn).is_some() {
                    return differs(&format!(
                        "how often the contacts of group {group} are solved"
                    ));
                }
            }
            now += if run.tail { count } else { 1 };
        }
        let taken = corners.chunks_exact(WORDS).filter(|c| c[0] != NONE);
        if taken.count() != data.len() {
            return differs("the number of contacts");
        }
        let mut last = vec![None; solver.particle_count()];
        for (contact, (data, &place)) in data.iter().zip(&self.places).enumerate() {
            let same_numbers = numbers[words::<NUMBERS>(place)] == data.numbers.map(f32::to_bits);
            if corners[words::<WORDS>(place)] != data.particles || !same_numbers {
                return differs(&format!("contact {contact}"));
            }
            let turn = turns[place as usize / THREADS];
            for p in data.particles.into_iter().filter(|&p| p != NONE) {
                let before = std::mem::replace(&mut last[p as usize], turn);
                if turn.is_none() || before >= turn {
                    return differs(&format!("when contact {contact} is solved"));
                }
            }
        }
        Ok(())
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers = [
            self.corners.array.buffer(),
            self.numbers.array.buffer(),
            self.uniform.buffer(),
            self.impulses.buffer(),
            self.multipliers.buffer(),
            self.colors.lists.array.buffer(),
            self.colors.ranges.array.buffer(),
        ];
        buffers.into_iter().map(Buffer::size).sum()
    }
}

/// The words of a contact in an array with `N` for each.
fn words<const N: usize>(place: u32) -> std::ops::Range<usize> {
    N * place as usize..N * (place as usize + 1)
}

/// The contacts in solving order by what runs at the same time: a row for each color and for each step of a tail.
fn steps(solver: &Solver<f32>) -> Rows<u32> {
    let mut particles = Vec::new();
    let (mut entries, mut rows) = (Vec::new(), 0);
    // Particle -> the step after the last one that has it.
    let mut next = Vec::new();
    for round in solver.contact_rounds() {
        if !round.is_tail {
            entries.extend(round.contacts.map(|contact| (rows, index(contact))));
            rows += 1;
            continue;
        }
        if particles.is_empty() {
            particles.extend(solver.contact_data().map(|contact| contact.particles));
        }
        next.clear();
        next.resize(solver.particle_count(), 0);
        let mut last = 0;
        for contact in round.contacts {
            let of_contact = particles[contact].into_iter().filter(|&p| p != NONE);
            let step = of_contact.clone().map(|p| next[p as usize]).max();
            let step = step.unwrap_or(0);
            of_contact.for_each(|p| next[p as usize] = step + 1);
            entries.push((rows + step, index(contact)));
            last = last.max(step + 1);
        }
        rows += last;
    }
    let mut by_row = Rows::default();
    by_row.refill(rows, entries.into_iter());
    by_row
}

/// The kernels of contacts.
#[derive(Debug)]
pub(crate) struct ContactKernels<'a> {
    colors: &'a Colors,
    one: BoundKernel,
    several: BoundKernel,
    /// Clears the sums of impulses, where they begin.
    begin_frame: Option<BoundKernel>,
    /// Clears multipliers, if they are kept.
    begin_substep: Option<BoundKernel>,
    words: usize,
}

impl ContactKernels<'_> {
    /// Begins a part of a frame.
    pub(crate) fn begin_frame(&self, pass: &mut Recorder<'_>) {
        if let Some(clear) = &self.begin_frame {
            clear.run(pass, &[], self.words.div_ceil(THREADS));
        }
    }

    /// Begins a substep.
    pub(crate) fn begin_substep(&self, pass: &mut Recorder<'_>) {
        if let Some(clear) = &self.begin_substep {
            clear.run(pass, &[], self.words.div_ceil(THREADS));
        }
    }

    /// Solves the contacts in an iteration, after all other constraints but the colliders.
    pub(crate) fn solve(&self, pass: &mut Recorder<'_>) {
        self.colors.run(pass, &self.one, &self.several);
    }
}
