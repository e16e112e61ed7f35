//! Which of the things there are was meant.

/// Up to three paths that look like `path`, closest first.
pub(super) fn similar(path: &str, all: &[&str]) -> Vec<String> {
    let last = |path: &str| path.rsplit('/').next().unwrap_or_default().to_owned();
    let name = last(path);
    let mut found: Vec<(usize, &str)> = all
        .iter()
        .map(|other| {
            let distance = distance(path, other).min(distance(&name, &last(other)) + 1);
            (distance, *other)
        })
        .filter(|(distance, _)| *distance <= 3)
        .collect();
    found.sort_unstable();
    found
        .into_iter()
        .take(3)
        .map(|(_, path)| path.to_owned())
        .collect()
}

/// Levenshtein distance in bytes: insertions, deletions and substitutions.
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, a) in a.bytes().enumerate() {
        let mut diagonal = i;
        row[0] = i + 1;
        for (j, b) in b.bytes().enumerate() {
            let substitution = diagonal + usize::from(a != b);
            diagonal = row[j + 1];
            row[j + 1] = substitution.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_the_number_of_edits() {
        for (a, b, edits) in [
            ("", "", 0),
            ("abc", "abc", 0),
            ("", "abc", 3),
            ("kitten", "sitting", 3),
            ("flaw", "lawn", 2),
        ] {
            assert_eq!(distance(a, b), edits, "{a} {b}");
            assert_eq!(distance(b, a), edits, "{b} {a}");
        }
    }

    #[test]
    fn similar_paths_are_close_in_whole_or_in_name() {
        let all = ["bloom/down", "bloom/up", "ssr/march", "lib/colour"];
        assert_eq!(similar("bloom/dwon", &all), ["bloom/down"]);
        assert_eq!(similar("refraction/march", &all), ["ssr/march"]);
        assert!(similar("nothing/alike", &all).is_empty());
    }
}
