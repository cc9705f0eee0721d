//! Which files a run may write, and how often.

use std::path::Path;

/// About how many surfaces, and as many pictures, a run saves.
const SURFACES: u64 = 50;

/// Every how many frames a surface is saved, and a picture.
pub(crate) fn save_every(frames: u64) -> u64 {
    frames.div_ceil(SURFACES)
}

/// Refuses a path that no file can have.
pub(crate) fn require_file(path: &Path) -> anyhow::Result<()> {
    let why = match path.parent() {
        _ if path.is_dir() => "it is a folder",
        None => "it names no file",
        // That of a bare name is empty.
        Some(folder) if folder != Path::new("") && !folder.is_dir() => "there is no such folder",
        Some(_) => return Ok(()),
    };
    anyhow::bail!("cannot write {}: {why}", path.display())
}
