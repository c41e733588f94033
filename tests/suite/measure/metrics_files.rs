//! `compare`'s page: its pictures and values, and what has none.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use stereolux::images::{Image, tone_map, write_exr};

use super::support::{Folder, assert_says, assert_success, printed, stderr, stereolux};

/// The picture that a page has under `element`, as RGB bytes.
fn inline_picture(page: &str, element: &str) -> image::RgbImage {
    let from = page.find(element).unwrap();
    let marker = "src=\"data:image/png;base64,";
    let from = from + page[from..].find(marker).unwrap() + marker.len();
    let coded = page[from..].split('"').next().unwrap();
    let png = BASE64_STANDARD.decode(coded).unwrap();
    image::load_from_memory(&png).unwrap().into_rgb8()
}

#[test]
fn a_page_holds_both_pictures_and_their_values() {
    let folder = Folder::new("compare-page");
    let path = |name: &str| folder.join(name).display().to_string();
    let (width, height) = (19, 12);
    let picture = |shift: f32| {
        let value = |i: u32| [0.01 * i as f32, shift, 3.0 - 0.01 * i as f32];
        Image::new(width, height, (0..width * height).map(value).collect()).unwrap()
    };
    let images = [("image", picture(0.25)), ("reference", picture(0.5))];
    for (name, image) in &images {
        write_exr(&folder.join(&format!("{name}.exr")), image).unwrap();
    }
    let plain = ["compare", &path("image.exr"), &path("reference.exr")];
    let alone = stereolux(&plain);
    assert_success(&alone);
    let report = path("new/page");
    let output = stereolux(&[&plain[..], &["--report", &report, "--exposure", "2"]].concat());
    assert_success(&output);
    // FLIP depends on the exposure, all else stays.
    let [alone, output] = [alone, output].map(|output| printed(&output));
    assert_eq!(alone["rel_mse"], output["rel_mse"]);
    let keys = |json: &serde_json::Value| json.as_object().unwrap().keys().cloned().collect();
    let [alone, output]: [Vec<String>; 2] = [&alone, &output].map(keys);
    assert_eq!(alone, output);

    let found = std::fs::read_dir(&report).unwrap();
    let names: Vec<_> = found.map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["report.html"]);
    let page = std::fs::read_to_string(folder.join("new/page/report.html")).unwrap();
    for address in ["http:", "https:", "src=\"/", "@import", "url("] {
        // The name of a drawing's language is no address to be fetched.
        let asked = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!asked.contains(address), "{address}");
    }
    for (name, image) in &images {
        let shown = inline_picture(&page, &format!("id=\"{name}_shown\""));
        assert_eq!(shown.as_raw(), tone_map(image, 2.0).pixels.as_flattened());
        let values = inline_picture(&page, &format!("id=\"{name}_values\""));
        assert_eq!(values.dimensions(), (width, 3 * height));
        for (index, pixel) in (0..).zip(&image.pixels) {
            for (channel, value) in (0..).zip(pixel) {
                let (x, y) = (index % width, index / width + channel * height);
                let [a, b, c] = values.get_pixel(x, y).0;
                let kept = f32::from_be_bytes([a, b, c, 0]);
                // 15 of the mantissa's 23 bits, rounded: half a unit of the last.
                assert!((kept - value).abs() <= value.abs() * 2.0_f32.powi(-16));
            }
        }
    }
    // Green is darker by 0.25 everywhere, and nothing else differs: the end of the map, and its middle.
    let white = [255; 3];
    for (name, color) in [("red", white), ("green", [0, 114, 178]), ("blue", white)] {
        let map = inline_picture(&page, &format!("alt=\"difference of {name}\""));
        assert!(map.pixels().all(|pixel| pixel.0 == color), "{name}");
    }
    for name in ["FLIP difference", "squared relative error"] {
        let map = inline_picture(&page, &format!("alt=\"{name}\""));
        assert_eq!(map.dimensions(), (width, height));
    }
}

#[test]
fn a_page_that_cannot_be_made_is_one_line_and_no_file() {
    let folder = Folder::new("compare-no-page");
    let path = |name: &str| folder.join(name).display().to_string();
    for (name, width) in [("a.exr", 16), ("wider.exr", 17)] {
        let plane = Image::filled(width, 16, [1.0; 3]).unwrap();
        write_exr(&folder.join(name), &plane).unwrap();
    }
    std::fs::create_dir(folder.join("suite")).unwrap();
    std::fs::write(folder.join("suite/report.html"), "a suite's").unwrap();
    let (report, in_the_way, taken) = (path("report"), path("a.exr"), path("suite"));
    for (reference, report, says) in [
        ("wider.exr", &report, "compare images of equal size"),
        ("a.exr", &in_the_way, "--report"),
        ("a.exr", &taken, "no comparison's"),
    ] {
        let (image, reference) = (path("a.exr"), path(reference));
        let output = stereolux(&["compare", &image, &reference, "--report", report]);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert_says(&message, &[says]);
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(folder.files(), ["a.exr", "suite/report.html", "wider.exr"]);
    let kept = std::fs::read_to_string(folder.join("suite/report.html")).unwrap();
    assert_eq!(kept, "a suite's");
}
