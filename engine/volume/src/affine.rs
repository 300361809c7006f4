//! The affine of a grid: made from the axes that a file gives, with the voxel distances and the directions of
//! its axes.

use glam::{DAffine3, DMat3, DVec3};

/// Signs that take LPS (x to the left, y to the back) to RAS (x to the right, y to the front); z is to the
/// head in both.
pub(super) const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// Returns the affine of a grid whose axes step along `columns` from `origin`; `signs` takes each axis of the
/// file's world to RAS.
pub(super) fn grid(columns: [DVec3; 3], origin: DVec3, signs: DVec3) -> DAffine3 {
    let [x, y, z] = columns.map(|column| signs * column);
    DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: signs * origin }
}

/// Returns the length of each column of an affine.
pub fn spacing_of(affine: &DAffine3) -> DVec3 {
    let m = affine.matrix3;
    DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
}

/// Cosine of two axes from which on they count as sheared.
pub(super) const SHEARED: f64 = 1e-3;

/// Returns the greatest cosine between two axes of an affine: 0 if they are at right angles.
pub(super) fn shear_of(affine: &DAffine3) -> f64 {
    let (m, spacing) = (affine.matrix3, spacing_of(affine));
    let units = [m.x_axis / spacing.x, m.y_axis / spacing.y, m.z_axis / spacing.z];
    [(0, 1), (0, 2), (1, 2)].map(|(i, j)| units[i].dot(units[j]).abs()).into_iter().fold(0.0, f64::max)
}

/// Returns for each voxel axis the letter of the anatomical direction that it is closest to. Every direction
/// is used once; the axis closest to a direction chooses first.
pub(super) fn axis_codes_of(affine: &DAffine3) -> String {
    let m = affine.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.normalize_or_zero().to_array());
    let mut codes = ['?'; 3];
    let (mut axes, mut directions) = (vec![0, 1, 2], vec![0, 1, 2]);
    while !axes.is_empty() {
        let strength = |&(a, d): &(usize, usize)| columns[a][d].abs();
        let (a, d) = axes
            .iter()
            .flat_map(|&a| directions.iter().map(move |&d| (a, d)))
            .max_by(|p, q| strength(p).total_cmp(&strength(q)))
            .expect("an axis and a direction are left");
        codes[a] = if columns[a][d] > 0.0 { ['R', 'A', 'S'][d] } else { ['L', 'P', 'I'][d] };
        axes.retain(|&x| x != a);
        directions.retain(|&x| x != d);
    }
    codes.iter().collect()
}
