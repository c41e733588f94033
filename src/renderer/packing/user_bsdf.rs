//! A user's own BSDF: one shader file and one entry here.
//!
//! The shader file defines `NAME_eval`, `NAME_pdf` and `NAME_sample` (signatures in `shaders/shared/bsdf_user.wesl`).
//! [`install_user_bsdfs`] adds the files to the shader library and puts a generated switch in place of the stub module
//! `shared/bsdf_user`. Materials choose a BSDF by its number in [`crate::scene::Material::user_bsdf`]: the first that
//! is registered is 1. Passes are then compiled with the feature `user_bsdf`. `examples/user_bsdf` has a
//! complete one.

use std::fmt::Write as _;

use crate::gpu::shaders::ShaderLibrary;
use crate::scene::Material;

use super::PackError;

/// Modules of users' BSDFs.
const FOLDER: &str = "user/";

/// A scattering model that a user adds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UserBsdf {
    /// Prefix of its three functions: a WGSL identifier.
    pub name: String,
    /// WESL source that defines them.
    pub source: String,
}

impl UserBsdf {
    /// A model whose functions are called `NAME_eval`, `NAME_pdf` and `NAME_sample`; [`install_user_bsdfs`] checks that
    /// they are there.
    pub fn new(name: impl Into<String>, source: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            source: source.into(),
        }
    }

    fn module(&self) -> String {
        format!("{FOLDER}{}", self.name)
    }

    fn check(&self) -> Result<(), PackError> {
        let fail = |reason: &str| {
            Err(PackError::UserBsdf {
                name: self.name.clone(),
                reason: reason.to_owned(),
            })
        };
        let mut letters = self.name.chars();
        let starts_well = letters.next().is_some_and(|c| c.is_ascii_alphabetic());
        if !starts_well || !letters.all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return fail(
                "a name is ASCII letters, digits and underscores, and begins with a letter",
            );
        }
        for function in ["eval", "pdf", "sample"] {
            if !self
                .source
                .contains(&format!("fn {}_{function}(", self.name))
            {
                return fail(&format!(
                    "its source defines no fn {}_{function}(...)",
                    self.name
                ));
            }
        }
        Ok(())
    }
}

/// Adds users' BSDFs to a library. Number 1 is the first.
///
/// # Errors
/// [`PackError::UserBsdf`] for a name that is no identifier or is there twice, or a missing function.
pub fn install_user_bsdfs(
    library: &mut ShaderLibrary,
    bsdfs: &[UserBsdf],
) -> Result<(), PackError> {
    for (index, bsdf) in bsdfs.iter().enumerate() {
        bsdf.check()?;
        if bsdfs[..index].iter().any(|other| other.name == bsdf.name) {
            return Err(PackError::UserBsdf {
                name: bsdf.name.clone(),
                reason: "registered twice".to_owned(),
            });
        }
    }
    for bsdf in bsdfs {
        library.insert(&bsdf.module(), bsdf.source.clone());
    }
    library.insert("shared/bsdf_user", user_bsdf_dispatch(bsdfs));
    Ok(())
}

/// Checks that `library` holds the BSDFs of all `materials`: the shaders' switch has no other answer to a number without a
/// model than black.
///
/// # Errors
/// [`PackError::UserBsdfMissing`] names the first material whose BSDF is not there.
pub fn check_user_bsdfs(library: &ShaderLibrary, materials: &[Material]) -> Result<(), PackError> {
    let installed = library
        .sources()
        .filter(|(name, _)| name.starts_with(FOLDER))
        .count() as u32;
    let beyond = |material: &&Material| material.user_bsdf > installed;
    match materials.iter().find(beyond) {
        Some(material) => Err(PackError::UserBsdfMissing {
            material: material.name.clone(),
            number: material.user_bsdf,
            installed,
        }),
        None => Ok(()),
    }
}

/// The module `shared/bsdf_user` for these BSDFs: imports and three switches over `b.user`.
pub fn user_bsdf_dispatch(bsdfs: &[UserBsdf]) -> String {
    let mut text =
        String::from("import package::shared::bsdf_types::{Bsdf, BsdfSample, bsdf_no_sample};\n");
    for UserBsdf { name, .. } in bsdfs {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "import package::user::{name}::{{{name}_eval, {name}_pdf, {name}_sample}};"
        );
    }
    for (function, argument, result, default) in [
        ("eval", "wi: vec3f", "vec3f", "vec3f(0.0)"),
        ("pdf", "wi: vec3f", "f32", "0.0"),
        ("sample", "u: vec3f", "BsdfSample", "bsdf_no_sample()"),
    ] {
        let passed = &argument[..argument.find(':').unwrap_or(argument.len())];
        let _ = writeln!(
            text,
            "\nfn user_bsdf_{function}(b: Bsdf, wo: vec3f, {argument}) -> {result} {{"
        );
        let _ = writeln!(text, "    switch b.user {{");
        for (index, UserBsdf { name, .. }) in bsdfs.iter().enumerate() {
            let number = index + 1;
            let _ = writeln!(
                text,
                "        case {number}u: {{ return {name}_{function}(b, wo, {passed}); }}"
            );
        }
        let _ = writeln!(text, "        default: {{ return {default}; }}\n    }}\n}}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bsdf(name: &str) -> UserBsdf {
        UserBsdf {
            name: name.to_owned(),
            source: format!("fn {name}_eval( fn {name}_pdf( fn {name}_sample("),
        }
    }

    #[test]
    fn numbers_count_from_one() {
        let text = user_bsdf_dispatch(&[bsdf("sheen"), bsdf("cloth")]);
        assert!(text.contains("case 1u: { return sheen_eval(b, wo, wi); }"));
        assert!(text.contains("case 2u: { return cloth_sample(b, wo, u); }"));
    }

    #[test]
    fn bad_names_and_missing_functions_are_errors() {
        let mut library = ShaderLibrary::embedded();
        for bad in ["", "1st", "a b", "sh\u{e9}en"] {
            assert!(
                install_user_bsdfs(&mut library, &[bsdf(bad)]).is_err(),
                "{bad}"
            );
        }
        assert!(install_user_bsdfs(&mut library, &[bsdf("a"), bsdf("a")]).is_err());
        let incomplete = UserBsdf {
            name: "sheen".to_owned(),
            source: "fn sheen_eval(".to_owned(),
        };
        let error = install_user_bsdfs(&mut library, &[incomplete]).unwrap_err();
        assert!(error.to_string().contains("sheen_pdf"), "{error}");
        assert!(install_user_bsdfs(&mut library, &[bsdf("sheen")]).is_ok());
    }
}
