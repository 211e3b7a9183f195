//! `trials.csv`: one row per grasp.

use std::io::Write;

/// Column names, in the order of the contract.
pub const COLUMNS: [&str; 33] = [
    "object",
    "grasp",
    "score",
    "label",
    "x_m",
    "y_m",
    "z_m",
    "qx",
    "qy",
    "qz",
    "qw",
    "width_m",
    "class",
    "collides",
    "reachable",
    "closes",
    "centred",
    "aligned",
    "penetration_m",
    "outcome",
    "held",
    "slip_linear_m",
    "slip_angular_rad",
    "closing_linear_m",
    "closing_angular_rad",
    "grip_force_n",
    "sim_s",
    "p_hold",
    "stage",
    "margin_g",
    "closing_width_m",
    "epsilon",
    "wrench_volume",
];

/// One row; `None` becomes an empty cell.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrialRow {
    /// Number of the grasp within its object.
    pub grasp: u64,
    /// Score of the grasp's maker.
    pub score: Option<f64>,
    /// Label of the input.
    pub label: Option<bool>,
    /// `object_from_hand`, ACRONYM frame: x, y, z (metres), quaternion x, y, z, w.
    pub pose: [f64; 7],
    /// Opening before closing, metres.
    pub width_m: Option<f64>,
    /// Class and flags of the classifier.
    pub geometry: Option<GeometryCells>,
    /// Outcome and measurements of the trial.
    pub physics: Option<PhysicsCells>,
    /// Calibrated probability to hold.
    pub p_hold: Option<f64>,
    /// Analytic quality, where it was asked for: Ferrari-Canny epsilon and wrench-space volume.
    pub wrench: Option<[f64; 2]>,
}

/// Cells of the classifier.
#[derive(Debug, Clone, PartialEq)]
pub struct GeometryCells {
    /// `optimal`, `collision` or `out_of_reach`.
    pub class: &'static str,
    /// collides, reachable, closes, centred, aligned.
    pub flags: [bool; 5],
    /// Depth, metres.
    pub penetration_m: f64,
    /// Distance of the two predicted contacts along the closing axis, metres.
    pub closing_width_m: Option<f64>,
}

/// Cells of the trial.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicsCells {
    /// Name of the outcome.
    pub outcome: &'static str,
    /// Did it hold?
    pub held: bool,
    /// Slip (m, rad), motion while closing (m, rad), grip force (N).
    pub measurements: [Option<f64>; 5],
    /// Simulated time, s.
    pub sim_s: f64,
    /// What the trial was doing when it ended.
    pub stage: &'static str,
    /// Under `hardness`: the acceleration survived, multiples of 9.81 m/s2.
    pub margin_g: Option<f64>,
}

/// Appends a number in its shortest round-trip form.
fn push_number(line: &mut String, value: f64) {
    use std::fmt::Write as _;
    // Debug keeps the shortest digits and turns to exponents at the extremes.
    let _ = write!(line, "{value:?}");
}

/// Writes the header.
///
/// # Errors
/// Those of the writer.
pub fn write_header(out: &mut impl Write) -> std::io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))
}

/// Appends one row of an object.
///
/// # Errors
/// Those of the writer.
pub fn write_row(out: &mut impl Write, object: &str, row: &TrialRow) -> std::io::Result<()> {
    let mut line = String::with_capacity(256);
    line.push_str(&quoted(object));
    line.push(',');
    line.push_str(&row.grasp.to_string());
    let flag = |b: bool| if b { "1" } else { "0" };
    let number = |line: &mut String, value: Option<f64>| {
        line.push(',');
        if let Some(v) = value {
            push_number(line, v);
        }
    };
    number(&mut line, row.score);
    line.push(',');
    line.push_str(row.label.map_or("", flag));
    for x in row.pose {
        number(&mut line, Some(x));
    }
    number(&mut line, row.width_m);
    match &row.geometry {
        Some(g) => {
            line.push(',');
            line.push_str(g.class);
            for f in g.flags {
                line.push(',');
                line.push_str(flag(f));
            }
            number(&mut line, Some(g.penetration_m));
        }
        None => line.push_str(",,,,,,,"),
    }
    match &row.physics {
        Some(p) => {
            line.push(',');
            line.push_str(p.outcome);
            line.push(',');
            line.push_str(flag(p.held));
            for m in p.measurements {
                number(&mut line, m);
            }
            number(&mut line, Some(p.sim_s));
        }
        None => line.push_str(",,,,,,,,"),
    }
    number(&mut line, row.p_hold);
    line.push(',');
    line.push_str(row.physics.as_ref().map_or("", |p| p.stage));
    number(&mut line, row.physics.as_ref().and_then(|p| p.margin_g));
    let closing_width_m = row.geometry.as_ref().and_then(|g| g.closing_width_m);
    number(&mut line, closing_width_m);
    number(&mut line, row.wrench.map(|w| w[0]));
    number(&mut line, row.wrench.map(|w| w[1]));
    line.push('\n');
    out.write_all(line.as_bytes())
}

/// A CSV field, quoted only where it must be (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_has_the_columns_of_the_contract() {
        let full = TrialRow {
            grasp: 7,
            score: Some(0.1 + 0.2),
            label: Some(true),
            pose: [1.0, -2.5e-12, 0.3, 0.0, 0.0, 0.0, 1.0],
            width_m: Some(0.08),
            geometry: Some(GeometryCells {
                class: "optimal",
                flags: [false, true, true, true, false],
                penetration_m: 0.0,
                closing_width_m: Some(0.0625),
            }),
            physics: Some(PhysicsCells {
                outcome: "held",
                held: true,
                measurements: [Some(0.001), None, Some(2.0), Some(0.1), Some(20.0)],
                sim_s: 2.7,
                stage: "hold",
                margin_g: Some(3.5),
            }),
            p_hold: None,
            wrench: Some([0.02, 1e-6]),
        };
        let mut out = Vec::new();
        write_header(&mut out).unwrap();
        write_row(&mut out, "a,\"b\"\nc", &full).unwrap();
        write_row(&mut out, "plain", &TrialRow::default()).unwrap();
        let mut reader = csv::Reader::from_reader(&out[..]);
        assert_eq!(
            reader.headers().unwrap().iter().collect::<Vec<_>>(),
            COLUMNS
        );
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert!(rows.iter().all(|r| r.len() == COLUMNS.len()));
        assert_eq!(&rows[0][0], "a,\"b\"\nc");
        assert_eq!(rows[0][2].parse::<f64>().unwrap(), 0.1 + 0.2);
        assert_eq!(rows[0][5].parse::<f64>().unwrap(), -2.5e-12);
        assert_eq!(
            (&rows[0][12], &rows[0][19], &rows[0][20]),
            ("optimal", "held", "1")
        );
        assert_eq!((&rows[0][28], &rows[0][29]), ("hold", "3.5"));
        assert_eq!(&rows[0][30], "0.0625");
        assert_eq!((&rows[0][31], &rows[0][32]), ("0.02", "1e-6"));
        assert!((27..33).all(|i| rows[1][i].is_empty()));
    }
}
