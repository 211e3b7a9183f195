//! `shakedown protocols`: the presets with their constants.

use shakedown_report::table::aligned;
use shakedown_sim::Protocol;

use crate::args::{Format, Global, NameArgs};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &NameArgs) -> Result<Exit, Failure> {
    if let Some(name) = &args.name {
        let protocol = Protocol::load(name, &[])?;
        match (global.format, Protocol::source_text(name)) {
            (Format::Json, _) => {
                println!(
                    "{}",
                    serde_json::to_string_pretty(&protocol).expect("plain data")
                );
            }
            (_, Some(text)) => print!("{text}"),
            (_, None) => print!("{}", toml::to_string(&protocol).expect("plain data")),
        }
        return Ok(Exit::Success);
    }
    let presets = Protocol::names()
        .map(|n| Protocol::load(n, &[]))
        .collect::<Result<Vec<_>, _>>()?;
    if global.format == Format::Json {
        println!(
            "{}",
            serde_json::to_string_pretty(&presets).expect("plain data")
        );
        return Ok(Exit::Success);
    }
    let rows: Vec<Vec<String>> = presets
        .iter()
        .map(|p| vec![p.name.clone(), p.version.clone(), p.description.clone()])
        .collect();
    print!(
        "{}",
        aligned(&["protocol", "version", "what it does"], &rows)
    );
    Ok(Exit::Success)
}
