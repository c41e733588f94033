use super::*;

const COLORS: [Averaging; 3] = [
    Averaging::Color,
    Averaging::BlendedColor,
    Averaging::MaskedColor(128),
];

fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Image {
    Image {
        name: "made".to_owned(),
        width,
        height,
        rgba8: (0..width * height)
            .flat_map(|at| texel(at % width, at / width))
            .collect(),
    }
}

/// Texels of each level.
fn chain(image: &Image, averaging: Averaging) -> Vec<Vec<[u8; 4]>> {
    let mut texels = Vec::new();
    let sizes = add_levels(image, averaging, &mut texels);
    assert_eq!(texels.len() as u64, texel_count(image, averaging));
    let mut rest = texels.into_iter().map(u32::to_le_bytes);
    sizes
        .iter()
        .map(|[width, height]| rest.by_ref().take((width * height) as usize).collect())
        .collect()
}

fn noise(x: u32, y: u32) -> [u8; 4] {
    let hash =
        (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
    (hash ^ (hash >> 15)).to_le_bytes()
}

#[test]
fn sizes_halve_down_to_one_texel() {
    for (size, due) in [
        ([8, 2], vec![[8, 2], [4, 1], [2, 1], [1, 1]]),
        ([5, 7], vec![[5, 7], [2, 3], [1, 1]]),
        ([1, 1], vec![[1, 1]]),
    ] {
        let image = image(size[0], size[1], noise);
        assert_eq!(add_levels(&image, Averaging::Color, &mut Vec::new()), due);
        assert_eq!(
            add_levels(&image, Averaging::None, &mut Vec::new()),
            due[..1]
        );
    }
}

#[test]
fn a_constant_texture_is_constant_at_all_levels() {
    let constant = [200, 3, 77, 140];
    let image = image(13, 8, |_, _| constant);
    for averaging in COLORS.into_iter().chain([Averaging::Linear]) {
        for level in &chain(&image, averaging)[1..] {
            let alpha = match averaging {
                Averaging::MaskedColor(_) => 255,
                _ => constant[3],
            };
            let due = [constant[0], constant[1], constant[2], alpha];
            assert!(
                level.iter().all(|texel| *texel == due),
                "{averaging:?}: {level:?}"
            );
        }
    }
}

/// Linear values of the means are exact up to rounding to bytes: half a step of 1/255, in sRGB at most times the curve's
/// steepest slope, 2.4 / 1.055 = 2.28 (at white); f32 sums of a few thousand texels add under 1e-4 steps.
#[test]
fn the_mean_of_each_level_is_the_texture_s() {
    for size in [[64, 64], [37, 51]] {
        let image = image(size[0], size[1], noise);
        for (averaging, slope) in [(Averaging::Color, 2.28), (Averaging::Linear, 1.0)] {
            let value = |byte: u8| {
                let value = f64::from(byte) / 255.0;
                if averaging == Averaging::Color {
                    srgb_decode(value)
                } else {
                    value
                }
            };
            let chain = chain(&image, averaging);
            // Texels of a level are equally large: each is the mean of an equal part of the image.
            let mean = |level: &[[u8; 4]]| {
                level.iter().map(|texel| value(texel[1])).sum::<f64>() / level.len() as f64
            };
            for level in &chain {
                let error = (mean(level) - mean(&chain[0])).abs();
                assert!(error < slope * 0.501 / 255.0, "{averaging:?}: {error}");
            }
            // Averaging bytes of sRGB instead would be far off.
            let bytes: f64 = chain[0]
                .iter()
                .map(|texel| f64::from(texel[1]) / 255.0)
                .sum();
            let wrong = srgb_decode(bytes / chain[0].len() as f64);
            assert!(averaging == Averaging::Linear || (wrong - mean(&chain[0])).abs() > 0.02);
        }
    }
}

#[test]
fn masks_keep_their_coverage_and_nothing_unseen_tints() {
    // A green quarter, just opaque enough, of red that is cut out.
    let image = image(64, 64, |x, y| {
        if x % 8 < 4 && y % 8 < 4 {
            [0, 255, 0, 128]
        } else {
            [255, 0, 0, 127]
        }
    });
    let masked = chain(&image, Averaging::MaskedColor(128));
    for level in &masked[3..] {
        for texel in level {
            assert_eq!(texel[3], 64, "a quarter is seen");
            // Red weighs three times LEAST_WEIGHT against one: 7e-4 in linear light, 12.92 times that in sRGB, 2.4 steps.
            assert!(texel[0] <= 3 && texel[1] >= 254, "{texel:?}");
        }
    }
    // Blended, both are half there.
    let blended = chain(&image, Averaging::BlendedColor);
    assert_eq!(blended[6][0][3], 127);
    assert!(blended[6][0][0] > 200);
}

/// Two normals at +-theta about z: their mean is cos(theta) long, and slopes along x have the variance tan^2(theta), along y
/// none: alpha^2 gains their sum. Von Mises and Fisher's law gives sin(theta) up to the fourth order, cos(theta) times that.
#[test]
fn spread_normals_become_roughness() {
    let byte_of = |value: f64| ((0.5 * value + 0.5) * 255.0).round() as u8;
    for degrees in [5.0, 10.0, 20.0_f64] {
        let theta = degrees.to_radians();
        let image = image(16, 16, |x, _| {
            let side = if x % 2 == 0 { 1.0 } else { -1.0 };
            [byte_of(side * theta.sin()), 128, byte_of(theta.cos()), 255]
        });
        let chain = chain(&image, Averaging::Normals);
        assert!(chain[0].iter().all(|texel| texel[3] == 0));
        // A byte is off by at most half: 1/255 in an angle of theta.
        let tolerance = theta.tan() * (1.0 - theta.cos()) + 2.0 / 255.0;
        for texel in chain[1..].iter().flatten() {
            let alpha = f64::from(texel[3]) / 255.0;
            assert!(
                (alpha - theta.tan()).abs() < tolerance,
                "{degrees}: {alpha}"
            );
            assert!(texel[0].abs_diff(128) <= 1 && texel[2] >= 254, "{texel:?}");
        }
    }
    assert_eq!(alpha_of_normals(1.0), 0.0);
    assert_eq!(alpha_of_normals(0.0), 1.0);
}
