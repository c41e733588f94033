//! Shader sources: WESL modules under `shaders/`, specialised by feature and lowered to WGSL.
//!
//! Imports and `@if(feature)` conditions are resolved by the `wesl` crate. Names are not mangled, so that bindings
//! keep the names that the Rust side looks them up by; a name used twice is an error that naga reports.
//!
//! What was compiled is remembered, by module and by those features that it asked for: what was made of embedded sources
//! alone for the whole process, the rest for the library and its clones until a module is inserted.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use wesl::{CompileOptions, Feature, Features, ModulePath, NoMangler, ResolveError, Resolver};

use super::context::GpuError;
use stereolux_base::features::{ShaderFeatures, words_asked};
use stereolux_base::foreign_errors::one_line;

/// Names and sources, sorted by name.
static EMBEDDED: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shader_table.rs"));
/// What was made of embedded sources alone.
static COMPILED_EMBEDDED: Memo = Memo(Mutex::new(BTreeMap::new()));

/// A set of WESL modules: those embedded in the binary, with replacements and additions.
#[derive(Clone, Default)]
pub struct ShaderLibrary {
    /// Modules that are not as embedded, by name.
    changed: BTreeMap<String, Cow<'static, str>>,
    /// What was made of any of them.
    compiled: Arc<Memo>,
}

/// A specialised shader: plain WGSL and what naga makes of it.
pub struct CompiledShader {
    /// Name of the root module, such as `passes/gather`.
    pub name: String,
    /// The WGSL text that the driver gets.
    pub wgsl: String,
    /// The parsed module, for reflection.
    pub module: naga::Module,
    /// Whether every module that it is made of came with the program.
    pub is_embedded: bool,
}

/// Compiled shaders by the name of their root module.
#[derive(Default)]
struct Memo(Mutex<BTreeMap<String, Vec<Compiled>>>);

/// A compiled shader and what decided how it came out.
struct Compiled {
    /// Names of the modules that it was made of.
    modules: Vec<String>,
    /// Features that they ask for.
    asked: ShaderFeatures,
    /// Those of them that were on.
    on: ShaderFeatures,
    shader: Arc<CompiledShader>,
}

impl Memo {
    fn find(
        &self,
        name: &str,
        features: &ShaderFeatures,
        is_valid: impl Fn(&Compiled) -> bool,
    ) -> Option<Arc<CompiledShader>> {
        let compiled = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = compiled
            .get(name)?
            .iter()
            .find(|known| features.and(known.asked) == known.on && is_valid(known))?;
        Some(Arc::clone(&found.shader))
    }

    /// The shader that is in use from now on: another thread may have been faster.
    fn remember(&self, compiled: Compiled) -> Arc<CompiledShader> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_name = all.entry(compiled.shader.name.clone()).or_default();
        let is_same = |known: &&Compiled| (known.asked, known.on) == (compiled.asked, compiled.on);
        if let Some(known) = of_name.iter().find(is_same) {
            return Arc::clone(&known.shader);
        }
        let shader = Arc::clone(&compiled.shader);
        of_name.push(compiled);
        shader
    }
}

impl ShaderLibrary {
    /// The sources that were built into the binary.
    pub fn embedded() -> Self {
        Self::default()
    }

    /// The embedded sources with every `.wesl` file below `folder` put in place of its namesake.
    ///
    /// # Errors
    /// [`GpuError::Shader`] if a file cannot be read, or none is there.
    pub fn with_folder(folder: &Path) -> Result<Self, GpuError> {
        let mut library = Self::embedded();
        let refused = |path: &Path, reason: String| GpuError::Shader {
            shader: path.display().to_string(),
            reason,
        };
        let mut found = 0;
        for (name, _) in EMBEDDED {
            let path = folder.join(format!("{name}.wesl"));
            if path.is_file() {
                let source = std::fs::read_to_string(&path);
                let source = source.map_err(|error| refused(&path, error.to_string()))?;
                library.insert(name, source);
                found += 1;
            }
        }
        if found == 0 {
            let reason = "no folder with files like passes/taa.wesl".to_owned();
            return Err(refused(folder, reason));
        }
        Ok(library)
    }

    /// Adds a module, or replaces the one of that name. `name` is the path without extension, `shared/bsdf_user`.
    pub fn insert(&mut self, name: &str, source: impl Into<Cow<'static, str>>) {
        let source = source.into();
        if embedded_source(name) == Some(&source) {
            self.changed.remove(name);
        } else {
            self.changed.insert(name.to_owned(), source);
        }
        // Clones keep what they know.
        self.compiled = Arc::default();
    }

    /// Names and texts of all modules, sorted by name.
    pub fn sources(&self) -> impl Iterator<Item = (&str, &str)> {
        let mut sources: BTreeMap<&str, &str> = EMBEDDED.iter().copied().collect();
        let changed = self.changed.iter();
        sources.extend(changed.map(|(name, source)| (name.as_str(), source.as_ref())));
        sources.into_iter()
    }

    fn source(&self, name: &str) -> Option<&str> {
        let changed = self.changed.get(name).map(AsRef::as_ref);
        changed.or_else(|| embedded_source(name))
    }

    /// Specialises module `name` and parses the result. A library returns one and the same shader as often as it is asked
    /// for, and for all features that the shader's modules do not ask for.
    ///
    /// # Errors
    /// [`GpuError::Shader`] with the module's name and the compiler's words.
    #[doc(hidden)]
    pub fn compile(
        &self,
        name: &str,
        features: &ShaderFeatures,
    ) -> Result<Arc<CompiledShader>, GpuError> {
        if features.user_bsdf && !self.changed.contains_key("shared/bsdf_user") {
            // Without this its surfaces would silently be black.
            return Err(GpuError::Shader {
                shader: name.to_owned(),
                reason: "a material asks for a user's BSDF (Material::user_bsdf) and the shader library has none: add it \
                         with install_user_bsdfs"
                    .to_owned(),
            });
        }
        let is_changed = |module: &String| self.changed.contains_key(module);
        let is_embedded = |known: &Compiled| !known.modules.iter().any(is_changed);
        let known = COMPILED_EMBEDDED.find(name, features, is_embedded);
        if let Some(shader) = known.or_else(|| self.compiled.find(name, features, |_| true)) {
            return Ok(shader);
        }
        let compiled = self.compile_anew(name, features)?;
        let memo = if is_embedded(&compiled) {
            &COMPILED_EMBEDDED
        } else {
            &*self.compiled
        };
        Ok(memo.remember(compiled))
    }

    fn compile_anew(&self, name: &str, features: &ShaderFeatures) -> Result<Compiled, GpuError> {
        let fail = |reason: String| GpuError::Shader {
            shader: name.to_owned(),
            reason: one_line(&reason),
        };
        let flags = features.report(ShaderFeatures::ALL).into_iter();
        let options = CompileOptions {
            validate: false, // naga validates the result, in full
            features: Features {
                default: Feature::Error,
                flags: flags
                    .map(|(word, on)| (word.to_owned(), Feature::from(on)))
                    .collect(),
            },
            ..CompileOptions::default()
        };
        let root = ModulePath::from_path(format!("/{name}"));
        let lowered = wesl::compile(&root, &Modules(self), &NoMangler, &options)
            .map_err(|error| fail(error.to_string()))?;
        let wgsl = lowered.to_string();
        let module = naga::front::wgsl::parse_str(&wgsl)
            .map_err(|error| fail(error.emit_to_string(&wgsl)))?;
        let modules: Vec<String> = lowered.modules.iter().map(module_name).collect();
        let is_embedded = !modules
            .iter()
            .any(|module| self.changed.contains_key(module));
        let mut asked = ShaderFeatures::default();
        let sources = modules.iter().filter_map(|module| self.source(module));
        for word in sources.flat_map(words_asked) {
            // Other words were errors.
            if let Some(feature) = asked.by_word_mut(word) {
                *feature = true;
            }
        }
        Ok(Compiled {
            modules,
            asked,
            on: features.and(asked),
            shader: Arc::new(CompiledShader {
                name: name.to_owned(),
                wgsl,
                module,
                is_embedded,
            }),
        })
    }
}

fn embedded_source(name: &str) -> Option<&'static str> {
    let index = EMBEDDED.binary_search_by_key(&name, |(module, _)| module);
    index.ok().map(|index| EMBEDDED[index].1)
}

fn module_name(path: &ModulePath) -> String {
    path.components.join("/")
}

/// A library's sources as the compiler asks for them.
struct Modules<'a>(&'a ShaderLibrary);

impl Resolver for Modules<'_> {
    fn resolve_source<'b>(&'b self, path: &ModulePath) -> Result<Cow<'b, str>, ResolveError> {
        let own = Some(path).filter(|path| path.origin.is_absolute());
        let source = own.and_then(|path| self.0.source(&module_name(path)));
        source.map(Cow::Borrowed).ok_or_else(|| {
            ResolveError::ModuleNotFound(path.clone(), "not in the shader library".to_owned())
        })
    }
}

impl CompiledShader {
    /// For a device that is to read the text.
    pub fn descriptor<'a>(&'a self, label: &'a str) -> wgpu::ShaderModuleDescriptor<'a> {
        wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Wgsl(self.wgsl.as_str().into()),
        }
    }

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
