//! How well do convex pieces stand for a solid? Time, number, volume and how far they stick out, for
//! the object of every ACRONYM file and every mesh below the folders given.
//!
//! `cargo run --release -p shakedown_tests --bin pieces -- OUT.csv ACRONYM/seen FOLDER...`

use std::path::{Path, PathBuf};
use std::time::Instant;

use nalgebra::Point3;
use parry3d::math::Vector;
use rayon::prelude::*;
use shakedown_gripper_assets::{ReadOptions, read_grasps};
use shakedown_objects::pieces::{PieceSettings, decompose};
use shakedown_objects::{Object, ObjectSpec};
use shakedown_tests::acronym_object;

/// What was measured of one mesh.
struct Row {
    mesh: PathBuf,
    faces: usize,
    pieces: usize,
    wall_s: f64,
    /// Volume of all pieces over the solid's.
    volume_ratio: f64,
    /// How far corners and faces of pieces lie outside the solid, metres.
    mean_outside_m: f64,
    largest_outside_m: f64,
    size_m: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = arguments.next().ok_or("give OUT.csv FOLDER...")?;
    let mut meshes = Vec::new();
    for folder in arguments {
        collect(Path::new(&folder), &mut meshes)?;
    }
    meshes.sort();
    let mut rows: Vec<Row> = meshes.par_iter().filter_map(|m| measure(m)).collect();
    rows.sort_by(|a, b| b.volume_ratio.total_cmp(&a.volume_ratio));
    let mut csv = String::from(
        "mesh,faces,pieces,wall_s,volume_ratio,mean_outside_m,largest_outside_m,size_m\n",
    );
    for r in &rows {
        csv += &format!(
            "{},{},{},{:.3},{:.3},{:.6},{:.6},{:.4}\n",
            r.mesh.display(),
            r.faces,
            r.pieces,
            r.wall_s,
            r.volume_ratio,
            r.mean_outside_m,
            r.largest_outside_m,
            r.size_m
        );
    }
    std::fs::write(&out, csv)?;
    let median = |value: fn(&Row) -> f64| {
        let mut all: Vec<f64> = rows.iter().map(value).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    };
    println!(
        "{} meshes: median {:.0} pieces, {:.2} s, volume ratio {:.3}, {:.2} mm outside on the mean",
        rows.len(),
        median(|r| r.pieces as f64),
        median(|r| r.wall_s),
        median(|r| r.volume_ratio),
        1e3 * median(|r| r.mean_outside_m),
    );
    println!(
        "\n| worst by volume | faces | pieces | s | volume ratio | outside, mean / largest, mm |\n|---|---:|---:|---:|---:|---|"
    );
    for r in rows.iter().take(10) {
        println!(
            "| {} | {} | {} | {:.2} | {:.2} | {:.2} / {:.1} |",
            r.mesh.file_stem().unwrap_or_default().to_string_lossy(),
            r.faces,
            r.pieces,
            r.wall_s,
            r.volume_ratio,
            1e3 * r.mean_outside_m,
            1e3 * r.largest_outside_m
        );
    }
    Ok(())
}

fn collect(folder: &Path, meshes: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let kind = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        if path.is_dir() {
            // The meshes of ACRONYM are of no size without their grasp files.
            if !path.with_file_name("grasps").is_dir() || path.ends_with("grasps") {
                collect(&path, meshes)?;
            }
        } else if ["h5", "obj", "stl", "ply", "off", "glb"].contains(&kind) {
            meshes.push(path);
        }
    }
    Ok(())
}

/// `None` for what is no sound solid.
fn measure(mesh: &Path) -> Option<Row> {
    let object = if mesh.extension().is_some_and(|e| e == "h5") {
        let file = read_grasps(mesh, &ReadOptions::default()).ok()?;
        acronym_object(mesh.parent()?.parent()?, &file)
    } else {
        let spec = ObjectSpec {
            mesh: mesh.to_owned(),
            density_kg_m3: Some(1.0),
            ..ObjectSpec::default()
        };
        Object::load(&spec)
            .map_err(|e| eprintln!("left out: {e}"))
            .ok()?
    };
    let solid_m3 = object.mass.volume_m3;
    let surface = &object.surface;
    let start = Instant::now();
    let pieces = decompose(surface.mesh(), &PieceSettings::default());
    let wall_s = start.elapsed().as_secs_f64();
    let (mut volume_m3, mut sum_m, mut n, mut largest_m) = (0.0, 0.0, 0usize, 0.0f64);
    for piece in &pieces {
        let within = piece[0];
        for [a, b, c] in hull(piece) {
            let [u, v, w] = [a, b, c].map(|p| p - within);
            // Every face is seen from inside the same way, whichever way its corners run.
            volume_m3 += u.dot(&v.cross(&w)).abs() / 6.0;
            let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            for p in [a, b, c, middle] {
                let outside_m = surface.signed_distance(&p).max(0.0);
                sum_m += outside_m;
                largest_m = largest_m.max(outside_m);
                n += 1;
            }
        }
    }
    let (lo, hi) = surface.mesh().bounds();
    Some(Row {
        mesh: mesh.to_owned(),
        faces: surface.mesh().faces().len(),
        pieces: pieces.len(),
        wall_s,
        volume_ratio: volume_m3 / solid_m3,
        mean_outside_m: sum_m / n.max(1) as f64,
        largest_outside_m: largest_m,
        size_m: (hi - lo).max(),
    })
}

/// Faces of the convex hull of some points; a corner of it is one of them.
fn hull(points: &[Point3<f64>]) -> Vec<[Point3<f64>; 3]> {
    let size = points
        .iter()
        .map(|p| (p - points[0]).norm())
        .fold(1e-9, f64::max);
    let local: Vec<Vector> = points
        .iter()
        .map(|p| (p - points[0]) / size)
        .map(|v| Vector::new(v.x as f32, v.y as f32, v.z as f32))
        .collect();
    let Ok((corners, faces)) = parry3d::transformation::try_convex_hull(&local) else {
        return Vec::new();
    };
    let corner = |i: u32| {
        let c = corners[i as usize];
        points[0] + nalgebra::Vector3::new(c.x, c.y, c.z).map(f64::from) * size
    };
    faces.into_iter().map(|f| f.map(corner)).collect()
}
