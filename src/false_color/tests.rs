use super::*;
use crate::images::srgb_decode;
use crate::metrics::{FlipView, compare};
use crate::renderer::Eye;

/// CIE 1976 lightness of an 8-bit sRGB colour, 0 to 100.
fn lightness(color: [u8; 3]) -> f64 {
    let [r, g, b] = color.map(|c| srgb_decode(f64::from(c) / 255.0));
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    if y > 216.0 / 24_389.0 {
        116.0 * y.cbrt() - 16.0
    } else {
        y * 24_389.0 / 27.0
    }
}

fn inspected(inspection: Inspection, values: InspectedValues, has: Option<Vec<bool>>) -> Inspected {
    let count = match &values {
        InspectedValues::Scalar(v) => v.len(),
        InspectedValues::Color(v) | InspectedValues::Direction(v) => v.len(),
        InspectedValues::Vector2(v) => v.len(),
        InspectedValues::Labels(v) => v.len(),
    };
    Inspected {
        inspection,
        eye: Eye::Left,
        size: [count as u32, 1],
        values,
        has_value: has,
    }
}

fn pixels(inspected: &Inspected, coloring: Coloring) -> Vec<[u8; 3]> {
    picture(inspected, coloring).unwrap().image.pixels
}

#[test]
fn the_map_grows_in_lightness_by_even_steps() {
    assert_eq!(map_color(0.0), [0; 3]);
    assert_eq!(
        (map_color(-3.0), map_color(7.0)),
        (map_color(0.0), map_color(1.0))
    );
    let mut before = -1.0;
    for step in 0..=200 {
        let now = lightness(map_color(f64::from(step) / 200.0));
        // A two-hundredth is half a unit of L*; 8-bit colours round by up to 0.2.
        assert!(now > before, "{step}: {before} to {now}");
        before = now;
    }
    for knot in 0..8 {
        let at = |k: i32| lightness(map_color(f64::from(k) / 8.0));
        let step = at(knot + 1) - at(knot);
        assert!((10.5..13.5).contains(&step), "{knot}: {step}");
    }
}

#[test]
fn shares_and_numbers_of_a_legend_are_those_of_the_picture() {
    for (range, scale) in [
        ([0.0, 3.7], Scale::Linear),
        ([-2.0, 5.0], Scale::Linear),
        ([1.2345e-5, 2.1e-5], Scale::Linear),
        ([1e6, 1e6 + 3.0], Scale::Linear),
        ([0.02, 300.0], Scale::Log),
        ([3.0, 80.0], Scale::Log),
        ([1e-9, 1e9], Scale::Log),
        ([7.1, 7.3], Scale::Log),
    ] {
        let ticks = ticks(range, scale);
        assert!((2..=9).contains(&ticks.len()), "{range:?}: {ticks:?}");
        for pair in ticks.windows(2) {
            assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1, "{ticks:?}");
        }
        for (place, text) in &ticks {
            // The number that is written stands where it belongs: to within what its digits leave open, a hundredth of the bar.
            let number: f64 = text.parse().unwrap();
            let share = share_of(number, range, scale);
            assert!(
                (0.0..=1.0).contains(place) && (share - place).abs() < 0.01,
                "{text} at {place}, {share}"
            );
        }
    }
    let texts = |range, scale| -> Vec<String> {
        ticks(range, scale).into_iter().map(|tick| tick.1).collect()
    };
    assert_eq!(
        texts([0.0, 1.0], Scale::Linear),
        ["0", "0.2", "0.4", "0.6", "0.8", "1"]
    );
    assert_eq!(
        texts([0.0, 47.0], Scale::Linear),
        ["0", "10", "20", "30", "40"]
    );
    assert_eq!(
        texts([0.01, 100.0], Scale::Log),
        ["0.01", "0.1", "1", "10", "100"]
    );
    assert_eq!(texts([3.0, 80.0], Scale::Log), ["5", "10", "20", "50"]);
    assert_eq!(share_of(10.0, [1.0, 100.0], Scale::Log), 0.5);
    assert_eq!(share_of(0.0, [1.0, 100.0], Scale::Log), 0.0);
    assert_eq!(share_of(f64::NAN, [0.0, 1.0], Scale::Linear), 0.0);
}

#[test]
fn ranges_leave_out_what_is_rare_and_are_never_empty() {
    let mut values: Vec<f64> = (0..1000).map(|i| f64::from(i) / 100.0).collect();
    values[7] = 1e9;
    assert_eq!(automatic_range(values.clone(), Scale::Linear)[0], 0.0);
    let high = automatic_range(values, Scale::Linear)[1];
    assert!((9.8..10.0).contains(&high), "{high}");
    let far = automatic_range((0..100).map(|i| 50.0 + f64::from(i) / 100.0), Scale::Linear);
    assert!(far[0] > 49.9 && far[1] < 51.0);
    for scale in [Scale::Linear, Scale::Log] {
        for values in [
            vec![],
            vec![0.0; 5],
            vec![3.0; 5],
            vec![-1.0; 5],
            vec![f64::NAN],
        ] {
            let [low, high] = automatic_range(values.clone(), scale);
            assert!(
                low < high && low.is_finite() && high.is_finite(),
                "{values:?}"
            );
            assert!(scale == Scale::Linear || low > 0.0);
            assert!(ticks([low, high], scale).len() >= 2);
        }
    }
    // A room between 2 and 12 m: no colours for what lies before it.
    let depths = (0..=1000).map(|i| 2.0 + f64::from(i) / 100.0);
    assert_eq!(automatic_range(depths.clone(), Scale::Linear)[0], 0.0);
    let [near, far] = depth_range(depths);
    assert!((2.0..2.2).contains(&near) && (11.8..12.0).contains(&far));
    assert_eq!(depth_range([]), [0.0, 1.0]);
    assert_eq!(depth_range([3.0; 5]), [0.0, 3.0]);
    // One dot in a thousand pixels is worth showing.
    let mut dots = vec![0.0; 1000];
    dots[3] = 2.0;
    assert_eq!(automatic_range(dots, Scale::Linear), [0.0, 2.0]);
    let decades = automatic_range([1e-30, 1.0, 1.0, 1.0], Scale::Log);
    assert!((decades[1] / decades[0]).log10() <= 6.01);
}

#[test]
fn lamps_hardly_move_what_is_white() {
    let lit = |lamps: usize| {
        let values = (0..1000).map(move |i| if i < lamps { 500.0 } else { 0.09 });
        automatic_white(values.chain([0.0; 500]))
    };
    assert!((lit(0) - 0.09).abs() < 1e-12, "an even picture is white");
    // A twentieth of lamps: (500 / 0.09)^0.05 is 1.54.
    assert!((lit(50) - 0.09 / 0.18 * 1.54).abs() < 0.01, "{}", lit(50));
    assert_eq!(automatic_white([0.0, -1.0, f64::NAN]), 1.0);
}

#[test]
fn numbers_become_colours_of_the_map_and_gaps_stay_gaps() {
    let depth = inspected(
        Inspection::Depth,
        InspectedValues::Scalar(vec![0.0, 1.0, 2.0, 4.0]),
        Some(vec![false, true, true, true]),
    );
    let coloring = Coloring {
        scale: Scale::Linear,
        range: Some([0.0, 4.0]),
    };
    let found = picture(&depth, coloring).unwrap();
    let expected = [NO_VALUE, map_color(0.25), map_color(0.5), map_color(1.0)];
    assert_eq!(found.image.pixels, expected);
    let Legend::Bar {
        unit, range, ticks, ..
    } = &found.legend
    else {
        panic!("a bar");
    };
    assert_eq!((*unit, *range, ticks.len()), ("m", [0.0, 4.0], 5));
    assert_eq!(found.legend.line(), "0 m to 4 m");
    // Nothing of the map looks like a gap.
    assert!((0..=100).all(|i| map_color(f64::from(i) / 100.0) != NO_VALUE));
    // By itself the range comes from what there is.
    let Legend::Bar { range, .. } = picture(&depth, Coloring::default()).unwrap().legend else {
        panic!("a bar");
    };
    assert_eq!(range, [1.0, 4.0], "from the nearest on");
    let wrong = Inspected {
        size: [3, 1],
        ..depth
    };
    assert!(picture(&wrong, coloring).is_err());
}

#[test]
fn colours_normals_motions_and_labels_have_their_own() {
    let coloring = Coloring::default();
    let albedo = inspected(
        Inspection::Albedo,
        InspectedValues::Color(vec![[0.0, 1.0, 0.5]]),
        None,
    );
    assert_eq!(pixels(&albedo, coloring), [[0, 255, 188]]);
    let light = inspected(
        Inspection::Direct,
        InspectedValues::Color(vec![[4.0, 2.0, 0.0]]),
        None,
    );
    let found = picture(&light, coloring).unwrap();
    assert_eq!(found.image.pixels, [[255, 188, 0]]);
    assert_eq!(
        found.legend,
        Legend::White {
            unit: "W/(m² sr)",
            white: 4.0
        }
    );
    assert_eq!(found.legend.line(), "white is 4 W/(m² sr)");
    let normal = inspected(
        Inspection::Normal,
        InspectedValues::Direction(vec![[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
        None,
    );
    assert_eq!(pixels(&normal, coloring), [[255, 128, 128], [128, 0, 128]]);
    let motion = inspected(
        Inspection::Motion,
        InspectedValues::Vector2(vec![[2.0, 0.0], [-2.0, 0.0], [0.0, 0.0], [0.0, 2.0]]),
        None,
    );
    let found = picture(&motion, coloring).unwrap();
    assert_eq!(
        found.legend,
        Legend::Wheel {
            unit: "pixels",
            longest: 2.0
        }
    );
    // Red to the right, its opposite to the left, grey at rest.
    assert_eq!(
        found.image.pixels[..3],
        [[255, 0, 0], [0, 255, 255], [64, 64, 64]]
    );
    assert_eq!(found.image.pixels[3], [128, 255, 0]);
    let labels = inspected(
        Inspection::Instance,
        InspectedValues::Labels(vec![5, 0, 5]),
        None,
    );
    let found = picture(&labels, coloring).unwrap();
    assert_eq!(found.image.pixels[0], found.image.pixels[2]);
    assert_eq!(
        found.legend,
        Legend::Labels(vec![
            (label_color(0), "0".to_owned()),
            (label_color(5), "5".to_owned())
        ])
    );
    let provenance = inspected(
        Inspection::Provenance,
        InspectedValues::Labels((0..7).collect()),
        None,
    );
    let found = picture(&provenance, coloring).unwrap();
    assert_eq!(found.image.pixels[1], [70, 130, 90]);
    assert!(
        found
            .legend
            .line()
            .starts_with("no surface, reused, outside the left image")
    );
    assert!(
        !found.image.pixels.contains(&[255, 0, 255]),
        "a provenance without a colour"
    );
}

#[test]
fn neighbouring_labels_differ() {
    let difference = |a: [u8; 3], b: [u8; 3]| -> i32 {
        (0..3)
            .map(|c| (i32::from(a[c]) - i32::from(b[c])).abs())
            .sum()
    };
    for label in 0..200 {
        for other in label + 1..label + 6 {
            let found = difference(label_color(label), label_color(other));
            assert!(found > 40, "{label} and {other}: {found}");
        }
        assert!(difference(label_color(label), NO_VALUE) > 60);
    }
}

#[test]
fn error_maps_hold_the_terms_of_the_metric() {
    let image = |pixels: Vec<[f32; 3]>| Image::new(pixels.len() as u32, 1, pixels).unwrap();
    let reference = image(
        (0..64)
            .map(|i| [0.5 + i as f32 * 0.01, 1.0, 0.25])
            .collect(),
    );
    let mut noisy = reference.clone();
    for (index, pixel) in noisy.pixels.iter_mut().enumerate() {
        pixel[index % 3] *= 1.0 + 0.01 * index as f32;
    }
    let map = crate::metrics::rel_mse_map(&noisy, &reference).unwrap();
    let mean = map.pixels.iter().map(|e| e.unwrap()).sum::<f64>() / 64.0;
    let whole = compare(&noisy, &reference, None, FlipView::default()).unwrap();
    assert!((mean - whole.rel_mse.unwrap()).abs() < 1e-12, "{mean}");
    noisy.pixels[5][1] = f32::NAN;
    let found = relative_error(&noisy, &reference, Coloring::default()).unwrap();
    assert_eq!(found.image.pixels[5], NO_VALUE);
    assert_eq!(found.image.pixels[0], map_color(0.0));
    let Legend::Bar { range, .. } = found.legend else {
        panic!("a bar");
    };
    assert!(range[0] == 0.0 && range[1] > mean);
    let small = image(vec![[0.0; 3]]);
    assert!(relative_error(&small, &reference, Coloring::default()).is_err());
    let black = image(vec![[0.0; 3]]);
    let gray = image(vec![[1.0; 3]]);
    let undefined = relative_error(&gray, &black, Coloring::default()).unwrap();
    assert_eq!(undefined.image.pixels, [NO_VALUE]);
}
