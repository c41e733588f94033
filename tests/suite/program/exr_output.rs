//! EXR files of a run: attributes, layers, views and samples, read by the `exr` crate's own reader.

use std::path::Path;

use exr::meta::attribute::AttributeValue;
use exr::prelude::{
    Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes,
    SpecificChannels, Text, WritableImage, read_all_flat_layers_from_file,
};
use glam::{DMat4, DQuat, DVec3, DVec4};

use crate::suite::support::{
    Folder, assert_says, assert_success, json, run_into, stats, stderr, stereolux, words,
};

const POSE: &str = "-0.2 0.3 0.9 0 0.1736482 0 0.9848078";
const SIZE: [usize; 2] = [24, 18];

fn render(folder: &Folder, name: &str, more: &[&str]) -> std::path::PathBuf {
    let out = folder.join(name);
    let eyes = ["--fov", "-50 40 30 -35", "--ipd", "0.1", "--pose", POSE];
    let args = [&eyes, more].concat();
    assert_success(&run_into(&out, "render --size 24x18 --photons 500", &args));
    out
}

/// Channels by name, as f64, and how many bits their samples have.
fn channels(path: &Path) -> Vec<(String, Vec<f64>, u32)> {
    let image = read_all_flat_layers_from_file(path).unwrap();
    let [layer] = &image.layer_data[..] else {
        panic!("{} parts", image.layer_data.len())
    };
    let list = layer.channel_data.list.iter();
    list.map(|channel| {
        let (samples, bits): (Vec<f64>, u32) = match &channel.sample_data {
            FlatSamples::F16(v) => (v.iter().map(|v| f64::from(v.to_f32())).collect(), 16),
            FlatSamples::F32(v) => (v.iter().map(|v| f64::from(*v)).collect(), 32),
            FlatSamples::U32(v) => (v.iter().map(|v| f64::from(*v)).collect(), 0),
        };
        assert_eq!(samples.len(), SIZE[0] * SIZE[1]);
        (channel.name.to_string(), samples, bits)
    })
    .collect()
}

fn names(channels: &[(String, Vec<f64>, u32)]) -> Vec<&str> {
    channels.iter().map(|(name, ..)| name.as_str()).collect()
}

fn of<'a>(channels: &'a [(String, Vec<f64>, u32)], name: &str) -> &'a [f64] {
    let found = channels.iter().find(|(known, ..)| known == name);
    &found.unwrap_or_else(|| panic!("no {name}")).1
}

#[test]
fn attributes_say_where_the_eye_was_and_what_it_saw() {
    let folder = Folder::new("exr-attributes");
    let out = render(&folder, "out", &[]);
    let run = json(&out.join("run.json"));
    for (eye, side) in [("left", -0.05), ("right", 0.05)] {
        let path = out.join(format!("frame_0000_{eye}.exr"));
        let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
        let [header] = &meta.headers[..] else {
            panic!("one part")
        };
        assert_eq!(header.compression, exr::compression::Compression::ZIP16);
        let own = &header.own_attributes;
        assert_eq!(own.view_name.as_ref().unwrap().to_string(), eye);
        let software = own.software_name.as_ref().unwrap().to_string();
        assert_eq!(software, concat!("stereolux ", env!("CARGO_PKG_VERSION")));
        let text = |name: &str| match own.other.iter().find(|(known, _)| **known == *name) {
            Some((_, AttributeValue::Text(text))) => text.to_string(),
            other => panic!("{name}: {other:?}"),
        };
        assert_eq!(run["adapter"]["name"], text("stereolux.adapter"));
        assert_eq!(run["settings_hash"], text("stereolux.settings"));
        assert_eq!(text("stereolux.displayTimeNs"), "0");
        let degrees = "-50.000000 40.000000 30.000000 -35.000000";
        assert_eq!(text("fovDegrees"), degrees);
        // The screen window is the field of view at distance 1; f32 of tangents near 1: 1e-6.
        let tan = |degrees: f64| degrees.to_radians().tan();
        let near = |found: f32, wanted: f64| {
            assert!((f64::from(found) - wanted).abs() < 1e-6, "{found} {wanted}")
        };
        let width = tan(40.0) + tan(50.0);
        near(own.screen_window_width, width);
        near(own.screen_window_center.0, (tan(40.0) - tan(50.0)) / 2.0);
        near(own.screen_window_center.1, (tan(30.0) - tan(35.0)) / 2.0);
        let aspect = (width / 24.0) / ((tan(30.0) + tan(35.0)) / 18.0);
        near(header.shared_attributes.pixel_aspect, aspect);
        // Row vectors: a point a metre before the eye, a little up and right, in a left-handed camera.
        let matrix = own.world_to_camera.unwrap();
        let camera_from_world = DMat4::from_cols_array(&matrix.map(f64::from));
        let head = DQuat::from_xyzw(0.0, 0.173_648_2, 0.0, 0.984_807_8).normalize();
        let eye_in_world = DVec3::new(-0.2, 0.3, 0.9) + head * DVec3::new(side, 0.0, 0.0);
        let point = eye_in_world + head * DVec3::new(0.2, 0.1, -1.0);
        let seen = camera_from_world * DVec4::from((point, 1.0));
        let off = seen.truncate() - DVec3::new(0.2, 0.1, 1.0);
        assert!(off.length() < 1e-6, "{seen}");
    }
}

#[test]
fn every_frame_says_when_it_was_shown() {
    let folder = Folder::new("exr-times");
    let out = folder.join("out");
    assert_success(&run_into(
        &out,
        "run --session simulated --frames 3 --size 8x8 --photons 300",
        &[],
    ));
    for (index, line) in stats(&out).iter().enumerate() {
        let path = out.join(format!("frame_000{index}_right.exr"));
        let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
        let attributes = &meta.headers[0].own_attributes.other;
        let is_time = |(name, _): &(&_, &_)| **name == *"stereolux.displayTimeNs";
        let Some((_, AttributeValue::Text(time))) = attributes.iter().find(is_time) else {
            panic!("{attributes:?}")
        };
        // 90 Hz, in whole nanoseconds.
        assert_eq!(time.to_string(), (index * 1_000_000_000 / 90).to_string());
        assert_eq!(line["display_time_ns"].to_string(), time.to_string());
    }
}

#[test]
fn half_floats_and_one_file_for_both_eyes_hold_the_same_pixels() {
    let folder = Folder::new("exr-samples");
    let parts = "--set=output.parts=true";
    let aovs = [
        parts,
        "--set=output.aovs=depth,normal,albedo,motion,instance",
    ];
    let plain = render(&folder, "plain", &[parts]);
    let files = render(&folder, "files", &aovs);
    let with = |name: &str, more: &str| render(&folder, name, &[&aovs[..], &[more]].concat());
    let both = with("both", "--set=output.layout=multiview");
    let half = with("half", "--set=output.exr=f16");
    let layers =
        words("B G N.X N.Y N.Z R Z albedo.B albedo.G albedo.R instance.id motion.X motion.Y");
    let multiview = channels(&both.join("frame_0000.exr"));
    assert!(!both.join("frame_0000_left.exr").exists());
    for eye in ["left", "right"] {
        let name = format!("frame_0000_{eye}.exr");
        let own = channels(&files.join(&name));
        assert_eq!(names(&own), layers);
        // Further layers change no pixel, and views are as their files.
        let radiance = channels(&plain.join(&name));
        assert_eq!(names(&radiance), ["B", "G", "R"]);
        let view = if eye == "left" { "" } else { "right." };
        for channel in ["R", "G", "B"] {
            assert!(of(&radiance, channel) == of(&own, channel));
            assert!(of(&multiview, &format!("{view}{channel}")) == of(&own, channel));
            let part = channels(&plain.join(format!("frame_0000_{eye}_direct.exr")));
            assert!(of(&multiview, &format!("direct.{view}{channel}")) == of(&part, channel));
        }
        for layer in ["Z", "N.X", "albedo.G", "instance.id"] {
            let (of_layer, channel) = layer.rsplit_once('.').unwrap_or(("", layer));
            let dot = if of_layer.is_empty() { "" } else { "." };
            // `albedo` is a part's name too; the layer that was asked for wins.
            let of_both = of(&multiview, &format!("{of_layer}{dot}{view}{channel}"));
            assert!(of_both == of(&own, layer), "{layer}");
        }
        let halves = channels(&half.join(&name));
        for (name, samples, bits) in &halves {
            let expected = match name.as_str() {
                "instance.id" => 0,
                "Z" | "motion.X" | "motion.Y" => 32,
                _ => 16,
            };
            assert_eq!(*bits, expected, "{name}");
            // Half of a unit in the last of 11 bits; 2^-25 where halves are denormal.
            for (half, full) in samples.iter().zip(of(&own, name)) {
                let allowed = full.abs() / 2048.0 + 3e-8;
                assert!((half - full).abs() <= allowed, "{name}: {half} and {full}");
            }
        }
        // What pixels see of the box: a unit normal, a depth, an instance, a grey or coloured wall.
        let mut seen: Vec<usize> = (0..SIZE[0] * SIZE[1]).collect();
        seen.retain(|pixel| of(&own, "Z")[*pixel] > 0.0);
        assert!(seen.len() > 50, "{} pixels see the box", seen.len());
        for pixel in seen {
            let at = |name: &str| of(&own, name)[pixel];
            let length = at("N.X").hypot(at("N.Y")).hypot(at("N.Z"));
            assert!((length - 1.0).abs() < 1e-3, "{length}");
            assert!((0.2..3.0).contains(&at("Z")) && at("instance.id") < 100.0);
            assert!(at("albedo.G") > 0.0 && at("albedo.G") < 1.0);
        }
    }
    let meta = exr::meta::MetaData::read_from_file(both.join("frame_0000.exr"), true).unwrap();
    let views = meta.headers[0].own_attributes.multi_view_names.as_ref();
    let views = views.unwrap().iter().map(ToString::to_string);
    assert!(views.eq(["left", "right"]));

    // Neither such a file is compared by one of its views, nor one that has them in parts of their own.
    let parts = folder.join("parts.exr");
    let part = |view: &str| {
        let attributes = LayerAttributes {
            view_name: Some(Text::from(view)),
            ..LayerAttributes::named(view)
        };
        let pixels = SpecificChannels::rgb(|_| (0.5f32, 0.5f32, 0.5f32));
        Layer::new((4, 4), attributes, Encoding::UNCOMPRESSED, pixels)
    };
    let bounds = IntegerBounds::from_dimensions((4, 4));
    Image::empty(ImageAttributes::new(bounds))
        .with_layer(part("left"))
        .with_layer(part("right"))
        .write()
        .to_file(&parts)
        .unwrap();
    for path in [both.join("frame_0000.exr"), parts] {
        let path = path.to_str().unwrap();
        let output = stereolux(&["compare", path, path]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert_says(&stderr(&output), &["several views"]);
    }
}
