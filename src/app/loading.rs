//! glTF scenes that are loaded and prepared on threads while frames go on.

use std::num::NonZero;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
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

/// Gives a thread the scene as it is, with [`Kept::surroundings`], for another renderer. Only what lacks shaders asks for
/// it: copying a large scene takes a frame's time.
type Answer = Sender<(Scene, u32)>;

/// Threads that wait for the scene. Each that loads holds the list until it is done.
#[derive(Default)]
pub(super) struct Questions(Arc<Mutex<Vec<Answer>>>);

impl Questions {
    fn taken(&self) -> Vec<Answer> {
        std::mem::take(&mut *locked(&self.0))
    }

    /// Waits for all threads, which may be busy on the device, and tells those that ask that the run is over.
    pub(super) fn end(&self) {
        while Arc::strong_count(&self.0) > 1 {
            self.taken();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
}

/// Also where an application falls over: nobody would answer.
impl Drop for Questions {
    fn drop(&mut self) {
        self.end();
    }
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
        let running = Arc::clone(&kept.asked.0);
        let asked = Arc::clone(&kept.asked.0);
        let make = move || {
            let scene = load()?;
            let Some(maker) = maker else {
                return Ok(scene.into());
            };
            let needs = Needs::of(&scene);
            let mut successor = None;
            if !maker.rebuild.can_show(&needs) {
                let (answer, answered) = channel();
                locked(&asked).push(answer);
                // Nobody answers once the run is over.
                if let Ok((scene, surroundings)) = answered.recv() {
                    let renderer = maker.rebuild.build_for(&maker.library, &scene, &needs)?;
                    successor = Some(Box::new(Successor {
                        renderer,
                        surroundings,
                        needs,
                    }));
                }
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
    /// Gives the scene to threads that ask for it.
    pub(super) fn answer_questions(&mut self) {
        for answer in self.asked.taken() {
            // A thread that has fallen over wants no answer.
            let _ = answer.send((self.scene.clone(), self.surroundings));
        }
    }
}

fn locked(asked: &Mutex<Vec<Answer>>) -> MutexGuard<'_, Vec<Answer>> {
    asked.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_waits_for_an_answer_once_the_application_is_gone() {
        let questions = Questions::default();
        let asked = Arc::clone(&questions.0);
        let thread = std::thread::spawn(move || {
            let (answer, answered) = channel();
            locked(&asked).push(answer);
            answered.recv().is_err()
        });
        drop(questions);
        assert!(thread.join().unwrap());
    }
}
