//! Every format, shape, mip and layer goes to the device and comes back.

use crate::common;

use common::{execute, on_each, plan, reds};
use etalon_ash::AshBackend;
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon_core::format::{SampleKind, StorageSupport};
use etalon_core::graph::{ClearValue, Graph, Texture};
use etalon_core::image::ImageData;
use etalon_core::plan::Capture;
use etalon_core::resource::{Dimension, Extent, SamplerDesc, TextureDesc};
use etalon_core::texel::Texel;

/// An image whose texels are all different, as far as the format goes, and
/// such as the format can hold: depths from 0 to 1, no NaN.
fn pattern(desc: TextureDesc) -> ImageData {
    let mut image = ImageData::zeroed(desc).unwrap();
    let size = desc.format.texel_bytes() as usize;
    for (index, texel) in image.bytes.chunks_exact_mut(size).enumerate() {
        let value = |channel: usize| ((index * 7 + channel * 3) % 101) as f32 / 101.0;
        let whole = |channel: usize| (index * 7 + channel * 3) as i32 % 101;
        let values = match desc.format.sample_kind() {
            SampleKind::Float | SampleKind::Depth => {
                Texel::Float([value(0), value(1), value(2), value(3)])
            }
            SampleKind::Sint => Texel::Sint([whole(0), -whole(1), whole(2), -whole(3)]),
            SampleKind::Uint => Texel::Uint([0, 1, 2, 3].map(|channel| whole(channel) as u32)),
        };
        desc.format.encode(values, texel);
    }
    image
}

/// Copies an import to a transient, and that to an output. `None` if the
/// device does not have such textures, which it says by an error.
fn round_trip(backend: &mut AshBackend, source: &ImageData) -> Option<ImageData> {
    let mut graph = Graph::new();
    let input = graph.import_texture("source", source.desc).unwrap();
    let middle = graph.texture("middle", source.desc);
    let middle = graph.copy(input, middle).unwrap();
    let result = graph.texture("result", source.desc);
    let result = graph.copy(middle, result).unwrap();
    graph.output("result", result).unwrap();
    let plan = plan(backend, &graph, Capture::Outputs);
    match backend.execute(&plan, &Inputs::new().texture("source", source)) {
        Ok(execution) => execution.output("result").cloned(),
        Err(BackendError::Unsupported { .. }) => None,
        Err(error) => panic!("{}: {error}", source.desc.format),
    }
}

fn shaped(format: Format, dimension: Dimension, extent: [u32; 3], mips: u32) -> TextureDesc {
    let [width, height, depth_or_layers] = extent;
    TextureDesc {
        dimension,
        extent: Extent {
            width,
            height,
            depth_or_layers,
        },
        mips,
        format,
    }
}

#[test]
fn every_format_comes_back_bit_for_bit() {
    on_each(|backend| {
        let mut unsupported = Vec::new();
        for &format in Format::ALL {
            let source = pattern(shaped(format, Dimension::D2, [13, 7, 3], 3));
            match round_trip(backend, &source) {
                Some(result) => assert_eq!(result, source, "{format}"),
                None => unsupported.push(format),
            }
        }
        println!("not supported: {unsupported:?}");
        // What WebGPU has on every device.
        assert!(
            unsupported
                .iter()
                .all(|format| format.storage() != StorageSupport::Core),
            "{unsupported:?}"
        );
    });
}

#[test]
fn every_shape_comes_back_bit_for_bit() {
    on_each(|backend| {
        for desc in [
            shaped(Format::R8Unorm, Dimension::D2, [5, 3, 1], 1),
            shaped(Format::R8Unorm, Dimension::D2, [33, 17, 5], 6),
            shaped(Format::Rgba16Float, Dimension::Cube, [8, 8, 6], 4),
            shaped(Format::Rgba8Unorm, Dimension::Cube, [4, 4, 12], 3),
            shaped(Format::R32Float, Dimension::D3, [9, 6, 5], 4),
            shaped(Format::R16Float, Dimension::D3, [3, 2, 7], 2),
        ] {
            let source = pattern(desc);
            let result = round_trip(backend, &source);
            assert_eq!(result.as_ref(), Some(&source), "{desc:?}");
        }
    });
}

#[test]
fn clears_are_rounded_as_the_format_says() {
    on_each(|backend| {
        for &format in Format::ALL {
            let value = match format.sample_kind() {
                SampleKind::Float | SampleKind::Depth => ClearValue::Float([0.1, 0.3, 0.7, 0.9]),
                SampleKind::Sint => ClearValue::Sint([-5, 6, -7, 8]),
                SampleKind::Uint => ClearValue::Uint([5, 6, 7, 8]),
            };
            let texel = match value {
                ClearValue::Float(value) => Texel::Float(value),
                ClearValue::Sint(value) => Texel::Sint(value),
                ClearValue::Uint(value) => Texel::Uint(value),
            };
            let mut expected = vec![0; format.texel_bytes() as usize];
            format.encode(texel, &mut expected);
            let desc = TextureDesc::d2(3, 2, format);
            let mut graph = Graph::new();
            let image = graph.texture("image", desc);
            let image = graph.clear(image, value).unwrap();
            graph.output("image", image).unwrap();
            let plan = plan(backend, &graph, Capture::Outputs);
            match backend.execute(&plan, &Inputs::new()) {
                Ok(execution) => {
                    let result = execution.output("image").unwrap();
                    for found in result.bytes.chunks_exact(expected.len()) {
                        assert_eq!(found, expected, "{format}");
                    }
                }
                Err(BackendError::Unsupported { .. }) => println!("not supported: {format}"),
                Err(error) => panic!("{format}: {error}"),
            }
        }
    });
}

/// The parts that a plan which captures every pass brings back.
fn captured(backend: &mut AshBackend, graph: &Graph, inputs: &Inputs<'_>) -> Vec<ImageData> {
    let plan = plan(backend, graph, Capture::EveryPass);
    let execution = backend.execute(&plan, inputs).unwrap();
    let images = execution.captures.into_iter().map(|captured| {
        let CapturedData::Texture(image) = captured.data else {
            panic!("no texture");
        };
        image
    });
    images.collect()
}

#[test]
fn parts_are_captured_as_textures_of_their_own() {
    on_each(|backend| {
        let desc = shaped(Format::R32Float, Dimension::Cube, [8, 8, 6], 3);
        let clear = |graph: &mut Graph, texture: Texture, mip: u32, layer: u32| {
            let value = ClearValue::Float([(10 * mip + layer) as f32; 4]);
            graph.clear(texture.mip(mip).layer(layer), value).unwrap()
        };
        let mut graph = Graph::new();
        let mut texture = graph.texture("cube", desc);
        for mip in 0..3 {
            for layer in 0..6 {
                texture = clear(&mut graph, texture, mip, layer);
            }
        }
        graph.output("cube", texture).unwrap();
        let images = captured(backend, &graph, &Inputs::new());
        assert_eq!(images.len(), 18);
        for (index, image) in images.iter().enumerate() {
            let (mip, layer) = (index as u32 / 6, index as u32 % 6);
            let size = 8 >> mip;
            assert_eq!(image.desc, TextureDesc::d2(size, size, Format::R32Float));
            assert_eq!(image.bytes.len() as u32, size * size * 4);
            assert!(reds(image).iter().all(|v| *v == (10 * mip + layer) as f32));
        }
        // The whole is a cube.
        let execution = execute(backend, &graph, &Inputs::new());
        let whole = execution.output("cube").unwrap();
        assert_eq!(whole.desc, desc);
        let texel = |layer, mip| whole.texel(0, 0, layer, mip).unwrap().to_f32()[0];
        assert_eq!(texel(4, 2), 24.0);
        assert_eq!(texel(1, 0), 1.0);
    });
}

#[test]
fn cubes_are_sampled_and_arrays_written() {
    on_each(|backend| {
        let desc = TextureDesc::cube(4, Format::Rgba16Float);
        let mut source = ImageData::zeroed(desc).unwrap();
        for layer in 0..6 {
            for (x, y) in (0..4).flat_map(|y| (0..4).map(move |x| (x, y))) {
                let texel = Texel::Float([layer as f32, 0.0, 0.0, 1.0]);
                source.set_texel(x, y, layer, 0, texel).unwrap();
            }
        }
        let mut graph = Graph::new();
        let input = graph.import_texture("source", desc).unwrap();
        let target = shaped(Format::Rgba16Float, Dimension::D2, [5, 3, 6], 1);
        let result = graph.texture("result", target);
        let result = graph
            .compute("test/faces")
            .read("source", input)
            .write("result", result)
            .sampler("filtering", SamplerDesc::default())
            .per_texel("result")
            .unwrap();
        graph.output("result", result).unwrap();
        let execution = execute(backend, &graph, &Inputs::new().texture("source", &source));
        let result = execution.output("result").unwrap();
        for (position, texel) in result.texels(0) {
            assert_eq!(texel.to_f32()[0], position.layer as f32, "{position:?}");
        }
    });
}

#[test]
fn volumes_are_written_and_captured() {
    on_each(|backend| {
        let desc = TextureDesc::d3(6, 5, 3, Format::R32Float);
        let mut graph = Graph::new();
        let result = graph.texture("volume", desc);
        let result = graph
            .compute("test/volume")
            .write("result", result)
            .per_texel("result")
            .unwrap();
        graph.output("volume", result).unwrap();
        let execution = execute(backend, &graph, &Inputs::new());
        let result = execution.output("volume").unwrap();
        assert_eq!(result.desc, desc);
        for (at, texel) in result.texels(0) {
            let expected = (at.x + 10 * at.y + 100 * at.layer) as f32;
            assert_eq!(texel.to_f32()[0], expected, "{at:?}");
        }
    });
}
