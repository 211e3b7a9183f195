//! Aligned tables and rates as they are printed.

/// A rate as a percentage with one digit.
pub fn percent(x: f64) -> String {
    format!("{:.1} %", 100.0 * x)
}

/// An interval of rates as percentages.
pub fn percent_interval(ci: Option<[f64; 2]>) -> String {
    ci.map_or_else(String::new, |[a, b]| {
        format!("[{:.1}, {:.1}]", 100.0 * a, 100.0 * b)
    })
}

/// A number with three digits, or a dash.
pub fn three(x: Option<f64>) -> String {
    x.map_or_else(|| "-".into(), |v| format!("{v:.3}"))
}

/// Lines of an aligned table; the first column is left-aligned, the others right-aligned. Works as
/// Markdown and in a terminal.
pub fn aligned(header: &[&str], rows: &[Vec<String>]) -> String {
    let columns = header.len();
    let cell = |text: &str| text.replace('|', "\\|").replace(['\n', '\r'], " ");
    let rows: Vec<Vec<String>> = rows
        .iter()
        .map(|r| r.iter().map(|c| cell(c)).collect())
        .collect();
    let width = |c: usize| {
        rows.iter()
            .map(|r| r[c].chars().count())
            .chain([header[c].chars().count(), 3])
            .max()
            .unwrap_or(3)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |cells: Vec<&str>| {
        let padded: Vec<String> = cells
            .iter()
            .enumerate()
            .map(|(i, c)| {
                let fill = " ".repeat(widths[i] - c.chars().count());
                if i == 0 {
                    format!("{c}{fill}")
                } else {
                    format!("{fill}{c}")
                }
            })
            .collect();
        format!("| {} |\n", padded.join(" | "))
    };
    let mut out = line(header.to_vec());
    let rule: Vec<String> = widths
        .iter()
        .enumerate()
        .map(|(i, w)| {
            if i == 0 {
                "-".repeat(*w)
            } else {
                format!("{}:", "-".repeat(w - 1))
            }
        })
        .collect();
    out.push_str(&format!("| {} |\n", rule.join(" | ")));
    for row in &rows {
        out.push_str(&line(row.iter().map(String::as_str).collect()));
    }
    out
}
