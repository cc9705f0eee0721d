//! [`Recluster`]: fresh clusters and colors for a degraded partition, made in the background.
//!
//! Cuts change clusters where they are, so a partition degrades: after many cuts it has more colors and smaller clusters than one
//! made from the mesh as it is now. When it has degraded enough, a copy of the mesh goes to a thread of its own, which
//! clusters and colors it as at the start. A fixed number of frames later, after the strokes of that frame, the new partition
//! takes the place of the old one, and follows the cuts made meanwhile: first each by itself, then small clusters around
//! all of them are merged. If the thread is not done by then the frame waits. So it depends on the scene alone in which
//! frame which partition comes, never on time or on the number of threads.
//!
//! The trade: the thread needs a core; the frame that starts it copies the mesh, the one that swaps costs what following
//! the cuts of the frames between took, and a schedule and layout, as any frame with a cut. More frames between wait less
//! and follow more. Clusters and colors far from all cuts change, too, and with them the order of solving: the result
//! differs as much as between two numberings of the mesh.
//!
//! The paper leaves this open. Cost: clustering and coloring in the background; beside it two divisions a frame.

use std::thread::JoinHandle;

use incise_cutting::{CutDelta, CuttableMesh};

use crate::Error;
use crate::partition::{Partition, PartitionSettings};
use crate::scene::ReclusterSpec;

/// What watches over the degradation of a partition.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Recluster {
    spec: ReclusterSpec,
    pending: Option<Pending>,
}

/// A copy has no thread: a partition in the making is left out, unless [`Recluster::settle`] was called.
impl Clone for Recluster {
    fn clone(&self) -> Self {
        Self {
            spec: self.spec,
            pending: self.pending.as_ref().and_then(Pending::copy),
        }
    }
}

/// A partition in the making.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Pending {
    /// The frame that takes it.
    due: u64,
    making: Making,
    /// The cuts since.
    deltas: Vec<CutDelta>,
}

/// A partition, or the thread that makes it.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
enum Making {
    Made(Box<Partition>),
    // Last, since a variant that is skipped must not shift the numbers of others. A snapshot has none.
    #[cfg_attr(feature = "save", serde(skip))]
    Thread(JoinHandle<Result<Partition, Error>>),
}

impl Recluster {
    pub(crate) fn new(spec: ReclusterSpec) -> Self {
        Self {
            spec,
            pending: None,
        }
    }

    /// Replaces the spec. A partition in the making is still taken in the frame that was set before.
    pub(crate) fn with(self, spec: ReclusterSpec) -> Self {
        Self { spec, ..self }
    }

    /// Notes a cut for the partition in the making.
    pub(crate) fn note(&mut self, delta: &CutDelta) {
        if let Some(pending) = &mut self.pending {
            pending.deltas.push(delta.clone());
        }
    }

    /// Takes the new partition if this is its frame, else starts one if the present one has degraded; tells whether it was taken.
    pub(crate) fn advance(
        &mut self,
        frame: u64,
        partition: &mut Partition,
        cuttable: &CuttableMesh,
    ) -> Result<bool, Error> {
        if self.pending.is_none() && partition.degradation() >= self.spec.threshold {
            let due = frame + u64::from(self.spec.frames.get());
            self.pending = Some(Pending::start(due, partition.settings(), cuttable)?);
        }
        let Some(pending) = self.pending.take_if(|pending| pending.due == frame) else {
            return Ok(false);
        };
        *partition = pending.finish(cuttable)?;
        Ok(true)
    }

    /// Waits for a partition in the making, so that a copy has it, too. It is taken in the same frame as it would be.
    pub(crate) fn settle(&mut self) -> Result<(), Error> {
        let Some(pending) = self.pending.take() else {
            return Ok(());
        };
        self.pending = Some(Pending {
            making: Making::Made(Box::new(pending.making.partition()?)),
            ..pending
        });
        Ok(())
    }

    /// Whether a partition is in the making.
    pub(crate) fn is_pending(&self) -> bool {
        self.pending.is_some()
    }
}

impl Pending {
    fn start(
        due: u64,
        settings: PartitionSettings,
        cuttable: &CuttableMesh,
    ) -> Result<Self, Error> {
        let refused = |message: String| Error::Threads {
            threads: 1,
            message,
        };
        let mesh = cuttable.mesh().clone();
        // A pool of its own: the caller's may be the one that waits.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| refused(error.to_string()))?;
        let thread = std::thread::Builder::new()
            .name("incise-recluster".to_owned())
            .spawn(move || pool.install(|| Partition::of(settings, &mesh)))
            .map_err(|error| refused(error.to_string()))?;
        Ok(Self {
            due,
            making: Making::Thread(thread),
            deltas: Vec::new(),
        })
    }

    fn copy(&self) -> Option<Self> {
        match &self.making {
            Making::Thread(_) => None,
            Making::Made(partition) => Some(Self {
                due: self.due,
                making: Making::Made(partition.clone()),
                deltas: self.deltas.clone(),
            }),
        }
    }

    /// Waits for the partition and lets it follow what has been cut meanwhile.
    fn finish(self, cuttable: &CuttableMesh) -> Result<Partition, Error> {
        let mut partition = self.making.partition()?;
        partition.catch_up(&self.deltas, cuttable)?;
        Ok(partition)
    }
}

impl Making {
    /// The partition; waits for it.
    fn partition(self) -> Result<Partition, Error> {
        let failed = |_| Error::Inconsistent("clustering in the background failed".into());
        match self {
            Self::Thread(thread) => thread.join().map_err(failed)?,
            Self::Made(partition) => Ok(*partition),
        }
    }
}
