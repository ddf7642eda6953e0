//! Ensembles allocate nothing for a single trajectory: counted by the global allocator of this test binary.
//!
//! The work of an ensemble is counted in all threads, and compared with a bound. The work of the test's own thread is
//! counted in that thread alone: the harness and a pool that ends allocate meanwhile.

#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use hamel_run::cache::Cache;
use hamel_run::dynamics::Factory;
use hamel_run::ensemble::{Cancel, EnsembleRequest, Progress, Width, integrate};
use hamel_run::evaluate::Judge;
use hamel_run::interpreted::{self, Built};
use hamel_run::members::Beginnings;
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::Checked;
use hamel_run::session::Session;
use hamel_run::stepper::{Pace, Room, Stepper};

/// Counts the allocations, of all threads and of each, and leaves the work to the system.
struct Counting;

static N_ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

thread_local! {
    static N_OF_THREAD: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    N_ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
    N_OF_THREAD.set(N_OF_THREAD.get() + 1);
}

// SAFETY: every call is handed on unchanged to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are what the callee asks for.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const TOP: &str = "
    model pendulum {
        param l = 2 where l > 0;
        coordinate theta in angle;
        coordinate x in real;
        lagrangian = (x_dot^2 + l^2*theta_dot^2/2 + x_dot*theta_dot*cos(theta))/2 + l*cos(theta) - x^2/2;
    }
";

fn scene() -> Built {
    let model = Session::of_shipped(&[]).parse("pendulum", TOP).unwrap_or_else(|e| panic!("{e}"));
    let model = Arc::new(Checked::new(model, Cache::none()));
    interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}")).in_memory()
}

fn allocations_of(scene: &Built, method: MethodName, n: usize) -> usize {
    let mut members = Beginnings::none(1, scene.info().state.len());
    for k in 0..n {
        let x = (k as f64 * 0.37).sin();
        members.push(&[1.5 + 0.3 * x], &[0.4 * x, 0.2, 0.1 - x, 0.3 * x]);
    }
    let request = EnsembleRequest {
        members,
        t_final: 0.5,
        method,
        steps: Steps::Adaptive { rtol: 1e-8, atol: 1e-10, max: None },
        // A state inside of a step costs gbs14 a step, with storage of its own.
        samples: if method == MethodName::Gbs14 { 1 } else { 3 },
        width: Width::Eight,
        max_steps: None,
        watched: None,
        noise: hamel_run::noise::Noise::default(),
        threads: Some(1),
        progress: Progress { all: n, ..Progress::default() },
        cancel: Cancel::default(),
    };
    let before = N_ALLOCATIONS.load(Ordering::Relaxed);
    let members = integrate(scene, &request).unwrap_or_else(|e| panic!("{e}"));
    let n_allocations = N_ALLOCATIONS.load(Ordering::Relaxed) - before;
    assert!(members.len() == n && members.have_arrived());
    n_allocations
}

/// One test, as others would allocate meanwhile.
#[test]
fn nothing_is_allocated_for_a_single_trajectory() {
    let scene = scene();
    assert_eq!(scene.info().state.len(), 4);
    for method in [MethodName::Dop853, MethodName::Vern9, MethodName::Tsit5, MethodName::Gbs14] {
        // Code is compiled once.
        allocations_of(&scene, method, 512);
        let (few, many) = (allocations_of(&scene, method, 2048), allocations_of(&scene, method, 4096));
        // Two blocks more of a thousand trajectories, each with storage of its own.
        assert!(many < few + 2048 / 8, "{}: {few} and {many}", method.name());
    }
    let mut judge = Judge::new(&scene);
    let mut have_values = |n: usize| {
        (0..n).all(|k| {
            let state = [0.01 * k as f64, 0.2, 0.1, 0.3];
            judge.have_values(&[[1.5].as_slice(); 4], &[state.as_slice(); 4])
        })
    };
    assert!(have_values(300));
    let before = N_OF_THREAD.get();
    assert!(have_values(100));
    assert_eq!(N_OF_THREAD.get(), before);
    for method in [MethodName::Dop853, MethodName::Rk4, MethodName::Gbs14] {
        steps_in_the_same_storage(&scene, method);
    }
}

/// A stepper allocates for its first steps, and not again.
fn steps_in_the_same_storage(scene: &Built, method: MethodName) {
    let steps = match method.has_fixed_steps() {
        true => Steps::Fixed { step: 0.01 },
        false => Steps::Adaptive { rtol: 1e-8, atol: 1e-10, max: None },
    };
    let stepper = Stepper::new(scene, &[1.5], Pace { dt: 0.01, method, steps, max_steps: None });
    let stepper = stepper.unwrap_or_else(|e| panic!("{e}"));
    let mut room = Room::default();
    let mut y = [0.4, 0.2, 0.1, 0.3];
    let mut all = [y; 13].concat();
    let mut steps = |n: usize| {
        let before = N_OF_THREAD.get();
        for _ in 0..n {
            // Single states begin with new storage for angles on circles, and for the rows of gbs14 in lanes.
            if method == MethodName::Rk4 {
                stepper.step(&mut room, 0.0, &[], &mut y).unwrap_or_else(|e| panic!("{e}"));
            }
            stepper.step_all(&mut room, 0.0, &[], &mut all).unwrap_or_else(|(_, e)| panic!("{e}"));
        }
        N_OF_THREAD.get() - before
    };
    assert!(steps(300) > 0);
    assert_eq!(steps(100), 0, "{}", method.name());
}
