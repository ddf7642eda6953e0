//! The one search that tries ways of writing the same, counts, and keeps the cheapest.
//!
//! Deliberately does not know: what is written, what it costs.

/// What ways are tried on.
pub trait Workspace {
    /// What a way changes.
    type State: Clone;

    /// A copy of what a way changes.
    fn state(&self) -> Self::State;

    /// Puts a state in the place of the present one; the budget that the present one has spent stays spent.
    fn put_back(&mut self, state: Self::State);
}

/// Ways that make all they make.
impl Workspace for () {
    type State = ();

    fn state(&self) {}

    fn put_back(&mut self, (): ()) {}
}

/// What was made in the cheapest way of some, each of which began in the same state.
#[derive(Clone, Debug)]
pub struct Trials<S, T> {
    start: S,
    best: Option<(u64, S, T)>,
}

impl<S: Clone, T> Trials<S, T> {
    /// No trial yet; each will begin in the present state.
    pub fn new(work: &impl Workspace<State = S>) -> Trials<S, T> {
        Trials { start: work.state(), best: None }
    }

    /// What the cheapest way costs by now.
    pub fn cost(&self) -> Option<u64> {
        self.best.as_ref().map(|(cost, ..)| *cost)
    }

    /// Tries a way, which tells its cost and what it made, or makes nothing. It is kept if it costs less than the
    /// cheapest before by more than `margin`; whether it is.
    pub fn attempt<W: Workspace<State = S>>(
        &mut self,
        work: &mut W,
        margin: u64,
        way: impl FnOnce(&mut W) -> Option<(u64, T)>,
    ) -> bool {
        work.put_back(self.start.clone());
        let Some((cost, made)) = way(work) else { return false };
        let is_kept = self.cost().is_none_or(|least| cost.saturating_add(margin) < least);
        if is_kept {
            self.best = Some((cost, work.state(), made));
        }
        is_kept
    }

    /// What the cheapest way made, with the workspace as it left it; none where no way made anything.
    pub fn finish(self, work: &mut impl Workspace<State = S>) -> Option<T> {
        let (_, state, made) = self.best?;
        work.put_back(state);
        Some(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A text and what was spent on it.
    struct Page(String, usize);

    impl Workspace for Page {
        type State = String;

        fn state(&self) -> String {
            self.0.clone()
        }

        fn put_back(&mut self, state: String) {
            self.1 += self.0.len();
            self.0 = state;
        }
    }

    #[test]
    fn the_cheapest_way_is_kept_with_what_it_wrote_and_a_margin_keeps_the_first() {
        let mut page = Page("x".to_owned(), 0);
        let mut trials = Trials::new(&page);
        let way = |text: &'static str, cost: u64| {
            move |page: &mut Page| {
                page.0.push_str(text);
                Some((cost, cost))
            }
        };
        assert!(trials.attempt(&mut page, 0, way("first", 10)));
        assert!(!trials.attempt(&mut page, 2, way("near", 8)));
        assert!(!trials.attempt(&mut page, 0, |_| None));
        assert!(trials.attempt(&mut page, 0, way("last", 9)));
        assert!(!trials.attempt(&mut page, 0, way("equal", 9)));
        assert_eq!(trials.finish(&mut page), Some(9));
        assert_eq!(page.0, "xlast");
        assert!(page.1 > page.0.len(), "what the other ways took stays spent");
        assert_eq!(Trials::<String, u64>::new(&page).finish(&mut page), None);
        assert_eq!(page.0, "xlast");
    }
}
