//! Decides what to ask for: a preview while something moves, the chosen quality once nothing does.

use vrtm::Quality;

use super::answer::Answer;
use super::inbox::{Purpose, Request};

/// A solve that takes no longer shows the chosen quality even while something moves, in milliseconds.
const QUICK: f64 = 40.0;
/// A solve that takes longer is preceded by a draft, so that a click shows something at once.
const SLOW: f64 = 200.0;

/// The request, and its duration.
#[derive(Default)]
pub struct Flow {
    /// Counts edits of maps and settings.
    pub edit: u64,
    asked: Option<Request>,
    /// Milliseconds of the last solve at the chosen quality, and which that was.
    known: Option<(Quality, f64)>,
}

/// Content of the window.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    pub frame: usize,
    pub last: usize,
    pub quality: Quality,
    /// True while the user drags, paints or plays.
    pub moving: bool,
}

impl Flow {
    /// The next request, if any; `shown` is the picture on the screen.
    pub fn next(&mut self, wanted: &Wanted, shown: Option<&Request>) -> Option<Request> {
        let &Wanted { frame, last, quality, moving } = wanted;
        let took = self.known.filter(|(of, _)| *of == quality).map(|(_, took)| took);
        let stale = shown.is_none_or(|shown| (shown.frame, shown.edit) != (frame, self.edit));
        let previewed = moving || stale && shown.is_some() && took.is_some_and(|took| took > SLOW);
        let purpose = if previewed { Purpose::Preview } else { Purpose::Final };
        let drafted = previewed && took.is_none_or(|took| took > QUICK);
        let quality = if drafted { Quality::Draft } else { quality };
        let request = Request { frame, last, quality, purpose, edit: self.edit };
        if self.asked.as_ref() == Some(&request) {
            return None;
        }
        self.asked = Some(request.clone());
        Some(request)
    }

    /// Learns how long a solve took.
    pub fn learn(&mut self, answer: &Answer, quality: Quality) {
        if answer.request.quality == quality && answer.report.charts_active > 0 {
            self.known = Some((quality, answer.solve_ms + answer.fetch_ms));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REST: Wanted = Wanted { frame: 1, last: 9, quality: Quality::Normal, moving: false };

    fn told(request: Option<Request>) -> Option<(usize, Quality, Purpose)> {
        request.map(|r| (r.frame, r.quality, r.purpose))
    }

    #[test]
    fn drafts_while_something_moves_and_the_chosen_quality_after_it() {
        let mut flow = Flow::default();
        let first = flow.next(&REST, None);
        assert_eq!(told(first.clone()), Some((1, Quality::Normal, Purpose::Final)));
        assert_eq!(flow.next(&REST, None), None, "once");
        let moving = Wanted { frame: 2, moving: true, ..REST };
        let preview = flow.next(&moving, first.as_ref());
        assert_eq!(told(preview.clone()), Some((2, Quality::Draft, Purpose::Preview)));
        let still = Wanted { moving: false, ..moving };
        let last = flow.next(&still, preview.as_ref());
        assert_eq!(told(last.clone()), Some((2, Quality::Normal, Purpose::Final)));
        flow.edit += 1;
        assert_eq!(flow.next(&still, last.as_ref()).map(|r| r.edit), Some(1), "an edit asks again");
    }

    #[test]
    fn quick_scenes_need_no_drafts_and_slow_ones_begin_with_them() {
        let mut flow = Flow { known: Some((Quality::Normal, 10.0)), ..Flow::default() };
        let moving = Wanted { moving: true, ..REST };
        assert_eq!(told(flow.next(&moving, None)), Some((1, Quality::Normal, Purpose::Preview)));
        let mut flow = Flow { known: Some((Quality::Normal, 900.0)), ..Flow::default() };
        let shown = Request { frame: 5, last: 9, quality: Quality::Normal, purpose: Purpose::Final, edit: 0 };
        let draft = flow.next(&REST, Some(&shown));
        assert_eq!(told(draft.clone()), Some((1, Quality::Draft, Purpose::Preview)));
        assert_eq!(told(flow.next(&REST, draft.as_ref())), Some((1, Quality::Normal, Purpose::Final)));
    }
}
