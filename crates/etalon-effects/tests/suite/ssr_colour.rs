//! What becomes of a reflection once it is found: looked up, blurred, mixed.

use crate::common;

use common::{Run, image, texels};
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_effects::ssr::{Blend, blur, mix, resolve};

#[test]
fn one_march_serves_several_colours() {
    // The reflection buffer is looked up bilinearly and weighted by visibility.
    let reflection = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [0.25, 0.5, 1.0, 1.0], // centre of texel 0 of 2
        1 => [0.5, 0.5, 1.0, 1.0],  // halfway between the two
        2 => [0.75, 0.5, 0.5, 1.0], // centre of texel 1, half visible
        _ => [0.75, 0.5, 0.0, 1.0], // not visible
    });
    let first = image(Format::Rgba16Float, 2, 1, |x, _| {
        if x == 0 {
            [1.0, 2.0, 4.0, 1.0]
        } else {
            [3.0, 0.0, 8.0, 1.0]
        }
    });
    let second = image(Format::Rgba16Float, 2, 1, |x, _| {
        if x == 0 {
            [f32::NAN, -1.0, f32::INFINITY, 1.0]
        } else {
            [0.5; 4]
        }
    });
    let resolved = |colour: &ImageData| {
        let mut run = Run::new();
        let (reflection, colour) = (
            run.import("reflection", &reflection),
            run.import("colour", colour),
        );
        let result = resolve(&mut run.graph, reflection, colour).expect("valid handles");
        texels(&run.output(result))
    };
    assert_eq!(
        resolved(&first),
        [
            [1.0, 2.0, 4.0, 1.0],
            [2.0, 1.0, 6.0, 1.0],
            [1.5, 0.0, 4.0, 0.5],
            [0.0; 4]
        ]
    );
    // A texel that is no number is none of its neighbours' business.
    let second = resolved(&second);
    assert_eq!(second[0], [0.0, 0.0, 65_504.0, 1.0]);
    assert_eq!(second[2], [0.25, 0.25, 0.25, 0.5]);
}

#[test]
fn the_blur_is_a_box() {
    let (width, height) = (23_usize, 11_usize);
    let value = |x: usize, y: usize| (common::hash((x + 31 * y) as u32) % 256) as f32;
    let source = image(Format::Rgba16Float, width as u32, height as u32, |x, y| {
        [value(x as usize, y as usize), 1.0, 0.0, 0.5]
    });
    for radius in [0_i64, 1, 3, 30] {
        let mut run = Run::new();
        let handle = run.import("source", &source);
        let result = blur(&mut run.graph, handle, radius as u32).expect("a valid radius");
        let result = texels(&run.output(result));
        let n = (2 * radius + 1) as f64;
        for y in 0..height as i64 {
            for x in 0..width as i64 {
                let mut sum = 0.0;
                for dy in -radius..=radius {
                    for dx in -radius..=radius {
                        let (x, y) = (
                            (x + dx).clamp(0, width as i64 - 1),
                            (y + dy).clamp(0, height as i64 - 1),
                        );
                        sum += f64::from(value(x as usize, y as usize));
                    }
                }
                let exact = sum / (n * n);
                let texel = result[y as usize * width + x as usize];
                // Rounded to f16 after each axis, 2^-11 each.
                assert!(
                    (f64::from(texel[0]) - exact).abs() <= exact * 0.000_98 + 1e-6,
                    "{radius}: {texel:?} for {exact}"
                );
                assert_eq!(texel[1..], [1.0, 0.0, 0.5]);
            }
        }
    }
    let mut run = Run::new();
    let handle = run.import("source", &source);
    assert!(blur(&mut run.graph, handle, 65).is_err());
}

#[test]
fn the_specular_map_says_how_much_and_how_sharp() {
    let scene = image(Format::Rgba16Float, 4, 1, |_, _| [1.0, 1.0, 1.0, 0.25]);
    let specular = image(Format::Rgba8Unorm, 4, 1, |x, _| match x {
        0 => [0.0, 0.0, 0.0, 1.0],
        1 => [1.0, 1.0, 1.0, 1.0],
        2 => [1.0, 0.2, 0.0, 0.0],
        _ => [1.0, 1.0, 1.0, 0.6],
    });
    let sharp = image(Format::Rgba16Float, 4, 1, |_, _| [4.0, 4.0, 4.0, 0.5]);
    let blurred = image(Format::Rgba16Float, 4, 1, |_, _| [2.0, 2.0, 2.0, 0.25]);
    let mixed = |with_blur: bool, blend: Blend| {
        let mut run = Run::new();
        let handles = [
            ("scene", &scene),
            ("specular", &specular),
            ("sharp", &sharp),
            ("blurred", &blurred),
        ]
        .map(|(name, image)| run.import(name, image));
        let blurred = with_blur.then_some(handles[3]);
        let result = mix(
            &mut run.graph,
            handles[0],
            handles[1],
            handles[2],
            blurred,
            blend,
        )
        .expect("equal sizes");
        texels(&run.output(result))
    };
    let close = |got: &[f32; 4], expected: [f32; 4]| {
        // One rounding to f16.
        let near = got
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() <= b * 0.000_5);
        assert!(near, "{got:?} for {expected:?}");
    };
    let added = mixed(true, Blend::Add);
    close(&added[0], [1.0, 1.0, 1.0, 0.25]);
    close(&added[1], [5.0, 5.0, 5.0, 0.25]);
    close(&added[2], [3.0, 1.4, 1.0, 0.25]);
    // Shininess 0.6: 0.6 · 4 + 0.4 · 2 = 3.2.
    close(&added[3], [4.2, 4.2, 4.2, 0.25]);
    let replaced = mixed(true, Blend::Replace);
    close(&replaced[0], [1.0, 1.0, 1.0, 0.25]);
    close(&replaced[1], [4.5, 4.5, 4.5, 0.25]);
    // Visibility 0.25: 1 - 0.25 + 2, and 1 - 0.2 · 0.25 + 0.2 · 2.
    close(&replaced[2], [2.75, 1.35, 1.0, 0.25]);
    // Without a blurred reflection every surface is sharp.
    close(&mixed(false, Blend::Add)[2], [5.0, 1.8, 1.0, 0.25]);
}

#[test]
fn a_specular_map_of_any_kind_is_read_alike() {
    let scene = image(Format::Rgba16Float, 4, 1, |_, _| [1.0; 4]);
    let sharp = image(Format::Rgba16Float, 4, 1, |_, _| [4.1, 0.3, 700.0, 0.5]);
    let blurred = image(Format::Rgba16Float, 4, 1, |_, _| [2.3, 0.7, 90.0, 0.25]);
    let mixed = |specular: &ImageData| {
        let mut run = Run::new();
        let handles = [
            ("scene", &scene),
            ("specular", specular),
            ("sharp", &sharp),
            ("blurred", &blurred),
        ]
        .map(|(name, image)| run.import(name, image));
        let result = mix(
            &mut run.graph,
            handles[0],
            handles[1],
            handles[2],
            Some(handles[3]),
            Blend::Add,
        );
        texels(&run.output(result.expect("equal sizes")))
    };
    // What is no share of anything counts as the nearest that is.
    let odd = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [f32::NAN, -1.0, f32::INFINITY, 1.0],
        1 => [0.5, 0.5, 0.5, f32::NAN],
        2 => [0.5, 0.5, 0.5, 7.0],
        _ => [f32::NEG_INFINITY; 4],
    });
    let meant = image(Format::Rgba32Float, 4, 1, |x, _| match x {
        0 => [0.0, 0.0, 1.0, 1.0],
        1 => [0.5, 0.5, 0.5, 0.0],
        2 => [0.5, 0.5, 0.5, 1.0],
        _ => [0.0; 4],
    });
    assert_eq!(mixed(&odd), mixed(&meant));
}

#[test]
fn eight_bit_shares_give_the_same_bits_however_they_are_decoded() {
    // Every share with every shininess: some of their products with light lie
    // so near a boundary of f16 that the last bit of a share decides.
    let (width, height) = (256, 256);
    let light = |seed: u32| {
        image(Format::Rgba16Float, width, height, move |x, y| {
            let random = |c: u32| common::hash(x ^ (y << 8) ^ (c << 16) ^ seed) % 1024;
            [0, 1, 2, 3].map(|c| 1.0 + random(c) as f32 / 1024.0)
        })
    };
    let black = image(Format::Rgba16Float, width, height, |_, _| [0.0; 4]);
    let (sharp, blurred) = (light(1 << 20), light(1 << 21));
    let mixed = |specular: &ImageData| {
        let mut run = Run::new();
        let handles = [
            ("scene", &black),
            ("specular", specular),
            ("sharp", &sharp),
            ("blurred", &blurred),
        ]
        .map(|(name, image)| run.import(name, image));
        let [scene, specular, sharp, blurred] = handles;
        let result = mix(
            &mut run.graph,
            scene,
            specular,
            sharp,
            Some(blurred),
            Blend::Add,
        );
        texels(&run.output(result.expect("equal sizes")))
    };
    let code = |k: u32| k as f32 / 255.0;
    let exact = image(Format::Rgba8Unorm, width, height, |x, y| {
        [code(x), code(x), code(x), code(y)]
    });
    let off = image(Format::Rgba32Float, width, height, |x, y| {
        let share = code(x);
        [
            share.next_down(),
            share,
            share.next_up(),
            code(y).next_down(),
        ]
    });
    let (exact, off) = (mixed(&exact), mixed(&off));
    let differ = exact
        .iter()
        .zip(&off)
        .filter(|(a, b)| a[..3] != b[..3])
        .count();
    assert_eq!(differ, 0);
}
