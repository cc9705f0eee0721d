//! Output paths of a run, and the interval at which files are saved.

use std::path::Path;

/// Approximate number of surfaces, and of images, that a run saves.
const SURFACES: u64 = 50;

/// Interval in frames between saved surfaces and images.
pub(crate) fn save_every(frames: u64) -> u64 {
    frames.div_ceil(SURFACES)
}

/// Returns an error for a path that cannot be a file.
pub(crate) fn require_file(path: &Path) -> anyhow::Result<()> {
    let why = match path.parent() {
        _ if path.is_dir() => "it is a folder",
        None => "it names no file",
        // The parent of a bare file name is empty.
        Some(folder) if folder != Path::new("") && !folder.is_dir() => "there is no such folder",
        Some(_) => return Ok(()),
    };
    anyhow::bail!("cannot write {}: {why}", path.display())
}
