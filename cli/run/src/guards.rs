//! The guards of a scene as the runtime asks for them.
//!
//! Does not know: who runs the scene.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Mutex;

use hamel_codegen::scene::Interpreter;
use hamel_runtime::{Failure, Pivot, Real};

/// As [`hamel_runtime::System::check`].
pub(super) fn check<R: Real>(interpreter: &Interpreter<'_, R>, t: R, y: &[R]) -> Result<(), Failure> {
    let found = interpreter.visit_pivots(t, y, |(name, value, scale)| {
        let verified = Pivot { name: "", value, scale }.verify(t);
        let named = verified.or_else(|_| Pivot { name: interned(name.to_owned()), value, scale }.verify(t));
        named.map_or_else(ControlFlow::Break, ControlFlow::Continue)
    });
    found.break_value().map_or(Ok(()), Err)
}

/// As [`hamel_runtime::System::domain`].
pub(super) fn domain<R: Real>(interpreter: &Interpreter<'_, R>, t: R, y: &[R]) -> Result<(), Failure> {
    let seconds = if R::ZERO.all_gt(t) { -t.magnitude() } else { t.magnitude() };
    let outside = |condition| Failure::OutsideDomain { t: seconds, condition: interned(condition) };
    interpreter.domain(t, y).map_err(outside)
}

/// As [`hamel_runtime::System::pivots`].
pub(super) fn pivots<R: Real>(
    interpreter: &Interpreter<'_, R>,
    t: R,
    y: &[R],
    visit: &mut dyn FnMut(Pivot<R>),
) {
    let _ = interpreter.visit_pivots(t, y, |(name, value, scale)| {
        visit(Pivot { name: interned(name.to_owned()), value, scale });
        ControlFlow::<()>::Continue(())
    });
}

/// The runtime's failures borrow from the program for ever, so each pivot's name and each condition is kept once.
fn interned(name: String) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(name.as_str()) {
        return known;
    }
    let name: &'static str = name.leak();
    kept.insert(name);
    name
}
