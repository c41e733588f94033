//! Shader features: the words that shaders ask for in `@if(...)`, each said once.
//!
//! One table gives the fields of [`PerFeature`], their words and their meanings. [`ShaderFeatures`] says of each whether it is
//! on. A shader that asks for another word does not compile.

use std::collections::BTreeMap;

/// Who decides on a feature, in the order in which they do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DecidedBy {
    /// What the scene needs, and `force.*`.
    Scene,
    /// Settings.
    Settings,
    /// The renderer, who knows eyes and session too.
    Renderer,
    /// Each pass for itself.
    Pass,
}

macro_rules! features {
    ($($decided_by:ident { $($word:ident: $meaning:literal,)+ })+) => {
        /// One value for each shader feature. Its fields are called as the shaders call the feature.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct PerFeature<T> {
            $($(
                #[doc = concat!("For ", $meaning, ".")]
                pub $word: T,
            )+)+
        }

        /// The words by which shaders ask.
        pub const WORDS: PerFeature<&'static str> = PerFeature { $($($word: stringify!($word),)+)+ };
        /// What each feature is, for messages.
        pub const MEANINGS: PerFeature<&'static str> = PerFeature { $($($word: $meaning,)+)+ };
        /// Who decides on each feature.
        pub const DECIDED_BY: PerFeature<DecidedBy> =
            PerFeature { $($($word: DecidedBy::$decided_by,)+)+ };

        impl<T> PerFeature<T> {
            /// The values in the table's order.
            pub fn into_values(self) -> impl Iterator<Item = T> {
                [$($(self.$word,)+)+].into_iter()
            }

            /// Both tables' values, feature by feature, made into one.
            #[must_use]
            pub fn zip<U, V>(self, other: PerFeature<U>, make: impl Fn(T, U) -> V) -> PerFeature<V> {
                PerFeature { $($($word: make(self.$word, other.$word),)+)+ }
            }

            /// The value by a word that comes from a text; `None` if the table does not know it.
            pub fn by_word_mut(&mut self, word: &str) -> Option<&mut T> {
                match word {
                    $($(stringify!($word) => Some(&mut self.$word),)+)+
                    _ => None,
                }
            }
        }

        impl ShaderFeatures {
            /// Every feature on.
            pub const ALL: Self = PerFeature { $($($word: true,)+)+ };
        }
    };
}

features! {
    Scene {
        glossy: "gloss and metal",
        dielectric: "glass",
        thin_walls: "panes of glass",
        textures: "textures",
        base_color_maps: "base colour textures",
        metallic_roughness_maps: "textures of metalness and roughness",
        emissive_maps: "emissive textures",
        specular_maps: "textures of specular strength",
        specular_color_maps: "textures of specular colour",
        transmission_maps: "textures of transmission",
        normal_maps: "normal maps",
        alpha: "alpha mask and blend",
        vertex_colors: "vertex colours",
        emitters: "emissive surfaces",
        points: "point lights",
        spots: "spot lights",
        directionals: "directional lights",
        environment: "the environment",
        caustics: "a caustic photon map",
        uv1: "a second set of texture coordinates",
        deformation: "deforming meshes",
    }
    Settings {
        guided_photons: "photons where a first few were of use",
        mips: "levels of textures",
        user_bsdf: "a user BSDF",
        sobol: "Sobol points instead of random numbers",
        light_only: "direct light by light samples only",
        bsdf_only: "direct light by BSDF samples only",
        parts: "separate direct and indirect light",
        albedo_sums: "the first surface's albedo",
        svgf: "the filter's guides beside the light",
        anti_aliased: "temporal anti-aliasing",
        still_mean: "the mean of still frames",
        images: "what shows in mirrors and clear glass, compared where it appears",
        keeps_ends: "path ends of the fused pass, for later passes",
        passthrough: "surroundings that let the room through",
        counts_work: "counts of rays, nodes, triangles and photons",
        record_texels: "texture copies of records and photons",
        wide_machine: "one path per thread, sorts and scans by whole workgroups",
    }
    Renderer {
        visibility_mask: "pixels that the lens hides",
        scatters: "left hits that are scattered into the right image",
        reuse_glossy: "light on glossy surfaces, carried to the right eye",
        reuse_paths: "light that whole paths found, carried to the right eye",
        reuse_shadow_rays: "shadow rays of the right eye for light that is carried to it",
        one_sample: "one sample per pixel",
        carries_light: "left samples for the right eye",
        shares_light: "filtered light, shared between the eyes",
    }
    Pass {
        from_list: "a pass over a list of pixels",
        from_tiles: "a pass over the tiles in which a surface is seen",
        inspects: "the inspection pass: counts BVH nodes, treats alpha-blended surfaces deterministically",
        meets_blended: "rays that meet alpha-blended surfaces wherever they are",
        encodes: "a target with hardware sRGB encoding",
        of_seen: "depth from what the filters keep of surfaces",
    }
}

/// Which features are on.
pub type ShaderFeatures = PerFeature<bool>;

impl ShaderFeatures {
    /// Every feature that `decider`, or someone before, decides on.
    #[must_use]
    pub fn decided_up_to(decider: DecidedBy) -> Self {
        DECIDED_BY.zip(Self::ALL, |by, _| by <= decider)
    }

    /// Those that are on here and in `other`.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        self.zip(other, |a, b| a && b)
    }

    /// Those that are on here and off in `other`.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        self.zip(other, |a, b| a && !b)
    }

    /// `entries` of the features that are on, such as their [`WORDS`], in the table's order.
    pub fn select<T>(self, entries: PerFeature<T>) -> impl Iterator<Item = T> {
        let selected = entries.zip(self, |entry, on| on.then_some(entry));
        selected.into_values().flatten()
    }

    /// Word and value of those that `listed` has on: what a report holds.
    #[must_use]
    pub fn report(self, listed: Self) -> BTreeMap<&'static str, bool> {
        let pairs = WORDS.zip(self, |word, on| (word, on));
        listed.select(pairs).collect()
    }
}

/// The words that a shader's source asks for in `@if` and `@elif`, as often as they stand there. What is commented out
/// counts; there may be no comment between the `@` and the parenthesis.
pub fn words_asked(source: &str) -> impl Iterator<Item = &str> {
    let attributes = source.split('@').skip(1).filter_map(|attribute| {
        let attribute = attribute.trim_start();
        let condition = ["if", "elif"]
            .iter()
            .find_map(|word| attribute.strip_prefix(word))?;
        condition.trim_start().strip_prefix('(')
    });
    attributes.flat_map(|condition| {
        let mut depth = 1_i32;
        let end = condition.find(|c| {
            depth += i32::from(c == '(') - i32::from(c == ')');
            depth == 0
        });
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        let words = condition[..end.unwrap_or(condition.len())].split(move |c| !is_word(c));
        words.filter(|word| !matches!(*word, "" | "true" | "false"))
    })
}
