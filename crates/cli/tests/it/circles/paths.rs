//! The contents of an item: its name, its attributes, and all paths in it.

use std::collections::BTreeSet;

use syn::buffer::{Cursor, TokenBuffer};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, Meta, UseTree};

/// A path as written, without generic arguments.
pub(super) type Words = Vec<String>;

pub(super) fn attributes(item: &Item) -> Option<&[Attribute]> {
    Some(match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => return None,
    })
}

/// Whether it calls a macro, which may create items with any name.
pub(super) fn is_call(item: &Item) -> bool {
    matches!(item, Item::Macro(call) if call.ident.is_none())
}

pub(super) fn name_of(item: &Item) -> Option<String> {
    let name = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::TraitAlias(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(name.to_string())
}

/// `#[cfg(test)]`, possibly with further conditions.
pub(super) fn for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::List(list) if list.path.is_ident("cfg") => {
            let words = list.tokens.to_string();
            words == "test" || (words.starts_with("all") && words.contains("test") && !words.contains("not"))
        }
        _ => false,
    })
}

/// The file that `#[path = "…"]` names.
pub(super) fn path_attribute(attribute: &Attribute) -> Option<String> {
    let Meta::NameValue(pair) = &attribute.meta else { return None };
    let syn::Expr::Lit(value) = &pair.value else { return None };
    match &value.lit {
        syn::Lit::Str(text) if pair.path.is_ident("path") => Some(text.value()),
        _ => None,
    }
}

/// The `use` trees within an item.
pub(super) struct InnerUses(pub(super) Vec<UseTree>);

impl<'ast> Visit<'ast> for InnerUses {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.0.push(item.tree.clone());
    }
}

/// All paths within items, those in macros and attributes included.
pub(super) struct Paths(pub(super) BTreeSet<Words>);

impl Paths {
    /// Collects whatever looks like a path among tokens: words with `::` between them.
    fn scan(&mut self, mut at: Cursor<'_>) {
        let mut path = Words::new();
        let mut joins = false;
        loop {
            if let Some((word, next)) = at.ident() {
                if !joins {
                    self.0.insert(core::mem::take(&mut path));
                }
                path.push(word.to_string());
                (at, joins) = (next, false);
            } else if let Some(next) = colons(at) {
                (at, joins) = (next, !path.is_empty());
            } else {
                self.0.insert(core::mem::take(&mut path));
                joins = false;
                if let Some((inside, _, _, next)) = at.any_group() {
                    self.scan(inside);
                    at = next;
                } else if let Some((literal, next)) = at.literal() {
                    // `#[serde(with = "path")]`
                    let text = literal.to_string();
                    let words = text.trim_matches('"').split("::");
                    let is_path =
                        words.clone().count() > 1 && words.clone().all(|word| syn::parse_str::<syn::Ident>(word).is_ok());
                    if is_path {
                        self.0.insert(words.map(str::to_owned).collect());
                    }
                    at = next;
                } else if let Some((_, next)) = at.token_tree() {
                    at = next;
                } else {
                    return;
                }
            }
        }
    }
}

/// What follows `::`.
fn colons(at: Cursor<'_>) -> Option<Cursor<'_>> {
    let (first, next) = at.punct()?;
    let (second, next) = next.punct()?;
    (first.as_char() == ':' && second.as_char() == ':').then_some(next)
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(for_tests) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !for_tests(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_item_use(&mut self, _: &'ast syn::ItemUse) {}

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.0.insert(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_path(&call.path);
        self.scan(TokenBuffer::new2(call.tokens.clone()).begin());
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let Meta::List(list) = &attribute.meta {
            self.scan(TokenBuffer::new2(list.tokens.clone()).begin());
        }
    }
}
