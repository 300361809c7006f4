//! Draws the picture of an evaluation, with its figures as the lines above the slices.

use std::path::Path;

use engine::Result;
use engine::fit::evaluate::Evaluation;
use engine::gpu::Gpu;
use engine::splat::SplatSet;

use super::sheet;
use super::solid::Solids;
use super::subject::Subject;
use crate::shared::figures::psnr;
use crate::shared::inputs::Case;

/// Returns the names of splats and volume as the title of a picture.
pub fn names(splats: &Path, volume: &Path) -> String {
    let [splats, volume] = [splats, volume].map(|p| p.file_name().unwrap_or_default().to_string_lossy());
    format!("{splats} and {volume}")
}

/// Writes the picture of an evaluation. Its slices meet at the voxel `at`, or in the middle of the region.
#[expect(clippy::too_many_arguments, reason = "what a picture shows, once")]
pub fn draw(
    path: &Path,
    force: bool,
    gpu: &Gpu,
    set: &SplatSet,
    case: &Case,
    at: Option<usize>,
    title: &str,
    evaluation: &Evaluation,
) -> Result<()> {
    let (range, on_grid, unit) = (evaluation.range, &evaluation.on_grid, evaluation.unit);
    let [low, high] = range;
    let mut psnr_line = format!("PSNR {} at the voxels", psnr(on_grid.psnr_db, range));
    if !evaluation.between.is_empty() {
        psnr_line += &format!(", {} between them at worst", psnr(evaluation.worst_psnr_db(), range));
    }
    psnr_line += &format!(" (over {low} to {high}{unit}); RMSE {:.1}{unit}", on_grid.rmse_hu);
    let size_line = format!(
        "{} splats for {} voxels; outline: soft Dice {:.4}",
        set.splats.len(),
        case.roi.voxel_count(),
        on_grid.soft_dice
    );
    let subject = Subject::new(gpu, set, &case.volume, &case.roi, at)?;
    let mut lines = vec![psnr_line, size_line];
    lines.extend(at.map(|i| {
        let [nx, ny, _] = case.volume.size;
        let error = subject.error(subject.centre);
        format!(
            "slices meet at the worst voxel, {} {} {}: {error:+.0}{unit}",
            i % nx,
            i / nx % ny,
            i / (nx * ny)
        )
    }));
    let solids = Solids::new(gpu, set, &subject, sheet::SOLID)?;
    sheet::write(path, force, &subject, &solids, title, &lines)
}
