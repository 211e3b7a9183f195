//! OFF (and COFF, whose colours are skipped): no maintained crate reads it, so these lines do.

use std::path::Path;

use crate::error::{ObjectError, Place};
use crate::mesh::RawMesh;

/// Vertices and faces of the file; polygons are split into fans.
///
/// # Errors
/// Names the line that cannot be read.
pub fn parse(bytes: &[u8], path: &Path) -> Result<RawMesh, ObjectError> {
    let bad = |line: usize, what: String| {
        ObjectError::bad(
            path,
            Place::Line(line),
            what,
            "correct the line or export the mesh again",
        )
    };
    let text = std::str::from_utf8(bytes).map_err(|_| bad(1, "not text".into()))?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, l)| (i + 1, l.split('#').next().unwrap_or("").trim()))
        .filter(|(_, l)| !l.is_empty());
    let (first_line, first) = lines.next().ok_or_else(|| bad(1, "empty".into()))?;
    // Some exporters put the counts on the line of the magic word.
    let rest = first
        .trim_start_matches("COFF")
        .trim_start_matches("OFF")
        .trim();
    let (count_line, counts) = if rest.is_empty() {
        lines
            .next()
            .ok_or_else(|| bad(first_line, "the counts are missing".into()))?
    } else {
        (first_line, rest)
    };
    let counts: Vec<usize> = counts
        .split_ascii_whitespace()
        .map_while(|w| w.parse().ok())
        .collect();
    let [vertex_count, face_count, ..] = counts[..] else {
        return Err(bad(
            count_line,
            "expected the number of vertices and faces".into(),
        ));
    };
    let mut raw = RawMesh::default();
    let mut last = count_line;
    for i in 0..vertex_count {
        let (line, text) = lines.next().ok_or_else(|| {
            bad(
                last,
                format!("the file ends at vertex {i} of {vertex_count}"),
            )
        })?;
        last = line;
        let xyz: Vec<f64> = text
            .split_ascii_whitespace()
            .take(3)
            .map_while(|w| w.parse().ok())
            .collect();
        let [x, y, z] = xyz[..] else {
            return Err(bad(line, "expected three coordinates".into()));
        };
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return Err(bad(line, format!("a coordinate is {x} {y} {z}")));
        }
        raw.vertices.push([x, y, z]);
    }
    for i in 0..face_count {
        let (line, text) = lines
            .next()
            .ok_or_else(|| bad(last, format!("the file ends at face {i} of {face_count}")))?;
        last = line;
        let mut words = text.split_ascii_whitespace();
        let n: usize = words
            .next()
            .and_then(|w| w.parse().ok())
            .filter(|&n| n >= 3)
            .ok_or_else(|| bad(line, "expected a number of corners >= 3".into()))?;
        let corners: Vec<u32> = words.take(n).map_while(|w| w.parse().ok()).collect();
        if corners.len() != n || corners.iter().any(|&c| c as usize >= vertex_count) {
            return Err(bad(
                line,
                format!("expected {n} indices below {vertex_count}"),
            ));
        }
        for k in 1..n - 1 {
            raw.faces.push([corners[0], corners[k], corners[k + 1]]);
        }
    }
    Ok(raw)
}
