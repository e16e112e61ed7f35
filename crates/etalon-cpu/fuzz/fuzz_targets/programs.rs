//! Bytes as the choices of the generator: what the interpreter computes is what
//! each invocation would.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| etalon_tests::fuzz::program(bytes));
