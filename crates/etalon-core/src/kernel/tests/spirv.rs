//! SPIR-V: valid, and contracted only where it may be.

use std::io::Write as _;
use std::process::{Command, Stdio};

use super::*;

/// Opcodes of the instructions of a module, with their words.
fn instructions(words: &[u32]) -> Vec<(u16, &[u32])> {
    let mut rest = &words[5..];
    let mut found = Vec::new();
    while let Some(first) = rest.first() {
        let (instruction, after) = rest.split_at((first >> 16) as usize);
        found.push(((first & 0xffff) as u16, instruction));
        rest = after;
    }
    found
}

/// Results that may not be contracted.
fn decorated(words: &[u32]) -> Vec<u32> {
    let all = instructions(words).into_iter();
    all.filter(|(opcode, words)| *opcode == 71 && words[2] == 42)
        .map(|(_, words)| words[1])
        .collect()
}

/// Results of floating-point arithmetic: type and opcode by SPIR-V's numbers,
/// written down here a second time.
fn contractible(words: &[u32]) -> Vec<u32> {
    let all = instructions(words).into_iter();
    all.filter(|(opcode, _)| matches!(opcode, 127 | 129 | 131 | 133 | 136 | 140..=148))
        .map(|(_, words)| words[2])
        .collect()
}

fn all_arithmetic() -> String {
    evaluating(
        "-x + x - x * x / (x % 2.0) + (m * v).x + (v * m).y + (m * m)[0].x + (m * x)[0].y \
         + (v * x).z + dot(v, v) + length(v)",
    )
}

/// Asks the validator of the Khronos group, where it is installed.
fn validate(words: &[u32]) -> Option<Result<(), String>> {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let started = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.3", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = match started {
        Ok(child) => child,
        Err(error) => {
            eprintln!("spirv-val cannot be run ({error}): the SPIR-V is not validated");
            return None;
        }
    };
    child.stdin.take().unwrap().write_all(&bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    Some(if output.status.success() {
        Ok(())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    })
}

/// The capabilities that a module declares.
fn capabilities(words: &[u32]) -> Vec<u32> {
    let all = instructions(words).into_iter();
    all.filter(|(opcode, _)| *opcode == 17)
        .map(|(_, words)| words[1])
        .collect()
}

#[test]
fn half_floats_are_not_contracted_and_ask_for_no_more_than_they_need() {
    let (float16, storage, uniform, input) = (9, 4433, 4434, 4436);
    let text = |buffer: &str| {
        format!(
            "enable f16;
             @group(0) @binding(0) var<storage, read_write> data: array<{buffer}>;
             var<workgroup> kept: array<f16, 4>;
             @compute @workgroup_size(1) fn main() {{
                 kept[0] = f16(data[0]);
                 workgroupBarrier();
                 let h = kept[0];
                 let v = vec4(h, 1.0h, f16(data[1]), h);
                 let w = v * v + v - v * h / v;
                 data[2] = {buffer}(-w.x * w.y + w.z - h * 2.0h / w.w);
             }}"
        )
    };
    for (buffer, in_buffers) in [("f16", true), ("f32", false)] {
        let kernel = compile_one(&text(buffer), Arithmetic::Strict).unwrap();
        let words = spirv(
            &kernel,
            naga::ShaderStage::Compute,
            &SpirvOptions::default(),
        )
        .unwrap();
        let mut expected = contractible(&words);
        let mut found = decorated(&words);
        assert!(expected.len() >= 11, "{expected:?}");
        expected.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, expected);
        let asked = capabilities(&words);
        assert!(asked.contains(&float16), "{asked:?}");
        assert_eq!(asked.contains(&storage), in_buffers, "{asked:?}");
        assert!(
            !asked.contains(&uniform) && !asked.contains(&input),
            "{asked:?}"
        );
        if let Some(result) = validate(&words) {
            result.unwrap_or_else(|message| panic!("{message}"));
        }
    }
    let plain = compile_one(&evaluating("x * x"), Arithmetic::Strict).unwrap();
    let words = spirv(&plain, naga::ShaderStage::Compute, &SpirvOptions::default()).unwrap();
    assert!(!capabilities(&words).contains(&float16));
}

#[test]
fn contraction_is_forbidden_in_strict_kernels_only() {
    let text = evaluating("-x + x - x * x / v.x + (v * x).z + (m * x)[0].y");
    let strict = compile_one(&text, Arithmetic::Strict).unwrap();
    let words = spirv(
        &strict,
        naga::ShaderStage::Compute,
        &SpirvOptions::default(),
    )
    .unwrap();
    let mut expected = contractible(&words);
    let mut found = decorated(&words);
    assert!(expected.len() >= 9, "{expected:?}");
    expected.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, expected);

    let fast = compile_one(&text, Arithmetic::Fast).unwrap();
    let fast = spirv(&fast, naga::ShaderStage::Compute, &SpirvOptions::default()).unwrap();
    assert_eq!(decorated(&fast), [0_u32; 0]);
    // Nothing else is different.
    let plain: Vec<u32> = instructions(&words)
        .into_iter()
        .filter(|(opcode, words)| !(*opcode == 71 && words[2] == 42))
        .flat_map(|(_, words)| words.to_vec())
        .collect();
    assert_eq!(plain, fast[5..]);
}

/// Every opcode of the list does occur, so that none is there by mistake;
/// `OpFMod` and `OpOuterProduct` are not reachable from WGSL.
#[test]
fn every_arithmetic_opcode_of_wgsl_is_covered() {
    let kernel = compile_one(&all_arithmetic(), Arithmetic::Fast).unwrap();
    let words = spirv(
        &kernel,
        naga::ShaderStage::Compute,
        &SpirvOptions::default(),
    )
    .unwrap();
    let found: Vec<u16> = instructions(&words)
        .into_iter()
        .map(|(opcode, _)| opcode)
        .collect();
    for opcode in NO_CONTRACTION_OPCODES {
        let reachable = !matches!(opcode, 141 | 147);
        assert_eq!(found.contains(&opcode), reachable, "{opcode}");
    }
}

#[test]
fn the_validator_accepts_every_kernel() {
    let library = KernelLibrary::of(etalon_shaders::sources());
    let mut modules = Vec::new();
    for path in library.paths() {
        if !library.source(path).unwrap().contains("@compute") {
            continue;
        }
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let request = KernelRequest::new(path.to_owned());
            let kernel = library
                .get(&request, arithmetic)
                .unwrap_or_else(|e| panic!("{e}"));
            modules.push((format!("{path}, {arithmetic}"), kernel));
        }
    }
    modules.push((
        "arithmetic".to_owned(),
        compile_one(&all_arithmetic(), Arithmetic::Fast).unwrap(),
    ));
    let tile = "var<workgroup> tile: array<u32, 64>; var<workgroup> sum: atomic<u32>;
        @group(0) @binding(0) var<storage, read_write> o: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            tile[i] = o[i] / o[i + 1u]; workgroupBarrier(); atomicAdd(&sum, tile[63u - i]); workgroupBarrier();
            o[i] = atomicLoad(&sum) + dot4U8Packed(tile[0], 3u);
            for (var k = 0u; k < o[0]; k++) { o[k] = k; }
        }";
    modules.push((
        "workgroup".to_owned(),
        compile_one(tile, Arithmetic::Strict).unwrap(),
    ));
    let plain = SpirvOptions::default();
    let mut bounded = plain;
    bounded.bounded_loops = true;
    bounded.names = false;
    for (name, kernel) in &modules {
        for options in [plain, bounded] {
            let words = spirv(kernel, naga::ShaderStage::Compute, &options)
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(words[0], 0x0723_0203);
            assert_eq!(words[1], 0x0001_0300, "SPIR-V 1.3");
            match validate(&words) {
                Some(result) => assert_eq!(result, Ok(()), "{name}"),
                None => return,
            }
        }
    }
}

/// The validator does look: a decoration behind the types is refused.
#[test]
fn a_decoration_in_the_wrong_place_is_noticed() {
    let kernel = compile_one(&evaluating("x * x"), Arithmetic::Strict).unwrap();
    let mut words = spirv(
        &kernel,
        naga::ShaderStage::Compute,
        &SpirvOptions::default(),
    )
    .unwrap();
    let target = decorated(&words)[0];
    words.extend([3 << 16 | 71, target, 42]);
    if let Some(result) = validate(&words) {
        assert!(result.is_err());
    }
}

#[test]
fn options_change_what_they_say() {
    let text = "@group(0) @binding(0) var<storage, read_write> o: array<f32>;
        @group(0) @binding(3) var t: texture_2d<f32>;
        @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {
            for (var k = 0u; k < id.y; k++) { o[id.x + k] = textureLoad(t, id.xy, 0).x; }
        }";
    let kernel = compile_one(text, Arithmetic::Strict).unwrap();
    let count = |options: &SpirvOptions, opcode: u16| {
        let words = spirv(&kernel, naga::ShaderStage::Compute, options).unwrap();
        instructions(&words)
            .iter()
            .filter(|(it, _)| *it == opcode)
            .count()
    };
    let plain = SpirvOptions::default();
    // Clamping an index to the last element takes an `OpArrayLength`.
    assert!(count(&plain, 68) > 0);
    let mut unchecked = plain;
    unchecked.bounds_checks = naga::proc::BoundsCheckPolicies {
        index: naga::proc::BoundsCheckPolicy::Unchecked,
        buffer: naga::proc::BoundsCheckPolicy::Unchecked,
        image_load: naga::proc::BoundsCheckPolicy::Unchecked,
        binding_array: naga::proc::BoundsCheckPolicy::Unchecked,
    };
    assert_eq!(count(&unchecked, 68), 0);
    let mut bounded = plain;
    bounded.bounded_loops = true;
    assert!(count(&bounded, 59) > count(&plain, 59), "a variable more");
    let mut unnamed = plain;
    unnamed.names = false;
    assert!(count(&plain, 5) > 0);
    assert_eq!(count(&unnamed, 5), 0);
}
