//! Drawing on a device: from the solver's own buffer, with the normals and the pixels of the processor.

#![cfg(feature = "gpu")]

use std::sync::Arc;

use glam::Vec3;
use incise::{Scene, Simulation};
use incise_render::{
    Camera, ColorBy, GpuRenderer, Image, RenderError, RenderScene, Style, normal_sums,
    software_picture,
};

use crate::support::{Difference, LIVER, Shown, TWO_BODIES, gpu};

const SIZE: [u32; 2] = [120, 90];

/// Draws on both and compares. The same tolerances as for the references, but for what both see the same.
fn assert_alike(renderer: &mut GpuRenderer, shown: &Shown, style: &Style, what: &str) {
    let camera = shown.camera();
    let (render_scene, simulation) = (&shown.render_scene, &shown.simulation);
    let there = renderer
        .picture(render_scene, simulation, &camera, style, SIZE)
        .unwrap();
    let here = software_picture(render_scene, simulation.positions(), &camera, style, SIZE);
    let difference = Difference::of(&there, &here.unwrap(), 24);
    assert!(
        difference.mean < 1.0 && difference.share < 0.04,
        "{what}: {difference:?}"
    );
}

#[test]
fn both_draw_the_same() {
    let Some(gpu) = gpu("both_draw_the_same") else {
        return;
    };
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    // One renderer for all, so that what it keeps of one render_scene does not show in another.
    let mut liver = Shown::new(LIVER, 0);
    let bodies = Shown::new(TWO_BODIES, 2);
    for frame in 0..4 {
        assert_alike(&mut renderer, &liver, &Style::default(), "tissue");
        assert_alike(&mut renderer, &bodies, &Style::default(), "bodies");
        let by = [ColorBy::Color, ColorBy::Piece, ColorBy::Stretch][frame % 3];
        liver
            .render_scene
            .color(&mut liver.simulation, by, None)
            .unwrap();
        for smooth in [true, false] {
            let style = Style {
                color_by: by,
                wireframe: !smooth,
                smooth,
            };
            assert_alike(&mut renderer, &liver, &style, by.name());
        }
        liver.advance(1);
    }
}

/// Reads the simulation back, draws it by software and compares. As in `assert_alike`.
fn assert_present(
    there: &Image,
    render_scene: &RenderScene,
    simulation: &mut Simulation,
    camera: &Camera,
    what: &str,
) {
    simulation.read_back().unwrap();
    let here = software_picture(
        render_scene,
        simulation.positions(),
        camera,
        &Style::default(),
        SIZE,
    )
    .unwrap();
    let difference = Difference::of(there, &here, 24);
    assert!(
        difference.mean < 1.0 && difference.share < 0.04,
        "{what}: {difference:?}"
    );
}

/// Draws twice; the second time sends no positions and no skin, and neither reads.
fn assert_little_is_sent(
    renderer: &mut GpuRenderer,
    render_scene: &RenderScene,
    simulation: &Simulation,
    camera: &Camera,
) {
    let read = renderer.readbacks();
    let mut sent = [0; 2];
    for sent in &mut sent {
        let before = renderer.uploaded_bytes();
        renderer
            .draw(render_scene, simulation, camera, &Style::default(), SIZE)
            .unwrap();
        *sent = renderer.uploaded_bytes() - before;
    }
    let positions = 16 * simulation.positions().len() as u64;
    assert!(sent[1] < positions, "{sent:?} of {positions} bytes");
    assert_eq!(renderer.readbacks(), read);
}

#[test]
fn positions_do_not_leave_the_device() {
    let Some(gpu) = gpu("positions_do_not_leave_the_device") else {
        return;
    };
    let scene = Scene::from_toml(&LIVER.replace("substeps = 8", "substeps = 1")).unwrap();
    let mut simulation = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    let mut render_scene = RenderScene::new(&simulation, &scene);
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let camera = Camera::fit(Vec3::splat(-0.22).into(), Vec3::splat(0.2).into());
    let style = Style::default();
    // Before the first step too, when the device has no positions yet.
    let there = renderer
        .picture(&render_scene, &simulation, &camera, &style, SIZE)
        .unwrap();
    assert_present(
        &there,
        &render_scene,
        &mut simulation,
        &camera,
        "at the start",
    );
    for _ in 0..20 {
        simulation.step().unwrap();
        render_scene.sync(&simulation);
    }
    assert!(!renderer.needs_read_back(&render_scene, &simulation));
    assert_little_is_sent(&mut renderer, &render_scene, &simulation, &camera);
    let there = renderer
        .picture(&render_scene, &simulation, &camera, &style, SIZE)
        .unwrap();
    // The host does not know yet how far it fell.
    let old =
        software_picture(&render_scene, simulation.positions(), &camera, &style, SIZE).unwrap();
    let difference = Difference::of(&there, &old, 24);
    assert!(difference.mean > 1.0, "{difference:?}");
    assert_present(
        &there,
        &render_scene,
        &mut simulation,
        &camera,
        "20 frames on",
    );
}

#[test]
fn a_late_render_scene_needs_host_positions() {
    let Some(gpu) = gpu("a_late_render_scene_needs_host_positions") else {
        return;
    };
    let scene = Scene::from_toml(&LIVER.replace("substeps = 8", "substeps = 1")).unwrap();
    let mut simulation = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let camera = Camera::fit(Vec3::splat(-0.22).into(), Vec3::splat(0.2).into());
    let style = Style::default();
    for _ in 0..10 {
        simulation.step().unwrap();
    }
    let mut render_scene = RenderScene::new(&simulation, &scene);
    for what in ["made", "reset"] {
        assert!(
            renderer.needs_read_back(&render_scene, &simulation),
            "{what}"
        );
        simulation.read_back().unwrap();
        let there = renderer
            .picture(&render_scene, &simulation, &camera, &style, SIZE)
            .unwrap();
        assert_present(&there, &render_scene, &mut simulation, &camera, what);
        simulation.step().unwrap();
        render_scene.sync(&simulation);
        assert!(
            !renderer.needs_read_back(&render_scene, &simulation),
            "{what}"
        );
        render_scene.reset(&simulation);
    }
}

#[test]
fn bodies_of_several_solvers_are_put_together_on_the_device() {
    let Some(gpu) = gpu("bodies_of_several_solvers_are_put_together_on_the_device") else {
        return;
    };
    let cuts = "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0.02, 0.0, 0.0]\nnormal = [1.0, 0.1, 0.0]\n";
    let scene = Scene::from_toml(&format!("{TWO_BODIES}{cuts}")).unwrap();
    let mut simulation = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    assert_eq!(simulation.device_solvers().count(), 2);
    let mut render_scene = RenderScene::new(&simulation, &scene);
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let [low, high] = render_scene.bounds(&simulation);
    let (camera, style) = (Camera::fit(low, high), Style::default());
    for frame in 0..3 {
        simulation.step().unwrap();
        render_scene.sync(&simulation);
        assert!(!renderer.needs_read_back(&render_scene, &simulation));
        let there = renderer
            .picture(&render_scene, &simulation, &camera, &style, SIZE)
            .unwrap();
        assert_present(
            &there,
            &render_scene,
            &mut simulation,
            &camera,
            &format!("frame {frame}"),
        );
    }
    assert_eq!(simulation.report().pieces, 4);
}

/// Sums of normals of the skin's vertices by the processor and by the device, for a simulation on the processor.
fn normals_of_both(renderer: &mut GpuRenderer, shown: &Shown) -> [Vec<[i32; 3]>; 2] {
    let (camera, style) = (shown.camera(), Style::default());
    renderer
        .draw(
            &shown.render_scene,
            &shown.simulation,
            &camera,
            &style,
            SIZE,
        )
        .unwrap();
    let there = renderer.read_normal_sums().unwrap();
    let skin = shown.render_scene.skin();
    let positions = shown.simulation.positions();
    let place = |p: usize| (positions[p] - positions[0]).as_vec3();
    let vertices = skin.vertices().iter();
    let places: Vec<Vec3> = vertices
        .map(|vertex| place(vertex.particle.index()))
        .collect();
    let here = normal_sums(skin.triangles(), &places);
    assert_eq!(here.len(), there.len());
    [here, there]
}

#[test]
fn device_normals_equal_those_of_the_cpu() {
    let Some(gpu) = gpu("device_normals_equal_those_of_the_cpu") else {
        return;
    };
    let shown = Shown::new(LIVER, 4);
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let [here, there] = normals_of_both(&mut renderer, &shown);
    let skin = shown.render_scene.skin();
    let mut used = vec![false; here.len()];
    skin.triangles()
        .iter()
        .flatten()
        .for_each(|v| used[*v as usize] = true);
    for ((here, there), used) in here.iter().zip(&there).zip(used) {
        let [here, there] = [here, there].map(|sum| Vec3::from_array(sum.map(|part| part as f32)));
        assert_eq!(here != Vec3::ZERO, used);
        // WGSL grants an arc tangent 4096 units in the last place, which is 5e-4, and each of some six triangles may err
        // the same way; a unit is a millionth of the sum.
        assert!(
            (here - there).length() <= 1e-3 * here.length(),
            "{here} {there}"
        );
    }
}

/// A body of 1 m so far from the other one that single precision sees its particles at one place.
#[test]
fn triangles_without_an_area_have_no_normal() {
    let Some(gpu) = gpu("triangles_without_an_area_have_no_normal") else {
        return;
    };
    let shown = Shown::new(
        r#"
        [[body]]
        shape = { kind = "box", tets = 200 }
        [[body]]
        shape = { kind = "box", tets = 200 }
        position = [9.0e8, 9.0e8, 9.0e8]
        "#,
        0,
    );
    let mut renderer = GpuRenderer::new(gpu).unwrap();
    let [here, there] = normals_of_both(&mut renderer, &shown);
    let skin = shown.render_scene.skin();
    let rest = &shown.simulation.mesh().positions;
    let mut flat = 0;
    for (v, vertex) in skin.vertices().iter().enumerate() {
        if rest[vertex.particle.index()].x > 1e8 {
            assert_eq!([here[v], there[v]], [[0; 3]; 2]);
            flat += 1;
        }
    }
    assert!(0 < flat && flat < skin.vertices().len());
}

#[test]
fn sizes_that_are_no_pictures_are_refused() {
    let Some(gpu) = gpu("sizes_that_are_no_pictures_are_refused") else {
        return;
    };
    let shown = Shown::new(LIVER, 0);
    let largest = gpu.device().limits().max_texture_dimension_2d;
    let mut renderer = GpuRenderer::new(Arc::clone(&gpu)).unwrap();
    let camera = shown.camera();
    let mut draw = |size| {
        let picture = renderer.picture(
            &shown.render_scene,
            &shown.simulation,
            &camera,
            &Style::default(),
            size,
        );
        picture.map(|picture| picture.rgba.len())
    };
    for size in [[0, 1], [1, 0], [largest + 1, 1], [1, u32::MAX]] {
        let error = draw(size).unwrap_err();
        assert!(matches!(error, RenderError::Size { .. }), "{error}");
    }
    for size in [[1, 1], [33, 17], [16, 40]] {
        assert_eq!(draw(size).unwrap(), 4 * size[0] as usize * size[1] as usize);
    }
    assert!(gpu.check().is_ok(), "nothing was refused by the driver");
}

/// Normals depend on the positions and not on the view.
#[test]
fn the_last_state_is_drawn_again_while_the_simulation_goes_on() {
    let Some(gpu) = gpu("the_last_state_is_drawn_again_while_the_simulation_goes_on") else {
        return;
    };
    let scene = Scene::from_toml(LIVER).unwrap();
    let on_device = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    for mut simulation in [on_device, Simulation::new(&scene).unwrap()] {
        let mut render_scene = RenderScene::new(&simulation, &scene);
        let mut renderer = GpuRenderer::new(Arc::clone(&gpu)).unwrap();
        let mut camera = Camera::fit(Vec3::splat(-0.22).into(), Vec3::splat(0.2).into());
        let style = Style::default();
        simulation.step().unwrap();
        render_scene.sync(&simulation);
        renderer
            .draw(&render_scene, &simulation, &camera, &style, SIZE)
            .unwrap();
        let before = renderer.read_normal_sums().unwrap();
        for _ in 0..5 {
            simulation.step().unwrap();
            camera.orbit(0.1, 0.0);
            let sent = renderer.uploaded_bytes();
            renderer
                .redraw(&render_scene, &camera, &style, SIZE)
                .unwrap();
            let sent = renderer.uploaded_bytes() - sent;
            assert!(sent < 16 * simulation.positions().len() as u64, "{sent}");
            assert_eq!(renderer.read_normal_sums().unwrap(), before);
        }
        render_scene.reset(&simulation);
        simulation.read_back().unwrap();
        renderer
            .draw(&render_scene, &simulation, &camera, &style, SIZE)
            .unwrap();
        assert_ne!(renderer.read_normal_sums().unwrap(), before);
    }
}
