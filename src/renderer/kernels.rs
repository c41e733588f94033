//! The kernels of a frame, compiled once for what the scene needs.

use std::collections::BTreeMap;

use crate::gpu::{GpuContext, GpuError, Kernel, ShaderFeatures, ShaderLibrary};
use crate::passes::{self, Over, Pass};

/// Compiled passes by name.
pub struct KernelSet {
    kernels: BTreeMap<&'static str, Kernel>,
    from_list: BTreeMap<&'static str, Kernel>,
}

impl KernelSet {
    /// Compiles `wanted`, and those of `filling` that run over pixels once more for the fill list. Passes that see the scene get
    /// `features`, the others none.
    ///
    /// # Errors
    /// [`GpuError::Shader`] or [`GpuError::Validation`], naming the pass.
    pub fn new(
        context: &GpuContext,
        library: &ShaderLibrary,
        features: &ShaderFeatures,
        wanted: &[&Pass],
        filling: &[&Pass],
    ) -> Result<Self, GpuError> {
        let mut set = Self {
            kernels: BTreeMap::new(),
            from_list: BTreeMap::new(),
        };
        for pass in wanted {
            let kernel = Kernel::new(
                context,
                library,
                &shader_name(pass),
                &specialised(pass, features, false),
            )?;
            set.kernels.insert(pass.name, kernel);
        }
        for pass in filling.iter().filter(|pass| pass.over == Over::Pixels) {
            let kernel = Kernel::new(
                context,
                library,
                &shader_name(pass),
                &specialised(pass, features, true),
            )?;
            set.from_list.insert(pass.name, kernel);
        }
        Ok(set)
    }

    /// The kernel of `pass` over its whole domain.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the set was compiled without it.
    pub fn get(&self, pass: &Pass) -> Result<&Kernel, GpuError> {
        find(&self.kernels, pass)
    }

    /// The kernel of `pass` for the right eye's empty pixels.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if the set was compiled without it.
    pub fn get_from_list(&self, pass: &Pass) -> Result<&Kernel, GpuError> {
        if pass.over == Over::Pixels {
            find(&self.from_list, pass)
        } else {
            find(&self.kernels, pass)
        }
    }

    /// Names of all compiled passes; those over the fill list carry `(list)`.
    pub fn names(&self) -> Vec<String> {
        let listed = self.from_list.keys().map(|name| format!("{name} (list)"));
        self.kernels
            .keys()
            .map(|name| (*name).to_owned())
            .chain(listed)
            .collect()
    }
}

fn find<'a>(
    kernels: &'a BTreeMap<&'static str, Kernel>,
    pass: &Pass,
) -> Result<&'a Kernel, GpuError> {
    kernels.get(pass.name).ok_or_else(|| GpuError::Unbound {
        pass: pass.name.to_owned(),
        binding: "any (the pass was not compiled for this frame)".to_owned(),
    })
}

/// Name of a pass's shader module.
pub fn shader_name(pass: &Pass) -> String {
    format!("passes/{}", pass.name)
}

/// Features that `pass` is compiled with in a scene of `features`.
pub fn specialised(pass: &Pass, features: &ShaderFeatures, from_list: bool) -> ShaderFeatures {
    let own = if pass.traces {
        *features
    } else {
        // Photons are read by others too.
        ShaderFeatures {
            record_texels: features.record_texels,
            ..ShaderFeatures::default()
        }
    };
    ShaderFeatures {
        from_list: pass.over == Over::Hits || (from_list && pass.over == Over::Pixels),
        inspects: pass.name == passes::inspect_surfaces::PASS.name,
        ..own
    }
}
