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

    /// The example's measure, for its test.
    #[allow(dead_code)]
    #[path = "../../examples/reconstruction/paired_references.rs"]
    pub mod paired_references;

    /// The example that makes the files under assets/.
    #[path = "../../examples/make_assets/scenes/mod.rs"]
    pub mod embedded_scenes;

    pub mod bench;
    pub mod block_statistics;
    pub mod bsdf_furnace;
    pub mod bsdf_layer;
    pub mod bsdf_probe;
    pub mod bsdf_sampling;
    pub mod bsdf_specialised;
    pub mod bsdf_surface;
    pub mod bsdf_twin;
    pub mod bsdf_user;
    pub mod bvh_build;
    pub mod bvh_gpu;
    pub mod bvh_probe;
    pub mod bvh_reference;
    pub mod carried;
    pub mod caustics;
    pub mod checks;
    pub mod chi_square;
    pub mod closed_sphere;
    pub mod commands;
    pub mod convergence;
    pub mod cornell;
    pub mod deforming;
    pub mod deforming_motion;
    pub mod determinism;
    pub mod drag;
    pub mod edited_frames;
    pub mod editing;
    pub mod forced_features;
    pub mod frame_plan;
    /// The mutations of `fuzz/`, for a slice of them.
    #[path = "../../fuzz"]
    pub mod fuzz {
        pub mod mutate;
        pub mod parsers;
        pub mod seeds;
    }
    pub mod fuzzed;
    pub mod gathers;
    pub mod half_rate;
    pub mod hard_cases;
    pub mod hard_extremes;
    pub mod hard_scales;
    pub mod hard_support;
    pub mod hostile;
    pub mod hostile_files;
    pub mod hostile_pipes;
    pub mod hostile_values;
    pub mod hostile_viewer;
    pub mod images_files;
    pub mod inspect;
    pub mod inspect_photons;
    pub mod layout;
    pub mod light_candidates;
    pub mod lights_emission;
    pub mod lights_probe;
    pub mod lights_sampling;
    pub mod lookup;
    pub mod metrics_files;
    pub mod mirror;
    pub mod moving_instances;
    pub mod moving_support;
    pub mod openxr_failures;
    pub mod openxr_picture;
    pub mod openxr_remote;
    pub mod openxr_runtime;
    pub mod openxr_submit;
    pub mod openxr_support;
    pub mod options_flags;
    pub mod options_saving;
    pub mod options_settings;
    pub mod outliers;
    pub mod parts;
    pub mod photon_map;
    pub mod photons_over_time;
    pub mod progressive;
    pub mod reconstruction;
    pub mod reference;
    pub mod resize;
    pub mod saving;
    pub mod scene_builtin;
    pub mod scene_faults;
    pub mod scene_import;
    pub mod scene_motion;
    pub mod shaders;
    pub mod sphere;
    pub mod stereo_exact;
    pub mod support;
    pub mod techniques;
    pub mod uniform_branches;
    pub mod user_passes;
    pub mod viewer_app;
    pub mod viewer_files;
    pub mod viewer_painter;
    pub mod viewer_support;
    pub mod viewer_window;
    pub mod virtual_screen;
    pub mod xr_headset;
    pub mod xr_replay;
    pub mod xr_simulated;
    pub mod xr_trace;
    pub mod xr_trajectory;
    pub mod xr_validation;
    pub mod xr_view;
}
