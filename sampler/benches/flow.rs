//! Grasps per second of the flow sampler on the network that others measured: encoder with four
//! 3-D convolutions on 32^3, MLP 4 x 512, 20 Euler steps. `ORT_DYLIB_PATH` chooses ONNX Runtime.

#[path = "../tests/fixture/mod.rs"]
mod fixture;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use shakedown_gripper_assets::Gripper;
use shakedown_objects::shapes::Family;
use shakedown_sampler::{DrawSettings, FlowModel};

fn flow(c: &mut Criterion) {
    let dir = tempfile::tempdir().expect("a directory");
    fixture::card(dir.path(), 32, 20, "");
    fixture::save(
        &fixture::measured_encoder(),
        &dir.path().join("encoder.onnx"),
    );
    fixture::save(
        &fixture::measured_velocity(),
        &dir.path().join("velocity.onnx"),
    );
    let gripper = Gripper::load("franka_panda").expect("built in");
    let object = Family::Mug.member(0).object().expect("built in");
    let mut model = FlowModel::load(dir.path(), None).expect("a good model");
    println!("runtime: {} {}", model.runtime.name, model.runtime.version);
    let mut group = c.benchmark_group("flow_20_steps");
    group.sample_size(10);
    for count in [64u64, 1024] {
        group.throughput(Throughput::Elements(count));
        group.bench_with_input(BenchmarkId::from_parameter(count), &count, |b, &n| {
            b.iter(|| {
                model
                    .sample(&object, &gripper, n, 0, DrawSettings::default())
                    .expect("finite")
            });
        });
    }
    group.finish();
}

criterion_group!(benches, flow);
criterion_main!(benches);
