//! The page of `compare --report`: one file that needs no other, its pictures inline.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Value, json};

use crate::false_color::{
    Coloring, Legend, Scale, automatic_range, map_color, relative_error, share_of,
};
use crate::images::{Image, ImageRgb, ImageRgb8, encode_png, tone_map};
use crate::metrics::ComparedFiles;

/// The page: `{style}`, `{data}` and each [`pictures`]' name stand for what is filled in.
const PAGE: &str = include_str!("page.html");
/// By which it is known.
pub const TITLE: &str = "<title>stereolux compare</title>";
/// How the project's pages look.
const STYLE: &str = include_str!("../../../crates/report/src/page.css");
/// Memory that a page takes, bytes per pixel: its 39 bytes of pictures, by 4/3 in base64, that and the page's text before
/// and after a picture is put in, and 32 for the values that a map is made of.
pub const BYTES: u64 = 39 + 3 * 52 + 32;
/// Bars of the histogram: an odd number, so that no error has a bar of its own.
const BARS: usize = 61;
/// Colours of the differences' two ends, those of the plots: the image is darker, and brighter.
const ENDS: [[u8; 3]; 2] = [[0, 114, 178], [213, 94, 0]];
/// Where a difference is not finite.
const NOT_FINITE: [u8; 3] = [120; 3];

/// The page of two images that were compared at `exposure`, which `names` are the files of.
///
/// # Errors
/// One line.
pub fn page(names: [String; 2], compared: &ComparedFiles, exposure: f64) -> Result<String, String> {
    let largest = largest_difference(compared);
    let (pictures, relative) = pictures(compared, exposure, largest)?;
    let bar = |color: &dyn Fn(f64) -> [u8; 3], ends: [f64; 2], scale: &str| {
        let colors: Vec<[u8; 3]> = (0..=16).map(|step| color(f64::from(step) / 16.0)).collect();
        json!({"colors": colors, "ends": ends, "scale": scale})
    };
    let difference = bar(
        &|share| signed_color(2.0 * share - 1.0),
        [-largest, largest],
        "",
    );
    let data = json!({
        "names": names,
        "size": [compared.reference.width, compared.reference.height],
        "exposure": exposure,
        "comparison": compared.comparison,
        "histogram": {"largest": largest, "counts": histogram(compared, largest)},
        "legends": {
            "flip": bar(&map_color, [0.0, 1.0], ""),
            "relative": bar(&map_color, relative, "logarithmic"),
            "red": difference,
            "green": difference,
            "blue": difference,
        },
    });
    // Names of files come from outside; in a script, `<` is the one letter that could end it.
    let data = data.to_string().replace('<', "\\u003c");
    let mut page = PAGE.replacen("{style}", STYLE, 1);
    for (name, picture) in pictures {
        page = page.replacen(&format!("{{{name}}}"), &data_uri(&picture)?, 1);
    }
    // The data last: what is in it is not looked through.
    Ok(page.replacen("{data}", &data, 1))
}

/// A picture as an address that holds it.
fn data_uri(picture: &ImageRgb8) -> Result<String, String> {
    let mut png = Vec::new();
    encode_png(&mut png, picture).map_err(|error| error.to_string())?;
    Ok(format!(
        "data:image/png;base64,{}",
        BASE64_STANDARD.encode(png)
    ))
}

/// All pictures by their names, and the relative errors at the ends of their map.
#[expect(clippy::type_complexity, reason = "used once")]
fn pictures(
    compared: &ComparedFiles,
    exposure: f64,
    largest: f64,
) -> Result<(Vec<(&'static str, ImageRgb8)>, [f64; 2]), String> {
    let (image, reference) = (&compared.image, &compared.reference);
    let coloring = Coloring {
        scale: Scale::Log,
        range: None,
    };
    let relative = relative_error(image, reference, coloring).map_err(|error| error.to_string())?;
    let Legend::Bar { range, .. } = relative.legend else {
        return Err("an error map without a bar".to_owned());
    };
    let channel = |channel: usize| {
        map(image, |index, x| {
            let difference = f64::from(x[channel]) - f64::from(reference.pixels[index][channel]);
            signed_color(difference / largest)
        })
    };
    let flip = map(&compared.flip, |_, flip| {
        map_color(share_of(f64::from(flip), [0.0, 1.0], Scale::Linear))
    });
    let pictures = vec![
        ("image", tone_map(image, exposure)),
        ("reference", tone_map(reference, exposure)),
        ("flip", flip),
        ("relative", relative.image),
        ("red", channel(0)),
        ("green", channel(1)),
        ("blue", channel(2)),
        ("image_values", packed(image)),
        ("reference_values", packed(reference)),
    ];
    Ok((pictures, range))
}

/// A picture of the same size.
fn map<P: Copy>(image: &Image<P>, color: impl Fn(usize, P) -> [u8; 3]) -> ImageRgb8 {
    let pixels = image.pixels.iter().enumerate();
    image.like(pixels.map(|(index, pixel)| color(index, *pixel)))
}

/// Colour of a signed share, -1 to 1: white is no difference.
fn signed_color(share: f64) -> [u8; 3] {
    if !share.is_finite() {
        return NOT_FINITE;
    }
    let end = ENDS[usize::from(share > 0.0)];
    end.map(|end| (255.0 + share.abs().min(1.0) * (f64::from(end) - 255.0)).round() as u8)
}

/// Linear values as a picture three times as high: the three channels one below the other, each value's upper 24 of 32
/// bits as one pixel. Scripts of a page read pictures of 8 bits only, and 5 digits are kept this way.
fn packed(image: &ImageRgb) -> ImageRgb8 {
    let channel = |channel: usize| {
        image
            .pixels
            .iter()
            .map(move |pixel| upper_bits(pixel[channel]))
    };
    Image {
        width: image.width,
        height: 3 * image.height,
        pixels: (0..3).flat_map(channel).collect(),
    }
}

/// The upper 24 bits of a number, rounded; never from a finite number to another kind.
fn upper_bits(value: f32) -> [u8; 3] {
    let bits = value.to_bits();
    let rounded = bits.saturating_add(0x80);
    let keeps_kind = f32::from_bits(rounded & !0xff).is_finite() == value.is_finite();
    let [first, second, third, _] = if keeps_kind { rounded } else { bits }.to_be_bytes();
    // A NaN whose payload is in the lowest bits stays one.
    let quiet = if value.is_nan() { 0x40 } else { 0 };
    [first, second | quiet, third]
}

/// Differences of the pixels that count, x - r by channel.
fn differences(compared: &ComparedFiles) -> impl Iterator<Item = [f64; 3]> + '_ {
    let pairs = compared.image.pixels.iter().zip(&compared.reference.pixels);
    let counted = move |index: usize| {
        let mask = compared.mask.as_ref();
        mask.is_none_or(|mask| mask.pixels.get(index).copied().unwrap_or(false))
    };
    pairs.enumerate().filter_map(move |(index, (x, r))| {
        let difference = [0, 1, 2].map(|c| f64::from(x[c]) - f64::from(r[c]));
        let is_finite = difference.iter().all(|channel| channel.is_finite());
        (counted(index) && is_finite).then_some(difference)
    })
}

/// What the colours and the histogram reach to: few pixels differ by more.
fn largest_difference(compared: &ComparedFiles) -> f64 {
    let sizes = differences(compared).flatten().map(f64::abs);
    automatic_range(sizes, Scale::Linear)[1]
}

/// Pixels by difference, a row for each channel, [`BARS`] from `-largest` to `largest`; beyond counts in the last bars.
fn histogram(compared: &ComparedFiles, largest: f64) -> Value {
    let mut counts = [[0_u64; BARS]; 3];
    for difference in differences(compared) {
        for (bars, channel) in counts.iter_mut().zip(difference) {
            let share = share_of(channel, [-largest, largest], Scale::Linear);
            bars[((share * BARS as f64) as usize).min(BARS - 1)] += 1;
        }
    }
    json!(counts.map(|bars| bars.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{FlipView, compare, flip_map};

    fn compared(image: ImageRgb, reference: ImageRgb) -> ComparedFiles {
        let view = FlipView::default();
        ComparedFiles {
            flip: flip_map(&image, &reference, view).unwrap(),
            comparison: compare(&image, &reference, None, view).unwrap(),
            image,
            reference,
            mask: None,
        }
    }

    #[test]
    fn packed_values_keep_five_digits_and_their_kind() {
        let unpacked = |value: f32| {
            let [a, b, c] = upper_bits(value);
            f32::from_be_bytes([a, b, c, 0])
        };
        for value in [
            0.0,
            -0.0,
            1.0,
            0.1,
            -3.7e-5,
            123_456.79,
            1e-30,
            f32::MAX,
            f32::MIN,
        ] {
            // 15 bits of the mantissa are kept, rounded: half a unit of the last; the largest numbers are cut instead.
            let most = if value.abs() == f32::MAX {
                2.0_f32.powi(-15)
            } else {
                2.0_f32.powi(-16)
            };
            let error = (unpacked(value) - value).abs();
            assert!(error <= most * value.abs(), "{value}: {error}");
        }
        assert_eq!(unpacked(f32::INFINITY), f32::INFINITY);
        assert_eq!(unpacked(f32::NEG_INFINITY), f32::NEG_INFINITY);
        for nan in [
            f32::NAN,
            f32::from_bits(0x7f80_0001),
            f32::from_bits(u32::MAX),
        ] {
            assert!(unpacked(nan).is_nan());
        }
    }

    #[test]
    fn differences_are_counted_where_they_are() {
        let reference = Image::filled(16, 10, [1.0; 3]).unwrap();
        let mut image = reference.clone();
        for pixel in &mut image.pixels[..40] {
            *pixel = [1.5, 1.0, 0.5];
        }
        image.pixels[100] = [f32::NAN, 1.0, 1.0];
        let compared = compared(image, reference);
        assert_eq!(largest_difference(&compared), 0.5);
        let counts = histogram(&compared, 0.5);
        let bar = |channel: usize, bar: usize| counts[channel][bar].as_u64().unwrap();
        assert_eq!((bar(0, BARS - 1), bar(0, BARS / 2)), (40, 119));
        assert_eq!(bar(1, BARS / 2), 159);
        assert_eq!((bar(2, 0), bar(2, BARS / 2)), (40, 119));
    }

    #[test]
    fn signs_have_colours() {
        assert_eq!(signed_color(0.0), [255; 3]);
        assert_eq!([-1.0, 7.0].map(signed_color), ENDS);
        assert_eq!(signed_color(f64::NAN), NOT_FINITE);
    }

    #[test]
    fn names_of_files_cannot_leave_their_place() {
        let plane = Image::filled(16, 16, [1.0; 3]).unwrap();
        let names = ["</script><b>{flip}.exr", "{style}.exr"].map(str::to_owned);
        let page = page(names, &compared(plane.clone(), plane), 1.0).unwrap();
        assert!(page.contains("\\u003c/script>\\u003cb>{flip}.exr"));
        assert!(!page.contains("<b>{"));
        assert_eq!(page.matches("data:image/png;base64,").count(), 9);
    }
}
