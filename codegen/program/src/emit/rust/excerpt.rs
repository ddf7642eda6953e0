//! A function out of an emitted module, for pages that show it.
//!
//! Does not know: what is in the function.

use syn::spanned::Spanned as _;

use crate::program::Role;

/// As [`method_text`](crate::emit::method_text).
pub(in crate::emit) fn method_text(module: &str, role: &Role) -> Option<String> {
    let file = syn::parse_file(module).ok()?;
    let items = file.items.iter().filter_map(|item| match item {
        syn::Item::Impl(own) if own.trait_.is_none() => Some(&own.items),
        _ => None,
    });
    let method = items.flatten().find_map(|item| match item {
        syn::ImplItem::Fn(method) if method.sig.ident == role.name() => Some(method),
        _ => None,
    })?;
    let (start, end) = (method.vis.span().start(), method.block.span().end());
    let lines = module.lines().skip(start.line - 1).take(end.line + 1 - start.line);
    let dedented = lines.map(|line| match line.split_at_checked(start.column) {
        Some((indentation, rest)) if indentation.trim().is_empty() => rest,
        _ => line,
    });
    Some(dedented.collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use super::method_text;
    use crate::program::Role;

    #[test]
    fn a_method_is_found_by_its_role() {
        let module = "impl A {\n    /// Other.\n    pub fn energy(&self) {}\n    /// Rates.\n    #[inline]\n    pub fn rhs(&self) {\n        \
                      one();\n\n        two();\n    }\n}\nimpl B for A {\n    fn rhs(&self) {}\n}\n";
        let text = method_text(module, &Role::Rate);
        assert_eq!(text.as_deref(), Some("pub fn rhs(&self) {\n    one();\n\n    two();\n}"));
        assert_eq!(method_text(module, &Role::Domain), None);
        assert_eq!(method_text("impl {", &Role::Rate), None);
    }
}
