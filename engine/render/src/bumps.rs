//! Splats as bumps, and the grid of cells that finds which of them reach a point.

use glam::{DMat3, DVec3, Mat3, UVec3, Vec3};

use passes::Lists;
use splat::{Activations, Field, Splat};

/// Greatest number of cells of the grid that finds neighbours.
const MOST_CELLS: f64 = 4e6;
/// q at the edge of what mode alpha draws for a splat.
const DRAWN_Q: f32 = 6.0;
/// Number of points in a splat.
pub(super) const POINTS: usize = 4;

/// A splat in the form that the sums need.
#[derive(Clone)]
pub(super) struct Bump {
    pub(super) mean: Vec3,
    /// S⁻¹Rᵀ; takes a distance to the whitened distance.
    pub(super) whitening: Mat3,
    /// Half size of the box around the support, mm.
    reach: Vec3,
    pub(super) amplitude: f32,
    /// Intensity relative to the background.
    pub(super) intensity: f32,
    /// R S, the splat's axes times its standard deviations.
    spans: DMat3,
}

impl Bump {
    pub(super) fn new(splat: &Splat, field: &Field) -> Self {
        let axes = splat.axes();
        let scale = DVec3::from_array(splat.scale().map(f64::from));
        let spans = axes * DMat3::from_diagonal(scale);
        let squares = (0..3).map(|k| spans.col(k) * spans.col(k)).sum::<DVec3>();
        let mean = Vec3::from_array(splat.mean);
        let peak = field.kernel.peak(splat.log_scale.map(f64::from));
        Bump {
            mean,
            whitening: (DMat3::from_diagonal(scale.recip()) * axes.transpose()).as_mat3(),
            reach: (squares * field.kernel.support_q().max(f64::from(DRAWN_Q))).map(f64::sqrt).as_vec3(),
            amplitude: (f64::from(splat.opacity()) * peak) as f32,
            intensity: splat.intensity - field.background,
            spans,
        }
    }

    /// Returns [`POINTS`] points in the splat: the corners of a regular tetrahedron in its whitened space, at the
    /// distance at which their mean is that over what is drawn for the splat, for functions up to the second degree.
    /// A splat that is moved or rounded has the same points, moved or rounded.
    pub(super) fn points(&self) -> [Vec3; POINTS] {
        // The mean of q in a ball of q < 6, and the squared length of a corner.
        let scale = (0.6 * f64::from(DRAWN_Q) / 3.0).sqrt();
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        corners
            .map(|corner| (self.mean.as_dvec3() + self.spans * (DVec3::from_array(corner) * scale)).as_vec3())
    }

    /// Returns the volume of the splat in units of one of a standard deviation of 1 mm.
    pub(super) fn volume(&self) -> f64 {
        self.spans.determinant().abs()
    }

    /// Returns the whitened distance of a place; `None` beyond the box around the support.
    pub(super) fn whitened(&self, place: Vec3) -> Option<Vec3> {
        let apart = place - self.mean;
        (!apart.abs().cmpgt(self.reach).any()).then(|| self.whitening * apart)
    }

    /// Returns the profile that mode alpha draws at a whitened distance, (1 − q/6)^{3/2}; 0 beyond its edge.
    pub(super) fn profile(u: Vec3) -> f32 {
        let t = (1.0 - u.length_squared() / DRAWN_Q).max(0.0);
        t * t.sqrt()
    }
}

/// A regular grid: for each cell the splats whose boxes meet it, and the points that lie in it.
pub(super) struct Cells {
    low: Vec3,
    edge: f32,
    counts: UVec3,
    /// Bumps whose boxes meet each cell.
    pub(super) members: Lists,
    /// Points in each cell.
    pub(super) inside: Lists,
}

impl Cells {
    /// Creates the grid for one or more bumps, and for points that lie about them.
    pub(super) fn new(bumps: &[Bump], points: &[Vec3]) -> Self {
        let mut sizes: Vec<f32> = bumps.iter().map(|b| b.reach.max_element()).collect();
        let middle = sizes.len() / 2;
        let typical = *sizes.select_nth_unstable_by(middle, f32::total_cmp).1;
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for bump in bumps {
            (low, high) = (low.min(bump.mean), high.max(bump.mean));
        }
        // A bump that reaches beyond the box of the centres counts in its outermost cells.
        let extent = high - low;
        let volume = (extent + typical).as_dvec3().element_product();
        let edge = typical.max((volume / MOST_CELLS).cbrt() as f32).max(f32::MIN_POSITIVE);
        let counts = (extent / edge).floor().as_uvec3() + 1;
        let mut cells = Cells { low, edge, counts, members: Lists::default(), inside: Lists::default() };
        let inside = Lists::new(cells.count(), |take| {
            for (i, point) in points.iter().enumerate() {
                take(cells.index(cells.at(*point)), i as u32);
            }
        });
        let members = Lists::new(cells.count(), |take| {
            for (i, bump) in bumps.iter().enumerate() {
                let (from, to) = (cells.at(bump.mean - bump.reach), cells.at(bump.mean + bump.reach));
                for z in from.z..=to.z {
                    for y in from.y..=to.y {
                        for x in from.x..=to.x {
                            take(cells.index(UVec3::new(x, y, z)), i as u32);
                        }
                    }
                }
            }
        });
        (cells.members, cells.inside) = (members, inside);
        cells
    }

    /// Returns the number of cells.
    pub(super) fn count(&self) -> usize {
        self.counts.element_product() as usize
    }

    fn at(&self, place: Vec3) -> UVec3 {
        ((place - self.low) / self.edge).floor().max(Vec3::ZERO).as_uvec3().min(self.counts - 1)
    }

    fn index(&self, cell: UVec3) -> usize {
        ((cell.z * self.counts.y + cell.y) * self.counts.x + cell.x) as usize
    }
}
