//! Integration allocates nothing: counted by the global allocator of this test binary.

#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System as SystemAllocator};
use std::cell::Cell;

use hamel_runtime::{Dop853, Dopri5, Integrator, Method, Options, Rk4, System, Tsit5};

/// Counts the allocations of each thread and leaves the work to the system.
struct Counting;

thread_local! {
    // Constant and without destructor, so that counting itself allocates nothing.
    static N_ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    N_ALLOCATIONS.with(|n| n.set(n.get() + 1));
}

// SAFETY: every call is handed on unchanged to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are those that the callee asks for.
        unsafe { SystemAllocator.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { SystemAllocator.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { SystemAllocator.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

struct Pendulum;

impl System<f64> for Pendulum {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -y[0].sin()];
    }
}

/// Allocations while a solver is made, run, sampled and driven into an error.
fn allocations<M: Method>(method: M, options: Options<f64>) -> u64 {
    let before = N_ALLOCATIONS.with(Cell::get);
    let mut solver = Integrator::new(&Pendulum, method, 0.0, [1.0, 0.0], options).unwrap();
    solver.integrate_to(1.0).unwrap();
    let mut sum = 0.0;
    solver.sample(5.0, (1..400).map(|i| 1.0 + f64::from(i) * 0.01), |_, y| sum += y[0]).unwrap();
    let failed = solver.integrate_to(f64::NAN).is_err();
    let after = N_ALLOCATIONS.with(Cell::get);
    assert!(failed && sum.is_finite() && sum != 0.0);
    after - before
}

#[test]
fn integration_allocates_nothing() {
    let probe = N_ALLOCATIONS.with(Cell::get);
    drop(std::hint::black_box(Box::new(1.0)));
    assert_eq!(N_ALLOCATIONS.with(Cell::get), probe + 2, "the allocator counts");

    assert_eq!(allocations(Rk4, Options::fixed(0.01)), 0);
    assert_eq!(allocations(Tsit5, Options::fixed(0.01)), 0);
    assert_eq!(allocations(Dopri5, Options::adaptive(1e-9, 1e-9)), 0);
    assert_eq!(allocations(Tsit5, Options::adaptive(1e-9, 1e-9)), 0);
    assert_eq!(allocations(Dop853, Options::adaptive(1e-12, 1e-12)), 0);
}
