//! The splats that a page is made of: as one set, for its look, and apart as the files that they are from.

use engine::splat::{self, Part, SplatSet};
use engine::{Error, Kind, Result};
use glam::DVec3;

use crate::names;
use crate::source::Source;

/// Part of the splats, as one file of them.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) source: Source,
    /// Label in the source, and number of the object in the page.
    pub(crate) numbers: Vec<[u8; 2]>,
}

/// All splats of a page.
#[derive(Clone, Debug)]
pub struct Splats {
    /// All of them as one set, whose labels are the numbers of the page's objects; its names are those of files and labels,
    /// by which users call objects.
    pub set: SplatSet,
    pub(crate) pieces: Vec<Piece>,
    /// Number of each object, and the name by which the page calls it.
    pub(crate) names: Vec<(u8, String)>,
}

/// Returns the sources of a scene's parts: of blocks, those that lie apart as one.
fn together(sources: Vec<Source>) -> Result<Vec<Source>> {
    let files = sources.iter().map(|source| (source.stem.clone(), source.set.clone()));
    let source = |part: Part| match &sources[part.file] {
        alone if alone.set == part.set => Source { stem: part.name, ..alone.clone() },
        _ => Source::of(part.name, part.set),
    };
    Ok(splat::parts(files.collect())?.into_iter().map(source).collect())
}

impl Splats {
    /// Joins the splats of files.
    ///
    /// # Errors
    /// [`Kind::BadData`] for splats with colours and no intensity, and the errors of [`splat::join`].
    pub fn join(sources: Vec<Source>) -> Result<Self> {
        if let Some(source) = sources.iter().find(|source| is_coloured(&source.set)) {
            let message = "splats with colours and no intensity, and a page shows intensities through a transfer function";
            return Err(Error::new(Kind::BadData, "VGS-PAGE-001", message).help(format!(
                "give splats of `vgs fit`; for viewers of colours write a .glb: vgs convert {} -o OUT.glb",
                source.stem
            )));
        }
        let sources = together(sources)?;
        let names = names::of_objects(&sources);
        let set = match &sources[..] {
            [source] => source.set.clone(),
            several => splat::join(several.iter().map(|s| (s.stem.clone(), s.set.clone())).collect())?,
        };
        let mut numbers = set.objects().into_iter().map(|object| object.number);
        let names = numbers.clone().zip(names).collect();
        let labels = |source: &Source| source.set.objects().into_iter().map(|object| object.number);
        let pieces = sources.into_iter().map(|source| {
            let numbers = labels(&source).zip(&mut numbers).map(|(label, number)| [label, number]).collect();
            Piece { source, numbers }
        });
        let pieces = pieces.collect();
        Ok(Splats { set, pieces, names })
    }

    /// Returns the splats for which `keep` is true, with their part of the region. It is told the number of the object and
    /// the mean, mm RAS.
    pub fn selected(self, keep: &(dyn Fn(u8, DVec3) -> bool + Sync)) -> Self {
        let Splats { set, pieces, names } = self;
        let set = part(&set, &|label| label, keep).unwrap_or(set);
        let mut kept = Vec::new();
        for Piece { source, numbers } in pieces {
            let number =
                |label| numbers.iter().find(|[own, _]| *own == label).map_or(label, |[_, number]| *number);
            let source = match part(&source.set, &number, keep) {
                Some(set) => Source::of(source.stem, set),
                None => source,
            };
            kept.extend((!source.set.is_empty()).then_some(Piece { source, numbers }));
        }
        let left: Vec<u8> = set.objects().iter().map(|object| object.number).collect();
        let names = names.into_iter().filter(|(number, _)| left.contains(number)).collect();
        Splats { set, pieces: kept, names }
    }
}

/// Returns the splats of a set for which `keep` is true, `number` being that of the object of a label; `None` if these are
/// all.
fn part(
    set: &SplatSet,
    number: &(dyn Fn(u8) -> u8 + Sync),
    keep: &(dyn Fn(u8, DVec3) -> bool + Sync),
) -> Option<SplatSet> {
    let part = set.part(|label, mean| keep(number(label), mean));
    Some(part).filter(|part| part.count() < set.count())
}

fn is_coloured(set: &SplatSet) -> bool {
    set.colours.is_some() || !set.unit.is_physical()
}

#[cfg(test)]
mod tests {
    use engine::splat::{Form, Grid, Region, Splat, block_name};

    use super::*;

    #[test]
    fn blocks_that_lie_apart_are_one_object_of_a_page() {
        let source_in = |folder: &str, first: u32| {
            let set = SplatSet {
                splats: vec![Splat { mean: [first as f32, 0.0, 0.0], ..Splat::default() }],
                grid: Some(Grid { size: [64, 1, 1], world_from_voxel: Default::default() }),
                form: Form::Grid,
                region: Region::of([64, 1, 1], |i| (i as u32 / 8 == first / 8).then_some(0)),
                ..SplatSet::default()
            };
            Source::of(format!("{folder}{}", block_name([first as usize, 0, 0])), set)
        };
        let source = |first| source_in("bone/", first);
        let splats = Splats::join([0, 8, 40, 48].map(source).to_vec()).expect("splats");
        assert_eq!(splats.names, [(1, "bone".to_owned()), (2, "bone (2)".to_owned())]);
        assert_eq!(
            splats.pieces.iter().map(|piece| piece.source.set.splats.len()).collect::<Vec<_>>(),
            [2, 2]
        );
        let splats = Splats::join([0, 40].map(source).to_vec()).expect("splats");
        assert_eq!((splats.names.len(), splats.set.splats.len()), (1, 2));
        // As where a shell is in their folder.
        let splats = Splats::join([0, 40].map(|first| source_in("", first)).to_vec()).expect("splats");
        assert_eq!((splats.names.len(), splats.set.splats.len()), (1, 2));
    }
}
