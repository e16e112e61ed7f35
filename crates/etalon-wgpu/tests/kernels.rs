//! Kernels of every kind of binding, against results known in closed form.

mod common;

use common::{copy_kernel, everywhere, image, library, run};
use etalon_core::Format;
use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::resource::TextureDesc;

#[test]
fn a_copy_of_each_texel_is_the_image_at_any_size() {
    for (width, height) in [(1, 1), (1, 4096), (7, 13), (257, 129)] {
        everywhere(|_, backend| {
            let desc = TextureDesc::d2(width, height, Format::Rgba16Float);
            let image = image(desc);
            let library = library("test/copy", &copy_kernel(desc.format));
            let mut graph = Graph::new();
            let source = graph.import_texture("source", desc).unwrap();
            let target = graph.texture("target", desc);
            let target = graph
                .compute("test/copy")
                .read("source", source)
                .write("target", target)
                .per_texel("target")
                .unwrap();
            graph.output("image", target).unwrap();
            let inputs = Inputs::new().texture("source", &image);
            let execution = run(backend, &graph, &library, &inputs);
            assert_eq!(execution.output("image"), Some(&image));
        });
    }
}
