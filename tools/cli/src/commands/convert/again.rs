//! What is done to splats before they are written: given back what another program has dropped, or fitted again.

use std::ops::ControlFlow;
use std::path::Path;

use engine::fit::evaluate::between_slices_of;
use engine::fit::{FitConfig, FitForm, Problem};
use engine::splat::{self, Form, Grid, ReadOptions, SplatSet};
use engine::{Error, Kind};

use super::arguments::ConvertArguments;
use crate::shared::failure::Stop;
use crate::shared::inputs::Case;
use crate::shared::splat_files::warn_of_another_volume;
use crate::shared::waiting::Waiting;

/// Returns `set` with what another program has dropped with the comments of vgs, from the original.
pub fn given_back(arguments: &ConvertArguments, set: SplatSet, original: &Path) -> Result<SplatSet, Stop> {
    let splats = arguments.first();
    let summary = splat::describe(splats, &ReadOptions::default())?;
    if summary.layout != splat::ply::ORDINARY {
        let message = "the file already has what --like would take from another";
        return Err(Error::new(Kind::Usage, "VGS-CLI-129", message)
            .file(splats)
            .help("leave out --like")
            .into());
    }
    let original = splat::read(original, &ReadOptions::default())?;
    if original.unit.is_physical() && !set.unit.is_physical() {
        tracing::warn!("{}: the other program kept only the grey of the intensities", splats.display());
    }
    Ok(set.with_statements_of(&original))
}

/// Returns `set` rounded to a coarse lattice and fitted again to the volume and region of the flags.
pub fn fitted_again(arguments: &ConvertArguments, set: &SplatSet, volume: &Path) -> Result<SplatSet, Stop> {
    let (case, _) = Case::read_labelled(volume, &arguments.read, &arguments.region())?;
    let between_slices = between_slices_of(set, &case.volume);
    let grid = match between_slices.finer(&case.volume) {
        Some(finer) => Grid::of_voxels(finer.size(), finer.world_from_voxel()),
        None => Grid::of_voxels(case.volume.size, case.volume.world_from_voxel),
    };
    if set.grid != Some(grid) {
        let message = format!("the splats were fitted on another grid than that of {}", volume.display());
        return Err(Error::new(Kind::Usage, "VGS-CLI-100", message)
            .file(arguments.first())
            .help("give the volume they were fitted to, or leave --volume out")
            .into());
    }
    warn_of_another_volume(set, &case.volume, volume);
    let config = FitConfig::default().with(|c| {
        c.kernel = set.field.kernel;
        c.epsilon = set.field.epsilon;
        c.loss.occupancy_w0 = set.field.occupancy_w0;
        c.samples.between_slices = between_slices;
        c.samples.form = if set.form == Form::Field { FitForm::Field } else { FitForm::Grid };
    });
    let problem = Problem::new(&case.volume, &case.roi, &config)?;
    let gpu = arguments.device.boot()?;
    let waiting = Waiting::on("fitting the rounded splats again");
    let mut going = |share| {
        waiting.at(share);
        ControlFlow::Continue(())
    };
    let splats = set.to_voxel(&grid.world_from_voxel);
    let fitted = problem.rounded_set(&gpu, &splats, 0, &mut going)?;
    Ok(SplatSet {
        iterations: set.iterations,
        labels: set.labels.clone(),
        label_names: set.label_names.clone(),
        ..fitted
    })
}
