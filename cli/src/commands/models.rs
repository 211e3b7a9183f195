//! `shakedown models`: the flow models that are built in.

use shakedown_report::table::{aligned, percent};
use shakedown_sampler::{ModelCard, ModelFiles, built_in_names};

use crate::args::{Format, Global};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global) -> Result<Exit, Failure> {
    let cards = built_in_names()
        .map(|name| ModelFiles::find(name)?.parsed_card())
        .collect::<Result<Vec<ModelCard>, _>>()?;
    if global.format == Format::Json {
        println!(
            "{}",
            serde_json::to_string_pretty(&cards).expect("plain data")
        );
        return Ok(Exit::Success);
    }
    let rows: Vec<Vec<String>> = cards
        .iter()
        .map(|c| {
            let metric = |name: &str| c.metrics.get(name).map_or("-".into(), |v| percent(*v));
            vec![
                c.name.clone(),
                c.gripper.clone(),
                c.steps.to_string(),
                c.evaluator.map_or("-".into(), |e| e.redraws.to_string()),
                metric("training_objects_optimal"),
                metric("training_objects_held"),
                c.licence.clone(),
                c.training_data.clone(),
            ]
        })
        .collect();
    let header = [
        "model",
        "gripper",
        "steps",
        "redraws",
        "optimal",
        "held",
        "licence",
        "trained on",
    ];
    print!("{}", aligned(&header, &rows));
    println!(
        "\noptimal and held: of the flow alone, on objects of its training. Any model of the contract is given as a \
         directory:\n  shakedown run --model DIR    (model.toml, encoder.onnx, velocity.onnx, \
         perhaps evaluator.onnx; docs/formats.md)"
    );
    Ok(Exit::Success)
}
