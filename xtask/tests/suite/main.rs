//! The commands as a user starts them.

mod test_backends;
mod test_operations;
mod test_programs;
