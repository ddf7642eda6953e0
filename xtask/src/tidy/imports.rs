//! Which modules of a crate a file uses: by `use`, and by paths in its code.
//!
//! Paths that begin with `crate`, `super`, `self` or the name of a child module are followed through `pub use` to the
//! file that has the item. Code under `#[cfg(test)]`, comments and texts do not count.
//!
//! Does not know: what is allowed to use what, calls of methods.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

use super::source::Source;

/// Names from the crate's root to a module.
pub(super) type Module = Vec<String>;

/// A use of one module by another, and the line that shows it.
#[derive(Clone, Debug)]
pub(super) struct Use {
    pub(super) module: Module,
    pub(super) line: usize,
}

/// The modules of a crate, their files and what they use of each other.
#[derive(Debug, Default)]
pub(super) struct Imports {
    pub(super) files: BTreeMap<Module, PathBuf>,
    pub(super) uses: BTreeMap<Module, Vec<Use>>,
}

/// A path as it is written: names, and where it stands.
struct Written {
    names: Vec<String>,
    line: usize,
    /// The name that `pub use` gives what the path leads to.
    reexported: Option<String>,
}

/// The module that a file under `src` is.
fn module_of(file: &Path) -> Module {
    let mut names: Module =
        file.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if matches!(names.last().map(String::as_str), Some("mod" | "lib" | "main")) {
        names.pop();
    }
    names
}

/// Reads all files of a crate, `src` being its folder of sources.
pub(super) fn imports(sources: &[Source], src: &str) -> Imports {
    let mut imports = Imports::default();
    let mut streams = BTreeMap::new();
    for source in sources.iter().filter(|s| s.is_in(src) && s.has_extension("rs") && !s.is_test()) {
        let Ok(inside) = source.path.strip_prefix(src) else { continue };
        // What rustc cannot read, rustc reports.
        let Ok(tokens) = source.text.parse::<TokenStream>() else { continue };
        let module = module_of(inside);
        imports.files.insert(module.clone(), source.path.clone());
        streams.insert(module, tokens);
    }
    let known: BTreeSet<Module> = imports.files.keys().cloned().collect();
    let mut reexports: BTreeMap<Module, BTreeMap<String, Module>> = BTreeMap::new();
    let mut written: BTreeMap<Module, Vec<Written>> = BTreeMap::new();
    for (module, tokens) in streams {
        let mut reader = Reader { module: &module, known: &known, found: Vec::new() };
        reader.read(tokens);
        for path in reader.found {
            let Some(target) = absolute(&module, &path.names, &known) else { continue };
            match path.reexported {
                Some(name) => {
                    reexports.entry(module.clone()).or_default().insert(name, target);
                }
                None => written.entry(module.clone()).or_default().push(Written { names: target, ..path }),
            }
        }
    }
    for (module, paths) in written {
        let list = imports.uses.entry(module.clone()).or_default();
        for path in paths {
            let target = followed(path.names, &known, &reexports);
            if target != module {
                list.push(Use { module: target, line: path.line });
            }
        }
    }
    imports
}

/// A path from the crate's root, for one that leads into this crate.
fn absolute(module: &[String], names: &[String], known: &BTreeSet<Module>) -> Option<Module> {
    let mut base = module.to_vec();
    let mut rest = names;
    match rest.first()?.as_str() {
        "crate" => return Some(rest[1..].to_vec()),
        "self" => rest = &rest[1..],
        "super" => {
            while rest.first().is_some_and(|name| name == "super") {
                base.pop();
                rest = &rest[1..];
            }
        }
        child => {
            base.push(child.to_owned());
            if !known.contains(&base) {
                return None;
            }
            rest = &rest[1..];
        }
    }
    base.extend(rest.iter().cloned());
    Some(base)
}

/// The module with the item that a path leads to.
fn followed(
    mut path: Module,
    known: &BTreeSet<Module>,
    reexports: &BTreeMap<Module, BTreeMap<String, Module>>,
) -> Module {
    // A chain of `pub use` is as long as the modules are deep, at most.
    for _ in 0..8 {
        let n = (0..=path.len()).rev().find(|n| known.contains(&path[..*n])).unwrap_or(0);
        let (module, rest) = path.split_at(n);
        let Some(target) = rest.first().and_then(|name| reexports.get(module)?.get(name)) else {
            return module.to_vec();
        };
        path = target.iter().chain(&rest[1..]).cloned().collect();
    }
    path
}

struct Reader<'a> {
    module: &'a [String],
    known: &'a BTreeSet<Module>,
    found: Vec<Written>,
}

fn is_punct(tree: Option<&TokenTree>, c: char) -> bool {
    matches!(tree, Some(TokenTree::Punct(p)) if p.as_char() == c)
}

fn is_word(tree: Option<&TokenTree>, word: &str) -> bool {
    matches!(tree, Some(TokenTree::Ident(ident)) if ident == word)
}

impl Reader<'_> {
    fn read(&mut self, tokens: TokenStream) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        // Whether the item that begins here is `pub` in any way.
        let mut is_public = false;
        while let Some(tree) = trees.get(at) {
            match tree {
                TokenTree::Punct(p) if p.as_char() == '#' => {
                    let attribute = trees.get(at + 1).map(ToString::to_string).unwrap_or_default();
                    at += 2;
                    if attribute.replace(' ', "") == "[cfg(test)]" {
                        at = after_item(&trees, at);
                    }
                    continue;
                }
                TokenTree::Ident(ident) if ident == "pub" => {
                    is_public = true;
                    at += 1;
                    if matches!(trees.get(at), Some(TokenTree::Group(g)) if g.delimiter() == Delimiter::Parenthesis)
                    {
                        at += 1;
                    }
                    continue;
                }
                TokenTree::Ident(ident) if ident == "use" => {
                    let end = (at..trees.len()).find(|k| is_punct(trees.get(*k), ';')).unwrap_or(trees.len());
                    self.tree_of_use(&[], &trees[at + 1..end], is_public);
                    at = end;
                }
                TokenTree::Ident(_) => at = self.path(&trees, at),
                TokenTree::Group(group) => self.read(group.stream()),
                _ => {}
            }
            is_public = false;
            at += 1;
        }
    }

    /// A path in code, from its first name; the position of its last name.
    fn path(&mut self, trees: &[TokenTree], start: usize) -> usize {
        // `x.name` and `other::name` are not the beginning of a path.
        let continues =
            start > 0 && (is_punct(trees.get(start - 1), '.') || is_punct(trees.get(start - 1), ':'));
        let mut names = vec![trees[start].to_string()];
        let mut at = start;
        while is_punct(trees.get(at + 1), ':') && is_punct(trees.get(at + 2), ':') {
            let Some(TokenTree::Ident(name)) = trees.get(at + 3) else { break };
            names.push(name.to_string());
            at += 3;
        }
        let begins = matches!(names[0].as_str(), "crate" | "self" | "super") || {
            let mut child = self.module.to_vec();
            child.push(names[0].clone());
            self.known.contains(&child)
        };
        if names.len() > 1 && begins && !continues {
            let line = trees[start].span().start().line;
            self.found.push(Written { names, line, reexported: None });
        }
        at
    }

    /// The paths of `use a::{b, c::d as e};` without the `use`.
    fn tree_of_use(&mut self, prefix: &[String], trees: &[TokenTree], is_public: bool) {
        // Behind the last comma of a list is no path.
        for part in trees.split(|tree| is_punct(Some(tree), ',')).filter(|part| !part.is_empty()) {
            let mut names = prefix.to_vec();
            let mut renamed = None;
            let mut line = 0;
            let mut at = 0;
            while let Some(tree) = part.get(at) {
                match tree {
                    TokenTree::Group(group) => {
                        let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                        self.tree_of_use(&names, &inside, is_public);
                        names.clear();
                        break;
                    }
                    TokenTree::Ident(_) if is_word(Some(tree), "as") => {
                        renamed = part.get(at + 1).map(ToString::to_string);
                        break;
                    }
                    TokenTree::Ident(name) => {
                        line = name.span().start().line;
                        names.push(name.to_string());
                    }
                    _ => {}
                }
                at += 1;
            }
            if let Some(last) = names.last().cloned() {
                let reexported = is_public.then(|| renamed.unwrap_or(last));
                self.found.push(Written { names, line, reexported });
            }
        }
    }
}

/// The position after the item that begins at a position.
fn after_item(trees: &[TokenTree], start: usize) -> usize {
    let ends = |tree: &TokenTree| match tree {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        tree => is_punct(Some(tree), ';'),
    };
    (start..trees.len()).find(|k| ends(&trees[*k])).map_or(trees.len(), |k| k + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used(files: &[(&str, &str)]) -> Vec<String> {
        let sources: Vec<Source> =
            files.iter().map(|(path, text)| Source { path: path.into(), text: (*text).into() }).collect();
        let uses = imports(&sources, "c/src").uses;
        uses.iter()
            .flat_map(|(from, list)| {
                list.iter().map(move |to| format!("{} -> {}", from.join("::"), to.module.join("::")))
            })
            .collect()
    }

    #[test]
    fn paths_are_followed_to_the_file_with_the_item() {
        let files = [
            ("c/src/lib.rs", "mod a; mod b;"),
            ("c/src/a/mod.rs", "mod x; mod y; pub use x::X as Renamed; fn f() { y::g() }"),
            ("c/src/a/x.rs", "pub struct X;"),
            ("c/src/a/y.rs", "use super::{Renamed,}; #[cfg(test)] mod tests { use crate::b::B; }"),
            (
                "c/src/b.rs",
                "use crate::a::{Renamed, y::{self, Z}}; // use crate::c::C\n fn f() { \"crate::d\"; }",
            ),
        ];
        assert_eq!(used(&files), ["a -> a::y", "a::y -> a::x", "b -> a::x", "b -> a::y", "b -> a::y"]);
    }
}
