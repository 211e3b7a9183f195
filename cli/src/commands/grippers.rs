//! `shakedown grippers`: the hands that are built in.

use shakedown_gripper_assets::Gripper;
use shakedown_report::table::aligned;

use crate::args::{Format, Global, NameArgs};
use crate::failure::{Exit, Failure};

pub fn run(global: &Global, args: &NameArgs) -> Result<Exit, Failure> {
    if let Some(name) = &args.name {
        let gripper = Gripper::load(name)?;
        match (global.format, Gripper::source_text(name)) {
            (Format::Json, _) => {
                println!(
                    "{}",
                    serde_json::to_string_pretty(&gripper).expect("plain data")
                );
            }
            (_, Some(text)) => print!("{text}"),
            (_, None) => print!("{}", toml::to_string(&gripper).expect("plain data")),
        }
        return Ok(Exit::Success);
    }
    let grippers = Gripper::names()
        .map(Gripper::load)
        .collect::<Result<Vec<_>, _>>()?;
    if global.format == Format::Json {
        println!(
            "{}",
            serde_json::to_string_pretty(&grippers).expect("plain data")
        );
        return Ok(Exit::Success);
    }
    let rows: Vec<Vec<String>> = grippers
        .iter()
        .map(|g| {
            vec![
                g.name.clone(),
                format!("{:.0}", g.opening_max_m * 1e3),
                format!("{:.1}", g.tcp_z_m * 1e3),
                format!(
                    "{:.0} / {:.0}",
                    g.drive.force_continuous_n, g.drive.force_max_n
                ),
                g.description.clone(),
            ]
        })
        .collect();
    print!(
        "{}",
        aligned(
            &["gripper", "opening mm", "tcp mm", "force N", "what it is"],
            &rows
        )
    );
    Ok(Exit::Success)
}
