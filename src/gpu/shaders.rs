//! Shader sources: WESL modules under `shaders/`, specialised by feature and lowered to WGSL.
//!
//! Imports and `@if(feature)` conditions are resolved by the `wesl` crate. Names are not mangled, so that bindings
//! keep the names that the Rust side looks them up by; a name used twice is an error that naga reports.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use wesl::{CompileOptions, Feature, Features, ModulePath, NoMangler, VirtualResolver, Wesl};

use super::context::{GpuError, one_line};
use super::features::ShaderFeatures;

static EMBEDDED: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shader_table.rs"));

/// A set of WESL modules: those embedded in the binary, with replacements and additions.
#[derive(Clone)]
pub struct ShaderLibrary {
    sources: BTreeMap<String, Cow<'static, str>>,
}

/// A specialised shader: plain WGSL and what naga makes of it.
pub struct CompiledShader {
    /// Name of the root module, such as `passes/gather`.
    pub name: String,
    /// The WGSL text that the driver gets.
    pub wgsl: String,
    /// The parsed module, for reflection.
    pub module: naga::Module,
}

impl ShaderLibrary {
    /// The sources that were built into the binary.
    pub fn embedded() -> Self {
        Self {
            sources: EMBEDDED
                .iter()
                .map(|&(name, source)| (name.to_owned(), Cow::Borrowed(source)))
                .collect(),
        }
    }

    /// The embedded sources with every `.wesl` file below `folder` put in place of its namesake.
    ///
    /// # Errors
    /// [`GpuError::Shader`] if a file cannot be read.
    pub fn with_folder(folder: &Path) -> Result<Self, GpuError> {
        let mut library = Self::embedded();
        let names: Vec<String> = library.sources.keys().cloned().collect();
        for name in names {
            let path = folder.join(format!("{name}.wesl"));
            if path.is_file() {
                let source = std::fs::read_to_string(&path).map_err(|error| GpuError::Shader {
                    shader: path.display().to_string(),
                    reason: error.to_string(),
                })?;
                library.insert(&name, source);
            }
        }
        Ok(library)
    }

    /// Adds a module, or replaces the one of that name. `name` is the path without extension, `shared/bsdf_user`.
    pub fn insert(&mut self, name: &str, source: impl Into<Cow<'static, str>>) {
        self.sources.insert(name.to_owned(), source.into());
    }

    /// Names of all modules, sorted.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.keys().map(String::as_str)
    }

    fn is_as_embedded(&self, name: &str) -> bool {
        let embedded = EMBEDDED.iter().find(|(module, _)| *module == name);
        embedded.is_some_and(|(_, source)| self.sources.get(name).is_some_and(|s| s == source))
    }

    /// Names and texts of all modules, sorted by name.
    pub fn sources(&self) -> impl Iterator<Item = (&str, &str)> {
        self.sources
            .iter()
            .map(|(name, source)| (name.as_str(), source.as_ref()))
    }

    /// Specialises module `name` and parses the result.
    ///
    /// # Errors
    /// [`GpuError::Shader`] with the module's name and the compiler's words.
    pub fn compile(
        &self,
        name: &str,
        features: &ShaderFeatures,
    ) -> Result<CompiledShader, GpuError> {
        let fail = |reason: String| GpuError::Shader {
            shader: name.to_owned(),
            reason: one_line(&reason),
        };
        let wants_user_bsdf = features.user_bsdf;
        if wants_user_bsdf && self.is_as_embedded("shared/bsdf_user") {
            // Without this its surfaces would silently be black.
            return Err(fail(
                "a material asks for a user's BSDF (Material::user_bsdf) and the shader library has none: add it with \
                 install_user_bsdfs"
                    .to_owned(),
            ));
        }
        let mut resolver = VirtualResolver::new();
        for (module, source) in &self.sources {
            resolver.add_module(module_path(module), Cow::Borrowed(source.as_ref()));
        }
        let mut compiler = Wesl::new_barebones().set_custom_resolver(resolver);
        compiler.set_options(CompileOptions {
            validate: false, // naga validates the result, in full
            features: Features {
                default: Feature::Error,
                flags: features
                    .report(ShaderFeatures::ALL)
                    .into_iter()
                    .map(|(word, on)| (word.to_owned(), Feature::from(on)))
                    .collect(),
            },
            ..CompileOptions::default()
        });
        compiler.set_custom_mangler(NoMangler);
        let wgsl = compiler
            .compile(&module_path(name))
            .map_err(|error| fail(error.to_string()))?
            .to_string();
        let module = naga::front::wgsl::parse_str(&wgsl)
            .map_err(|error| fail(error.emit_to_string(&wgsl)))?;
        Ok(CompiledShader {
            name: name.to_owned(),
            wgsl,
            module,
        })
    }
}

fn module_path(name: &str) -> ModulePath {
    ModulePath::from_path(format!("/{name}"))
}

impl CompiledShader {
    /// Runs naga's validator, for tests and for reloading: the driver is not needed.
    ///
    /// # Errors
    /// [`GpuError::Shader`] with the validator's words.
    pub fn validate(&self) -> Result<naga::valid::ModuleInfo, GpuError> {
        naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::default(),
        )
        .validate(&self.module)
        .map_err(|error| GpuError::Shader {
            shader: self.name.clone(),
            reason: one_line(&error.emit_to_string(&self.wgsl)),
        })
    }
}
