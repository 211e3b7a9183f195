//! No bytes make the loader of a flow model panic: any graph as encoder, velocity or evaluator beside
//! good other ones.
#![no_main]

use std::borrow::Cow;
use std::sync::LazyLock;

use shakedown_sampler::{FlowModel, ModelFiles};

static GOOD: LazyLock<ModelFiles> = LazyLock::new(|| {
    let directory = std::env::var("SHAKEDOWN_FUZZ_MODEL").expect("a directory with a good model");
    ModelFiles::read(directory.as_ref()).expect("a good model")
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, graph)) = bytes.split_first() else {
        return;
    };
    let mut files = GOOD.clone();
    let graph = Cow::Owned(graph.to_vec());
    match kind % 3 {
        0 => files.encoder = graph,
        1 => files.velocity = graph,
        _ => files.evaluator = Some(graph),
    }
    let _ = FlowModel::open(&files, None);
});
