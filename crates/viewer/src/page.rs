//! The page around the viewer: its canvas, which has the state as attributes for the page's own scripts.
//!
//! They are `data-frame`, `data-tets`, `data-pieces` and, if there is one, `data-error`.

use eframe::web_sys::{self, Element};
use incise::report::FrameReport;

/// Identifier of the canvas on the page.
const CANVAS: &str = "incise";

/// Sets the canvas's attributes to the state of a frame.
pub(crate) fn publish(report: Option<&FrameReport>, error: Option<&str>) {
    if let Some(report) = report {
        set("data-frame", &report.frame.to_string());
        set("data-tets", &report.tets.to_string());
        set("data-pieces", &report.pieces.to_string());
    }
    if let Some(error) = error {
        set("data-error", error);
    }
}

/// The canvas on the page.
pub(crate) fn canvas() -> Option<Element> {
    web_sys::window()?.document()?.get_element_by_id(CANVAS)
}

/// Sets an attribute of the canvas.
pub(crate) fn set(name: &str, value: &str) {
    if let Some(canvas) = canvas() {
        // Only a malformed name could fail.
        let _ = canvas.set_attribute(name, value);
    }
}
