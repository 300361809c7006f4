//! The splats that a page is made of: as one set, for its look, and apart as the files that they are from.

use engine::splat::{self, SplatSet};
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
    pub fn selected(self, keep: &dyn Fn(u8, DVec3) -> bool) -> Self {
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
fn part(set: &SplatSet, number: &dyn Fn(u8) -> u8, keep: &dyn Fn(u8, DVec3) -> bool) -> Option<SplatSet> {
    let part = set.part(|label, mean| keep(number(label), mean));
    Some(part).filter(|part| part.count() < set.count())
}

fn is_coloured(set: &SplatSet) -> bool {
    set.colours.is_some() || !set.unit.is_physical()
}
