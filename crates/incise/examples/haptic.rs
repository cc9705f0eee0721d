//! The loop of a haptic device: a hand pulls tissue by springs, a probe presses it, and both feel forces.
//!
//! `cargo run -p incise --example haptic`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use incise::mesh::glam::DVec3;
use incise::meshing::{Shape, generate};
use incise::scene::{ColliderSpec, Quantity, ReportSpec};
use incise::{Body, Simulation};

/// The force in N that a device can exert on a hand.
const STRONGEST: f64 = 3.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut builder = Simulation::builder();
    // Asks for forces; without it they cost nothing.
    builder.report(ReportSpec::default().with(|spec| spec.quantities = vec![Quantity::Force]));
    // A block of 10 cm, as soft as a liver, glued to a table.
    let block = Body::new(generate(Shape::Box, 1500)?).scale(0.1);
    let block = builder.add_body(
        block
            .young_modulus(5e3)
            .damping(0.02)
            .pinned(|x| x.z < -0.049),
    );
    let mut simulation = builder.build()?;
    let probe = |z: f64| DVec3::new(0.02, 0.0, z);
    let ball = simulation
        .add_collider(&ColliderSpec::sphere(probe(0.077).to_array(), 0.025).with_friction(0.2))?;

    let top = DVec3::new(-0.03, 0.0, 0.05);
    let grab = simulation
        .grab(top, 0.015, 0.02)?
        .ok_or("nothing to grab")?;
    for frame in 1..=40 {
        // Input: the position of the device. Here the hand lifts by a millimeter a frame, and the probe goes down.
        let way = 1e-3 * f64::from(frame.min(20));
        simulation.move_grab(grab, top + DVec3::Z * way)?;
        simulation.move_collider(ball, probe(0.077 - way))?;

        simulation.step()?;

        // Output: the mean force of the frame on the hand, in the range of the device.
        let hand = simulation.grab_force(grab)?;
        let command = hand.force.clamp_length_max(STRONGEST);
        let pressed = simulation.collider_force(ball)?;
        let table = simulation.fixed_force(block)?;
        println!(
            "frame {frame:2}: hand {:6.3} N down, torque {:5.1} N mm; probe {:6.3} N up; table {:6.3} N",
            -command.z,
            hand.torque.length() * 1e3,
            pressed.force.z,
            table.force.z,
        );
    }
    Ok(())
}
