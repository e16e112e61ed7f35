//! Places in generated text lead back to the files.

use super::*;

/// Constructs of every kind, each with numbers that occur only once, so that
/// where they stand can be found by searching the text.
const FILES: [(&str, &str); 3] = [
    (
        "test/kernel",
        "// Comments with numbers: 9000.5
import package::test::lib::{weight, Shape as Form};
import package::test::other;

/* Block /* nested 9001 */ */
struct Settings { @size(32) a: f32, // 9002
    b: vec3f,
    @if(absent) c: array<vec4f, 9003>,
    d: array<vec4f, 1001>,
}
@group(0) @binding(1002) var<uniform> settings: Settings;
@if(!strict)
@group(0)
@binding(1003) var source: texture_2d<f32>;
@group(0) @binding(1004) var<storage, read_write> output: array<f32>;
const TABLE = array<f32, 3>(1005.0, 1006.5,
    1007.25, );
@if(absent) fn gone() -> f32 { return 9004.0; }
override factor: f32 = 1008.0 + 1009.0;
var<workgroup> tile: array<u32, 1010>;
const_assert 1011 < 1012;

fn helper(
    x: f32,
    shape: Form,
    y: array<f32, 1013>,
) -> f32 {
    ;
    @if(absent) return 9005.0;
    @if(!absent) let z = x * 1014.0;
    @else let z = x * 9006.0;
    return z /* 9007 */ + shape.size - (y[1] + 1015.0);
}

@compute @workgroup_size(1, 1016 - 1015)
fn main(@builtin(global_invocation_id) id: vec3u) {
    var a = weight(1017.0) + other::deep(1018.0,
        1019.0); var b = 1020.0;
    if a < 1021.0 {
        b += 1022.0;
    } else if b > 1023.0 { b -= 1024.0; }
    else
    {
        b *= 1025.0;
    }
    for (var i = 1026; i < 1027; i += 1028) { if i == 1029 { continue; } b += f32(i); }
    loop {
        b += 1030.0;
        @if(absent) { b += 9008.0; }
        continuing { a += 1031.0; break if a > 1032.0; }
    }
    while b < 1033.0 { b += 0x1p-3; break; }
    switch i32(b) { case 1034, 1035: { b = 1036.0; } default { b = -1037.0; } }
    { let c = vec3f(1038.0, a, 1039.0).x; b += c; }
    let p = &output[1040]; *p = b;
    tile[1041 - 1040] = u32(b) | 1042u; workgroupBarrier();
    const local: array<f32, 1043> = array<f32, 1043>();
    var h: array<f32, 1013>; h[1044 - 1040] = TABLE[1];
    output[1045] = helper(b, Form(1046.0), h) + settings.d[1000].y + factor + f32(tile[i32(b) + 1048]) + local[0];
    @if(strict) { output[1049] = 1050.0; }
    @elif(absent) { output[9009] = 9010.0; }
    _ = id.x + 1051u;
}
",
    ),
    (
        "test/lib",
        "struct Shape { size: f32 }

// Nothing here.
fn weight(x: f32) -> f32 {
    return x *
        2001.0;
}
",
    ),
    (
        "test/other",
        "import super::lib::weight as w;
fn unused() -> f32 { return 9100.0; }
fn deep(x: f32, y: f32) -> f32 { if x > 3001.0 { return w(3002.0); } return y; }
",
    ),
];

fn compiled(arithmetic: Arithmetic) -> Arc<Kernel> {
    library(&FILES)
        .get(&KernelRequest::new("test/kernel"), arithmetic)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Every place where `word` stands whole in one of the files.
fn find(word: &str) -> Vec<SourceLocation> {
    let mut found = Vec::new();
    for (path, text) in FILES {
        for (line, text) in (1..).zip(text.lines()) {
            for (at, _) in text.match_indices(word) {
                let boundary =
                    |c: Option<char>| !c.is_some_and(|c| c.is_alphanumeric() || c == '_');
                if boundary(text[..at].chars().next_back())
                    && boundary(text[at + word.len()..].chars().next())
                {
                    found.push(SourceLocation {
                        file: format!("{path}.wesl"),
                        line,
                        column: u32::try_from(text[..at].chars().count()).unwrap() + 1,
                    });
                }
            }
        }
    }
    found
}

#[test]
fn every_number_leads_back_to_where_it_was_written() {
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let kernel = compiled(arithmetic);
        assert!(!kernel.wgsl.contains("900"), "{}", kernel.wgsl);
        let mut checked = 0;
        for token in scan::tokens(&kernel.wgsl) {
            let digits: String = token
                .text
                .chars()
                .take_while(char::is_ascii_digit)
                .collect();
            if digits.len() == 4 && token.kind == scan::TokenKind::Number {
                let found = kernel.source_map.locate_offset(token.offset);
                let places = find(token.text);
                assert!(
                    places.contains(&found),
                    "{}: {found}, not {places:?}",
                    token.text
                );
                checked += 1;
            }
        }
        // As many as the text above has, more or less those under `strict`.
        assert!(checked >= 50, "{checked}");
    }
}

#[test]
fn every_word_leads_back_to_itself() {
    let kernel = compiled(Arithmetic::Strict);
    let mut others = Vec::new();
    for token in scan::tokens(&kernel.wgsl) {
        let found = kernel.source_map.locate_offset(token.offset);
        assert_ne!(found.file, GENERATED, "{}", token.text);
        let written = match token.text.strip_prefix("package_") {
            Some(name) => name.rsplit('_').next().unwrap(),
            None => token.text,
        };
        if token.kind == scan::TokenKind::Word && !find(written).contains(&found) {
            others.push(format!("{written} {found}"));
        }
    }
    assert_eq!(
        others,
        [
            // Imported under another name, or written with its path.
            "Shape test/kernel.wesl:25:12",
            "deep test/kernel.wesl:37:30",
            // Behind code that is gone: the statement it is in.
            "continuing test/kernel.wesl:47:5",
            // Printed for `default`, which is a word less.
            "case test/kernel.wesl:53:5",
            "default test/kernel.wesl:53:5",
            "Shape test/kernel.wesl:59:30",
            "weight test/other.wesl:3:57",
        ]
    );
}

/// What the interpreter reports: the spans of expressions and statements.
#[test]
fn spans_of_the_module_lead_to_lines() {
    let kernel = compiled(Arithmetic::Strict);
    let literal = |function: &naga::Function, value: f32| {
        let (handle, _) = function
            .expressions
            .iter()
            .find(|(_, expression)| {
                **expression == naga::Expression::Literal(naga::Literal::F32(value))
            })
            .unwrap();
        kernel
            .source_map
            .locate(function.expressions.get_span(handle))
    };
    assert_eq!(literal(main(&kernel), 1022.0), find("1022.0")[0]);
    assert_eq!(
        literal(main(&kernel), 1022.0).to_string(),
        "test/kernel.wesl:40:14"
    );
    let weight = kernel
        .module
        .functions
        .iter()
        .find(|(_, function)| {
            function
                .name
                .as_deref()
                .unwrap_or_default()
                .ends_with("weight")
        })
        .unwrap()
        .1;
    assert_eq!(literal(weight, 2001.0).to_string(), "test/lib.wesl:6:9");
    // The product as a whole begins a line before.
    let (product, _) = weight
        .expressions
        .iter()
        .find(|(_, expression)| matches!(expression, naga::Expression::Binary { .. }))
        .unwrap();
    let product = kernel
        .source_map
        .locate(weight.expressions.get_span(product));
    assert_eq!(product.to_string(), "test/lib.wesl:5:12");
}

#[test]
fn an_error_in_an_imported_function_names_its_file_and_line() {
    for (planted, place) in [
        ("        2001u;", "test/lib.wesl:5:12"),
        ("        undefined;", "test/lib.wesl:6:9"),
        ("        exp(x);", "test/lib.wesl:6:9"),
    ] {
        let mut files = FILES;
        let text = files[1].1.replace("        2001.0;", planted);
        files[1].1 = &text;
        let error = library(&files)
            .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
            .unwrap_err();
        assert_eq!(error.location().unwrap().to_string(), place, "{error}");
        assert!(
            error
                .to_string()
                .contains(&text.lines().nth(5).unwrap()[..0]),
            "{error}"
        );
        // Names are as written, without the file's path in them.
        assert!(!error.to_string().contains("package_"), "{error}");
    }
}

#[test]
fn removed_code_and_comments_before_a_place_do_not_shift_it() {
    let tail = "@compute @workgroup_size(1)\nfn main() { let a = 1 + missing; }";
    let place = |head: &str| {
        let error = error_of(&format!("{head}{tail}"));
        error.location().unwrap().clone()
    };
    let base = place("");
    assert_eq!((base.line, base.column), (2, 25));
    for head in [
        "// comment\n",
        "/* comment\n over lines */\n",
        "@if(strict)\nfn gone() {}\n",
        "@if(strict) const A = 1;\n@else const A = 2;\n",
        "const KEPT = 1.50000;\n",
        "fn kept() {\n\n\n\n}\n",
        ";\n;\n",
    ] {
        let found = place(head);
        let lines = u32::try_from(head.matches('\n').count()).unwrap();
        assert_eq!(
            (found.line, found.column),
            (base.line + lines, base.column),
            "{head:?}"
        );
    }
}

#[test]
fn places_outside_of_everything_are_in_the_generated_text() {
    let kernel = compiled(Arithmetic::Strict);
    let map = &kernel.source_map;
    let between = kernel.wgsl.find("}\n\n").unwrap() + 2;
    assert_eq!(map.locate_offset(between).file, GENERATED);
    for offset in [kernel.wgsl.len(), kernel.wgsl.len() + 1, usize::MAX] {
        assert_eq!(map.locate_offset(offset).file, GENERATED);
    }
    assert_eq!(map.generated(), kernel.wgsl);
}

#[test]
fn directives_lead_back_too() {
    let error =
        error_of("// comment\nenable\n  subgroups; @compute @workgroup_size(1) fn main() {}");
    assert_eq!(
        error.location().unwrap().to_string(),
        "test/one.wesl:3:3",
        "{error}"
    );
}

#[test]
fn columns_count_characters() {
    let error = error_of("@compute @workgroup_size(1) fn main() { /* äöü→ */ let x = missing; }");
    let location = error.location().unwrap();
    assert_eq!(location.to_string(), "test/one.wesl:1:60");
}
