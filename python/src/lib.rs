//! The native half of the Python package `sfers_rs`: thin functions and classes over the library `sfers`, which `sfers_rs/*.py` makes pleasant.
//!
//! Tables travel as JSON text, arrays as numpy's. The interpreter is released while something is simulated, and no thread outlives a call.

mod diagnose;
mod error;
mod experiment;
mod interrupt;
mod plant;
mod recording;
mod service;
mod simulation;
mod sweep;

mod pybullet;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::diagnose::diagnose;
    #[pymodule_export]
    use super::experiment::{Experiment, effect_table, key_tables, preset, presets, toml_of};
    #[pymodule_export]
    use super::plant::diagnose_plant;
    #[pymodule_export]
    use super::recording::{Recording, drawn};
    #[pymodule_export]
    use super::simulation::Simulation;
    #[pymodule_export]
    use super::sweep::run_sweep;
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let names = PyModule::new(module.py(), "sfers_rs.pybullet")?;
        pybullet::register(&names)?;
        module.add("pybullet", names)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
