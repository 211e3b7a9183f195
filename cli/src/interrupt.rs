//! Ctrl-C: no new trial starts, what is finished is on disk, and the user learns how to go on.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static STOP: AtomicBool = AtomicBool::new(false);

/// Listens for Ctrl-C and termination from now on; a second one ends at once.
pub fn listen() {
    static ONCE: OnceLock<()> = OnceLock::new();
    ONCE.get_or_init(|| {
        // Without a handler the default one ends the process: the journal survives that too.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
    });
}

/// Was the process asked to stop?
pub fn requested() -> bool {
    STOP.load(Ordering::Relaxed)
}
