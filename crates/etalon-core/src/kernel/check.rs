//! What is refused before a text is parsed.

use super::scan::{TokenKind, tokens};

/// Finds the first token that is none of WGSL's, and says what is wrong.
///
/// WESL 0.4 skips what it cannot read as if it were blank: `a - 4294967296u`
/// becomes `a -`.
pub(crate) fn check_tokens(text: &str) -> Result<(), (usize, String)> {
    for token in tokens(text) {
        let problem = match token.kind {
            TokenKind::Word if !token.text.is_ascii() => {
                Some("identifiers of kernels are ASCII".to_owned())
            }
            TokenKind::Number => {
                number_problem(token.text).map(|problem| format!("`{}` is {problem}", token.text))
            }
            TokenKind::Punctuation if !"&@/![]{}:,=<>%-.+|();*~^".contains(token.text) => {
                Some(format!(
                    "the character `{}` means nothing in WGSL",
                    token.text.escape_debug()
                ))
            }
            TokenKind::Unclosed => Some("this comment is not closed".to_owned()),
            TokenKind::Word | TokenKind::Punctuation => None,
        };
        if let Some(problem) = problem {
            return Err((token.offset, problem));
        }
    }
    Ok(())
}

/// Why a text is no number literal (WGSL §3.5.1), or one out of range.
fn number_problem(text: &str) -> Option<&'static str> {
    const MALFORMED: Option<&str> = Some("no number");
    let (digits, radix) = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(digits) => (digits, 16),
        None => (text, 10),
    };
    let exponent_mark = if radix == 16 { ['p', 'P'] } else { ['e', 'E'] };
    let (mantissa, exponent) = match digits.split_once(exponent_mark) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (digits, None),
    };
    // Without an exponent, a hexadecimal `f` is a digit.
    let last = exponent.unwrap_or(mantissa);
    let suffixes: &[char] = match (radix, exponent) {
        (16, None) => &['i', 'u'],
        _ => &['i', 'u', 'f', 'h'],
    };
    let bare = last.strip_suffix(suffixes).unwrap_or(last);
    let suffix = last.get(bare.len()..).unwrap_or_default();
    let mantissa = if exponent.is_some() { mantissa } else { bare };

    if let Some(exponent) = exponent {
        let exponent = exponent.strip_suffix(suffixes).unwrap_or(exponent);
        let digits = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
        if digits.is_empty() || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
            return MALFORMED;
        }
    }
    let (whole, fraction) = match mantissa.split_once('.') {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (mantissa, None),
    };
    let digit = |c: char| c.is_digit(radix);
    let any = !whole.is_empty() || fraction.is_some_and(|fraction| !fraction.is_empty());
    if !any || !whole.chars().all(digit) || !fraction.unwrap_or_default().chars().all(digit) {
        return MALFORMED;
    }
    let float = fraction.is_some() || exponent.is_some() || matches!(suffix, "f" | "h");
    if float {
        return if matches!(suffix, "i" | "u") {
            MALFORMED
        } else {
            None
        };
    }
    if radix == 10 && whole.len() > 1 && whole.starts_with('0') {
        return Some("an integer with a leading zero");
    }
    let most = match suffix {
        "u" => u64::from(u32::MAX),
        "i" => i32::MAX as u64,
        _ => i64::MAX as u64,
    };
    match u64::from_str_radix(whole, radix) {
        Ok(value) if value <= most => None,
        _ => Some("out of range of its type"),
    }
}

/// The most levels a kernel may nest, see [`check_nesting`].
pub(crate) const MAX_NESTING: usize = 192;

/// The most `<` behind names that may be open at once, see [`check_nesting`].
pub(crate) const MAX_OPEN_ANGLES: usize = 8;

/// The most `loop` statements within each other, see [`check_nesting`].
pub(crate) const MAX_LOOPS: usize = 8;

/// What an open bracket holds so far.
#[derive(Default)]
struct Level {
    /// Operators of the current expression, and `else`s of the current ladder.
    operators: usize,
    /// `<` behind a name that may yet be a bracket.
    angles: usize,
    /// Whether it is the body of a `loop`.
    body_of_loop: bool,
}

/// Finds the first place where a text nests too deeply, and says how.
///
/// Compilers walk syntax trees recursively, so a hostile text could exhaust
/// the stack, which cannot be caught. Brackets nest, and so does each operator
/// of a chain (`a + b + c` is a tree of depth three) and each `else` of an
/// `else if` ladder; all are counted against [`MAX_NESTING`].
///
/// WESL 0.4 takes time exponential in two more things: in how many `<` behind
/// a name are within each other, since each may or may not be a template list
/// and is tried, and in how many `loop`s are, since it evaluates the
/// conditions in their bodies twice.
pub(crate) fn check_nesting(text: &str) -> Result<(), (usize, String)> {
    let mut levels = vec![Level::default()];
    let mut before = "";
    let mut loops_next = false;
    let mut tokens = tokens(text).peekable();
    while let Some(token) = tokens.next() {
        let Some(level) = levels.last_mut() else {
            return Ok(());
        };
        match token.text {
            "(" | "[" | "{" => {
                let block = token.text == "{";
                if block {
                    level.angles = 0;
                }
                levels.push(Level {
                    body_of_loop: block && std::mem::take(&mut loops_next),
                    ..Level::default()
                });
            }
            ")" | "]" | "}" => {
                if levels.len() > 1 {
                    levels.pop();
                }
                // A block ends a statement, unless a ladder goes on.
                if token.text == "}"
                    && tokens.peek().is_none_or(|next| next.text != "else")
                    && let Some(level) = levels.last_mut()
                {
                    level.operators = 0;
                }
            }
            ";" => {
                level.operators = 0;
                level.angles = 0;
            }
            "," => level.operators = 0,
            ":" => level.angles = 0,
            "loop" => loops_next = true,
            "else" | "+" | "-" | "*" | "/" | "%" | "^" | "!" | "~" | "=" | "." => {
                level.operators += 1;
            }
            "&" | "|" => {
                level.operators += 1;
                // `&&` and `||` are in no template list.
                if before == token.text {
                    level.angles = 0;
                }
            }
            "<" => {
                level.operators += 1;
                if before.starts_with(|c: char| c.is_alphabetic() || c == '_') {
                    level.angles += 1;
                }
            }
            ">" => {
                level.operators += 1;
                level.angles = level.angles.saturating_sub(1);
            }
            _ => {}
        }
        before = token.text;

        let refuse = |message: String| Err((token.offset, message));
        let nested = levels.len() - 1 + levels.iter().map(|it| it.operators).sum::<usize>();
        if nested > MAX_NESTING {
            return refuse(format!("nested more than {MAX_NESTING} levels deep"));
        }
        if levels.iter().map(|it| it.angles).sum::<usize>() > MAX_OPEN_ANGLES {
            return refuse(format!(
                "more than {MAX_OPEN_ANGLES} template lists or comparisons within each other; \
                 name some of them"
            ));
        }
        if levels.iter().filter(|it| it.body_of_loop).count() > MAX_LOOPS {
            return refuse(format!("more than {MAX_LOOPS} `loop`s within each other"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_that_are_not_wgsl_are_found() {
        let fine = "fn f_1() -> vec4<f32> { /* ü€ */ // $\n let _x = !(a[1] % ~2) ^ 3 | 4 & 5; *p += b.x; @c : }";
        assert_eq!(check_tokens(fine), Ok(()));
        for (text, at) in [
            ("a $ b", 2),
            ("a # b", 2),
            ("let é = 1", 4),
            ("\u{feff}fn", 0),
            ("a\0", 1),
            ("\"text\"", 0),
            ("a /* b", 2),
            ("1 + 4294967296u", 4),
        ] {
            assert_eq!(check_tokens(text).map_err(|(at, _)| at), Err(at), "{text}");
        }
    }

    #[test]
    fn numbers_are_those_of_the_grammar() {
        for number in [
            "0",
            "10",
            "0u",
            "12i",
            "0x0",
            "0X1fu",
            "0xABi",
            "4294967295u",
            "2147483647i",
            "0xffffffffu",
            "9223372036854775807",
            "1f",
            "1h",
            "0f",
            "00f",
            "1.",
            ".5",
            "1.5",
            "01.5",
            "1e5",
            "1E-5f",
            "1.5e+3h",
            ".5e1f",
            "0x1p0",
            "0x.8p-3",
            "0X1.8P+2f",
            "0x1.f",
            "0x1.",
        ] {
            assert_eq!(number_problem(number), None, "{number}");
        }
        for number in [
            "4294967296u",
            "2147483648i",
            "9223372036854775808",
            "0x100000000u",
            "01",
            "00u",
            "1.5u",
            "1e5i",
            "0x",
            "0xp1",
            "0x.p1",
            "0x1p",
            "0x1pf",
            "1e",
            "1e+",
            "1e5x",
            "1x",
            "1.5.2",
            "12f3",
            "0x1.8pz",
            "0xg",
            "1uu",
            "1fi",
            "1_000",
        ] {
            assert!(number_problem(number).is_some(), "{number}");
        }
    }

    #[test]
    fn nesting_is_bounded_wherever_it_comes_from() {
        assert_eq!(check_nesting(""), Ok(()));
        let deep = MAX_NESTING + 1;
        for text in [
            "(".repeat(deep),
            format!("let a = {}1;", "-".repeat(deep)),
            format!("let a = 1{};", "+1".repeat(deep)),
            format!("if a {{}} {}", "else if b { let c = 1; } ".repeat(deep)),
            "1 < ".repeat(deep),
            "f(1+".repeat(deep / 2 + 1),
        ] {
            let found = check_nesting(&text).unwrap_err();
            assert!(found.1.contains("nested more than 192"), "{text}");
        }
        // The same amount side by side is no nesting.
        for text in [
            "f();".repeat(deep),
            "a[1],".repeat(deep),
            "if a { b(); } ".repeat(deep),
            "let a = 1 + 2;".repeat(deep),
            "let a = b < 2;".repeat(deep),
            "))))".repeat(deep),
        ] {
            assert_eq!(check_nesting(&text), Ok(()), "{text}");
        }
        let place = check_nesting(&"(".repeat(deep)).map_err(|(at, _)| at);
        assert_eq!(place, Err(MAX_NESTING));
    }

    #[test]
    fn what_takes_exponential_time_is_bounded_more_tightly() {
        for (open, limit) in [
            ("array<", MAX_OPEN_ANGLES),
            ("f(a < ", MAX_OPEN_ANGLES),
            ("a < b, ", MAX_OPEN_ANGLES),
            ("loop { ", MAX_LOOPS),
            ("loop { if a { ", MAX_LOOPS),
        ] {
            assert_eq!(check_nesting(&open.repeat(limit)), Ok(()), "{open}");
            assert!(check_nesting(&open.repeat(limit + 1)).is_err(), "{open}");
        }
        for text in [
            "array<vec4<f32>, 9>(vec4<f32>(1), vec4<f32>(2), ".repeat(20),
            "a < b && c > d || ".repeat(20),
            "if a < b { while c < d {} ".repeat(20),
            "if a < b { ".repeat(20),
            "loop { break; } ".repeat(20),
            "for (var i = 0; i < 4; i++) { ".repeat(20),
        ] {
            assert_eq!(check_nesting(&text), Ok(()), "{text}");
        }
    }
}
