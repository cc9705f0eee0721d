//! The loop of a game: a mesh in memory, a blade and a ball that move live, and the changes that a renderer uploads.
//!
//! `cargo run -p incise --example game_loop`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use incise::cutting::Skin;
use incise::mesh::glam::{DVec2, DVec3};
use incise::mesh::{ParticleId, TetMesh};
use incise::scene::ColliderSpec;
use incise::{Body, Event, Simulation};

/// A bar of `n` cubes of 0.1 m along x, six tets around a diagonal of each.
fn bar(n: u32) -> TetMesh {
    let corner = |i: u32| DVec3::new(f64::from(i >> 2), f64::from(i >> 1 & 1), f64::from(i & 1));
    let cube = |x: u32| {
        [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]]
            .map(|[a, b]| [0, b, a, 7].map(|c| ParticleId(4 * x + c)))
    };
    TetMesh {
        positions: (0..4 * n + 4).map(|i| corner(i) * 0.1).collect(),
        tets: (0..n).flat_map(cube).collect(),
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut builder = Simulation::builder();
    builder
        .gravity(DVec3::new(0.0, 0.0, -9.81))
        .ground(-0.3, 0.5);
    builder.add_body(Body::new(bar(12)).young_modulus(5e5).pinned(|x| x.x == 0.0));
    let mut simulation = builder.build()?;
    let ball =
        simulation.add_collider(&ColliderSpec::sphere([0.9, 0.05, 0.4], 0.1).with_friction(0.3))?;

    // What a renderer keeps: an index buffer updated by cuts, and vertices updated from the particles.
    let mut skin = Skin::new(simulation.boundary());
    // Texture coordinates of the particles; those of new particles are interpolated.
    let rest = &simulation.mesh().positions;
    let mut uv: Vec<DVec2> = rest.iter().map(|x| x.truncate()).collect();
    let blade = |y: f64| [DVec3::new(0.43, y, -1.0), DVec3::new(0.43, y, 1.0)];
    let stroke = simulation.begin_stroke(&blade(-0.1), 0.1)?;
    for frame in 1..=20 {
        let t = f64::from(frame) / 20.0;
        // Input: blade and ball move.
        simulation.move_blade(stroke, &blade(-0.1 + 0.4 * t))?;
        simulation.move_collider(ball, DVec3::new(0.9, 0.05, 0.4 - 0.25 * t))?;
        if frame == 20 {
            simulation.end_stroke(stroke)?; // after this frame
        }

        let ms = simulation.step()?.ms.total;

        // Output: triangles and vertices that changed, then positions and normals of all vertices.
        let (mut triangles, mut vertices) = (0, 0);
        for delta in simulation.deltas() {
            let changed = skin.apply_delta(delta);
            triangles += changed.triangles.len(); // upload skin.triangles()[i] for each
            vertices += changed.vertices.len();
            delta.extend_with(&mut uv, |a, b, t| a.lerp(*b, t));
        }
        let positions = simulation.positions();
        let at = |p: ParticleId| positions[p.index()].as_vec3();
        let buffer: Vec<_> = skin.vertices().iter().map(|v| at(v.particle)).collect();
        let normals = skin.normals(positions);
        let mapped: Vec<_> = skin
            .vertices()
            .iter()
            .map(|v| uv[v.particle.index()].as_vec2())
            .collect();
        // Two draw calls: the skin with its texture, and the cut faces.
        let (outer, cut) = (skin.outer_triangles(), skin.cut_triangles());
        println!(
            "frame {frame:2}: {ms:4.1} ms, {:3} vertices, {} normals, {} texture coordinates, {:3} outer and {:3} cut triangles, \
             changed {triangles} and {vertices}",
            buffer.len(),
            normals.len(),
            mapped.len(),
            outer.len(),
            cut.len(),
        );
        for event in simulation.events() {
            match event {
                Event::CutBegan { stroke } => println!("  stroke {stroke} begins to cut"),
                Event::PieceDetached(piece) => println!("  {:.2} kg come off", piece.mass),
                Event::CutEnded { stroke } => println!("  stroke {stroke} is over"),
                _ => {}
            }
        }
    }
    let hit = simulation.ray_cast(DVec3::new(0.2, 0.05, 1.0), DVec3::NEG_Z);
    println!("a click hits {:?}", hit.map(|hit| hit.particles));
    Ok(())
}
