//! No text makes the readers of protocols, hands, object sets, model cards and presets panic.
#![no_main]

use shakedown_gripper_assets::Gripper;
use shakedown_sampler::ModelCard;
use shakedown_sim::Protocol;
use shakedown_trainer::Preset;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else {
        return;
    };
    let Ok(text) = std::str::from_utf8(rest) else {
        return;
    };
    let name = "fuzz.toml".as_ref();
    match kind % 5 {
        0 => drop(Protocol::parse(text, "fuzz.toml", &[])),
        1 => drop(Gripper::parse(text, name)),
        2 => drop(ModelCard::parse(text, name)),
        3 => drop(Preset::parse(text, name)),
        _ => shakedown_fuzz::as_file(rest, "set.toml", |path| {
            drop(shakedown_objects::set::read_set(path));
        }),
    }
});
