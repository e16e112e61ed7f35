//! Any text: translation and execution answer, and never panic.

#![no_main]

use std::sync::Once;

use libfuzzer_sys::fuzz_target;

/// libFuzzer's hook aborts at once; that would take naga's own panics for ours.
/// Without it, a panic that nobody caught still ends the process.
static HOOK: Once = Once::new();

fuzz_target!(|bytes: &[u8]| {
    HOOK.call_once(|| std::panic::set_hook(Box::new(|what| eprintln!("{what}"))));
    etalon_tests::fuzz::wgsl(bytes);
});
