//! Uploads, clears, copies and captures of every format and shape.

use crate::common::{Route, copy_kernel, everywhere, image, library, on_vulkan, plan, run};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Execution, Inputs};
use etalon_core::format::{SampleKind, StorageSupport};
use etalon_core::graph::{ClearValue, Graph, Subresources};
use etalon_core::image::ImageData;
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::Capture;
use etalon_core::resource::{BufferDesc, Dimension, Extent, TextureDesc};
use etalon_core::texel::Texel;
use etalon_wgpu::WgpuBackend;

fn desc(dimension: Dimension, width: u32, height: u32, depth: u32, mips: u32) -> TextureDesc {
    TextureDesc {
        dimension,
        extent: Extent {
            width,
            height,
            depth_or_layers: depth,
        },
        mips,
        format: Format::R8Uint,
    }
}

/// Plans and runs; what the device cannot do must be said with the format, and
/// only OpenGL may lack anything.
fn attempt(
    route: Route,
    backend: &mut WgpuBackend,
    graph: &Graph,
    inputs: &Inputs<'_>,
    format: Format,
) -> Option<Execution> {
    let plan = plan(backend, graph, &KernelLibrary::new(), Capture::Outputs);
    match backend.execute(&plan, inputs) {
        Ok(execution) => Some(execution),
        Err(BackendError::Unsupported { step, what }) if route == Route::Gl => {
            assert!(
                [format.name(), "cube", "3D"]
                    .iter()
                    .any(|text| what.contains(text)),
                "{step}: {what}"
            );
            println!("{route:?}: {step}: {what}");
            None
        }
        Err(error) => panic!("{route:?}, {format}: {error}"),
    }
}

#[test]
fn every_format_and_shape_comes_back_as_it_went() {
    let shapes = [
        desc(Dimension::D2, 13, 7, 1, 1),
        desc(Dimension::D2, 70, 9, 3, 4),
        desc(Dimension::Cube, 9, 9, 6, 3),
        desc(Dimension::Cube, 5, 5, 12, 1),
        desc(Dimension::D3, 6, 5, 7, 3),
        desc(Dimension::D2, 1, 1, 1, 1),
    ];
    everywhere(|route, backend| {
        let mut carried = 0;
        for &format in Format::ALL {
            for shape in shapes {
                let desc = shape.with_format(format);
                let depth = format.sample_kind() == SampleKind::Depth;
                if depth && desc.dimension == Dimension::D3 {
                    continue;
                }
                let image = image(desc);
                let mut graph = Graph::new();
                let source = graph.import_texture("image", desc).unwrap();
                // Through a copy as well, so that it is not just the upload.
                let copied = graph.texture("copied", desc);
                let copied = graph.copy(source, copied).unwrap();
                graph.output("copied", copied).unwrap();
                let inputs = Inputs::new().texture("image", &image);
                let Some(execution) = attempt(route, backend, &graph, &inputs, format) else {
                    continue;
                };
                let result = execution.output("copied").unwrap();
                assert_eq!(result.desc, image.desc, "{format}");
                assert!(result.bytes == image.bytes, "{route:?}: {desc:?}");
                carried += 1;
            }
        }
        // OpenGL reads back what it renders to; these at the least.
        let least = if route == Route::Gl {
            40
        } else {
            Format::ALL.len() * 5
        };
        assert!(carried >= least, "{route:?} carried {carried} only");
    });
}

/// A value of the format's kind that it stores exactly or by rounding.
fn clear_value(format: Format) -> (ClearValue, Texel) {
    match format.sample_kind() {
        SampleKind::Float | SampleKind::Depth => {
            let value = [0.7, 0.1, 0.45, 0.9];
            (ClearValue::Float(value), Texel::Float(value))
        }
        SampleKind::Sint => {
            let value = [-100, 27, 3, -1];
            (ClearValue::Sint(value), Texel::Sint(value))
        }
        SampleKind::Uint => {
            let value = [200, 13, 255, 1];
            (ClearValue::Uint(value), Texel::Uint(value))
        }
    }
}

#[test]
fn clears_store_what_the_codec_stores_and_nothing_beside() {
    let shapes = [
        desc(Dimension::D2, 300, 5, 1, 1),
        // More rows than one band of copies has.
        desc(Dimension::D2, 65, 1500, 2, 3),
        desc(Dimension::D3, 12, 9, 20, 2),
        desc(Dimension::Cube, 8, 8, 6, 2),
    ];
    everywhere(|route, backend| {
        for &format in Format::ALL {
            for shape in shapes {
                let desc = shape.with_format(format);
                let depth = format.sample_kind() == SampleKind::Depth;
                if depth && desc.dimension == Dimension::D3 {
                    continue;
                }
                let (value, texel) = clear_value(format);
                let mut graph = Graph::new();
                let target = graph.texture("cleared", desc);
                let zero = ClearValue::zero(format.sample_kind());
                let target = graph.clear(target, zero).unwrap();
                let mip = desc.mips - 1;
                let part = if desc.layers() > 1 {
                    target.mip(mip).layer(1)
                } else {
                    target.mip(mip)
                };
                let target = graph.clear(part, value).unwrap();
                graph.output("cleared", target).unwrap();
                let inputs = Inputs::new();
                let Some(execution) = attempt(route, backend, &graph, &inputs, format) else {
                    continue;
                };
                let result = execution.output("cleared").unwrap();
                let size = format.texel_bytes() as usize;
                let (mut cleared, mut zeroed) = (vec![0; size], vec![0; size]);
                format.encode(texel, &mut cleared);
                format.encode(
                    match zero {
                        ClearValue::Float(value) => Texel::Float(value),
                        ClearValue::Sint(value) => Texel::Sint(value),
                        ClearValue::Uint(value) => Texel::Uint(value),
                    },
                    &mut zeroed,
                );
                for at in 0..desc.mips {
                    let positions = desc.positions(at);
                    let texels = result.mip(at).unwrap().chunks_exact(size);
                    for (place, bytes) in positions.zip(texels) {
                        let hit = at == mip && (desc.layers() == 1 || place.layer == 1);
                        let wanted = if hit { &cleared } else { &zeroed };
                        assert_eq!(bytes, wanted, "{route:?}: {format} at {place:?}");
                    }
                }
            }
        }
    });
}

#[test]
fn parts_are_copied_to_parts() {
    on_vulkan(|backend| {
        let desc = desc(Dimension::D2, 20, 12, 3, 3).with_format(Format::Rg16Uint);
        let image = image(desc);
        let mut graph = Graph::new();
        let source = graph.import_texture("image", desc).unwrap();
        let target = graph.texture("parts", desc);
        let target = graph.clear(target, ClearValue::Uint([0; 4])).unwrap();
        let target = graph
            .copy(source.mip(1).layer(2), target.mip(1).layer(0))
            .unwrap();
        let target = graph
            .copy(source.mips(0, 2).layer(0), target.mips(0, 2).layer(1))
            .unwrap();
        graph.output("parts", target).unwrap();
        let inputs = Inputs::new().texture("image", &image);
        let execution = run(backend, &graph, &KernelLibrary::new(), &inputs);
        let result = execution.output("parts").unwrap();
        for mip in 0..3 {
            for place in desc.positions(mip) {
                let from = match (mip, place.layer) {
                    (1, 0) => Some(2),
                    (0 | 1, 1) => Some(0),
                    _ => None,
                };
                let seen = result.texel(place.x, place.y, place.layer, mip).unwrap();
                let wanted = match from {
                    Some(layer) => image.texel(place.x, place.y, layer, mip).unwrap(),
                    None => Texel::Uint([0, 0, 0, 1]),
                };
                assert_eq!(seen, wanted, "mip {mip} at {place:?}");
            }
        }
    });
}

#[test]
fn buffers_are_copied_and_cleared() {
    everywhere(|_, backend| {
        let bytes = crate::common::noise(1 << 16, 3);
        let desc = BufferDesc { bytes: 1 << 16 };
        let mut graph = Graph::new();
        let source = graph.import_buffer("bytes", desc).unwrap();
        let copy = graph.buffer("copy", desc);
        let copy = graph.copy_buffer(source, copy).unwrap();
        let zeros = graph.buffer("zeros", desc);
        let zeros = graph.copy_buffer(copy, zeros).unwrap();
        let zeros = graph.clear_buffer(zeros).unwrap();
        graph.output_buffer("copy", copy).unwrap();
        graph.output_buffer("zeros", zeros).unwrap();
        let inputs = Inputs::new().buffer("bytes", &bytes);
        let execution = run(backend, &graph, &KernelLibrary::new(), &inputs);
        let data = |name: &str| {
            execution
                .captures
                .iter()
                .find(|captured| captured.binding == name)
                .map(|captured| captured.data.clone())
        };
        assert_eq!(data("copy"), Some(CapturedData::Buffer(bytes)));
        assert_eq!(data("zeros"), Some(CapturedData::Buffer(vec![0; 1 << 16])));
    });
}

#[test]
fn captures_of_a_range_are_textures_of_their_own() {
    on_vulkan(|backend| {
        let desc = desc(Dimension::Cube, 8, 8, 6, 3).with_format(Format::Rgba8Uint);
        let image = image(desc);
        let mut graph = Graph::new();
        let source = graph.import_texture("image", desc).unwrap();
        let target = graph.texture("parts", desc);
        let target = graph
            .copy(source.mips(1, 2).layer(4), target.mips(1, 2).layer(4))
            .unwrap();
        let target = graph.copy(source.mip(0), target.mip(0)).unwrap();
        let rest = Subresources {
            mip: 1,
            mips: 2,
            layer: 4,
            layers: 1,
        };
        graph.output("parts", target).unwrap_err();
        // The output needs all; what is captured here are the passes.
        let mut complete = target;
        for layer in [0, 1, 2, 3, 5] {
            complete = graph
                .copy(
                    source.mips(rest.mip, rest.mips).layer(layer),
                    complete.mips(rest.mip, rest.mips).layer(layer),
                )
                .unwrap();
        }
        graph.output("parts", complete).unwrap();
        let plan = plan(backend, &graph, &KernelLibrary::new(), Capture::EveryPass);
        let inputs = Inputs::new().texture("image", &image);
        let execution = backend.execute(&plan, &inputs).unwrap();
        let captured = |index: usize| match &execution.captures[index].data {
            CapturedData::Texture(image) => image,
            CapturedData::Buffer(_) => panic!("a texture was captured"),
        };
        // The order of independent passes is the plan's; find them by shape.
        let shapes: Vec<TextureDesc> = (0..execution.captures.len())
            .map(|index| captured(index).desc)
            .collect();
        let layer = TextureDesc::d2(4, 4, desc.format).with_mips(2);
        let cube = TextureDesc::cube(8, desc.format);
        assert_eq!(shapes.iter().filter(|shape| **shape == layer).count(), 6);
        assert_eq!(shapes.iter().filter(|shape| **shape == cube).count(), 1);
        let whole = shapes.iter().position(|shape| *shape == cube).unwrap();
        assert_eq!(captured(whole).bytes, image.mip(0).unwrap());
        let layers: Vec<Vec<u8>> = (0..6)
            .map(|layer| {
                (1..3)
                    .flat_map(|mip| {
                        let bytes = image.mip(mip).unwrap();
                        let size = bytes.len() / 6;
                        bytes[size * layer..size * (layer + 1)].to_vec()
                    })
                    .collect()
            })
            .collect();
        for (index, _) in shapes
            .iter()
            .enumerate()
            .filter(|(_, shape)| **shape == layer)
        {
            assert!(layers.contains(&captured(index).bytes));
        }
    });
}

#[test]
fn every_storage_format_is_stored_and_loaded() {
    everywhere(|route, backend| {
        let extended = backend.limits().extended_storage_formats;
        for &format in Format::ALL {
            let stored = match format.storage() {
                StorageSupport::Core => true,
                StorageSupport::Extended => extended,
                StorageSupport::None => false,
            };
            if !stored {
                continue;
            }
            let desc = TextureDesc::d2(33, 6, format);
            let image = image(desc);
            let library = library("test/copy", &copy_kernel(format));
            let mut graph = Graph::new();
            let source = graph.import_texture("source", desc).unwrap();
            let result = graph.texture("result", desc);
            let result = graph
                .compute("test/copy")
                .read("source", source)
                .write("result", result)
                .per_texel("result")
                .unwrap();
            graph.output("image", result).unwrap();
            let plan = plan(backend, &graph, &library, Capture::Outputs);
            match backend.execute(&plan, &Inputs::new().texture("source", &image)) {
                Ok(execution) => {
                    let result = execution.output("image").unwrap();
                    assert_stored(route, &image, result);
                }
                Err(BackendError::Unsupported { step, what }) => {
                    // Blue-first storage is a feature of its own.
                    assert!(
                        route == Route::Gl || format == Format::Bgra8Unorm,
                        "{step}: {what}"
                    );
                    assert!(what.contains(format.name()), "{step}: {what}");
                    println!("{route:?}: {step}: {what}");
                }
                Err(error) => panic!("{route:?}, {format}: {error}"),
            }
        }
    });
}

/// What a format holds can be stored again without change, except that the
/// smallest signed normalised number has two encodings.
fn assert_stored(route: Route, image: &ImageData, result: &ImageData) {
    for ((place, wanted), (_, seen)) in image.texels(0).zip(result.texels(0)) {
        let format = image.desc.format;
        assert_eq!(seen, wanted, "{route:?}: {format} at {place:?}");
    }
}
