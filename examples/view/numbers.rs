//! Numbers of frames in the names of files.

/// Fewest digits of the largest number: poses that are only counted, such as `smile1` and `smile2`, are no shot.
const DIGITS: usize = 3;

/// The frame of each file of a shot: the only number in which the names differ, as `vrtm bake` reads them. They ascend;
/// `None` if the names are not those of a shot.
pub fn frames(names: &[&str]) -> Option<Vec<i64>> {
    let parts: Vec<_> = names.iter().map(|name| parts(name)).collect();
    let [first, others @ ..] = parts.as_slice() else { return None };
    let alike = |k: usize| others.iter().all(|other| other.get(k) == first.get(k));
    let count = first.len();
    let [at] = (0..count).filter(|&k| !alike(k)).collect::<Vec<_>>()[..] else { return None };
    let is_number = |part: &&str| part.starts_with(|c: char| c.is_ascii_digit());
    if !parts.iter().all(|parts| parts.len() == count && is_number(&parts[at])) {
        return None;
    }
    // A hyphen is a minus sign unless it stands behind a letter or a digit.
    let before = at.checked_sub(1).map_or("", |k| first[k]);
    let minus = match before.strip_suffix('-') {
        // A digit is a part of its own.
        Some("") => at == 1,
        Some(rest) => !rest.ends_with(char::is_alphanumeric),
        None => false,
    };
    let digits = parts.iter().map(|parts| parts[at].len()).max()?;
    let numbers: Option<Vec<i64>> = parts.iter().map(|parts| parts[at].parse().ok()).collect();
    let numbers: Vec<i64> = numbers?.into_iter().map(|n| if minus { -n } else { n }).collect();
    (digits >= DIGITS && numbers.windows(2).all(|pair| pair[0] < pair[1])).then_some(numbers)
}

/// A name cut into numbers and what stands between them.
fn parts(name: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digit = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != digit).unwrap_or(rest.len());
        let (part, others) = rest.split_at(end);
        parts.push(part);
        rest = others;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_shot_have_the_numbers_of_its_frames() {
        assert_eq!(frames(&["a2_sim.0101", "a2_sim.0102", "a2_sim.0105"]), Some(vec![101, 102, 105]));
        assert_eq!(frames(&["walk_998", "walk_1001"]), Some(vec![998, 1001]));
        assert_eq!(frames(&["sim.-0005", "sim.-0004"]), Some(vec![-5, -4]));
        assert_eq!(frames(&["sim-0004", "sim-0005"]), Some(vec![4, 5]), "a hyphen behind a letter is none");
        assert_eq!(frames(&["a2-004", "a2-005"]), Some(vec![4, 5]), "nor is one behind a digit");
    }

    #[test]
    fn other_names_have_none() {
        let all: [&[&str]; 6] = [
            &["smile", "frown"],
            &["smile1", "smile2"],
            &["a1.0001", "a2.0002"],
            &["sim.0102", "sim.0101"],
            &["sim.0101"],
            &["sim.0101", "sim.0101b"],
        ];
        for names in all {
            assert_eq!(frames(names), None, "{names:?}");
        }
    }
}
