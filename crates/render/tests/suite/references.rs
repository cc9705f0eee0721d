//! Pictures equal stored ones that were checked by eye, by software and, where there is an adapter, by a device.

use std::path::Path;

use incise_render::{Camera, ColorBy, Image, Style, software_picture};

use crate::support::{Difference, LIVER, Shown, TWO_BODIES};

const SIZE: [u32; 2] = [128, 96];

/// A scene and how it is drawn.
struct Reference {
    name: &'static str,
    shown: Shown,
    camera: Camera,
    style: Style,
}

fn references() -> [Reference; 3] {
    let liver = Shown::new(LIVER, 16);
    let mut colored = Shown::new(LIVER, 6);
    colored
        .render_scene
        .color(&mut colored.simulation, ColorBy::Color, None)
        .unwrap();
    let [low, high] = colored.render_scene.bounds(&colored.simulation);
    let closer = Camera::fit(low, high);
    let mut bodies = Shown::new(TWO_BODIES, 5);
    let blade = [[-0.5, -0.5, 0.2], [0.2, 0.0, 0.25], [0.5, 0.5, 0.1]];
    bodies
        .render_scene
        .set_blade(Some(&blade.map(glam::DVec3::from_array)));
    [
        Reference {
            name: "liver",
            camera: liver.camera(),
            shown: liver,
            style: Style::default(),
        },
        Reference {
            name: "colors",
            camera: closer,
            shown: colored,
            style: Style {
                color_by: ColorBy::Color,
                wireframe: true,
                ..Style::default()
            },
        },
        Reference {
            name: "two_bodies",
            camera: bodies.camera(),
            shown: bodies,
            style: Style::default(),
        },
    ]
}

fn stored(name: &str) -> Image {
    Image::read_png(path(name)).unwrap_or_else(|error| panic!("{error}: see main.rs"))
}

fn path(name: &str) -> std::path::PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references");
    folder.join(format!("{name}.png"))
}

#[test]
fn software_draws_the_references() {
    for reference in references() {
        let Reference {
            name,
            shown,
            camera,
            style,
        } = reference;
        let (render_scene, simulation) = (&shown.render_scene, &shown.simulation);
        let drawn = software_picture(render_scene, simulation.positions(), &camera, &style, SIZE);
        let drawn = drawn.unwrap();
        if std::env::var_os("INCISE_BLESS").is_some() {
            drawn.write_png(path(name)).unwrap();
        }
        // The same code: only sines and exponentials of another library may round another way, which moves an edge over
        // a sample now and then.
        let difference = Difference::of(&drawn, &stored(name), 8);
        assert!(
            difference.mean < 0.2 && difference.share < 0.005,
            "{name}: {difference:?}"
        );
    }
}

#[cfg(feature = "gpu")]
#[test]
fn a_device_draws_the_references() {
    let Some(gpu) = crate::support::gpu("a_device_draws_the_references") else {
        return;
    };
    let mut renderer = incise_render::GpuRenderer::new(gpu).unwrap();
    for reference in references() {
        let Reference {
            name,
            shown,
            camera,
            style,
        } = reference;
        let (render_scene, simulation) = (&shown.render_scene, &shown.simulation);
        let drawn = renderer
            .picture(render_scene, simulation, &camera, &style, SIZE)
            .unwrap();
        let expected = stored(name);
        // Formulas are the same, so areas agree to rounding: half a step of a byte, twice. Samples of a pixel are where
        // the standard has them on most devices and may be elsewhere: an edge pixel is then off by up to a quarter of
        // the contrast, and some 5% of the pixels are on edges of bodies, most of them if all triangles are outlined.
        let difference = Difference::of(&drawn, &expected, 24);
        let edges = if style.wireframe { 0.08 } else { 0.02 };
        assert!(
            difference.mean < 1.0 && difference.share < edges,
            "{name}: {difference:?}"
        );
    }
}
