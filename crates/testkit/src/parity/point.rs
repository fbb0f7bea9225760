//! Named points of the schedule, at which the two backends are compared.

use std::cmp::Reverse;
use std::fmt;

/// A point of the schedule, just after a stage. Points are ordered as in the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Point {
    Surface,
    Pyramid,
    Level {
        level: Reverse<usize>,
        /// 0: prolong (or the start of a solve); 1: relax, or all iterations of pbd; 1 + n: the n-th correction.
        step: u32,
    },
    Certify,
}

impl Point {
    /// The point after a step on a level.
    pub fn level(level: usize, step: u32) -> Point {
        Point::Level { level: Reverse(level), step }
    }
}

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Point::Surface => f.write_str("surface"),
            Point::Pyramid => f.write_str("pyramid"),
            Point::Level { level, step: 0 } => write!(f, "prolong@{}", level.0),
            Point::Level { level, step: 1 } => write!(f, "relax@{}", level.0),
            Point::Level { level, step } => write!(f, "correct@{}.{}", level.0, step - 1),
            Point::Certify => f.write_str("certify"),
        }
    }
}
