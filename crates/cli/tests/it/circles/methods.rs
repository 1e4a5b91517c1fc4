//! The methods of one type that stand in several files, and which of them call each other.

use std::collections::{BTreeMap, BTreeSet};

use syn::buffer::{Cursor, TokenBuffer};
use syn::visit::{self, Visit};
use syn::{Expr, ImplItem, Item, Type};

use super::graph::{Edges, circles};
use super::modules::{Circle, Crate};
use super::paths::for_tests;

/// The methods that a body calls of its own type: `self.name(…)` and `Self::name`.
struct OwnCalls(BTreeSet<String>);

impl OwnCalls {
    /// The same among the tokens of a macro's call.
    fn scan(&mut self, mut at: Cursor<'_>) {
        let mut before = String::new();
        while !at.eof() {
            if let Some((word, next)) = at.ident() {
                if before == "self." || before == "Self::" {
                    self.0.insert(word.to_string());
                }
                (before, at) = (word.to_string(), next);
            } else if let Some((inside, _, _, next)) = at.any_group() {
                self.scan(inside);
                (before, at) = (String::new(), next);
            } else if let Some((point, next)) = at.punct() {
                before.push(point.as_char());
                at = next;
            } else if let Some((_, next)) = at.token_tree() {
                (before, at) = (String::new(), next);
            } else {
                return;
            }
        }
    }
}

impl<'ast> Visit<'ast> for OwnCalls {
    fn visit_expr_method_call(&mut self, call: &'ast syn::ExprMethodCall) {
        if matches!(&*call.receiver, Expr::Path(path) if path.path.is_ident("self")) {
            self.0.insert(call.method.to_string());
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if let [first, second] = path.segments.iter().collect::<Vec<_>>().as_slice()
            && first.ident == "Self"
        {
            self.0.insert(second.ident.to_string());
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.scan(TokenBuffer::new2(call.tokens.clone()).begin());
    }
}

/// The methods of a type: name → (file, the methods that it calls of its own type).
type Methods = BTreeMap<String, (usize, BTreeSet<String>)>;

/// The methods of every type, by its name and where it is defined.
fn methods(is: &Crate) -> BTreeMap<(String, Option<usize>), Methods> {
    let mut types: BTreeMap<(String, Option<usize>), Methods> = BTreeMap::new();
    is.items(|module, file, item| {
        let Item::Impl(item) = item else { return };
        let Type::Path(path) = &*item.self_ty else { return };
        let Some(name) = path.path.segments.last().map(|segment| segment.ident.to_string()) else { return };
        let words: Vec<String> = path.path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        let of = types.entry((name, is.file_of(module, &words))).or_default();
        for function in item.items.iter() {
            let ImplItem::Fn(function) = function else { continue };
            if for_tests(&function.attrs) {
                continue;
            }
            let mut calls = OwnCalls(BTreeSet::new());
            calls.visit_block(&function.block);
            of.insert(function.sig.ident.to_string(), (file, calls.0));
        }
    });
    types
}

/// The cycles between files in which the methods of one type call each other. A module and its submodules are no exception.
pub(super) fn of_methods(is: &Crate) -> Vec<Circle> {
    let mut found = Vec::new();
    for ((name, _), methods) in methods(is) {
        let mut edges = Edges::new();
        let mut uses = Vec::new();
        for (from, (file, calls)) in &methods {
            for (to, (other, _)) in calls.iter().filter_map(|to| Some((to, methods.get(to)?))) {
                if file != other {
                    edges.entry(*file).or_default().insert(*other);
                    uses.push((*file, *other, format!("{} → {} ({name}::{from} calls {to})", is.path(*file), is.path(*other))));
                }
            }
        }
        for knot in circles(&edges, &|_, _| false) {
            found.push(Circle {
                files: knot.iter().map(|&file| is.path(file)).collect(),
                uses: uses
                    .iter()
                    .filter(|(from, to, _)| knot.contains(from) && knot.contains(to))
                    .map(|(_, _, words)| words.clone())
                    .collect(),
            });
        }
    }
    found
}

/// In how many files the methods of a type stand.
pub(super) fn files_of_methods(is: &Crate, name: &str) -> usize {
    let of = methods(is).into_iter().filter(|((of, _), _)| of == name).flat_map(|(_, methods)| methods.into_values());
    of.map(|(file, _)| file).collect::<BTreeSet<_>>().len()
}
