//! [`OpenDialog`]: the dialog of the desktop or of the browser for the choice of a file.
//!
//! The window goes on while the dialog is open: a thread waits for it, or a task of the browser.

use std::sync::mpsc::{Receiver, channel};

use rfd::{AsyncFileDialog, FileHandle};

/// Endings of scenes, meshes and surfaces.
const ENDINGS: [&str; 13] = [
    "toml", "vtk", "vtu", "msh", "node", "ele", "mesh", "obj", "stl", "ply", "off", "gltf", "glb",
];

/// A dialog that is open.
#[derive(Debug)]
pub(crate) struct OpenDialog {
    chosen: Receiver<FileHandle>,
}

impl OpenDialog {
    /// Opens the dialog; `wake` is called when it is closed.
    pub(crate) fn open(wake: impl FnOnce() + Send + 'static) -> Self {
        let dialog = AsyncFileDialog::new()
            .add_filter("Scenes, meshes and surfaces", &ENDINGS)
            .add_filter("All files", &["*"])
            .pick_file();
        let (sender, chosen) = channel();
        let wait = async move {
            if let Some(file) = dialog.await {
                // The window may have opened another dialog.
                let _ = sender.send(file);
            }
            wake();
        };
        #[cfg(target_family = "wasm")]
        wasm_bindgen_futures::spawn_local(wait);
        #[cfg(not(target_family = "wasm"))]
        std::thread::spawn(|| pollster::block_on(wait));
        Self { chosen }
    }

    /// The chosen file, once.
    pub(crate) fn poll(&self) -> Option<FileHandle> {
        self.chosen.try_recv().ok()
    }
}
