//! Points of the schedule, by name: where a solve may change from one backend to the other, and where a comparison of
//! both was made.

use std::cmp::Reverse;
use std::fmt;

use crate::error::{Error, Result};

/// A point of the schedule, just after a stage. Points are ordered as in the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Point {
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
            Point::Level { level, step: u32::MAX } => write!(f, "correct@{}", level.0),
            Point::Level { level, step } => write!(f, "correct@{}.{}", level.0, step - 1),
            Point::Certify => f.write_str("certify"),
        }
    }
}

/// A change of backend within a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Switch {
    /// True if the GPU begins.
    pub gpu_first: bool,
    /// The last stage on that backend.
    pub last: Point,
}

impl Switch {
    /// Reads `BACKEND:STAGE`: `cpu` or `gpu`, and the last stage that it runs: `surface`, `pyramid`, `prolong@LEVEL`,
    /// `relax@LEVEL` (pbd: its iterations), `correct@LEVEL` (all corrections of the level), `correct@LEVEL.N` (the
    /// first N of them) or `certify`. Level 0 is the finest. A level that the grid does not have comes before all of
    /// the grid's levels.
    ///
    /// # Errors
    /// `InvalidArgument` for other text.
    pub fn parse(text: &str) -> Result<Switch> {
        let unreadable = || {
            Error::argument(format!(
                "VRTM_SWITCH: '{text}' is not cpu: or gpu: and a stage, as in cpu:relax@1 or gpu:correct@0.2"
            ))
        };
        let (backend, stage) = text.split_once(':').ok_or_else(unreadable)?;
        let gpu_first = match backend {
            "cpu" => false,
            "gpu" => true,
            _ => return Err(unreadable()),
        };
        let (name, place) = stage.split_once('@').map_or((stage, None), |(name, place)| (name, Some(place)));
        let number = |text: &str| text.parse::<u16>().map_err(|_| unreadable());
        let last = match (name, place) {
            ("surface", None) => Point::Surface,
            ("pyramid", None) => Point::Pyramid,
            ("certify", None) => Point::Certify,
            ("prolong", Some(level)) => Point::level(number(level)?.into(), 0),
            ("relax", Some(level)) => Point::level(number(level)?.into(), 1),
            ("correct", Some(place)) => match place.split_once('.') {
                Some((level, n)) => Point::level(number(level)?.into(), 1 + u32::from(number(n)?)),
                None => Point::level(number(place)?.into(), u32::MAX),
            },
            _ => return Err(unreadable()),
        };
        Ok(Switch { gpu_first, last })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_are_read_and_named_alike() {
        for text in
            ["cpu:surface", "gpu:pyramid", "cpu:prolong@3", "gpu:relax@0", "cpu:correct@1.2", "cpu:certify"]
        {
            let switch = Switch::parse(text).unwrap();
            let backend = if switch.gpu_first { "gpu" } else { "cpu" };
            assert_eq!(format!("{backend}:{}", switch.last), text);
        }
        assert_eq!(Switch::parse("cpu:correct@2").unwrap().last, Point::level(2, u32::MAX));
        for text in
            ["", "cpu", "cpu:", "tpu:surface", "cpu:relax", "cpu:relax@", "cpu:surface@1", "cpu:correct@1.x"]
        {
            let error = Switch::parse(text).unwrap_err();
            assert!(error.message.starts_with("VRTM_SWITCH: '"), "{}", error.message);
        }
    }

    #[test]
    fn points_stand_in_the_schedule_s_order() {
        let names = [
            "surface",
            "pyramid",
            "prolong@2",
            "relax@2",
            "correct@2.1",
            "correct@2",
            "prolong@1",
            "certify",
        ];
        let points = names.map(|name| Switch::parse(&format!("cpu:{name}")).unwrap().last);
        assert!(points.is_sorted());
    }
}
