//! What the fuzz targets run, over a corpus and seeded mutations of it.

use etalon_tests::fuzz::{corpus, program, wgsl};
use etalon_tests::programs::Choices;

/// A text as pieces to be mixed: words, numbers, and single other characters.
fn tokens(text: &str) -> Vec<&str> {
    let mut tokens = Vec::new();
    let mut start = 0;
    let mut previous = ' ';
    for (at, character) in text.char_indices() {
        let word = |character: char| character.is_alphanumeric() || character == '_';
        if at > start && !(word(previous) && word(character)) {
            tokens.push(&text[start..at]);
            start = at;
        }
        previous = character;
    }
    tokens.push(&text[start..]);
    tokens
}

/// The corpus with something changed: some bytes, or tokens put elsewhere, left
/// out, repeated or taken from another text.
fn mutated(choices: &mut Choices<'_>, corpus: &[String]) -> Vec<u8> {
    let text = choices.of(corpus);
    if choices.chance(25) {
        let mut bytes = text.into_bytes();
        for _ in 0..1 + choices.below(4) {
            let at = choices.below(bytes.len());
            bytes[at] ^= 1 << choices.below(8);
        }
        return bytes;
    }
    let other = choices.of(corpus);
    let (mut pieces, others) = (tokens(&text), tokens(&other));
    for _ in 0..1 + choices.below(3) {
        let (at, from) = (choices.below(pieces.len()), choices.below(others.len()));
        let length = 1 + choices.below(4);
        let end = (at + length).min(pieces.len());
        match choices.below(5) {
            0 => drop(pieces.drain(at..end)),
            1 => {
                let again = pieces[at..end].to_vec();
                pieces.splice(at..at, again);
            }
            2 => {
                // One word for another is what most often stays valid.
                let word = pieces[choices.below(pieces.len())];
                pieces[at] = word;
            }
            3 => {
                let new = others[from..(from + length).min(others.len())].to_vec();
                pieces.splice(at..end, new);
            }
            _ => {
                const EDGES: [&str; 10] = [
                    "0",
                    "1",
                    "4294967295u",
                    "-1",
                    "2147483648",
                    "0.0",
                    "1e38",
                    "vec4",
                    "i32",
                    "f32",
                ];
                pieces[at] = choices.of(&EDGES);
            }
        }
        if pieces.is_empty() {
            break;
        }
    }
    pieces.concat().into_bytes()
}

/// Runs an input; a panic is reported with it.
fn survive(name: &str, run: fn(&[u8]), input: &[u8]) {
    if std::panic::catch_unwind(|| run(input)).is_err() {
        panic!("{name}:\n{}", String::from_utf8_lossy(input));
    }
}

#[test]
fn the_corpus_is_accepted_and_survived() {
    let corpus = corpus();
    assert!(corpus.len() > 60, "{} texts", corpus.len());
    for text in &corpus {
        assert!(naga::front::wgsl::parse_str(text).is_ok(), "{text}");
        survive("corpus", wgsl, text.as_bytes());
    }
}

#[test]
fn mutations_of_the_corpus_are_survived() {
    let corpus = corpus();
    let mut valid = 0;
    const COUNT: u64 = 3000;
    for seed in 0..COUNT {
        let input = mutated(&mut Choices::seeded(seed), &corpus);
        if std::str::from_utf8(&input).is_ok_and(|text| naga::front::wgsl::parse_str(text).is_ok())
        {
            valid += 1;
        }
        survive(&format!("seed {seed}"), wgsl, &input);
    }
    // Else nothing but naga's front end would be tried.
    assert!(valid > COUNT / 20, "{valid} of {COUNT} texts are WGSL");
}

#[test]
fn programs_of_any_choices_are_evaluated_right() {
    for seed in 0..150 {
        let mut choices = Choices::seeded(seed);
        let length = choices.below(1500);
        let bytes: Vec<u8> = (0..length).map(|_| choices.below(256) as u8).collect();
        survive(&format!("seed {seed}"), program, &bytes);
    }
    survive("nothing", program, &[]);
}
