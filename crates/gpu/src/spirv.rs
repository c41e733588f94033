//! SPIR-V of kernels: what naga writes of them for a Vulkan 1.3 device whose driver checks bounds of buffers (robustness2).
//! `crates/isa` compiles the same words for cards that are not there.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};

use super::context::GpuError;
use super::kernel::Binding;
use super::shaders::CompiledShader;
use stereolux_base::foreign_errors::one_line;

/// The module of `shader` with its entry point `main`; `bindings` in order of their slots have the numbers 0, 1, ... that wgpu
/// gives to what a layout lists.
///
/// Differs from what WGSL says in two things. Loops are not counted: naga would end each by force after 2^64 turns, which costs
/// an eighth of a gather's time on an H200. Private arrays hold anything before they are written: setting a ray's stack to zero
/// is 288 bytes of memory for every thread.
///
/// # Errors
/// [`GpuError::Shader`] with naga's words.
pub fn module_words(shader: &CompiledShader, bindings: &[Binding]) -> Result<Vec<u32>, GpuError> {
    let info = shader.validate()?;
    let numbered = (0..).zip(bindings).map(|(number, binding)| {
        let place = naga::ResourceBinding {
            group: 0,
            binding: binding.slot,
        };
        let given = spv::BindingInfo {
            descriptor_set: 0,
            binding: number,
            binding_array_size: None,
        };
        (place, given)
    });
    let options = spv::Options {
        lang_version: (1, 6),
        flags: spv::WriterFlags::empty(),
        binding_map: numbered.collect(),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        // Every kernel writes its workgroup memory before reading it.
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        emit_int_div_checks: true,
        ..spv::Options::default()
    };
    let entry = spv::PipelineOptions {
        shader_stage: naga::ShaderStage::Compute,
        entry_point: "main".to_owned(),
    };
    let written = spv::write_vec(&shader.module, &info, &options, Some(&entry));
    let words = written.map_err(|error| GpuError::Shader {
        shader: shader.name.clone(),
        reason: one_line(&error.to_string()),
    })?;
    Ok(without_array_initialisers(&words))
}

// Numbers of the SPIR-V specification, sections 3.7 and 3.52.
const HEADER_WORDS: usize = 5;
const TYPE_ARRAY: u32 = 28;
const TYPE_POINTER: u32 = 32;
const VARIABLE: u32 = 59;
const PRIVATE: u32 = 6;

/// The instructions of a module: opcode and words.
fn instructions(words: &[u32]) -> impl Iterator<Item = (u32, &[u32])> {
    let mut rest = words.get(HEADER_WORDS..).unwrap_or_default();
    std::iter::from_fn(move || {
        let first = *rest.first()?;
        let (instruction, after) = rest.split_at_checked(((first >> 16) as usize).max(1))?;
        rest = after;
        Some((first & 0xffff, instruction))
    })
}

/// The module without the values that its private variables begin with, where they are arrays.
fn without_array_initialisers(words: &[u32]) -> Vec<u32> {
    let mut arrays = Vec::new();
    let mut pointers_to_arrays = Vec::new();
    let mut left = words[..HEADER_WORDS.min(words.len())].to_vec();
    for (opcode, instruction) in instructions(words) {
        match (opcode, instruction) {
            (TYPE_ARRAY, [_, ty, ..]) => arrays.push(*ty),
            (TYPE_POINTER, [_, ty, PRIVATE, pointee]) if arrays.contains(pointee) => {
                pointers_to_arrays.push(*ty);
            }
            (VARIABLE, [_, ty, id, PRIVATE, _]) if pointers_to_arrays.contains(ty) => {
                left.extend([(4 << 16) | VARIABLE, *ty, *id, PRIVATE]);
                continue;
            }
            _ => {}
        }
        left.extend_from_slice(instruction);
    }
    left
}

#[cfg(test)]
mod tests {
    use super::{PRIVATE, VARIABLE, instructions, module_words};
    use crate::features::ShaderFeatures;
    use crate::kernel::reflect_bindings;
    use crate::shaders::ShaderLibrary;

    /// Words of each private variable of an embedded pass.
    fn private_variables(pass: &str) -> Vec<usize> {
        let shader = ShaderLibrary::embedded()
            .compile(pass, &ShaderFeatures::default())
            .unwrap();
        let words = module_words(&shader, &reflect_bindings(&shader).unwrap()).unwrap();
        let variables = instructions(&words)
            .filter(|(opcode, words)| *opcode == VARIABLE && words.get(3) == Some(&PRIVATE));
        variables.map(|(_, words)| words.len()).collect()
    }

    #[test]
    fn private_arrays_begin_with_anything() {
        assert_eq!(
            private_variables("passes/first_hits"),
            [4],
            "the stack of rays"
        );
        assert_eq!(private_variables("passes/taa"), [0; 0]);
    }
}
