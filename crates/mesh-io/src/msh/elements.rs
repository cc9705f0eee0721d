//! The element types of MSH files: read, skipped, or unsupported.
//!
//! Source: the Gmsh reference manual, section "MSH file format", list of element types.

/// The treatment of an element type.
#[derive(Debug, PartialEq)]
pub(super) enum Kind {
    /// A tet with four nodes, which is read.
    Tet,
    /// A point, line, triangle or quadrilateral with this many nodes, which is skipped.
    Lower(usize),
    /// A volume element other than a tet with four nodes, which is an error with this name.
    Volume(&'static str),
    /// An unknown number, which is an error.
    Unknown,
}

/// The treatment of the element type with this number.
pub(super) const fn kind_of(number: i32) -> Kind {
    match number {
        4 => Kind::Tet,
        15 => Kind::Lower(1),
        1 => Kind::Lower(2),
        2 | 8 => Kind::Lower(3),
        3 | 26 => Kind::Lower(4),
        27 => Kind::Lower(5),
        9 | 28 => Kind::Lower(6),
        16 => Kind::Lower(8),
        10 | 20 => Kind::Lower(9),
        21 => Kind::Lower(10),
        22 => Kind::Lower(12),
        23 | 24 => Kind::Lower(15),
        36 => Kind::Lower(16),
        25 => Kind::Lower(21),
        37 => Kind::Lower(25),
        5 => Kind::Volume("hexahedron"),
        6 => Kind::Volume("prism (wedge)"),
        7 => Kind::Volume("pyramid"),
        11 => Kind::Volume("10-node tetrahedron"),
        12 => Kind::Volume("27-node hexahedron"),
        13 => Kind::Volume("18-node prism (wedge)"),
        14 => Kind::Volume("14-node pyramid"),
        17 => Kind::Volume("20-node hexahedron"),
        18 => Kind::Volume("15-node prism (wedge)"),
        19 => Kind::Volume("13-node pyramid"),
        29 => Kind::Volume("20-node tetrahedron"),
        30 => Kind::Volume("35-node tetrahedron"),
        31 => Kind::Volume("56-node tetrahedron"),
        92 => Kind::Volume("64-node hexahedron"),
        93 => Kind::Volume("125-node hexahedron"),
        _ => Kind::Unknown,
    }
}
