//! [`Coloring`]: a color per vertex, and two checks that the coloring is proper.
//!
//! Vertices of one color run at the same time, colors one after the other. A coloring is *proper*
//! if adjacent vertices differ. The two checks look at the result only and share no code with any
//! coloring algorithm: one walks the edges of a graph, the other needs no graph and walks particle
//! by particle. Each costs one pass over its input.

use crate::{Classes, ColorId, ConstraintGraph, GraphError, Incidence};

/// A color for every vertex `0..vertex_count()`.
///
/// Colors are labels from 0. Algorithms normally use each label up to the largest; local recoloring
/// may leave gaps. The coloring need not be proper: call [`verify`](Self::verify).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Coloring {
    colors: Vec<ColorId>,
}

impl Coloring {
    /// A coloring in which vertex `v` has color `colors[v]`.
    #[must_use]
    pub fn new(colors: Vec<ColorId>) -> Self {
        Self { colors }
    }

    /// The number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.colors.len()
    }

    /// The color of vertex `v`.
    ///
    /// # Panics
    /// If there is no vertex `v`.
    #[must_use]
    pub fn color(&self, v: usize) -> ColorId {
        self.colors[v]
    }

    /// The colors of all vertices.
    #[must_use]
    pub fn colors(&self) -> &[ColorId] {
        &self.colors
    }

    /// The largest label plus one, 0 for no vertices: the number of steps a solver makes.
    /// O(vertices).
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.colors
            .iter()
            .max()
            .map_or(0, |color| color.index() + 1)
    }

    /// The number of labels in use; less than [`color_count`](Self::color_count) if there are gaps.
    /// O(vertices + colors).
    #[must_use]
    pub fn distinct_colors(&self) -> usize {
        let mut used = vec![false; self.color_count()];
        for color in &self.colors {
            used[color.index()] = true;
        }
        used.into_iter().filter(|&used| used).count()
    }

    /// Changes the color of vertex `v`. O(1).
    ///
    /// # Panics
    /// If there is no vertex `v`.
    pub fn set(&mut self, v: usize, color: ColorId) {
        self.colors[v] = color;
    }

    /// Adds a vertex at the end. Amortized O(1).
    pub fn push(&mut self, color: ColorId) {
        self.colors.push(color);
    }

    /// Closes gaps: renumbers the colors, in order, to `0..distinct_colors()`. O(vertices +
    /// colors).
    ///
    /// ```
    /// use incise_graph::{ColorId, Coloring};
    ///
    /// let mut coloring = Coloring::new([4, 1, 4].map(ColorId).to_vec());
    /// coloring.compact();
    /// assert_eq!(coloring.colors(), [1, 0, 1].map(ColorId));
    /// ```
    pub fn compact(&mut self) {
        let mut name = vec![0u32; self.color_count()];
        for color in &self.colors {
            name[color.index()] = 1;
        }
        let mut next = 0;
        for name in &mut name {
            next += std::mem::replace(name, next);
        }
        for color in &mut self.colors {
            *color = ColorId(name[color.index()]);
        }
    }

    /// The vertices of every color, ascending. O(vertices + colors).
    #[must_use]
    pub fn classes(&self) -> Classes {
        Classes::group(self.color_count(), self.colors.iter().map(|color| color.0))
    }

    /// The vertices of every color that fulfill a condition, ascending. O(vertices + colors).
    ///
    /// ```
    /// use incise_graph::{ColorId, Coloring};
    ///
    /// // Vertex 1 is the slot of a removed constraint.
    /// let coloring = Coloring::new([0, 0, 1].map(ColorId).to_vec());
    /// let classes = coloring.classes_of(|v| v != 1);
    /// assert!(classes.iter().eq([&[0], &[2]]));
    /// ```
    #[must_use]
    pub fn classes_of(&self, is_member: impl Fn(usize) -> bool + Clone) -> Classes {
        let labels = self.colors.iter().enumerate();
        // No class has this label.
        let label =
            move |(v, color): (usize, &ColorId)| if is_member(v) { color.0 } else { u32::MAX };
        Classes::group(self.color_count(), labels.map(label))
    }

    /// Checks that adjacent vertices of `graph` differ. O(vertices + edges).
    ///
    /// # Errors
    /// The first offending edge (smallest first vertex, then smallest second one), or a wrong
    /// number of vertices.
    ///
    /// ```
    /// use incise_graph::{ColorId, Coloring, ConstraintGraph};
    ///
    /// let path = ConstraintGraph::from_edges(3, &[(0, 1), (1, 2)])?;
    /// assert!(Coloring::new([0, 1, 0].map(ColorId).to_vec()).verify(&path).is_ok());
    /// let error = Coloring::new([0, 1, 1].map(ColorId).to_vec()).verify(&path).unwrap_err();
    /// assert_eq!(error.to_string(), "vertices 1 and 2 are adjacent and both have color 1");
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn verify(&self, graph: &ConstraintGraph) -> Result<(), GraphError> {
        self.expect_vertices(graph.vertex_count())?;
        for (first, second) in graph.edges() {
            let color = self.color(first as usize);
            if color == self.color(second as usize) {
                return Err(GraphError::SameColor {
                    first,
                    second,
                    color,
                });
            }
        }
        Ok(())
    }

    /// Checks that constraints of one color share no particle, without a graph. O(entries +
    /// colors).
    ///
    /// For a coloring of clusters, pass the [`quotient`](Incidence::quotient) incidence.
    ///
    /// # Errors
    /// The first offending pair of the smallest offending particle, or a wrong number of
    /// constraints.
    pub fn verify_incidence(&self, incidence: &Incidence) -> Result<(), GraphError> {
        self.expect_vertices(incidence.constraint_count())?;
        // For each color the last particle at which it was seen, and the constraint that had it
        // there.
        let mut seen = vec![(u32::MAX, 0); self.color_count()];
        for (particle, p) in (0..).zip(0..incidence.particle_count()) {
            for &second in incidence.constraints_of(p) {
                let color = self.color(second as usize);
                let (last_particle, first) = seen[color.index()];
                if last_particle == particle {
                    return Err(GraphError::SharedParticle {
                        first,
                        second,
                        color,
                        particle,
                    });
                }
                seen[color.index()] = (particle, second);
            }
        }
        Ok(())
    }

    fn expect_vertices(&self, expected: usize) -> Result<(), GraphError> {
        let found = self.vertex_count();
        if found == expected {
            Ok(())
        } else {
            Err(GraphError::Length {
                what: "coloring",
                expected,
                found,
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coloring(colors: &[u32]) -> Coloring {
        Coloring::new(colors.iter().copied().map(ColorId).collect())
    }

    #[test]
    fn counts_and_classes_with_a_gap() {
        let mut coloring = coloring(&[3, 0, 3]);
        coloring.push(ColorId(1));
        assert_eq!((coloring.color_count(), coloring.distinct_colors()), (4, 3));
        let classes: Vec<Vec<u32>> = coloring.classes().iter().map(<[u32]>::to_vec).collect();
        assert_eq!(classes, [vec![1], vec![3], vec![], vec![0, 2]]);
        coloring.set(0, ColorId(0));
        coloring.set(2, ColorId(0));
        assert_eq!((coloring.color_count(), coloring.distinct_colors()), (2, 2));
    }

    #[test]
    fn both_proofs_name_the_first_offense() {
        let incidence =
            Incidence::from_constraints(4, [[0u32, 1], [1, 2], [2, 3], [3, 0]]).unwrap();
        let graph = ConstraintGraph::from_incidence(&incidence);
        let good = coloring(&[0, 1, 0, 1]);
        good.verify(&graph).unwrap();
        good.verify_incidence(&incidence).unwrap();
        let bad = coloring(&[0, 1, 1, 0]);
        let color = ColorId(0);
        assert_eq!(
            bad.verify(&graph),
            Err(GraphError::SameColor {
                first: 0,
                second: 3,
                color
            })
        );
        assert_eq!(
            bad.verify_incidence(&incidence),
            Err(GraphError::SharedParticle {
                first: 0,
                second: 3,
                color,
                particle: 0
            })
        );
        let short = coloring(&[0]);
        let length = GraphError::Length {
            what: "coloring",
            expected: 4,
            found: 1,
        };
        assert_eq!(short.verify(&graph), Err(length.clone()));
        assert_eq!(short.verify_incidence(&incidence), Err(length));
    }

    #[test]
    fn no_vertices() {
        let none = Coloring::default();
        assert_eq!(
            (
                none.color_count(),
                none.distinct_colors(),
                none.classes().count()
            ),
            (0, 0, 0)
        );
        none.verify(&ConstraintGraph::from_edges(0, &[]).unwrap())
            .unwrap();
    }
}
