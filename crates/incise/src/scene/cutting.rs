//! [`CuttingSpec`]: settings of all cuts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of all cuts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CuttingSpec {
    /// Largest volume of a crumb, in mean volumes of the original tets. A smaller part does not come off but stays with
    /// the other side of the cut, if that is at least eight times as large as a crumb; 0 lets every part come off.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub crumbs: f64,
}

impl Default for CuttingSpec {
    fn default() -> Self {
        Self { crumbs: 0.5 }
    }
}

impl CuttingSpec {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
