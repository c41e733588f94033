//! Cards without the cards: Mesa's RADV compiles for a family named in the environment, on its null device.
//!
//! `unsafe`: every block here is calls of Vulkan. Their handles were made by the same device, are in use by nobody else and
//! are destroyed once, as each block shows; structures that are pointed to outlive the call.
#![allow(
    unsafe_code,
    reason = "Vulkan's calls; wgpu does not open RADV's null device"
)]

use std::collections::BTreeMap;
use std::ffi::{CStr, OsStr};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};
use ash::{khr, vk};
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use stereolux::gpu::kernel::{Binding, BindingKind, DISPATCH_BINDING};

/// Where Debian puts RADV's manifest.
const MANIFEST: &str = "/usr/share/vulkan/icd.d/radeon_icd.x86_64.json";

/// The argument that makes this program open a device and end.
pub const PROBE: &str = "--probe";

stereolux_base::words! {
    /// A generation of cards.
    #[derive(PartialOrd, Ord, ValueEnum, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Family: name {
        /// RDNA 2: Navi 21, RX 6800.
        Rdna2 = "rdna2",
        /// RDNA 3: Navi 31, RX 7900.
        Rdna3 = "rdna3",
    }
}

impl Family {
    /// Waves of 64 lanes that a SIMD unit holds, of 16: as many as fit into its registers (of AMD's instruction set
    /// references: 1,024 and 1,536 for 32 lanes), and whose groups fit into the 128 KiB of workgroup memory that four
    /// units share.
    pub fn waves(self, vgprs: u32, lds_bytes: u32, group_threads: u32) -> u32 {
        let registers = match self {
            Self::Rdna2 => 512,
            Self::Rdna3 => 768,
        };
        let by_registers = registers / vgprs.max(1);
        let groups = (128 << 10) / lds_bytes.max(1);
        let by_memory = groups
            .saturating_mul(group_threads.div_ceil(64))
            .div_ceil(4);
        by_registers.min(by_memory).min(16)
    }

    /// What `RADV_FORCE_FAMILY` calls it: Mesa 22's name, then that of later ones.
    fn forced_names(self) -> [&'static str; 2] {
        match self {
            Self::Rdna2 => ["navi21", "navi21"],
            Self::Rdna3 => ["gfx1100", "navi31"],
        }
    }
}

/// An open null device.
pub struct Card {
    /// Which.
    pub family: Family,
    /// What compiles for it.
    pub compiler: Compiler,
}

/// A device that compiles.
pub struct Compiler {
    /// Its name.
    pub device_name: String,
    /// Driver and version.
    pub driver: String,
    device: ash::Device,
    executables: khr::pipeline_executable_properties::Device,
    // Dropped last: they hold the library that the others call.
    _instance: ash::Instance,
    _entry: ash::Entry,
}

/// What the driver says of a compiled kernel, by the driver's own names.
pub type Statistics = BTreeMap<String, f64>;

fn text(raw: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = raw.iter().map(|c| *c as u8).collect();
    CStr::from_bytes_until_nul(&bytes).map_or_else(
        |_| String::new(),
        |text| text.to_string_lossy().into_owned(),
    )
}

impl Card {
    /// Opens the null device of `family`. Only for a process of one thread: the driver is told by the environment.
    pub fn open(family: Family) -> Result<Self> {
        let manifest = std::env::var_os("VK_DRIVER_FILES").unwrap_or_else(|| MANIFEST.into());
        for name in family.forced_names() {
            let told = [
                ("VK_DRIVER_FILES", manifest.as_os_str()),
                // What older loaders read.
                ("VK_ICD_FILENAMES", manifest.as_os_str()),
                ("MESA_SHADER_CACHE_DISABLE", OsStr::new("true")),
                ("RADV_FORCE_FAMILY", OsStr::new(name)),
            ];
            // A driver that does not know the name aborts: another process tries it.
            let mut probe = Command::new(std::env::current_exe()?);
            probe.arg(PROBE).envs(told).stderr(Stdio::null());
            if !probe.status()?.success() {
                continue;
            }
            for (variable, value) in told {
                // SAFETY: the program has not made a second thread yet (`main` opens cards first), so nobody reads the
                // environment meanwhile.
                unsafe { std::env::set_var(variable, value) };
            }
            let compiler = Compiler::open()?;
            return Ok(Self { family, compiler });
        }
        bail!(
            "no {} device: install Mesa's RADV (Debian: mesa-vulkan-drivers), or name its manifest in VK_DRIVER_FILES",
            family.name()
        )
    }

    /// Opens what the environment names; aborts where the driver does not know the name.
    pub fn probe() -> Result<()> {
        Compiler::open().map(drop)
    }
}

impl Compiler {
    /// Opens the loader's first device.
    pub fn open() -> Result<Self> {
        // SAFETY: the module's comment. The loader is the system's own; handles stay within what is returned.
        unsafe {
            let entry = ash::Entry::load()
                .context("no Vulkan loader: install libvulkan1 (Debian's name)")?;
            // RADV has rules by engine: wgpu's name, as wgpu-hal says it.
            let application = vk::ApplicationInfo::default()
                .engine_name(c"wgpu-hal")
                .api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry
                .create_instance(&info, None)
                .context("vkCreateInstance")?;
            let found = instance
                .enumerate_physical_devices()
                .context("vkEnumeratePhysicalDevices")?;
            let &physical = found.first().context("the driver has no device")?;
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            instance.get_physical_device_properties2(physical, &mut properties);
            let device_name = text(&properties.properties.device_name);
            let driver = format!(
                "{} {}",
                text(&driver.driver_name),
                text(&driver.driver_info)
            );
            let device = open_device(&instance, physical).context(
                "vkCreateDevice: the driver has to tell what kernels become (VK_KHR_pipeline_executable_properties) and to check bounds (VK_EXT_robustness2)",
            )?;
            let executables = khr::pipeline_executable_properties::Device::new(&instance, &device);
            Ok(Self {
                device_name,
                driver,
                device,
                executables,
                _instance: instance,
                _entry: entry,
            })
        }
    }

    /// Compiles SPIR-V whose entry point is `main` and whose bindings are numbered in the order of `bindings`.
    pub fn compile(&self, words: &[u32], bindings: &[Binding]) -> Result<Statistics> {
        let layout_bindings: Vec<_> = (0..)
            .zip(bindings)
            .map(|(slot, binding)| layout_binding(slot, binding))
            .collect();
        let set_info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&layout_bindings);
        let module_info = vk::ShaderModuleCreateInfo::default().code(words);
        let device = &self.device;
        // SAFETY: the module's comment; naga has validated the module that the words were written from.
        unsafe {
            let module = device.create_shader_module(&module_info, None)?;
            let sets = [device.create_descriptor_set_layout(&set_info, None)?];
            let layout_info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            let layout = device.create_pipeline_layout(&layout_info, None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(layout);
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            let statistics = match made {
                Ok(pipelines) => {
                    let statistics = self.statistics(pipelines[0]);
                    device.destroy_pipeline(pipelines[0], None);
                    statistics
                }
                Err((_, error)) => Err(error.into()),
            };
            device.destroy_pipeline_layout(layout, None);
            device.destroy_descriptor_set_layout(sets[0], None);
            device.destroy_shader_module(module, None);
            statistics
        }
    }

    fn statistics(&self, pipeline: vk::Pipeline) -> Result<Statistics> {
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
        let of = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
        let mut found = Statistics::new();
        // SAFETY: the module's comment; the pipeline was made with CAPTURE_STATISTICS. A statistic's format says which
        // member of the union the driver wrote.
        unsafe {
            let properties = self.executables.get_pipeline_executable_properties(&info)?;
            let property = properties.first().context("a pipeline without code")?;
            found.insert("subgroup".to_owned(), f64::from(property.subgroup_size));
            for statistic in self.executables.get_pipeline_executable_statistics(&of)? {
                use vk::PipelineExecutableStatisticFormatKHR as Format;
                let value = match statistic.format {
                    Format::BOOL32 => f64::from(statistic.value.b32),
                    Format::INT64 => statistic.value.i64 as f64,
                    Format::UINT64 => statistic.value.u64 as f64,
                    _ => statistic.value.f64,
                };
                found.insert(text(&statistic.name), value);
            }
        }
        Ok(found)
    }
}

/// # Safety
/// `physical` belongs to `instance`.
unsafe fn open_device(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
) -> ash::prelude::VkResult<ash::Device> {
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(0)
        .queue_priorities(&[1.0])];
    let extensions = [
        khr::pipeline_executable_properties::NAME.as_ptr(),
        ash::ext::robustness2::NAME.as_ptr(),
    ];
    // As wgpu-hal opens a device: bounds are checked by the driver.
    let core = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
    let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
        .pipeline_executable_info(true);
    let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default()
        .robust_buffer_access2(true)
        .robust_image_access2(true);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_features(&core)
        .enabled_extension_names(&extensions)
        .push_next(&mut executables)
        .push_next(&mut robustness);
    // SAFETY: the caller's promise, and the module's comment.
    unsafe { instance.create_device(physical, &info, None) }
}

fn layout_binding(slot: u32, binding: &Binding) -> vk::DescriptorSetLayoutBinding<'static> {
    let ty = match binding.kind {
        BindingKind::Uniform if binding.name == DISPATCH_BINDING => {
            vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC
        }
        BindingKind::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        BindingKind::Read | BindingKind::ReadWrite => vk::DescriptorType::STORAGE_BUFFER,
        BindingKind::Texels => vk::DescriptorType::STORAGE_IMAGE,
    };
    vk::DescriptorSetLayoutBinding::default()
        .binding(slot)
        .descriptor_type(ty)
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::COMPUTE)
}
