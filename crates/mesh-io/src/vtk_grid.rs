//! Conversion of a VTK unstructured grid, with cells of any kind, to a mesh of tets.
//!
//! Tets are kept, cells of lower dimension dropped (meshing tools put boundary triangles into the same list), and so
//! are their values. Volume cells of other kinds are an error, since dropping them would leave holes. Linear.
//!
//! Source: `vtkCellType.h` of the VTK library for the numbers of the kinds.

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use crate::fields::whole;
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues};

/// VTK's number for a tetrahedron.
pub(crate) const TETRA: usize = 10;

/// The name under which regions are written.
pub(crate) const REGIONS: &str = "regions";

/// Names of cell values with region numbers: ours, and those of meshio and Gmsh.
const REGION_NAMES: [&str; 5] = [
    REGIONS,
    "medit:ref",
    "gmsh:physical",
    "tetgen:ref",
    "CellEntityIds",
];

/// The content of an unstructured grid.
#[derive(Default)]
pub(crate) struct Grid {
    pub(crate) positions: Vec<DVec3>,
    /// The corners of cell `c` are `points[offsets[c]..offsets[c + 1]]`.
    pub(crate) offsets: Vec<usize>,
    pub(crate) points: Vec<usize>,
    /// VTK's number for the kind of each cell.
    pub(crate) types: Vec<usize>,
    pub(crate) particles: Vec<NamedValues>,
    pub(crate) cells: Vec<NamedValues>,
}

impl Grid {
    /// The tets with their values. There must be one type and one value for each cell and one value for each point.
    ///
    /// # Errors
    /// [`MeshIoError::Empty`] without cells, or the result of `error` for a cell, the number of points of the cells
    /// before it and a message.
    pub(crate) fn into_file(
        self,
        error: impl Fn(usize, usize, String) -> MeshIoError,
    ) -> Result<MeshFile, MeshIoError> {
        let error = |cell: usize, message| error(cell, self.offsets[cell], message);
        if self.types.is_empty() {
            return Err(MeshIoError::Empty);
        }
        let is_tet = |&(_, &kind): &(usize, &usize)| kind == TETRA;
        let cells = || self.types.iter().enumerate();
        let mut tets = Vec::with_capacity(cells().filter(is_tet).count());
        for (cell, &kind) in cells() {
            let points = &self.points[self.offsets[cell]..self.offsets[cell + 1]];
            match kind {
                // A truncated text may end in the type 1 for 10.
                1 if points.len() > 1 => {
                    let message = format!(
                        "the cell {cell} is a single point (cell type 1) but has {}, correct it",
                        points.len()
                    );
                    return Err(error(cell, message));
                }
                TETRA => {
                    let tet = tet(cell, points, self.positions.len());
                    tets.push(tet.map_err(|message| error(cell, message))?);
                }
                // Points, lines and faces, straight, quadratic and of higher order.
                0..10 | 21..=23 | 28 | 30 | 34..=36 | 68..=70 | 75..=77 => {}
                _ => {
                    let message = format!(
                        "the cell {cell} is a {} (cell type {kind}), only tets with 4 points are read: convert the mesh",
                        volume_name(kind)
                    );
                    return Err(error(cell, message));
                }
            }
        }
        if tets.is_empty() {
            let message = format!(
                "none of the {} cells is a tetrahedron (cell type {TETRA}), mesh the volume",
                self.types.len()
            );
            return Err(error(0, message));
        }
        let mut of_tets = self.cells;
        if tets.len() < self.types.len() && !of_tets.is_empty() {
            let taken: Vec<usize> = cells().filter(is_tet).map(|(cell, _)| cell).collect();
            for field in &mut of_tets {
                match &mut field.values {
                    OwnedValues::Scalars(v) => *v = taken.iter().map(|&cell| v[cell]).collect(),
                    OwnedValues::Vectors(v) => *v = taken.iter().map(|&cell| v[cell]).collect(),
                }
            }
        }
        Ok(MeshFile {
            regions: take_regions(&mut of_tets),
            mesh: TetMesh {
                positions: self.positions,
                tets,
            },
            particles: self.particles,
            tets: of_tets,
        })
    }
}

fn tet(cell: usize, points: &[usize], particles: usize) -> Result<[ParticleId; 4], String> {
    let &[a, b, c, d] = points else {
        return Err(format!(
            "the tet {cell} has {} points instead of 4, correct it",
            points.len()
        ));
    };
    if let Some(corner) = [a, b, c, d].into_iter().find(|&corner| corner >= particles) {
        return Err(format!(
            "the cell {cell} uses point {corner} but there are {particles}, counted from 0"
        ));
    }
    Ok([a, b, c, d].map(ParticleId::new))
}

/// Removes and returns the first values that have a name of regions and are whole numbers of 32 bits.
fn take_regions(fields: &mut Vec<NamedValues>) -> Vec<i32> {
    for i in 0..fields.len() {
        if let OwnedValues::Scalars(values) = &fields[i].values
            && REGION_NAMES.contains(&fields[i].name.as_str())
            && let Some(regions) = values.iter().map(|&v| whole(v)).collect()
        {
            fields.remove(i);
            return regions;
        }
    }
    Vec::new()
}

fn volume_name(kind: usize) -> &'static str {
    match kind {
        11 => "voxel",
        12 => "hexahedron",
        13 => "wedge",
        14 => "pyramid",
        15 => "pentagonal prism",
        16 => "hexagonal prism",
        24 => "quadratic tetrahedron",
        25 | 29 | 33 => "quadratic hexahedron",
        26 | 31 | 32 => "quadratic wedge",
        27 | 37 => "quadratic pyramid",
        41 => "convex point set",
        42 => "polyhedron",
        71 | 78 => "tetrahedron of higher order",
        72 | 79 => "hexahedron of higher order",
        73 | 80 => "wedge of higher order",
        74 | 81 => "pyramid of higher order",
        _ => "cell of a kind that is not known",
    }
}

/// Values by their number of components: scalars, vectors, or `None` for other numbers.
pub(crate) fn named_values(
    name: String,
    components: usize,
    values: Vec<f64>,
) -> Option<NamedValues> {
    let values = match components {
        1 => OwnedValues::Scalars(values),
        3 => OwnedValues::Vectors(positions(&values)),
        _ => return None,
    };
    Some(NamedValues { name, values })
}

/// Groups of three numbers as vectors.
pub(crate) fn positions(values: &[f64]) -> Vec<DVec3> {
    let (triples, _) = values.as_chunks::<3>();
    triples.iter().copied().map(DVec3::from).collect()
}
