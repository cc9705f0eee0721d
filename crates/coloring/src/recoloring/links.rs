//! Incidence that changes: which vertices are at which particle, in linked lists.
//!
//! A link joins a vertex (a constraint or a cluster) and a particle. It lies in two lists, that of
//! its particle and that of its vertex. A cluster may be at a particle with several constraints, so
//! a link counts how often it was added; it goes when it was removed as often. The valence of a
//! particle is the number of its links. How many particles have each valence is kept up to date,
//! and with it the largest valence, which bounds the colors from below. Cost: O(links at the
//! particle) to add, and O(links of the vertex) more for a link that goes; its slot is used again.

use incise_graph::Incidence;

/// The end of a list.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Link {
    vertex: u32,
    particle: u32,
    /// How often it was added and not removed.
    count: u32,
    next_at_particle: u32,
    previous_at_particle: u32,
    next_of_vertex: u32,
}

/// All links.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Links {
    links: Vec<Link>,
    /// Places to use again.
    free: Vec<u32>,
    /// Particle -> its first link.
    at_particle: Vec<u32>,
    /// Vertex -> its first link.
    of_vertex: Vec<u32>,
    /// Particle -> the number of different vertices there.
    valence: Vec<u32>,
    /// Valence -> the number of particles that have it.
    histogram: Vec<u32>,
}

impl Links {
    pub(super) fn vertex_count(&self) -> usize {
        self.of_vertex.len()
    }

    pub(super) fn particle_count(&self) -> usize {
        self.at_particle.len()
    }

    /// The largest valence.
    pub(super) fn bound(&self) -> usize {
        self.histogram.len().saturating_sub(1)
    }

    /// Is there any link of `v`?
    pub(super) fn has(&self, v: u32) -> bool {
        self.of_vertex
            .get(v as usize)
            .is_some_and(|&first| first != NONE)
    }

    /// Makes sure that there are `count` vertices at least.
    pub(super) fn reserve_vertices(&mut self, count: usize) {
        if self.of_vertex.len() < count {
            self.of_vertex.resize(count, NONE);
        }
    }

    /// The slot of the link between a vertex and a particle.
    fn find(&self, vertex: u32, particle: u32) -> Option<u32> {
        let mut slot = *self.at_particle.get(particle as usize)?;
        while let Some(link) = self.links.get(slot as usize) {
            if link.vertex == vertex {
                return Some(slot);
            }
            slot = link.next_at_particle;
        }
        None
    }

    /// Links a vertex and a particle, once more if they are linked; both may be new.
    pub(super) fn add(&mut self, vertex: u32, particle: u32) {
        if !self.repeat(vertex, particle) {
            self.insert(vertex, particle);
        }
    }

    /// Counts a link once more; false if there is none. O(links at the particle).
    pub(super) fn repeat(&mut self, vertex: u32, particle: u32) -> bool {
        let slot = self.find(vertex, particle);
        if let Some(slot) = slot {
            self.links[slot as usize].count += 1;
        }
        slot.is_some()
    }

    /// Counts a link once more if it is the last that came to the particle; false if it is not. Does
    /// what [`repeat`](Self::repeat) does where no other link can be meant. O(1).
    pub(super) fn repeat_last(&mut self, vertex: u32, particle: u32) -> bool {
        let slot = self.at_particle.get(particle as usize).copied();
        let last = slot.and_then(|slot| self.links.get_mut(slot as usize));
        match last {
            Some(link) if link.vertex == vertex => {
                link.count += 1;
                true
            }
            _ => false,
        }
    }

    /// Links a vertex and a particle that are not linked; both may be new. O(1).
    pub(super) fn insert(&mut self, vertex: u32, particle: u32) {
        grow(&mut self.of_vertex, vertex, NONE);
        if self.particle_count() <= particle as usize {
            let new = particle as usize + 1 - self.particle_count();
            grow(&mut self.at_particle, particle, NONE);
            grow(&mut self.valence, particle, 0);
            self.count(0, new);
        }
        self.move_particle(particle, self.valence[particle as usize] + 1);
        let first = self.at_particle[particle as usize];
        let link = Link {
            vertex,
            particle,
            count: 1,
            next_at_particle: first,
            previous_at_particle: NONE,
            next_of_vertex: self.of_vertex[vertex as usize],
        };
        let slot = match self.free.pop() {
            Some(slot) => {
                self.links[slot as usize] = link;
                slot
            }
            None => {
                self.links.push(link);
                u32::try_from(self.links.len() - 1).expect("fewer than 2^32 links")
            }
        };
        if first != NONE {
            self.links[first as usize].previous_at_particle = slot;
        }
        self.at_particle[particle as usize] = slot;
        self.of_vertex[vertex as usize] = slot;
    }

    /// Takes back one addition of a link; `None` if there is none, else whether the link is gone.
    pub(super) fn remove(&mut self, vertex: u32, particle: u32) -> Option<bool> {
        let slot = self.find(vertex, particle)?;
        let link = &mut self.links[slot as usize];
        link.count -= 1;
        if link.count > 0 {
            return Some(false);
        }
        let link = *link;
        match link.previous_at_particle {
            NONE => self.at_particle[particle as usize] = link.next_at_particle,
            before => self.links[before as usize].next_at_particle = link.next_at_particle,
        }
        if link.next_at_particle != NONE {
            self.links[link.next_at_particle as usize].previous_at_particle =
                link.previous_at_particle;
        }
        let first = self.of_vertex[vertex as usize];
        if first == slot {
            self.of_vertex[vertex as usize] = link.next_of_vertex;
        } else {
            let mut before = first;
            while self.links[before as usize].next_of_vertex != slot {
                before = self.links[before as usize].next_of_vertex;
            }
            self.links[before as usize].next_of_vertex = link.next_of_vertex;
        }
        self.free.push(slot);
        self.move_particle(particle, self.valence[particle as usize] - 1);
        Some(true)
    }

    /// The vertex of each link at a particle.
    fn at(&self, particle: u32) -> impl Iterator<Item = u32> {
        let links = self.links_at(particle);
        links.map(|link| link.vertex)
    }

    fn links_at(&self, particle: u32) -> impl Iterator<Item = &Link> {
        let first = self.links.get(self.at_particle[particle as usize] as usize);
        std::iter::successors(first, |link| self.links.get(link.next_at_particle as usize))
    }

    fn links_of(&self, v: u32) -> impl Iterator<Item = &Link> + Clone {
        let first = self.of_vertex.get(v as usize);
        let first = first.and_then(|&first| self.links.get(first as usize));
        std::iter::successors(first, |link| self.links.get(link.next_of_vertex as usize))
    }

    /// The particle of each link of a vertex.
    pub(super) fn of(&self, v: u32) -> impl Iterator<Item = u32> + Clone {
        self.links_of(v).map(|link| link.particle)
    }

    /// The particles of a vertex, each as often as it was added and not removed.
    pub(super) fn repeated(&self, v: u32) -> impl Iterator<Item = u32> {
        let links = self.links_of(v);
        links.flat_map(|link| std::iter::repeat_n(link.particle, link.count as usize))
    }

    /// The neighbors of a vertex, some of them several times.
    pub(super) fn neighbors(&self, v: u32) -> impl Iterator<Item = u32> {
        let all = self.of(v).flat_map(|particle| self.at(particle));
        all.filter(move |&u| u != v)
    }

    /// The sum of the valences of a vertex's particles.
    pub(super) fn degree_bound(&self, v: u32) -> u64 {
        let valences = self.of(v).map(|p| self.valence[p as usize]);
        valences.map(u64::from).sum()
    }

    /// The links as fixed incidence; vertices without any have no particles.
    pub(super) fn incidence(&self) -> Incidence {
        let rows = (0..).take(self.vertex_count()).map(|v| {
            let mut particles: Vec<u32> = self.of(v).collect();
            particles.sort_unstable();
            particles
        });
        Incidence::from_constraints(self.particle_count(), rows)
            .expect("particles are known and listed once")
    }

    /// Are the valences and their counts those of `incidence`?
    pub(super) fn counts_agree(&self, incidence: &Incidence) -> bool {
        let mut histogram = vec![0; self.histogram.len()];
        let valences = (0..self.particle_count()).map(|p| incidence.constraints_of(p).len());
        let mut agree = valences.clone().max().unwrap_or(0) == self.bound();
        for (valence, &known) in valences.zip(&self.valence) {
            agree &= valence == known as usize;
            if let Some(count) = histogram.get_mut(valence) {
                *count += 1;
            }
        }
        agree && histogram == self.histogram
    }

    /// Gives a particle another valence.
    fn move_particle(&mut self, particle: u32, valence: u32) {
        let old = std::mem::replace(&mut self.valence[particle as usize], valence);
        self.histogram[old as usize] -= 1;
        self.count(valence as usize, 1);
        while self.histogram.last() == Some(&0) {
            self.histogram.pop();
        }
    }

    fn count(&mut self, valence: usize, particles: usize) {
        if self.histogram.len() <= valence {
            self.histogram.resize(valence + 1, 0);
        }
        self.histogram[valence] += u32::try_from(particles).expect("particles fit in 32 bits");
    }
}

/// Makes room for entry `index`.
fn grow(list: &mut Vec<u32>, index: u32, value: u32) {
    if list.len() <= index as usize {
        list.resize(index as usize + 1, value);
    }
}
