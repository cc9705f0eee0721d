//! Ten bodies of 5,000 to 4,000,000 tets are sound: a sweep over shapes and sizes.

use incise_meshing::Shape;

use crate::shapes::assert_sound;

/// All but the box, which the plate stands for: organic, thin-limbed, of genus 1, with a void, flat, convex, long, of
/// two pieces.
fn bodies() -> impl Iterator<Item = Shape> {
    let all = Shape::ALL.into_iter();
    all.filter(|&shape| shape != Shape::Box)
}

#[test]
fn ten_bodies_of_5_000_tets() {
    for shape in bodies() {
        assert_sound(shape, 5_000);
    }
}

#[test]
fn bodies_of_50_000_tets() {
    for shape in [Shape::Bunny, Shape::Gear, Shape::Shell, Shape::Pair] {
        assert_sound(shape, 50_000);
    }
}

#[test]
#[ignore = "ten seconds in release: cargo test --release -p incise-meshing -- --ignored ten_bodies_of_50"]
fn ten_bodies_of_50_000_and_of_500_000_tets() {
    for tets in [50_000, 500_000] {
        for shape in bodies() {
            assert_sound(shape, tets);
        }
    }
}

#[test]
#[ignore = "fifteen seconds in release: cargo test --release -p incise-meshing -- --ignored a_million"]
fn ten_bodies_of_a_million_tets() {
    for shape in bodies() {
        assert_sound(shape, 1_000_000);
    }
}

#[test]
#[ignore = "ten seconds in release: cargo test --release -p incise-meshing -- --ignored four_million"]
fn an_armadillo_of_four_million_tets() {
    assert_sound(Shape::Armadillo, 4_000_000);
}
