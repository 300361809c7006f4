//! Figures of a CPU prototype (f32, AVX-512) of the paper's method and of ours, on the same cases, over -1024..3071 HU:
//! what `--profile paper` should come to, full batch, and how far either method gets at a density.

/// Where densities are swept.
pub struct Sweep {
    /// Folder of the case.
    pub folder: &'static str,
    /// Its mask.
    pub mask: &'static str,
    /// Splats per voxel, and what is known there.
    pub densities: [Density; 6],
}

/// What is known at one density.
pub struct Density {
    /// Splats per ROI voxel.
    pub density: f64,
    /// Iterations of the paper's method, full batch.
    pub iterations: u32,
    /// Its best PSNR, dB.
    pub paper: Option<f64>,
    /// Ours, fitted and measured on the grid alone, 200 iterations, dB.
    pub ours: Option<f64>,
}

const fn at(density: f64, iterations: u32, paper: Option<f64>, ours: Option<f64>) -> Density {
    Density { density, iterations, paper, ours }
}

/// Both sweeps.
pub const SWEEPS: [Sweep; 2] = [
    Sweep {
        folder: "ct-torso-tiny",
        mask: "mask_ts",
        densities: [
            at(0.005, 1000, None, None),
            at(0.01, 1000, None, Some(44.1)),
            at(0.02, 1000, Some(31.21), Some(47.4)),
            at(0.05, 1000, Some(32.94), Some(51.4)),
            at(0.1, 600, Some(33.27), Some(54.5)),
            at(0.25, 300, Some(33.13), None),
        ],
    },
    Sweep {
        folder: "ct-torso-3mm",
        mask: "mask_bones",
        densities: [
            at(0.005, 600, None, Some(32.1)),
            at(0.01, 600, None, Some(34.2)),
            at(0.02, 600, None, Some(37.3)),
            at(0.05, 600, None, Some(42.8)),
            at(0.1, 600, Some(27.85), Some(49.5)),
            at(0.25, 300, Some(27.65), Some(63.4)),
        ],
    },
];

/// A fit of the paper's method that `--profile paper` has to repeat.
pub struct Fidelity {
    /// Folder of the case.
    pub folder: &'static str,
    /// Its mask.
    pub mask: &'static str,
    /// Splats per ROI voxel.
    pub density: f64,
    /// Iterations.
    pub iterations: u32,
    /// Best PSNR, dB.
    pub best: f64,
    /// PSNR at the end, dB.
    pub last: Option<f64>,
}

/// Full batch, no change of topology.
pub const FIDELITY: [Fidelity; 3] = [
    Fidelity {
        folder: "ct-torso-tiny",
        mask: "mask_ts",
        density: 0.02,
        iterations: 1000,
        best: 31.21,
        last: Some(31.21),
    },
    Fidelity {
        folder: "ct-torso-tiny",
        mask: "mask_ts",
        density: 0.05,
        iterations: 1000,
        best: 32.94,
        last: Some(32.94),
    },
    Fidelity {
        folder: "ct-torso-3mm",
        mask: "mask_bones",
        density: 0.1,
        iterations: 600,
        best: 27.85,
        last: None,
    },
];

/// How a finding departs from `--profile paper`, full batch, without change of topology.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Not at all.
    FullBatch,
    /// 1.6 % of the splats a step, and nothing but these is rasterized.
    SubsetAlone,
    /// 1.6 % of the splats a step; all are rasterized.
    SubsetOfAll,
    /// Intensities are those of the volume.
    Sampled,
    /// The Gaussian of unit integral.
    DensityKernel,
    /// λ_mask = 0.
    NoMask,
    /// Half of the splats at first, densification up to all.
    Densify,
}

/// A row of the findings: what, splats per voxel, and the prototype's figures.
pub struct Finding {
    /// How it is run.
    pub variant: Variant,
    /// Splats per ROI voxel of ct-torso-tiny mask_ts.
    pub density: f64,
    /// The prototype's best / last, dB.
    pub prototype: &'static str,
}

const fn finding(variant: Variant, density: f64, prototype: &'static str) -> Finding {
    Finding { variant, density, prototype }
}

/// All rows.
pub const FINDINGS: [Finding; 13] = [
    finding(Variant::SubsetAlone, 0.02, "—"),
    finding(Variant::SubsetOfAll, 0.02, "—"),
    finding(Variant::FullBatch, 0.02, "31.21 / 31.21"),
    finding(Variant::Sampled, 0.02, "28.70 (the start) / 28.17, sampled once"),
    finding(Variant::DensityKernel, 0.02, "32.14 / 22.91"),
    finding(Variant::NoMask, 0.02, "32.71 / 31.44"),
    finding(Variant::SubsetOfAll, 0.05, "30.36"),
    finding(Variant::Densify, 0.05, "32.43"),
    finding(Variant::SubsetAlone, 0.1, "29.62 (the start) / 27.77"),
    finding(Variant::SubsetOfAll, 0.1, "—"),
    finding(Variant::FullBatch, 0.1, "33.27 after 600 iterations"),
    finding(Variant::Sampled, 0.1, "—"),
    finding(Variant::DensityKernel, 0.1, "—"),
];

/// Share of the splats in a subset of the findings.
pub const SUBSET_SHARE: f64 = 0.016;
