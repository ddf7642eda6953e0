//! Sums of products over tables: the tables as constants, and what runs through them.
//!
//! Does not know: what the products are of.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::quote;

use super::Writer;
use super::format::parse;
use super::tokens::{allow_numbers, doc_attributes, ident, parse_all, size};
use crate::emit::module::{Loops, Routine};
use crate::error::Error;
use crate::program::Factors;

impl Writer<'_> {
    /// The tables of the program.
    ///
    /// # Errors
    /// [`Error::Emission`] never in practice: numbers are finite.
    pub(super) fn tables(&self) -> Result<TokenStream, Error> {
        let rt = &self.runtime;
        let mut tables = TokenStream::new();
        for (table, name) in self.module.program.tables.iter().zip(&self.module.tables) {
            let name = ident(name);
            let doc = doc_attributes([format!(
                "Products: {}; distinct numbers: {}; sums: {}.",
                table.n_products(),
                table.numbers().len(),
                table.ends.len()
            )]);
            let places = Literal::byte_string(&table.places);
            let ends = table.ends.iter().map(|end| Literal::u32_unsuffixed(*end));
            let allow = allow_numbers(table.parts().iter().map(|[hi, _]| *hi));
            let mut numbers = Vec::with_capacity(table.parts().len());
            for [hi, lo] in table.parts() {
                // Small numbers with an exponent.
                let (hi, lo) = (parse(&format!("{hi:?}"))?, parse(&format!("{lo:?}"))?);
                numbers.push(quote! { [#hi, #lo] });
            }
            tables.extend(quote! {
                #doc
                #allow
                static #name: #rt::Products<'static> =
                    #rt::Products::new(#places, &[#(#ends),*], &[#(#numbers),*]);
            });
        }
        Ok(tables)
    }

    /// Binds a function's own vector to a name that no component takes, where loops read all of it.
    pub(super) fn argument_of_loops(&self, routine: &Routine<'_>, vector: &Ident) -> Option<TokenStream> {
        let loops = routine.loops.as_ref().filter(|_| routine.contracts_argument())?;
        let argument = ident(&loops.argument);
        Some(quote! { let #argument = #vector; })
    }

    /// The contractions of a function, after its straight-line code.
    pub(super) fn loops(&self, routine: &Routine<'_>) -> Result<TokenStream, Error> {
        let Some(Loops { scalars, values, argument, sums }) = &routine.loops else {
            return Ok(TokenStream::new());
        };
        let (scalars, argument) = (ident(scalars), ident(argument));
        let sums: Vec<Ident> = sums.iter().map(|name| ident(name)).collect();
        let mut tokens = TokenStream::new();
        if !values.is_empty() {
            let values = parse_all(values)?;
            tokens.extend(quote! { let #scalars = [#(#values),*]; });
        }
        let factors = |factors: Factors| match factors {
            Factors::State => quote! { y },
            Factors::Argument => quote! { #argument },
            Factors::Scalars => quote! { &#scalars },
            Factors::Contraction(k) => {
                let sums = &sums[k as usize];
                quote! { &#sums }
            }
        };
        for (contraction, sums) in routine.function.contractions.iter().zip(&sums) {
            let n = size(contraction.n_results);
            tokens.extend(quote! { let mut #sums = [R::ZERO; #n]; });
            for products in &contraction.terms {
                let table = ident(&self.module.tables[products.table as usize]);
                let (left, right) = (factors(products.left), factors(products.right));
                tokens.extend(quote! { #table.add_to(#left, #right, &mut #sums); });
            }
        }
        Ok(tokens)
    }

    /// The array of a function's results.
    pub(super) fn results(&self, routine: &Routine<'_>) -> Result<TokenStream, Error> {
        let whole = routine.loops.as_ref().zip(routine.function.contraction_of_results());
        if let Some((loops, k)) = whole {
            let sums = ident(&loops.sums[k]);
            return Ok(quote! { #sums });
        }
        let results = parse_all(&routine.code.results)?;
        Ok(quote! { [#(#results),*] })
    }
}
