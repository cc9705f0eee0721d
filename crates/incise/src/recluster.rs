//! [`Recluster`]: rebuilds clusters and colors of a degraded partition in the background.
//!
//! Cuts change clusters locally, so a partition degrades: after many cuts it has more colors and smaller clusters than
//! a rebuilt one. Once it has degraded enough, a thread clusters and colors a copy of the mesh. A fixed number of
//! frames later, after the strokes of that frame, the new partition replaces the old one. The cuts made meanwhile are
//! applied to it first, one by one, and then small clusters around all of them are merged. If the thread has not
//! finished by then, the frame waits. The frame of the replacement thus depends on the scene alone, never on time or on
//! the number of threads.
//!
//! Trade-off: the thread needs a core. The frame that starts it copies the mesh; the frame of the replacement applies
//! the pending cuts and rebuilds schedule and layout. More frames between mean less waiting and more cuts to apply.
//! Clusters and colors far from all cuts change as well, and with them the order of solving: results differ as much as
//! between two numberings of the mesh.
//!
//! The paper leaves this open. Cost: clustering and coloring in the background, and two divisions a frame.

use std::thread::JoinHandle;

use incise_cutting::{CutDelta, CuttableMesh};

use crate::Error;
use crate::partition::{Partition, PartitionSettings};
use crate::scene::ReclusterSpec;

/// Monitors the degradation of a partition and rebuilds it in the background.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Recluster {
    spec: ReclusterSpec,
    pending: Option<Pending>,
}

/// A copy has no thread: a partition in the rebuild is left out, unless [`Recluster::settle`] was called.
impl Clone for Recluster {
    fn clone(&self) -> Self {
        Self {
            spec: self.spec,
            pending: self.pending.as_ref().and_then(Pending::copy),
        }
    }
}

/// A partition that is being rebuilt.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Pending {
    /// The frame that takes it.
    due: u64,
    rebuild: Rebuild,
    /// The cuts since.
    deltas: Vec<CutDelta>,
}

/// A partition, or the thread that makes it.
#[derive(Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
enum Rebuild {
    Done(Box<Partition>),
    // Last, since a variant that is skipped must not shift the numbers of others. A snapshot has none.
    #[cfg_attr(feature = "save", serde(skip))]
    Running(JoinHandle<Result<Partition, Error>>),
}

impl Recluster {
    pub(crate) fn new(spec: ReclusterSpec) -> Self {
        Self {
            spec,
            pending: None,
        }
    }

    /// Replaces the spec. A partition that is being rebuilt is still taken in the frame that was set before.
    pub(crate) fn with(self, spec: ReclusterSpec) -> Self {
        Self { spec, ..self }
    }

    /// Notes a cut for the partition in the rebuild.
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

    /// Waits for a partition in the rebuild, so that a copy has it, too. It is taken in the same frame as it would be.
    pub(crate) fn settle(&mut self) -> Result<(), Error> {
        let Some(pending) = self.pending.take() else {
            return Ok(());
        };
        self.pending = Some(Pending {
            rebuild: Rebuild::Done(Box::new(pending.rebuild.partition()?)),
            ..pending
        });
        Ok(())
    }

    /// Whether a partition is in the rebuild.
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
        if cfg!(target_family = "wasm") {
            // There are no threads.
            return Ok(Self {
                due,
                rebuild: Rebuild::Done(Box::new(Partition::of(settings, &mesh)?)),
                deltas: Vec::new(),
            });
        }
        // A pool of its own: the caller's may be the one that waits.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| refused(error.to_string()))?;
        let thread = std::thread::Builder::new()
            .name("incise-recluster".to_owned())
            .spawn(move || pool.install(|| Partition::of(settings, &mesh)))
            .map_err(|error| refused(error.to_string()))?;
        Ok(Self {
            due,
            rebuild: Rebuild::Running(thread),
            deltas: Vec::new(),
        })
    }

    fn copy(&self) -> Option<Self> {
        match &self.rebuild {
            Rebuild::Running(_) => None,
            Rebuild::Done(partition) => Some(Self {
                due: self.due,
                rebuild: Rebuild::Done(partition.clone()),
                deltas: self.deltas.clone(),
            }),
        }
    }

    /// Waits for the partition and applies the cuts made meanwhile.
    fn finish(self, cuttable: &CuttableMesh) -> Result<Partition, Error> {
        let mut partition = self.rebuild.partition()?;
        partition.catch_up(&self.deltas, cuttable)?;
        Ok(partition)
    }
}

impl Rebuild {
    /// The partition; waits for it.
    fn partition(self) -> Result<Partition, Error> {
        let failed = |_| Error::Inconsistent("clustering in the background failed".into());
        match self {
            Self::Running(thread) => thread.join().map_err(failed)?,
            Self::Done(partition) => Ok(*partition),
        }
    }
}
