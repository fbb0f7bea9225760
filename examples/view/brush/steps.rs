//! What was done to the maps: it can be undone, and redone.

use super::canvas::{Canvas, Rect};

/// Steps that can be undone, and texels that all of them hold at most.
const MOST: usize = 32;
const MOST_TEXELS: usize = 1 << 27;

/// A change of a page's map.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    pub page: usize,
    pub rect: Rect,
    /// The texels of the rectangle.
    pub texels: Vec<u16>,
}

/// For each step, at most one change per page: what was there before it, or after it.
#[derive(Default)]
pub struct Steps {
    undo: Vec<Vec<Change>>,
    redo: Vec<Vec<Change>>,
}

impl Steps {
    /// Keeps what was there before a new step.
    pub fn keep(&mut self, before: Vec<Change>) {
        if before.is_empty() {
            return;
        }
        self.undo.push(before);
        self.redo.clear();
        let size = |steps: &[Vec<Change>]| steps.iter().flatten().map(|c| c.texels.len()).sum::<usize>();
        while self.undo.len() > MOST || (self.undo.len() > 1 && size(&self.undo) > MOST_TEXELS) {
            self.undo.remove(0);
        }
    }

    pub fn clear(&mut self) {
        *self = Steps::default();
    }

    pub fn can_undo(&self) -> bool {
        !self.undo.is_empty()
    }

    pub fn can_redo(&self) -> bool {
        !self.redo.is_empty()
    }

    /// Takes the last step back. Returns what changed.
    pub fn undo(&mut self, canvases: &mut [Canvas]) -> Vec<Change> {
        let Some(changes) = self.undo.pop() else { return Vec::new() };
        self.redo.push(swap(canvases, &changes));
        changes
    }

    /// Does the last step that was taken back again. Returns what changed.
    pub fn redo(&mut self, canvases: &mut [Canvas]) -> Vec<Change> {
        let Some(changes) = self.redo.pop() else { return Vec::new() };
        self.undo.push(swap(canvases, &changes));
        changes
    }
}

/// Pastes changes; returns what was there.
fn swap(canvases: &mut [Canvas], changes: &[Change]) -> Vec<Change> {
    let one = |Change { page, rect, texels }: &Change| {
        let canvas = &mut canvases[*page];
        let before = canvas.copy(*rect);
        canvas.paste(*rect, texels);
        Change { page: *page, rect: *rect, texels: before }
    };
    changes.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_taken_back_and_done_again_until_a_new_one() {
        let mut canvases = [Canvas { size: [2, 1], texels: vec![0, 0], deep: false }];
        let mut steps = Steps::default();
        let set = |steps: &mut Steps, canvases: &mut [Canvas], value: u16| {
            let rect = Rect { first: [1, 0], size: [1, 1] };
            steps.keep(vec![Change { page: 0, rect, texels: canvases[0].copy(rect) }]);
            canvases[0].texels[1] = value;
        };
        set(&mut steps, &mut canvases, 1);
        set(&mut steps, &mut canvases, 2);
        steps.undo(&mut canvases);
        assert_eq!(canvases[0].texels, [0, 1]);
        steps.redo(&mut canvases);
        assert_eq!((&*canvases[0].texels, steps.can_redo()), (&[0, 2][..], false));
        steps.undo(&mut canvases);
        steps.undo(&mut canvases);
        assert_eq!((&*canvases[0].texels, steps.can_undo()), (&[0, 0][..], false));
        set(&mut steps, &mut canvases, 7);
        assert!(!steps.can_redo(), "a new step ends what could be done again");
        assert!(steps.redo(&mut canvases).is_empty());
    }
}
