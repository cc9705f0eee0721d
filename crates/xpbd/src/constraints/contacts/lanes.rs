//! Contacts that share no particle, several at once, one in each lane of a processor.
//!
//! A block is as many contacts in a row as an instruction takes numbers, or less, all of one color and one kind: pairs,
//! vertices at triangles, or edges. Most contacts are on the right side of their own plane, and a block of such contacts
//! is done when this is known.
//!
//! Each number is computed as [`Contacts::solve_one`] does, operation by operation, so the bits are the same. What is rare
//! is left to that function: a contact that has pressed along another plane in the iteration before, and blocks of one or
//! two contacts.
//!
//! Cost: four particles of each contact are read and transposed, then all lanes together take the operations of one contact.

use std::ops::Range;

use fearless_simd::{Level, Select, Simd, SimdBase, SimdFloat, SimdMask};

use super::{ContactFactors, Contacts, MARGIN, PARALLEL, PER_MOVE, Pair, SLIGHT, Surface};
use crate::Float;
use crate::particles::Particles;
use crate::simd_kernel::{Buffers, cross, dot, splat};

/// Most lanes of any instruction set.
const MOST_LANES: usize = 16;
/// Fewer contacts are solved one after the other.
const FEWEST: usize = 3;

type Lanes<R, S> = <R as Float>::Lanes<S>;
type Mask<R, S> = <Lanes<R, S> as SimdBase<S>>::Mask;
type Vector<R, S> = [Lanes<R, S>; 3];
/// Four numbers of each contact: a position and an inverse mass, or constants.
type Quad<R, S> = [Lanes<R, S>; 4];

/// A plane of each contact, as [`super::ContactPlane`].
#[derive(Clone, Copy)]
struct Planes<R: Float, S: Simd> {
    normal: Vector<R, S>,
    shares: [Lanes<R, S>; 4],
    exist: Mask<R, S>,
}

/// The own plane of each contact, before it is known whether it matters.
struct OwnPlanes<R: Float, S: Simd> {
    planes: Planes<R, S>,
    /// `C`.
    value: Lanes<R, S>,
    /// Whether edges pass each other beyond their ends.
    are_past: Mask<R, S>,
}

/// What acts, as [`super::Gap`].
struct Gaps<R: Float, S: Simd> {
    planes: Planes<R, S>,
    are_second: Mask<R, S>,
    residual: Lanes<R, S>,
    are_past: Mask<R, S>,
}

/// Where the particles of contacts are, now and at the start of the substep; of a pair the first two.
struct Places<R: Float, S: Simd> {
    now: [Quad<R, S>; 4],
    before: [Quad<R, S>; 4],
}

/// What a lane reads of a contact.
trait LaneContact<R: Float> {
    /// Particles of a contact.
    const PARTICLES: usize;

    /// The particles; of a pair the first two.
    fn particles(&self) -> [u32; 4];
    /// The normal or the one beyond, and the thickness.
    fn direction(&self) -> [R; 4];
    /// The limit and its distance.
    fn limit(&self) -> [R; 4];
    /// [`Contacts::solve_one`].
    fn solve_one(
        &self,
        contacts: &Contacts<R>,
        index: usize,
        particles: &Particles<R>,
        factors: ContactFactors<R>,
    );
}

/// A kind of contacts.
trait Kind<R: Float> {
    type Contact: LaneContact<R>;

    /// The own planes; `direction` has [`LaneContact::direction`].
    fn own<S: Simd>(simd: S, x: &[Quad<R, S>; 4], direction: &Quad<R, S>) -> OwnPlanes<R, S>;
    /// `C` of planes at positions.
    fn value<S: Simd>(
        planes: &Planes<R, S>,
        x: &[Quad<R, S>; 4],
        direction: &Quad<R, S>,
    ) -> Lanes<R, S>;
    /// What acts: the own planes, unless a kind has others. `_limits` reads [`LaneContact::limit`].
    #[inline(always)]
    fn gaps<S: Simd>(
        simd: S,
        own: &OwnPlanes<R, S>,
        places: &Places<R, S>,
        direction: &Quad<R, S>,
        _limits: impl FnOnce() -> Quad<R, S>,
        kept: Lanes<R, S>,
    ) -> Gaps<R, S> {
        let before = Self::value(&own.planes, &places.before, direction);
        Gaps {
            planes: own.planes,
            are_second: Mask::<R, S>::splat(simd, false),
            residual: new_part::<R, S>(simd, own.value, before, kept),
            are_past: own.are_past,
        }
    }
}

/// Solves contacts of one color, given by their numbers among those of their kind.
pub(super) fn solve<R: Float>(
    level: Level,
    contacts: &Contacts<R>,
    is_pairs: bool,
    range: Range<usize>,
    particles: &Particles<R>,
    factors: ContactFactors<R>,
) {
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(simd) = level.as_avx512() {
            in_lanes(simd, contacts, is_pairs, range, particles, factors);
        } else if let Some(simd) = level.as_avx2() {
            in_lanes(simd, contacts, is_pairs, range, particles, factors);
        } else {
            let simd = level.as_sse2().expect("every x86-64 processor has SSE 2");
            in_lanes(simd, contacts, is_pairs, range, particles, factors);
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    fearless_simd::dispatch!(level, simd => {
        in_lanes(simd, contacts, is_pairs, range, particles, factors);
    });
}

#[inline(always)]
fn in_lanes<R: Float, S: Simd>(
    simd: S,
    contacts: &Contacts<R>,
    is_pairs: bool,
    range: Range<usize>,
    particles: &Particles<R>,
    factors: ContactFactors<R>,
) {
    simd.vectorize(
        #[inline(always)]
        move || {
            let mut solver = InLanes {
                simd,
                contacts,
                particles,
                factors,
                x: Buffers::new(),
                previous: Buffers::new(),
                constants: Buffers::new(),
            };
            let mut from = range.start;
            while from < range.end {
                let to = range.end.min(from + Lanes::<R, S>::LEN);
                from += if is_pairs {
                    solver.solve::<Pairs>(from, &contacts.pairs[from..to])
                } else {
                    let row = &contacts.surfaces[from..to];
                    let is_edges = row[0].is_edges;
                    let other = row.iter().position(|contact| contact.is_edges != is_edges);
                    let row = &row[..other.unwrap_or(row.len())];
                    let index = contacts.pairs.len() + from;
                    if is_edges {
                        solver.solve::<Edges>(index, row)
                    } else {
                        solver.solve::<Faces>(index, row)
                    }
                };
            }
        },
    );
}

/// What all blocks have in common, and the numbers of one of them.
struct InLanes<'a, R: Float, S: Simd> {
    simd: S,
    contacts: &'a Contacts<R>,
    particles: &'a Particles<R>,
    factors: ContactFactors<R>,
    x: Buffers<R>,
    previous: Buffers<R>,
    /// Directions, limits, multipliers, and impulses.
    constants: Buffers<R>,
}

/// The places of [`InLanes::constants`].
const DIRECTION: usize = 0;
const LIMIT: usize = 1;
const MULTIPLIER: usize = 2;
const IMPULSE: usize = 3;

impl<R: Float, S: Simd> InLanes<'_, R, S> {
    #[inline(always)]
    fn splat(&self, value: R) -> Lanes<R, S> {
        splat::<R, S>(self.simd, value)
    }

    /// Solves a block, the first contact of which has the number `first` among all, and returns its size.
    #[inline(always)]
    fn solve<K: Kind<R>>(&mut self, first: usize, block: &[K::Contact]) -> usize {
        let simd = self.simd;
        let (contacts, particles) = (self.contacts, self.particles);
        let count = block.len();
        if count < FEWEST {
            for (lane, contact) in block.iter().enumerate() {
                contact.solve_one(contacts, first + lane, particles, self.factors);
            }
            return count;
        }
        let lanes = Lanes::<R, S>::LEN;
        let (zero, one) = (self.splat(R::ZERO), self.splat(R::ONE));
        // Lanes without a contact repeat the first one, and write nothing.
        let of_lane = |lane: usize| if lane < count { lane } else { 0 };
        let mut numbers = [[0; 4]; MOST_LANES];
        for (lane, numbers) in numbers[..lanes].iter_mut().enumerate() {
            let contact = &block[of_lane(lane)];
            *numbers = contact.particles();
            for (k, &p) in numbers[..K::Contact::PARTICLES].iter().enumerate() {
                self.x
                    .set::<S>(k, lane, R::read(&particles.cells[p as usize]));
            }
            self.constants
                .set::<S>(DIRECTION, lane, contact.direction());
        }
        let mut now = [[zero; 4]; 4];
        for (k, now) in now[..K::Contact::PARTICLES].iter_mut().enumerate() {
            *now = self.x.columns(simd, k);
        }
        let direction = self.constants.columns(simd, DIRECTION);
        let own = K::own(simd, &now, &direction);
        let live = Mask::<R, S>::from_bitmask(simd, (1 << count) - 1) & own.planes.exist;
        let mut due = live & own.value.simd_lt(zero) & !own.are_past;

        // What has pressed in the iterations before.
        let none = Mask::<R, S>::splat(simd, false);
        let (mut friction, mut before) = ([zero; 3], zero);
        let (mut pressed, mut were_second) = (none, none);
        if !contacts.multipliers.is_empty() {
            let own = &contacts.multipliers[first..first + count];
            for lane in 0..lanes {
                let multiplier = R::read(&own[of_lane(lane)]);
                self.constants.set::<S>(MULTIPLIER, lane, multiplier);
            }
            let [x, y, z, signed] = self.constants.columns(simd, MULTIPLIER);
            were_second = signed.simd_lt(zero);
            before = were_second.select(-signed, signed);
            friction = [x, y, z];
            pressed = live & before.simd_gt(zero);
            due |= pressed;
        }
        if !due.any_true() {
            return count;
        }

        for (lane, numbers) in numbers[..lanes].iter().enumerate() {
            for (k, &p) in numbers[..K::Contact::PARTICLES].iter().enumerate() {
                let [x, y, z] = R::components(particles.previous[p as usize]);
                self.previous.set::<S>(k, lane, [x, y, z, R::ZERO]);
            }
        }
        let mut places = Places {
            now,
            before: [[zero; 4]; 4],
        };
        for (k, before) in places.before[..K::Contact::PARTICLES]
            .iter_mut()
            .enumerate()
        {
            *before = self.previous.columns(simd, k);
        }
        let kept = self.splat(self.factors.kept);
        let constants = &mut self.constants;
        let limits = || {
            for lane in 0..lanes {
                let limit = block[of_lane(lane)].limit();
                constants.set::<S>(LIMIT, lane, limit);
            }
            constants.columns(simd, LIMIT)
        };
        let gaps = K::gaps(simd, &own, &places, &direction, limits, kept);
        let are_open = gaps.are_past | gaps.residual.simd_ge(zero);
        let mut active = due & (!are_open | pressed) & gaps.residual.is_finite();
        if pressed.any_true() {
            let differ =
                (gaps.are_second & !were_second) | (!gaps.are_second & were_second) | gaps.are_past;
            let elsewhere = active & pressed & differ;
            active &= !elsewhere;
            let mut left = elsewhere.to_bitmask();
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                block[lane].solve_one(contacts, first + lane, particles, self.factors);
            }
        }
        if !active.any_true() {
            return count;
        }

        let Planes { normal, shares, .. } = gaps.planes;
        let (mut sum, mut most) = (zero, zero);
        for (place, &share) in places.now[..K::Contact::PARTICLES].iter().zip(&shares) {
            let weight = place[3];
            sum += weight * share * share;
            let moved = weight * absolute::<R, S>(simd, share);
            most = moved.simd_gt(most).select(moved, most);
        }
        let least = most * self.splat(R::from_f64(PER_MOVE));
        sum = least.simd_gt(sum).select(least, sum);
        let change = -(gaps.residual / sum);
        let change = (before + change).simd_lt(zero).select(-before, change);
        active &= change.is_finite();
        let pressure = before + change;
        let mut impulse = scaled::<R, S>(&normal, change);
        if self.factors.friction > R::ZERO {
            let mut slide = [zero; 3];
            let ways = places.now.iter().zip(&places.before).zip(&shares);
            for ((now, before), &share) in ways.take(K::Contact::PARTICLES) {
                let [x, y, z] = between::<R, S>(now, before);
                slide[0] += x * share;
                slide[1] += y * share;
                slide[2] += z * share;
            }
            let along = dot::<R, S>(&normal, &slide);
            let per_sum = one / sum;
            let mut wanted = friction;
            for axis in 0..3 {
                slide[axis] -= normal[axis] * along;
                wanted[axis] -= slide[axis] * per_sum;
            }
            let length = dot::<R, S>(&wanted, &wanted).sqrt();
            let limit = self.splat(self.factors.friction) * pressure;
            let slides = length.simd_gt(limit);
            let part = limit / length;
            for axis in 0..3 {
                wanted[axis] = slides.select(wanted[axis] * part, wanted[axis]);
                impulse[axis] += wanted[axis] - friction[axis];
            }
            friction = wanted;
        }
        let [ix, iy, iz] = impulse;
        active &= ix.is_finite() & iy.is_finite() & iz.is_finite();
        let moves = places.now.iter().zip(&shares).enumerate();
        for (k, (&[x, y, z, weight], &share)) in moves.take(K::Contact::PARTICLES) {
            let part = weight * share;
            let moved = [x + ix * part, y + iy * part, z + iz * part, weight];
            self.x.put(simd, k, moved);
        }
        self.constants.put(simd, IMPULSE, [ix, iy, iz, change]);
        if !contacts.multipliers.is_empty() {
            let [x, y, z] = friction;
            let signed = gaps.are_second.select(-pressure, pressure);
            self.constants.put(simd, MULTIPLIER, [x, y, z, signed]);
        }
        let keeps_refused = particles.keeps_refused();
        if keeps_refused {
            self.previous.put(simd, 0, shares);
        }
        let mut left = active.to_bitmask();
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let numbers = &numbers[lane][..K::Contact::PARTICLES];
            for (k, &p) in numbers.iter().enumerate() {
                R::write(&particles.cells[p as usize], self.x.get::<S>(k, lane));
            }
            let [x, y, z, change] = self.constants.get::<S>(IMPULSE, lane);
            if keeps_refused {
                let shares = self.previous.get::<S>(0, lane);
                for (&p, &share) in numbers.iter().zip(&shares) {
                    particles.refuse(p, R::vector(x, y, z) * share);
                }
            }
            if let Some(total) = contacts.impulses.get(first + lane) {
                let [a, b, c, normal] = R::read(total);
                R::write(total, [a + x, b + y, c + z, normal + change]);
            }
            if let Some(multiplier) = contacts.multipliers.get(first + lane) {
                R::write(multiplier, self.constants.get::<S>(MULTIPLIER, lane));
            }
        }
        count
    }
}

/// [`Pair`].
struct Pairs;
/// [`Surface`] of a vertex and a triangle.
struct Faces;
/// [`Surface`] of two edges.
struct Edges;

impl<R: Float> LaneContact<R> for Pair<R> {
    const PARTICLES: usize = 2;

    #[inline(always)]
    fn particles(&self) -> [u32; 4] {
        let [a, b] = self.particles;
        [a, b, 0, 0]
    }

    #[inline(always)]
    fn direction(&self) -> [R; 4] {
        let [x, y, z] = R::components(self.normal);
        [x, y, z, R::ZERO]
    }

    #[inline(always)]
    fn limit(&self) -> [R; 4] {
        [R::ZERO; 4]
    }

    #[inline(never)]
    fn solve_one(
        &self,
        contacts: &Contacts<R>,
        index: usize,
        particles: &Particles<R>,
        factors: ContactFactors<R>,
    ) {
        contacts.solve_one(index, self, particles, factors);
    }
}

impl<R: Float> LaneContact<R> for Surface<R> {
    const PARTICLES: usize = 4;

    #[inline(always)]
    fn particles(&self) -> [u32; 4] {
        self.particles
    }

    #[inline(always)]
    fn direction(&self) -> [R; 4] {
        let [x, y, z] = self.beyond;
        [x, y, z, self.thickness]
    }

    #[inline(always)]
    fn limit(&self) -> [R; 4] {
        let [x, y, z] = self.limit;
        [x, y, z, self.distance]
    }

    #[inline(never)]
    fn solve_one(
        &self,
        contacts: &Contacts<R>,
        index: usize,
        particles: &Particles<R>,
        factors: ContactFactors<R>,
    ) {
        contacts.solve_one(index, self, particles, factors);
    }
}

impl<R: Float> Kind<R> for Pairs {
    type Contact = Pair<R>;

    #[inline(always)]
    fn own<S: Simd>(simd: S, x: &[Quad<R, S>; 4], direction: &Quad<R, S>) -> OwnPlanes<R, S> {
        let (zero, one) = (splat::<R, S>(simd, R::ZERO), splat::<R, S>(simd, R::ONE));
        let [a, b, c, _] = *direction;
        let planes = Planes {
            normal: [a, b, c],
            shares: [-one, one, zero, zero],
            exist: Mask::<R, S>::splat(simd, true),
        };
        OwnPlanes {
            value: Self::value(&planes, x, direction),
            planes,
            are_past: Mask::<R, S>::splat(simd, false),
        }
    }

    #[inline(always)]
    fn value<S: Simd>(
        planes: &Planes<R, S>,
        [first, second, ..]: &[Quad<R, S>; 4],
        _: &Quad<R, S>,
    ) -> Lanes<R, S> {
        dot::<R, S>(&planes.normal, &between::<R, S>(second, first))
    }
}

impl<R: Float> Kind<R> for Faces {
    type Contact = Surface<R>;

    #[inline(always)]
    fn own<S: Simd>(simd: S, x: &[Quad<R, S>; 4], direction: &Quad<R, S>) -> OwnPlanes<R, S> {
        let one = splat::<R, S>(simd, R::ONE);
        let basis = basis::<R, S>(x);
        let [e1, e2, r] = &basis;
        let (size, normal, exist) = directions::<R, S>(simd, &cross::<R, S>(e1, e2));
        let second = dot::<R, S>(&cross::<R, S>(r, e2), &normal) / size;
        let third = dot::<R, S>(&cross::<R, S>(e1, r), &normal) / size;
        let (second, third, finite) = inside::<R, S>(simd, second, third);
        let planes = Planes {
            normal,
            shares: [one, second + third - one, -second, -third],
            exist: exist & finite,
        };
        OwnPlanes {
            value: above::<R, S>(&planes, &basis, direction[3]),
            planes,
            are_past: Mask::<R, S>::splat(simd, false),
        }
    }

    #[inline(always)]
    fn value<S: Simd>(
        planes: &Planes<R, S>,
        x: &[Quad<R, S>; 4],
        direction: &Quad<R, S>,
    ) -> Lanes<R, S> {
        above::<R, S>(planes, &basis::<R, S>(x), direction[3])
    }

    #[inline(always)]
    fn gaps<S: Simd>(
        simd: S,
        own: &OwnPlanes<R, S>,
        places: &Places<R, S>,
        direction: &Quad<R, S>,
        limits: impl FnOnce() -> Quad<R, S>,
        kept: Lanes<R, S>,
    ) -> Gaps<R, S> {
        let (zero, one) = (splat::<R, S>(simd, R::ZERO), splat::<R, S>(simd, R::ONE));
        let (now, old) = (basis::<R, S>(&places.now), basis::<R, S>(&places.before));
        let [e1, e2, r] = &now;
        let area = cross::<R, S>(e1, e2);
        let [x, y, z, thickness] = *direction;
        let before = above::<R, S>(&own.planes, &old, thickness);
        let mut gaps = Gaps {
            planes: own.planes,
            are_second: own.are_past,
            residual: new_part::<R, S>(simd, own.value, before, kept),
            are_past: own.are_past,
        };
        let beyond = own.value.simd_lt(zero) & is_some::<R, S>(simd, &[x, y, z]);
        let (length, along, have_length) = directions::<R, S>(simd, e1);
        if beyond.any_true() {
            let (_, normal, exist) =
                directions::<R, S>(simd, &combined::<R, S>(&now, &area, &[x, y, z]));
            let low = splat::<R, S>(simd, R::from_f64(-MARGIN));
            let high = splat::<R, S>(simd, R::from_f64(1.0 + MARGIN));
            let part = clamped::<R, S>(dot::<R, S>(r, &along) / length, low, high);
            let other = Planes {
                normal,
                shares: [one, part - one, -part, zero],
                exist: exist & have_length,
            };
            let value = above::<R, S>(&other, &now, thickness);
            let other_before = above::<R, S>(&other, &old, thickness);
            let residual = new_part::<R, S>(simd, value, other_before, kept);
            let slight = splat::<R, S>(simd, R::from_f64(SLIGHT)) * dot::<R, S>(e1, e1);
            let both_slight = (before.simd_ge(zero) | (before * before).simd_lt(slight))
                & (other_before.simd_ge(zero) | (other_before * other_before).simd_lt(slight));
            let acts = value.simd_ge(zero)
                | (both_slight & residual.simd_gt(gaps.residual))
                | (!both_slight & other_before.simd_gt(before));
            let acts = beyond & other.exist & acts;
            for (acting, other) in gaps.planes.normal.iter_mut().zip(normal) {
                *acting = acts.select(other, *acting);
            }
            for (acting, other) in gaps.planes.shares.iter_mut().zip(other.shares) {
                *acting = acts.select(other, *acting);
            }
            gaps.residual = acts.select(residual, gaps.residual);
            gaps.are_second = acts;
        }
        let press = !gaps.residual.simd_ge(zero);
        if press.any_true() {
            let [x, y, z, distance] = limits();
            let limited = press & is_some::<R, S>(simd, &[x, y, z]);
            if limited.any_true() {
                let (_, outward, exist) =
                    directions::<R, S>(simd, &combined::<R, S>(&now, &area, &[x, y, z]));
                let part = clamped::<R, S>(dot::<R, S>(r, &along) / length, zero, one);
                let mut way = *r;
                for axis in 0..3 {
                    way[axis] = r[axis] - e1[axis] * part;
                }
                let is_past = dot::<R, S>(&outward, &way).simd_gt(distance + thickness);
                gaps.are_past = limited & exist & have_length & is_past;
            }
        }
        gaps
    }
}

impl<R: Float> Kind<R> for Edges {
    type Contact = Surface<R>;

    #[inline(always)]
    fn own<S: Simd>(simd: S, x: &[Quad<R, S>; 4], direction: &Quad<R, S>) -> OwnPlanes<R, S> {
        let (zero, one) = (splat::<R, S>(simd, R::ZERO), splat::<R, S>(simd, R::ONE));
        let [x0, x1, x2, x3] = x;
        let [nx, ny, nz, _] = *direction;
        let (length, along, have_first) = directions::<R, S>(simd, &between::<R, S>(x1, x0));
        let (other_length, other, have_second) = directions::<R, S>(simd, &between::<R, S>(x3, x2));
        let across = cross::<R, S>(&along, &other);
        let square = dot::<R, S>(&across, &across);
        let parallel = splat::<R, S>(simd, R::from_f64(PARALLEL * PARALLEL));
        let r = between::<R, S>(x0, x2);
        let first = -(dot::<R, S>(&r, &cross::<R, S>(&other, &across)) / square) / length;
        let second = -(dot::<R, S>(&r, &cross::<R, S>(&along, &across)) / square) / other_length;
        let exist = have_first
            & have_second
            & square.simd_gt(parallel)
            & square.is_finite()
            & first.is_finite()
            & second.is_finite();
        let on_edges =
            first.simd_ge(zero) & first.simd_le(one) & second.simd_ge(zero) & second.simd_le(one);
        let first = clamped::<R, S>(first, zero, one);
        let second = clamped::<R, S>(second, zero, one);
        let planes = Planes {
            normal: [nx, ny, nz],
            shares: [one - first, first, second - one, -second],
            exist,
        };
        OwnPlanes {
            value: Self::value(&planes, x, direction),
            planes,
            are_past: !on_edges,
        }
    }

    #[inline(always)]
    fn value<S: Simd>(
        planes: &Planes<R, S>,
        [x0, x1, x2, x3]: &[Quad<R, S>; 4],
        direction: &Quad<R, S>,
    ) -> Lanes<R, S> {
        let [_, first, _, second] = planes.shares;
        let mut way = planes.normal;
        for axis in 0..3 {
            way[axis] = (x0[axis] - x2[axis])
                + (x1[axis] - x0[axis]) * first
                + (x3[axis] - x2[axis]) * second;
        }
        dot::<R, S>(&planes.normal, &way) - direction[3]
    }
}

/// The vectors from one particle to another.
#[inline(always)]
fn between<R: Float, S: Simd>(to: &Quad<R, S>, from: &Quad<R, S>) -> Vector<R, S> {
    [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
}

#[inline(always)]
fn scaled<R: Float, S: Simd>(v: &Vector<R, S>, by: Lanes<R, S>) -> Vector<R, S> {
    [v[0] * by, v[1] * by, v[2] * by]
}

#[inline(always)]
fn absolute<R: Float, S: Simd>(simd: S, value: Lanes<R, S>) -> Lanes<R, S> {
    let zero = splat::<R, S>(simd, R::ZERO);
    value.simd_lt(zero).select(-value, value)
}

#[inline(always)]
fn clamped<R: Float, S: Simd>(x: Lanes<R, S>, low: Lanes<R, S>, high: Lanes<R, S>) -> Lanes<R, S> {
    let x = x.simd_lt(low).select(low, x);
    x.simd_gt(high).select(high, x)
}

/// Whether a direction is not three zeros, which stand for none.
#[inline(always)]
fn is_some<R: Float, S: Simd>(simd: S, [x, y, z]: &Vector<R, S>) -> Mask<R, S> {
    let zero = splat::<R, S>(simd, R::ZERO);
    !(x.simd_eq(zero) & y.simd_eq(zero) & z.simd_eq(zero))
}

/// [`crate::direction::direction`]: lengths, unit vectors, and where there are such.
#[inline(always)]
fn directions<R: Float, S: Simd>(
    simd: S,
    v: &Vector<R, S>,
) -> (Lanes<R, S>, Vector<R, S>, Mask<R, S>) {
    let (zero, one) = (splat::<R, S>(simd, R::ZERO), splat::<R, S>(simd, R::ONE));
    let a = absolute::<R, S>(simd, v[0]);
    let b = absolute::<R, S>(simd, v[1]);
    let c = absolute::<R, S>(simd, v[2]);
    let largest = a.simd_gt(b).select(a, b);
    let largest = c.simd_gt(largest).select(c, largest);
    let part = [v[0] / largest, v[1] / largest, v[2] / largest];
    let length = dot::<R, S>(&part, &part).sqrt();
    let unit = scaled::<R, S>(&part, one / length);
    (largest * length, unit, length.simd_gt(zero))
}

/// [`super::basis`].
#[inline(always)]
fn basis<R: Float, S: Simd>(x: &[Quad<R, S>; 4]) -> [Vector<R, S>; 3] {
    [
        between::<R, S>(&x[2], &x[1]),
        between::<R, S>(&x[3], &x[1]),
        between::<R, S>(&x[0], &x[1]),
    ]
}

/// [`super::combined`].
#[inline(always)]
fn combined<R: Float, S: Simd>(
    [e1, e2, _]: &[Vector<R, S>; 3],
    area: &Vector<R, S>,
    [a, b, c]: &Vector<R, S>,
) -> Vector<R, S> {
    let mut sum = *area;
    for axis in 0..3 {
        sum[axis] = e1[axis] * *a + e2[axis] * *b + area[axis] * *c;
    }
    sum
}

/// [`super::inside`], and where the weights are numbers.
#[inline(always)]
fn inside<R: Float, S: Simd>(
    simd: S,
    second: Lanes<R, S>,
    third: Lanes<R, S>,
) -> (Lanes<R, S>, Lanes<R, S>, Mask<R, S>) {
    let (zero, one) = (splat::<R, S>(simd, R::ZERO), splat::<R, S>(simd, R::ONE));
    let margin = splat::<R, S>(simd, R::from_f64(MARGIN));
    let first = one - second - third;
    let finite = first.is_finite() & second.is_finite() & third.is_finite();
    let within = first.simd_ge(-margin) & second.simd_ge(-margin) & third.simd_ge(-margin);
    if within.all_true() {
        return (second, third, finite);
    }
    let a = first.simd_gt(-margin).select(first + margin, zero);
    let b = second.simd_gt(-margin).select(second + margin, zero);
    let c = third.simd_gt(-margin).select(third + margin, zero);
    let scale = (one + margin + margin + margin) / (a + b + c);
    (
        within.select(second, b * scale - margin),
        within.select(third, c * scale - margin),
        finite,
    )
}

/// [`Surface::above`].
#[inline(always)]
fn above<R: Float, S: Simd>(
    planes: &Planes<R, S>,
    [e1, e2, r]: &[Vector<R, S>; 3],
    thickness: Lanes<R, S>,
) -> Lanes<R, S> {
    let [_, _, second, third] = planes.shares;
    let mut way = *r;
    for axis in 0..3 {
        way[axis] = r[axis] + e1[axis] * second + e2[axis] * third;
    }
    dot::<R, S>(&planes.normal, &way) - thickness
}

/// [`super::new_part`].
#[inline(always)]
fn new_part<R: Float, S: Simd>(
    simd: S,
    value: Lanes<R, S>,
    before: Lanes<R, S>,
    kept: Lanes<R, S>,
) -> Lanes<R, S> {
    let zero = splat::<R, S>(simd, R::ZERO);
    before.simd_lt(zero).select(value - kept * before, value)
}
