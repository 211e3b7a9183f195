//! The four functions: classify, simulate, rank, evaluate.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Isometry3;
use numpy::{PyArray1, PyReadonlyArrayDyn};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use shakedown_classifier::{Class, HandModel, Thresholds, Verdict};
use shakedown_gripper_assets::Gripper;
use shakedown_metrics::Row;
use shakedown_metrics::hold_model::HoldJudge;
use shakedown_metrics::summary::{GeometryRow, Throughput, summarise};
use shakedown_objects::Object;
use shakedown_sim::{Label, Outcome, Protocol, Scene, run_trial};

use crate::arguments::{ObjectFacts, detached, object, poses, raised};
use crate::named::{GripperLike, ProtocolLike};

type Poses<'py> = PyReadonlyArrayDyn<'py, f64>;

/// One grasp, judged.
struct Judged {
    verdict: Verdict,
    outcome: Option<Outcome>,
    p_hold: Option<f64>,
}

/// Judges grasps by geometry and, with a protocol, by a trial each; as `shakedown run` does.
fn judged(
    object: &Object,
    gripper: &Gripper,
    protocol: Option<&Protocol>,
    grasps: &[Isometry3<f64>],
) -> Result<Vec<Judged>, String> {
    let hand = HandModel::new(gripper, gripper.opening_max_m).map_err(|e| e.to_string())?;
    let cache = shakedown_objects::pieces::default_cache_directory();
    let scene = protocol
        .map(|p| Scene::new(object, gripper, p, None, cache.as_deref()))
        .transpose()
        .map_err(|e| e.to_string())?;
    let judge = match (&scene, protocol) {
        (Some(scene), Some(p)) if HoldJudge::reads(p) => {
            Some(HoldJudge::new(object, scene.mass_kg, true))
        }
        _ => None,
    };
    let surface = &object.surface;
    Ok(grasps
        .par_iter()
        .map(|pose| {
            let verdict =
                shakedown_classifier::classify(&hand, surface, pose, &Thresholds::default());
            let outcome = scene.as_ref().map(|s| run_trial(s, pose));
            let p_hold = judge
                .as_ref()
                .map(|j| j.p_hold(&hand, surface, pose, &verdict, outcome.as_ref()));
            Judged {
                verdict,
                outcome,
                p_hold,
            }
        })
        .collect())
}

fn floats<'py>(
    out: &Bound<'py, PyDict>,
    name: &str,
    values: impl Iterator<Item = Option<f64>>,
) -> PyResult<()> {
    let values: Vec<f64> = values.map(|x| x.unwrap_or(f64::NAN)).collect();
    out.set_item(name, PyArray1::from_vec(out.py(), values))
}

fn flags<'py>(
    out: &Bound<'py, PyDict>,
    name: &str,
    values: impl Iterator<Item = bool>,
) -> PyResult<()> {
    out.set_item(name, PyArray1::from_vec(out.py(), values.collect()))
}

fn geometry_columns<'py>(out: &Bound<'py, PyDict>, judged: &[Judged]) -> PyResult<()> {
    let verdicts = || judged.iter().map(|j| &j.verdict);
    let classes: Vec<&str> = verdicts().map(|v| v.class().name()).collect();
    out.set_item("class", classes)?;
    flags(out, "collides", verdicts().map(|v| v.collides))?;
    flags(out, "reachable", verdicts().map(|v| v.reachable))?;
    flags(out, "closes", verdicts().map(|v| v.closes))?;
    flags(out, "centred", verdicts().map(|v| v.centred))?;
    flags(out, "aligned", verdicts().map(|v| v.aligned))?;
    floats(
        out,
        "penetration_m",
        verdicts().map(|v| Some(v.penetration_m)),
    )?;
    let widths = verdicts().map(|v| v.closing.map(|c| c.width_m()));
    floats(out, "closing_width_m", widths)
}

fn trial_columns<'py>(out: &Bound<'py, PyDict>, judged: &[Judged]) -> PyResult<()> {
    let outcomes = || judged.iter().filter_map(|j| j.outcome.as_ref());
    let names: Vec<&str> = outcomes().map(|o| o.label.name()).collect();
    out.set_item("outcome", names)?;
    flags(out, "held", outcomes().map(Outcome::is_held))?;
    floats(out, "slip_linear_m", outcomes().map(|o| o.slip_linear_m))?;
    floats(
        out,
        "slip_angular_rad",
        outcomes().map(|o| o.slip_angular_rad),
    )?;
    floats(
        out,
        "closing_linear_m",
        outcomes().map(|o| o.closing_linear_m),
    )?;
    floats(
        out,
        "closing_angular_rad",
        outcomes().map(|o| o.closing_angular_rad),
    )?;
    floats(out, "grip_force_n", outcomes().map(|o| o.grip_force_n))?;
    floats(out, "sim_s", outcomes().map(|o| Some(o.sim_s)))?;
    floats(out, "margin_g", outcomes().map(|o| o.margin_g))?;
    floats(out, "p_hold", judged.iter().map(|j| j.p_hold))
}

/// What geometry says of each pose.
#[pyfunction]
#[pyo3(signature = (mesh, poses, *, gripper = GripperLike::Name("franka_panda".into()), frame = "acronym", threads = None, scale = None))]
pub fn classify<'py>(
    py: Python<'py>,
    mesh: PathBuf,
    #[pyo3(from_py_with = keep)] poses: Poses<'py>,
    gripper: GripperLike,
    frame: &str,
    threads: Option<usize>,
    scale: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let gripper = gripper.load()?;
    // Geometry asks for no mass: an open mesh is welcome here.
    let facts = ObjectFacts {
        scale,
        mass_kg: Some(1.0),
        ..ObjectFacts::default()
    };
    let object = object(mesh, facts)?;
    let grasps = crate::arguments::poses(&poses, frame, gripper.tcp_z_m)?;
    let all = detached(py, threads, || judged(&object, &gripper, None, &grasps))?;
    let out = PyDict::new(py);
    geometry_columns(&out, &all.map_err(raised)?)?;
    Ok(out)
}

fn keep<'py>(any: &Bound<'py, PyAny>) -> PyResult<Poses<'py>> {
    // Lists and other number types are taken too, as NumPy would.
    let array = any
        .py()
        .import("numpy")?
        .call_method1("ascontiguousarray", (any, "float64"))?;
    array.extract()
}

/// Geometry and one trial for each pose.
#[pyfunction]
#[pyo3(signature = (mesh, poses, protocol = ProtocolLike::Name("acronym".into()), *, gripper = GripperLike::Name("franka_panda".into()), frame = "acronym", threads = None, scale = None, mass_kg = None, density_kg_m3 = None, friction = None))]
pub fn simulate<'py>(
    py: Python<'py>,
    mesh: PathBuf,
    #[pyo3(from_py_with = keep)] poses: Poses<'py>,
    protocol: ProtocolLike,
    gripper: GripperLike,
    frame: &str,
    threads: Option<usize>,
    scale: Option<f64>,
    mass_kg: Option<f64>,
    density_kg_m3: Option<f64>,
    friction: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let facts = ObjectFacts {
        scale,
        mass_kg,
        density_kg_m3,
        friction,
    };
    let all = tried(py, mesh, &poses, protocol, gripper, frame, threads, facts)?;
    let out = PyDict::new(py);
    geometry_columns(&out, &all)?;
    trial_columns(&out, &all)?;
    Ok(out)
}

fn tried(
    py: Python<'_>,
    mesh: PathBuf,
    array: &Poses<'_>,
    protocol: ProtocolLike,
    gripper: GripperLike,
    frame: &str,
    threads: Option<usize>,
    facts: ObjectFacts,
) -> PyResult<Vec<Judged>> {
    let (gripper, protocol) = (gripper.load()?, protocol.load()?);
    let object = object(mesh, facts)?;
    let grasps = poses(array, frame, gripper.tcp_z_m)?;
    detached(py, threads, || {
        judged(&object, &gripper, Some(&protocol), &grasps)
    })?
    .map_err(raised)
}

/// The poses best first: `order` indexes them, `p_hold` is in that order.
#[pyfunction]
#[pyo3(signature = (mesh, poses, *, gripper = GripperLike::Name("franka_panda".into()), frame = "acronym", threads = None, scale = None, mass_kg = None, density_kg_m3 = None, friction = None))]
pub fn rank<'py>(
    py: Python<'py>,
    mesh: PathBuf,
    #[pyo3(from_py_with = keep)] poses: Poses<'py>,
    gripper: GripperLike,
    frame: &str,
    threads: Option<usize>,
    scale: Option<f64>,
    mass_kg: Option<f64>,
    density_kg_m3: Option<f64>,
    friction: Option<f64>,
) -> PyResult<Bound<'py, PyDict>> {
    let facts = ObjectFacts {
        scale,
        mass_kg,
        density_kg_m3,
        friction,
    };
    let protocol = ProtocolLike::Name("acronym".into());
    let all = tried(py, mesh, &poses, protocol, gripper, frame, threads, facts)?;
    let p = |i: usize| all[i].p_hold.unwrap_or(0.0);
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|a, b| p(*b).total_cmp(&p(*a)).then(a.cmp(b)));
    let out = PyDict::new(py);
    floats(&out, "p_hold", order.iter().map(|i| Some(p(*i))))?;
    let held = order
        .iter()
        .map(|i| all[*i].outcome.is_some_and(|o| o.is_held()));
    flags(&out, "held", held)?;
    let order: Vec<i64> = order.into_iter().map(|i| i as i64).collect();
    out.set_item("order", PyArray1::from_vec(py, order))?;
    Ok(out)
}

/// The numbers of `summary.json` over some objects: a dictionary of name to `(mesh, poses)`.
#[pyfunction]
#[pyo3(signature = (objects, protocol = ProtocolLike::Name("acronym".into()), *, gripper = GripperLike::Name("franka_panda".into()), frame = "acronym", threads = None, labels = None, facts = None))]
pub fn evaluate<'py>(
    py: Python<'py>,
    objects: BTreeMap<String, (PathBuf, Bound<'py, PyAny>)>,
    protocol: ProtocolLike,
    gripper: GripperLike,
    frame: &str,
    threads: Option<usize>,
    labels: Option<BTreeMap<String, Vec<bool>>>,
    facts: Option<BTreeMap<String, BTreeMap<String, f64>>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (gripper, protocol) = (gripper.load()?, protocol.load()?);
    let mut rows = Vec::new();
    for (name, (mesh, array)) in objects {
        let own = match facts.as_ref().and_then(|f| f.get(&name)) {
            Some(own) => ObjectFacts::of(&name, own)?,
            None => ObjectFacts::default(),
        };
        let object = object(mesh, own)?;
        let grasps = poses(&keep(&array)?, frame, gripper.tcp_z_m)?;
        let labels = labels.as_ref().and_then(|l| l.get(&name));
        if labels.is_some_and(|l| l.len() != grasps.len()) {
            return Err(raised(format!("{name}: not as many labels as poses")));
        }
        let all = detached(py, threads, || {
            judged(&object, &gripper, Some(&protocol), &grasps)
        })?
        .map_err(raised)?;
        let row = |(i, j): (usize, &Judged)| row(j, labels.map(|l| l[i]));
        rows.push((name, all.iter().enumerate().map(row).collect()));
    }
    let outcomes = Label::ALL.map(Label::name);
    let summary = summarise(&rows, &outcomes, Throughput::default());
    let mut value = serde_json::to_value(&summary).map_err(raised)?;
    // Time is not measured here.
    value
        .as_object_mut()
        .and_then(|o| o.shift_remove("throughput"));
    py.import("json")?
        .call_method1("loads", (value.to_string(),))
}

fn row(judged: &Judged, label: Option<bool>) -> Row {
    let v = &judged.verdict;
    let optimal = v.class() == Class::Optimal;
    Row {
        geometry: Some(GeometryRow {
            collides: v.collides,
            reachable: v.reachable,
            optimal,
            optimal_strict: optimal && v.closes && v.centred && v.aligned,
            width_m: v.closing.map(|c| c.width_m() as f32),
        }),
        outcome: judged.outcome.map(|o| (o.label.name(), o.is_held())),
        label,
        p_hold: judged.p_hold.map(|p| p as f32),
    }
}
