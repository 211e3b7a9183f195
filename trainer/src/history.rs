//! How did it learn? `training.csv`, one row per report, and `loss.svg` drawn from it.

use std::fs;
use std::path::Path;

use plotters::prelude::*;
use serde::{Deserialize, Serialize};

use crate::checkpoint::replace;
use crate::error::TrainError;

/// One row of `training.csv`: means since the row before.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Steps taken.
    pub step: u64,
    /// Squared error of the angular velocity, rad^2.
    pub loss_rotation: f32,
    /// Squared error of the translation velocity, in the unit of the preset.
    pub loss_translation: f32,
    /// Learning rate of the last step.
    pub learning_rate: f32,
}

/// Reads `training.csv`, up to `step`; rows after it belong to a run that was killed.
pub fn read(directory: &Path, step: u64) -> Vec<Entry> {
    let Ok(mut reader) = csv::Reader::from_path(directory.join("training.csv")) else {
        return Vec::new();
    };
    reader
        .deserialize()
        .filter_map(Result::ok)
        .filter(|e: &Entry| e.step <= step)
        .collect()
}

/// Writes `training.csv` and `loss.svg`.
///
/// # Errors
/// A disk that cannot be written.
pub fn write(directory: &Path, entries: &[Entry]) -> Result<(), TrainError> {
    replace(&directory.join("training.csv"), |p| {
        let mut writer = csv::Writer::from_path(p)?;
        for e in entries {
            writer.serialize(e).map_err(std::io::Error::other)?;
        }
        writer.flush()
    })?;
    if entries.len() >= 2 {
        let svg = draw(entries).map_err(|e| TrainError::Data(format!("loss.svg: {e}")))?;
        replace(&directory.join("loss.svg"), |p| fs::write(p, svg))?;
    }
    Ok(())
}

fn draw(entries: &[Entry]) -> Result<String, Box<dyn std::error::Error>> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (720, 400)).into_drawing_area();
        root.fill(&WHITE)?;
        let last = entries.last().map_or(1, |e| e.step) as f64;
        let values = || {
            entries
                .iter()
                .flat_map(|e| [e.loss_rotation, e.loss_translation])
                .filter(|v| *v > 0.0)
        };
        let low = values().fold(f32::INFINITY, f32::min) * 0.8;
        let high = values().fold(0.0, f32::max) * 1.2;
        let mut chart = ChartBuilder::on(&root)
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(56)
            .build_cartesian_2d(0.0..last, (low..high).log_scale())?;
        chart
            .configure_mesh()
            .x_desc("step")
            .y_desc("squared error")
            .light_line_style(TRANSPARENT)
            .draw()?;
        // Blue and orange of the Okabe-Ito palette.
        let series = [
            ("SO(3), rad²", RGBColor(0, 114, 178), 0),
            ("R³", RGBColor(230, 159, 0), 1),
        ];
        for (name, colour, which) in series {
            let line = entries.iter().map(move |e| {
                let y = [e.loss_rotation, e.loss_translation][which];
                (e.step as f64, y)
            });
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(2)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour));
        }
        chart
            .configure_series_labels()
            .border_style(BLACK.mix(0.3))
            .draw()?;
        root.present()?;
    }
    Ok(svg)
}
