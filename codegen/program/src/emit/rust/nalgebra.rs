//! Parameters and state in the types of the crate `nalgebra`, for modules that are asked to have them.
//!
//! Every group of numbers has a method of its name that gives it, and `with_<name>` that takes another one; a vector
//! of the whole state goes there and back. Does not know: which numbers form a group, or why.

use proc_macro2::{Ident, TokenStream};
use quote::quote;

use super::Writer;
use super::notation::Rust;
use super::tokens::{doc_attributes, ident, idents, size};
use crate::emit::names::Scope;
use crate::emit::text::{GroupKind, GroupText};
use hamel_expr::error::Error;

/// Methods that `Params` and `State` have already, or that their derived traits bring with them.
const TAKEN: [&str; 6] = ["from_array", "to_array", "from_vector", "to_vector", "clone", "fmt"];

/// A group with the names of its methods and of the fields that it consists of.
struct Group<'a> {
    text: &'a GroupText,
    get: String,
    set: String,
    fields: Vec<Ident>,
    /// The argument of a method that takes the group; no field has that name.
    argument: Ident,
    /// What the structure has besides these fields.
    rest: TokenStream,
}

impl Writer<'_> {
    /// All of it; nothing for a module that does without.
    pub(super) fn groups(&self) -> Result<TokenStream, Error> {
        let Some(groups) = &self.module.text.groups else { return Ok(TokenStream::new()) };
        let (rt, n) = (&self.runtime, size(self.module.state.len()));
        let params = self.accessors("Params", &groups.params, &self.module.params)?;
        let state = self.accessors("State", &groups.state, &self.module.state)?;
        Ok(quote! {
            #params

            #state

            impl<R: #rt::Real + #rt::nalgebra::Scalar> State<R> {
                /// The named components of a vector.
                #[must_use]
                pub fn from_vector(y: #rt::nalgebra::SVector<R, #n>) -> Self {
                    Self::from_array(y.into())
                }

                /// The components as the vector that the system of [`Prepared::on_vectors`] takes.
                #[must_use]
                pub fn to_vector(self) -> #rt::nalgebra::SVector<R, #n> {
                    self.to_array().into()
                }
            }

            impl<R> Prepared<R> {
                /// The system with vectors for its states.
                #[must_use]
                pub const fn on_vectors(self) -> #rt::OnVectors<Self, #n> {
                    #rt::OnVectors::new(self)
                }
            }
        })
    }

    /// The methods of all groups of a structure: those of rotations ask more of the scalar than the others.
    fn accessors(&self, owner: &str, texts: &[GroupText], fields: &[String]) -> Result<TokenStream, Error> {
        let rt = &self.runtime;
        let mut scope = Scope::with(&Rust, TAKEN);
        let mut groups = Vec::with_capacity(texts.len());
        for (text, get) in texts.iter().zip(scope.add_all(texts.iter().map(|text| text.name.as_str()))) {
            let set = scope.add(&format!("with_{get}"));
            groups.push(Group::new(text, [get, set], fields)?);
        }
        let owner = ident(owner);
        let mut items = TokenStream::new();
        for turns in [false, true] {
            let chosen: Vec<&Group<'_>> = groups.iter().filter(|g| g.turns() == turns).collect();
            if chosen.is_empty() {
                continue;
            }
            let methods = chosen.iter().map(|group| self.methods(group));
            let scalar = ident(if turns { "RealField" } else { "Scalar" });
            items.extend(quote! {
                impl<R: #rt::Real + #rt::nalgebra::#scalar> #owner<R> {
                    #(#methods)*
                }
            });
        }
        Ok(items)
    }

    fn methods(&self, group: &Group<'_>) -> TokenStream {
        let Group { text, fields, argument, rest, .. } = group;
        let (get, set) = (ident(&group.get), ident(&group.set));
        let rt = &self.runtime;
        let na = quote! { #rt::nalgebra };
        let n = size(fields.len());
        let numbers = quote! { [#(self.#fields),*] };
        let quaternion = |parts: &[Ident]| {
            quote! { #na::UnitQuaternion::from_quaternion(#na::Quaternion::new(#(self.#parts),*)) }
        };
        // Of a quaternion, nalgebra has the vector first.
        let turned = |parts: &[Ident]| {
            let (w, xyz) = (&parts[0], &parts[1..]);
            quote! { [#(#xyz,)* #w] }
        };
        let matrix = |n_rows: usize, n_columns: usize, entry: &dyn Fn(usize, usize) -> TokenStream| {
            let columns = (0..n_columns).map(|j| {
                let entries = (0..n_rows).map(|i| entry(i, j));
                quote! { [#(#entries),*] }
            });
            quote! { [#(#columns),*] }
        };
        let (given, taken, value, parts) = match text.kind {
            GroupKind::Vector => {
                let vector = quote! { #na::SVector<R, #n> };
                let value = quote! { #numbers.into() };
                (vector.clone(), vector, value, quote! { let [#(#fields),*] = #argument.into(); })
            }
            GroupKind::Diagonal => {
                let columns = matrix(fields.len(), fields.len(), &|i, j| {
                    let field = &fields[i];
                    if i == j {
                        quote! { self.#field }
                    } else {
                        quote! { R::ZERO }
                    }
                });
                let parts = quote! { let [#(#fields),*] = #argument.into(); };
                let (given, taken) = (quote! { #na::SMatrix<R, #n, #n> }, quote! { #na::SVector<R, #n> });
                (given, taken, quote! { #columns.into() }, parts)
            }
            GroupKind::Symmetric(n_rows) => {
                // Rows of the upper triangle are shorter by the columns before them.
                let position = |i: usize, j: usize| i * n_rows - i * (i + 1) / 2 + j;
                let columns = matrix(n_rows, n_rows, &|i, j| {
                    let field = &fields[position(i.min(j), i.max(j))];
                    quote! { self.#field }
                });
                let pattern = matrix(n_rows, n_rows, &|i, j| {
                    let field = (i <= j).then(|| &fields[position(i, j)]);
                    field.map_or(quote! { _ }, |field| quote! { #field })
                });
                let n_rows = size(n_rows);
                let kind = quote! { #na::SMatrix<R, #n_rows, #n_rows> };
                (kind.clone(), kind, quote! { #columns.into() }, quote! { let #pattern = #argument.into(); })
            }
            GroupKind::Matrix(n_rows, n_columns) => {
                let field = |i: usize, j: usize| &fields[i * n_columns + j];
                let columns = matrix(n_rows, n_columns, &|i, j| {
                    let field = field(i, j);
                    quote! { self.#field }
                });
                let pattern = matrix(n_rows, n_columns, &|i, j| {
                    let field = field(i, j);
                    quote! { #field }
                });
                let (n_rows, n_columns) = (size(n_rows), size(n_columns));
                let kind = quote! { #na::SMatrix<R, #n_rows, #n_columns> };
                (kind.clone(), kind, quote! { #columns.into() }, quote! { let #pattern = #argument.into(); })
            }
            GroupKind::Attitude => {
                let (kind, turned) = (quote! { #na::UnitQuaternion<R> }, turned(fields));
                let parts = quote! { let #turned = #argument.into_inner().coords.into(); };
                (kind.clone(), kind, quaternion(fields), parts)
            }
            GroupKind::Place => {
                let (attitude, position) = fields.split_at(4);
                let (kind, turned, rotation) =
                    (quote! { #na::Isometry3<R> }, turned(attitude), quaternion(attitude));
                let value = quote! {
                    let position = #na::Translation3::new(#(self.#position),*);
                    #na::Isometry3::from_parts(position, #rotation)
                };
                let parts = quote! {
                    let #turned = #argument.rotation.into_inner().coords.into();
                    let [#(#position),*] = #argument.translation.vector.into();
                };
                (kind.clone(), kind, value, parts)
            }
            GroupKind::PlanarPlace => {
                let (angle, position) = (&fields[0], &fields[1..]);
                let kind = quote! { #na::Isometry2<R> };
                let value =
                    quote! { #na::Isometry2::new(#na::Vector2::new(#(self.#position),*), self.#angle) };
                let parts = quote! {
                    let #angle = #argument.rotation.angle();
                    let [#(#position),*] = #argument.translation.vector.into();
                };
                (kind.clone(), kind, value, parts)
            }
        };
        let (get_doc, set_doc) = group.docs();
        quote! {
            #get_doc
            #[must_use]
            pub fn #get(&self) -> #given {
                #value
            }

            #set_doc
            #[must_use]
            pub fn #set(self, #argument: #taken) -> Self {
                #parts
                Self { #(#fields,)* #rest }
            }
        }
    }
}

impl<'a> Group<'a> {
    fn new(text: &'a GroupText, [get, set]: [String; 2], fields: &[String]) -> Result<Group<'a>, Error> {
        let mut own = Vec::with_capacity(text.components.len());
        for at in &text.components {
            let name = fields.get(*at).ok_or_else(|| Error::ShapeMismatch {
                what: format!("position of a component of {}", text.name),
                found: *at,
                expected: fields.len(),
            })?;
            own.push(name.as_str());
        }
        let expected = text.kind.n_components().unwrap_or(own.len());
        if own.len() != expected {
            let what = format!("number of components of {}", text.name);
            return Err(Error::ShapeMismatch { what, found: own.len(), expected });
        }
        let argument = ident(&Scope::with(&Rust, own.iter().copied()).add("value"));
        let rest = if own.len() < fields.len() {
            quote! { ..self }
        } else {
            TokenStream::new()
        };
        Ok(Group { text, get, set, fields: idents(own), argument, rest })
    }

    /// Whether it has a rotation.
    fn turns(&self) -> bool {
        matches!(self.text.kind, GroupKind::Attitude | GroupKind::Place | GroupKind::PlanarPlace)
    }

    /// What both methods say.
    fn docs(&self) -> (TokenStream, TokenStream) {
        let fields: Vec<String> = self.fields.iter().map(|f| format!("`{f}`")).collect();
        let (name, fields) = (&self.text.name, fields.join(", "));
        let [what, note] = match self.text.kind {
            GroupKind::Vector => [format!("vector `{name}`"), String::new()],
            GroupKind::Diagonal => [format!("diagonal matrix `{name}`"), ", by its diagonal".to_owned()],
            GroupKind::Symmetric(_) => {
                [format!("symmetric matrix `{name}`"), ", of which the upper triangle is read".to_owned()]
            }
            GroupKind::Matrix(..) => [format!("matrix `{name}`"), String::new()],
            GroupKind::Attitude => [format!("attitude `{name}`"), String::new()],
            GroupKind::Place | GroupKind::PlanarPlace => ["place".to_owned(), String::new()],
        };
        let mut get = vec![format!("The {what}: {fields}.")];
        match self.text.kind {
            GroupKind::Attitude => get.extend([
                String::new(),
                "It turns vectors from body to space. The quaternion of the state is normalised.".to_owned(),
            ]),
            GroupKind::Place => get.extend([
                String::new(),
                "It moves points from body to space. The quaternion of the state is normalised.".to_owned(),
            ]),
            GroupKind::PlanarPlace => {
                get.extend([String::new(), "It moves points from body to space.".to_owned()]);
            }
            _ => {}
        }
        (doc_attributes(get), doc_attributes([format!("The same with another {what}{note}.")]))
    }
}
