//! Cuts a beam into slices, moves every second one sideways frame by frame, and prints what touches.
//!
//! `cargo run -p incise-contact --example slices`

#![expect(clippy::print_stdout, reason = "prints what it found")]

use glam::DVec3;
use incise_contact::{ContactDetector, ContactSettings, ContactState};
use incise_cutting::{CutOptions, CuttableMesh, PieceTracker, Plane, cut_plane};
use incise_mesh::kuhn_box;

/// How fast the slices move in m/s.
const SPEED: f64 = 0.5;
const FRAME: f64 = 1.0 / 60.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut body = CuttableMesh::new(kuhn_box([16, 4, 4], DVec3::new(4.0, 1.0, 1.0)))?;
    let mut pieces = PieceTracker::new(&body);
    let body_of = vec![0; body.mesh().positions.len()];
    let mut contacts = ContactDetector::new(&body, body_of, ContactSettings::default())?;
    let mut positions = body.mesh().positions.clone();
    for (stroke, x) in (0..).zip([0.8, 1.6, 2.4, 3.2]) {
        let plane = Plane {
            point: DVec3::new(x + 0.05, 0.0, 0.0),
            normal: DVec3::X,
        };
        let options = CutOptions {
            tag: stroke,
            ..CutOptions::default()
        };
        let delta = cut_plane(&mut body, &positions, &plane, &options)?;
        delta.extend_particles(&mut positions);
        pieces.apply_delta(&body, &delta);
        contacts.apply_delta(&body, &delta);
    }

    // In a simulation a solver moves the particles.
    let mut velocities = vec![DVec3::ZERO; positions.len()];
    for (tet, corners) in (0..).zip(&body.mesh().tets) {
        let odd = pieces.piece_of(incise_mesh::TetId(tet)) % 2 == 1;
        for particle in corners {
            velocities[particle.index()] = DVec3::Y * if odd { SPEED } else { 0.0 };
        }
    }
    println!(
        "{} pieces, mean edge {:.3} m",
        pieces.count(),
        contacts.mean_edge()
    );
    for frame in 0..24 {
        let update = contacts.update(&ContactState {
            mesh: &body,
            pieces: &pieces,
            positions: &positions,
            velocities: &velocities,
            fixed: &[],
            frame_time: FRAME,
        });
        println!(
            "frame {frame:2}: {:3} pairs, {:4} candidates{}",
            contacts.pairs().len(),
            contacts.faces().len(),
            if update.searched { ", searched" } else { "" },
        );
        for (position, velocity) in positions.iter_mut().zip(&velocities) {
            *position += *velocity * FRAME;
        }
    }
    Ok(())
}
