//! The modules of a crate, and the names that each file uses from others.
//!
//! Names are resolved as the compiler does, as far as files need it: through `use`, re-exports and globs to the file
//! that defines the item. The segments after an item's name (a variant, an associated function) belong to the item.
//! Excluded are `#[cfg(test)]`, `mod x;`, names created by macros, and a parent's `pub use` of its submodules, which
//! only lists them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use syn::visit::Visit;
use syn::{Attribute, Item, UseTree, Visibility};

use super::graph::{Edges, circles};
use super::paths::{InnerUses, Paths, Words, attributes, for_tests, is_call, name_of, path_attribute};

/// The meaning of a name.
#[derive(Clone, Debug)]
enum Named {
    Item,
    Module(usize),
    Import(Words),
}

/// The target of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Target {
    /// An item defined in a module.
    Item(usize),
    Module(usize),
    /// Outside this crate, or something without a name of its own here (a variable, a type parameter).
    Elsewhere,
}

struct Module {
    parent: Option<usize>,
    file: usize,
    names: BTreeMap<String, Vec<Named>>,
    globs: Vec<Words>,
    /// Imported: the path, and whether it is only listed for others.
    imports: Vec<(Words, bool)>,
    /// Its items except modules.
    items: Vec<Item>,
}

/// A crate's modules.
pub(super) struct Crate {
    modules: Vec<Module>,
    /// Path of each file, and its module.
    files: Vec<(PathBuf, usize)>,
}

/// A cycle: its files, and each use between two of them, `from → to (names)`.
#[derive(Debug)]
pub(super) struct Circle {
    pub(super) files: BTreeSet<String>,
    pub(super) uses: Vec<String>,
}

impl Crate {
    /// The crate whose root is this file. `read` returns a file's text, `None` if there is none.
    pub(super) fn read(root: &Path, read: &impl Fn(&Path) -> Option<String>) -> Self {
        let mut made = Self { modules: Vec::new(), files: Vec::new() };
        made.add_file(root, root.parent().unwrap(), None, read);
        made
    }

    fn add_file(&mut self, path: &Path, folder: &Path, parent: Option<usize>, read: &impl Fn(&Path) -> Option<String>) -> usize {
        let text = read(path).unwrap_or_else(|| panic!("no file {}", path.display()));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        self.files.push((path.to_owned(), self.modules.len()));
        self.add_module(parsed.items, self.files.len() - 1, folder, parent, read)
    }

    fn add_module(
        &mut self,
        items: Vec<Item>,
        file: usize,
        folder: &Path,
        parent: Option<usize>,
        read: &impl Fn(&Path) -> Option<String>,
    ) -> usize {
        let id = self.modules.len();
        let (names, globs, imports) = Default::default();
        self.modules.push(Module { parent, file, names, globs, imports, items: Vec::new() });
        for item in items.into_iter().filter(|item| !attributes(item).is_some_and(for_tests)) {
            match item {
                Item::Mod(module) => {
                    let name = module.ident.to_string();
                    let below = folder.join(&name);
                    let child = match module.content {
                        Some((_, items)) => self.add_module(items, file, &below, Some(id), read),
                        None => {
                            let (path, below) = self.place(file, folder, &name, &module.attrs, read);
                            self.add_file(&path, &below, Some(id), read)
                        }
                    };
                    self.name(id, name, Named::Module(child));
                }
                Item::Use(item) => {
                    let only_listed = !matches!(item.vis, Visibility::Inherited);
                    self.import(id, &item.tree, &mut Vec::new(), only_listed);
                }
                item => {
                    if let Some(name) = name_of(&item) {
                        self.name(id, name, Named::Item);
                    }
                    // A `use` within a body: its names are assigned to the whole module, since scopes are not modelled.
                    let mut inner = InnerUses(Vec::new());
                    inner.visit_item(&item);
                    for tree in inner.0 {
                        self.import(id, &tree, &mut Vec::new(), false);
                    }
                    self.modules[id].items.push(item);
                }
            }
        }
        id
    }

    /// The file of `mod name;`, and the folder of its own modules.
    fn place(
        &self,
        file: usize,
        folder: &Path,
        name: &str,
        attributes: &[Attribute],
        read: &impl Fn(&Path) -> Option<String>,
    ) -> (PathBuf, PathBuf) {
        if let Some(given) = attributes.iter().find_map(path_attribute) {
            return (self.files[file].0.with_file_name(given), folder.join(name));
        }
        let flat = folder.join(format!("{name}.rs"));
        let path = if read(&flat).is_some() { flat } else { folder.join(name).join("mod.rs") };
        (path, folder.join(name))
    }

    fn name(&mut self, module: usize, name: String, named: Named) {
        self.modules[module].names.entry(name).or_default().push(named);
    }

    fn import(&mut self, module: usize, tree: &UseTree, before: &mut Words, only_listed: bool) {
        match tree {
            UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.import(module, &path.tree, before, only_listed);
                before.pop();
            }
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.import(module, tree, before, only_listed)),
            UseTree::Glob(_) => self.modules[module].globs.push(before.clone()),
            UseTree::Name(name) if name.ident == "self" => {
                self.import_as(module, before.last().unwrap().clone(), before.clone(), only_listed);
            }
            UseTree::Name(name) => {
                let word = name.ident.to_string();
                self.import_as(module, word.clone(), [&before[..], &[word]].concat(), only_listed);
            }
            UseTree::Rename(renamed) => {
                let path = [&before[..], &[renamed.ident.to_string()]].concat();
                self.import_as(module, renamed.rename.to_string(), path, only_listed);
            }
        }
    }

    fn import_as(&mut self, module: usize, name: String, path: Words, only_listed: bool) {
        self.name(module, name, Named::Import(path.clone()));
        self.modules[module].imports.push((path, only_listed));
    }

    /// The target of a path written in a module; `None` if a module has no such name.
    fn resolve(&self, module: usize, path: &[String], seen: &mut BTreeSet<(usize, String)>) -> BTreeSet<Target> {
        let Some((first, mut rest)) = path.split_first() else { return BTreeSet::new() };
        let mut at: BTreeSet<Target> = match first.as_str() {
            "crate" => [Target::Module(0)].into(),
            "self" => [Target::Module(module)].into(),
            "super" => self.modules[module].parent.map(Target::Module).into_iter().collect(),
            name => {
                let found = self.look_up(module, name, seen);
                if found.is_empty() { [Target::Elsewhere].into() } else { found }
            }
        };
        while let Some((word, after)) = rest.split_first() {
            let step = |target| match target {
                Target::Item(_) | Target::Elsewhere => [target].into(),
                Target::Module(module) if word == "super" => {
                    self.modules[module].parent.map(Target::Module).into_iter().collect()
                }
                Target::Module(module) => {
                    let found = self.look_up(module, word, seen);
                    // A name that a module does not define may be created by a macro that it calls.
                    let made = found.is_empty() && self.modules[module].items.iter().any(is_call);
                    if made { [Target::Item(module)].into() } else { found }
                }
            };
            at = at.into_iter().flat_map(step).collect();
            rest = after;
        }
        at
    }

    fn look_up(&self, module: usize, name: &str, seen: &mut BTreeSet<(usize, String)>) -> BTreeSet<Target> {
        if !seen.insert((module, name.to_owned())) {
            return BTreeSet::new();
        }
        let is = &self.modules[module];
        let mut found = BTreeSet::new();
        for named in is.names.get(name).into_iter().flatten() {
            match named {
                Named::Item => _ = found.insert(Target::Item(module)),
                Named::Module(child) => _ = found.insert(Target::Module(*child)),
                Named::Import(path) => found.extend(self.resolve(module, path, seen)),
            }
        }
        if found.is_empty() {
            for glob in &is.globs {
                for target in self.resolve(module, glob, &mut seen.clone()) {
                    if let Target::Module(from) = target {
                        found.extend(self.look_up(from, name, seen));
                    }
                }
            }
        }
        found
    }

    /// The files that a path of a module leads to.
    fn files_of(&self, module: usize, path: &[String]) -> BTreeSet<usize> {
        let item = |target| match target {
            Target::Item(module) => Some(self.modules[module].file),
            Target::Module(_) | Target::Elsewhere => None,
        };
        self.resolve(module, path, &mut BTreeSet::new()).into_iter().filter_map(item).collect()
    }

    /// Each item that is no module, with its module and file.
    pub(super) fn items(&self, mut told: impl FnMut(usize, usize, &Item)) {
        for (id, module) in self.modules.iter().enumerate() {
            module.items.iter().for_each(|item| told(id, module.file, item));
        }
    }

    /// The file that defines what a path of a module names; `None` outside this crate.
    pub(super) fn file_of(&self, module: usize, path: &[String]) -> Option<usize> {
        self.files_of(module, path).into_iter().next()
    }

    /// A file's path.
    pub(super) fn path(&self, file: usize) -> String {
        self.files[file].0.to_str().unwrap().replace('\\', "/")
    }

    /// Whether a file's module is an ancestor of another's.
    fn is_above(&self, file: usize, other: usize) -> bool {
        let above = self.files[file].1;
        let mut at = self.modules[self.files[other].1].parent;
        while let Some(module) = at {
            if module == above {
                return true;
            }
            at = self.modules[module].parent;
        }
        false
    }

    /// The uses between files: (from, to) → names.
    fn uses(&self) -> BTreeMap<(usize, usize), BTreeSet<String>> {
        let mut uses: BTreeMap<(usize, usize), BTreeSet<String>> = BTreeMap::new();
        for (id, module) in self.modules.iter().enumerate() {
            let mut add = |path: &[String], only_listed: bool| {
                for to in self.files_of(id, path) {
                    if to != module.file && !(only_listed && self.is_above(module.file, to)) {
                        uses.entry((module.file, to)).or_default().insert(path.join("::"));
                    }
                }
            };
            module.imports.iter().for_each(|(path, only_listed)| add(path, *only_listed));
            let mut paths = Paths(BTreeSet::new());
            module.items.iter().for_each(|item| paths.visit_item(item));
            paths.0.iter().for_each(|path| add(path, false));
        }
        uses
    }

    /// Imports from this crate that could not be resolved: names are not found through them.
    pub(super) fn unresolved(&self) -> Vec<String> {
        let mut left = Vec::new();
        for (id, module) in self.modules.iter().enumerate() {
            let paths = module.imports.iter().map(|(path, _)| path).chain(&module.globs);
            for path in paths.filter(|path| path.first().is_some_and(|word| ["crate", "self", "super"].contains(&&**word))) {
                if self.resolve(id, path, &mut BTreeSet::new()).is_empty() {
                    left.push(format!("{}: {}", self.files[module.file].0.display(), path.join("::")));
                }
            }
        }
        left
    }

    /// All cycles between files except those of a module with its submodules.
    pub(super) fn circles(&self) -> Vec<Circle> {
        let uses = self.uses();
        let mut edges = Edges::new();
        for &(from, to) in uses.keys() {
            edges.entry(from).or_default().insert(to);
        }
        let found = circles(&edges, &|above, below| self.is_above(above, below));
        let path = |file: usize| self.path(file);
        found
            .into_iter()
            .map(|knot| Circle {
                files: knot.iter().map(|&file| path(file)).collect(),
                uses: uses
                    .iter()
                    .filter(|((from, to), _)| knot.contains(from) && knot.contains(to))
                    .map(|((from, to), names)| {
                        let names = names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
                        format!("{} → {} ({names})", path(*from), path(*to))
                    })
                    .collect(),
            })
            .collect()
    }
}
