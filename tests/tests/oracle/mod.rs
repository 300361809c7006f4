//! Every kernel alone against its f64 reference in `reference`, on the same inputs.
//!
//! The list below is the list of kernels, and that of the losses is the table of the engine: a `.comp` file without a
//! test here fails `every_kernel_has_a_test`, by name.

mod bins;
mod deconvolution;
mod hidden;
mod occupancy;
mod optimiser;
mod picture;
mod quads;
mod raymarch;
mod slab;
mod sorting;
mod volume;

macro_rules! oracle {
    ($($module:ident: $($kernel:ident)*;)*) => {
        $($(
            #[test]
            fn $kernel() {
                $module::$kernel();
            }
        )*)*

        #[test]
        fn every_kernel_has_a_test() {
            let losses = engine::passes::loss::TERMS.iter().map(|term| term.shader.name);
            let tested: Vec<_> = [$($(stringify!($kernel)),*),*].into_iter().chain(losses).collect();
            let kernels: Vec<_> = shaders_glsl::KERNELS.iter().map(|s| s.name).collect();
            for kernel in &kernels {
                assert!(
                    tested.contains(kernel),
                    "{kernel}.comp has no test: add it to `oracle!` in {}",
                    file!()
                );
            }
            for test in tested {
                assert!(kernels.contains(&test), "`oracle!` in {} tests {test}, which is no kernel", file!());
            }
        }
    };
}

oracle! {
    sorting: scan_sums scan_offsets scan_apply radix_count radix_scatter sum_triples;
    bins: splat_bounds emit_pairs brick_ranges pair_masks cell_masks;
    volume: splat_to_volume overlap_sums splat_to_volume_grad moments_to_grad;
    optimiser: adam gather_rows scatter_rows;
    picture: picture_project picture_pairs picture_blend picture_ssim picture_loss_grad picture_blend_grad
        picture_project_grad adam_harmonics;
    quads: project_quads;
    deconvolution: deconvolve_points deconvolve_splats;
    hidden: hidden_parts;
    slab: mark_active limit_active list_active project_splats emit_tile_pairs slab;
    occupancy: occupancy_mark occupancy_spread list_faces;
    raymarch: voxel_gradients raymarch;
}

/// The kernels of all losses.
#[test]
fn losses() {
    volume::losses();
}

/// Records one pass, runs it and waits.
fn run(gpu: &engine::gpu::Gpu, record: impl FnOnce(&mut engine::gpu::Recorder)) {
    let mut recorder = gpu.record().expect("a recorder");
    record(&mut recorder);
    let ticket = recorder.submit().expect("submitting");
    gpu.wait(ticket).expect("waiting");
}
