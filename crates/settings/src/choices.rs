//! Settings with a few named values: one list per choice gives its type, words and explanations.

/// A type whose values each have a word, for files, flags and listings.
pub trait Choice: Copy + Eq + Send + Sync + 'static {
    /// All values, in the order of listings.
    const ALL: &'static [Self];
    /// Their words, in the same order.
    const WORDS: &'static [&'static str];
    /// What each does, one sentence without a full stop, in the same order.
    const SENTENCES: &'static [&'static str];

    /// The value's word.
    fn word(self) -> &'static str;

    /// The value that a word stands for.
    fn from_word(word: &str) -> Option<Self> {
        let place = Self::WORDS.iter().position(|known| *known == word)?;
        Self::ALL.get(place).copied()
    }
}

/// Makes an enum, its [`Choice`] and its words for serde and for people from one line per value and its sentence.
#[macro_export]
macro_rules! choices {
    ($(
        $(#[$about:meta])*
        pub enum $name:ident {
            $( $(#[doc = $sentence:literal])+ $value:ident = $word:literal, )+
        }
    )+) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $( $(#[doc = $sentence])+ #[serde(rename = $word)] $value, )+
        }

        impl $crate::Choice for $name {
            const ALL: &'static [Self] = &[$(Self::$value),+];
            const WORDS: &'static [&'static str] = &[$($word),+];
            const SENTENCES: &'static [&'static str] =
                &[$(concat!($($sentence),+).trim_ascii_start()),+];

            fn word(self) -> &'static str {
                match self {
                    $(Self::$value => $word,)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str($crate::Choice::word(*self))
            }
        }
    )+};
}

choices! {
    /// Light transport method (`method`).
    pub enum Method {
        /// Photon mapping: photons traced from the lights, gathered at the eye's hits
        Photon = "photon",
        /// Path tracing: the reference for errors
        Path = "path",
    }

    /// How the right eye reuses the left eye's work (`reuse`).
    pub enum Reuse {
        /// Render each eye separately
        Off = "off",
        /// Reproject the left eye's hits into the right eye, trace only pixels that stay empty
        Scatter = "scatter",
        /// Trace the right eye's primary rays and reuse demodulated light of left samples that agree in position and normal
        Lookup = "lookup",
    }

    /// Random numbers of the path tracer (`path.sampler`).
    pub enum Sampler {
        /// Independent uniform numbers
        Random = "random",
        /// Owen-scrambled Sobol points
        Sobol = "sobol",
    }

    /// How the path tracer finds lights (`path.technique`).
    pub enum Technique {
        /// Light and BSDF samples, combined by MIS (balance heuristic)
        Mis = "mis",
        /// Light samples only
        Light = "light",
        /// BSDF samples only, which miss point, spot and directional lights
        Bsdf = "bsdf",
    }

    /// Source of direct light in photon mapping (`photon.direct`).
    pub enum DirectLight {
        /// Next-event estimation; the map holds only photons that scattered at least once
        Nee = "nee",
        /// The photon map, as in the 2020 report
        Map = "map",
    }

    /// Weight of a photon by its distance from the gather point (`photon.kernel`).
    pub enum Kernel {
        /// The same weight over the whole disc
        Constant = "constant",
        /// 2 (1 - d^2/r^2) / (pi r^2)
        Epanechnikov = "epanechnikov",
        /// Falls linearly to the rim: 3 (1 - d/r) / (pi r^2)
        Cone = "cone",
    }

    /// How photons around a point are found (`photon.search`).
    pub enum Search {
        /// A hash grid whose cells are as wide as the radius
        Grid = "grid",
        /// A left-balanced kd-tree
        KdTree = "kd-tree",
    }

    /// Which photons make an estimate (`photon.estimate`).
    pub enum PhotonEstimate {
        /// All photons within the radius
        Radius = "radius",
        /// The `photon.nearest` nearest photons within the radius
        Nearest = "nearest",
    }

    /// Kernels of one sample of an eye (`photon.schedule`).
    pub enum Schedule {
        /// One kernel traces, another gathers
        Split = "split",
        /// One kernel traces and gathers
        Fused = "fused",
    }

    /// How a gather loads photons (`photon.loads`).
    pub enum Loads {
        /// Every thread loads its own
        Direct = "direct",
        /// A workgroup loads them together into shared memory
        Cooperative = "cooperative",
    }

    /// Frames on their way to the device at once (`gpu.frames_in_flight`).
    pub enum FramesInFlight {
        /// 2 in a headset or in real time, 1 where images are written or nothing hurries
        Auto = "auto",
        /// Each is waited for
        One = "1",
        /// The host prepares one while the device computes another
        Two = "2",
        /// As 2, with one more frame of latency
        Three = "3",
    }

    /// Passes of the a-trous wavelet filter (`reconstruct.atrous_passes`).
    pub enum AtrousPasses {
        /// 3 for paths; 1 for photons, whose noise is as wide as their discs
        Auto = "auto",
        /// None
        Zero = "0",
        /// To the pixels beside a pixel
        One = "1",
        /// 3 pixels far
        Two = "2",
        /// 7 pixels far
        Three = "3",
        /// 15 pixels far
        Four = "4",
        /// 31 pixels far
        Five = "5",
        /// 63 pixels far
        Six = "6",
        /// 127 pixels far
        Seven = "7",
        /// 255 pixels far
        Eight = "8",
    }

    /// Motion of the simulated headset (`simulated.motion`).
    pub enum Motion {
        /// The head does not move
        Still = "still",
        /// The head turns left and right
        Yaw = "yaw",
        /// The head moves along a walk
        Walk = "walk",
        /// Small band-limited movements of a standing person
        Sway = "sway",
    }

    /// When a shader feature is compiled in (`force.*`).
    pub enum Force {
        /// If the scene needs it
        Auto = "auto",
        /// Always
        On = "on",
        /// Never, even if that changes the image
        Off = "off",
    }

    /// Whether a step of reconstruction runs (`reconstruct.*`).
    pub enum Switch {
        /// On in sequences (run, view) of one sample per pixel, off in single frames (render)
        Auto = "auto",
        /// Always; true says the same
        On = "on",
        /// Never; false says the same
        Off = "off",
    }

    /// Whether images are written (`output.images`).
    pub enum WriteImages {
        /// Except in an OpenXR session and on the desktop, which writing would slow down
        Auto = "auto",
        /// Always; true says the same
        On = "on",
        /// Never; false says the same
        Off = "off",
    }

    /// What of a frame may be read after it (`output.kept`).
    pub enum Kept {
        /// What is shown, and where the right eye's pixels came from
        Picture = "picture",
        /// Hit rays too, from which a runtime gets its depth where there are no filters
        Depth = "depth",
        /// Samples and motion too, for tests and programs that look into frames
        All = "all",
    }

    /// What the device's timestamps enclose (`gpu.timestamps`).
    pub enum Timestamps {
        /// Each pass; in an OpenXR session and on the desktop each stage
        Auto = "auto",
        /// Each pass; true says the same
        On = "on",
        /// Each stage (photons, left eye, right eye, reconstruction): passes may overlap within it
        Stages = "stages",
        /// Nothing; false says the same
        Off = "off",
    }

    /// Surroundings that light a scene (`light`).
    pub enum Light {
        /// A plain studio, if the scene has no light to be seen by
        Auto = "auto",
        /// A plain studio: a grey room with three soft boxes
        Studio = "studio",
        /// A plain sky with a sun
        Sky = "sky",
        /// None but the scene's own and environment.path
        None = "none",
    }

    /// Samples of EXR files (`output.exr`).
    pub enum ExrPrecision {
        /// 32-bit floats
        F32 = "f32",
        /// 16-bit floats, up to 65504; depth and motion stay at 32 bits
        F16 = "f16",
    }

    /// How EXR files hold the eyes (`output.layout`).
    pub enum ExrLayout {
        /// A file per eye and part: frame_NNNN_left.exr, frame_NNNN_right.exr
        Files = "files",
        /// One file per frame, frame_NNNN.exr, with both eyes as views and all parts as layers
        Multiview = "multiview",
    }

    /// Further images of what a pixel sees (`output.aovs`).
    pub enum Aov {
        /// Distance from the eye along the ray, metres: channel Z
        Depth = "depth",
        /// Shading normal in world axes: channels N.X, N.Y, N.Z
        Normal = "normal",
        /// Base colour: channels albedo.R, albedo.G, albedo.B
        Albedo = "albedo",
        /// Place in the previous frame less place now, pixels right and down: channels motion.X, motion.Y
        Motion = "motion",
        /// Number of the instance, 4294967295 for none: channel instance.id
        Instance = "instance",
    }

    /// Curve from radiance to what is shown (`output.tone`).
    pub enum Tone {
        /// ACES filmic, by the fit of Narkowicz 2015
        Aces = "aces",
        /// AgX, which keeps hues of bright colours
        Agx = "agx",
        /// Khronos PBR Neutral, which keeps base colours
        Neutral = "neutral",
        /// None: clipped at 1
        Linear = "linear",
    }

    /// Coarser levels of textures (`textures.mips`).
    pub enum Mips {
        /// Where frames are reconstructed
        Auto = "auto",
        /// Chosen by how much of a texture a ray covers
        On = "on",
        /// The finest level everywhere, as other renderers read it
        Off = "off",
    }

    /// Reference space that the scene stands in (`openxr.space`).
    pub enum Space {
        /// Origin at the wearer's head when the runtime last recentred
        Local = "local",
        /// Origin on the floor in the middle of the play area
        Stage = "stage",
    }

    /// How the right stick turns the wearer (`openxr.turn`).
    pub enum Turn {
        /// By `openxr.snap_turn_deg` at each push
        Snap = "snap",
        /// Evenly while it is pushed, by `openxr.turn_deg_per_s` at full deflection
        Smooth = "smooth",
    }

    /// Swapchain colour format (`openxr.format`).
    pub enum ImageFormat {
        /// The runtime's preference among the two
        Auto = "auto",
        /// 8 bits, sRGB
        Srgb = "srgb",
        /// Half floats, linear
        Half = "half",
    }

    /// Which eyes are rendered; the flag `--eyes`.
    pub enum Eyes {
        /// Both eyes
        Both = "both",
        /// The left eye
        Left = "left",
        /// The right eye, without a left eye to reuse
        Right = "right",
    }
}

impl Switch {
    /// Whether it is on for certain; the commands decide what [`Switch::Auto`] is, and the renderer takes it for off.
    #[must_use]
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

macro_rules! switched {
    ($($name:ident)+) => {$(
        impl From<bool> for $name {
            fn from(on: bool) -> Self {
                if on { Self::On } else { Self::Off }
            }
        }
    )+};
}
switched! { Switch WriteImages Timestamps }

impl From<u32> for AtrousPasses {
    /// More than eight are eight.
    fn from(passes: u32) -> Self {
        let numbers = &Self::ALL[1..];
        numbers[(passes as usize).min(numbers.len() - 1)]
    }
}

impl AtrousPasses {
    /// How many, with a method.
    #[must_use]
    pub fn with(self, method: Method) -> u32 {
        match (self, method) {
            (Self::Auto, Method::Path) => 3,
            (Self::Auto, Method::Photon) => 1,
            _ => self as u32 - Self::Zero as u32,
        }
    }
}

impl WriteImages {
    /// Whether images are written; the commands decide what [`WriteImages::Auto`] is, files being the rule.
    #[must_use]
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}

impl Timestamps {
    /// Whether anything is timed.
    #[must_use]
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}

impl Force {
    /// Whether the feature is in, given what the scene or the adapter needs.
    #[must_use]
    pub fn apply(self, needed: bool) -> bool {
        match self {
            Self::Auto => needed,
            Self::On => true,
            Self::Off => false,
        }
    }
}
