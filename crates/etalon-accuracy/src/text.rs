//! Numbers and names as people read them.

use std::collections::BTreeMap;

use etalon_scenes::FrameSize;

/// The size of a picture, given as `640x360`.
///
/// # Errors
/// In words, if the text says none or none that is possible.
pub fn size(text: &str) -> Result<FrameSize, String> {
    let sides = text.split_once(['x', '×']);
    let sides = sides.and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) = sides.ok_or_else(|| format!("`{text}` is no size like 640x360"))?;
    FrameSize::new(width, height).map_err(|error| error.to_string())
}

/// Text for HTML and SVG, in elements and in quoted attributes. Characters that XML
/// cannot hold at all become U+FFFD.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' | '\r' => escaped.push(character),
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            control if control < ' ' => escaped.push('\u{fffd}'),
            other => escaped.push(other),
        }
    }
    escaped
}

/// A figure in three significant digits; 0 is `0` and nothing else is.
#[must_use]
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return if value.is_nan() {
            "not a number"
        } else if value > 0.0 {
            "∞"
        } else {
            "−∞"
        }
        .to_owned();
    }
    let magnitude = value.abs();
    let sign = if value < 0.0 { "−" } else { "" };
    // By way of scientific notation, which rounds first and then counts digits.
    let scientific = format!("{magnitude:.2e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-3..5).contains(&exponent) {
        format!("{sign}{magnitude:.*}", (2 - exponent).max(0) as usize)
    } else {
        format!("{sign}{mantissa}×10{}", superscript(exponent))
    }
}

/// A whole number, raised.
pub(crate) fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|digit| match digit {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => digit
                .to_digit(10)
                .and_then(|digit| char::from_u32('⁰' as u32 + digit))
                .unwrap_or(digit),
        })
        .collect()
}

/// A number with its unit, if it has one.
pub(crate) fn quantity(value: f64, unit: &str) -> String {
    if unit.is_empty() {
        number(value)
    } else {
        format!("{} {unit}", number(value))
    }
}

/// The unit that a time in nanoseconds is best told in, and its size in them.
fn time_unit(nanoseconds: f64) -> (f64, &'static str) {
    match nanoseconds.abs() {
        // What rounds to a thousand is one of the next.
        time if time < 999.5 => (1.0, "ns"),
        time if time < 999.5e3 => (1e3, "µs"),
        time if time < 999.5e6 => (1e6, "ms"),
        _ => (1e9, "s"),
    }
}

/// A time in nanoseconds, in three significant digits.
#[must_use]
pub fn time(nanoseconds: f64) -> String {
    let (size, unit) = time_unit(nanoseconds);
    format!("{} {unit}", number(nanoseconds / size))
}

/// Bytes, in three significant digits.
#[must_use]
pub fn bytes(bytes: u64) -> String {
    let mut value = bytes as f64;
    if value < 1024.0 {
        return format!("{bytes} B");
    }
    let mut unit = "B";
    for next in ["KiB", "MiB", "GiB", "TiB"] {
        if value < 999.5 {
            break;
        }
        value /= 1024.0;
        unit = next;
    }
    format!("{} {unit}", number(value))
}

/// A whole number, its digits in groups of three.
pub(crate) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut grouped = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            // Narrow, and no place to break a line.
            grouped.push('\u{202f}');
        }
        grouped.push(digit);
    }
    grouped
}

/// Settings in one line.
pub(crate) fn settings(settings: &BTreeMap<String, String>) -> String {
    if settings.is_empty() {
        return "nothing to set".to_owned();
    }
    let each: Vec<String> = settings
        .iter()
        .map(|(knob, value)| format!("{knob} {value}"))
        .collect();
    each.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_short_and_zero_is_only_zero() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1.00"),
            (0.012_345, "0.0123"),
            (123.456, "123"),
            (99_999.0, "1.00×10⁵"),
            (99_899.0, "99899"),
            (0.999_9, "1.00"),
            (1e-9, "1.00×10⁻⁹"),
            (-2.5e12, "−2.50×10¹²"),
            (f64::INFINITY, "∞"),
            (f64::NAN, "not a number"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(superscript(-9_876_543), "⁻⁹⁸⁷⁶⁵⁴³");
        assert_eq!(superscript(2_010), "²⁰¹⁰");
    }

    #[test]
    fn times_and_sizes_have_the_unit_that_suits() {
        for (nanoseconds, text) in [
            (0.0, "0 ns"),
            (12.0, "12.0 ns"),
            (999.6, "1.00 µs"),
            (1.5e6, "1.50 ms"),
            (2e9, "2.00 s"),
            (7.2e12, "7200 s"),
        ] {
            assert_eq!(time(nanoseconds), text);
        }
        for (size, text) in [
            (0, "0 B"),
            (1023, "1023 B"),
            (1024, "1.00 KiB"),
            (1024 * 1024 * 3 / 2, "1.50 MiB"),
            (1000 * 1024, "0.977 MiB"),
        ] {
            assert_eq!(bytes(size), text);
        }
        assert_eq!(count(7), "7");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
    }

    #[test]
    fn sizes_are_two_numbers() {
        for text in ["640x360", "640×360"] {
            assert_eq!(size(text), Ok(FrameSize::new(640, 360).unwrap()));
        }
        for text in ["", "640", "640x", "x360", "-1x5", "640x360x2", "a×b"] {
            assert_eq!(size(text), Err(format!("`{text}` is no size like 640x360")));
        }
        assert!(size("0x5").is_err() && size("99999x99999").is_err());
    }

    #[test]
    fn text_cannot_become_markup() {
        assert_eq!(
            escape("<a href=\"x\" b='y'>&\u{1}"),
            "&lt;a href=&quot;x&quot; b=&#39;y&#39;&gt;&amp;\u{fffd}"
        );
    }
}
