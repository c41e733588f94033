//! glTF scenes that are loaded and prepared on threads while frames go on.

use std::num::NonZero;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;

use rayon::ThreadPoolBuilder;

use super::AppError;
use super::kept::Kept;
use crate::gpu::ShaderLibrary;
use crate::renderer::{PartPreparation, PreparedPart, Rebuild, Renderer};
use crate::scene::{Needs, Scene};

/// A glTF file that is being loaded ([`World::load_part`](super::World::load_part)).
pub struct PartLoading(JoinHandle<Result<Loaded, AppError>>);

/// What a thread made of a file.
pub(super) struct Loaded {
    pub(super) scene: Scene,
    /// `None`: there was no renderer yet to prepare it for.
    pub(super) prepared: Option<PreparedPart>,
    pub(super) successor: Option<Box<Successor>>,
}

impl From<Scene> for Loaded {
    fn from(scene: Scene) -> Self {
        Self {
            scene,
            prepared: None,
            successor: None,
        }
    }
}

/// A renderer for a part whose shaders the present one lacks.
pub(super) struct Successor {
    pub(super) renderer: Renderer,
    /// [`Kept::surroundings`] of the scene that it was made from.
    pub(super) surroundings: u32,
    /// Of the part.
    needs: Needs,
}

impl Successor {
    /// Whether the part cannot come into the scene without it.
    pub(super) fn is_needed(&self, renderer: &Renderer) -> bool {
        !renderer.rebuild().can_show(&self.needs)
    }
}

/// The scene as it is, for a renderer that is made on a thread. Only what lacks shaders asks for it: copying a large scene
/// takes a frame's time.
struct Shown {
    scene: Scene,
    surroundings: u32,
}

/// A thread's question for the scene that is shown.
pub(super) struct Question {
    asked: Receiver<()>,
    answer: Sender<Shown>,
}

/// What a thread needs to prepare a part for a renderer.
pub(super) struct Maker {
    pub(super) preparation: PartPreparation,
    pub(super) rebuild: Rebuild,
    pub(super) library: ShaderLibrary,
}

impl PartLoading {
    pub(super) fn begin(
        kept: &mut Kept,
        load: impl FnOnce() -> Result<Scene, AppError> + Send + 'static,
        maker: Option<Maker>,
    ) -> Self {
        let (ask, asked) = channel();
        let (answer, answered) = channel();
        if maker.is_some() {
            kept.questions.push(Question { asked, answer });
        }
        let make = move || {
            let scene = load()?;
            let Some(maker) = maker else {
                return Ok(scene.into());
            };
            let needs = Needs::of(&scene);
            let mut successor = None;
            // Nobody answers once the run is over.
            if !maker.rebuild.can_show(&needs)
                && ask.send(()).is_ok()
                && let Ok(Shown {
                    scene,
                    surroundings,
                }) = answered.recv()
            {
                let renderer = maker.rebuild.build_for(&maker.library, &scene, &needs)?;
                successor = Some(Box::new(Successor {
                    renderer,
                    surroundings,
                    needs,
                }));
            }
            let own = successor
                .as_ref()
                .map(|own| own.renderer.part_preparation());
            let prepared = own.unwrap_or(maker.preparation).prepare(&scene)?;
            Ok(Loaded {
                scene,
                prepared: Some(prepared),
                successor,
            })
        };
        let running = Arc::clone(&kept.loaders);
        Self(std::thread::spawn(move || {
            // Of its own: frames that ask rayon's for a moment's work would wait there until all shaders are compiled.
            let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
            let threads = ThreadPoolBuilder::new().num_threads((cores - 1).max(1));
            let made = threads.build()?.install(make);
            drop(running);
            made
        }))
    }

    /// Waits for the thread; `None` if it fell over.
    pub(super) fn end(self, kept: &mut Kept) -> Option<Result<Loaded, AppError>> {
        while !self.0.is_finished() {
            kept.answer_questions();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        self.0.join().ok()
    }
}

impl Kept {
    /// Waits for all threads, which may be busy on the device, and tells those that ask that the run is over.
    pub(super) fn end_loading(&mut self) {
        self.questions.clear();
        while Arc::strong_count(&self.loaders) > 1 {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    /// Gives the scene to threads that ask for it.
    pub(super) fn answer_questions(&mut self) {
        let shown = || Shown {
            scene: self.scene.clone(),
            surroundings: self.surroundings,
        };
        self.questions
            .retain(|question| match question.asked.try_recv() {
                Ok(()) => {
                    // A thread that has fallen over wants no answer.
                    let _ = question.answer.send(shown());
                    false
                }
                Err(TryRecvError::Empty) => true,
                Err(TryRecvError::Disconnected) => false,
            });
    }
}
