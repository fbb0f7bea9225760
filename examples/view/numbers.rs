//! Numbers of frames in the names of files.

/// Fewest digits of the largest number: poses that are only counted, such as `smile1` and `smile2`, are no shot.
const DIGITS: usize = 3;

/// The frame of each file of a shot: the only number in which the names differ, as `vrtm bake` reads them. They ascend;
/// `None` if the names are not those of a shot.
pub fn frames<'a>(names: &[&'a str]) -> Option<Vec<i64>> {
    let [first, others @ ..] = names else { return None };
    let alike = |from_end: bool| {
        let byte = |name: &str, k: usize| name.as_bytes()[if from_end { name.len() - 1 - k } else { k }];
        let same = |other: &&str| {
            let all = first.len().min(other.len());
            (0..all).find(|&k| byte(first, k) != byte(other, k)).unwrap_or(all)
        };
        others.iter().map(same).min()
    };
    // A number that begins or ends alike is cut out whole.
    let is_digit = |c: char| c.is_ascii_digit();
    let before = first.get(..alike(false)?)?.trim_end_matches(is_digit);
    let behind = first.get(first.len() - alike(true)?..)?.trim_start_matches(is_digit);
    let number = |name: &&'a str| {
        let number = name.get(before.len()..name.len() - behind.len())?;
        number.chars().all(is_digit).then_some(number)
    };
    let numbers = names.iter().map(number).collect::<Option<Vec<&str>>>()?;
    let digits = numbers.iter().map(|number| number.len()).max()?;
    // A hyphen is a minus sign unless it stands behind a letter or a digit.
    let minus = before.strip_suffix('-').is_some_and(|rest| !rest.ends_with(char::is_alphanumeric));
    let frame = |number: &&str| number.parse::<i64>().ok().map(|n| if minus { -n } else { n });
    let numbers = numbers.iter().map(frame).collect::<Option<Vec<_>>>()?;
    (digits >= DIGITS && numbers.windows(2).all(|pair| pair[0] < pair[1])).then_some(numbers)
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
