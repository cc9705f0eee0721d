//! [`write_atomically`]: writing of files whose final name never shows partial content.
//!
//! The content goes to a file with a temporary name in the same folder, which is renamed when complete and removed
//! after any error or panic. Readers see the old file or the new one. The content is passed to the operating system but
//! not flushed to the disk: after a power failure the file may be lost.

use std::fs::{self, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::MeshIoError;

/// Calls `content` with a buffered writer and moves the result to `path` if it is complete.
///
/// # Errors
/// [`MeshIoError::Io`] with the error of `content` or of the file system. No temporary file remains then, and an
/// existing file at `path` is unchanged.
///
/// # Example
/// ```
/// use incise_mesh_io::write_atomically;
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.txt", std::process::id()));
/// write_atomically(&path, |file| writeln!(file, "complete"))?;
/// let failed = write_atomically(&path, |file| {
///     writeln!(file, "half")?;
///     Err(std::io::Error::other("out of ideas"))
/// });
/// assert!(failed.is_err());
/// assert_eq!(std::fs::read_to_string(&path).unwrap(), "complete\n");
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn write_atomically(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), MeshIoError> {
    let path = path.as_ref();
    let write = || {
        let mut name = path
            .file_name()
            .ok_or_else(|| io::Error::other("the path has no file name"))?
            .to_owned();
        static COUNTER: AtomicU32 = AtomicU32::new(0);
        let unique = COUNTER.fetch_add(1, Ordering::Relaxed);
        name.push(format!(".{}-{unique}.tmp", std::process::id()));
        let temporary = path.with_file_name(name);
        let file = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&temporary)?;
        let remover = Remover(Some(temporary));

        let mut writer = BufWriter::new(file);
        content(&mut writer)?;
        // Closed before it is renamed, because some systems cannot rename an open file.
        drop(
            writer
                .into_inner()
                .map_err(io::IntoInnerError::into_error)?,
        );
        remover.keep_as(path)
    };
    write().map_err(|source| MeshIoError::Io {
        action: "write",
        path: path.to_owned(),
        source,
    })
}

/// Removes the temporary file when dropped before the rename.
struct Remover(Option<PathBuf>);

impl Remover {
    fn keep_as(mut self, path: &Path) -> io::Result<()> {
        if let Some(temporary) = &self.0 {
            fs::rename(temporary, path)?;
            self.0 = None;
        }
        Ok(())
    }
}

impl Drop for Remover {
    fn drop(&mut self) {
        if let Some(temporary) = &self.0 {
            // This error cannot be reported, since another one is being returned.
            fs::remove_file(temporary).ok();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_writes_leave_no_file() {
        let folder = tempfile::tempdir().expect("there is a place for temporary files");
        let path = folder.path().join("a.txt");
        let failed = write_atomically(&path, |file| {
            file.write_all(&[0; 100_000])?;
            Err(io::Error::other("enough"))
        });
        let error = failed.unwrap_err();
        assert!(error.to_string().ends_with("a.txt"), "{error}");
        let cause = std::error::Error::source(&error).map(ToString::to_string);
        assert_eq!(cause.as_deref(), Some("enough"));
        let panicked =
            std::panic::catch_unwind(|| write_atomically(&path, |_| panic!("on purpose")));
        assert!(panicked.is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);

        write_atomically(&path, |file| file.write_all(b"old")).unwrap();
        write_atomically(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_atomically(folder.path().join("none/a.txt"), |_| Ok(())).is_err());
        assert!(write_atomically("/", |_| Ok(())).is_err());
    }
}
