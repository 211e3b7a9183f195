//! No bytes make the loader of a flow model panic: any graph as encoder or as velocity beside a good
//! other one.
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
    let part = if kind % 2 == 0 { &mut files.encoder } else { &mut files.velocity };
    *part = Cow::Owned(graph.to_vec());
    let _ = FlowModel::open(&files, None);
});
