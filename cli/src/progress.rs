//! Progress on stderr: a bar with rate and time left on a terminal, nothing otherwise.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::args::{Color, Global};

/// A bar over `total` grasps.
pub fn bar(global: &Global, total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if global.quiet {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    let plain = global.color == Color::Never || std::env::var_os("NO_COLOR").is_some();
    let template = if plain {
        "{msg:20!} [{bar:30}] {pos}/{len} {per_sec} {eta} left"
    } else {
        "{msg:20!} [{bar:30.cyan}] {pos}/{len} {per_sec} {eta} left"
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// A note on stderr, unless quiet.
pub fn note(global: &Global, text: &str) {
    if !global.quiet {
        eprintln!("note: {text}");
    }
}
