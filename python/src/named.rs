//! Hands and protocols: built in by name, or from a TOML file.

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::raised;

/// A hand: a built-in name or a TOML file.
#[pyclass(frozen, from_py_object, module = "shakedown")]
#[derive(Clone)]
pub struct Gripper {
    pub inner: shakedown_gripper_assets::Gripper,
}

#[pymethods]
impl Gripper {
    #[new]
    #[pyo3(signature = (name = "franka_panda"))]
    fn new(name: &str) -> PyResult<Self> {
        let inner = shakedown_gripper_assets::Gripper::load(name).map_err(raised)?;
        Ok(Self { inner })
    }

    /// Names of the built-in hands.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        shakedown_gripper_assets::Gripper::names().collect()
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    #[getter]
    fn opening_max_m(&self) -> f64 {
        self.inner.opening_max_m
    }

    #[getter]
    fn tcp_z_m(&self) -> f64 {
        self.inner.tcp_z_m
    }

    fn __repr__(&self) -> String {
        format!("Gripper({:?})", self.inner.name)
    }
}

/// A protocol: a built-in preset or a TOML file, with constants overridden by keyword.
#[pyclass(frozen, from_py_object, module = "shakedown")]
#[derive(Clone)]
pub struct Protocol {
    pub inner: shakedown_sim::Protocol,
}

#[pymethods]
impl Protocol {
    #[new]
    #[pyo3(signature = (name = "acronym", **overrides))]
    fn new(name: &str, overrides: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut set = Vec::new();
        for (key, value) in overrides.into_iter().flatten() {
            // Python has no dots in keywords: solver__dt is solver.dt.
            let key = key.extract::<String>()?.replace("__", ".");
            set.push(format!("{key}={}", value.str()?));
        }
        let inner = shakedown_sim::Protocol::load(name, &set).map_err(raised)?;
        Ok(Self { inner })
    }

    /// Names of the built-in presets.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        shakedown_sim::Protocol::names().collect()
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    #[getter]
    fn version(&self) -> &str {
        &self.inner.version
    }

    /// Every constant, as in a run's manifest.
    fn constants<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.inner).map_err(raised)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        format!(
            "Protocol({:?}, version {:?})",
            self.inner.name, self.inner.version
        )
    }
}

/// A name, or a hand made before.
#[derive(FromPyObject)]
pub enum GripperLike {
    Made(Gripper),
    Name(String),
}

impl GripperLike {
    pub fn load(self) -> PyResult<shakedown_gripper_assets::Gripper> {
        match self {
            Self::Made(g) => Ok(g.inner),
            Self::Name(name) => Ok(Gripper::new(&name)?.inner),
        }
    }
}

/// A name, or a protocol made before.
#[derive(FromPyObject)]
// One per call: its size does not matter.
#[allow(clippy::large_enum_variant)]
pub enum ProtocolLike {
    Made(Protocol),
    Name(String),
}

impl ProtocolLike {
    pub fn load(self) -> PyResult<shakedown_sim::Protocol> {
        match self {
            Self::Made(p) => Ok(p.inner),
            Self::Name(name) => Ok(Protocol::new(&name, None)?.inner),
        }
    }
}
