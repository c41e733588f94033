//! A primitive's attributes and triangles, read and checked.

use gltf::json::mesh::{Mode, Semantic};

use super::{PrimitiveData, PrimitiveImport};
use crate::SceneError;

impl PrimitiveImport<'_, '_> {
    /// Reads and checks.
    pub(super) fn read(&mut self, mode: Mode) -> Result<PrimitiveData, SceneError> {
        let Some(positions) = self.attribute::<3>(&Semantic::Positions, None)? else {
            return Err(self.fault("has no POSITION"));
        };
        let count = positions.len();
        let indices = match self.primitive.indices {
            Some(accessor) => {
                let place = format!("{}.indices", self.place);
                let indices = self.reader.read_indices(accessor.value(), &place)?;
                if let Some(at) = indices.iter().position(|index| *index as usize >= count) {
                    return Err(self.fault(&format!(
                        "index {at} names vertex {}, there are {count}",
                        indices[at]
                    )));
                }
                indices
            }
            None => (0..u32::try_from(count).map_err(|_| self.fault("has too many vertices"))?)
                .collect(),
        };
        let triangles = self.triangles_of(mode, &indices);
        let normals = self.attribute::<3>(&Semantic::Normals, Some(count))?;
        // glTF 2.0, section 3.7.2.1: without normals, tangents must be ignored.
        let tangents = if normals.is_some() {
            self.attribute::<4>(&Semantic::Tangents, Some(count))?
        } else {
            None
        };
        Ok(PrimitiveData {
            normals,
            tangents,
            uv0: self.attribute::<2>(&Semantic::TexCoords(0), Some(count))?,
            uv1: self.attribute::<2>(&Semantic::TexCoords(1), Some(count))?,
            colors: self.colors(count)?,
            joints: self.joints(count)?,
            targets: self.targets(count)?,
            positions,
            triangles,
        })
    }

    /// Reads an attribute of `N` floats; every value must be finite, and there must be `count` of them.
    pub(super) fn attribute<const N: usize>(
        &self,
        semantic: &Semantic,
        count: Option<usize>,
    ) -> Result<Option<Vec<[f32; N]>>, SceneError> {
        let Some(accessor) = self.accessor_of(semantic.clone()) else {
            return Ok(None);
        };
        self.check_count(accessor, semantic, count)?;
        let place = format!("{}.{}", self.place, semantic.to_string());
        let (_, values) = self.reader.read_floats(accessor, &[N], &place)?;
        let (elements, _) = values.as_chunks::<N>();
        self.check(elements, semantic)?;
        Ok(Some(elements.to_vec()))
    }

    fn colors(&self, count: usize) -> Result<Option<Vec<[f32; 4]>>, SceneError> {
        let semantic = Semantic::Colors(0);
        let Some(accessor) = self.accessor_of(semantic.clone()) else {
            return Ok(None);
        };
        self.check_count(accessor, &semantic, Some(count))?;
        let place = format!("{}.COLOR_0", self.place);
        let (components, values) = self.reader.read_floats(accessor, &[3, 4], &place)?;
        let colors: Vec<[f32; 4]> = values
            .chunks_exact(components)
            .map(|color| {
                [
                    color[0],
                    color[1],
                    color[2],
                    color.get(3).copied().unwrap_or(1.0),
                ]
            })
            .collect();
        self.check(&colors, &semantic)?;
        Ok(Some(
            colors
                .into_iter()
                .map(|color| color.map(|channel| channel.clamp(0.0, 1.0)))
                .collect(),
        ))
    }

    /// Checks that an accessor has an element for every vertex, before it is read.
    pub(super) fn check_count(
        &self,
        accessor: usize,
        semantic: &Semantic,
        count: Option<usize>,
    ) -> Result<(), SceneError> {
        let place = format!("{}.{}", self.place, semantic.to_string());
        let found = self.reader.count_of(accessor, &place)?;
        match count.filter(|count| *count as u64 != found) {
            Some(count) => Err(self.fault(&format!(
                "{} has {found} elements, POSITION has {count}",
                semantic.to_string()
            ))),
            None => Ok(()),
        }
    }

    pub(super) fn check<const N: usize>(
        &self,
        elements: &[[f32; N]],
        semantic: &Semantic,
    ) -> Result<(), SceneError> {
        match elements
            .iter()
            .position(|element| element.iter().any(|value| !value.is_finite()))
        {
            Some(at) => Err(self.fault(&format!(
                "{} of vertex {at} is not finite: {:?}",
                semantic.to_string(),
                elements[at]
            ))),
            None => Ok(()),
        }
    }

    /// Lists, strips and fans as a list (glTF 2.0, section 3.7.2.1).
    fn triangles_of(&mut self, mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
        match mode {
            Mode::TriangleStrip => indices
                .windows(3)
                .enumerate()
                .map(|(at, corners)| {
                    if at % 2 == 0 {
                        [corners[0], corners[1], corners[2]]
                    } else {
                        [corners[0], corners[2], corners[1]]
                    }
                })
                .collect(),
            Mode::TriangleFan => indices
                .first()
                .map(|hub| {
                    indices[1..]
                        .windows(2)
                        .map(|rim| [rim[0], rim[1], *hub])
                        .collect()
                })
                .unwrap_or_default(),
            _ => {
                let (triangles, rest) = indices.as_chunks::<3>();
                if !rest.is_empty() {
                    self.notes.warn(format_args!(
                        "{}: {} indices after the last whole triangle are ignored",
                        self.place,
                        rest.len()
                    ));
                }
                triangles.to_vec()
            }
        }
    }
}
