//! Comparing image files: the numbers, the limit, the mask, and what cannot be compared.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use stereolux_base::limits::LoadLimits;
use stereolux_images::images::{Image, ImageRgb, write_exr, write_png};
use stereolux_images::metrics::{FlipView, compare_and_keep};

#[path = "../../base/tests/shared/folders.rs"]
#[allow(dead_code)]
mod folders;
use folders::Folder;

#[test]
fn files_are_compared_and_faults_named() {
    let folder = Folder::new("metrics");
    let path = |name: &str| folder.join(name);
    let plane = |value: f32| Image::filled(24, 16, [value; 3]).unwrap();
    let save = |name: &str, image: &ImageRgb| write_exr(&path(name), image).unwrap();
    save("two.exr", &plane(2.0));
    save("three.exr", &plane(3.0));
    save("other-size.exr", &Image::filled(16, 24, [2.0; 3]).unwrap());
    // White on the left half.
    let mask = (0..24 * 16)
        .map(|i| if i % 24 < 12 { [255; 3] } else { [0; 3] })
        .collect();
    write_png(&path("mask.png"), &Image::new(24, 16, mask).unwrap()).unwrap();
    let compared = |image: &str, reference: &str, mask: Option<&str>| {
        let mask = mask.map(path);
        let (view, limits) = (FlipView::default(), LoadLimits::default());
        let [image, reference] = [image, reference].map(path);
        compare_and_keep(&image, &reference, mask.as_deref(), view, limits, 0)
            .map(|compared| compared.comparison)
    };

    let same = compared("two.exr", "two.exr", None).unwrap();
    assert_eq!((same.rel_mse, same.rmse, same.flip), (Some(0.0), 0.0, 0.0));

    // r = 2, x = 3, s = 4: 1 / (4 + 0.04).
    let wrong = compared("three.exr", "two.exr", Some("mask.png")).unwrap();
    assert!((wrong.rel_mse.unwrap() - 1.0 / 4.04).abs() < 1e-12);
    assert_eq!(wrong.pixels, 12 * 16);
    assert!(wrong.exceeds(0.24) && !wrong.exceeds(0.25));

    let json = serde_json::to_value(&wrong).unwrap();
    for key in [
        "rel_mse",
        "rel_mse_se",
        "rmse",
        "rmse_se",
        "mean_rel_bias",
        "mean_rel_bias_se",
        "flip",
        "flip_se",
        "width",
        "height",
        "pixels",
        "non_finite",
    ] {
        assert!(json[key].is_number(), "{key} in {json}");
    }

    for (image, says) in [
        ("other-size.exr", "[16, 24]"),
        ("missing.exr", "missing.exr"),
        ("mask.png/x", "mask.png"),
    ] {
        let message = compared(image, "two.exr", None).unwrap_err().to_string();
        assert!(
            message.contains(says) && !message.contains('\n'),
            "{message}"
        );
    }
}
