//! The command line: see `mesoshell --help`.
fn main() {}
