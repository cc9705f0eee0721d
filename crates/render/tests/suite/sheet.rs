//! Contact sheets: cells, captions.

use incise_render::{Image, contact_sheet};

#[test]
fn cells_are_as_large_as_the_largest_picture() {
    let caption = "frame 12  0.20 s  2 pieces".to_owned();
    let pictures = [[30, 20], [50, 10], [20, 40], [5, 5], [50, 40]]
        .map(|[width, height]| (Image::filled(width, height, [200, 30, 30]), caption.clone()));
    let sheet = contact_sheet(&pictures, 3);
    // 10 pixels between, 20 for a caption.
    assert_eq!((sheet.width, sheet.height), (10 + 3 * 60, 10 + 2 * 70));
    let red = sheet
        .rgba
        .chunks_exact(4)
        .filter(|pixel| pixel[0] == 200 && pixel[1] == 30);
    let pixels = pictures.iter().map(|(picture, _)| picture.rgba.len() / 4);
    assert_eq!(red.count(), pixels.sum::<usize>(), "all of all pictures");
    for (i, (picture, _)) in pictures.iter().enumerate() {
        let (left, top) = (
            10 + 60 * u32::try_from(i % 3).unwrap(),
            10 + 70 * u32::try_from(i / 3).unwrap(),
        );
        assert_eq!(sheet.pixel(left, top), [200, 30, 30]);
        assert_eq!(
            sheet.pixel(left + picture.width - 1, top + picture.height - 1),
            [200, 30, 30]
        );
        let dark = (0..50).flat_map(|x| (0..20).map(move |y| (x, y)));
        let dark = dark
            .filter(|&(x, y)| sheet.pixel(left + x, top + 40 + y)[0] < 120)
            .count();
        assert!(dark > 30, "{dark} dark pixels in caption {i}");
    }
    // A caption stays in its cell.
    let between = (0..sheet.height).all(|y| sheet.pixel(65, y)[0] > 240);
    assert!(between);
}

#[test]
fn captions_differ_and_empty_sheets_are_allowed() {
    let sheet =
        |caption: &str| contact_sheet(&[(Image::filled(60, 10, [9; 3]), caption.to_owned())], 4);
    assert_eq!(sheet("a").width, 80, "as many columns as pictures");
    assert_ne!(sheet("frame 1"), sheet("frame 2"));
    assert_eq!(sheet("ü"), sheet("?"));
    assert_eq!(sheet(""), sheet("   "));
    let none = contact_sheet(&[], 0);
    assert!(none.width > 0 && none.height > 0);
    let empty = contact_sheet(&[(Image::filled(0, 0, [0; 3]), "x".to_owned())], 1);
    assert_eq!(empty.width, 20);
}
