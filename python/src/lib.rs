//! The native half of the Python package `sfers_rs`: thin functions and classes over the library `sfers`, which `sfers_rs/*.py` makes pleasant.
//!
//! Tables travel as JSON text, arrays as numpy's. The interpreter is released while something is simulated.

mod pybullet;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let names = PyModule::new(module.py(), "sfers_rs.pybullet")?;
        pybullet::register(&names)?;
        module.add("pybullet", names)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
