//! What AMD's compiler makes of the kernels: none of them may need more registers than there are.

use std::path::Path;

use bench::isa::{compiled, figure, recipes, spills};
use engine::Kind;
use engine::gpu::GpuOptions;

#[test]
fn no_kernel_spills_and_lit_slabs_have_eight_waves() {
    let recipes = recipes(&GpuOptions { validation: true, ..GpuOptions::default() }).expect("default runs");
    let names: Vec<String> = recipes.iter().map(|recipe| recipe.name()).collect();
    for needed in [
        "slab (GROUP = 64, SHADED)",
        "adam",
        "raymarch (MASKED, ATLAS, SHADED, KEPT)",
        "raymarch (MASKED, ATLAS, SHADED, OCCLUDED, GRADED, KEPT)",
        "alpha (CORNERS = 6)",
    ] {
        assert!(names.iter().any(|name| name == needed), "{needed} is not among {names:?}");
    }
    for family in ["navi21", "navi31"] {
        let made = match compiled(Path::new(env!("CARGO_BIN_EXE_bench")), &recipes, family) {
            Ok(made) => made,
            Err(e) if e.kind == Kind::Unavailable && std::env::var_os("CI").is_none() => {
                eprintln!("skipped: {e}");
                return;
            }
            Err(e) => panic!("{e}; {}", e.help),
        };
        assert_eq!(made.pipelines.len(), recipes.len());
        for (recipe, stage) in made.pipelines.iter().flat_map(|p| p.stages.iter().map(|s| (&p.recipe, s))) {
            let name = format!("{} on {}, {}", recipe.name(), made.device, stage.stage);
            assert!(figure(stage, "VGPRs") > Some(0.0), "{name}: {:?}", stage.figures);
            assert!(!spills(stage), "{name} spills: {:?}", stage.figures);
            if recipe.name().starts_with("slab") {
                assert!(figure(stage, "Subgroups per SIMD") >= Some(8.0), "{name}: {:?}", stage.figures);
            }
        }
    }
}
