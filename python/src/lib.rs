//! The native half of the Python package `sfers_rs`: thin functions and classes over the library `sfers`, which `sfers_rs/*.py` makes pleasant.
//!
//! Tables travel as JSON text, arrays as numpy's. The interpreter is released while something is simulated.

mod diagnose;
mod error;
mod plant;
mod service;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::diagnose::diagnose;
    #[pymodule_export]
    use super::plant::diagnose_plant;
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
