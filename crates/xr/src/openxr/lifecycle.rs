//! The session's states, OpenXR 1.1 section 9.3 "Session Lifecycle".

use openxr::SessionState;

/// What a change of state asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Nothing.
    None,
    /// `xrBeginSession`; frames follow.
    Begin,
    /// `xrEndSession`; no frames until the next [`Step::Begin`].
    End,
    /// The session is over: the wearer or the runtime wants this program to quit.
    Quit,
    /// The session is about to be lost.
    Lost,
}

/// Where the session stands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lifecycle {
    running: bool,
}

impl Lifecycle {
    /// Whether frames are waited for, begun and ended.
    pub(super) fn running(&self) -> bool {
        self.running
    }

    /// Notes a state and says what it asks for. A session that is stopped without being asked to becomes idle and may
    /// become ready again.
    pub(super) fn enter(&mut self, state: SessionState) -> Step {
        match state {
            SessionState::READY if !self.running => {
                self.running = true;
                Step::Begin
            }
            SessionState::STOPPING if self.running => {
                self.running = false;
                Step::End
            }
            SessionState::EXITING => {
                self.running = false;
                Step::Quit
            }
            SessionState::LOSS_PENDING => {
                self.running = false;
                Step::Lost
            }
            _ => Step::None,
        }
    }
}

/// A state's name as the specification has it, in lower case.
pub(super) fn name(state: SessionState) -> String {
    format!("{state:?}").to_lowercase().replace('_', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_life_with_a_pause() {
        use SessionState as S;
        let mut life = Lifecycle::default();
        let steps = [
            (S::IDLE, Step::None, false),
            (S::READY, Step::Begin, true),
            (S::SYNCHRONIZED, Step::None, true),
            (S::VISIBLE, Step::None, true),
            (S::FOCUSED, Step::None, true),
            (S::VISIBLE, Step::None, true),
            (S::SYNCHRONIZED, Step::None, true),
            (S::STOPPING, Step::End, false),
            (S::IDLE, Step::None, false),
            (S::READY, Step::Begin, true),
            (S::STOPPING, Step::End, false),
            (S::EXITING, Step::Quit, false),
        ];
        for (state, step, running) in steps {
            assert_eq!(life.enter(state), step, "{}", name(state));
            assert_eq!(life.running(), running, "{}", name(state));
        }
    }

    #[test]
    fn a_repeated_state_asks_for_nothing_twice_and_a_loss_stops_frames() {
        let mut life = Lifecycle::default();
        assert_eq!(life.enter(SessionState::STOPPING), Step::None);
        assert_eq!(life.enter(SessionState::READY), Step::Begin);
        assert_eq!(life.enter(SessionState::READY), Step::None);
        assert_eq!(life.enter(SessionState::LOSS_PENDING), Step::Lost);
        assert!(!life.running());
    }
}
