//! Axis-aligned boxes whose roundings only ever enlarge them.

use glam::{DVec3, Vec3};

/// f32 rounding unit, 2^-24.
pub const ROUNDING_UNIT: f64 = 1.0 / 16_777_216.0;

/// What a box gains on each side, times the largest magnitude of its corners.
///
/// The ray-triangle test sees its vertices through a shear whose error is up to 6 units of |vertex - origin| and a
/// direction that is off by a division (2.5 units in the last place, 5 of ours), so it may accept a ray that passes a
/// box by that much. 16 covers both; the ray adds the same share of its origin (`traversal.wesl`). Compare Ize,
/// "Robust BVH Ray Traversal", JCGT 2(2), 2013, which counts the slab test alone.
pub const PAD_UNITS: f64 = 16.0;

/// Corner of bounds that nothing can enter: far larger than any coordinate, small enough not to overflow in a slab test.
const NOWHERE: f32 = 1e18;

/// A box in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds32 {
    /// Lower corner, metres.
    pub min: Vec3,
    /// Upper corner, metres.
    pub max: Vec3,
}

impl Bounds32 {
    /// Holds nothing: min > max.
    pub const EMPTY: Self = Self {
        min: Vec3::splat(NOWHERE),
        max: Vec3::splat(-NOWHERE),
    };

    /// Smallest box around points.
    pub fn of_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    /// Smallest f32 box that holds the f64 box.
    pub fn rounded_outward(min: DVec3, max: DVec3) -> Self {
        Self {
            min: Vec3::from_array(min.to_array().map(round_down)),
            max: Vec3::from_array(max.to_array().map(|x| -round_down(-x))),
        }
    }

    /// True if nothing is inside.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// True if the boxes share a point.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// True if `other` lies inside; an empty box lies in any.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }

    /// Centre, metres; overflow-free for every legal coordinate.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Half the surface area in square metres, 0 if empty. In f64: f32 overflows from 1e19 m on and underflows early.
    pub fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let size = self.max.as_dvec3() - self.min.as_dvec3();
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Largest magnitude of a corner's coordinate, 0 if empty.
    pub fn max_magnitude(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        self.min.abs().max(self.max.abs()).max_element()
    }

    /// Enlarged by `units` rounding units of its own largest coordinate on each side.
    #[must_use]
    pub fn padded(&self, units: f64) -> Self {
        if self.is_empty() {
            return *self;
        }
        let pad = DVec3::splat(units * ROUNDING_UNIT * f64::from(self.max_magnitude()));
        Self::rounded_outward(self.min.as_dvec3() - pad, self.max.as_dvec3() + pad)
    }
}

/// Largest f32 that is not above `x`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_only_enlarges() {
        for x in [0.1, -0.1, 1e6 + 0.01, -1e6 - 0.03, 0.0, 1e-40, -1e-40] {
            let bounds = Bounds32::rounded_outward(DVec3::splat(x), DVec3::splat(x));
            assert!(f64::from(bounds.min.x) <= x && f64::from(bounds.max.x) >= x);
            assert!(f64::from(bounds.min.x.next_up().next_up()) > x || x.abs() < 1e-38);
        }
    }

    #[test]
    fn empty_stays_empty() {
        assert!(Bounds32::EMPTY.padded(16.0).is_empty());
        assert_eq!(Bounds32::EMPTY.half_area(), 0.0);
        let point = Bounds32::of_points([Vec3::ONE]);
        assert_eq!(Bounds32::EMPTY.union(&point), point);
        assert!(point.contains(&Bounds32::EMPTY));
        assert!(!Bounds32::EMPTY.contains(&point));
    }

    #[test]
    fn padding_contains_and_grows() {
        let bounds = Bounds32::of_points([Vec3::new(-3.0, 2.0, 1e3), Vec3::new(4.0, 2.0, 1e3)]);
        let padded = bounds.padded(PAD_UNITS);
        assert!(padded.contains(&bounds));
        assert!(padded.min.y < 2.0 && padded.max.y > 2.0);
        assert!(!bounds.contains(&padded));
    }
}
