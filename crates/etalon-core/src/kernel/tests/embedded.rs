//! The kernels that come with Etalon.

use super::*;

/// Paths of the files that are kernels: those with an entry point.
fn kernels(library: &KernelLibrary) -> Vec<String> {
    let entry = |path: &str| {
        library
            .source(path)
            .is_some_and(|text| text.contains("@compute"))
    };
    let paths = library.paths().into_iter();
    paths
        .filter(|path| entry(path))
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_kernel_compiles_in_both_arithmetics() {
    let library = KernelLibrary::of(etalon_shaders::sources());
    for path in kernels(&library) {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let kernel = library
                .get(&KernelRequest::new(path.clone()), arithmetic)
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(kernel.name, path);
            assert!(!kernel.bindings.is_empty(), "{path}");
        }
    }
}

/// Real text, with every construct its authors use: each expression of each
/// module begins with the same word in the generated text and in the file.
#[test]
fn every_expression_leads_back_to_its_own_text() {
    let library = KernelLibrary::of(etalon_shaders::sources());
    for path in kernels(&library) {
        let kernel = library
            .get(&KernelRequest::new(path.clone()), Arithmetic::Strict)
            .unwrap_or_else(|error| panic!("{error}"));
        let functions = kernel.module.functions.iter().map(|(_, function)| function);
        let entries = kernel
            .module
            .entry_points
            .iter()
            .map(|entry| &entry.function);
        for function in functions.chain(entries) {
            for (handle, _) in function.expressions.iter() {
                let span = function.expressions.get_span(handle);
                let Some(range) = span.to_range() else {
                    continue;
                };
                let location = kernel.source_map.locate(span);
                let text = library
                    .source(location.file.strip_suffix(".wesl").unwrap())
                    .unwrap();
                let line = text.lines().nth(location.line as usize - 1).unwrap();
                let rest: String = line.chars().skip(location.column as usize - 1).collect();
                let written = scan::tokens(&rest).next().unwrap();
                let generated = scan::tokens(&kernel.wgsl[range.start..]).next().unwrap();
                let same = generated.text == written.text
                    // Imported: the name has the file's path before it.
                    || (generated.text.starts_with("package_")
                        && generated.text.ends_with(written.text))
                    // An import written as a path.
                    || rest.starts_with("package::");
                assert!(
                    same,
                    "{path}, {location}: `{}` is `{}`",
                    written.text, generated.text
                );
            }
        }
    }
}
