//! Figures of a CPU prototype (f32, AVX-512) of the paper's method and of ours, on the same cases, over
//! -1024..3071 HU: what `--profile paper` should reach with full batches, and how far either method gets at a
//! density.

/// Sweep of the density on one case.
pub struct Sweep {
    /// Folder of the case.
    pub folder: &'static str,
    /// Mask of the case.
    pub mask: &'static str,
    /// Splats per voxel, and the figures known there.
    pub densities: [Density; 6],
}

/// Figures at one density.
pub struct Density {
    /// Splats per ROI voxel.
    pub density: f64,
    /// Iterations of the paper's method, full batch.
    pub iterations: u32,
    /// Best PSNR of the paper's method, dB.
    pub paper: Option<f64>,
    /// PSNR of our method, fitted and measured on the grid alone, 200 iterations, dB.
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

/// Fit of the paper's method that `--profile paper` has to repeat.
pub struct Fidelity {
    /// Folder of the case.
    pub folder: &'static str,
    /// Mask of the case.
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

/// Fits with full batches and without density control.
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

/// Difference of a finding from `--profile paper` with full batches and without density control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// No difference.
    FullBatch,
    /// 1.6 % of the splats per step, and only these are rasterized.
    SubsetAlone,
    /// 1.6 % of the splats per step; all are rasterized.
    SubsetOfAll,
    /// Intensities are sampled from the volume.
    Sampled,
    /// The Gaussian has unit integral.
    DensityKernel,
    /// There is no mask term: λ_mask = 0.
    NoMask,
    /// The fit starts with half of the splats, and densification goes up to all.
    Densify,
}

/// Row of the findings: variant, splats per voxel, and the prototype's figures.
pub struct Finding {
    /// Difference from `--profile paper`.
    pub variant: Variant,
    /// Splats per ROI voxel of ct-torso-tiny mask_ts.
    pub density: f64,
    /// Best / last PSNR of the prototype, dB.
    pub prototype: &'static str,
}

const fn finding(variant: Variant, density: f64, prototype: &'static str) -> Finding {
    Finding { variant, density, prototype }
}

/// All findings.
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

/// Share of the splats in a mini-batch of the findings.
pub const SUBSET_SHARE: f64 = 0.016;
