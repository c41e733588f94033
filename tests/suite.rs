//! The integration tests, in one binary: wgpu is linked once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::type_complexity,
    clippy::too_many_arguments,
    missing_docs
)]

mod suite {
    /// The example's code, called as a user would.
    #[allow(dead_code)]
    #[path = "../../examples/user_bsdf/main.rs"]
    pub mod user_bsdf_example;

    /// The smallest application.
    #[allow(dead_code)]
    #[path = "../../examples/minimal.rs"]
    pub mod minimal_example;

    /// A loop with the renderer in hand.
    #[allow(dead_code)]
    #[path = "../../examples/own_loop.rs"]
    pub mod own_loop_example;

    /// What `stereolux new` writes.
    #[allow(dead_code)]
    #[path = "../../assets/template/src/main.rs"]
    pub mod template;

    /// A part that comes and goes.
    #[allow(dead_code)]
    #[path = "../../examples/adding.rs"]
    pub mod adding_example;

    /// The tour of the gallery.
    #[allow(dead_code)]
    #[path = "../../examples/gallery_tour.rs"]
    pub mod gallery_tour_example;

    /// The example that makes the files under assets/.
    #[allow(dead_code)]
    #[path = "../../crates/scene/examples/make_assets/scenes/mod.rs"]
    pub mod embedded_scenes;

    /// The mutations of `fuzz/`, for a slice of them.
    #[path = "../../fuzz"]
    pub mod fuzz {
        pub mod mutate;
        pub mod parsers;
        pub mod seeds;
    }

    #[allow(dead_code)]
    #[path = "../../crates/base/tests/shared/folders.rs"]
    pub mod folders;

    /// From the tests of shaders without a renderer.
    #[path = "../../crates/gpu/tests/shared/adapter.rs"]
    pub mod adapter;

    #[path = "../../crates/gpu/tests/shared/textures.rs"]
    pub mod textures;

    #[path = "../../crates/gpu/tests/shared/uniform_branches.rs"]
    pub mod branches;

    /// From the tests of images.
    #[allow(dead_code)]
    #[path = "../../crates/images/tests/shared/block_statistics.rs"]
    pub mod block_statistics;
    #[path = "../../crates/images/tests/shared/chi_square.rs"]
    pub mod chi_square;

    pub mod bvh;
    pub mod frame;
    pub mod measure;
    pub mod program;
    pub mod scene;
    pub mod stereo;
    pub mod support;
    pub mod transport;
    pub mod untrusted;
    pub mod viewer;
    pub mod xr;
}
