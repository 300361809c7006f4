//! Colours that depend on the direction of view: real spherical harmonics up to degree 3, as 3D Gaussian
//! splatting files hold them.
//!
//! The colour of a splat seen along the unit vector d, from the eye to its mean in the frame of the set, is
//! ½ + Σₖ Yₖ(d) cₖ for each of red, green and blue, and 0 if that is negative. Colours are display-referred
//! (sRGB-encoded). The basis is orthonormal over the sphere, with the signs of the graphics literature
//! (Condon-Shortley phase) and k = l² + l + m; its constants are those of Kerbl et al., "3D Gaussian
//! Splatting", 2023.

use glam::{DMat3, DVec3};

/// Y₀₀ = 1 / (2√π).
pub const SH0: f32 = 0.282_094_8;
/// Highest degree that is supported.
pub const MAX_DEGREE: u8 = 3;
/// Number of basis functions up to [`MAX_DEGREE`].
pub const MAX_BASIS: usize = (MAX_DEGREE as usize + 1).pow(2);

/// The colours of the splats of a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    /// Highest degree l, 0 to [`MAX_DEGREE`].
    pub degree: u8,
    /// Coefficients of one splat after the other: for each splat its (degree + 1)² coefficients in the order
    /// of [`basis`], and for each of these red, green, blue. Coefficient k of channel c of splat i is at
    /// `(i * (degree + 1)² + k) * 3 + c`.
    pub coefficients: Vec<f32>,
}

/// Luminance of red, green and blue (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Returns the luminance of the colour whose coefficients of degree 0 are the first three of `coefficients`.
pub fn luminance(coefficients: &[f32]) -> f32 {
    LUMINANCE.iter().zip(coefficients).map(|(weight, c)| weight * (0.5 + SH0 * c)).sum()
}

/// Returns the number of basis functions up to `degree`: (degree + 1)².
pub fn basis_count(degree: u8) -> usize {
    (usize::from(degree) + 1).pow(2)
}

/// Returns Yₖ at the unit vector `direction` for all k up to [`MAX_DEGREE`].
pub fn basis(direction: [f64; 3]) -> [f64; MAX_BASIS] {
    let [x, y, z] = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    [
        0.282_094_791_773_878_14,
        -0.488_602_511_902_919_9 * y,
        0.488_602_511_902_919_9 * z,
        -0.488_602_511_902_919_9 * x,
        1.092_548_430_592_079_2 * x * y,
        -1.092_548_430_592_079_2 * y * z,
        0.315_391_565_252_520_05 * (2.0 * zz - xx - yy),
        -1.092_548_430_592_079_2 * x * z,
        0.546_274_215_296_039_6 * (xx - yy),
        -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
        2.890_611_442_640_554 * x * y * z,
        -0.457_045_799_464_465_8 * y * (4.0 * zz - xx - yy),
        0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.457_045_799_464_465_8 * x * (4.0 * zz - xx - yy),
        1.445_305_721_320_277 * z * (xx - yy),
        -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
    ]
}

/// Returns directions and weights that integrate a product of two functions up to [`MAX_DEGREE`] over the
/// sphere exactly: four nodes of Gauss and Legendre in z, eight angles.
fn directions() -> impl Iterator<Item = (DVec3, f64)> {
    const NODES: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
        (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    ];
    NODES.into_iter().flat_map(|(z, weight)| {
        (0..8).map(move |step| {
            let angle = std::f64::consts::TAU * f64::from(step) / 8.0;
            let radius = (1.0 - z * z).sqrt();
            let direction = DVec3::new(radius * angle.cos(), radius * angle.sin(), z);
            (direction, weight * std::f64::consts::TAU / 8.0)
        })
    })
}

impl Harmonics {
    /// Returns the number of floats that belong to one splat.
    pub fn stride(&self) -> usize {
        3 * basis_count(self.degree)
    }

    /// Returns the coefficients of one splat.
    ///
    /// # Panics
    /// If there is no such splat.
    pub fn of(&self, splat: usize) -> &[f32] {
        &self.coefficients[splat * self.stride()..][..self.stride()]
    }

    /// Returns red, green and blue of `splat`, seen along the unit vector `direction` from the eye to its
    /// mean, in the frame of the set. The values are 0 or more; 1 is the display's white.
    ///
    /// # Panics
    /// If there is no such splat.
    pub fn colour(&self, splat: usize, direction: [f64; 3]) -> [f64; 3] {
        let mut colour = [0.5; 3];
        for (y, rgb) in basis(direction).into_iter().zip(self.of(splat).chunks_exact(3)) {
            for (sum, &c) in colour.iter_mut().zip(rgb) {
                *sum += y * f64::from(c);
            }
        }
        colour.map(|v| v.max(0.0))
    }

    /// Returns the same colours in a frame in which a direction d of this one is `rotation` · d.
    pub fn turned(&self, rotation: &DMat3) -> Harmonics {
        // Y'ⱼ = Σₖ ⟨Y'ⱼ, Yₖ⟩ Yₖ, since a rotation takes the functions of a degree to themselves.
        let mut products = [[0.0; MAX_BASIS]; MAX_BASIS];
        for (direction, weight) in directions() {
            let (before, after) = (basis(direction.to_array()), basis((*rotation * direction).to_array()));
            for (row, y) in products.iter_mut().zip(after) {
                for (product, z) in row.iter_mut().zip(before) {
                    *product += weight * y * z;
                }
            }
        }
        let count = basis_count(self.degree);
        let turned = |of: &[f32]| -> Vec<f32> {
            let sum = |j: usize, channel: usize| {
                (0..count).map(|k| products[j][k] * f64::from(of[3 * k + channel])).sum::<f64>() as f32
            };
            (0..3 * count).map(|at| sum(at / 3, at % 3)).collect()
        };
        let coefficients = self.coefficients.chunks_exact(self.stride()).flat_map(turned).collect();
        Harmonics { degree: self.degree, coefficients }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    /// Returns nodes and weights of Gauss-Legendre quadrature on -1..1, by Newton's method on the Legendre
    /// polynomial.
    fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
        let node = |i: usize| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (mut p, mut before) = (x, 1.0);
                for k in 2..=n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
                }
                slope = n as f64 * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        };
        (0..n).map(node).collect()
    }

    #[test]
    fn the_basis_is_orthonormal() {
        // Products of two functions of degree 3 are polynomials of degree 6: 8 by 16 points integrate them
        // exactly.
        let mut gram = [[0.0; MAX_BASIS]; MAX_BASIS];
        for (z, weight) in gauss_legendre(8) {
            for step in 0..16 {
                let (sin, cos) = (TAU * f64::from(step) / 16.0).sin_cos();
                let r = (1.0 - z * z).sqrt();
                let y = basis([r * cos, r * sin, z]);
                for (row, a) in gram.iter_mut().zip(y) {
                    for (sum, b) in row.iter_mut().zip(y) {
                        *sum += weight * TAU / 16.0 * a * b;
                    }
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, &product) in row.iter().enumerate() {
                let expected = f64::from(u8::from(i == j));
                assert!((product - expected).abs() < 1e-12, "<Y{i}, Y{j}> = {product}");
            }
        }
    }

    #[test]
    fn hand_values() {
        // Along the axes only a few functions differ from zero: their values are roots of rationals over π.
        let c0 = (0.25 / PI).sqrt();
        let c1 = (0.75 / PI).sqrt();
        let c2 = (15.0 / PI).sqrt() / 2.0;
        let polar2 = (5.0 / PI).sqrt() / 4.0;
        let polar3 = (7.0 / PI).sqrt() / 4.0;
        // Direction, and every function that does not vanish there with its value.
        type Row<'a> = ([f64; 3], &'a [(usize, f64)]);
        let rows: [Row; 3] = [
            (
                [1.0, 0.0, 0.0],
                &[
                    (0, c0),
                    (3, -c1),
                    (6, -polar2),
                    (8, c2 / 2.0),
                    (13, (21.0 / TAU).sqrt() / 4.0),
                    (15, -(35.0 / TAU).sqrt() / 4.0),
                ],
            ),
            (
                [0.0, 1.0, 0.0],
                &[
                    (0, c0),
                    (1, -c1),
                    (6, -polar2),
                    (8, -c2 / 2.0),
                    (9, (35.0 / TAU).sqrt() / 4.0),
                    (11, (21.0 / TAU).sqrt() / 4.0),
                ],
            ),
            ([0.0, 0.0, -1.0], &[(0, c0), (2, -c1), (6, 2.0 * polar2), (12, -2.0 * polar3)]),
        ];
        for (direction, expected) in rows {
            for (k, y) in basis(direction).into_iter().enumerate() {
                let want = expected.iter().find(|(at, _)| *at == k).map_or(0.0, |(_, value)| *value);
                assert!((y - want).abs() < 1e-12, "Y{k} along {direction:?}: {y}, not {want}");
            }
        }
        // Off the axes the products come in: at (1, 1, 1)/√3 they are 1/3 and 1/(3√3).
        let diagonal = basis([1.0 / 3f64.sqrt(); 3]);
        assert!((diagonal[4] - c2 / 3.0).abs() < 1e-12 && (diagonal[5] + c2 / 3.0).abs() < 1e-12);
        assert!((diagonal[7] + c2 / 3.0).abs() < 1e-12 && diagonal[6].abs() < 1e-12);
        assert!((diagonal[10] - (105.0 / PI).sqrt() / 2.0 / 27f64.sqrt()).abs() < 1e-12);
        assert!(diagonal[14].abs() < 1e-12);
    }

    #[test]
    fn turned_colours_are_the_same_in_the_turned_direction() {
        let coefficients: Vec<f32> = (0..96).map(|i| ((i * 37 % 101) as f32 - 50.0) * 0.01).collect();
        let rotation = DMat3::from_euler(glam::EulerRot::XYZ, 0.7, -1.1, 2.3);
        for degree in 0..=MAX_DEGREE {
            let stride = 3 * basis_count(degree);
            let two = [&coefficients[..stride], &coefficients[48..][..stride]].concat();
            let before = Harmonics { degree, coefficients: two };
            let after = before.turned(&rotation);
            for direction in [DVec3::X, DVec3::new(0.6, -0.8, 0.0), DVec3::ONE.normalize()] {
                for splat in 0..2 {
                    let [a, b] = [
                        before.colour(splat, direction.to_array()),
                        after.colour(splat, (rotation * direction).to_array()),
                    ];
                    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-5), "degree {degree}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn colours_of_degree_one() {
        let dc = [0.5, 0.0, -3.0];
        let mut coefficients = vec![0.0; 12];
        // A first splat that is black, then: red brighter along +x, green along +y, blue below zero.
        coefficients[..3].copy_from_slice(&[-2.0; 3]);
        coefficients.extend(dc);
        coefficients.extend([0.0, -1.0, 0.0]);
        coefficients.extend([0.0, 0.0, 0.0]);
        coefficients.extend([-1.0, 0.0, 0.0]);
        let harmonics = Harmonics { degree: 1, coefficients };
        assert_eq!(harmonics.stride(), 12);
        assert_eq!(harmonics.colour(0, [0.0, 0.0, 1.0]), [0.0; 3], "negative is black");
        let (c0, c1) = ((0.25 / PI).sqrt(), (0.75 / PI).sqrt());
        let rows = [
            ([1.0, 0.0, 0.0], [0.5 + 0.5 * c0 + c1, 0.5, 0.0]),
            ([-1.0, 0.0, 0.0], [0.5 + 0.5 * c0 - c1, 0.5, 0.0]),
            ([0.0, 1.0, 0.0], [0.5 + 0.5 * c0, 0.5 + c1, 0.0]),
            ([0.0, 0.0, 1.0], [0.5 + 0.5 * c0, 0.5, 0.0]),
        ];
        for (direction, expected) in rows {
            for (got, want) in harmonics.colour(1, direction).into_iter().zip(expected) {
                assert!((got - want).abs() < 1e-12, "{direction:?}: {got}, not {want}");
            }
        }
        let grey = Harmonics { degree: 0, coefficients: vec![1.0; 3] };
        assert!((grey.colour(0, [0.6, 0.0, 0.8])[1] - (0.5 + c0)).abs() < 1e-12);
        assert!((f64::from(SH0) - c0).abs() < 2e-8);
    }
}
