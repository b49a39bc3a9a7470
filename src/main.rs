//! The command `sfers`. Everything it does is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    sfers::cli::main()
}
