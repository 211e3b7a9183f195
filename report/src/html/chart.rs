//! Small charts as SVG, each beside the table of its numbers.

use std::cmp::Ordering;

use crate::table::percent;

/// Text as text: nothing in it can become markup.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}

/// A table; cells are markup.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let row = |tag: &str, cells: &[String]| {
        let inner: String = cells
            .iter()
            .enumerate()
            .map(|(i, c)| match (tag, i) {
                ("th", _) => format!("<th scope='col'>{c}</th>"),
                (_, 0) => format!("<th scope='row'>{c}</th>"),
                _ => format!("<td>{c}</td>"),
            })
            .collect();
        format!("<tr>{inner}</tr>\n")
    };
    let head: Vec<String> = header.iter().map(|h| escaped(h)).collect();
    let body: String = rows.iter().map(|r| row("td", r)).collect();
    format!(
        "<div class='scroll'><table><thead>{}</thead><tbody>\n{body}</tbody></table></div>\n",
        row("th", &head)
    )
}

/// A bar from 0 to 1 with its interval as a whisker.
pub fn bar(rate: f64, ci: Option<[f64; 2]>) -> String {
    let whisker = ci.map_or_else(String::new, |[a, b]| {
        format!(
            "<path class='whisker' d='M{0:.1} 3v8M{0:.1} 7H{1:.1}M{1:.1} 3v8'/>",
            1.0 + 158.0 * a,
            1.0 + 158.0 * b
        )
    });
    format!(
        "<svg class='bar' viewBox='0 0 160 14' preserveAspectRatio='none' role='img' aria-label='{}'><rect class='track' \
         width='160' height='14' rx='2'/><rect class='fill' width='{:.1}' height='14' rx='2'/>\
         {whisker}</svg>",
        percent(rate),
        160.0 * rate
    )
}

/// A bar from 0 to `share` of the width, with a mark at another share.
pub fn marked_bar(share: f64, mark: f64, label: &str) -> String {
    format!(
        "<svg class='bar' viewBox='0 0 160 14' preserveAspectRatio='none' role='img' aria-label='{}'><rect class='track' \
         width='160' height='14' rx='2'/><rect class='fill' width='{:.1}' height='14' rx='2'/>\
         <path class='whisker' d='M{:.1} 0v14'/></svg>",
        escaped(label),
        160.0 * share,
        160.0 * mark
    )
}

/// From one rate to another: a ring, a line, a dot.
pub fn change(base: f64, new: f64) -> String {
    let x = |rate: f64| 5.0 + 150.0 * rate;
    let kind = match new.total_cmp(&base) {
        Ordering::Less => "worse",
        Ordering::Equal => "before",
        Ordering::Greater => "better",
    };
    format!(
        "<svg class='bar' viewBox='0 0 160 14' role='img' aria-label='{} to {}'><rect class='track' y='6' \
         width='160' height='2'/><path class='{kind}' d='M{:.1} 7H{:.1}'/><circle class='before' cx='{:.1}' cy='7' \
         r='4'/><circle class='{kind}' cx='{:.1}' cy='7' r='4'/></svg>",
        percent(base),
        percent(new),
        x(base),
        x(new),
        x(base),
        x(new)
    )
}

/// A line over x from `x[0]` to `x[last]`, y from 0 to 1; `diagonal` draws where both are equal.
pub fn lines(
    label: &str,
    x_title: &str,
    series: &[(&str, Vec<(f64, f64)>)],
    diagonal: bool,
) -> String {
    const W: f64 = 420.0;
    const H: f64 = 240.0;
    let all = || series.iter().flat_map(|(_, points)| points.iter());
    let low = all().map(|p| p.0).fold(f64::MAX, f64::min);
    let high = all().map(|p| p.0).fold(f64::MIN, f64::max).max(low + 1e-9);
    let (low, high) = if diagonal { (0.0, 1.0) } else { (low, high) };
    let x = |v: f64| 44.0 + (W - 60.0) * (v - low) / (high - low);
    let y = |v: f64| H - 36.0 - (H - 52.0) * v;
    let mut svg = format!(
        "<svg class='chart' viewBox='0 0 {W} {H}' role='img' aria-label='{}'>",
        escaped(label)
    );
    for k in 0..=4 {
        let v = f64::from(k) / 4.0;
        svg += &format!(
            "<path class='grid' d='M44 {0:.1}H{1}'/><text x='38' y='{2:.1}' text-anchor='end'>{3}</text>",
            y(v),
            W - 16.0,
            y(v) + 4.0,
            (100.0 * v).round()
        );
        let at = low + (high - low) * v;
        let text = if diagonal {
            format!("{at:.2}")
        } else {
            format!("{:.0}", at)
        };
        svg += &format!(
            "<text x='{:.1}' y='{}' text-anchor='middle'>{text}</text>",
            x(at),
            H - 18.0
        );
    }
    svg += &format!(
        "<text x='{}' y='{}' text-anchor='end'>{}</text>",
        W - 16.0,
        H - 4.0,
        escaped(x_title)
    );
    if diagonal {
        svg += &format!(
            "<path class='grid' d='M{:.1} {:.1}L{:.1} {:.1}'/>",
            x(0.0),
            y(0.0),
            x(1.0),
            y(1.0)
        );
    }
    for (i, (name, points)) in series.iter().enumerate() {
        let path: Vec<String> = points
            .iter()
            .map(|(px, py)| format!("{:.1} {:.1}", x(*px), y(*py)))
            .collect();
        svg += &format!("<path class='line s{i}' d='M{}'/>", path.join("L"));
        for (px, py) in points {
            svg += &format!(
                "<circle class='dot s{i}' cx='{:.1}' cy='{:.1}' r='3'/>",
                x(*px),
                y(*py)
            );
        }
        svg += &format!(
            "<text class='key s{i}' x='{}' y='{}'>{}</text>",
            44.0 + 110.0 * i as f64,
            H - 4.0,
            escaped(name)
        );
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hostile_text_stays_text() {
        let e = escaped("<script>alert('x')</script> & \"quotes\"");
        assert!(!e.contains('<') && !e.contains('>') && !e.contains('"') && !e.contains('\''));
    }
}
