//! The viewer on a web page: it draws on the page's canvas with WebGPU and simulates on the page's one thread.
//!
//! `?scene=FILE` in the page's address opens a scene, mesh or surface that lies beside the page.

use std::path::Path;

use eframe::wasm_bindgen::{JsCast, JsValue};
use eframe::{WebOptions, WebRunner, web_sys};
use incise::scene::Backend;
use web_sys::js_sys::Uint8Array;
use web_sys::{HtmlCanvasElement, Response, UrlSearchParams, Window};

use crate::app::Viewer;
use crate::graphics;
use crate::load::{Source, TETS};
use crate::page::{canvas, set};
use crate::sentence::sentence;

/// Starts the viewer; an error becomes the attribute `data-error` of the canvas.
pub(crate) fn main() {
    wasm_bindgen_futures::spawn_local(async {
        if let Err(error) = start().await {
            let text = error.as_string().unwrap_or_else(|| format!("{error:?}"));
            set("data-error", &text);
        }
    });
}

async fn start() -> Result<(), JsValue> {
    let window = web_sys::window().ok_or("there is no window")?;
    let canvas: HtmlCanvasElement = canvas().ok_or("the page has no canvas")?.dyn_into()?;
    let source = match UrlSearchParams::new_with_str(&window.location().search()?)?.get("scene") {
        Some(address) => {
            let bytes = fetch(&window, &address).await?;
            Source::from_bytes(Path::new(&address), bytes, TETS)
        }
        None => Source::new(None, TETS),
    };
    let source = source.map_err(|error| sentence(&error))?;
    let options = WebOptions {
        wgpu_options: graphics::configuration(),
        ..WebOptions::default()
    };
    WebRunner::new()
        .start(
            canvas,
            options,
            Box::new(|creation| {
                let viewer = Viewer::new(creation, source, Backend::Cpu, TETS, false);
                Ok(Box::new(viewer))
            }),
        )
        .await
}

/// The contents behind an address.
async fn fetch(window: &Window, address: &str) -> Result<Vec<u8>, JsValue> {
    let response = wasm_bindgen_futures::JsFuture::from(window.fetch_with_str(address)).await?;
    let response: Response = response.dyn_into()?;
    if !response.ok() {
        return Err(format!("{address}: the server answers {}", response.status()).into());
    }
    let bytes = wasm_bindgen_futures::JsFuture::from(response.array_buffer()?).await?;
    Ok(Uint8Array::new(&bytes).to_vec())
}
