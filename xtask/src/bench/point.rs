//! A solution that was timed.
//!
//! Does not know: how it was timed or is shown.

/// By whom the methods of the runtime are.
pub(crate) const OWN: &str = "hamel";

/// A solution that was timed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// By what: `hamel`, `hamel, <instruction set>`, or who else.
    pub(crate) by: String,
    /// Name of the method.
    pub(crate) method: String,
    /// `rtol = atol`, or the number of steps of a method without error estimate.
    pub(crate) knob: f64,
    /// `max_i |dy_i| / (1 + |y_i|)` at the end.
    pub(crate) error: f64,
    /// Evaluations of the right-hand side, or expansions of the solution; zero where they are not counted.
    pub(crate) evals: u64,
    /// Steps, rejected ones included.
    pub(crate) steps: u64,
    /// Microseconds of the fastest solution.
    pub(crate) us: f64,
}

impl Point {
    /// The point of a line `<by>;<method>;<knob>;<error>;<evals>;<steps>;<ns>`.
    pub(super) fn parse(line: &str) -> Option<Point> {
        let fields: Vec<&str> = line.split(';').collect();
        let [by, method, knob, error, evals, steps, ns] = fields[..] else { return None };
        Some(Point {
            by: by.to_owned(),
            method: method.to_owned(),
            knob: knob.parse().ok()?,
            error: error.parse().ok()?,
            evals: evals.parse().ok()?,
            steps: steps.parse().ok()?,
            us: 1e-3 * ns.parse::<f64>().ok()?,
        })
    }

    /// Whether a method of the runtime computed it.
    pub(crate) fn is_own(&self) -> bool {
        self.by == OWN || self.set().is_some()
    }

    /// The instruction set that a method of the runtime was compiled for besides that of the page.
    pub(crate) fn set(&self) -> Option<&str> {
        self.by.strip_prefix(OWN)?.strip_prefix(", ")
    }

    /// Whether it is one of several solutions side by side, whose time no single one has.
    pub(crate) fn is_lane(&self) -> bool {
        self.method.ends_with(" lanes")
    }

    /// Who and how in one line.
    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.by, self.method)
    }
}

/// The fastest of points whose error is at most `bound`.
pub(crate) fn fastest<'a>(points: impl IntoIterator<Item = &'a Point>, bound: f64) -> Option<&'a Point> {
    points.into_iter().filter(|p| p.error <= bound).min_by(|a, b| a.us.total_cmp(&b.us))
}

#[cfg(test)]
mod tests {
    use super::{Point, fastest};

    #[test]
    fn points_are_read_and_the_fastest_within_the_error_is_found() {
        let lines = [
            "hamel;vern9;1e-9;2e-10;100;6;5000",
            "hamel;vern9;1e-8;2e-9;80;5;4000",
            "x y;dop;1e-9;1e-11;3;2;4500",
        ];
        let points: Vec<Point> = lines.iter().filter_map(|line| Point::parse(line)).collect();
        assert_eq!(points.len(), 3);
        assert_eq!(fastest(&points, 1e-9).map(Point::name).as_deref(), Some("x y dop"));
        assert_eq!(fastest(&points, 1e-8).map(|p| p.us), Some(4.0));
        assert_eq!(fastest(&points, 1e-12), None);
        assert_eq!(Point::parse("hamel;vern9;1e-9"), None);
        let wide = Point { by: "hamel, x86-64-v4".into(), ..points[0].clone() };
        assert_eq!((wide.is_own(), wide.set()), (true, Some("x86-64-v4")));
        assert_eq!((points[0].set(), points[2].set(), points[2].is_own()), (None, None, false));
    }
}
