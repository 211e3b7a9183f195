//! A trial's memory: little, and none of it taken while it runs.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use nalgebra::{Isometry3, Vector3};
use shakedown_sim::probe::Probe;
use shakedown_sim::{ObjectLoad, run_trial};
use shakedown_tests::rig::{block, centred, gripped};

thread_local! {
    static CALLS: Cell<usize> = const { Cell::new(0) };
    static NOW: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

/// The system's allocator, counting what each thread does.
struct Counting;

fn count(bytes: isize) {
    if bytes > 0 {
        CALLS.with(|c| c.set(c.get() + 1));
    }
    NOW.with(|now| {
        now.set(now.get() + bytes);
        MOST.with(|most| most.set(most.get().max(now.get())));
    });
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn no_step_of_a_gripped_object_allocates() {
    let scene = gripped(&block(Vector3::repeat(0.05), 0.1), 0.5, 20.0, &[]);
    let mut probe = Probe::new(&scene, &centred(), 0.08);
    probe.close(0.6, &Vector3::zeros());
    let before = CALLS.with(Cell::get);
    for k in 0..500 {
        // Harder than friction holds: contacts are found anew all the time.
        let load = ObjectLoad {
            force_n: Vector3::y() * (0.06 * f64::from(k)),
            torque_n_m: Vector3::zeros(),
        };
        probe.step(&Isometry3::identity(), &load);
    }
    assert!(probe.motion().0.norm() > 1e-3, "it slid");
    assert_eq!(CALLS.with(Cell::get), before);
}

#[test]
fn a_running_trial_needs_less_than_a_megabyte() {
    let scene = gripped(&block(Vector3::repeat(0.05), 0.1), 0.5, 20.0, &[]);
    let start = NOW.with(Cell::get);
    MOST.with(|m| m.set(start));
    assert!(run_trial(&scene, &centred()).is_held());
    let most = MOST.with(Cell::get) - start;
    assert!((1..1 << 20).contains(&most), "{most} bytes");
    assert_eq!(NOW.with(Cell::get), start, "all of it given back");
}
