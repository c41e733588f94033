//! Typed reads from buffers. Every count is held against the bytes that are really there, and what it expands to against
//! the load's budget, before memory is taken.

use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

use super::super::SceneError;
use super::document::Document;
use super::resources::Buffer;
use stereolux_base::limits::product;

/// What a number that is read takes, bytes: as f32, and as f64 or in a vector of a fixed size after that. Accessors may
/// overlap, and those without a buffer view hold zeros, so that no buffer bounds the sum.
const NUMBER_BYTES: u64 = 12;

/// Reads accessors of one document.
pub struct Reader<'a> {
    pub document: &'a Document<'a>,
    /// One per buffer of the document, cut to its declared length.
    pub buffers: &'a [Buffer<'a>],
}

/// Where an accessor's elements lie.
struct Layout<'a> {
    /// From the first element on; none for an accessor of zeros.
    data: Option<&'a [u8]>,
    stride: usize,
    count: usize,
    multiplicity: usize,
    component: ComponentType,
    normalized: bool,
    sparse: Option<&'a Sparse>,
}

impl<'a> Reader<'a> {
    /// Bytes of a buffer view.
    pub fn view(&self, index: usize, place: &str) -> Result<&'a [u8], SceneError> {
        let root = &self.document.root;
        let view = root.buffer_views.get(index).ok_or_else(|| {
            self.document.fault(format!(
                "{place}: buffer view {index} is out of range, there are {}",
                root.buffer_views.len()
            ))
        })?;
        let buffer_index = view.buffer.value();
        let buffer = self.buffers.get(buffer_index).ok_or_else(|| {
            self.document.fault(format!(
                "bufferViews[{index}]: buffer {buffer_index} is out of range, there are {}",
                self.buffers.len()
            ))
        })?;
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        let end = offset.checked_add(view.byte_length.0);
        end.and_then(|end| buffer.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)).ok_or_else(|| {
            self.document.fault(format!(
                "bufferViews[{index}]: bytes {offset} + {} lie outside buffer {buffer_index}, which has {} bytes",
                view.byte_length.0,
                buffer.len()
            ))
        })
    }

    fn fault(&self, index: usize, place: &str, what: &str) -> SceneError {
        let document = self.document;
        document.fault(format!("accessors[{index}] ({place}): {what}"))
    }

    fn layout(&self, index: usize, place: &str, matrices: bool) -> Result<Layout<'a>, SceneError> {
        let accessors = &self.document.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| {
            self.document.fault(format!(
                "{place}: accessor {index} is out of range, there are {}",
                accessors.len()
            ))
        })?;
        let fault = |what: &str| self.fault(index, place, what);
        let (Checked::Valid(component), Checked::Valid(kind)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(fault("unknown type"));
        };
        if matrices && (kind != Type::Mat4 || component.0 != ComponentType::F32) {
            return Err(fault("must hold 4x4 matrices of floats"));
        }
        if !matrices && matches!(kind, Type::Mat2 | Type::Mat3 | Type::Mat4) {
            return Err(fault("a matrix, where a scalar or vector belongs"));
        }
        let component = component.0;
        let multiplicity = kind.multiplicity();
        let element_size = component.size() * multiplicity;
        let count = accessor.count.0;
        if count == 0 {
            return Err(fault("count is 0; leave the accessor out instead"));
        }
        let mut layout = Layout {
            data: None,
            stride: element_size,
            count: count as usize,
            multiplicity,
            component,
            normalized: accessor.normalized,
            sparse: accessor.sparse.as_ref(),
        };
        let Some(view_index) = accessor.buffer_view else {
            return Ok(layout);
        };
        let view_index = view_index.value();
        let bytes = self.view(view_index, &format!("accessors[{index}]"))?;
        let stride = self.document.root.buffer_views[view_index]
            .byte_stride
            .map_or(element_size, |stride| stride.0);
        if stride < element_size {
            return Err(fault(&format!(
                "byteStride {stride} of bufferViews[{view_index}] is less than the element's {element_size} bytes"
            )));
        }
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        // Last byte needed: offset + (count - 1) * stride + element_size, in u128 so that nothing wraps.
        let needed =
            u128::from(offset) + u128::from(count - 1) * stride as u128 + element_size as u128;
        if needed > bytes.len() as u128 {
            return Err(fault(&format!(
                "{count} elements need {needed} bytes, bufferViews[{view_index}] has {}",
                bytes.len()
            )));
        }
        (layout.data, layout.stride) = (bytes.get(offset as usize..), stride);
        Ok(layout)
    }

    /// Number of an accessor's elements, which have their bytes in the buffer view, if there is one. Nothing is read.
    pub fn count_of(&self, index: usize, place: &str) -> Result<u64, SceneError> {
        Ok(self.layout(index, place, false)?.count as u64)
    }

    /// Reads an accessor as floats: `(components per element, values)`. Normalised integers are scaled (glTF 2.0,
    /// section 3.11), other integers are taken as they are (KHR_mesh_quantization), sparse values are put in.
    pub fn read_floats(
        &self,
        index: usize,
        allowed: &[usize],
        place: &str,
    ) -> Result<(usize, Vec<f32>), SceneError> {
        let layout = self.layout(index, place, false)?;
        if !allowed.contains(&layout.multiplicity) {
            let what = format!(
                "has {} components per element, {allowed:?} would fit",
                layout.multiplicity
            );
            return Err(self.fault(index, place, &what));
        }
        if layout.component == ComponentType::U32 {
            let what = "32-bit integers are allowed for indices only";
            return Err(self.fault(index, place, what));
        }
        let convert = |bytes: &[u8]| to_float(layout.component, layout.normalized, bytes);
        Ok((layout.multiplicity, self.read(index, &layout, convert)?))
    }

    /// Reads an accessor of 4x4 matrices, column by column.
    pub fn read_matrices(&self, index: usize, place: &str) -> Result<Vec<[f32; 16]>, SceneError> {
        let layout = self.layout(index, place, true)?;
        let convert = |bytes: &[u8]| to_float(layout.component, false, bytes);
        let values = self.read(index, &layout, convert)?;
        Ok(values.as_chunks::<16>().0.to_vec())
    }

    /// Reads an accessor of vertex indices.
    pub fn read_indices(&self, index: usize, place: &str) -> Result<Vec<u32>, SceneError> {
        let layout = self.layout(index, place, false)?;
        let is_index = matches!(
            layout.component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        );
        if layout.multiplicity != 1 || !is_index {
            return Err(self.fault(index, place, "indices must be unsigned scalars"));
        }
        self.read(index, &layout, |bytes| to_index(layout.component, bytes))
    }

    /// Reads an accessor's components, after asking for the memory of what it expands to, and puts in the substitutes of a
    /// sparse one (glTF 2.0, section 3.6.2.3).
    fn read<T: Default + Clone>(
        &self,
        index: usize,
        layout: &Layout<'_>,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let (count, multiplicity) = (layout.count, layout.multiplicity);
        let bytes = product(&[count as u64, multiplicity as u64, NUMBER_BYTES]);
        let place = format!("accessors[{index}]");
        self.document
            .take(bytes, &place, format_args!("{count} elements"))?;
        let component_size = layout.component.size();
        let element_size = component_size * multiplicity;
        let mut values = vec![T::default(); count * multiplicity];
        let mut put = |element: usize, bytes: &[u8]| {
            let slots = values[element * multiplicity..].iter_mut();
            for (slot, bytes) in slots.zip(bytes.chunks_exact(component_size)) {
                *slot = convert(bytes);
            }
        };
        if let Some(data) = layout.data {
            for element in 0..count {
                // In bounds: `layout` has compared the last byte with the view's length.
                put(element, &data[element * layout.stride..][..element_size]);
            }
        }
        let Some(sparse) = layout.sparse else {
            return Ok(values);
        };
        let place = format!("accessors[{index}].sparse");
        let Checked::Valid(index_component) = sparse.indices.component_type else {
            return Err(self
                .document
                .fault(format!("{place}.indices: unknown type")));
        };
        let index_component = index_component.0;
        let section =
            |view: usize, offset: u64, size: usize, what: &str| -> Result<&'a [u8], SceneError> {
                let bytes = self.view(view, &format!("{place}.{what}"))?;
                let needed = u128::from(offset) + u128::from(sparse.count.0) * size as u128;
                if needed > bytes.len() as u128 {
                    return Err(self.document.fault(format!(
                    "{place}.{what}: {} elements need {needed} bytes, bufferViews[{view}] has {}",
                    sparse.count.0,
                    bytes.len()
                )));
                }
                Ok(&bytes[offset as usize..needed as usize])
            };
        let targets = section(
            sparse.indices.buffer_view.value(),
            sparse.indices.byte_offset.0,
            index_component.size(),
            "indices",
        )?;
        let sources = section(
            sparse.values.buffer_view.value(),
            sparse.values.byte_offset.0,
            element_size,
            "values",
        )?;
        for (target, source) in targets
            .chunks_exact(index_component.size())
            .zip(sources.chunks_exact(element_size))
        {
            let target = to_index(index_component, target) as usize;
            if target >= count {
                return Err(self.document.fault(format!(
                    "{place}.indices: element {target} is out of range, there are {count}"
                )));
            }
            put(target, source);
        }
        Ok(values)
    }
}

fn to_float(component: ComponentType, normalized: bool, bytes: &[u8]) -> f32 {
    let scale = |value: f32, max: f32| {
        if normalized {
            (value / max).max(-1.0)
        } else {
            value
        }
    };
    match (component, bytes) {
        (ComponentType::I8, &[a]) => scale(f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => scale(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => scale(f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b]) => scale(f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => 0.0,
    }
}

fn to_index(component: ComponentType, bytes: &[u8]) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}
