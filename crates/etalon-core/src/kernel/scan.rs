//! A small lexer over WESL text, for the few things that have to be known of a
//! file before, or without, its syntax tree: which features its `@if`s name,
//! which overrides and bindings it declares, where a word stands, and how
//! deeply it nests.

/// What a [`Token`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TokenKind {
    /// Identifier or keyword.
    Word,
    /// Number literal.
    Number,
    /// One character of anything else.
    Punctuation,
    /// A block comment that never ends.
    Unclosed,
}

/// A piece of text that is neither white space nor comment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token<'a> {
    /// What it is.
    pub kind: TokenKind,
    /// Its text.
    pub text: &'a str,
    /// Byte offset in the scanned text.
    pub offset: usize,
}

/// Splits WESL text into tokens, skipping `//` and nested `/* */` comments.
pub(crate) fn tokens(text: &str) -> Tokens<'_> {
    Tokens { text, offset: 0 }
}

/// Iterator over the tokens of a text.
#[derive(Clone, Debug)]
pub(crate) struct Tokens<'a> {
    text: &'a str,
    offset: usize,
}

impl<'a> Tokens<'a> {
    fn rest(&self) -> &'a str {
        self.text.get(self.offset..).unwrap_or_default()
    }

    /// Moves behind white space and comments.
    fn skip_blank(&mut self) {
        loop {
            let rest = self.rest();
            let trimmed = rest.trim_start();
            self.offset += rest.len() - trimmed.len();
            if trimmed.starts_with("//") {
                self.offset += trimmed
                    .find([
                        '\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{2028}', '\u{2029}',
                    ])
                    .unwrap_or(trimmed.len());
            } else if trimmed.starts_with("/*")
                && let Some(len) = block_comment_len(trimmed)
            {
                self.offset += len;
            } else {
                return;
            }
        }
    }
}

/// Length of the block comment `text` starts with, if it ever ends.
fn block_comment_len(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut depth = 0_usize;
    let mut at = 0;
    while at < bytes.len() {
        match bytes.get(at..at + 2) {
            Some(b"/*") => {
                depth += 1;
                at += 2;
            }
            Some(b"*/") => {
                depth -= 1;
                at += 2;
                if depth == 0 {
                    return Some(at);
                }
            }
            _ => at += 1,
        }
    }
    None
}

/// Length of the number `text` starts with, including its suffix.
///
/// Generous: `1e+5`, `0x1p-3` and `1.5f` are one token each, and so would be
/// text that is no valid number. Only the extent matters here.
fn number_len(text: &str) -> usize {
    let hexadecimal = text.starts_with("0x") || text.starts_with("0X");
    let mut previous = ' ';
    for (at, character) in text.char_indices() {
        let exponent = if hexadecimal {
            matches!(previous, 'p' | 'P')
        } else {
            matches!(previous, 'e' | 'E')
        };
        let continues = character.is_ascii_alphanumeric()
            || character == '.'
            || character == '_'
            || (exponent && matches!(character, '+' | '-'));
        if !continues {
            return at;
        }
        previous = character;
    }
    text.len()
}

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        self.skip_blank();
        let rest = self.rest();
        let first = rest.chars().next()?;
        let second = rest.chars().nth(1);
        let number =
            first.is_ascii_digit() || (first == '.' && second.is_some_and(|c| c.is_ascii_digit()));
        let (kind, len) = if rest.starts_with("/*") {
            (TokenKind::Unclosed, rest.len())
        } else if number {
            (TokenKind::Number, number_len(rest))
        } else if first.is_alphabetic() || first == '_' {
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            (TokenKind::Word, end.unwrap_or(rest.len()))
        } else {
            (TokenKind::Punctuation, first.len_utf8())
        };
        let token = Token {
            kind,
            text: rest.get(..len)?,
            offset: self.offset,
        };
        self.offset += len;
        Some(token)
    }
}

impl Token<'_> {
    /// Whether this is a hexadecimal floating-point literal, or would be if it
    /// were valid.
    fn is_hex_float(&self) -> bool {
        let hexadecimal = self.text.starts_with("0x") || self.text.starts_with("0X");
        self.kind == TokenKind::Number && hexadecimal && self.text.contains(['.', 'p', 'P'])
    }
}

/// Whether a text has hexadecimal floating-point literals.
pub(crate) fn has_hex_float(text: &str) -> bool {
    tokens(text).any(|token| token.is_hex_float())
}

/// Replaces each hexadecimal floating-point literal by a decimal one of the
/// same length and type.
///
/// WESL 0.4 takes their exponent to be one of 16 instead of 2, and refuses
/// those with the suffix `f`.
pub(crate) fn hide_hex_floats(text: &str) -> String {
    let mut hidden = String::with_capacity(text.len());
    let mut copied = 0;
    for token in tokens(text).filter(Token::is_hex_float) {
        hidden.push_str(text.get(copied..token.offset).unwrap_or_default());
        copied = token.offset + token.text.len();
        // Without an exponent, `f` is a digit.
        let typed = token.text.contains(['p', 'P']);
        let suffix = token.text.chars().next_back();
        let suffix = suffix.filter(|c| typed && matches!(c, 'f' | 'h'));
        let digits = token.text.chars().count() - 2 - usize::from(suffix.is_some());
        hidden.push_str("1.");
        hidden.extend(std::iter::repeat_n('0', digits));
        hidden.extend(suffix);
    }
    hidden.push_str(text.get(copied..).unwrap_or_default());
    hidden
}

/// The names in `@if(…)` and `@elif(…)` conditions, in order, with repeats.
pub(crate) fn features(text: &str) -> Vec<&str> {
    let mut names = Vec::new();
    let mut tokens = tokens(text).peekable();
    while let Some(token) = tokens.next() {
        if token.text != "@" {
            continue;
        }
        let conditional = tokens.next_if(|t| matches!(t.text, "if" | "elif"));
        if conditional.is_none() || tokens.next_if(|t| t.text == "(").is_none() {
            continue;
        }
        let mut depth = 1_usize;
        for token in tokens.by_ref() {
            match token.text {
                "(" => depth += 1,
                ")" => depth -= 1,
                "true" | "false" => {}
                name if token.kind == TokenKind::Word => names.push(name),
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    names
}

/// What a file declares at module scope that a kernel's user can name.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Declared<'a> {
    /// Names of `override` declarations.
    pub overrides: Vec<&'a str>,
    /// Names of variables with a `@binding`.
    pub bindings: Vec<&'a str>,
}

/// Finds the overrides and bindings a file declares, under any condition.
pub(crate) fn declared(text: &str) -> Declared<'_> {
    let mut found = Declared::default();
    let mut depth = 0_usize;
    let mut bound = false;
    let mut tokens = tokens(text).peekable();
    while let Some(token) = tokens.next() {
        match token.text {
            "{" => depth += 1,
            "}" => {
                depth = depth.saturating_sub(1);
                bound = false;
            }
            ";" => bound = false,
            "@" => bound |= tokens.peek().is_some_and(|t| t.text == "binding"),
            "override" if depth == 0 => {
                found.overrides.extend(tokens.next().map(|t| t.text));
            }
            "var" if depth == 0 => {
                if tokens.next_if(|t| t.text == "<").is_some() {
                    tokens.by_ref().find(|t| t.text == ">");
                }
                if let Some(name) = tokens.next()
                    && bound
                {
                    found.bindings.push(name.text);
                }
            }
            _ => {}
        }
    }
    found
}

/// Offset of the first occurrence of `word` as a whole token.
pub(crate) fn find_word(text: &str, word: &str) -> Option<usize> {
    tokens(text)
        .find(|token| token.text == word)
        .map(|token| token.offset)
}

/// Offset of the `fn` of the function with the given name.
pub(crate) fn find_function(text: &str, name: &str) -> Option<usize> {
    let after = tokens(text).skip(1);
    tokens(text)
        .zip(after)
        .find(|(before, token)| before.text == "fn" && token.text == name)
        .map(|(before, _)| before.offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<&str> {
        tokens(text).map(|token| token.text).collect()
    }

    #[test]
    fn tokens_skip_comments_and_keep_numbers_whole() {
        assert_eq!(
            texts("a // b\n/* c /* d */ e */ f1(1.5e-3f, .5, 0x1p-2)"),
            ["a", "f1", "(", "1.5e-3f", ",", ".5", ",", "0x1p-2", ")"]
        );
        assert_eq!(texts("1-2"), ["1", "-", "2"]);
        assert_eq!(texts("a /* never ends"), ["a", "/* never ends"]);
        assert_eq!(texts("é→"), ["é", "→"]);
        assert_eq!(texts(""), Vec::<&str>::new());
        let offsets: Vec<_> = tokens(" a\n  bc").map(|t| t.offset).collect();
        assert_eq!(offsets, [1, 5]);
    }

    #[test]
    fn hexadecimal_floats_are_hidden_behind_decimals_of_their_length() {
        for (text, hidden) in [
            ("a + 0x1p-3; // 0x1p-3", "a + 1.0000; // 0x1p-3"),
            ("0x1.8p1f 0XA.p+2h 0x.8", "1.00000f 1.00000h 1.00"),
            // `f` is a digit here.
            ("0x1.f", "1.000"),
            // Not hexadecimal, or no floats.
            ("0x1f 1.5e-3f 0xepu", "0x1f 1.5e-3f 1.000"),
        ] {
            assert_eq!(hide_hex_floats(text), hidden);
            assert_eq!(text.len(), hidden.len());
            assert_eq!(has_hex_float(text), text != hidden);
        }
    }

    #[test]
    fn features_are_the_names_in_conditions() {
        let text = "@if(strict) const a = 1; // @if(no)\n@elif(!(x && strict)) const b = if(y);\n@else fn if_(z: f32) {}";
        assert_eq!(features(text), ["strict", "x", "strict"]);
        assert_eq!(features("@if(true || a"), ["a"]);
        assert_eq!(features("@if @if("), Vec::<&str>::new());
    }

    #[test]
    fn declarations_are_found_at_module_scope_only() {
        let text = "@group(0) @binding(0) var source: texture_2d<f32>;
            @if(strict) @binding(1) @group(0) var<storage, read_write> list: array<u32>;
            var<workgroup> tile: array<f32, 64>;
            @id(3) override radius: f32 = 1.0;
            fn f() { var local = 1; @binding(2) var x = 2; }
            override count: u32;";
        let found = declared(text);
        assert_eq!(found.overrides, ["radius", "count"]);
        assert_eq!(found.bindings, ["source", "list"]);
        assert_eq!(declared("var<"), Declared::default());
    }

    #[test]
    fn words_and_functions_are_found_whole_and_outside_of_comments() {
        let text = "// main\nlet mainly = 1; fn main() {} main";
        assert_eq!(find_word(text, "main"), text.find("main()"));
        assert_eq!(find_function(text, "main"), text.find("fn main"));
        assert_eq!(find_function(text, "mainly"), None);
    }
}
