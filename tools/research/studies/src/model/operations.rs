//! Operations of the kernels, counted in their SPIR-V.
//!
//! An addition, multiplication, comparison or conversion of a component is one operation, so that a fused multiply-add is
//! two, as in the makers' figures; a division, a root, an exponential or a logarithm is eight, the time of four fused
//! multiply-adds, at which GPUs' units for these run. Loads, stores and addresses count nothing: bytes are counted
//! elsewhere. Both sides of a branch count, as a group in lockstep takes both, but for branches that specialisation
//! constants decide.
//!
//! A loop whose number of rounds is a constant counts as often as it runs; where the source asks for it to be unrolled,
//! its integers are constants and cost nothing. Other loops are told apart by the name of
//! their variable: `main/block/round` is one round of the loop over `round` inside the loop over `block`, without the
//! loops inside.

use std::collections::{BTreeMap, BTreeSet};

use rspirv::dr::{self, Block, Function, Instruction, Module, Operand};
use rspirv::spirv::{self, GlslStd450Op as Library, Op, Word};
use shaders_glsl::{PLAIN, Shader, Stage};

/// Operations of a division, a root, an exponential or a logarithm.
const DEAR: f64 = 8.0;

/// Operations of one invocation of a shader, by loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Operations(BTreeMap<String, f64>);

impl Operations {
    /// Counts a shader whose specialisation constants have these values, and else those of its source. Functions
    /// named in `apart` count nothing where they are called; their own operations are found by their name.
    ///
    /// # Panics
    /// If the shader has no such constant or function; tests count all that is counted.
    pub fn of(shader: &Shader, constants: &[(&str, u32)], apart: &[&str]) -> Self {
        let ending = match shader.stage {
            Stage::Compute => "comp",
            Stage::Vertex => "vert",
            Stage::Fragment => "frag",
        };
        let file = format!("{}.{ending}", shader.name);
        let (_, words) = PLAIN.iter().find(|(name, _)| *name == file).expect("every shader has its SPIR-V");
        let module = dr::load_bytes(words).unwrap_or_else(|e| panic!("{file}: {e}"));
        let known = constants.iter().map(|&(name, value)| {
            let id = shader.constants.iter().position(|known| *known == name);
            (id.unwrap_or_else(|| panic!("{file} has no constant {name}")) as u32, value)
        });
        let source = Source::new(&module, known.collect());
        let mut found = BTreeMap::new();
        for name in ["main"].iter().chain(apart) {
            let function = source.function(name).unwrap_or_else(|| panic!("{file} has no function {name}"));
            for (path, count) in source.count(function, apart) {
                found.insert(join(name, &path), count);
            }
        }
        Operations(found)
    }

    /// Returns the operations of one round of a loop, or of a function outside of its loops.
    ///
    /// # Panics
    /// If there is no such loop, as where the source has changed.
    pub fn at(&self, path: &str) -> f64 {
        *self.0.get(path).unwrap_or_else(|| panic!("no {path} among {:?}", self.0.keys()))
    }
}

/// Returns "a/b"; one of the two where the other is empty.
fn join(a: &str, b: &str) -> String {
    [a, b].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("/")
}

/// A module with what is known of its identifiers.
struct Source<'a> {
    module: &'a Module,
    names: BTreeMap<Word, String>,
    /// Values of constants: of 32-bit integers, and 1 and 0 of true and false.
    values: BTreeMap<Word, u32>,
    /// Type of every value.
    types: BTreeMap<Word, Word>,
    /// Components of vectors and matrices.
    widths: BTreeMap<Word, f64>,
}

/// A loop of a function.
struct Loop {
    blocks: BTreeSet<Word>,
    /// True if the source asks for it to be unrolled: then its integers are constants.
    unrolled: bool,
    /// Rounds, where a constant says how many.
    rounds: Option<f64>,
    /// Name of its variable.
    name: String,
}

impl<'a> Source<'a> {
    fn new(module: &'a Module, constants: BTreeMap<u32, u32>) -> Self {
        let text = |instruction: &Instruction| match instruction.operands.as_slice() {
            [Operand::IdRef(id), Operand::LiteralString(name)] => Some((*id, name.clone())),
            _ => None,
        };
        let names =
            module.debug_names.iter().filter(|i| i.class.opcode == Op::Name).filter_map(text).collect();
        let ids: BTreeMap<Word, u32> = module
            .annotations
            .iter()
            .filter_map(|i| match i.operands.as_slice() {
                [
                    Operand::IdRef(id),
                    Operand::Decoration(spirv::Decoration::SpecId),
                    Operand::LiteralBit32(number),
                ] => Some((*id, *number)),
                _ => None,
            })
            .collect();
        let mut source = Source {
            module,
            names,
            values: BTreeMap::new(),
            types: BTreeMap::new(),
            widths: BTreeMap::new(),
        };
        for i in module.all_inst_iter() {
            if let (Some(id), Some(of)) = (i.result_id, i.result_type) {
                source.types.insert(id, of);
            }
        }
        for i in &module.types_global_values {
            let Some(id) = i.result_id else { continue };
            let width = |of: Word| source.widths.get(&of).copied().unwrap_or(1.0);
            match (i.class.opcode, i.operands.as_slice()) {
                (Op::TypeVector | Op::TypeMatrix, [Operand::IdRef(part), Operand::LiteralBit32(n)]) => {
                    let whole = width(*part) * f64::from(*n);
                    source.widths.insert(id, whole);
                }
                _ => {
                    let chosen = ids.get(&id).and_then(|number| constants.get(number));
                    if let Some(value) = chosen.copied().or_else(|| source.constant(i)) {
                        source.values.insert(id, value);
                    }
                }
            }
        }
        source
    }

    /// Returns the value of a constant, where it is an integer or a truth.
    fn constant(&self, i: &Instruction) -> Option<u32> {
        let value = |k: usize| self.values.get(&i.operands.get(k)?.id_ref_any()?).copied();
        match (i.class.opcode, i.operands.as_slice()) {
            (Op::Constant | Op::SpecConstant, [Operand::LiteralBit32(value)]) => Some(*value),
            (Op::ConstantTrue | Op::SpecConstantTrue, _) => Some(1),
            (Op::ConstantFalse | Op::SpecConstantFalse, _) => Some(0),
            (Op::SpecConstantOp, [Operand::LiteralSpecConstantOpInteger(op), ..]) => match op {
                Op::IEqual => Some(u32::from(value(1)? == value(2)?)),
                Op::INotEqual => Some(u32::from(value(1)? != value(2)?)),
                Op::LogicalAnd => Some(value(1)? & value(2)?),
                Op::LogicalOr => Some(value(1)? | value(2)?),
                Op::LogicalNot => Some(1 - value(1)?),
                Op::IAdd => Some(value(1)?.wrapping_add(value(2)?)),
                Op::ISub => Some(value(1)?.wrapping_sub(value(2)?)),
                Op::IMul => Some(value(1)?.wrapping_mul(value(2)?)),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns the function of that name.
    fn function(&self, name: &str) -> Option<&'a Function> {
        self.module.functions.iter().find(|f| self.name_of(f) == name)
    }

    /// Returns the name of a function without its parameters.
    fn name_of(&self, function: &Function) -> &str {
        let id = function.def.as_ref().and_then(|i| i.result_id);
        let name = id.and_then(|id| self.names.get(&id)).map_or("", String::as_str);
        name.split('(').next().unwrap_or(name)
    }

    /// Counts a function with all that it calls, by loop.
    fn count(&self, function: &Function, apart: &[&str]) -> BTreeMap<String, f64> {
        let blocks: BTreeMap<Word, &Block> = function
            .blocks
            .iter()
            .filter_map(|block| Some((block.label.as_ref()?.result_id?, block)))
            .collect();
        let Some(entry) = function.blocks.first().and_then(|b| b.label.as_ref()?.result_id) else {
            return BTreeMap::new();
        };
        let live = self.reached(&blocks, entry, None);
        let mut loops: Vec<Loop> = live.iter().filter_map(|&at| self.read_loop(&blocks, at)).collect();
        // The outer ones first.
        loops.sort_by_key(|l| std::cmp::Reverse(l.blocks.len()));
        let mut found = BTreeMap::from([(String::new(), 0.0)]);
        for label in &live {
            let around = loops.iter().filter(|l| l.blocks.contains(label));
            let (mut path, mut times, mut unrolled) = (String::new(), 1.0, false);
            for l in around {
                unrolled |= l.unrolled;
                match l.rounds {
                    Some(rounds) => times *= rounds,
                    None => path = join(&path, &l.name),
                }
            }
            let mut add = |path: String, count: f64| *found.entry(path).or_insert(0.0) += times * count;
            for i in &blocks[label].instructions {
                if i.class.opcode != Op::FunctionCall {
                    let is_free = unrolled && is_of_integers(i.class.opcode);
                    add(path.clone(), if is_free { 0.0 } else { self.operations(i) });
                    continue;
                }
                let called = i.operands.first().and_then(Operand::id_ref_any);
                let callee = self
                    .module
                    .functions
                    .iter()
                    .find(|f| f.def.as_ref().is_some_and(|def| def.result_id == called));
                let callee = callee.filter(|f| !apart.contains(&self.name_of(f)));
                for (inner, count) in callee.map(|f| self.count(f, apart)).unwrap_or_default() {
                    add(join(&path, &inner), count);
                }
            }
        }
        found
    }

    /// Returns the blocks that can be reached from one of them without passing through `wall`.
    fn reached(&self, blocks: &BTreeMap<Word, &Block>, from: Word, wall: Option<Word>) -> BTreeSet<Word> {
        let mut found = BTreeSet::new();
        let mut open = vec![from];
        while let Some(at) = open.pop() {
            if Some(at) != wall && found.insert(at) {
                open.extend(blocks[&at].instructions.last().map(|i| self.targets(i)).unwrap_or_default());
            }
        }
        found
    }

    /// Returns where a block may go on.
    fn targets(&self, last: &Instruction) -> Vec<Word> {
        let ids: Vec<Word> = last.operands.iter().filter_map(Operand::id_ref_any).collect();
        match (last.class.opcode, ids.as_slice()) {
            (Op::Branch, [to]) => vec![*to],
            (Op::BranchConditional, [condition, yes, no, ..]) => match self.values.get(condition) {
                Some(0) => vec![*no],
                Some(_) => vec![*yes],
                None => vec![*yes, *no],
            },
            (Op::Switch, [_, to @ ..]) => to.to_vec(),
            _ => Vec::new(),
        }
    }

    /// Returns the loop that begins at a block; nothing if none does.
    fn read_loop(&self, blocks: &BTreeMap<Word, &Block>, header: Word) -> Option<Loop> {
        let head = blocks[&header].instructions.iter().find(|i| i.class.opcode == Op::LoopMerge)?;
        let merge = head.operands.first()?.id_ref_any()?;
        let inside = self.reached(blocks, header, Some(merge));
        // The condition stands in the first block that may leave.
        let mut at = header;
        let condition = loop {
            let last = blocks[&at].instructions.last()?;
            match self.targets(last).as_slice() {
                [next] if inside.contains(next) => at = *next,
                _ => break &blocks[&at].instructions,
            }
        };
        let load = condition.iter().find(|i| i.class.opcode == Op::Load)?;
        let variable = load.operands.first()?.id_ref_any()?;
        let name = self.names.get(&variable).cloned().unwrap_or_default();
        let bound = condition.iter().find_map(|i| match (i.class.opcode, i.operands.as_slice()) {
            (Op::ULessThan | Op::SLessThan, [Operand::IdRef(left), Operand::IdRef(right)])
                if Some(*left) == load.result_id =>
            {
                self.values.get(right).copied()
            }
            _ => None,
        });
        let unrolled = head.operands.iter().any(|operand| {
            matches!(operand, Operand::LoopControl(control) if control.contains(spirv::LoopControl::UNROLL))
        });
        Some(Loop { blocks: inside, unrolled, rounds: bound.map(f64::from), name })
    }

    /// Returns the components of the value of an operand.
    fn width(&self, operand: Option<&Operand>) -> f64 {
        let of = operand.and_then(Operand::id_ref_any).and_then(|id| self.types.get(&id));
        of.and_then(|of| self.widths.get(of)).copied().unwrap_or(1.0)
    }

    /// Returns the operations of one instruction.
    fn operations(&self, i: &Instruction) -> f64 {
        let whole = i.result_type.and_then(|of| self.widths.get(&of)).copied().unwrap_or(1.0);
        let [first, second] = [0, 1].map(|k| self.width(i.operands.get(k)));
        match i.class.opcode {
            Op::FDiv | Op::UDiv | Op::SDiv | Op::UMod | Op::SRem | Op::SMod | Op::FMod | Op::FRem => {
                DEAR * whole
            }
            Op::Dot => 2.0 * first - 1.0,
            // A product and, but for the first column, a sum for every element of the matrix.
            Op::MatrixTimesVector => 2.0 * first - whole,
            Op::VectorTimesMatrix => 2.0 * second - whole,
            Op::Any | Op::All => first - 1.0,
            Op::ExtInst => match i.operands.get(1) {
                Some(Operand::LiteralExtInstInteger(op)) => {
                    let wide = self.width(i.operands.get(2));
                    Library::from_u32(*op).map_or(whole, |op| library(op, whole, wide))
                }
                _ => whole,
            },
            Op::IAdd
            | Op::ISub
            | Op::IMul
            | Op::FAdd
            | Op::FSub
            | Op::FMul
            | Op::SNegate
            | Op::FNegate
            | Op::VectorTimesScalar
            | Op::MatrixTimesScalar
            | Op::IEqual
            | Op::INotEqual
            | Op::ULessThan
            | Op::ULessThanEqual
            | Op::UGreaterThan
            | Op::UGreaterThanEqual
            | Op::SLessThan
            | Op::SLessThanEqual
            | Op::SGreaterThan
            | Op::SGreaterThanEqual
            | Op::FOrdEqual
            | Op::FOrdNotEqual
            | Op::FUnordNotEqual
            | Op::FOrdLessThan
            | Op::FOrdLessThanEqual
            | Op::FOrdGreaterThan
            | Op::FOrdGreaterThanEqual
            | Op::LogicalAnd
            | Op::LogicalOr
            | Op::LogicalNot
            | Op::BitwiseAnd
            | Op::BitwiseOr
            | Op::BitwiseXor
            | Op::Not
            | Op::ShiftLeftLogical
            | Op::ShiftRightLogical
            | Op::ShiftRightArithmetic
            | Op::BitCount
            | Op::ConvertFToU
            | Op::ConvertFToS
            | Op::ConvertSToF
            | Op::ConvertUToF
            | Op::FConvert
            | Op::Select
            | Op::AtomicIAdd
            | Op::GroupNonUniformAny
            | Op::GroupNonUniformAll
            | Op::GroupNonUniformFMin
            | Op::GroupNonUniformFMax => whole,
            _ => 0.0,
        }
    }
}

/// Returns true if an instruction only counts and compares integers.
fn is_of_integers(op: Op) -> bool {
    matches!(op, Op::IAdd | Op::ISub | Op::IMul | Op::IEqual | Op::INotEqual | Op::ULessThan | Op::SLessThan)
}

/// Returns the operations of a function of GLSL's library, whose result has `whole` components and its first argument
/// `wide`.
fn library(op: Library, whole: f64, wide: f64) -> f64 {
    match op {
        Library::Sqrt
        | Library::InverseSqrt
        | Library::Exp
        | Library::Log
        | Library::Exp2
        | Library::Log2 => DEAR * whole,
        Library::Pow => 2.0 * DEAR * whole,
        Library::Length => 2.0 * wide - 1.0 + DEAR,
        Library::Normalize => 3.0 * wide - 1.0 + DEAR,
        Library::Cross => 9.0,
        Library::FMix => 3.0 * whole,
        Library::Fma | Library::FClamp | Library::UClamp | Library::SClamp => 2.0 * whole,
        // A conversion and a factor each.
        Library::UnpackUnorm2x16 | Library::UnpackUnorm4x8 | Library::UnpackSnorm2x16 => 2.0 * whole,
        _ => whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_functions_and_constants_are_told_apart() {
        let slab = |shaded: u32| Operations::of(&shaders_glsl::SLAB, &[("SHADED", shaded)], &["add"]);
        let [plain, lit] = [0, 1].map(slab);
        for path in ["main", "main/block", "main/block/round", "main/block/round/i", "add"] {
            assert!(plain.at(path) > 0.0, "{path}");
        }
        // Sixteen evaluations of one call: by hand 13 for each, 14 for each plane and four pixels, 12 for each pixel and
        // four planes.
        let each = plain.at("add") / 16.0;
        assert!((15.0..30.0).contains(&each), "{each}");
        assert!(lit.at("add") > 1.8 * plain.at("add"), "{plain:?} {lit:?}");
        assert_eq!(plain.at("main/block/round/i"), lit.at("main/block/round/i"));
    }

    #[test]
    fn what_a_branch_on_a_constant_leaves_out_is_not_counted() {
        let standard =
            |value: u32| Operations::of(&shaders_glsl::ALPHA_FRAG, &[("STANDARD", value)], &[]).at("main");
        // A dot product of two components; two products, an exponential and the smaller one of two; two comparisons and
        // a choice; four products for the colour.
        assert_eq!(standard(1), 3.0 + (2.0 + 8.0 + 1.0) + (2.0 + 1.0) + 4.0);
        assert!(standard(0) != standard(1));
    }
}
