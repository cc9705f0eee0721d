//! [`CuttingSpec`]: settings of all cuts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of all cuts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct CuttingSpec {
    /// Largest volume of a crumb, in mean volumes of the original tets. A smaller part does not come off but stays with
    /// the other side of the cut, if that is at least eight times as large as a crumb; 0 lets every part come off.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub crumbs: f64,
    /// Whether particles that cuts created are taken out again where a stroke cuts what an earlier one has cut, so that
    /// cuts of cuts do not make ever smaller tets: where the mesh is better or as good without them, in frames without a
    /// blade on its way, some in each. Cut faces stay within a twentieth of an edge of where they were cut. A single stroke
    /// leaves its mesh as it cut it.
    pub improve: bool,
    /// Whether strokes that end at each other at an angle are joined, so that a square cut by four strokes from corner to
    /// corner comes off: sweeps, live blades, rectangles and surfaces less than about half a mean edge apart, in the first
    /// frame without a blade on its way. Faces open there, no tet is split. Once one of these strokes has `snap = 0`, which
    /// leaves slivers, no more ends are joined.
    pub join_ends: bool,
}

impl Default for CuttingSpec {
    fn default() -> Self {
        Self {
            crumbs: 0.5,
            improve: true,
            join_ends: true,
        }
    }
}

impl CuttingSpec {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
