//! A panel's picture: the triangles that egui makes of widgets, drawn on the host. It does what egui's own painters do on a
//! device (premultiplied sRGB bytes, blended as they are), with the same bits on every machine.

use std::collections::HashMap;

use egui::epaint::{ImageData, ImageDelta, Primitive, Vertex};
use egui::{ClippedPrimitive, Color32, ColorImage, TextureId, TexturesDelta};

/// Corners lie on a grid of so many steps a pixel, so that which pixels two neighbours cover is decided without rounding.
const STEPS: f32 = 256.0;
/// Corners further out, in pixels, are drawn as if they were here: products of two stay within 64 bits.
const MOST_PIXELS: f32 = 1e6;

/// What panels draw on.
pub(super) struct Canvas {
    size: [usize; 2],
    pixels: Vec<Color32>,
    textures: HashMap<TextureId, ColorImage>,
}

impl Canvas {
    pub(super) fn new([width, height]: [u32; 2]) -> Self {
        let size = [width as usize, height as usize];
        Self {
            size,
            pixels: vec![Color32::BLACK; size[0] * size[1]],
            textures: HashMap::new(),
        }
    }

    /// Takes egui's textures over: letters, for the most part. Those that are no longer used go with the next call.
    pub(super) fn take_textures(&mut self, delta: TexturesDelta) {
        let mut delta = delta;
        for (id, changes) in delta.set.drain() {
            for ImageDelta { image, pos, .. } in changes {
                let ImageData::Color(image) = image;
                match (pos, self.textures.get_mut(&id)) {
                    (Some([left, top]), Some(known)) => put(known, &image, left, top),
                    _ => {
                        self.textures.insert(id, (*image).clone());
                    }
                }
            }
        }
        for id in delta.free.drain() {
            self.textures.remove(&id);
        }
    }

    /// Draws everything anew; one pixel a point.
    pub(super) fn draw(&mut self, primitives: &[ClippedPrimitive]) {
        self.pixels.fill(Color32::BLACK);
        for ClippedPrimitive {
            clip_rect,
            primitive,
        } in primitives
        {
            // Nothing here makes callbacks, which draw on a device.
            let Primitive::Mesh(mesh) = primitive else {
                continue;
            };
            let Some(texture) = self.textures.get(&mesh.texture_id) else {
                continue;
            };
            let within = |value: f32, most: usize| (value.round().max(0.0) as usize).min(most);
            let clip = [
                [
                    within(clip_rect.min.x, self.size[0]),
                    within(clip_rect.max.x, self.size[0]),
                ],
                [
                    within(clip_rect.min.y, self.size[1]),
                    within(clip_rect.max.y, self.size[1]),
                ],
            ];
            for corners in mesh.indices.chunks_exact(3) {
                let corner = |of: usize| mesh.vertices.get(corners[of] as usize);
                if let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) {
                    fill(&mut self.pixels, self.size[0], clip, [a, b, c], texture);
                }
            }
        }
    }

    /// The picture, opaque.
    pub(super) fn rgba8(&self) -> Vec<u8> {
        let pixels = self.pixels.iter();
        pixels
            .flat_map(|of| [of.r(), of.g(), of.b(), 255])
            .collect()
    }
}

fn put(texture: &mut ColorImage, patch: &ColorImage, left: usize, top: usize) {
    let [columns, rows] = patch.size;
    for row in 0..rows {
        let from = &patch.pixels[row * columns..][..columns];
        let first = (top + row) * texture.size[0] + left;
        if let Some(to) = texture.pixels.get_mut(first..first + columns) {
            to.copy_from_slice(from);
        }
    }
}

/// Fills a triangle of either winding. A pixel whose centre lies on the edge of two belongs to one of them: feathered edges
/// are half transparent and must not be blended twice.
fn fill(
    pixels: &mut [Color32],
    width: usize,
    clip: [[usize; 2]; 2],
    corners: [&Vertex; 3],
    texture: &ColorImage,
) {
    let on_grid = |value: f32| {
        // NaN becomes 0.
        (value.clamp(-MOST_PIXELS, MOST_PIXELS) * STEPS).round() as i64
    };
    let mut corners = corners;
    let place = |of: &Vertex| [on_grid(of.pos.x), on_grid(of.pos.y)];
    let edge = |[ax, ay]: [i64; 2], [bx, by]: [i64; 2], [x, y]: [i64; 2]| {
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let mut at = corners.map(place);
    if edge(at[0], at[1], at[2]) < 0 {
        corners.swap(1, 2);
        at.swap(1, 2);
    }
    let area = edge(at[0], at[1], at[2]);
    if area == 0 {
        return;
    }
    // The edge opposite to each corner, and whether centres on it are inside: edges on top and on the left.
    let edges = [[at[1], at[2]], [at[2], at[0]], [at[0], at[1]]];
    let least = edges.map(|[[ax, ay], [bx, by]]| i64::from(!(by < ay || (by == ay && bx > ax))));
    let range = |axis: usize| {
        let values = at.map(|corner| corner[axis]);
        let low = values.into_iter().fold(i64::MAX, i64::min);
        let high = values.into_iter().fold(i64::MIN, i64::max);
        let step = STEPS as i64;
        let [first, end] = clip[axis].map(|bound| bound as i64);
        low.div_euclid(step).max(first)..(high.div_euclid(step) + 1).min(end)
    };
    let color = corners.map(|corner| corner.color.to_array().map(f32::from));
    for row in range(1) {
        for column in range(0) {
            let center = [column, row].map(|index| index * STEPS as i64 + STEPS as i64 / 2);
            let inside = edges.map(|[a, b]| edge(a, b, center));
            if (0..3).any(|of| inside[of] < least[of]) {
                continue;
            }
            let share = inside.map(|of| of as f32 / area as f32);
            let mix = |values: [f32; 3]| (0..3).map(|of| share[of] * values[of]).sum::<f32>();
            let texel = sample(
                texture,
                mix(corners.map(|corner| corner.uv.x)),
                mix(corners.map(|corner| corner.uv.y)),
            );
            let source: [f32; 4] =
                std::array::from_fn(|c| mix(color.map(|of| of[c])) * texel[c] / 255.0);
            let pixel = &mut pixels[row as usize * width + column as usize];
            let before = pixel.to_array().map(f32::from);
            let kept = 1.0 - source[3] / 255.0;
            let [r, g, b, a] =
                std::array::from_fn(|c| (source[c] + kept * before[c]).round().min(255.0) as u8);
            *pixel = Color32::from_rgba_premultiplied(r, g, b, a);
        }
    }
}

/// Bilinear, the border going on; bytes.
fn sample(texture: &ColorImage, u: f32, v: f32) -> [f32; 4] {
    let [columns, rows] = texture.size;
    let split = |place: f32, count: usize| {
        let place = (place * count as f32 - 0.5).clamp(0.0, count.max(1) as f32 - 1.0);
        let first = place as usize;
        (first, (first + 1).min(count.max(1) - 1), place.fract())
    };
    let (left, right, x) = split(u, columns);
    let (top, bottom, y) = split(v, rows);
    let texel = |column: usize, row: usize| {
        let found = texture.pixels.get(row * columns + column);
        found.map_or([0.0; 4], |of| of.to_array().map(f32::from))
    };
    let [a, b, c, d] = [
        texel(left, top),
        texel(right, top),
        texel(left, bottom),
        texel(right, bottom),
    ];
    std::array::from_fn(|i| {
        let upper = a[i] + x * (b[i] - a[i]);
        let lower = c[i] + x * (d[i] - c[i]);
        upper + y * (lower - upper)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Mesh, Rect, pos2, vec2};

    fn drawn(mesh: Mesh, clip: Rect) -> Canvas {
        let mut canvas = Canvas::new([8, 8]);
        let white = ColorImage::new([1, 1], vec![Color32::WHITE]);
        canvas.textures.insert(mesh.texture_id, white);
        canvas.draw(&[ClippedPrimitive {
            clip_rect: clip,
            primitive: Primitive::Mesh(mesh),
        }]);
        canvas
    }

    /// Two triangles of a half transparent rectangle: every pixel whose centre it holds is blended once, its diagonal too, and
    /// none outside. 128 of 255 white over black is 128.
    #[test]
    fn neighbours_share_their_edge_without_blending_twice() {
        let everywhere = Rect::from_min_size(pos2(0.0, 0.0), vec2(8.0, 8.0));
        let half = Color32::from_rgba_premultiplied(128, 128, 128, 128);
        let mut mesh = Mesh::default();
        let rectangle = Rect::from_min_max(pos2(1.5, 2.0), pos2(6.5, 7.0));
        mesh.add_colored_rect(rectangle, half);
        let canvas = drawn(mesh.clone(), everywhere);
        for (index, pixel) in canvas.pixels.iter().enumerate() {
            // Centres on the left and upper edges are inside, those on the right and lower ones not.
            let is_inside = (1..6).contains(&(index % 8)) && (2..7).contains(&(index / 8));
            let expected = if is_inside { 128 } else { 0 };
            assert_eq!(pixel.r(), expected, "pixel {index}");
        }
        // What is blended twice is seen.
        let again = mesh.clone();
        mesh.append(again);
        assert_eq!(drawn(mesh.clone(), everywhere).pixels[3 * 8 + 3].r(), 192);
        let clip = Rect::from_min_max(pos2(0.0, 0.0), pos2(3.0, 3.0));
        let clipped = drawn(mesh, clip);
        let lit = clipped.pixels.iter().filter(|pixel| pixel.r() > 0).count();
        assert_eq!(lit, 2, "columns 1 and 2 of row 2");
    }

    #[test]
    fn colors_and_letters_are_interpolated() {
        // Halfway between the middles of two texels is their mean; beyond the middles of the outer ones their own values.
        let texture = ColorImage::new([2, 1], vec![Color32::BLACK, Color32::WHITE]);
        assert_eq!(sample(&texture, 0.5, 0.5)[0], 127.5);
        assert_eq!(sample(&texture, 0.0, 0.0)[0], 0.0);
        assert_eq!(sample(&texture, 1.0, 0.3)[0], 255.0);
    }
}
