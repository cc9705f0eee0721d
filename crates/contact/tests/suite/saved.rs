//! A detector that is written and read again continues bit for bit.

use glam::DVec3;
use incise_contact::{ContactDetector, ContactSettings};

use crate::scene::{Scene, jittered_box};

#[test]
fn continues_bit_for_bit() {
    let mut above = jittered_box(4, 0.2, 2);
    for x in &mut above.positions {
        *x += DVec3::new(0.1, 0.05, 0.98);
    }
    let bodies = [jittered_box(4, 0.2, 1), above];
    let mut scene = Scene::new(&bodies, ContactSettings::default());
    scene.cut(0, DVec3::splat(0.5), DVec3::X);
    scene.update();
    let written = serde_json::to_string(&scene.contacts).unwrap();
    let mut read: ContactDetector = serde_json::from_str(&written).unwrap();
    read.check(&scene.body).unwrap();
    for frame in 0..6 {
        if frame == 3 {
            let delta = scene.cut(1, DVec3::splat(0.4), DVec3::Y);
            read.apply_delta(&scene.body, &delta);
        }
        let high = scene.positions.iter_mut().filter(|x| x.z > 0.99);
        high.for_each(|x| *x += DVec3::new(0.03, 0.01, -0.01));
        let update = scene.update();
        let same = read.update(&scene.state());
        assert_eq!(update, same);
        assert_eq!(read.faces(), scene.contacts.faces());
        assert_eq!(read.pairs(), scene.contacts.pairs());
        assert!(!read.faces().is_empty() && !read.pairs().is_empty());
    }
}
