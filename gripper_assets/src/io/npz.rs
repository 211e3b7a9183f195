//! Pose lists as NumPy archives: `transforms` (N,4,4), `score`, `label`, `width_m`, `frame`.

use std::fs::File;
use std::io::BufReader;
use std::num::NonZeroUsize;
use std::path::Path;

use npyz::WriterBuilder as _;
use npyz::npz::{NpzArchive, NpzWriter};

use super::file::{
    GraspFile, GraspFormat, ObjectReference, Poses, ReadOptions, check_length, create, matrix_rows,
    stated_frame,
};
use crate::error::GraspError;
use crate::grasp::pose_of_matrix;

/// Steps of the parser on the header of an array; a proper one takes a few hundred.
const HEADER_STEPS_MAX: Option<NonZeroUsize> = NonZeroUsize::new(1_000_000);

/// Most numbers of an array: four million poses.
const NUMBERS_MAX: u64 = 1 << 26;

type Archive = NpzArchive<BufReader<File>>;

/// Numbers in C order and their shape.
type Array = (Vec<f64>, Vec<u64>);

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<GraspFile, GraspError> {
    // The header is a Python literal, whose parser takes for ever on some that are deeply nested.
    pest::set_call_limit(HEADER_STEPS_MAX);
    let mut npz = NpzArchive::open(path).map_err(|e| {
        GraspError::bad(path, "archive", e.to_string(), "write it with numpy.savez")
    })?;
    let (transforms, shape) = floats(&mut npz, path, "transforms")?
        .ok_or_else(|| bad(path, "transforms", "there is no such array".into()))?;
    let [_, 4, 4] = shape[..] else {
        return Err(bad(
            path,
            "transforms",
            format!("its shape is {shape:?}, not (N, 4, 4)"),
        ));
    };
    let frame = frame_name(&mut npz, path)?;
    let frame = stated_frame(path, options, frame.as_deref())?;
    let mut poses = Poses::new(path, frame, options);
    for (i, m) in transforms.chunks_exact(16).enumerate() {
        let rows: [[f64; 4]; 4] = std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c]));
        poses.push(pose_of_matrix(&rows), || format!("transforms[{i}]"))?;
    }
    for (key, set) in [
        (
            "score",
            (|g, v| g.score = Some(v)) as fn(&mut crate::Grasp, f64),
        ),
        ("width_m", |g, v| g.width_m = Some(v)),
        ("label", |g, v| g.label = Some(v != 0.0)),
    ] {
        if let Some((values, _)) = floats(&mut npz, path, key)? {
            check_length(path, key, values.len(), poses.grasps.len())?;
            for (grasp, value) in poses.grasps.iter_mut().zip(values) {
                if !value.is_nan() {
                    set(grasp, value);
                }
            }
        }
    }
    Ok(poses.finish(GraspFormat::Npz, None, ObjectReference::default()))
}

fn bad(path: &Path, key: &str, what: String) -> GraspError {
    GraspError::bad(
        path,
        key,
        what,
        "see docs/formats.md for the arrays of a pose list",
    )
}

/// An array of any plain number type in C order, with its shape.
fn floats(npz: &mut Archive, path: &Path, key: &str) -> Result<Option<Array>, GraspError> {
    let io = |e: std::io::Error| bad(path, key, e.to_string());
    let Some(array) = npz.by_name(key).map_err(io)? else {
        return Ok(None);
    };
    let shape = array.shape().to_vec();
    // A small archive can unpack to any size.
    let numbers = shape.iter().try_fold(1u64, |n, d| n.checked_mul(*d));
    if numbers.is_none_or(|n| n > NUMBERS_MAX) {
        let what = format!("its shape is {shape:?}: over {NUMBERS_MAX} numbers");
        return Err(bad(path, key, what));
    }
    if array.order() != npyz::Order::C && shape.len() > 1 {
        return Err(bad(path, key, "the array is in Fortran order".into()));
    }
    macro_rules! attempt {
        ($array:expr, $($t:ty => $f:expr),+) => {{
            let array = $array;
            $(let array = match array.try_data::<$t>() {
                Ok(data) => {
                    let values: Result<Vec<f64>, _> = data.map(|x| x.map($f)).collect();
                    return values.map(|v| Some((v, shape))).map_err(io);
                }
                Err(array) => array,
            };)+
            array.dtype().descr()
        }};
    }
    let found = attempt!(array,
        f64 => |x| x, f32 => f64::from, bool => |x| f64::from(u8::from(x)), i64 => |x| x as f64,
        i32 => f64::from, i8 => f64::from, u8 => f64::from, u64 => |x| x as f64);
    Err(bad(
        path,
        key,
        format!("its type is {found}, not a number type"),
    ))
}

fn frame_name(npz: &mut Archive, path: &Path) -> Result<Option<String>, GraspError> {
    let io = |e: std::io::Error| bad(path, "frame", e.to_string());
    let Some(array) = npz.by_name("frame").map_err(io)? else {
        return Ok(None);
    };
    if array.len() > 1 || array.dtype().num_bytes().is_none_or(|n| n > 1024) {
        return Err(bad(path, "frame", "it is not one short word".into()));
    }
    let array = match array.try_data::<String>() {
        Ok(mut data) => return data.next().transpose().map_err(io),
        Err(array) => array,
    };
    match array.try_data::<Vec<u8>>() {
        Ok(mut data) => Ok(data.next().transpose().map_err(io)?.map(|b| {
            String::from_utf8_lossy(&b)
                .trim_end_matches('\0')
                .to_owned()
        })),
        Err(array) => Err(bad(
            path,
            "frame",
            format!("its type is {}, not a string", array.dtype().descr()),
        )),
    }
}

pub(super) fn write(file: &GraspFile) -> Result<(), GraspError> {
    let io = |e: std::io::Error| GraspError::io(&file.path, e);
    let mut npz = NpzWriter::new(create(&file.path)?);
    let n = file.grasps.len() as u64;
    let rows = file.grasps.iter().map(|g| matrix_rows(&g.object_from_hand));
    add(&mut npz, "transforms", &[n, 4, 4], rows.flatten().flatten()).map_err(io)?;
    // A grasp without a value becomes NaN, which the reader takes for unknown.
    for (key, get) in [
        ("score", (|g| g.score) as fn(&crate::Grasp) -> Option<f64>),
        ("width_m", |g| g.width_m),
    ] {
        if file.grasps.iter().any(|g| get(g).is_some()) {
            let values = file.grasps.iter().map(|g| get(g).unwrap_or(f64::NAN));
            add(&mut npz, key, &[n], values).map_err(io)?;
        }
    }
    if file.grasps.iter().all(|g| g.label.is_some()) {
        let labels = file.grasps.iter().map(|g| g.label == Some(true));
        add(&mut npz, "label", &[n], labels).map_err(io)?;
    }
    let name = "acronym".to_owned();
    let mut out = npz
        .array::<str>("frame", Default::default())
        .map_err(io)?
        .dtype(npyz::DType::Plain(
            "<U7".parse().expect("a valid type string"),
        ))
        .shape(&[])
        .begin_nd()
        .map_err(io)?;
    out.push(name.as_str()).map_err(io)?;
    out.finish().map_err(io)?;
    std::io::Write::flush(
        npz.zip_writer()
            .finish()
            .map_err(|e| io(e.into()))?
            .get_mut(),
    )
    .map_err(io)
}

fn add<T: npyz::AutoSerialize>(
    npz: &mut NpzWriter<std::io::BufWriter<File>>,
    key: &str,
    shape: &[u64],
    values: impl Iterator<Item = T>,
) -> std::io::Result<()> {
    let mut out = npz
        .array(key, Default::default())?
        .default_dtype()
        .shape(shape)
        .begin_nd()?;
    out.extend(values)?;
    out.finish()
}
