//! The part of an eye's image that the lens hides, so that no ray is spent on it.

use super::view::Tangents;
use serde::Serialize;

/// Triangles of a mesh that are kept: both eyes' fit into the header of a recording, which is one line.
const MOST_TRIANGLES: usize = 200;

/// Triangles on the plane one metre ahead of an eye (x right, y up: tangents of viewing angles) that nobody can see.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct HiddenArea {
    triangles: Vec<[[f64; 2]; 3]>,
}

impl HiddenArea {
    /// From a mesh: corners, and three indices per triangle. Triangles with an index or a coordinate that makes no sense
    /// are left out, and of more than `MOST_TRIANGLES` the smallest, which only costs rays.
    #[must_use]
    pub fn from_mesh(vertices: &[[f64; 2]], indices: &[u32]) -> Self {
        let corner = |index: u32| {
            vertices
                .get(index as usize)
                .copied()
                .filter(|corner| corner.iter().all(|c| c.is_finite()))
        };
        let corners = indices.as_chunks::<3>().0.iter();
        let triangles = corners.filter_map(|&[a, b, c]| Some([corner(a)?, corner(b)?, corner(c)?]));
        Self::from_triangles(triangles.collect())
    }

    /// From triangles; every number must be finite. The largest count.
    #[must_use]
    pub fn from_triangles(mut triangles: Vec<[[f64; 2]; 3]>) -> Self {
        if triangles.len() > MOST_TRIANGLES {
            let area = |[a, b, c]: &[[f64; 2]; 3]| {
                ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
            };
            triangles.sort_by(|a, b| area(b).total_cmp(&area(a)));
            triangles.truncate(MOST_TRIANGLES);
        }
        Self { triangles }
    }

    /// The triangles.
    #[must_use]
    pub fn triangles(&self) -> &[[[f64; 2]; 3]] {
        &self.triangles
    }

    /// True if nothing is hidden.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// One bit per pixel in row-major order from the lowest bit of the first word: set where all of the pixel is hidden.
    /// A pixel counts as hidden if its four corners lie in hidden triangles; what is hidden is the rim of a roughly round
    /// opening, so no visible spot is smaller than that.
    #[must_use]
    pub fn pixels(&self, tangents: &Tangents, [width, height]: [u32; 2]) -> Vec<u32> {
        let (columns, rows) = (width as usize + 1, height as usize + 1);
        let mut corners = vec![false; columns * rows];
        let step_x = (tangents.right - tangents.left) / f64::from(width);
        let step_y = (tangents.down - tangents.up) / f64::from(height);
        for triangle in &self.triangles {
            // Corner (i, j) of the pixel grid in units of pixels.
            let [a, b, c] =
                triangle.map(|[x, y]| [(x - tangents.left) / step_x, (y - tangents.up) / step_y]);
            let range = |axis: usize, most: usize| {
                let low = a[axis].min(b[axis]).min(c[axis]).floor().max(0.0);
                let high = a[axis]
                    .max(b[axis])
                    .max(c[axis])
                    .ceil()
                    .min(most as f64 - 1.0);
                // Beyond the image: an empty range. Casts of what is clamped are exact.
                (low as usize)..(if high < low { 0 } else { high as usize + 1 })
            };
            let edge = |p: [f64; 2], q: [f64; 2], x: f64, y: f64| {
                (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
            };
            // Either winding; edges belong to the triangle, so that neighbours leave no seam. Rounding of the
            // runtime's f32 corners is some 1e-4 pixels.
            let slack = 1e-3;
            // Every point is within that of the edges of a triangle without area, which hides nothing.
            if edge(a, b, c[0], c[1]).abs() <= slack {
                continue;
            }
            for j in range(1, rows) {
                for i in range(0, columns) {
                    if corners[j * columns + i] {
                        continue;
                    }
                    let (x, y) = (i as f64, j as f64);
                    let sides = [edge(a, b, x, y), edge(b, c, x, y), edge(c, a, x, y)];
                    if sides.iter().all(|s| *s >= -slack) || sides.iter().all(|s| *s <= slack) {
                        corners[j * columns + i] = true;
                    }
                }
            }
        }
        let pixels = width as usize * height as usize;
        let mut bits = vec![0_u32; pixels.div_ceil(32)];
        for pixel in 0..pixels {
            let (i, j) = (pixel % width as usize, pixel / width as usize);
            let at = j * columns + i;
            let hidden = corners[at]
                && corners[at + 1]
                && corners[at + columns]
                && corners[at + columns + 1];
            bits[pixel / 32] |= u32::from(hidden) << (pixel % 32);
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Tangents = Tangents {
        left: -1.0,
        right: 1.0,
        up: 1.0,
        down: -1.0,
    };

    fn hidden(bits: &[u32], pixel: usize) -> bool {
        bits[pixel / 32] >> (pixel % 32) & 1 == 1
    }

    #[test]
    fn a_corner_triangle_hides_the_pixels_that_lie_in_it_whole() {
        // The upper left half of the square, cut along the rising diagonal.
        let area = HiddenArea::from_mesh(
            &[[-1.0, 1.0], [-1.0, -1.0], [1.0, 1.0]],
            &[0, 1, 2, 7, 0, 1],
        );
        assert_eq!(
            area.triangles().len(),
            1,
            "an index without a corner is left out"
        );
        let bits = area.pixels(&SQUARE, [8, 8]);
        for j in 0..8 {
            for i in 0..8 {
                // Corners of pixel (i, j) reach to i + 1 + j + 1; the diagonal runs through i + j = 8.
                assert_eq!(hidden(&bits, j * 8 + i), i + j + 2 <= 8, "({i}, {j})");
            }
        }
    }

    #[test]
    fn two_halves_leave_no_seam_and_what_lies_outside_hides_nothing() {
        let quad = [[-2.0, 2.0], [2.0, 2.0], [-2.0, -2.0], [2.0, -2.0]];
        let all = HiddenArea::from_mesh(&quad, &[0, 1, 2, 1, 3, 2]);
        assert!((0..63).all(|pixel| hidden(&all.pixels(&SQUARE, [9, 7]), pixel)));
        let beside = HiddenArea::from_mesh(
            &[[1.5, 0.0], [3.0, 0.0], [3.0, 3.0], [f64::NAN, 0.0]],
            &[0, 1, 2, 0, 1, 3],
        );
        assert!(beside.pixels(&SQUARE, [9, 7]).iter().all(|word| *word == 0));
    }

    #[test]
    fn triangles_without_area_hide_nothing() {
        let point = [0.1, 0.1];
        for triangle in [[point; 3], [point, [0.1001, 0.1], [0.1, 0.1001]]] {
            let area = HiddenArea::from_triangles(vec![triangle]);
            assert!(area.pixels(&SQUARE, [8, 8]).iter().all(|word| *word == 0));
        }
    }
}
