//! Asks a GPU's compiler, without the GPU, what it makes of the kernels: registers, spills, waves, instructions.
//!
//! A short fit and pictures in all modes, on the device at hand, tell which pipelines a default run creates. A
//! child process, which the runner starts with Mesa's driver for AMD GPUs, compiles these for one generation of
//! GPUs; such a driver is told its generation by its environment. Nothing runs on it.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use engine::fit::{self, Profile};
use engine::gpu::{Compiler, Executable, Gpu, GpuOptions, Recipe};
use engine::render::{Camera, Classification, Look, MODES, Renderer, Scene, Settings, VolumeSource};
use engine::transfer::{OpacityPoint, preset};
use engine::{Error, Kind, Result, output};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::report::{Outputs, Table};
use crate::scene;

/// Greatest subgroup size of the kernels for CPU drivers is 8; AMD's GPUs have 32 or 64.
const SUBGROUP: u32 = 64;

/// What a GPU's compiler makes of the kernels
#[derive(Args)]
pub struct IsaArguments {
    /// Generations of AMD GPUs, as RADV_FORCE_FAMILY names them: navi21 is RDNA 2, navi31 RDNA 3
    #[arg(long, value_delimiter = ',', default_values_t = ["navi21".to_owned(), "navi31".to_owned()])]
    family: Vec<String>,
    /// Lists pipelines with at least so many vector registers; those that spill are always listed
    #[arg(long, default_value_t = 64)]
    registers: u32,
    /// Compiles the pipelines of this file and prints what came of it as JSON: what the children do
    #[arg(long, value_name = "FILE", hide = true)]
    compile: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

/// What a driver made of all pipelines.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Compiled {
    /// The device and its driver.
    pub device: String,
    /// What was made of each pipeline.
    pub pipelines: Vec<Pipeline>,
}

/// What a driver made of one pipeline.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Pipeline {
    /// The pipeline.
    pub recipe: Recipe,
    /// Its stages.
    pub stages: Vec<Executable>,
}

/// Compiles all pipelines and prints the tables.
pub fn run(options: &GpuOptions, arguments: &IsaArguments) -> Result<()> {
    if let Some(file) = &arguments.compile {
        return compile(options, file);
    }
    eprintln!("a short fit and pictures in all modes, for their pipelines");
    let recipes = recipes(options)?;
    // The runner's loader is the executable, but the first argument is this program.
    let program = PathBuf::from(std::env::args_os().next().unwrap_or_default());
    let mut all = Vec::new();
    for family in &arguments.family {
        eprintln!("compiling {} pipelines for {family}", recipes.len());
        all.push(compiled(&program, &recipes, family)?);
    }
    let tables: Vec<Table> = all.iter().map(|compiled| compiled.table(arguments.registers)).collect();
    arguments.outputs.finish_with(&tables, &all)
}

/// Returns the pipelines that default runs create on a GPU: fits of both forms, and pictures in all modes on a
/// desktop and in a headset, classified in both ways, not lit, lit, and lit with ambient occlusion and gradient opacity.
///
/// # Errors
/// If the device at hand cannot run them.
pub fn recipes(options: &GpuOptions) -> Result<BTreeSet<Recipe>> {
    let options = GpuOptions { subgroup_size: Some(SUBGROUP), ..options.clone() };
    let gpu = Gpu::new(&options)?;
    let scene::Scene { volume, roi, .. } = scene::Scene::phantom(24)?;
    let mut set = None;
    for profile in ["field", "default"] {
        let mut config = Profile::named(profile)?.config()?;
        (config.iterations, config.count.density) = (2, 0.02);
        set = Some(fit::run(&gpu, &volume, &roi, &config, |_| ControlFlow::Continue(()))?);
    }
    let range = volume.min_max().map_or([0.0, 1.0], |(low, high)| [low, high].map(f64::from));
    let source = VolumeSource { volume: &volume, roi: Some(&roi) };
    let lit = |shade, occlusion| {
        let mut function = preset("CT-Bone")?.over(range);
        (function.material.shade, function.material.occlusion) = (shade, occlusion);
        Ok::<_, Error>(function)
    };
    let ramp = [(20.0, 0.0), (80.0, 1.0)].map(|(intensity, opacity)| OpacityPoint { intensity, opacity });
    let whole = lit(true, 0.5)?.with_gradient_opacity(ramp.into())?;
    let functions = [lit(false, 0.0)?, lit(true, 0.0)?, whole];
    let mut scene = Scene::new(&gpu, set.as_ref(), Some(&source), &Look::new(functions[0].clone()))?;
    let camera = Camera::from_side("anterior", DVec3::ZERO, 24.0, 30.0, 1.0)?;
    for function in functions {
        scene.set_look(&Look::new(function))?;
        for (mode, headset, classification) in MODES.iter().flat_map(|mode| {
            [false, true].into_iter().flat_map(move |headset| {
                [Classification::Point, Classification::PreIntegrated].map(|how| (mode, headset, how))
            })
        }) {
            let views = if headset { 2 } else { 1 };
            let classification = Some(classification);
            let usual = Settings::new([32; 2]);
            let settings = Settings { views, depth: headset, masked: headset, classification, ..usual };
            let mut renderer = Renderer::new(&gpu, mode, &scene, &settings)?;
            renderer.render(&scene, &vec![camera; views as usize])?;
        }
    }
    Ok(gpu.recipes())
}

/// Compiles the pipelines of a file and prints what came of it.
fn compile(options: &GpuOptions, file: &Path) -> Result<()> {
    let text = std::fs::read_to_string(file).map_err(|e| Error::io(file, "reading pipelines", &e))?;
    let wrong = |e: serde_json::Error| Error::new(Kind::Usage, "VGS-BEN-045", format!("no pipelines: {e}"));
    let recipes: Vec<Recipe> = serde_json::from_str(&text).map_err(wrong)?;
    let compiler = Compiler::new(options)?;
    let pipeline = |recipe: Recipe| Ok(Pipeline { stages: compiler.compile(&recipe)?, recipe });
    let pipelines = recipes.into_iter().map(pipeline).collect::<Result<Vec<_>>>()?;
    let made = Compiled { device: format!("{} ({})", compiler.name, compiler.driver), pipelines };
    println!("{}", serde_json::to_string(&made).expect("figures are JSON"));
    Ok(())
}

/// Returns what AMD's compiler makes of pipelines for a generation of GPUs, in a process of its own of `program`,
/// which is bench.
///
/// # Errors
/// Returns [`Kind::Unavailable`] if Mesa's driver for AMD GPUs is not set up.
pub fn compiled(program: &Path, recipes: &BTreeSet<Recipe>, family: &str) -> Result<Compiled> {
    let unavailable = |what: String| {
        Error::new(Kind::Unavailable, "VGS-BEN-046", what)
            .help("`tools/setup amd` brings Mesa's driver for AMD GPUs; start this through tools/run")
    };
    let runner = std::env::var_os("VGS_RUNNER")
        .ok_or_else(|| unavailable("a compiler for GPUs needs the runner of this project".into()))?;
    let folder = std::env::temp_dir().join(format!("vgs-isa-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "making a folder", &e))?;
    let file = folder.join(format!("{family}.json"));
    let text = serde_json::to_string(recipes).expect("recipes are JSON");
    output::write_atomic(&file, true, |w| w.write_all(text.as_bytes()))?;
    let child = Command::new(runner)
        .arg(program)
        .args(["isa", "--compile"])
        .arg(&file)
        .env("VGS_DRIVER", "amd")
        .env("RADV_FORCE_FAMILY", family)
        .stdin(Stdio::null())
        .output()
        .map_err(|e| Error::io(program, "starting the compiler", &e))?;
    let _ = std::fs::remove_dir_all(&folder);
    if !child.status.success() {
        let said = String::from_utf8_lossy(&child.stderr);
        return Err(unavailable(format!("nothing was compiled for {family}: {}", said.trim())));
    }
    serde_json::from_slice(&child.stdout)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-047", format!("the compiler's figures: {e}")))
}

/// What the table shows of a stage: titles, and the driver's names.
const COLUMNS: [(&str, &str); 8] = [
    ("vector registers", "VGPRs"),
    ("spilled: vector", "Spilled VGPRs"),
    ("scalar", "Spilled SGPRs"),
    ("scratch, bytes", "Scratch size"),
    ("LDS, bytes", "LDS size"),
    ("waves a SIMD", "Subgroups per SIMD"),
    ("instructions", "Instructions"),
    ("inverse throughput, cycles", "Inverse Throughput"),
];

/// Names of the figures that are 0 in a stage that fits the registers.
const SPILLS: [&str; 3] = ["Spilled VGPRs", "Spilled SGPRs", "Scratch size"];

/// Returns a figure of a stage by the driver's name; `None` if the driver does not tell it.
pub fn figure(stage: &Executable, name: &str) -> Option<f64> {
    stage.figures.iter().find(|(found, _)| found == name).map(|&(_, value)| value)
}

/// Returns true if a stage does not fit the registers.
pub fn spills(stage: &Executable) -> bool {
    SPILLS.iter().any(|name| figure(stage, name) != Some(0.0))
}

impl Compiled {
    /// Returns the stages that spill, or have at least so many vector registers, those with most first.
    fn table(&self, registers: u32) -> Table {
        let stages = || self.pipelines.iter().flat_map(|p| p.stages.iter().map(|stage| (&p.recipe, stage)));
        let used = |stage: &Executable| figure(stage, "VGPRs").unwrap_or(f64::INFINITY);
        let is_listed = |stage: &Executable| spills(stage) || used(stage) >= f64::from(registers);
        let mut listed: Vec<_> = stages().filter(|(_, stage)| is_listed(stage)).collect();
        listed.sort_by(|a, b| used(b.1).total_cmp(&used(a.1)));
        let row = |(recipe, stage): &(&Recipe, &Executable)| {
            let figures = COLUMNS.iter().map(|(_, name)| {
                figure(stage, name).map_or_else(|| "—".to_owned(), |value| format!("{value:.0}"))
            });
            [recipe.name(), stage.stage.clone()].into_iter().chain(figures).collect()
        };
        let rest = stages().count() - listed.len();
        let title = format!(
            "## What {} makes of the kernels\n\n{} pipelines of default runs. {rest} stages with less than {registers} vector \
             registers, which spill nothing and use no scratch, are not listed.",
            self.device,
            self.pipelines.len()
        );
        let columns = ["pipeline", "stage"].into_iter().chain(COLUMNS.iter().map(|&(title, _)| title));
        Table { title, columns: columns.collect(), rows: listed.iter().map(row).collect() }
    }
}
