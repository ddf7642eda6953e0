//! The bracket of momenta that are projected along the metric, where multipliers keep a constraint.
//!
//! Does not know: which coordinates a state has.

use crate::mechanics::chart::Chart;
use crate::mechanics::solve::Factorisation;
use crate::reduction::{AccelerationRow, AccelerationSource};
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::builder::{Builder, MomentumForm};

/// Solves the equations of the complement with a right-hand side, and names what comes out.
type Solve<'s, T> = dyn Fn(&mut T, &str, &[ExprId]) -> Vec<ExprId> + 's;

impl Builder<'_> {
    /// The bracket of `p o P`, `P(x, p) = p - a^T S^-1 psi` with `a_A = d psi_A/dy`, `S = a L_yy^-1 a^T`:
    ///
    /// ```text
    /// W_a = e_a - a_Aa S^AB n_B,   n_A = L_yy^-1 a_A
    /// {p_a, p_b} = -<p, [W_a, W_b]_0> + a_Bb G_B(W_a) - a_Ba G_B(W_b)
    /// R_x = r - kappa_B rho(n_B),   R_p = W (F + N p + kappa_B (<p, [., n_B]_0> + rho dpsi_B))
    ///       - a^T S^-1 (dpsi(R_x) + dpsi/dt),   kappa = S^-1 b,   b_A = psi_A - a_A y
    /// ```
    ///
    /// with `G(W) = S^-1 dpsi(rho W)` at fixed `p`, and `[,]_0` the bracket of the frame with constant coefficients.
    pub(super) fn of_projection(
        &mut self,
        rows: &[AccelerationRow],
        chart: &Chart,
    ) -> Result<MomentumForm, Error> {
        let system = &self.equations.system;
        let (m, n_rows) = (self.momentum.len(), rows.len());
        let names: Vec<String> = system.algebroid.frame().to_vec();
        let mut residuals = Vec::new();
        let mut forms = Vec::new();
        for row in rows {
            let AccelerationSource::Differentiated(residual) = row.source else { continue };
            residuals.push(residual);
            let form = row.one_form.iter().map(|e| self.replace(*e)).collect::<Result<Vec<_>, _>>()?;
            forms.push(form);
        }
        let normals = self.normals(&forms, &names)?;
        self.writer.begin("response S = a n to multipliers");
        let mut response = vec![vec![self.g.zero(); n_rows]; n_rows];
        for a in 0..n_rows {
            for b in a..n_rows {
                let sum = self.g.dot(&forms[a], &normals[b]);
                let named = self.define(&format!("S_{}_{}", a + 1, b + 1), sum);
                (response[a][b], response[b][a]) = (named, named);
            }
        }
        let labels: Vec<String> = rows.iter().map(|r| format!("lambda_{}", r.name)).collect();
        self.writer.begin("factors of S");
        let (g, writer) = (&mut *self.g, &mut self.writer);
        let factors = Factorisation::new(g, writer, "S", &response, &labels, &system.signs, &[])?;
        // S^-1 of a vector that is indexed by the constraints.
        let solved = |b: &mut Self, stem: &str, right: &[ExprId]| -> Vec<ExprId> {
            let labels: Vec<String> = rows.iter().map(|r| format!("{stem}_{}", r.name)).collect();
            factors.solve(b.g, &mut b.writer, &labels, right)
        };
        self.writer.begin("sections W = e - a S^-1 n");
        let mut raised = vec![vec![self.g.zero(); m]; n_rows];
        for alpha in 0..m {
            let column: Vec<ExprId> = normals.iter().map(|n| n[alpha]).collect();
            for (a, e) in solved(self, &format!("n_{}", names[alpha]), &column).into_iter().enumerate() {
                raised[a][alpha] = e;
            }
        }
        let mut sections = vec![vec![self.g.zero(); m]; m];
        for a in 0..m {
            for alpha in 0..m {
                let mut terms = if a == alpha { vec![self.g.one()] } else { Vec::new() };
                for (form, raised) in forms.iter().zip(&raised) {
                    let product = self.g.mul(form[a], raised[alpha]);
                    terms.push(self.g.neg(product));
                }
                let sum = self.g.sum(&terms);
                sections[a][alpha] = self.define(&format!("W_{}_{}", names[a], names[alpha]), sum);
            }
        }
        let structure = self.lie_poisson();
        self.writer.begin("brackets {x, p} = rho W");
        let mut anchors = Vec::new();
        for a in 0..m {
            let section = sections[a].clone();
            let anchor = self.anchor_of(&section);
            let base = system.algebroid.base().to_vec();
            let named = anchor.into_iter().zip(base).map(|(e, x)| {
                let name = format!("rho_{}_{}", self.g.name(x), names[a]);
                self.define(&name, e)
            });
            anchors.push(named.collect::<Vec<_>>());
        }
        let mut turning = vec![vec![self.g.zero(); m]; m];
        let mut slopes = Vec::new();
        self.writer.begin("brackets {p_a, p_b}");
        for a in 0..m {
            for b in 0..m {
                if system.hamiltonian.is_none() {
                    let turned = self.along(self.raw_momentum[b], &anchors[a])?;
                    turning[a][b] = self.define(&format!("d_{}_p_{}", names[a], names[b]), turned);
                }
            }
            let changes = self.changes(&residuals, &normals, &forms, &anchors[a], &turning[a])?;
            slopes.push(solved(self, &format!("g_{}", names[a]), &changes));
        }
        let mut momenta = vec![vec![self.g.zero(); m]; m];
        for a in 0..m {
            for b in a + 1..m {
                let algebraic = self.bilinear(&structure, &sections[a], &sections[b]);
                let mut terms = vec![self.g.neg(algebraic)];
                for (form, k) in forms.iter().zip(0..) {
                    terms.push(self.g.mul(form[b], slopes[a][k]));
                    let product = self.g.mul(form[a], slopes[b][k]);
                    terms.push(self.g.neg(product));
                }
                let sum = self.g.sum(&terms);
                let named = self.define(&format!("c_{}_{}", names[a], names[b]), sum);
                momenta[a][b] = named;
                momenta[b][a] = self.g.neg(named);
            }
        }
        self.writer.begin("remainder R");
        let offsets = self.offsets(&residuals, chart)?;
        let kappa = offsets.iter().any(|e| *e != self.g.zero()).then(|| solved(self, "kappa", &offsets));
        let [along_x, along_pi, lag] = self.remainder_of_projection(
            &residuals,
            &forms,
            &normals,
            &sections,
            &structure,
            (kappa, &solved),
        )?;
        let anchor = (0..system.algebroid.n_base()).map(|i| anchors.iter().map(|v| v[i]).collect()).collect();
        let moving_energy = self.g.zero();
        Ok(MomentumForm { anchor, momenta, turning, remainder: [along_x, along_pi], lag, moving_energy })
    }

    /// `n_A = L_yy^-1 a_A`.
    fn normals(&mut self, forms: &[Vec<ExprId>], names: &[String]) -> Result<Vec<Vec<ExprId>>, Error> {
        let hessian = self.hessian.clone();
        if self.equations.system.hamiltonian.is_some() {
            let mut normals = Vec::new();
            for form in forms {
                let mut normal = Vec::new();
                for row in &hessian {
                    let row = row.iter().map(|e| self.replace(*e)).collect::<Result<Vec<_>, _>>()?;
                    normal.push(self.g.dot(&row, form));
                }
                normals.push(normal);
            }
            return Ok(normals);
        }
        self.writer.begin("factors of M = L_yy");
        let (g, writer) = (&mut *self.g, &mut self.writer);
        let signs = &self.equations.system.signs;
        let factors = Factorisation::new(g, writer, "M", &hessian, names, signs, &[])?;
        self.writer.begin("normals n = M^-1 a");
        let solve = |(k, form): (usize, &Vec<ExprId>)| {
            let labels: Vec<String> = names.iter().map(|n| format!("n{}_{n}", k + 1)).collect();
            factors.solve(self.g, &mut self.writer, &labels, form)
        };
        Ok(forms.iter().enumerate().map(solve).collect())
    }

    /// `b_A = psi_A - <d psi_A/dy, y>` where the constraints hold: what a constraint is at rest where it is affine, and
    /// zero where it is homogeneous.
    fn offsets(&mut self, residuals: &[ExprId], chart: &Chart) -> Result<Vec<ExprId>, Error> {
        let velocities = &self.equations.system.velocities;
        let mut offsets = Vec::new();
        for residual in residuals {
            if let Some((_, offset)) = self.g.affine_parts(*residual, velocities) {
                offsets.push(offset);
                continue;
            }
            let mut terms = Vec::new();
            for y in velocities {
                let (slope, y) = (self.g.diff(*residual, *y), self.g.sym(*y));
                terms.push(self.g.mul(slope, y));
            }
            let sum = self.g.sum(&terms);
            let offset = self.g.neg(sum);
            let offset = self.replace(offset)?;
            let own = self.writer.clone().finish().0;
            let whole = chart.restricted(self.g, &own, offset)?;
            offsets.push(if self.g.is_zero(whole) { self.g.zero() } else { offset });
        }
        Ok(offsets)
    }

    /// `dpsi_A` along a vector of the base at fixed momenta, of which `turned` are the changes at fixed velocities.
    fn changes(
        &mut self,
        residuals: &[ExprId],
        normals: &[Vec<ExprId>],
        forms: &[Vec<ExprId>],
        direction: &[ExprId],
        turned: &[ExprId],
    ) -> Result<Vec<ExprId>, Error> {
        let mut changes = Vec::new();
        for (k, residual) in residuals.iter().enumerate() {
            let explicit = self.along(*residual, direction)?;
            let implicit = match &self.equations.system.hamiltonian {
                Some(hamiltonian) => {
                    let mut terms = Vec::new();
                    for (p, form) in hamiltonian.momenta.iter().zip(&forms[k]) {
                        let y = self.g.diff(hamiltonian.h, *p);
                        let change = self.along(y, direction)?;
                        terms.push(self.g.mul(*form, change));
                    }
                    self.g.sum(&terms)
                }
                None => {
                    let sum = self.g.dot(&normals[k], turned);
                    self.g.neg(sum)
                }
            };
            changes.push(self.g.add(explicit, implicit));
        }
        Ok(changes)
    }

    /// `R_x`, `R_p` and the lag.
    fn remainder_of_projection(
        &mut self,
        residuals: &[ExprId],
        forms: &[Vec<ExprId>],
        normals: &[Vec<ExprId>],
        sections: &[Vec<ExprId>],
        structure: &[Vec<ExprId>],
        (kappa, solved): (Option<Vec<ExprId>>, &Solve<'_, Self>),
    ) -> Result<[Vec<ExprId>; 3], Error> {
        let system = &self.equations.system;
        let is_hamiltonian = system.hamiltonian.is_some();
        let m = self.momentum.len();
        let mut along_x = vec![self.g.zero(); system.algebroid.n_base()];
        for (normal, kappa) in normals.iter().zip(kappa.iter().flatten()) {
            for (sum, e) in along_x.iter_mut().zip(self.anchor_of(normal)) {
                let product = self.g.mul(*kappa, e);
                *sum = self.g.sub(*sum, product);
            }
        }
        let mut pushed = self.forces()?;
        for (alpha, kappa) in (0..m).filter_map(|alpha| Some((alpha, kappa.as_ref()?))) {
            let direction: Vec<ExprId> =
                (0..along_x.len()).map(|i| system.algebroid.anchor(i, alpha)).collect();
            let mut turned = vec![self.g.zero(); m];
            if !is_hamiltonian {
                for (b, e) in turned.iter_mut().enumerate() {
                    *e = self.along(self.raw_momentum[b], &direction)?;
                }
            }
            let changes = self.changes(residuals, normals, forms, &direction, &turned)?;
            for ((normal, kappa), change) in normals.iter().zip(kappa).zip(changes) {
                let algebraic = self.g.dot(&structure[alpha], normal);
                let sum = self.g.add(algebraic, change);
                let term = self.g.mul(*kappa, sum);
                pushed[alpha] = self.g.add(pushed[alpha], term);
            }
        }
        self.add_own_rates(&mut along_x)?;
        // Changes of p at fixed velocities, along R_x and with time.
        let (mut turned, mut lag) = (vec![self.g.zero(); m], vec![self.g.zero(); m]);
        let mut by_time = turned.clone();
        if !is_hamiltonian {
            for b in 0..m {
                turned[b] = self.along(self.raw_momentum[b], &along_x)?;
                by_time[b] = self.by_time(self.raw_momentum[b])?;
                lag[b] = self.g.add(turned[b], by_time[b]);
            }
        }
        let mut changes = self.changes(residuals, normals, forms, &along_x, &turned)?;
        for (k, residual) in residuals.iter().enumerate() {
            let explicit = self.by_time(*residual)?;
            let implicit = match &system.hamiltonian {
                Some(hamiltonian) => {
                    let mut terms = Vec::new();
                    for (p, form) in hamiltonian.momenta.iter().zip(&forms[k]) {
                        let y = self.g.diff(hamiltonian.h, *p);
                        let change = self.by_time(y)?;
                        terms.push(self.g.mul(*form, change));
                    }
                    self.g.sum(&terms)
                }
                None => {
                    let sum = self.g.dot(&normals[k], &by_time);
                    self.g.neg(sum)
                }
            };
            changes[k] = self.g.sum(&[changes[k], explicit, implicit]);
        }
        let reaction = solved(self, "nu", &changes);
        let mut along_p = Vec::new();
        for a in 0..m {
            let mut terms = vec![self.g.dot(&sections[a], &pushed)];
            for (form, reaction) in forms.iter().zip(&reaction) {
                let product = self.g.mul(form[a], *reaction);
                terms.push(self.g.neg(product));
            }
            along_p.push(self.g.sum(&terms));
        }
        Ok([along_x, along_p, lag])
    }
}
