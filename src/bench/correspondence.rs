//! Which pixels of both eyes show the same point.

use glam::DVec3;

use crate::images::Image;
use crate::xr::View;

/// Distances along a left ray may differ by this share and still be one surface: what a pixel's width makes of a floor
/// seen at a grazing angle, while the surfaces behind an edge lie much farther off.
const SAME_DISTANCE: f64 = 0.02;

/// Index of the pixel, `width` to a row, that a place in an image lies in; column and row in pixels from the upper left corner.
#[must_use]
pub fn pixel_at([column, row]: [f64; 2], width: u32) -> u32 {
    row as u32 * width + column as u32
}

/// For each right-eye pixel where in the left image the same surface point is seen, column and row in pixels from the upper left
/// corner, from both eyes' first hits: unit direction and distance per pixel by rows from the top, distance 0 where nothing is
/// hit. In f64 on the host.
#[must_use]
pub fn left_from_right(
    views: &[View; 2],
    size: [u32; 2],
    left_hits: &[[f32; 4]],
    right_hits: &[[f32; 4]],
) -> Image<Option<[f64; 2]>> {
    let [width, height] = size;
    let seen = |ray: &[f32; 4]| -> Option<[f64; 2]> {
        let [x, y, z, distance] = ray.map(f64::from);
        if distance <= 0.0 {
            return None;
        }
        let point_in_world = views[1].position_in_world + DVec3::new(x, y, z) * distance;
        let (column, row) = views[0].pixel_from_point_in_world(point_in_world, width, height)?;
        // Inside the half-open image, so the floors are pixels of it.
        let index = pixel_at([column, row], width) as usize;
        let left_distance = f64::from(left_hits.get(index)?[3]);
        let needed = (point_in_world - views[0].position_in_world).length();
        ((left_distance - needed).abs() <= SAME_DISTANCE * needed).then_some([column, row])
    };
    let mut pixels: Vec<Option<[f64; 2]>> = right_hits.iter().map(seen).collect();
    pixels.resize(width as usize * height as usize, None);
    Image {
        width,
        height,
        pixels,
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::xr::Fov;

    const SIZE: [u32; 2] = [16, 16];
    const DISTANCE_M: f64 = 2.0;

    fn views(ipd_m: f64) -> [View; 2] {
        [-0.5, 0.5].map(|side| View {
            position_in_world: DVec3::X * (side * ipd_m),
            orientation: DQuat::IDENTITY,
            fov: Fov::from_degrees(-45.0, 45.0, 45.0, -45.0),
        })
    }

    /// First hits on the plane z = -DISTANCE_M.
    fn plane_hits(view: &View) -> Vec<[f32; 4]> {
        (0..SIZE[0] * SIZE[1])
            .map(|index| {
                let (x, y) = (f64::from(index % SIZE[0]), f64::from(index / SIZE[0]));
                let ray = view.ray_through_pixel(x + 0.5, y + 0.5, SIZE[0], SIZE[1]);
                let direction = ray.direction;
                let distance = DISTANCE_M / -direction.z;
                let [x, y, z] = direction.as_vec3().to_array();
                [x, y, z, distance as f32]
            })
            .collect()
    }

    #[test]
    fn a_plane_shifts_by_its_disparity() {
        // A pixel is 2 x 2 m / 16 = 0.25 m wide on the plane, so an IPD of 0.5 m shifts by two pixels: what the right eye sees
        // in column c, the left eye sees in c + 2; its last two columns are outside.
        let views = views(0.5);
        let found = left_from_right(&views, SIZE, &plane_hits(&views[0]), &plane_hits(&views[1]));
        for (index, to) in found.pixels.iter().enumerate() {
            // Through the pixels' middles; 1e-5 is what f32 rays leave of a place 16 pixels wide.
            let expected = [(index % 16) as f64 + 2.5, (index / 16) as f64 + 0.5];
            assert_eq!(to.is_some(), index % 16 < 14, "pixel {index}");
            for (found, expected) in to.iter().flatten().zip(expected) {
                assert!((found - expected).abs() < 1e-5, "pixel {index}: {to:?}");
            }
        }
    }

    #[test]
    fn another_surface_in_front_is_no_match() {
        let views = views(0.5);
        let mut left = plane_hits(&views[0]);
        left[16 * 3 + 5][3] *= 0.8;
        left[16 * 3 + 6][3] = 0.0;
        let found = left_from_right(&views, SIZE, &left, &plane_hits(&views[1]));
        assert_eq!(found.pixels[16 * 3 + 3], None);
        assert_eq!(found.pixels[16 * 3 + 4], None);
        assert_eq!(
            found.pixels[16 * 3 + 5].map(|to| pixel_at(to, 16)),
            Some(16 * 3 + 7)
        );
        // Rays that miss have no partner.
        let nothing = vec![[0.0, 0.0, -1.0, 0.0]; 256];
        let found = left_from_right(&views, SIZE, &left, &nothing);
        assert!(found.pixels.iter().all(Option::is_none));
    }
}
