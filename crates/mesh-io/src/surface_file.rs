//! [`SurfaceFile`]: a surface with the texture coordinates of its file.
//!
//! Texture coordinates belong to corners of triangles and not to points, because they differ along the seams where a
//! texture is cut open. As in Wavefront files they are a list of their own, and each corner has a number in it. Cost:
//! O(values).

use glam::DVec2;
use incise_mesh::TriangleSurface;

use crate::MeshIoError;

/// The content of a surface file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceFile {
    /// Points and triangles.
    pub surface: TriangleSurface,
    /// Texture coordinates: to the right and up, (0, 0) and (1, 1) are the corners of the image. Empty if the file has
    /// none.
    pub texture: Vec<DVec2>,
    /// For each triangle the numbers of its corners' texture coordinates; empty if there are none.
    pub texture_corners: Vec<[u32; 3]>,
}

impl From<TriangleSurface> for SurfaceFile {
    fn from(surface: TriangleSurface) -> Self {
        Self {
            surface,
            ..Self::default()
        }
    }
}

impl SurfaceFile {
    /// The texture coordinates of the corners of a triangle; `None` if there are none. O(1).
    ///
    /// # Example
    /// ```
    /// let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.5\nf 1/1 2/2 3/3\n";
    /// let file = incise_mesh_io::parse_surface_file("a.obj", text)?;
    /// assert_eq!(file.texture_of(0).map(|corners| corners[2].y), Some(0.5));
    /// # Ok::<(), incise_mesh_io::MeshIoError>(())
    /// ```
    #[must_use]
    pub fn texture_of(&self, triangle: usize) -> Option<[DVec2; 3]> {
        let corners = self.texture_corners.get(triangle)?;
        let [a, b, c] = corners.map(|corner| self.texture.get(corner as usize).copied());
        Some([a?, b?, c?])
    }

    /// Checks that texture coordinates, if there are any, are given for each triangle.
    ///
    /// # Errors
    /// [`MeshIoError::FieldLength`] if they are given for some triangles only, or a corner has a number beyond their
    /// list.
    pub fn check(&self) -> Result<(), MeshIoError> {
        let triangles = self.surface.triangles.len();
        let given = (0..triangles).filter(|&t| self.texture_of(t).is_some());
        let found = given.count();
        let listed = self.texture_corners.len();
        if listed > 0 && (found, listed) != (triangles, triangles) {
            return Err(MeshIoError::FieldLength {
                name: "texture coordinates".to_owned(),
                expected: triangles,
                found,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use incise_mesh::kuhn_box;

    #[test]
    fn texture_coordinates_are_those_of_all_triangles_or_none() {
        let mut file = SurfaceFile::from(TriangleSurface::boundary_of(&kuhn_box(
            [1, 1, 1],
            DVec3::ONE,
        )));
        assert!(file.check().is_ok());
        assert_eq!(file.texture_of(0), None);
        file.texture = vec![DVec2::X, DVec2::Y];
        file.texture_corners = vec![[0, 1, 0]; 12];
        assert!(file.check().is_ok());
        assert_eq!(file.texture_of(11), Some([DVec2::X, DVec2::Y, DVec2::X]));
        file.texture_corners[3][1] = 2;
        assert!(matches!(
            file.check(),
            Err(MeshIoError::FieldLength {
                expected: 12,
                found: 11,
                ..
            })
        ));
        file.texture_corners = vec![[0, 1, 0]; 13];
        assert!(file.check().is_err());
    }
}
