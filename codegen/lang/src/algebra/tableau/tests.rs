//! Each step of an elimination against values of the system that it eliminates from.

use std::collections::{BTreeMap, BTreeSet};

use super::*;
use hamel_expr::{ExprId, Graph, SectionWriter, Sign, SymbolId, inlined};

/// `x`, `y`, `z` and values of them.
fn letters(g: &mut Graph) -> (Vec<SymbolId>, Vec<ExprId>, BTreeMap<SymbolId, f64>) {
    let symbols: Vec<SymbolId> = ["x", "y", "z"].map(|name| g.symbol(name)).to_vec();
    let letters = symbols.iter().map(|s| g.sym(*s)).collect();
    let values = symbols.iter().copied().zip([0.7, -1.3, 2.1]).collect();
    (symbols, letters, values)
}

/// `[x, 1, z; y, x, 2; z, y, x + y | 1, x, z]`.
fn rows(g: &mut Graph, letters: &[ExprId]) -> Vec<Vec<ExprId>> {
    let (x, y, z) = (letters[0], letters[1], letters[2]);
    let (one, two, sum) = (g.one(), g.int(2), g.add(x, y));
    vec![vec![x, one, z, one], vec![y, x, two, x], vec![z, y, sum, z]]
}

fn at(g: &Graph, e: ExprId, values: &BTreeMap<SymbolId, f64>) -> f64 {
    g.eval_f64(e, values).expect("a value")
}

/// Whether `rows x = right` for the values in the last column of solved rows.
fn residual(g: &Graph, rows: &[Vec<ExprId>], x: &[f64], values: &BTreeMap<SymbolId, f64>) -> f64 {
    let of_row = rows.iter().map(|row| {
        let left: f64 = row.iter().zip(x).map(|(e, x)| at(g, *e, values) * x).sum();
        (left - at(g, row[x.len()], values)).abs()
    });
    of_row.fold(0.0, f64::max)
}

#[test]
fn cells_blocks_and_columns_solve_the_same_system() {
    let mut g = Graph::new();
    let (_, letters, values) = letters(&mut g);
    let rows = rows(&mut g, &letters);
    let mut by_cells = Tableau::new(rows.clone());
    let mut open = vec![0, 1, 2];
    let mut columns = vec![0, 1, 2];
    let mut x = [0.0; 3];
    let mut places = Vec::new();
    while !open.is_empty() {
        let cells = open.iter().flat_map(|i| columns.iter().map(|j| (*i, *j)));
        let cell = by_cells.best(&mut g, &Judge::BLIND, Tie::Smallest, cells).expect("regular");
        by_cells.eliminate(&mut g, (cell.row, cell.column));
        places.push((cell.row, cell.column));
        open.retain(|i| *i != cell.row);
        columns.retain(|j| *j != cell.column);
    }
    assert_eq!(
        (places[0], places[1].0 == 0),
        ((0, 1), false),
        "the number of the first row is divided by first"
    );
    places.iter().for_each(|(i, j)| x[*j] = at(&g, by_cells.rows()[*i][3], &values));
    assert!(residual(&g, &rows, &x, &values) < 1e-14);

    let mut by_block = Tableau::new(rows.clone());
    let determinant = by_block.eliminate_together(&mut g, &[0, 1, 2], &[0, 1, 2]).expect("regular");
    let x: Vec<f64> = by_block.rows().iter().map(|row| at(&g, row[3], &values)).collect();
    assert!(residual(&g, &rows, &x, &values) < 1e-14);
    let [a, b, c] = [0, 1, 2].map(|i| [0, 1, 2].map(|j| at(&g, rows[i][j], &values)));
    let minor = |i: usize, j: usize| b[i] * c[j] - b[j] * c[i];
    let by_hand = a[0] * minor(1, 2) - a[1] * minor(0, 2) + a[2] * minor(0, 1);
    assert!((at(&g, determinant, &values) - by_hand).abs() < 1e-14);

    let mut crossed = Tableau::new(rows.clone());
    for k in 0..3 {
        crossed.cross_out(&mut g, (k, k));
    }
    let x: Vec<f64> = crossed
        .rows()
        .iter()
        .enumerate()
        .map(|(k, row)| at(&g, row[3], &values) / at(&g, row[k], &values))
        .collect();
    assert!(residual(&g, &rows, &x, &values) < 1e-13);
    let is_whole = |e: &ExprId| {
        g.reachable(&[*e]).iter().all(|e| match g.node(*e) {
            hamel_expr::Node::Product { factors, .. } => {
                factors.iter().all(|(_, q)| q > &hamel_expr::Rational::from_integer(0.into()))
            }
            _ => true,
        })
    };
    assert!(crossed.rows().iter().flatten().all(is_whole), "something was divided by");
}

/// A matrix of nine rows, `x` on the diagonal and `y` beside it, around the corner as well: `x^9 + y^9`.
#[test]
fn determinants_of_many_rows_are_products_of_pivots() {
    let mut g = Graph::new();
    let (_, letters, values) = letters(&mut g);
    let n = MAX_DETERMINANT + 1;
    let entry = |g: &Graph, i: usize, j: usize| match (j + n - i) % n {
        0 => letters[0],
        1 => letters[1],
        _ => g.zero(),
    };
    let square: Vec<Vec<ExprId>> = (0..n).map(|i| (0..n).map(|j| entry(&g, i, j)).collect()).collect();
    let found = determinant_of(&mut g, &square);
    let by_hand = 0.7_f64.powi(9) + (-1.3_f64).powi(9);
    assert!((at(&g, found, &values) - by_hand).abs() < 1e-12 * by_hand.abs());
    // The same with two rows exchanged.
    let mut exchanged = square;
    exchanged.swap(0, 3);
    let found = determinant_of(&mut g, &exchanged);
    assert!((at(&g, found, &values) + by_hand).abs() < 1e-12 * by_hand.abs());
}

#[test]
fn blocks_that_vanish_identically_are_refused_and_kernels_found() {
    let mut g = Graph::new();
    let (_, letters, values) = letters(&mut g);
    let (x, y) = (letters[0], letters[1]);
    let (xx, xy) = (g.mul(x, x), g.mul(x, y));
    // The second row is x times the first, which is not seen from the entries alone.
    let square = vec![vec![x, y], vec![xx, xy]];
    assert_eq!(Tableau::new(square.clone()).eliminate_together(&mut g, &[0, 1], &[0, 1]), None);
    assert!(solve_symbolic(&mut g, &square, &[vec![x], vec![y]]).is_err());
    let (kernel, others) = Tableau::new(square.clone()).kernel(&mut g, &Judge::BLIND, 2);
    assert_eq!((kernel.len(), others.len()), (1, 1));
    for row in &square {
        let along = g.dot(row, &kernel[0]);
        assert!(at(&g, along, &values).abs() < 1e-14);
    }
}

#[test]
fn divisors_are_graded_by_what_is_known_of_them() {
    let mut g = Graph::new();
    let (symbols, letters, _) = letters(&mut g);
    let (x, y, z) = (letters[0], letters[1], letters[2]);
    let params = BTreeSet::from([symbols[0], symbols[1]]);
    let signs = BTreeMap::from([(y, Sign::Positive)]);
    let judge = Judge { params: Known::Params(&params), signs: Some(&signs) };
    let (two, grade) = (g.int(2), |g: &mut Graph, e| judge.grade(g, e).map(|(grade, _)| grade));
    assert_eq!(grade(&mut g, two), Some(Grade::Number));
    assert_eq!(grade(&mut g, y), Some(Grade::Definite));
    assert_eq!(grade(&mut g, x), Some(Grade::Parameter));
    assert_eq!(grade(&mut g, z), Some(Grade::Watched));
    let difference = g.sub(x, y);
    let sum = g.add(x, y);
    let product = g.mul(sum, difference);
    let (xx, yy) = (g.powi(x, 2), g.powi(y, 2));
    let squares = g.sub(xx, yy);
    let zero = g.sub(product, squares);
    assert_eq!(grade(&mut g, zero), None, "what vanishes however it is written is no divisor");
    assert_eq!(Judge::BLIND.grade(&mut g, y), Some((Grade::Watched, 1)));
}

/// `H d + g = 0` by the minimum over one unknown after the other, and after a substitution.
#[test]
fn the_least_value_solves_the_symmetric_system_and_a_substitution_is_a_congruence() {
    let mut g = Graph::new();
    let (symbols, letters, values) = letters(&mut g);
    let (x, y, z) = (letters[0], letters[1], letters[2]);
    let (three, xy) = (g.int(3), g.mul(x, y));
    let h = vec![vec![three, x, xy], vec![x, z, y], vec![xy, y, three]];
    let mut writer = SectionWriter::new(&g, symbols.into_iter().collect(), &[]);
    let names = ["a", "b", "c"].map(str::to_owned);
    let mut form = QuadraticForm::new(&g, &h, vec![x, y, z]);
    let mut pen = Pen { g: &mut g, writer: &mut writer, names: &names, stems: ["H", "g"] };
    let steps: Vec<Least> = (0..3).map(|k| form.least(&mut pen, k).expect("a pivot")).collect();
    let mut d = [0.0; 3];
    let definitions: Vec<_> = writer.definitions().copied().collect();
    let whole = inlined(&mut g, &definitions);
    let value = |g: &mut Graph, e: ExprId| {
        let e = g.subs(e, &whole).expect("a value");
        at(g, e, &values)
    };
    for k in (0..3).rev() {
        d[k] = -value(&mut g, steps[k].z);
        for (j, u) in &steps[k].u {
            d[k] -= value(&mut g, *u) * d[*j];
        }
    }
    for (row, force) in h.iter().zip([x, y, z]) {
        let left: f64 = row.iter().zip(d).map(|(e, d)| at(&g, *e, &values) * d).sum();
        assert!((left + at(&g, force, &values)).abs() < 1e-13, "{left}");
    }

    // d_c = x d_a + 2 d_b: 1/2 H d d + g d is what it was.
    let mut writer = SectionWriter::new(&g, BTreeSet::new(), &[]);
    let two = g.int(2);
    let mut form = QuadraticForm::new(&g, &h, vec![x, y, z]);
    let mut pen = Pen { g: &mut g, writer: &mut writer, names: &names, stems: ["H", "g"] };
    form.substitute(&mut pen, &[(2, &[(0, x), (1, two)])]);
    let definitions: Vec<_> = writer.definitions().copied().collect();
    let whole = inlined(&mut g, &definitions);
    let mut value = |e: Option<ExprId>| {
        let e = e.map_or(g.zero(), |e| g.subs(e, &whole).expect("a value"));
        at(&g, e, &values)
    };
    let [a, b] = [0.4, -0.9];
    let c = values.values().next().expect("x") * a + 2.0 * b;
    let whole_of = |value: &mut dyn FnMut(Option<ExprId>) -> f64| {
        let d = [a, b, c];
        let quadratic: f64 = (0..3)
            .flat_map(|i| (0..3).map(move |j| (i, j)))
            .map(|(i, j)| value(Some(h[i][j])) * d[i] * d[j])
            .sum();
        let linear: f64 = [x, y, z].iter().zip(d).map(|(e, d)| value(Some(*e)) * d).sum();
        quadratic / 2.0 + linear
    };
    let before = whole_of(&mut value);
    let quadratic = value(form.entry(0, 0)) * a * a
        + 2.0 * value(form.entry(0, 1)) * a * b
        + value(form.entry(1, 1)) * b * b;
    let after = quadratic / 2.0 + value(Some(form.g[0])) * a + value(Some(form.g[1])) * b;
    assert!((before - after).abs() < 1e-13, "{before} {after}");
    assert_eq!(form.entry(2, 2), None);
}
