//! Device memory of bodies, by form: allocations of the solver after set-up, before the first step.

use std::sync::Arc;
use std::time::Instant;

use incise::gpu::{GpuContext, GpuSolver};
use incise::meshing::{Shape, generate};

use super::iteration::{WAYS, Way, absent, hanging};
use super::measure::{flush, ms_since};
use super::report::{MemoryRow, MemoryUse};
use crate::solver::body::{scaled, schedule};

/// All forms of a generated body of about so many tets.
pub(crate) fn memory(gpu: &Arc<GpuContext>, tets: usize) -> anyhow::Result<Vec<MemoryRow>> {
    let mesh = scaled(&generate(Shape::Liver, tets)?, 1.0);
    let mut rows = Vec::new();
    for way in WAYS.into_iter().filter(Way::is_gauss_seidel) {
        let schedule = schedule(&mesh, way.clustering)?;
        let body = hanging(&mesh)?;
        let send = || {
            let before = gpu.traffic();
            let mut device = GpuSolver::new(Arc::clone(gpu), body, way.form)?;
            let start = Instant::now();
            device.send(&schedule)?;
            flush(gpu)?;
            Ok(MemoryUse {
                bytes: device.bytes(),
                uploaded: gpu.traffic().since(before).uploaded_bytes,
                sending: ms_since(start),
            })
        };
        let (used, note) = absent(send())?;
        rows.push(MemoryRow {
            tets: mesh.tets.len(),
            particles: mesh.positions.len(),
            form: way.name.to_owned(),
            used,
            note,
        });
    }
    Ok(rows)
}
