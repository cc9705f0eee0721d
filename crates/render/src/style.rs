//! [`Style`] and [`ColorBy`]: drawing options of bodies.

use std::fmt;
use std::str::FromStr;

use crate::RenderError;

/// Quantity that the colors of a body show.
///
/// ```
/// use incise_render::ColorBy;
///
/// assert_eq!("cluster".parse::<ColorBy>()?, ColorBy::Cluster);
/// assert!("blue".parse::<ColorBy>().is_err());
/// assert_eq!(ColorBy::ALL.map(ColorBy::name).join(", "), ColorBy::KNOWN);
/// # Ok::<(), incise_render::RenderError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum ColorBy {
    /// Material: the outer surface dark, cut faces light.
    #[default]
    Tissue,
    /// Color of the tet's cluster: clusters of one color are solved together.
    Color,
    /// The tet's cluster.
    Cluster,
    /// The piece that the tet belongs to.
    Piece,
    /// Largest principal stretch of the tet.
    Stretch,
    /// Constraint residual of the tet.
    Residual,
}

impl ColorBy {
    /// All values.
    pub const ALL: [Self; 6] = [
        Self::Tissue,
        Self::Color,
        Self::Cluster,
        Self::Piece,
        Self::Stretch,
        Self::Residual,
    ];
    /// Names of all values, for messages.
    pub const KNOWN: &str = "tissue, color, cluster, piece, stretch, residual";

    /// Name, as it is parsed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tissue => "tissue",
            Self::Color => "color",
            Self::Cluster => "cluster",
            Self::Piece => "piece",
            Self::Stretch => "stretch",
            Self::Residual => "residual",
        }
    }
}

impl fmt::Display for ColorBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ColorBy {
    type Err = RenderError;

    fn from_str(name: &str) -> Result<Self, RenderError> {
        let found = Self::ALL.into_iter().find(|by| by.name() == name);
        found.ok_or_else(|| RenderError::UnknownColoring {
            given: name.to_owned(),
            known: Self::KNOWN,
        })
    }
}

/// Drawing options of bodies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Style {
    /// Quantity shown by the colors. Colors other than of tissue are those of the last
    /// [`RenderScene::color`](crate::RenderScene::color) with this value; triangles without one are drawn as tissue.
    pub color_by: ColorBy,
    /// Draws the edges of all triangles; rims of cuts always have a line.
    pub wireframe: bool,
    /// Shades the outer surface smoothly; otherwise each triangle is flat.
    pub smooth: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            color_by: ColorBy::Tissue,
            wireframe: false,
            smooth: true,
        }
    }
}
