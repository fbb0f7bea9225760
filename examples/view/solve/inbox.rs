//! What the window asks of the solving thread. Edits of maps and settings are all kept, in their order; of requests
//! only the newest counts, and it cancels a running one that nobody waits for any more.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use vrtm::{Control, Quality, TileSettings};

use crate::brush::canvas::{Canvas, Rect};
use crate::model::Model;

/// Purpose of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Shows something while the user drags, paints or plays: always finished, or a window would show nothing while
    /// requests come faster than results.
    Preview,
    /// The result at the chosen quality, once nothing moves: cancelled as soon as something newer is asked for.
    Final,
}

/// A frame to solve.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Frame of the timeline, from 1.
    pub frame: usize,
    /// Frames of the timeline.
    pub last: usize,
    pub quality: Quality,
    pub purpose: Purpose,
    /// Counts edits: a result belongs to the maps and settings up to this one.
    pub edit: u64,
}

/// A change of what is solved.
pub enum Edit {
    /// Another mesh, with its maps.
    Open(Arc<Model>, Vec<Canvas>),
    /// The settings of all tiles.
    Settings(TileSettings),
    /// A part of a page's rigidity map, after a stroke of the brush.
    Paint { page: usize, rect: Rect, texels: Vec<u16> },
}

/// A piece of work.
pub struct Work {
    pub edits: Vec<Edit>,
    pub request: Option<Request>,
    /// Cancels the solve.
    pub control: Arc<Control>,
}

#[derive(Default)]
struct State {
    edits: Vec<Edit>,
    request: Option<Request>,
    running: Option<(Purpose, Arc<Control>)>,
    closed: bool,
}

/// The place where the window leaves what it wants, and the thread takes it.
#[derive(Default)]
pub struct Inbox {
    state: Mutex<State>,
    bell: Condvar,
}

impl Inbox {
    /// Adds a change. A final result of what was before is of no use any more; after another mesh is opened no result
    /// is.
    pub fn post(&self, edit: Edit) {
        let mut state = self.state();
        let another = matches!(edit, Edit::Open(..));
        if another {
            state.edits.clear();
            state.request = None;
        }
        state.cancel_if(|purpose| another || purpose == Purpose::Final);
        state.edits.push(edit);
        self.bell.notify_one();
    }

    /// Replaces what was asked for before.
    pub fn ask(&self, request: Request) {
        let mut state = self.state();
        state.cancel_if(|purpose| purpose == Purpose::Final);
        state.request = Some(request);
        self.bell.notify_one();
    }

    /// Ends the thread: nothing is solved to its end.
    pub fn close(&self) {
        let mut state = self.state();
        state.closed = true;
        state.cancel_if(|_| true);
        self.bell.notify_one();
    }

    /// Waits for work; `None` once closed.
    pub fn take(&self) -> Option<Work> {
        let idle = |state: &mut State| !state.closed && state.edits.is_empty() && state.request.is_none();
        let mut state = self.bell.wait_while(self.state(), idle).unwrap_or_else(PoisonError::into_inner);
        if state.closed {
            return None;
        }
        let control = Arc::new(Control::new());
        let (edits, request) = (std::mem::take(&mut state.edits), state.request.take());
        state.running = request.as_ref().map(|request| (request.purpose, control.clone()));
        Some(Work { edits, request, control })
    }

    /// True if a solve runs or waits.
    pub fn is_busy(&self) -> bool {
        let state = self.state();
        state.running.is_some() || state.request.is_some()
    }

    /// Tells that what was taken last is done.
    pub fn done(&self) {
        self.state().running = None;
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn cancel_if(&mut self, obsolete: impl Fn(Purpose) -> bool) {
        if let Some((purpose, control)) = &self.running
            && obsolete(*purpose)
        {
            control.cancel();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(frame: usize, purpose: Purpose) -> Request {
        Request { frame, last: 100, quality: Quality::Normal, purpose, edit: 0 }
    }

    fn paint(x: u32) -> Edit {
        Edit::Paint { page: 0, rect: Rect { first: [x, 0], size: [1, 1] }, texels: vec![1] }
    }

    #[test]
    fn the_newest_request_wins_and_all_edits_stay() {
        let inbox = Inbox::default();
        inbox.ask(request(1, Purpose::Preview));
        inbox.post(paint(1));
        inbox.ask(request(2, Purpose::Preview));
        inbox.post(paint(2));
        let work = inbox.take().expect("open");
        assert_eq!(work.request.map(|r| r.frame), Some(2));
        let columns = work.edits.iter().map(|edit| match edit {
            Edit::Paint { rect, .. } => rect.first[0],
            _ => 0,
        });
        assert_eq!(columns.collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn a_newer_request_cancels_a_final_result_only() {
        for (purpose, cancelled) in [(Purpose::Final, true), (Purpose::Preview, false)] {
            let inbox = Inbox::default();
            inbox.ask(request(1, purpose));
            let work = inbox.take().expect("open");
            assert!(inbox.is_busy());
            inbox.ask(request(2, Purpose::Preview));
            assert_eq!(work.control.is_cancelled(), cancelled, "{purpose:?}");
            inbox.done();
            let next = inbox.take().expect("open");
            assert!(!next.control.is_cancelled());
        }
    }

    #[test]
    fn a_stroke_cancels_a_final_result_and_another_mesh_everything() {
        let inbox = Inbox::default();
        inbox.ask(request(1, Purpose::Final));
        let work = inbox.take().expect("open");
        inbox.post(paint(1));
        assert!(work.control.is_cancelled());
        inbox.ask(request(1, Purpose::Preview));
        let work = inbox.take().expect("open");
        let model = Model::scene("squash");
        inbox.ask(request(5, Purpose::Preview));
        inbox.post(Edit::Open(Arc::new(model), Vec::new()));
        assert!(work.control.is_cancelled());
        assert_eq!(inbox.take().and_then(|work| work.request), None, "a request for the mesh before");
    }
}
