//! Signed distance grids and their peers (CPU seconds at 64^3 on ACRONYM's sample mug: open3d 0.9,
//! warp 0.6). `SHAKEDOWN_MESH` and `SHAKEDOWN_SCALE` choose another mesh than the embedded mug.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use shakedown_objects::shapes::Family;
use shakedown_objects::{Object, ObjectSpec, SdfGrid};

fn subject() -> Object {
    match std::env::var_os("SHAKEDOWN_MESH") {
        Some(mesh) => Object::load(&ObjectSpec {
            mesh: mesh.into(),
            scale: std::env::var("SHAKEDOWN_SCALE")
                .ok()
                .and_then(|s| s.parse().ok()),
            ..ObjectSpec::default()
        })
        .expect("a usable mesh"),
        None => Family::Mug.member(0).object().expect("built in"),
    }
}

fn sdf(c: &mut Criterion) {
    let object = subject();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    let mut group = c.benchmark_group("sdf");
    group.sample_size(10);
    for resolution in [32usize, 48, 64] {
        group.bench_with_input(
            BenchmarkId::from_parameter(resolution),
            &resolution,
            |b, &n| {
                pool.install(|| b.iter(|| SdfGrid::bake(&object.surface, n, 0.1)));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, sdf);
criterion_main!(benches);
