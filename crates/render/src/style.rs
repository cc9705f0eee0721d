//! [`Style`] and [`ColorBy`]: how bodies are drawn.

use std::fmt;
use std::str::FromStr;

use crate::RenderError;

/// What the colors of a body show.
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
    /// What the body is made of: the outer surface dark, cut faces light.
    #[default]
    Tissue,
    /// The color of the tet's cluster: what is solved together.
    Color,
    /// The tet's cluster.
    Cluster,
    /// The piece that the tet belongs to.
    Piece,
    /// The largest principal stretch of the tet.
    Stretch,
    /// How far the tet's constraints are from solved.
    Residual,
}

impl ColorBy {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Tissue,
        Self::Color,
        Self::Cluster,
        Self::Piece,
        Self::Stretch,
        Self::Residual,
    ];
    /// Their names, for messages.
    pub const KNOWN: &str = "tissue, color, cluster, piece, stretch, residual";

    /// The name, as it is parsed.
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

/// How bodies are drawn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Style {
    /// What colors show. Colors other than of tissue are those that [`RenderScene::color`](crate::RenderScene::color) made last
    /// for the same; triangles without one are drawn as tissue.
    pub color_by: ColorBy,
    /// Whether the edges of triangles are drawn.
    pub wireframe: bool,
    /// Whether shading is smooth over the outer surface; otherwise each triangle is flat.
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
