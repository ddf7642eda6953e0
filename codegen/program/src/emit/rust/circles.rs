//! The right-hand side with angles as points of circles: its functions, `Inside`, and what integrators ask of both.
//!
//! Does not know: which angles there are and why.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::functions::doc_by;
use super::lines;
use super::tokens::{array, pattern, size, statements, taken_apart, texts};

impl Writer<'_> {
    /// The methods; none where the angles stay numbers.
    pub(super) fn circle_functions(&self) -> TokenStream {
        let Some(found) = &self.module.circles else { return TokenStream::new() };
        let (n, n_inside) = self.dimensions(found.circles.n_angles);
        let title =
            "[`rhs`](Self::rhs) for a state with cosine and sine of angles behind it: neither is called.";
        let doc = doc_by(&[], found.rate.function, title, &found.circles.program.state);
        let (body, results) = (self.body(&found.rate), self.results(&found.rate));
        let title = "The state with cosine and sine of the angles of [`rhs`](Self::rhs) behind it.";
        let doc_of_points = self.function_doc(found.points.function, title, &[]);
        let read = found.points.state.iter().take(self.module.state.len());
        let taken_apart = taken_apart(&pattern(read.map(Option::as_ref)), "*y");
        let (bound, points) =
            (statements(&found.points.code.statements), array(&texts(&found.points.code.results)));
        quote! {
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
                    #taken_apart
                    #bound
                    #points
                };
                let mut z = [R::ZERO; #n_inside];
                z[..#n].copy_from_slice(y);
                z[#n..].copy_from_slice(&points);
                z
            }
        }
    }

    /// `Inside` and its traits; nothing where the angles stay numbers.
    pub(super) fn circles(&self) -> TokenStream {
        let Some(found) = &self.module.circles else { return TokenStream::new() };
        let (n, n_inside) = self.dimensions(found.circles.n_angles);
        lines::statements(&format!("{}::circles!(Prepared[{n}], Inside[{n_inside}]);", self.path))
    }

    /// What a scene says of its circles to drivers that serve any scene.
    pub(super) fn circles_of(&self) -> TokenStream {
        let Some(found) = &self.module.circles else { return TokenStream::new() };
        let n_angles = found.circles.n_angles;
        let (n, n_inside) = self.dimensions(n_angles);
        lines::statements(&format!("{}::scene!(@circles [{n}] {n_angles} [{n_inside}]);", self.path))
    }

    /// Lengths of the state without and with points.
    fn dimensions(&self, n_angles: usize) -> (proc_macro2::Literal, proc_macro2::Literal) {
        let n = self.module.state.len();
        (size(n), size(n + 2 * n_angles))
    }
}
