//! One compute pipeline, its bindings found by name.
//!
//! Binding layouts are read from the compiled shader through naga instead of being written twice. A resource that a
//! shader declares and nobody provides is an error that names pass and binding; what a specialised shader no longer
//! declares is not bound.

use wgpu::util::DeviceExt as _;

use super::context::{GpuContext, GpuError};
use super::shaders::{CompiledShader, ShaderLibrary};
use super::vulkan_interop::module_of_embedded;
use stereolux_base::features::ShaderFeatures;

/// Name of the uniform that is bound with a dynamic offset: it tells the dispatches of one pass apart.
pub const DISPATCH_BINDING: &str = "dispatch";
/// Distance of two entries of the dispatch table in bytes: the largest uniform offset alignment that wgpu knows.
pub const DISPATCH_STRIDE: u64 = 256;

/// Named resources that kernels choose from.
#[derive(Default, Clone)]
pub struct Resources<'a> {
    entries: Vec<(&'static str, wgpu::BindingResource<'a>)>,
}

impl<'a> Resources<'a> {
    /// No resources.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a whole buffer under the name that shaders declare. A later entry hides an earlier one of that name.
    #[must_use]
    pub fn with(mut self, name: &'static str, buffer: &'a wgpu::Buffer) -> Self {
        self.entries.push((name, buffer.as_entire_binding()));
        self
    }

    /// Adds a texture under the name that shaders declare.
    #[must_use]
    pub fn with_texture(mut self, name: &'static str, view: &'a wgpu::TextureView) -> Self {
        self.entries
            .push((name, wgpu::BindingResource::TextureView(view)));
        self
    }

    /// The resource of that name.
    pub fn get(&self, name: &str) -> Option<wgpu::BindingResource<'a>> {
        self.entries
            .iter()
            .rev()
            .find(|(entry, _)| *entry == name)
            .map(|(_, resource)| resource.clone())
    }
}

/// One binding that a shader declares.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// Name of the global variable.
    pub name: String,
    /// Slot in bind group 0.
    pub slot: u32,
    /// What it is.
    pub kind: BindingKind,
}

/// What a binding holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    /// Uniform buffer; the one called [`DISPATCH_BINDING`] has a dynamic offset.
    Uniform,
    /// Read-only storage buffer.
    Read,
    /// Storage buffer that is written.
    ReadWrite,
    /// Two-dimensional texture of four words a texel, read only.
    Texels,
}

/// What a pass is bound to.
pub struct Interface {
    /// Name of the pass: it labels the pipeline, the bind groups and the timestamps.
    pub name: String,
    /// Bindings in slot order.
    pub bindings: Vec<Binding>,
    layout: wgpu::BindGroupLayout,
}

/// A compute pipeline with one entry point, `main`, and one bind group.
pub struct Kernel {
    /// What it is bound to.
    pub interface: Interface,
    /// Threads of one workgroup.
    pub workgroup_size: [u32; 3],
    pipeline: wgpu::ComputePipeline,
    is_dynamic: bool,
}

/// Bindings of group 0 that `shader` declares, in slot order.
///
/// # Errors
/// [`GpuError::Shader`] for a binding outside group 0 or of a kind that no pass uses.
pub fn reflect_bindings(shader: &CompiledShader) -> Result<Vec<Binding>, GpuError> {
    let mut bindings = Vec::new();
    for (_, variable) in shader.module.global_variables.iter() {
        let Some(place) = variable.binding else {
            continue;
        };
        let name = variable.name.clone().unwrap_or_default();
        let kind = match variable.space {
            naga::AddressSpace::Uniform => BindingKind::Uniform,
            naga::AddressSpace::Storage { access } => {
                if access.contains(naga::StorageAccess::STORE) {
                    BindingKind::ReadWrite
                } else {
                    BindingKind::Read
                }
            }
            naga::AddressSpace::Handle
                if matches!(
                    shader.module.types[variable.ty].inner,
                    naga::TypeInner::Image {
                        dim: naga::ImageDimension::D2,
                        arrayed: false,
                        class: naga::ImageClass::Storage {
                            format: naga::StorageFormat::Rgba32Uint,
                            access: naga::StorageAccess::LOAD,
                        },
                    }
                ) =>
            {
                BindingKind::Texels
            }
            other => {
                return Err(GpuError::Shader {
                    shader: shader.name.clone(),
                    reason: format!("binding {name:?} in address space {other:?} is not supported"),
                });
            }
        };
        if place.group != 0 {
            return Err(GpuError::Shader {
                shader: shader.name.clone(),
                reason: format!("binding {name:?} is in group {}, not 0", place.group),
            });
        }
        bindings.push(Binding {
            name,
            slot: place.binding,
            kind,
        });
    }
    bindings.sort_by_key(|binding| binding.slot);
    Ok(bindings)
}

fn binding_type(binding: &Binding) -> wgpu::BindingType {
    let ty = match binding.kind {
        BindingKind::Uniform => wgpu::BufferBindingType::Uniform,
        BindingKind::Read => wgpu::BufferBindingType::Storage { read_only: true },
        BindingKind::ReadWrite => wgpu::BufferBindingType::Storage { read_only: false },
        BindingKind::Texels => {
            return wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::ReadOnly,
                format: wgpu::TextureFormat::Rgba32Uint,
                view_dimension: wgpu::TextureViewDimension::D2,
            };
        }
    };
    wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: binding.name == DISPATCH_BINDING,
        min_binding_size: None,
    }
}

/// Layouts of a group of bindings, each a slot, the stages that see it and what it is, and of pipelines that have it alone.
pub fn layouts(
    device: &wgpu::Device,
    label: &str,
    bindings: impl IntoIterator<Item = (u32, wgpu::ShaderStages, wgpu::BindingType)>,
) -> (wgpu::BindGroupLayout, wgpu::PipelineLayout) {
    let label = Some(label);
    let entry = |(binding, visibility, ty)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty,
        count: None,
    };
    let entries: Vec<_> = bindings.into_iter().map(entry).collect();
    let group = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label,
        entries: &entries,
    });
    let pipeline = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&group)],
        immediate_size: 0,
    });
    (group, pipeline)
}

impl Interface {
    /// Of a pass whose `bindings` the stages of `visibility` see; and a layout for its pipeline.
    pub(super) fn new(
        context: &GpuContext,
        pass: &str,
        bindings: Vec<Binding>,
        visibility: wgpu::ShaderStages,
    ) -> (Self, wgpu::PipelineLayout) {
        let entries = bindings
            .iter()
            .map(|binding| (binding.slot, visibility, binding_type(binding)));
        let (layout, pipeline_layout) = layouts(&context.device, pass, entries);
        let interface = Self {
            name: pass.to_owned(),
            bindings,
            layout,
        };
        (interface, pipeline_layout)
    }

    /// Binds what the shader declares from `resources`.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if a name is missing, [`GpuError::Validation`] if a resource does not fit.
    pub fn bind(
        &self,
        context: &GpuContext,
        resources: &Resources<'_>,
    ) -> Result<wgpu::BindGroup, GpuError> {
        self.bind_by(context, |binding| resources.get(&binding.name))
    }

    /// As [`Interface::bind`], with what `resource_of` finds for each binding.
    ///
    /// # Errors
    /// As [`Interface::bind`].
    pub fn bind_by<'a>(
        &self,
        context: &GpuContext,
        resource_of: impl Fn(&Binding) -> Option<wgpu::BindingResource<'a>>,
    ) -> Result<wgpu::BindGroup, GpuError> {
        let mut entries = Vec::with_capacity(self.bindings.len());
        for binding in &self.bindings {
            let mut resource = resource_of(binding).ok_or_else(|| GpuError::Unbound {
                pass: self.name.clone(),
                binding: binding.name.clone(),
            })?;
            if binding.name == DISPATCH_BINDING
                && let wgpu::BindingResource::Buffer(buffer) = &mut resource
            {
                buffer.size = wgpu::BufferSize::new(DISPATCH_STRIDE);
            }
            entries.push(wgpu::BindGroupEntry {
                binding: binding.slot,
                resource,
            });
        }
        context.guarded(&self.name, || {
            let descriptor = wgpu::BindGroupDescriptor {
                label: Some(&self.name),
                layout: &self.layout,
                entries: &entries,
            };
            Ok(context.device.create_bind_group(&descriptor))
        })
    }
}

/// Buffers among the bindings, uniforms too: what adapters limit per stage.
#[must_use]
pub fn buffer_count(bindings: &[Binding]) -> usize {
    let is_buffer = |binding: &&Binding| binding.kind != BindingKind::Texels;
    bindings.iter().filter(is_buffer).count()
}

/// Whether a stage that may have `limit` buffers takes these bindings.
fn check_buffers(pass: &str, bindings: &[Binding], limit: u32) -> Result<(), GpuError> {
    let count = buffer_count(bindings);
    if count > limit as usize {
        return Err(GpuError::TooManyBuffers {
            pass: pass.to_owned(),
            count,
            limit,
        });
    }
    Ok(())
}

impl Kernel {
    /// Compiles shader `name` of `library` with `features` and builds its pipeline.
    ///
    /// # Errors
    /// [`GpuError::Shader`] or [`GpuError::Validation`], with the pass's name.
    pub fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        name: &str,
        features: &ShaderFeatures,
    ) -> Result<Self, GpuError> {
        let shader = &library.compile(name, features)?;
        let pass = name.strip_prefix("passes/").unwrap_or(name);
        let bindings = reflect_bindings(shader)?;
        let workgroup_size = shader
            .module
            .entry_points
            .iter()
            .find(|entry| entry.name == "main")
            .map(|entry| entry.workgroup_size)
            .ok_or_else(|| GpuError::Shader {
                shader: shader.name.clone(),
                reason: "no entry point called main".to_owned(),
            })?;
        let limits = context.device.limits();
        let limit = limits.max_buffers_and_acceleration_structures_per_shader_stage;
        check_buffers(pass, &bindings, limit)?;
        context.count_made();
        context.guarded(pass, || {
            let device = &context.device;
            let (interface, pipeline_layout) =
                Interface::new(context, pass, bindings, wgpu::ShaderStages::COMPUTE);
            let bindings = &interface.bindings;
            let module = if shader.is_embedded {
                module_of_embedded(context, pass, shader, bindings)?
            } else {
                device.create_shader_module(shader.descriptor(pass))
            };
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(pass),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[],
                    // Every kernel writes its workgroup memory before reading it.
                    zero_initialize_workgroup_memory: false,
                },
                cache: context.pipeline_cache(),
            });
            Ok(Self {
                is_dynamic: bindings.iter().any(|b| b.name == DISPATCH_BINDING),
                interface,
                workgroup_size,
                pipeline,
            })
        })
    }

    /// Workgroups that cover `threads` threads along x in a 2D grid that keeps within the dimension limit.
    ///
    /// Kernels over lists get their index from `shaders/shared/invocation.wesl`.
    pub fn groups_for(&self, threads: u32) -> [u32; 3] {
        linear_groups(threads, self.workgroup_size[0])
    }

    pub(super) fn set<'p>(
        &self,
        pass: &mut wgpu::ComputePass<'p>,
        bound: &wgpu::BindGroup,
        dispatch_index: u32,
    ) {
        pass.set_pipeline(&self.pipeline);
        let offset = [dispatch_index * DISPATCH_STRIDE as u32];
        pass.set_bind_group(0, bound, if self.is_dynamic { &offset } else { &[] });
    }
}

/// Workgroups along x of a list kernel.
pub const ROW_GROUPS: u32 = 1024;

/// Splits `threads` into rows of [`ROW_GROUPS`] workgroups of `group` threads.
pub fn linear_groups(threads: u32, group: u32) -> [u32; 3] {
    let groups = threads.div_ceil(group);
    [groups.min(ROW_GROUPS), groups.div_ceil(ROW_GROUPS), 1]
}

/// The dispatch table: entry i holds the four words that the i-th dispatch of a pass sees.
pub struct DispatchTable {
    entries: Vec<[u32; 4]>,
    /// What passes bind.
    pub buffer: wgpu::Buffer,
}

impl DispatchTable {
    /// A table of `entries`: the one `before`, if there is one and it is large enough, for the submissions to come.
    pub fn holding(
        context: &GpuContext,
        label: &str,
        entries: Vec<[u32; 4]>,
        before: Option<Self>,
    ) -> Self {
        let before = match before {
            Some(table) if table.entries == entries => return table,
            other => other,
        };
        let stride = (DISPATCH_STRIDE / 4) as usize;
        let mut words = vec![0u32; entries.len().max(1) * stride];
        for (index, entry) in entries.iter().enumerate() {
            words[index * stride..index * stride + 4].copy_from_slice(entry);
        }
        let contents: &[u8] = bytemuck::cast_slice(&words);
        let fits = |table: &Self| table.buffer.size() >= contents.len() as u64;
        if let Some(Self { buffer, .. }) = before.filter(fits) {
            context.queue.write_buffer(&buffer, 0, contents);
            return Self { entries, buffer };
        }
        context.count_made();
        let descriptor = wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        };
        let buffer = context.device.create_buffer_init(&descriptor);
        Self { entries, buffer }
    }
}

#[cfg(test)]
mod tests {
    use super::{Binding, BindingKind, check_buffers};

    #[test]
    fn too_many_buffers_are_an_error_that_says_what_to_do() {
        let binding = |slot| Binding {
            name: format!("buffer {slot}"),
            slot,
            kind: BindingKind::Read,
        };
        let mut bindings: Vec<Binding> = (0..24).map(binding).collect();
        bindings.push(Binding {
            kind: BindingKind::Texels,
            ..binding(24)
        });
        assert!(check_buffers("eye_fused", &bindings, 24).is_ok());
        bindings.push(binding(25));
        let line = check_buffers("eye_fused", &bindings, 24).map_err(|error| error.to_string());
        assert!(
            line.is_err_and(
                |line| line.contains("eye_fused has 25 buffers") && line.contains("split")
            )
        );
    }
}
