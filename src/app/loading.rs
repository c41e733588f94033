//! glTF scenes that are loaded and prepared on threads while frames go on.

use std::num::NonZero;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use rayon::ThreadPoolBuilder;

use super::AppError;
use super::kept::Kept;
use crate::gpu::ShaderLibrary;
use crate::renderer::{PartPreparation, PreparedPart, Rebuild, RenderError, Renderer};
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
    /// Parts that this scene had.
    pub(super) parts: Vec<u64>,
    /// Of the part.
    needs: Needs,
}

impl Successor {
    /// Whether the part cannot come into the scene without it.
    pub(super) fn is_needed(&self, renderer: &Renderer) -> bool {
        !renderer.rebuild().can_show(&self.needs)
    }
}

/// What a thread waits for.
enum Question {
    /// How to prepare a part that began to be loaded before there was a renderer: for the first one, whatever took its place
    /// since, so that a replay has the same frames.
    Maker(Sender<Maker>),
    /// The scene as it is, with [`Kept::surroundings`], for another renderer. Only what lacks shaders asks for it: copying a
    /// large scene takes a frame's time.
    Scene(Sender<(Scene, u32)>),
}

/// Questions of threads that load parts. Each holds the list until it is done.
#[derive(Default)]
pub(super) struct Questions(Arc<Mutex<Vec<Question>>>);

impl Questions {
    fn taken(&self) -> Vec<Question> {
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
#[derive(Clone)]
pub(super) struct Maker {
    preparation: PartPreparation,
    rebuild: Rebuild,
    library: ShaderLibrary,
}

impl Maker {
    pub(super) fn of(renderer: &Renderer, library: &ShaderLibrary) -> Self {
        Self {
            preparation: renderer.part_preparation(),
            rebuild: renderer.rebuild(),
            library: library.clone(),
        }
    }

    /// Prepares a part, with another renderer where this one lacks its shaders: of the scene that `shown` gives, with
    /// [`Kept::surroundings`], to which the part has not been added.
    pub(super) fn prepare(
        &self,
        part: Scene,
        shown: impl FnOnce() -> Option<(Scene, u32)>,
    ) -> Result<Loaded, RenderError> {
        part.check()?;
        let needs = Needs::of(&part);
        let mut successor = None;
        // What deforms comes with a renderer that is made of the whole scene (`Renderer::add_part`).
        if !needs.deformation
            && !self.rebuild.can_show(&needs)
            && let Some((scene, surroundings)) = shown()
        {
            let renderer = self.rebuild.build_for(&self.library, &scene, &needs)?;
            successor = Some(Box::new(Successor {
                renderer,
                surroundings,
                parts: scene.parts,
                needs,
            }));
        }
        let own = successor
            .as_ref()
            .map(|own| own.renderer.part_preparation());
        let preparation = own.as_ref().unwrap_or(&self.preparation);
        Ok(Loaded {
            prepared: Some(preparation.prepare(&part)?),
            scene: part,
            successor,
        })
    }
}

impl PartLoading {
    pub(super) fn begin(
        kept: &Kept,
        load: impl FnOnce() -> Result<Scene, AppError> + Send + 'static,
        maker: Option<Maker>,
    ) -> Self {
        let running = Arc::clone(&kept.asked.0);
        let asked = Arc::clone(&kept.asked.0);
        let make = move || {
            let scene = load()?;
            // Nobody answers where it is added before there is a renderer, or once the run is over.
            let Some(maker) = maker.or_else(|| ask(&asked, Question::Maker)) else {
                return Ok(scene.into());
            };
            Ok(maker.prepare(scene, || ask(&asked, Question::Scene))?)
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
    pub(super) fn end(
        self,
        kept: &mut Kept,
        renderer: Option<&Renderer>,
    ) -> Option<Result<Loaded, AppError>> {
        while !self.0.is_finished() {
            kept.answer_questions(renderer);
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        self.0.join().ok()
    }
}

impl Kept {
    /// Answers threads that ask. What a part is prepared for nobody knows before there is a renderer.
    pub(super) fn answer_questions(&mut self, renderer: Option<&Renderer>) {
        if self.first_maker.is_none() && Arc::strong_count(&self.asked.0) > 1 {
            self.first_maker = renderer.map(|renderer| Maker::of(renderer, &self.library));
        }
        for question in self.asked.taken() {
            // A thread that has fallen over wants no answer.
            match (question, &self.first_maker) {
                (Question::Maker(answer), Some(maker)) => {
                    let _ = answer.send(maker.clone());
                }
                (Question::Maker(_), None) => {}
                (Question::Scene(answer), _) => {
                    let _ = answer.send((self.scene.clone(), self.surroundings));
                }
            }
        }
    }
}

/// The application's answer; `None` if there will be none.
fn ask<T>(questions: &Mutex<Vec<Question>>, question: fn(Sender<T>) -> Question) -> Option<T> {
    let (answer, answered) = channel();
    locked(questions).push(question(answer));
    answered.recv().ok()
}

fn locked(asked: &Mutex<Vec<Question>>) -> MutexGuard<'_, Vec<Question>> {
    asked.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_waits_for_an_answer_once_the_application_is_gone() {
        let questions = Questions::default();
        let asked = Arc::clone(&questions.0);
        let thread = std::thread::spawn(move || ask(&asked, Question::Maker).is_none());
        drop(questions);
        assert!(thread.join().unwrap());
    }
}
