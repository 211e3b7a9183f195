//! The Python module `shakedown`: NumPy in and out, the interpreter's lock released while grasps are
//! tried, errors as exceptions. `python/shakedown/__init__.pyi` tells the types.

use pyo3::prelude::*;

mod arguments;
mod calls;
mod named;

/// The compiled half of the package `shakedown`.
#[pymodule]
fn _shakedown(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("engine", shakedown_sim::GRIP)?;
    module.add(
        "ShakedownError",
        module.py().get_type::<arguments::ShakedownError>(),
    )?;
    module.add_class::<named::Gripper>()?;
    module.add_class::<named::Protocol>()?;
    module.add_function(wrap_pyfunction!(calls::classify, module)?)?;
    module.add_function(wrap_pyfunction!(calls::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(calls::rank, module)?)?;
    module.add_function(wrap_pyfunction!(calls::evaluate, module)?)
}
