//! The lattice that splats are rounded to: each parameter in steps that change the field about alike.
//!
//! With Σ = CCᵀ and C lower triangular (Cholesky), a change dC changes the splat by C⁻¹dC in units of its own
//! widths. So the diagonal of C is rounded to powers of a ratio, an entry beside it to steps of the diagonal
//! entry of its row times ratio − 1, and a coordinate of the mean to a part of the width of the splat along
//! that axis. A needle gets finer steps than a ball by itself. The opacity is rounded to even steps of ln α,
//! the intensity to even steps.
//!
//! Numbers that decide how many steps there are come from +, −, ×, ÷ and √ alone: every machine finds the same.

use glam::{DMat3, DVec3};

use super::rounding::Steps;
use crate::space::reshaped;
use crate::{Activations, Splat};

/// Greatest |code| of any parameter.
pub const CODE_LIMIT: i32 = 1 << 26;
/// Greatest |ln| of a diagonal entry.
const LOG_LIMIT: f64 = 42.0;
/// Greatest −ln α.
const FAINTEST: f64 = 20.0;
/// Greatest number of steps of a coordinate in a cell.
const MOST_STEPS: f64 = 65536.0;
/// Number of codes of a splat without its place: six of the shape, opacity, intensity.
pub const CODES: usize = 8;

/// The lattice of some steps.
pub struct Lattice {
    steps: Steps,
    /// Powers of the ratio from −`last` to `last`.
    powers: Vec<f64>,
    last: i32,
}

impl Lattice {
    /// Creates the lattice; `None` if a step cannot be used.
    pub fn new(steps: Steps) -> Option<Self> {
        let good = |v: f64, low: f64, high: f64| (low..=high).contains(&v);
        let usable = good(steps.mean, 1e-4, 2.0)
            && good(steps.ratio, 1.0001, 2.0)
            && good(steps.opacity, 1e-4, 2.0)
            && good(steps.intensity, 1e-30, 1e30);
        usable.then_some(())?;
        let (mut up, mut down) = (vec![1.0], Vec::new());
        let most = LOG_LIMIT.exp();
        while up[up.len() - 1] < most {
            let power = up[up.len() - 1] * steps.ratio;
            up.push(power);
            down.push(1.0 / power);
        }
        let last = down.len() as i32;
        down.reverse();
        down.extend(up);
        Some(Lattice { steps, powers: down, last })
    }

    /// Returns the codes of everything but the place of `splat`: a, b, c, d, e, f of C by rows, opacity,
    /// intensity.
    pub fn codes(&self, splat: &Splat) -> [i32; CODES] {
        let scale = DVec3::from_array(splat.scale().map(f64::from));
        let rows = (splat.axes() * DMat3::from_diagonal(scale)).transpose();
        // Gram-Schmidt over the rows never squares the widths.
        let (a, u) = split(rows.x_axis);
        let b = rows.y_axis.dot(u);
        let (c, v) = split(rows.y_axis - b * u);
        let (d, e) = (rows.z_axis.dot(u), rows.z_axis.dot(v));
        let (f, _) = split(rows.z_axis - d * u - e * v);
        let log =
            |width: f64| ((width.ln() / self.steps.ratio.ln()).round() as i32).clamp(-self.last, self.last);
        // With C = M D and M of unit diagonal: what rounding D and the first row of M changed, the entries
        // below make up for.
        let limit = f64::from(CODE_LIMIT);
        let beside = |entry: f64, step: f64| (entry / step).round().clamp(-limit, limit);
        let (below, last, across) = (b / a, d / a, e / c);
        let (a, c, f) = (log(a), log(c), log(f));
        let [pa, pc, pf] = [a, c, f].map(|code| self.power(code));
        let step = self.even() * pc / pa;
        let b = beside(below, step);
        let d = beside(last + across * (b * step - below), self.even() * pf / pa);
        let e = beside(across, self.even() * pf / pc);
        let faint = (-f64::from(splat.opacity_logit)).exp().ln_1p().min(FAINTEST);
        let intensity = (f64::from(splat.intensity) / self.steps.intensity).round().clamp(-limit, limit);
        [a, b as i32, c, d as i32, e as i32, f, (faint / self.steps.opacity).round() as i32, intensity as i32]
    }

    /// Returns the splat of these codes at the origin; `None` if there is none.
    pub fn splat(&self, codes: &[i32; CODES]) -> Option<Splat> {
        let [.., opacity, intensity] = *codes;
        let c = self.root(codes)?;
        let mut splat = reshaped(&Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() }, &c);
        let faint = match opacity {
            0 => self.steps.opacity / 4.0,
            k => f64::from(k) * self.steps.opacity,
        };
        (faint > 0.0).then_some(())?;
        splat.opacity_logit = -(faint.exp_m1().ln()) as f32;
        splat.intensity = (f64::from(intensity) * self.steps.intensity) as f32;
        Some(splat)
    }

    /// Returns the number of steps along each axis in a cell of this side, 1 to 65536; `None` if there is no
    /// splat of these codes.
    pub fn counts(&self, codes: &[i32; CODES], side: f64) -> Option<[u32; 3]> {
        let m = self.root(codes)?;
        let (a, b, c) = (m.x_axis.x, m.x_axis.y, m.y_axis.y);
        let (d, e, f) = (m.x_axis.z, m.y_axis.z, m.z_axis.z);
        // Rows of C⁻¹, whose columns' lengths are 1 / the width along each axis.
        let x = DVec3::new(1.0 / a, -b / (a * c), (b * e - c * d) / (a * c * f)).length();
        let y = DVec3::new(1.0 / c, -e / (c * f), 0.0).length();
        Some(
            [x, y, 1.0 / f]
                .map(|inverse| (side * inverse / self.steps.mean).ceil().clamp(1.0, MOST_STEPS) as u32),
        )
    }

    /// Returns C; `None` if a code is beyond the lattice.
    fn root(&self, &[a, b, c, d, e, f, ..]: &[i32; CODES]) -> Option<DMat3> {
        let within = [a, c, f].iter().all(|code| code.abs() <= self.last);
        within.then_some(())?;
        let [a, c, f] = [a, c, f].map(|code| self.power(code));
        let even = self.even();
        let beside = |code: i32, diagonal: f64| f64::from(code) * even * diagonal;
        Some(DMat3::from_cols(
            DVec3::new(a, beside(b, c), beside(d, f)),
            DVec3::new(0.0, c, beside(e, f)),
            DVec3::new(0.0, 0.0, f),
        ))
    }

    fn power(&self, code: i32) -> f64 {
        self.powers[(code + self.last) as usize]
    }

    /// Returns the step of an entry beside the diagonal, in diagonal entries.
    fn even(&self) -> f64 {
        self.steps.ratio - 1.0
    }
}

/// Returns length and direction of `v`.
fn split(v: DVec3) -> (f64, DVec3) {
    let length = v.length().max(1e-30);
    (length, v / length)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    const STEPS: Steps = Steps { mean: 0.05, ratio: 1.03, opacity: 0.05, intensity: 2.0 };

    fn covariance(splat: &Splat) -> DMat3 {
        let scale = DVec3::from_array(splat.log_scale.map(|log| f64::from(log).exp()));
        let root = splat.axes() * DMat3::from_diagonal(scale);
        root * root.transpose()
    }

    fn splats(count: usize, anisotropy: f32) -> Vec<Splat> {
        let mut rng = Pcg64::seed_from_u64(11);
        let mut between = |low: f32, high: f32| rng.random_range(low..high);
        (0..count)
            .map(|_| Splat {
                mean: [0.0; 3],
                opacity_logit: between(-15.0, 15.0),
                rotation: [between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)],
                log_scale: [between(-0.9, anisotropy.ln()), between(-0.9, 0.0), between(-0.9, 0.0)],
                intensity: between(-1024.0, 3071.0),
            })
            .collect()
    }

    #[test]
    fn rounding_changes_a_splat_by_a_part_of_its_own_widths() {
        let lattice = Lattice::new(STEPS).expect("usable steps");
        for anisotropy in [1.5, 30.0, 5e3] {
            for splat in splats(300, anisotropy) {
                let codes = lattice.codes(&splat);
                let rounded = lattice.splat(&codes).expect("a splat");
                assert_eq!(lattice.codes(&rounded), codes, "rounding again changes nothing");
                // The eigenvalues of Σ⁻¹Σ' − 1 are the relative changes of squared widths.
                let change = covariance(&splat).inverse() * covariance(&rounded) - DMat3::IDENTITY;
                let trace = (change * change).to_cols_array_2d();
                let squared = trace[0][0] + trace[1][1] + trace[2][2];
                assert!(squared < 0.09f64.powi(2), "anisotropy {anisotropy}: {squared}");
                assert!((rounded.intensity - splat.intensity).abs() <= 1.001);
                let ln = |s: &Splat| f64::from(s.opacity()).max(1e-7).ln();
                assert!((ln(&rounded) - ln(&splat)).abs() < 0.026, "{}", splat.opacity_logit);
            }
        }
    }

    #[test]
    fn thin_splats_have_finer_places() {
        let lattice = Lattice::new(STEPS).expect("usable steps");
        let flat = Splat { log_scale: [0.0, 1.0, -2.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let counts = lattice.counts(&lattice.codes(&flat), 2.0).expect("a splat");
        let expected = [0.0f64, 1.0, -2.0].map(|log| 2.0 / (0.05 * log.exp()));
        for (count, expected) in counts.into_iter().zip(expected) {
            assert!((f64::from(count) / expected - 1.0).abs() < 0.08, "{count} steps, not {expected}");
        }
    }

    #[test]
    fn steps_and_codes_that_cannot_be_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e40] {
            assert!(Lattice::new(Steps { mean: bad, ..STEPS }).is_none());
            assert!(Lattice::new(Steps { ratio: bad, ..STEPS }).is_none());
            assert!(Lattice::new(Steps { opacity: bad, ..STEPS }).is_none());
            assert!(Lattice::new(Steps { intensity: bad, ..STEPS }).is_none());
        }
        let lattice = Lattice::new(STEPS).expect("usable steps");
        assert!(lattice.splat(&[1 << 20, 0, 0, 0, 0, 0, 1, 0]).is_none());
        assert!(lattice.splat(&[0, 0, 0, 0, 0, 0, -1, 0]).is_none());
    }
}
