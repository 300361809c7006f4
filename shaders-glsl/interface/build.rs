//! Writes one file to `OUT_DIR`, `constants.rs`: a module for each file of `../include` that has constants.

use std::path::PathBuf;
use std::{env, fs};

use constants::{Modules, list, module, read_constants};

#[path = "../constants.rs"]
mod constants;

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("..");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    println!("cargo::rerun-if-changed=../include");
    println!("cargo::rerun-if-changed=../constants.rs");
    let mut modules = Modules::new();
    for file in list(&root.join("include")) {
        read_constants(&file, &root, &mut modules);
    }
    let items: String = modules.iter().map(|(name, constants)| module(name, constants)).collect();
    fs::write(out.join("constants.rs"), items).expect("OUT_DIR is writable");
}
