//! Integration allocates nothing: counted by the global allocator of this test binary.

#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System as SystemAllocator};
use std::cell::Cell;
use std::ops::ControlFlow;

use hamel_runtime::{
    Convolutions, Differentiable, Direction, Dop853, Dopri5, Gauss4, Gauss6, Gauss8, Integrator, Invariants,
    Jet, Method, Options, OverScalar, Progress, Projected, Real, Rk4, System, Taylor, Tsit5, Vern9,
};

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

impl<R: Real> System<R> for Pendulum {
    type State = [R; 2];
    fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
        *dy = [y[1], -y[0].sin()];
    }
}

impl<Q: Real, R: Real> OverScalar<Q, R> for Pendulum {
    type Over = Pendulum;
    fn over(&self, _convert: impl Fn(R) -> Q) -> Pendulum {
        Pendulum
    }
    fn state_over(state: &[R; 2], convert: impl Fn(R) -> Q) -> [Q; 2] {
        state.map(convert)
    }
}

impl Differentiable<f64> for Pendulum {
    fn jacobian(&self, _t: f64, y: &[f64; 2], jacobian: &mut [[f64; 2]]) {
        jacobian.copy_from_slice(&[[0.0, 1.0], [-y[0].cos(), 0.0]]);
    }
}

impl Jet<f64> for Pendulum {
    type Workspace = Convolutions<f64, 2>;
    fn workspace(&self) -> Self::Workspace {
        Convolutions::default()
    }
    /// `k s_k = sum_j j y_j c_(k-j)` and `k c_k = -sum_j j y_j s_(k-j)` for `s = sin y`, `c = cos y`.
    fn series(&self, _t: f64, y: &[f64; 2], work: &mut Self::Workspace, out: &mut [[f64; 2]]) {
        work.clear();
        let start = [y[0].sin(), y[0].cos()];
        let mut s = start[0];
        let mut next = *y;
        for (k, out) in out.iter_mut().enumerate() {
            *out = next;
            if k > 0 {
                let n = k as f64;
                let rate = n * out[0];
                let [cosines, sines] = work.sums();
                s = (cosines + rate * start[1]) / n;
                let c = -(sines + rate * start[0]) / n;
                work.push([rate; 2], [c, s]);
            }
            next = [out[1] / (k + 1) as f64, -s / (k + 1) as f64];
        }
    }
}

impl Invariants<f64, 1> for Pendulum {
    fn values(&self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [0.5 * y[1] * y[1] - y[0].cos()]
    }
    fn gradients(&self, _t: f64, y: &[f64; 2], gradients: &mut [[f64; 2]; 1]) {
        gradients[0] = [y[0].sin(), y[1]];
    }
}

/// Allocations while a solver is made, run, sampled, stopped at events and driven into an error.
fn allocations<M: Method<f64, Pendulum>>(method: M, options: Options<f64>) -> u64 {
    let before = N_ALLOCATIONS.with(Cell::get);
    let mut solver = Integrator::new(&Pendulum, method, 0.0, [1.0, 0.0], options).unwrap();
    solver.integrate_to(1.0).unwrap();
    let mut sum = 0.0;
    solver.sample(5.0, (1..400).map(|i| 1.0 + f64::from(i) * 0.01), |_, y| sum += y[0]).unwrap();
    let mut n_events = 0;
    let progress = solver.integrate_with_events(
        20.0,
        [Direction::Either; 2],
        |_, y| [y[0], y[1]],
        |_| {
            n_events += 1;
            if n_events == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    );
    let stopped = progress == Ok(Progress::Running) && n_events == 3;
    let failed = solver.integrate_to(f64::NAN).is_err();
    let after = N_ALLOCATIONS.with(Cell::get);
    assert!(stopped && failed && sum.is_finite() && sum != 0.0);
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
    assert_eq!(allocations(Vern9, Options::adaptive(1e-12, 1e-12)), 0);
    assert_eq!(allocations(Gauss4::fixed_point(), Options::fixed(0.05)), 0);
    assert_eq!(allocations(Gauss6::newton(), Options::fixed(0.05)), 0);
    assert_eq!(allocations(Gauss8::fixed_point(), Options::fixed(0.05)), 0);
    assert_eq!(allocations(Projected::<_, 1>::new(Rk4), Options::fixed(0.05)), 0);
    assert_eq!(allocations(Taylor::new(), Options::adaptive(1e-12, 1e-12)), 0);
    assert_eq!(allocations(Taylor::of_order(8), Options::fixed(0.05)), 0);
    assert_eq!(allocations(Projected::<_, 1>::new(Taylor::new()), Options::adaptive(1e-12, 1e-12)), 0);
}

#[cfg(feature = "lanes")]
#[test]
fn integration_in_lanes_allocates_nothing() {
    use hamel_runtime::{Gauss16, Gbs14};

    assert_eq!(allocations(Gbs14, Options::adaptive(1e-12, 1e-12)), 0);
    assert_eq!(allocations(Gauss16, Options::fixed(0.05)), 0);
    assert_eq!(allocations(Projected::<_, 1>::new(Gauss16), Options::fixed(0.05)), 0);
}

#[test]
fn fluids_allocate_nothing() {
    use hamel_runtime::matrices::{Current, IsospectralMidpoint, Options, Torus};

    const N: usize = 15;
    let options = Options::fixed(0.02).with_carried(1).with_background();
    let tables = [0.0; Torus::<[f64; 0]>::storage(N)];
    let mut room = vec![0.0; IsospectralMidpoint::<Torus<&mut [f64]>, &mut [f64]>::storage(N, &options)];
    let modes: [f64; N * N - 1] = core::array::from_fn(|k| 1.0 / (1 + k) as f64);
    let before = N_ALLOCATIONS.with(Cell::get);
    let torus = Torus::new(N, tables).unwrap();
    let mut fluid = IsospectralMidpoint::new(&torus, &mut room[..], 0.0, options).unwrap();
    torus.set_modes(&modes, fluid.vorticity_mut());
    fluid.set_current(0, Current::magnetic()).unwrap();
    torus.add_mode((1, 2), [0.1, 0.0], fluid.carried_mut(0));
    torus.add_mode((0, 1), [0.1, 0.0], fluid.constant_current_mut(0));
    fluid.integrate_to(0.1).unwrap();
    let [mut casimirs, mut of_field, mut crosses] = [[0.0; 4]; 3];
    fluid.casimirs(&mut casimirs);
    fluid.carried_casimirs(0, &mut of_field);
    fluid.cross_casimirs(0, &mut crosses);
    assert!(fluid.energy() > 0.0 && casimirs[1] > 0.0 && of_field[1] > 0.0 && crosses[0] != 0.0);
    assert_eq!(N_ALLOCATIONS.with(Cell::get), before);
}
