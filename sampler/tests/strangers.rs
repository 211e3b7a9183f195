//! A model from a stranger can make a run fail, never end the process: graphs that made tract panic,
//! or ask for all memory, are errors that name the file.

#![cfg(feature = "onnx")]

mod fixture;

use std::path::Path;

use fixture::*;
use shakedown_sampler::FlowModel;
use tract_onnx::pb::ModelProto;

/// What is said of a good model whose encoder was changed.
fn complaint(change: impl FnOnce(&mut ModelProto)) -> String {
    let directory = tempfile::tempdir().unwrap();
    let mut encoder = small_encoder(9);
    change(&mut encoder);
    write(directory.path(), &encoder);
    let error = match FlowModel::load(directory.path(), None) {
        Ok(_) => panic!("the model was taken"),
        Err(error) => error.to_string(),
    };
    assert!(error.contains("encoder.onnx"), "{error}");
    error
}

fn write(directory: &Path, encoder: &ModelProto) {
    card(directory, 9, 2, "");
    save(encoder, &directory.join("encoder.onnx"));
    let velocity = spring_velocity([0.5; 9], [0.1; 3], [0.2; 3]);
    save(&velocity, &directory.join("velocity.onnx"));
}

#[test]
fn a_graph_on_which_tract_panics_is_an_error() {
    // An output that no node makes: found by fuzzing.
    let error = complaint(|m| m.graph.as_mut().unwrap().output[0].name = "nobody".into());
    assert!(error.contains("not a usable ONNX graph"), "{error}");
}

#[test]
fn a_zero_byte_in_a_name_is_an_error() {
    // The C interface cannot say such a name: found by fuzzing.
    let error = complaint(|m| m.graph.as_mut().unwrap().node[0].name = "a\0b".into());
    assert!(error.contains("zero byte"), "{error}");
}

#[test]
fn a_constant_larger_than_its_file_is_refused_before_it_takes_memory() {
    let error = complaint(|m| {
        let huge = constant("huge", &[1 << 20, 1 << 20], vec![1.0]);
        m.graph.as_mut().unwrap().initializer.push(huge);
    });
    assert!(error.contains("more than the file holds"), "{error}");
}

#[test]
fn a_small_graph_that_makes_a_huge_tensor_is_refused_before_it_takes_memory() {
    let error = complaint(|m| {
        let graph = m.graph.as_mut().unwrap();
        graph
            .initializer
            .push(integers("shape", vec![1 << 20, 1 << 20]));
        graph
            .node
            .push(node("ConstantOfShape", &["shape"], "monster", vec![]));
    });
    assert!(error.contains("shape"), "{error}");
}
