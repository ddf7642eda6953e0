//! An order in which everything comes after what it uses, and the circles that prevent one.
//!
//! Deliberately does not know: what uses what.

/// An order in which everything comes after what it uses, and the cycles that prevent one.
pub(super) fn order_by_use(uses: &[Vec<usize>]) -> (Vec<usize>, Vec<Vec<usize>>) {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; uses.len()];
    let (mut order, mut cycles) = (Vec::new(), Vec::new());
    for root in 0..uses.len() {
        if state[root] != State::New {
            continue;
        }
        // The path from the root, each with the next use to follow.
        let mut path: Vec<(usize, usize)> = vec![(root, 0)];
        state[root] = State::Open;
        while let Some((node, next)) = path.last_mut() {
            match uses[*node].get(*next) {
                Some(used) => {
                    *next += 1;
                    let used = *used;
                    match state[used] {
                        State::New => {
                            state[used] = State::Open;
                            path.push((used, 0));
                        }
                        State::Open => {
                            let start = path.iter().position(|(n, _)| *n == used).unwrap_or(0);
                            cycles.push(path[start..].iter().map(|(n, _)| *n).collect());
                        }
                        State::Done => {}
                    }
                }
                None => {
                    state[*node] = State::Done;
                    order.push(*node);
                    path.pop();
                }
            }
        }
    }
    (order, cycles)
}

pub(super) fn describe_cycle<'a>(cycle: &[usize], name: impl Fn(usize) -> &'a String) -> String {
    let mut words: Vec<&str> = cycle.iter().take(8).map(|k| name(*k).as_str()).collect();
    if cycle.len() > 8 {
        words.push("..");
    }
    if let Some(first) = cycle.first() {
        words.push(name(*first));
    }
    words.join(" -> ")
}
