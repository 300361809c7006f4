//! The steps of `bench gpu`: programs of this project with their arguments.

/// A step: what it tells, the commands that it runs one after the other, and the tables that they write.
pub struct Step {
    /// Name, by which `--only` chooses it.
    pub name: &'static str,
    /// What it tells.
    pub what: &'static str,
    /// Commands: a program of this project or `cargo`, then arguments. `{out}` is the folder of results, `{data}` that
    /// of scans, `{device}` the choice of a device.
    pub commands: Vec<String>,
    /// Markdown files that the commands write, in the folder of results.
    pub tables: Vec<&'static str>,
}

/// A case to be fitted: name, volume, mask, and further arguments of the fit.
type Case = (&'static str, &'static str, &'static str, &'static str);

/// Scans of `--data`.
const SCANS: [Case; 3] = [
    ("torso-bones", "ct-torso-3mm/ct.nii.gz", "ct-torso-3mm/mask_bones.nii.gz", ""),
    ("skull", "ct-skull/ct.nii.gz", "ct-skull/mask_skull.nii.gz", "--density 0.05"),
    ("heart", "ct-thorax-1p5mm/ct.nii.gz", "ct-thorax-1p5mm/mask_heart.nii.gz", ""),
];
/// Scans of full size.
const FULL: [Case; 2] = [
    ("abdomen-bones", "ct-abdomen-full/ct.nii.gz", "ct-abdomen-full/mask_bones.nii.gz", "--splats 250000"),
    ("chest-vessels", "ct-chest-full/ct.nii.gz", "ct-chest-full/mask_vessels.nii.gz", "--splats 250000"),
];
/// Edges of synthetic CTs in place of scans, and of the full-size one, voxels: usual ones and quick ones.
const PHANTOMS: [([usize; 3], usize); 2] = [([64, 128, 192], 384), ([16, 20, 24], 32)];

/// Returns all steps, the most telling first. With `has_data` they take the scans of `{data}`, else synthetic CTs; quick
/// ones prove that everything works.
pub fn steps(has_data: bool, quick: bool) -> Vec<Step> {
    let (small, full) = PHANTOMS[usize::from(quick)];
    let flag = if quick { " --quick" } else { "" };
    let few = if quick { " --iterations 20" } else { "" };
    let scans = |cases: &[Case]| -> Vec<String> {
        let fit = |(name, volume, mask, more): &Case| {
            format!(
                "vgs fit {{data}}/{volume} --roi {{data}}/{mask} -o {{out}}/splats/{name}.ply --force --json {more}{few}"
            )
        };
        cases.iter().map(|case| fit(case) + " {device}").collect()
    };
    let phantoms = |edges: &[usize], more: &str| -> Vec<String> {
        let commands = |edge: &usize| {
            let folder = format!("{{out}}/cases/phantom-{edge}");
            let splats = format!("{{out}}/splats/phantom-{edge}.ply");
            [
                format!("vgs phantom -o {folder} --size {edge} --force"),
                format!(
                    "vgs fit {folder}/ct.nii.gz --roi {folder}/mask.nii.gz -o {splats} --force --json{more}{few} {{device}}"
                ),
            ]
        };
        edges.iter().flat_map(commands).collect()
    };
    let names: Vec<String> = match has_data {
        true => SCANS.map(|(name, ..)| name.to_owned()).into(),
        false => small.map(|edge| format!("phantom-{edge}")).into(),
    };
    let files: Vec<String> = names.iter().map(|name| format!("{{out}}/splats/{name}.ply")).collect();
    let step = |name, what, commands: Vec<String>, tables: &[&'static str]| Step {
        name,
        what,
        commands,
        tables: tables.to_vec(),
    };
    let pictures = match has_data {
        true => format!("bench render --data {{data}} --out {{out}}/pictures{flag} {{device}}"),
        false => format!(
            "bench render --data {{out}} --config {{out}}/pictures.toml --out {{out}}/pictures{flag} {{device}}"
        ),
    };
    vec![
        step("devices", "The devices, as they describe themselves", vec!["vgs devices --json".into()], &[]),
        step(
            "tests",
            "Kernels against their f64 twins, sorting, gradients, shapes of workgroups; cargo and the sources are needed",
            vec![
                "cargo test --offline --locked --package vgs-tests --test oracle --test sorting --test gradients \
                 --test shapes --test descriptors"
                    .into(),
            ],
            &[],
        ),
        step(
            "passes",
            "Forward and backward pass of the fit",
            vec![format!(
                "bench passes --markdown {{out}}/passes.md --json {{out}}/passes.json --force{flag} {{device}}"
            )],
            &["passes.md"],
        ),
        step(
            "fits",
            "Three fits with the default profile",
            if has_data { scans(&SCANS) } else { phantoms(&small, "") },
            &[],
        ),
        step("pictures", "All modes: accuracy, speed, the paper's Table 5", vec![pictures], &["pictures/render.md"]),
        step(
            "headset",
            "Sessions in a simulated headset, with the quality levels that fit the budget",
            vec![format!(
                "bench xr {} --budgets {} --size {} --frames {} --markdown {{out}}/headset.md --json {{out}}/headset.json \
                 --plot {{out}}/headset.svg --force {{device}}",
                files[2],
                if quick { "200" } else { "8,11,50" },
                if quick { "32 32" } else { "1440 1440" },
                if quick { "20" } else { "300" },
            )],
            &["headset.md"],
        ),
        step(
            "full",
            "Fits of full size",
            match (has_data, quick) {
                (true, _) => scans(&FULL),
                (false, false) => phantoms(&[full], " --splats 250000"),
                (false, true) => phantoms(&[full], ""),
            },
            &[],
        ),
    ]
}
