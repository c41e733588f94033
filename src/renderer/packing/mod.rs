//! Packing of a [`crate::scene::Scene`] into the arrays that shaders read. Nothing here calls the GPU.
//!
//! | array (binding name) | made by |
//! |---|---|
//! | `materials` | [`pack_materials`] |
//! | `texture_infos`, `texels` | [`pack_textures`] |
//! | `vertices` | [`pack_vertices`] |
//! | `environment_map`, `environment_cdf` | [`pack_environment`] |
//! | `lights`, `light_alias` | [`pack_lights`] |
//! | the module `shared/bsdf_user` | [`install_user_bsdfs`] |

mod environment;
mod lights;
mod materials;
mod mips;
mod textures;
mod user_bsdf;
mod vertices;

pub use environment::{PackedEnvironment, pack_environment};
pub use lights::{
    LightKinds, LightSources, LightUploads, PackedLights, SceneBox, emitter_ordinals, mean_glow,
    pack_lights, spot_falloff, spot_solid_angle,
};
pub use materials::pack_materials;
pub use mips::{Averaging, alpha_of_normals};
pub use textures::{PackedTextures, image_levels, pack_textures, sample_image};
pub use user_bsdf::{UserBsdf, check_user_bsdfs, install_user_bsdfs, user_bsdf_dispatch};
pub use vertices::pack_vertices;

use crate::renderer::records::material::MOST_MATERIALS;

/// A scene that cannot be packed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PackError {
    /// The images do not fit into one binding.
    #[error(
        "textures need {bytes} bytes ({images} images), but at most {budget} bytes can be bound; \
         {without_levels}scale the largest image down ({largest}) or choose another --adapter"
    )]
    TexturesTooLarge {
        /// Bytes of all images that materials in use refer to.
        bytes: u64,
        /// How many images these are.
        images: usize,
        /// What can be bound.
        budget: u64,
        /// What to do where coarser levels are among the bytes, else empty.
        without_levels: &'static str,
        /// Name and size of the largest image.
        largest: String,
    },
    /// More materials than a ray can tell apart.
    #[error(
        "{count} materials are too many: at most {MOST_MATERIALS} fit; merge those that are alike"
    )]
    TooManyMaterials {
        /// How many there are.
        count: usize,
    },
    /// A material asks for a user's BSDF that was not added.
    #[error(
        "material {material:?} uses user BSDF number {number}, but the shader library holds {installed}: \
         add them all, in the order of their numbers, with install_user_bsdfs"
    )]
    UserBsdfMissing {
        /// The material's name.
        material: String,
        /// The number that it asks for, from 1.
        number: u32,
        /// How many the library holds.
        installed: u32,
    },
    /// A user's BSDF cannot be named in a shader.
    #[error("user BSDF {name:?}: {reason}")]
    UserBsdf {
        /// The name that was registered.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
}
