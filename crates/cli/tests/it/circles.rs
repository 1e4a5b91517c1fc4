//! The files of a crate have no cyclic dependencies: if A uses B, directly or through others, B does not use A. A
//! module and its submodules form one subject and may use each other. The methods of one type have no cycle across files
//! either, there without exception: a type whose methods call each other from many files is no machine that can be read.

mod graph;
mod methods;
mod modules;
mod paths;

use std::path::Path;
use std::process::Command;

use methods::{files_of_methods, of_methods};
use modules::{Circle, Crate};

/// The roots of all crates of the workspace.
fn crates(mut told: impl FnMut(&Crate)) {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let workspace = Path::new(metadata["workspace_root"].as_str().unwrap());
    let read = |path: &Path| std::fs::read_to_string(workspace.join(path)).ok();
    for package in metadata["packages"].as_array().unwrap() {
        for target in package["targets"].as_array().unwrap() {
            if ["lib", "bin"].contains(&target["kind"][0].as_str().unwrap()) {
                let root = Path::new(target["src_path"].as_str().unwrap()).strip_prefix(workspace).unwrap();
                told(&Crate::read(root, &read));
            }
        }
    }
}

#[test]
fn files_have_no_circles() {
    let (mut told, mut unfollowed) = (Vec::new(), Vec::new());
    crates(|is| {
        unfollowed.extend(is.unresolved());
        for Circle { files, uses } in is.circles() {
            told.push(format!("{files:?}\n    {}", uses.join("\n    ")));
        }
    });
    assert!(told.is_empty(), "{} circles:\n{}", told.len(), told.join("\n"));
    // An unresolved name could hide a cycle.
    assert!(unfollowed.is_empty(), "where these lead is not seen:\n{}", unfollowed.join("\n"));
}

#[test]
fn methods_of_one_type_have_no_circles_across_files() {
    let mut told = Vec::new();
    crates(|is| {
        for Circle { files, uses } in of_methods(is) {
            told.push(format!("{files:?}\n    {}", uses.join("\n    ")));
        }
        let files = files_of_methods(is, "Pilot");
        assert!(files <= 2, "the methods of `Pilot` stand in {files} files");
    });
    assert!(told.is_empty(), "{} circles:\n{}", told.len(), told.join("\n"));
}

#[test]
fn a_circle_of_methods_is_found() {
    let of = |files: &[(&str, &str)]| {
        let read = |path: &Path| {
            let name = path.to_str().unwrap().replace('\\', "/");
            files.iter().find(|(at, _)| *at == name).map(|(_, text)| (*text).to_owned())
        };
        let is = Crate::read(Path::new("lib.rs"), &read);
        (of_methods(&is).len(), files_of_methods(&is, "A"))
    };
    let lib = ("lib.rs", "mod b; pub struct A; impl A { fn one(&self) { self.two() } fn four(&self) {} }");
    let back = |call: &'static str| of(&[lib, ("b.rs", call)]);
    assert_eq!(back("use crate::A; impl A { fn two(&self) {} }"), (0, 2));
    assert_eq!(back("use crate::A; impl A { fn two(&self) { self.three() } fn three(&self) { self.four() } }"), (1, 2));
    assert_eq!(back("use super::A; impl A { fn two(&self) { println!(\"{}\", self.four()) } }"), (1, 2));
    assert_eq!(back("use super::A; impl A { fn two(&self) { [1].map(Self::four) } }"), (1, 2));
    // Another type of this name, and a method of a field.
    assert_eq!(back("struct A; impl A { fn two(&self) { self.four() } fn four(&self) {} }"), (0, 2));
    assert_eq!(back("use crate::A; impl A { fn two(&self) { self.0.four() } }"), (0, 2));
}

/// The cycles of a made-up crate, each as the names of its files.
fn of(files: &[(&str, &str)]) -> Vec<String> {
    let read = |path: &Path| {
        let name = path.to_str().unwrap().replace('\\', "/");
        files.iter().find(|(at, _)| *at == name).map(|(_, text)| (*text).to_owned())
    };
    let names = |circle: Circle| circle.files.into_iter().collect::<Vec<_>>().join(" ");
    Crate::read(Path::new("lib.rs"), &read).circles().into_iter().map(names).collect()
}

#[test]
fn a_circle_is_found() {
    let two = [
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "use crate::b::B; pub struct A(B);"),
        ("b.rs", "use super::a::A; pub struct B(A);"),
    ];
    assert_eq!(of(&two), ["a.rs b.rs"]);
    // Without any `use`, through a third, and from within a macro.
    let three = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "pub fn a() { crate::b::b() }"),
        ("b.rs", "pub fn b() { println!(\"{}\", crate::c::Word::new().0) }"),
        ("c.rs", "pub struct Word(pub u8); impl Word { fn again() { use crate::a; a::a() } }"),
    ];
    assert_eq!(of(&three), ["a.rs b.rs c.rs"]);
}

#[test]
fn one_direction_is_no_circle() {
    let files = [
        ("lib.rs", "mod a; mod b; #[cfg(test)] mod tests;"),
        ("a.rs", "use crate::b::B; pub struct A(B);"),
        ("b.rs", "pub struct B; #[cfg(test)] mod tests { use crate::a::A; } #[cfg(test)] fn made() -> crate::a::A { loop {} }"),
    ];
    assert_eq!(of(&files), [""; 0]);
}

#[test]
fn a_module_and_those_below_it_may_use_each_other() {
    let files = [
        ("lib.rs", "mod a;"),
        ("a/mod.rs", "mod one; mod two; pub struct A(one::One); pub struct B; fn f() { two::two() }"),
        ("a/one.rs", "use super::{A, B, two::two}; pub struct One; fn f(_: A) { two() }"),
        ("a/two.rs", "mod deep; pub fn two() -> super::B { loop {} }"),
        ("a/two/deep.rs", "use crate::a::B;"),
    ];
    assert_eq!(of(&files), [""; 0]);
    // But its submodules may not use each other.
    let files = [files[0], files[1], files[2], ("a/two.rs", "pub fn two() -> super::one::One { loop {} }")];
    assert_eq!(of(&files), ["a/one.rs a/two.rs"]);
}

#[test]
fn a_circle_through_a_child_is_found() {
    let there = [
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "mod child; pub struct A; fn f() { child::f() }"),
        ("a/child.rs", "pub fn f() -> crate::b::B { loop {} }"),
        ("b.rs", "pub struct B(crate::a::A);"),
    ];
    assert_eq!(of(&there), ["a/child.rs a/mod.rs b.rs"]);
    let back = [
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "pub mod child; pub struct A; fn f() { crate::b::f() }"),
        ("a/child.rs", "use super::A; pub struct Child(A);"),
        ("b.rs", "use crate::a::child::Child; pub fn f() {}"),
    ];
    assert_eq!(of(&back), ["a/child.rs a/mod.rs b.rs"]);
}

#[test]
fn what_is_exported_again_is_where_it_is_defined() {
    let words = ("a/words.rs", "pub enum Word { Yes } pub struct Other;");
    // The parent lists it: b uses the words; the parent, which uses b, does not count as used.
    let listed = [
        ("lib.rs", "mod a; mod b; pub use a::Word;"),
        ("a/mod.rs", "mod words; pub use words::{Other as Another, *}; fn f() { crate::b::f() }"),
        words,
        ("b.rs", "use crate::a::{Another, Word::Yes}; pub fn f() -> crate::Word { Yes }"),
    ];
    assert_eq!(of(&listed), [""; 0]);
    // A cycle is thus detected behind a parent's list.
    let hidden = ("a/words.rs", "pub enum Word { Yes } pub struct Other(crate::b::B);");
    let circle = [listed[0], listed[1], hidden, ("b.rs", "pub struct B(crate::Word); pub fn f() {}")];
    assert_eq!(of(&circle), ["a/words.rs b.rs"]);
}

#[test]
fn what_a_macro_makes_is_where_it_is_called() {
    let files = [
        ("lib.rs", "mod a; mod b; mod keys;"),
        ("a.rs", "pub fn a() { crate::b::b() }"),
        ("b.rs", "use crate::keys::Made; pub fn b() {}"),
        ("keys.rs", "made! { Made: crate::a::a }"),
    ];
    assert_eq!(of(&files), ["a.rs b.rs keys.rs"]);
}

#[test]
fn files_are_found_where_the_compiler_finds_them() {
    let files = [
        ("lib.rs", "#[cfg(unix)] #[path = \"elsewhere.rs\"] mod a; #[cfg(not(unix))] mod a; mod within { pub mod b; }"),
        ("elsewhere.rs", "pub fn a() { crate::within::b::b() }"),
        ("a.rs", "pub fn a() {}"),
        ("within/b.rs", "pub fn b() { crate::a::a() }"),
    ];
    assert_eq!(of(&files), ["elsewhere.rs within/b.rs"]);
}
