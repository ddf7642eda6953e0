//! Sums of products over tables: the tables as constants, and what runs through them.
//!
//! Does not know: what the products are of.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::quote;

use super::Writer;
use super::lines;
use super::tokens::{array, ident, size, texts};
use crate::emit::expression::Text;
use crate::emit::module::{Loops, Routine};
use crate::emit::series::Part;
use crate::program::{Factors, Function, Jet, ProductKind, Products};

impl Writer<'_> {
    /// The tables of the program.
    pub(super) fn tables(&self) -> TokenStream {
        let mut tables = TokenStream::new();
        for (table, name) in self.module.program.tables.iter().zip(&self.module.tables) {
            let doc = lines::documentation([format!(
                "Products: {}; distinct numbers: {}; sums: {}.",
                table.n_products(),
                table.numbers().len(),
                table.ends.len()
            )]);
            let ends: Vec<String> = table.ends.iter().map(u32::to_string).collect();
            let numbers: Vec<String> =
                table.parts().iter().map(|[hi, lo]| format!("[{hi:?}, {lo:?}]")).collect();
            let arguments = [
                Literal::byte_string(&table.places).to_string(),
                format!("&{}", lines::array(&ends)),
                format!("&{}", lines::array(&numbers)),
            ];
            let arguments: String =
                arguments.iter().map(|argument| lines::indented(argument) + ",\n").collect();
            let rt = &self.path;
            tables.extend(lines::statements(&format!(
                "{doc}{}\nstatic {name}: {rt}::Products<'static> = {rt}::Products::new(\n{arguments});",
                lines::ALLOW
            )));
        }
        tables
    }

    /// Binds a function's own vector to a name that no component takes, where loops read all of it.
    pub(super) fn argument_of_loops(&self, routine: &Routine<'_>, vector: &Ident) -> Option<TokenStream> {
        let loops = routine.loops.as_ref().filter(|_| routine.contracts_argument())?;
        let argument = ident(&loops.argument);
        Some(quote! { let #argument = #vector; })
    }

    /// The contractions of a function, after its straight-line code.
    pub(super) fn loops(&self, routine: &Routine<'_>) -> TokenStream {
        let Some(loops) = &routine.loops else { return TokenStream::new() };
        let plain = |products: &Products, sums: &Ident| {
            let [left, right] = [products.left, products.right].map(|f| values_of(loops, &quote! { y }, f));
            let table = self.table(products);
            quote! { #table.add_to(#left, #right, &mut #sums); }
        };
        self.contractions((routine.function, loops), plain, |_, _| TokenStream::new())
    }

    /// The contractions of a recurrence of Taylor coefficients. `state` has the coefficients of the order, `order` is
    /// its variable and none for order zero, `stored` are the coefficients of all orders of factors.
    pub(super) fn loops_of_series(
        &self,
        jet: &Jet,
        part: &Part<'_>,
        (state, order): (&TokenStream, Option<&TokenStream>),
        stored: impl Fn(Factors) -> Option<TokenStream>,
    ) -> TokenStream {
        let Some(loops) = &part.loops else { return TokenStream::new() };
        let rt = &self.runtime;
        let term = |products: &Products, sums: &Ident| {
            let table = self.table(products);
            let factors = [products.left, products.right];
            match (jet.kind(products), order) {
                (ProductKind::Convolved, Some(order)) => {
                    let [left, right] = factors.map(&stored);
                    quote! { #table.add_convolutions_to(#order, &#left, &#right, &mut #sums); }
                }
                (ProductKind::Constant, Some(_)) => TokenStream::new(),
                _ => {
                    let [left, right] = factors.map(|f| values_of(loops, state, f));
                    quote! { #table.add_to(#left, #right, &mut #sums); }
                }
            }
        };
        let zero = quote! { 0 };
        let order = order.unwrap_or(&zero);
        let set = |factors: Factors, values: &TokenStream| {
            let stored = stored(factors);
            stored.map(|stored| quote! { #rt::set_order(&mut #stored, #order, #values); })
        };
        let known = set(Factors::State, state);
        let contractions = self.contractions((part.function, loops), term, |factors, values| {
            set(factors, &quote! { &#values }).unwrap_or_default()
        });
        quote! { #known #contractions }
    }

    /// The contractions of a function: `term` adds the products of a table to an array, `after` follows the array of
    /// each contraction, and that of the scalars.
    fn contractions(
        &self,
        (function, loops): (&Function, &Loops),
        term: impl Fn(&Products, &Ident) -> TokenStream,
        after: impl Fn(Factors, &Ident) -> TokenStream,
    ) -> TokenStream {
        let mut tokens = TokenStream::new();
        if !loops.values.is_empty() {
            let (scalars, values) = (ident(&loops.scalars), array(&texts(&loops.values)));
            let after = after(Factors::Scalars, &scalars);
            tokens.extend(quote! { let #scalars = #values; #after });
        }
        for ((contraction, sums), k) in function.contractions.iter().zip(&loops.sums).zip(0u32..) {
            let (n, sums) = (size(contraction.n_results), ident(sums));
            let terms = contraction.terms.iter().map(|products| term(products, &sums));
            let after = after(Factors::Contraction(k), &sums);
            tokens.extend(quote! { let mut #sums = [R::ZERO; #n]; #(#terms)* #after });
        }
        tokens
    }

    /// The constant that is a table.
    fn table(&self, products: &Products) -> Ident {
        ident(&self.module.tables[products.table as usize])
    }

    /// The array of a function's results.
    pub(super) fn results(&self, routine: &Routine<'_>) -> TokenStream {
        array_of_results(routine.function, routine.loops.as_ref(), &routine.code.results)
    }
}

/// The array of the first results of a function, which are also given one by one.
pub(super) fn array_of_results(function: &Function, loops: Option<&Loops>, results: &[Text]) -> TokenStream {
    match loops.zip(function.contraction_of_first_results(results.len())) {
        Some((loops, k)) => {
            let sums = ident(&loops.sums[k]);
            quote! { #sums }
        }
        None => array(&texts(results)),
    }
}

/// The values of factors; the state is spelled by the function.
fn values_of(loops: &Loops, state: &TokenStream, factors: Factors) -> TokenStream {
    let array = match factors {
        Factors::State => return state.clone(),
        Factors::Argument => {
            let argument = ident(&loops.argument);
            return quote! { #argument };
        }
        Factors::Scalars => ident(&loops.scalars),
        Factors::Contraction(k) => ident(&loops.sums[k as usize]),
    };
    quote! { &#array }
}
