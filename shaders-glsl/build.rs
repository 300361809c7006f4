//! Compiles every stage file with glslang (through shaderc), reflects it, and writes one table to `OUT_DIR`:
//! `shaders.rs` with a `Shader` per file, a module of constants per file that has some, and a compile-time
//! check that each struct which a shader shares with the host has the same fields at the same offsets in
//! `interface/src/types/mod.rs`.
//!
//! The unoptimised SPIR-V is reflected, because optimising drops names and unused bindings; the optimised one
//! is shipped.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use spirq::ReflectConfig;
use spirq::ty::{AccessType, DescriptorType, Type};
use spirq::var::Variable;

use constants::{Modules, list, module, read_constants};

mod constants;

/// The folders that hold shaders; `include/` holds the files that they share.
const FOLDERS: [&str; 6] = ["common", "fit", "headset", "picture", "render", "window"];
/// Endings of the files that are compiled, with the name of their stage for glslang and for the table.
const STAGES: [(&str, shaderc::ShaderKind, &str); 3] = [
    ("comp", shaderc::ShaderKind::Compute, "Compute"),
    ("vert", shaderc::ShaderKind::Vertex, "Vertex"),
    ("frag", shaderc::ShaderKind::Fragment, "Fragment"),
];

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    println!("cargo::rerun-if-changed=include");
    let compiler = shaderc::Compiler::new().expect("glslang starts");
    let mut structs = BTreeMap::new();
    let mut items = String::new();
    let mut names = Vec::new();
    let mut kernels = Vec::new();
    let mut plain_items = String::new();
    let mut modules = Modules::new();
    for file in list(&root.join("include")) {
        read_constants(&file, &root, &mut modules);
    }
    for folder in FOLDERS {
        println!("cargo::rerun-if-changed={folder}");
        for file in list(&root.join(folder)) {
            let ending = file.extension().unwrap_or_default().to_string_lossy().into_owned();
            let Some(&(_, kind, stage)) = STAGES.iter().find(|s| s.0 == ending) else { continue };
            let name = file.file_stem().expect("a file has a name").to_string_lossy().into_owned();
            let plain = compile(&compiler, &root, &file, kind, false);
            let optimised = compile(&compiler, &root, &file, kind, true);
            let file_name = format!("{name}.{ending}");
            fs::write(out.join(format!("{file_name}.spv")), optimised).expect("OUT_DIR is writable");
            fs::write(out.join(format!("{file_name}.plain.spv")), without_source(&plain))
                .expect("OUT_DIR is writable");
            plain_items += &format!(
                "({file_name:?}, include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file_name}.plain.spv\"))), "
            );
            let reflected = reflect(&file_name, &plain, &mut structs);
            read_constants(&file, &root, &mut modules);
            let workgroup = workgroup(&fs::read_to_string(&file).expect("a listed file is readable"));
            let item = match stage {
                "Compute" => name.to_uppercase(),
                _ => file_name.to_uppercase().replace('.', "_"),
            };
            writeln!(
                items,
                "/// `{folder}/{file_name}`\npub static {item}: Shader = Shader {{ name: {name:?}, \
                 stage: Stage::{stage}, folder: {folder:?}, \
                 spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file_name}.spv\")), {reflected}, \
                 workgroup: {workgroup:?} }};"
            )
            .unwrap();
            if stage == "Compute" {
                kernels.push(item.clone());
            }
            names.push(item);
        }
    }
    for (about, list, names) in [("shader", "ALL", names), ("kernel", "KERNELS", kernels)] {
        let names = amp(&names);
        writeln!(items, "/// Every compiled {about}.\npub static {list}: &[&Shader] = &[{names}];").unwrap();
    }
    writeln!(
        items,
        "/// Unoptimised SPIR-V with names, by file: what programs that study the kernels read.\n\
         pub static PLAIN: &[(&str, &[u8])] = &[{plain_items}];"
    )
    .unwrap();
    for (name, constants) in &modules {
        items += &module(name, constants);
    }
    for (name, fields) in &structs {
        items += &layout_check(name, fields);
    }
    fs::write(out.join("shaders.rs"), items).expect("OUT_DIR is writable");
}

/// Reads the workgroup of a kernel from `layout(local_size_x = 64) in;`; `None` if a specialisation constant
/// says its size.
fn workgroup(source: &str) -> Option<[u32; 3]> {
    let line = source.lines().find(|l| l.starts_with("layout(local_size_x = "))?;
    let inside = line.strip_prefix("layout(")?.split(')').next()?;
    let mut size = [1; 3];
    for (part, axis) in inside.split(", ").zip(&mut size) {
        *axis = part.split(" = ").nth(1)?.parse().ok()?;
    }
    Some(size)
}

fn amp(names: &[String]) -> String {
    names.iter().map(|n| format!("&{n}, ")).collect()
}

fn compile(
    compiler: &shaderc::Compiler,
    root: &Path,
    file: &Path,
    kind: shaderc::ShaderKind,
    optimise: bool,
) -> Vec<u8> {
    let mut options = shaderc::CompileOptions::new().expect("glslang has options");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    // Every Vulkan 1.2 and 1.3 driver reads SPIR-V 1.5.
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    options.set_warnings_as_errors();
    if optimise {
        options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    } else {
        options.set_optimization_level(shaderc::OptimizationLevel::Zero);
        options.set_generate_debug_info();
    }
    options.set_include_callback(|asked, _, from, _| {
        let path = root.join("include").join(asked);
        let content = fs::read_to_string(&path)
            .map_err(|e| format!("{from} includes {asked}, which is not in include/: {e}"))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.to_string_lossy().into_owned(), content })
    });
    let source = fs::read_to_string(file).expect("a listed file is readable");
    let shown = file.strip_prefix(root).unwrap_or(file).to_string_lossy().into_owned();
    match compiler.compile_into_spirv(&source, kind, &shown, "main", Some(&options)) {
        Ok(binary) => binary.as_binary_u8().to_vec(),
        // A build script speaks through a panic; the compiler's own text names file and line.
        Err(e) => panic!("\n{e}\n"),
    }
}

/// Returns SPIR-V without the text of its source and its line numbers: glslang cuts long texts anywhere, also inside
/// of a letter.
fn without_source(spirv: &[u8]) -> Vec<u8> {
    const HEADER: usize = 5 * 4;
    // OpSourceContinued, OpSource, OpSourceExtension, OpString, OpLine, OpNoLine.
    const SOURCE: [u16; 6] = [2, 3, 4, 7, 8, 317];
    let (header, mut rest) = spirv.split_at(HEADER);
    let mut kept = header.to_vec();
    while let &[low, high, words_low, words_high, ..] = rest {
        let length = 4 * usize::from(u16::from_le_bytes([words_low, words_high]));
        let (instruction, behind) = rest.split_at(length);
        if !SOURCE.contains(&u16::from_le_bytes([low, high])) {
            kept.extend(instruction);
        }
        rest = behind;
    }
    kept
}

/// The offset and name of each member of a struct, and the size of the whole.
type Fields = (Vec<(usize, String)>, usize);

fn reflect(name: &str, spirv: &[u8], structs: &mut BTreeMap<String, Fields>) -> String {
    let entry = ReflectConfig::new()
        .spv(spirv)
        .ref_all_rscs(true)
        .reflect()
        .unwrap_or_else(|e| panic!("{name}: cannot reflect: {e}"))
        .pop()
        .expect("one entry point");
    let mut bindings = BTreeMap::new();
    let mut push_bytes = 0;
    let mut constants = Vec::new();
    for var in &entry.vars {
        match var {
            Variable::Descriptor { name: binding, desc_bind, desc_ty, ty, .. } => {
                assert_eq!(desc_bind.set(), 0, "{name}: push descriptors are set 0");
                let (label, access, resource) = match desc_ty {
                    DescriptorType::StorageBuffer(access) => {
                        let Type::Struct(block) = ty else { panic!("{name}: a buffer block is a struct") };
                        let [member] = block.members.as_slice() else {
                            panic!("{name}: a buffer block holds one array")
                        };
                        let Type::Array(array) = &member.ty else {
                            panic!("{name}: a buffer block holds one array")
                        };
                        collect(&array.element_ty, structs);
                        let stride = array.stride.expect("a buffer array has a stride");
                        let label = member.name.clone().or_else(|| binding.clone());
                        (label, *access, format!("Resource::Buffer {{ stride: {stride} }}"))
                    }
                    DescriptorType::CombinedImageSampler() => {
                        (binding.clone(), AccessType::ReadOnly, "Resource::Texture".to_owned())
                    }
                    DescriptorType::StorageImage(access) => {
                        (binding.clone(), *access, "Resource::Image".to_owned())
                    }
                    other => panic!("{name}: {other:?} cannot be bound"),
                };
                let access = match access {
                    AccessType::ReadOnly => "Read",
                    AccessType::WriteOnly => "Write",
                    AccessType::ReadWrite => "ReadWrite",
                };
                let number = desc_bind.bind();
                let label = label.unwrap_or_default();
                bindings.insert(
                    number,
                    format!(
                        "Binding {{ number: {number}, name: {label:?}, access: Access::{access}, resource: {resource} }}, "
                    ),
                );
            }
            Variable::PushConstant { ty, .. } => {
                collect(ty, structs);
                push_bytes = ty.nbyte().expect("push constants have a size");
            }
            Variable::SpecConstant { name: constant, spec_id, .. } => {
                constants.push((*spec_id, constant.clone().unwrap_or_default()));
            }
            Variable::Input { .. } | Variable::Output { .. } => {}
        }
    }
    // For a pair of vertex and fragment shader, only all bindings together must count up.
    assert!(
        !name.ends_with(".comp") || bindings.keys().copied().eq(0..bindings.len() as u32),
        "{name}: bindings count up from 0"
    );
    // A constant that is also the workgroup size is listed twice, once without a name.
    constants.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.cmp(&a.1)));
    constants.dedup_by_key(|c| c.0);
    assert!(constants.iter().map(|c| c.0).eq(0..constants.len() as u32), "{name}: constants count up from 0");
    let bindings: String = bindings.into_values().collect();
    let constants: String = constants.iter().map(|c| format!("{:?}, ", c.1)).collect();
    format!("bindings: &[{bindings}], constants: &[{constants}], push_bytes: {push_bytes}")
}

/// Notes the layout of a struct and of the structs inside it.
fn collect(ty: &Type, structs: &mut BTreeMap<String, Fields>) {
    let Type::Struct(s) = ty else { return };
    let name = s.name.clone().expect("debug info names structs");
    let mut fields = Vec::new();
    for member in &s.members {
        collect(&member.ty, structs);
        fields.push((
            member.offset.expect("members have offsets"),
            member.name.clone().expect("debug info names members"),
        ));
    }
    let found = (fields, ty.nbyte().expect("shared structs have a size"));
    if let Some(before) = structs.insert(name.clone(), found.clone()) {
        assert_eq!(before, found, "two shaders disagree on struct {name}");
    }
}

fn layout_check(name: &str, (fields, size): &Fields) -> String {
    let mut check = format!("const _: () = {{\n    use crate::types::{name};\n");
    for (offset, field) in fields {
        writeln!(
            check,
            "    assert!(core::mem::offset_of!({name}, {field}) == {offset}, \
             \"{name}.{field}: offset differs from the shader\");"
        )
        .unwrap();
    }
    writeln!(
        check,
        "    assert!(size_of::<{name}>() == {size}, \"{name}: size differs from the shader\");\n}};"
    )
    .unwrap();
    check
}
