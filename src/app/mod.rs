//! The application's seam: one trait to implement, the frame's input, the world to change.
//!
//! An application owns no loop. [`run_app`] gives it the flags of `stereolux run` and calls it once a frame, between
//! locating the wearer and rendering: what [`App::update`] changes is in the images of the frame whose input it got.
//! Everything that it can see is in [`FrameInput`] and [`World`] and is recorded with `--record`, so that `--trace` drives
//! it to the same pixels without a headset. An application that keeps to that takes no other clock and no other dice.

mod hands;
mod kept;
mod loading;
#[cfg(feature = "panels")]
mod panels;
mod world;

use std::error::Error;

use glam::DVec3;

use crate::frame_loop::LoopError;
use crate::gpu::ShaderLibrary;
use crate::pose::Pose;
use crate::renderer::Renderer;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::xr::input::{Button, Buttons, Hand, Input, Side};
use crate::xr::{ActionError, ActionValues, Actions, FrameState, LocatedViews, View, XrSession};

pub use crate::commands::{run_app, run_app_with};
pub(crate) use kept::Kept;
pub use loading::PartLoading;
#[cfg(feature = "panels")]
pub use panels::{Panel, PanelSpec};
pub use world::{World, WorldError};

/// Why an application gives up; its text is one line.
pub type AppError = Box<dyn Error + Send + Sync>;

/// An application on the frame loop.
pub trait App {
    /// The actions of its own ([`FrameInput::action_pressed`], [`Input::actions`]); called once, before the session begins.
    ///
    /// # Errors
    /// Ends the program with exit status 2: a declaration that cannot be.
    fn actions(&self) -> Result<Actions, AppError> {
        Ok(Actions::default())
    }

    /// Called once, before the scene is uploaded: look up what `update` will need, add what the scene lacks.
    ///
    /// # Errors
    /// Ends the program with exit status 2: the scene is none that the application can work with.
    fn start(&mut self, world: &mut World<'_>) -> Result<(), AppError> {
        let _ = world;
        Ok(())
    }

    /// Called in every frame, also in those that `--range` leaves out of the files.
    ///
    /// # Errors
    /// Ends the program with exit status 1; files of the frames before are complete.
    fn update(&mut self, frame: &FrameInput, world: &mut World<'_>) -> Result<(), AppError>;

    /// Called once, after the last frame, however the loop ended: to keep what the next start goes on with.
    fn end(&mut self, world: &mut World<'_>) {
        let _ = world;
    }
}

/// Nothing but the scene and its animation: what `stereolux run` shows.
pub(crate) struct SceneAlone;

impl App for SceneAlone {
    fn update(&mut self, _: &FrameInput, _: &mut World<'_>) -> Result<(), AppError> {
        Ok(())
    }
}

/// What the wearer does in a frame, and when it will be seen.
#[derive(Clone, Debug)]
pub struct FrameInput {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// When the frame will be seen, nanoseconds on the session's clock: the time to move things by.
    pub display_time_ns: i64,
    /// Nanoseconds between two refreshes of the display.
    pub period_ns: i64,
    /// Left eye, right eye.
    pub views: [View; 2],
    /// Hands, buttons, gaze, and the application's own actions.
    pub input: Input,
    before: Held,
}

/// What was held in the frame before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Held {
    buttons: [Buttons; 2],
    actions: ActionValues,
}

impl FrameInput {
    pub(crate) fn new(index: u32, state: &FrameState, views: &LocatedViews, input: Input) -> Self {
        Self {
            frame: index,
            display_time_ns: state.predicted_display_time_ns,
            period_ns: state.period_ns,
            views: views.views,
            input,
            before: Held::default(),
        }
    }

    /// Knows what was held in the frame before, and notes what is held now.
    pub(crate) fn after(mut self, held: &mut Held) -> Self {
        let now = Held {
            buttons: self.input.hands.each_ref().map(|hand| hand.pressed),
            actions: self.input.actions.clone(),
        };
        self.before = std::mem::replace(held, now);
        self
    }

    /// When the frame will be seen, seconds.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.display_time_ns as f64 * 1e-9
    }

    /// World from head: midway between the eyes, turned like the left one.
    #[must_use]
    pub fn head(&self) -> Pose {
        Pose::new(
            View::midpoint_in_world(&self.views),
            self.views[0].orientation,
        )
    }

    /// A hand.
    #[must_use]
    pub fn hand(&self, side: Side) -> &Hand {
        self.input.hand(side)
    }

    /// Whether a button went down in this frame.
    #[must_use]
    pub fn pressed(&self, side: Side, button: Button) -> bool {
        let now = self.hand(side).pressed;
        now.without(self.before.buttons[side as usize]).has(button)
    }

    /// Whether a button went up in this frame.
    #[must_use]
    pub fn released(&self, side: Side, button: Button) -> bool {
        let before = self.before.buttons[side as usize];
        before.without(self.hand(side).pressed).has(button)
    }

    /// Whether an action of kind bool has begun in this frame.
    ///
    /// # Errors
    /// No such action, or one of another kind.
    pub fn action_pressed(&self, name: &str) -> Result<bool, ActionError> {
        Ok(self.input.actions.held(name)? && !self.before.actions.is_held(name))
    }

    /// Whether an action of kind bool has ended in this frame.
    ///
    /// # Errors
    /// As [`FrameInput::action_pressed`].
    pub fn action_released(&self, name: &str) -> Result<bool, ActionError> {
        Ok(!self.input.actions.held(name)? && self.before.actions.is_held(name))
    }

    /// Where a hand points: origin and unit direction in the world; `None` while it is not tracked.
    #[must_use]
    pub fn aim(&self, side: Side) -> Option<(DVec3, DVec3)> {
        let aim = self.hand(side).aim?;
        Some((aim.pose.position, aim.direction()))
    }
}

/// An application with its world, for the frame loop.
pub struct Application<'a> {
    app: &'a mut dyn App,
    pub(crate) kept: Kept,
    held: Held,
}

impl<'a> Application<'a> {
    /// Starts it. `library`: shaders of all its renderers.
    ///
    /// # Errors
    /// The application's own.
    pub(crate) fn start(
        app: &'a mut dyn App,
        actions: Actions,
        scene: Scene,
        settings: &Settings,
        library: ShaderLibrary,
    ) -> Result<Self, AppError> {
        let mut kept = Kept::new(scene, actions);
        (kept.library, kept.limits) = (library, settings.limits.load());
        let mut world = World::new(&mut kept, None, None);
        world.show_hands(settings.input.show_hands)?;
        app.start(&mut world)?;
        kept.settled();
        Ok(Self {
            app,
            kept,
            held: Held::default(),
        })
    }

    /// Lets it change the world for a frame, with the scene's animation where it then stands, and shows the wearer's hands
    /// as far as `session` knows them.
    ///
    /// # Errors
    /// [`LoopError`].
    pub(crate) fn update(
        &mut self,
        session: &mut dyn XrSession,
        renderer: &mut Renderer,
        mut frame: FrameInput,
    ) -> Result<(), LoopError> {
        let actions = frame.input.actions.of(&self.kept.actions);
        frame.input.actions = actions.map_err(|error| LoopError::App(error.into()))?;
        renderer.animate(frame.display_time_ns);
        let frame = frame.after(&mut self.held);
        let mut world = World::new(&mut self.kept, Some(renderer), Some(&frame));
        let updated = self.app.update(&frame, &mut world);
        updated.map_err(LoopError::App)?;
        let moved = world.move_hands(&frame.input);
        moved.map_err(|error| LoopError::App(error.into()))?;
        if world.takes_model()
            && let Some(model) = session.controller_model()?
        {
            world.take_model(model);
        }
        self.kept.answer_questions(Some(renderer));
        Ok(self.kept.show(renderer, frame.display_time_ns)?)
    }

    pub(crate) fn end(&mut self, renderer: &Renderer) {
        self.app
            .end(&mut World::new(&mut self.kept, Some(renderer), None));
        self.kept.asked.end();
        // With a model that has come meanwhile, and its renderer: they go before the session does.
        self.kept.hands = None;
        self.kept.arrival = None;
        self.kept.first_maker = None;
    }
}
