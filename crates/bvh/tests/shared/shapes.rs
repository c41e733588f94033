//! Random numbers, and triangles made of them.

use glam::{DQuat, DVec3, Vec3};
use stereolux_base::random;
use stereolux_bvh::MeshTriangle;

/// Random numbers and what is made of them.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        random::bits(&mut self.0)
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    pub fn unit(&mut self) -> f64 {
        random::unit(&mut self.0)
    }

    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.vector();
            if v.length() > 0.1 && v.length() < 1.0 {
                return v.normalize();
            }
        }
    }

    pub fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), 6.3 * self.unit())
    }

    /// Uniform on a triangle: weights of its second and third vertex.
    pub fn weights(&mut self) -> [f32; 2] {
        let (root, v) = (self.unit().sqrt(), self.unit());
        [(root * (1.0 - v)) as f32, (root * v) as f32]
    }
}

/// Small random triangles in a cube of side 2.
pub fn soup(random: &mut Random, count: usize, size: f64) -> Vec<[Vec3; 3]> {
    let triangle = |_| {
        let center = random.vector();
        [(); 3].map(|()| (center + size * random.vector()).as_vec3())
    };
    (0..count).map(triangle).collect()
}

/// The vertices and triangles of a mesh in which nothing is shared.
pub fn unshared(triangles: &[[Vec3; 3]]) -> (Vec<[f32; 3]>, Vec<MeshTriangle>) {
    let positions = triangles.as_flattened().iter().map(Vec3::to_array);
    let triangles = (0..triangles.len() as u32).map(|i| MeshTriangle {
        vertices: [3 * i, 3 * i + 1, 3 * i + 2],
        material: 0,
    });
    (positions.collect(), triangles.collect())
}
