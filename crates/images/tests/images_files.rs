//! Image files: what is written reads back, bytes repeat, faults are named, nothing half-written stays.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::Path;

use stereolux_images::images::{
    Image, ImageRgb, read_image, srgb_decode, tone_map, write_atomically, write_exr, write_png,
};

#[path = "../../base/tests/shared/folders.rs"]
#[allow(dead_code)]
mod folders;
use folders::Folder;

/// 7 x 5 pixels, no two values alike, over the whole range of radiance.
fn sample() -> ImageRgb {
    let pixels = (0..35)
        .map(|i| [i as f32 * 0.037, 1e6 / (1.0 + i as f32), 1e-4 * i as f32])
        .collect();
    Image::new(7, 5, pixels).unwrap()
}

/// Radiance files have two signatures.
#[test]
fn radiance_files_are_read_by_either_name() {
    let scratch = Folder::new("images-hdr");
    for name in ["RADIANCE", "RGBE"] {
        let head = format!("#?{name}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n");
        let path = scratch.write("a.hdr", [head.as_bytes(), &[128, 64, 32, 129]].concat());
        // Mantissa / 256 * 2^(exponent - 128).
        assert_eq!(read_image(&path).unwrap().pixels, [[1.0, 0.5, 0.25]]);
    }
}

#[test]
fn exr_reads_back_bit_for_bit_and_repeats_byte_for_byte() {
    let scratch = Folder::new("images-exr");
    let mut image = sample();
    image.pixels[3] = [f32::NEG_INFINITY, -0.0, f32::MIN_POSITIVE / 2.0];
    let (a, b) = (scratch.join("a.exr"), scratch.join("b.exr"));
    write_exr(&a, &image).unwrap();
    write_exr(&b, &image).unwrap();
    assert_eq!(fs::read(&a).unwrap(), fs::read(&b).unwrap());
    let read = read_image(&a).unwrap();
    assert_eq!((read.width, read.height), (7, 5));
    let bits = |image: &ImageRgb| {
        image
            .pixels
            .iter()
            .map(|pixel| pixel.map(f32::to_bits))
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(&read), bits(&image));
    assert_eq!(scratch.files(), ["a.exr", "b.exr"]);
    // Negative control: another image has other bytes.
    image.pixels[0][0] += 1.0;
    write_exr(&b, &image).unwrap();
    assert_ne!(fs::read(&a).unwrap(), fs::read(&b).unwrap());
}

#[test]
fn png_is_decoded_from_srgb() {
    let scratch = Folder::new("images-png");
    let path = scratch.join("a.png");
    let picture = Image::new(2, 1, vec![[0, 128, 255], [1, 2, 3]]).unwrap();
    write_png(&path, &picture).unwrap();
    let read = read_image(&path).unwrap();
    let middle = srgb_decode(f64::from(128.0_f32 / 255.0)) as f32;
    assert_eq!(read.pixels[0], [0.0, middle, 1.0]);
    write_png(&path, &tone_map(&sample(), 1.0)).unwrap();
    assert_eq!(read_image(&path).unwrap().width, 7);
}

#[test]
fn unreadable_files_are_named_in_one_line() {
    let scratch = Folder::new("images-bad");
    let whole = scratch.join("whole.exr");
    write_exr(&whole, &sample()).unwrap();
    let bytes = fs::read(&whole).unwrap();
    let png = scratch.join("whole.png");
    write_png(&png, &tone_map(&sample(), 1.0)).unwrap();
    let png_bytes = fs::read(&png).unwrap();
    let refused = |path: &Path| {
        let message = read_image(path)
            .expect_err(&path.display().to_string())
            .to_string();
        assert!(
            !message.contains('\n') && message.contains(path.to_str().unwrap()),
            "{message}"
        );
        message
    };
    assert!(refused(scratch.path()).contains("directory"));
    assert!(refused(&scratch.join("missing.exr")).contains("cannot be read"));
    for (name, text) in [("empty.exr", ""), ("text.exr", "hello, this is text")] {
        assert!(refused(&scratch.write(name, text)).contains("not an EXR"));
    }
    // Cut at every length, header and pixels alike: an error each time, never a panic.
    for length in (4..bytes.len()).step_by(7) {
        refused(&scratch.write("cut.exr", &bytes[..length]));
    }
    refused(&scratch.write("cut.png", &png_bytes[..png_bytes.len() / 2]));
    // The content decides, not the name.
    let really = scratch.write("really.png", &bytes);
    assert_eq!(read_image(&really).unwrap(), sample());
}

#[test]
fn failed_writes_leave_nothing_behind() {
    let scratch = Folder::new("images-atomic");
    let path = scratch.join("file.json");
    write_atomically(&path, |out| std::io::Write::write_all(out, b"old")).unwrap();
    let failed = write_atomically(&path, |out| {
        std::io::Write::write_all(out, b"half")?;
        Err(std::io::Error::other("disk full"))
    });
    assert!(failed.unwrap_err().to_string().contains("disk full"));
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(scratch.files(), ["file.json"]);
    assert!(
        write_exr(scratch.path(), &sample())
            .unwrap_err()
            .to_string()
            .contains("directory")
    );
    assert!(write_exr(&scratch.join("no/such/dir.exr"), &sample()).is_err());
    assert!(write_exr(Path::new("/"), &sample()).is_err());
    assert_eq!(scratch.files(), ["file.json"]);
}
