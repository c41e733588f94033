//! Steps of a plan: their size, names and dispatch parameters.

use super::buffers::Moment;
use super::passes::Pass;
use super::photon_layout::MapKind;

stereolux_base::words! {
    /// An eye, with its word in file names and pass labels.
    #[derive(PartialOrd, Ord)]
    pub enum Eye: name {
        /// The eye that is rendered in full.
        Left = "left",
        /// The eye that reuses the left one's samples.
        Right = "right",
    }
}

impl Eye {
    /// `Dispatch.eye` of the eye's passes.
    #[must_use]
    pub fn index(self) -> u32 {
        self as u32
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// A part of the frame. The order is that of the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Deforms skinned and morphed meshes.
    Pose,
    /// Traces a photon map, or a share of it.
    Photons(MapKind),
    /// Clears the sums over the frame's samples.
    Begin,
    /// One sample of the left eye, or of the only one.
    Left,
    /// One sample of the right eye.
    Right,
    /// The same if both eyes have equal poses and angles.
    RightEqual,
    /// Denoises both eyes.
    Reconstruct,
    /// Runs nothing: the host, and passes outside the plan, read what is kept.
    After,
    /// Hands pictures to a runtime or a window.
    Present,
    /// A view of intermediate results.
    Inspect,
}

impl Stage {
    /// Name, as `info` lists it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Photons(kind) => kind.label(),
            Self::Begin => "begin",
            Self::Left => "left",
            Self::Right | Self::RightEqual => "right",
            Self::Reconstruct => "reconstruction",
            Self::After => "after",
            Self::Present => "present",
            Self::Inspect => "inspection",
        }
    }

    /// Whether the stage runs once per sample.
    #[must_use]
    pub fn is_per_sample(self) -> bool {
        matches!(self, Self::Left | Self::Right | Self::RightEqual)
    }
}

/// A list of pixels, by the first part of its buffers' names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct List(pub &'static str);

impl List {
    /// Pixels of the own eye that see a surface.
    pub const HITS: Self = Self("hit");
    /// The same of the left eye.
    pub const LEFT_HITS: Self = Self("left_hit");
    /// Pixels of the right eye that reuse nothing.
    pub const FILL: Self = Self("fill");
    /// Pixels whose first surface is followed by lobes that scatter light of lights.
    pub const FOLLOWED: Self = Self("followed");
    /// Tiles in which the own eye sees a surface, each counted as 64 pixels.
    pub const SEEN: Self = Self("seen");
    /// The same of tiles in which a pixel of the own eye mixes with what was seen before.
    pub const MIXED: Self = Self("mixed");
    /// The same of tiles in which light has a short history.
    pub const YOUNG: Self = Self("young");
    /// Pixels that gather first at half rate.
    pub const COARSE: Self = Self("coarse");
    /// Pixels that gather in a second pass: between those of half rate, or right-eye pixels without reused indirect light.
    pub const GATHER: Self = Self("gather");
}

/// Workgroups of a dispatch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// One.
    Once,
    /// This many, in rows.
    Groups(u32),
    /// Enough for this many threads.
    Threads(u32),
    /// 8x8 tiles of the image.
    Tiles,
    /// Those of a list, counted on the device (indirect).
    List(List),
    /// The same for a pass whose threads take several entries each (`shaders/shared/runs.wesl`).
    Runs(List),
    /// Those in a buffer at a byte offset (indirect).
    Indirect(&'static str, u64),
    /// A triangle over the image, in a render pass.
    Fragments,
}

/// Parameters of a dispatch: `Dispatch` in `shaders/shared/frame.wesl`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Words {
    /// Number of the first path, digit, axis, level or wavelet pass; the sample's where the stage has one.
    pub index: u32,
    /// Eye, or kind of photon map.
    pub eye: u32,
    /// Paths, blocks, or number of the slice.
    pub count: u32,
    /// Slots per path, mask of a digit, number of slices, or a thread's list entries.
    pub of: u32,
}

/// What a step does.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Runs a pass.
    Run {
        /// Which.
        pass: Pass,
        /// Workgroups.
        size: Size,
        /// The list that it runs over or sets up.
        list: Option<List>,
        /// The list that it appends to.
        appends: Option<List>,
        /// Its parameters.
        words: Words,
        /// Renamed bindings (rule 1 of [`super::bind`]).
        names: Vec<(&'static str, &'static str)>,
    },
    /// Clears the buffers whose rows name the moment.
    Clear(Moment),
    /// Copies a whole buffer into another.
    Copy {
        /// What is read.
        from: &'static str,
        /// What is written.
        to: &'static str,
    },
    /// Updates a buffer's texture copy, if it has one.
    CopyTexels(&'static str),
    /// Keeps a buffer's data until here.
    Keep(&'static str),
}

/// When a step of its stage runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Only {
    /// Always.
    Always,
    /// If a batch of photon paths is due.
    BatchDue(u32),
    /// If the pose has changed since the previous frame.
    NewPose,
}

/// Owner of the buffers that a shader's names resolve to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Owner {
    /// Eye.
    pub eye: Eye,
    /// Photon map.
    pub map: MapKind,
    /// Batch of photon paths.
    pub batch: u32,
}

/// One step of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Name in timings.
    pub label: String,
    /// Owner of its buffers.
    pub owner: Owner,
    /// When.
    pub only: Only,
    /// What.
    pub action: Action,
}

/// A stage and its steps.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedStage {
    /// Which.
    pub stage: Stage,
    /// How often it runs.
    pub when: &'static str,
    /// Steps in order.
    pub steps: Vec<Step>,
}

impl Step {
    /// Renames bindings.
    pub(super) fn names(&mut self, more: &[(&'static str, &'static str)]) -> &mut Self {
        if let Action::Run { names, .. } = &mut self.action {
            names.extend_from_slice(more);
        }
        self
    }

    /// Sets the dispatch's parameters.
    pub(super) fn words(&mut self, index: u32, count: u32, of: u32) -> &mut Self {
        if let Action::Run { words, .. } = &mut self.action {
            *words = Words {
                index,
                count,
                of,
                ..*words
            };
        }
        self
    }

    /// Has the step's pass append to a list.
    pub(super) fn appends(&mut self, list: List) -> &mut Self {
        if let Action::Run { appends, .. } = &mut self.action {
            *appends = Some(list);
        }
        self
    }

    /// Makes the step conditional.
    pub(super) fn only(&mut self, only: Only) -> &mut Self {
        self.only = only;
        self
    }

    /// The pass that the step runs.
    #[must_use]
    pub fn pass(&self) -> Option<&Pass> {
        match &self.action {
            Action::Run { pass, .. } => Some(pass),
            _ => None,
        }
    }

    /// Whether the step works on a list of pixels.
    #[must_use]
    pub fn runs_from_list(&self) -> bool {
        matches!(
            self.action,
            Action::Run {
                size: Size::List(_) | Size::Runs(_),
                ..
            }
        )
    }
}

/// Builds the steps of a stage, in order.
pub(super) struct Steps {
    prefix: String,
    pub(super) owner: Owner,
    /// When the steps that follow run.
    pub(super) only: Only,
    dispatch_eye: u32,
    /// Number of slices, or of a thread's list entries, given to passes without slices.
    of: u32,
    steps: Vec<Step>,
}

impl Steps {
    /// Steps of an eye; timings call them `prefix.PASS`.
    pub(super) fn of_eye(prefix: impl Into<String>, eye: Eye) -> Self {
        Self {
            prefix: prefix.into(),
            owner: Owner {
                eye,
                map: MapKind::Photons,
                batch: 0,
            },
            only: Only::Always,
            dispatch_eye: eye.index(),
            of: 0,
            steps: Vec::new(),
        }
    }

    /// Steps of a photon map.
    pub(super) fn of_map(kind: MapKind) -> Self {
        let mut steps = Self::of_eye(kind.label(), Eye::Left);
        steps.owner.map = kind;
        steps.dispatch_eye = kind.index();
        steps
    }

    /// Sets the number of slices, or of a thread's list entries, given to the passes that follow.
    pub(super) fn told_of(mut self, of: u32) -> Self {
        self.of = of;
        self
    }

    /// Sets the eye of the steps that follow.
    pub(super) fn turn_to(&mut self, prefix: &str, eye: Eye) {
        self.prefix = format!("{prefix}.{}", eye.name());
        self.owner.eye = eye;
        self.dispatch_eye = eye.index();
    }

    pub(super) fn push(&mut self, label: String, action: Action) -> &mut Step {
        self.steps.push(Step {
            label,
            owner: self.owner,
            only: self.only,
            action,
        });
        let last = self.steps.len() - 1;
        &mut self.steps[last]
    }

    /// Runs a pass over `size`.
    pub(super) fn run(&mut self, pass: &Pass, size: Size) -> &mut Step {
        let words = Words {
            eye: self.dispatch_eye,
            of: self.of,
            ..Words::default()
        };
        let list = match size {
            Size::List(list) | Size::Runs(list) => Some(list),
            _ => None,
        };
        self.push(
            format!("{}.{}", self.prefix, pass.name),
            Action::Run {
                pass: pass.clone(),
                size,
                list,
                appends: None,
                words,
                names: Vec::new(),
            },
        )
    }

    /// Adds the steps of another list.
    pub(super) fn append(&mut self, more: Self) {
        self.steps.extend(more.steps);
    }

    /// Runs a pass once per slice of its loop. Returns the steps.
    pub(super) fn in_slices(&mut self, pass: &Pass, over: Size, slices: u32) -> &mut [Step] {
        let first = self.steps.len();
        for slice in 0..slices {
            self.run(pass, over).words(0, slice, slices);
        }
        &mut self.steps[first..]
    }

    /// Renames bindings of all steps so far, but for those that a step has renamed itself.
    pub(super) fn rename(&mut self, more: &[(&'static str, &'static str)]) {
        for step in &mut self.steps {
            if let Action::Run { names, .. } = &mut step.action {
                names.splice(0..0, more.iter().copied());
            }
        }
    }

    /// Runs a pass that appends to a list, and computes the list's workgroups from its length.
    pub(super) fn run_appending(&mut self, pass: &Pass, size: Size, list: List) {
        self.run(pass, size).appends(list);
        self.set_up(list);
    }

    /// Computes a list's workgroups from its length.
    pub(super) fn set_up(&mut self, list: List) {
        let step = self.run(&super::passes::list_setup, Size::Once);
        if let Action::Run { list: of, .. } = &mut step.action {
            *of = Some(list);
        }
    }

    /// Clears the buffers of a moment.
    pub(super) fn clear(&mut self, moment: Moment) -> &mut Step {
        self.push(String::new(), Action::Clear(moment))
    }

    /// Copies a buffer.
    pub(super) fn copy(&mut self, from: &'static str, to: &'static str) -> &mut Step {
        self.push(String::new(), Action::Copy { from, to })
    }

    /// Copies a buffer into its texture; the time counts as the previous pass's.
    pub(super) fn copy_texels(&mut self, name: &'static str) {
        let label = self.steps.last().map(|step| step.label.clone());
        self.push(label.unwrap_or_default(), Action::CopyTexels(name));
    }

    /// Keeps a buffer's data until here.
    pub(super) fn keep(&mut self, name: &'static str) {
        self.push(String::new(), Action::Keep(name));
    }

    pub(super) fn done(self) -> Vec<Step> {
        self.steps
    }
}
