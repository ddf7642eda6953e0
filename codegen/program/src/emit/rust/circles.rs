//! The right-hand side with angles as points of circles: its functions, `Inside`, and what integrators ask of both.
//!
//! Does not know: which angles there are and why.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::{doc_attributes, parse_all, pattern, size, statements};
use hamel_expr::error::Error;

impl Writer<'_> {
    /// The methods; none where the angles stay numbers.
    pub(super) fn circle_functions(&self) -> Result<TokenStream, Error> {
        let Some(found) = &self.module.circles else { return Ok(TokenStream::new()) };
        let (n, n_inside) = self.dimensions(found.circles.n_angles);
        let title =
            "[`rhs`](Self::rhs) for a state with cosine and sine of angles behind it: neither is called.";
        let doc = self.function_doc(found.rate.function, title, &found.circles.program.state);
        let (body, results) = (self.body(&found.rate)?, self.results(&found.rate)?);
        let title = "The state with cosine and sine of the angles of [`rhs`](Self::rhs) behind it.";
        let doc_of_points = self.function_doc(found.points.function, title, &[]);
        let read = found.points.state.iter().take(self.module.state.len());
        let taken_apart = pattern(read.map(Option::as_ref));
        let (bound, points) =
            (statements(&found.points.code.statements)?, parse_all(&found.points.code.results)?);
        Ok(quote! {
            #doc
            #[inline]
            pub fn rhs_on_circles(&self, t: R, y: &[R; #n_inside], dy: &mut [R; #n_inside]) {
                #body
                *dy = #results;
            }

            #doc_of_points
            #[inline]
            #[must_use]
            pub fn on_circles(&self, y: &[R; #n]) -> [R; #n_inside] {
                let points = {
                    let #taken_apart = *y;
                    #bound
                    [#(#points),*]
                };
                let mut z = [R::ZERO; #n_inside];
                z[..#n].copy_from_slice(y);
                z[#n..].copy_from_slice(&points);
                z
            }
        })
    }

    /// `Inside` and its traits; nothing where the angles stay numbers.
    pub(super) fn circles(&self) -> TokenStream {
        let Some(found) = &self.module.circles else { return TokenStream::new() };
        let rt = &self.runtime;
        let (n, n_inside) = self.dimensions(found.circles.n_angles);
        let doc = doc_attributes([
            "The equations with cosine and sine of angles behind the state, for integrators: what a step is computed \
             with."
                .to_owned(),
            String::new(),
            "See [`Prepared::rhs_on_circles`].".to_owned(),
        ]);
        quote! {
            #doc
            #[derive(Clone, Copy, Debug, PartialEq)]
            pub struct Inside<R = f64>(Prepared<R>);

            impl<R: #rt::Real> #rt::System<R> for Inside<R> {
                type State = [R; #n_inside];

                #[inline]
                fn rhs(&self, t: R, y: &[R; #n_inside], dy: &mut [R; #n_inside]) {
                    self.0.rhs_on_circles(t, y, dy);
                }
            }

            impl<Q: #rt::Real, R: #rt::Real> #rt::OverScalar<Q, R> for Inside<R> {
                type Over = Inside<Q>;

                fn over(&self, convert: impl Fn(R) -> Q) -> Inside<Q> {
                    Inside(#rt::OverScalar::over(&self.0, convert))
                }

                fn state_over(state: &[R; #n_inside], convert: impl Fn(R) -> Q) -> [Q; #n_inside] {
                    state.map(convert)
                }
            }

            impl<R: #rt::Real> #rt::Circles<R> for Prepared<R> {
                type Inside = Inside<R>;

                fn inside(&self) -> Inside<R> {
                    Inside(*self)
                }

                #[inline]
                fn on_circles(&self, y: &[R; #n]) -> [R; #n_inside] {
                    self.on_circles(y)
                }
            }
        }
    }

    /// What a scene says of its circles to drivers that serve any scene.
    pub(super) fn circles_of(&self) -> TokenStream {
        let Some(found) = &self.module.circles else { return TokenStream::new() };
        let (n_angles, (n, n_inside)) =
            (size(found.circles.n_angles), self.dimensions(found.circles.n_angles));
        quote! {
            const N_CIRCLES: usize = #n_angles;

            fn on_circles_of(&self, y: &[R; #n], z: &mut [R]) {
                if let Ok(z) = <&mut [R; #n_inside]>::try_from(z) {
                    *z = self.on_circles(y);
                }
            }

            fn rhs_on_circles_of(&self, t: R, z: &[R], dz: &mut [R]) {
                if let (Ok(z), Ok(dz)) = (<&[R; #n_inside]>::try_from(z), <&mut [R; #n_inside]>::try_from(dz)) {
                    self.rhs_on_circles(t, z, dz);
                }
            }
        }
    }

    /// Lengths of the state without and with points.
    fn dimensions(&self, n_angles: usize) -> (proc_macro2::Literal, proc_macro2::Literal) {
        let n = self.module.state.len();
        (size(n), size(n + 2 * n_angles))
    }
}
