//! Algebra expressions: families, powers of `R`, products, semidirect products, representations.
//!
//! Deliberately does not know: how algebras are given names.

use super::values::Elaboration;
use crate::algebra::{LieAlgebra, Representation};
use crate::spec::ast::{AlgebraExpr, AlgebraNode};
use crate::spec::diagnostic::{Help, Span};
use crate::spec::eval::is_poisoned;
use crate::spec::fluid::{self, FluidSurface};
use crate::spec::limits::{MAX_ABELIAN, MAX_DIM, MAX_REPRESENTATION};
use crate::spec::names;
use hamel_expr::Number;
use hamel_expr::error::Error;

/// Families of algebras, one for each number.
pub(super) const FAMILIES: &[&str] = &[
    "so",
    "se",
    "su",
    "u",
    "gl",
    "sl",
    "sp",
    "sim",
    "galilei",
    "heisenberg",
    "zeitlin",
    "zeitlin_sphere",
    "torus",
    "witt",
];

/// Families whose names definitions may take all the same, as their parentheses tell them apart.
pub(super) const SHORT_FAMILIES: &[&str] = &["u"];

/// Names that algebra definitions cannot take, besides the families.
pub(super) const BUILT_IN: &[&str] = &[
    "R",
    "product",
    "semidirect",
    "vorticity",
    "standard",
    "adjoint",
    "coadjoint",
    "functions",
    "densities",
    "dual",
    "trivial",
];

/// Representations that are known without declaration.
const REPRESENTATIONS: &[&str] =
    &["standard", "adjoint", "coadjoint", "functions", "densities", "dual", "trivial"];

impl Elaboration<'_> {
    pub(super) fn algebra(&mut self, expr: &AlgebraExpr) -> Option<LieAlgebra<Number>> {
        let span = expr.span;
        let (name, arguments) = match &expr.node {
            AlgebraNode::Number(_) => {
                self.problem(span, "expected an algebra, found a number", "for example `so(3)` or `R^3`");
                return None;
            }
            AlgebraNode::Power(n) if *n > MAX_ABELIAN => {
                self.problem(span, format!("R^{n} is too large"), format!("the largest is R^{MAX_ABELIAN}"));
                return None;
            }
            AlgebraNode::Power(n) => return Some(LieAlgebra::abelian(*n).into()),
            AlgebraNode::Name(name) => {
                if name == "R" {
                    return Some(LieAlgebra::abelian(1).into());
                }
                if let Some(algebra) = self.algebras.get(name) {
                    return Some(algebra.clone());
                }
                if is_poisoned(name, &self.poisoned) {
                    return None;
                }
                let message = if FAMILIES.contains(&name.as_str())
                    || ["product", "semidirect", "vorticity"].contains(&name.as_str())
                {
                    self.problem(
                        span,
                        format!("`{name}` needs arguments"),
                        format!(
                            "for example `{name}({})`",
                            match name.as_str() {
                                "product" => "so(3), R^3",
                                "semidirect" => "so(3), standard",
                                "vorticity" => "torus(2)",
                                "sp" | "torus" | "witt" => "2",
                                _ => "3",
                            }
                        ),
                    );
                    return None;
                } else if self.representations.contains_key(name) {
                    format!("`{name}` is a representation, not an algebra")
                } else {
                    format!("unknown algebra `{name}`")
                };
                let help = self.algebra_help(name);
                self.problem(span, message, help);
                return None;
            }
            AlgebraNode::Call(name, arguments) => (name, arguments),
        };
        match name.text.as_str() {
            "product" => {
                if arguments.is_empty() {
                    self.problem(span, "`product` of nothing", "write `product(so(3), R^3)`");
                    return None;
                }
                let factors: Vec<Option<LieAlgebra<Number>>> =
                    arguments.iter().map(|a| self.algebra(a)).collect();
                let factors: Vec<LieAlgebra<Number>> = factors.into_iter().collect::<Option<_>>()?;
                self.check_dim(span, factors.iter().map(LieAlgebra::dim).sum())?;
                Some(LieAlgebra::product(&factors))
            }
            "semidirect" => {
                let Some((base, spaces)) = arguments.split_first().filter(|(_, spaces)| !spaces.is_empty())
                else {
                    self.problem(
                        span,
                        "`semidirect` takes an algebra and its representations",
                        "for example `semidirect(so(3), standard)`",
                    );
                    return None;
                };
                let base = self.algebra(base)?;
                let spaces: Vec<Option<Representation<Number>>> =
                    spaces.iter().map(|s| self.representation(s, &base)).collect();
                let spaces: Vec<Representation<Number>> = spaces.into_iter().collect::<Option<_>>()?;
                self.check_dim(span, base.dim() + spaces.iter().map(Representation::dim).sum::<usize>())?;
                match LieAlgebra::semidirect(&base, &spaces) {
                    Ok(algebra) => Some(algebra),
                    Err(error) => {
                        self.builder.error(Some(span), &error);
                        None
                    }
                }
            }
            "vorticity" => {
                let [inner] = arguments.as_slice() else {
                    self.problem(span, "`vorticity` takes one algebra", "for example `vorticity(torus(2))`");
                    return None;
                };
                let algebra = self.algebra(inner)?.vorticity();
                self.algebra_or_report(algebra, span)
            }
            family if FAMILIES.contains(&family) => {
                let [AlgebraExpr { node: AlgebraNode::Number(n), .. }] = arguments.as_slice() else {
                    self.problem(
                        span,
                        format!("`{family}` takes one number"),
                        format!("for example `{family}(3)`"),
                    );
                    return None;
                };
                self.named_algebra(family, *n, span)
            }
            other => {
                let help = self.algebra_help(other);
                self.problem(name.span, format!("unknown algebra `{other}`"), help);
                None
            }
        }
    }

    fn named_algebra(&mut self, family: &str, n: usize, span: Span) -> Option<LieAlgebra<Number>> {
        // Their structure constants come from an elimination that grows with the sixth power of n.
        let largest = match family {
            "so" | "se" => 10,
            "sim" | "galilei" => 5,
            "heisenberg" => 14,
            _ => 8,
        };
        let says_itself = ["zeitlin", "zeitlin_sphere", "torus", "witt"].contains(&family);
        if n > largest && !says_itself {
            self.problem(
                span,
                format!("{family}({n}) is too large"),
                format!("the largest is {family}({largest})"),
            );
            return None;
        }
        let algebra = match family {
            "so" => LieAlgebra::so(n),
            "se" => LieAlgebra::se(n),
            "su" => LieAlgebra::su(n),
            "u" => LieAlgebra::u(n),
            "gl" => LieAlgebra::gl(n),
            "sl" => LieAlgebra::sl(n),
            "sp" => LieAlgebra::sp(n),
            "sim" => LieAlgebra::sim(n),
            "galilei" => LieAlgebra::galilei(n),
            "zeitlin" => return self.with_table(LieAlgebra::zeitlin(n), FluidSurface::Torus, span),
            "zeitlin_sphere" => {
                return self.with_table(LieAlgebra::zeitlin_sphere(n), FluidSurface::Sphere, span);
            }
            "torus" => return self.algebra_or_report(LieAlgebra::torus(n), span),
            "witt" => return self.algebra_or_report(LieAlgebra::witt(n), span),
            _ => LieAlgebra::heisenberg(n),
        };
        self.algebra_or_report(algebra.map(LieAlgebra::into), span)
    }

    /// An algebra of functions on a surface, which fluids can do without.
    fn with_table(
        &mut self,
        algebra: Result<LieAlgebra<Number>, Error>,
        surface: FluidSurface,
        span: Span,
    ) -> Option<LieAlgebra<Number>> {
        let Err(Error::Unsupported { what, possible }) = &algebra else {
            return self.algebra_or_report(algebra, span);
        };
        let help = fluid::instead_of_a_table(surface, possible);
        self.problem(span, format!("{what} has no table of structure constants"), help);
        None
    }

    fn algebra_or_report(
        &mut self,
        algebra: Result<LieAlgebra<Number>, Error>,
        span: Span,
    ) -> Option<LieAlgebra<Number>> {
        match algebra {
            Ok(algebra) => Some(algebra),
            Err(error) => {
                self.builder.error(Some(span), &error);
                None
            }
        }
    }

    fn check_dim(&mut self, span: Span, dim: usize) -> Option<()> {
        if dim <= MAX_DIM {
            return Some(());
        }
        self.problem(span, format!("algebra of dimension {dim}, the limit is {MAX_DIM}"), "");
        None
    }

    fn algebra_help(&self, name: &str) -> Help {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        if FAMILIES.contains(&stem) && stem.len() < name.len() {
            let meant = format!("{stem}({})", &name[stem.len()..]);
            return Help::replacing(name, &meant, format!("did you mean `{meant}`?"));
        }
        let mut known = FAMILIES.to_vec();
        known.extend(["R", "product", "semidirect", "vorticity"]);
        known.extend(self.algebras.keys().map(String::as_str));
        names::suggest(name, known)
    }

    pub(super) fn representation(
        &mut self,
        expr: &AlgebraExpr,
        algebra: &LieAlgebra<Number>,
    ) -> Option<Representation<Number>> {
        let span = expr.span;
        let n = algebra.dim();
        let adjoint_fits = n * n * n <= MAX_REPRESENTATION;
        match &expr.node {
            AlgebraNode::Name(name) => match name.as_str() {
                "standard" => match Representation::standard(algebra) {
                    Some(r) => Some(r.into()),
                    None => {
                        let message = format!("`standard` does not exist for {}", algebra.name());
                        self.problem(span, message, "so(n), gl(n), sl(n), sp(n), su(n) and u(n) have one; give yours with `representation`");
                        None
                    }
                },
                "adjoint" | "coadjoint" if !adjoint_fits => {
                    self.problem(span, format!("`{name}` of {} is too large", algebra.name()), "");
                    None
                }
                "functions" | "densities" => {
                    let (found, help) = match name.as_str() {
                        "functions" => (
                            Representation::functions(algebra),
                            "zeitlin(N), zeitlin_sphere(N), torus(K) and witt(K) act on functions",
                        ),
                        _ => (Representation::densities(algebra), "witt(K) acts on densities"),
                    };
                    if found.is_none() {
                        let message = format!("`{name}` does not exist for {}", algebra.name());
                        self.problem(span, message, help);
                    }
                    found
                }
                "adjoint" => Some(Representation::adjoint(algebra)),
                "coadjoint" => Some(Representation::coadjoint(algebra)),
                _ => self.named_representation(name, algebra, span),
            },
            AlgebraNode::Call(name, arguments) => match (name.text.as_str(), arguments.as_slice()) {
                ("dual", [inner]) => self.representation(inner, algebra).map(|r| r.dual()),
                ("trivial", [AlgebraExpr { node: AlgebraNode::Number(dim), .. }]) => {
                    if dim * dim * n > MAX_REPRESENTATION {
                        self.problem(span, "trivial representation is too large", "");
                        return None;
                    }
                    Some(Representation::trivial(algebra, *dim))
                }
                ("dual", _) => {
                    self.problem(span, "`dual` takes one representation", "for example `dual(standard)`");
                    None
                }
                ("trivial", _) => {
                    self.problem(span, "`trivial` takes one number", "for example `trivial(3)`");
                    None
                }
                (other, _) => {
                    let help = names::suggest(other, REPRESENTATIONS.iter().copied());
                    self.problem(span, format!("unknown representation `{other}`"), help);
                    None
                }
            },
            _ => {
                self.problem(span, "expected a representation", "for example `standard` or `trivial(3)`");
                None
            }
        }
    }

    fn named_representation(
        &mut self,
        name: &str,
        algebra: &LieAlgebra<Number>,
        span: Span,
    ) -> Option<Representation<Number>> {
        if let Some((owner, r)) = self.representations.get(name) {
            if owner == algebra {
                return Some(r.clone());
            }
            let message = format!("`{name}` represents {}, not {}", owner.name(), algebra.name());
            self.problem(span, message, "declare a representation of this algebra");
            return None;
        }
        if !is_poisoned(name, &self.poisoned) {
            let mut known = REPRESENTATIONS.to_vec();
            known.extend(self.representations.keys().map(String::as_str));
            let help = names::suggest(name, known);
            self.problem(span, format!("unknown representation `{name}`"), help);
        }
        None
    }
}
