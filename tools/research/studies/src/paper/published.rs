//! Figures that the paper reports: its Tables 2, 3, 4 and 6, copied digit by digit.

/// Data set and mask of the paper, and the nearest case here.
pub struct Case {
    /// Name in the paper.
    pub name: &'static str,
    /// Mask in the paper.
    pub mask: &'static str,
    /// Folder of the nearest case here.
    pub folder: &'static str,
    /// Mask in that folder.
    pub file: &'static str,
    /// Voxels of the paper's region of interest. The paper does not state them; they are estimated from the
    /// volume of the anatomy and the size of a voxel.
    pub estimated_voxels: f64,
    /// Difference between the region here and the paper's.
    pub remark: &'static str,
}

/// The paper's cases.
pub const CASES: [Case; 4] = [CASE_1_TS, CASE_1_LIVER, CASE_4, CASE_6];

const CASE_1_TS: Case = Case {
    name: "Case 1",
    mask: "TS (binary)",
    folder: "ct-thorax-1p5mm",
    file: "mask_ts",
    estimated_voxels: 2.5e6,
    remark: "vessels, heart and one vertebra; the paper's mask has all structures of TotalSegmentator",
};
const CASE_1_LIVER: Case = Case {
    name: "Case 1",
    mask: "Liver (float)",
    folder: "ct-thorax-1p5mm",
    file: "mask_liver_soft",
    estimated_voxels: 0.44e6,
    remark: "a binary liver, blurred; the paper's is the output of a network",
};
const CASE_4: Case = Case {
    name: "Case 4",
    mask: "TS-Bones (binary)",
    folder: "ct-abdomen-full",
    file: "mask_bones",
    estimated_voxels: 1.0e6,
    remark: "bone above 200 HU; the paper's mask has the marrow, too",
};
const CASE_6: Case = Case {
    name: "Case 6",
    mask: "TS (binary)",
    folder: "ct-chest-full",
    file: "mask_vessels",
    estimated_voxels: 4.5e6,
    remark: "contrast-filled vessels and heart chambers, the nearest thing at hand: no mask of TotalSegmentator",
};

/// Worst and best value of a figure within the first 1000 iterations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// The worst.
    pub worst: f64,
    /// The best.
    pub best: f64,
}

/// A row of Table 2.
pub struct Quality {
    /// Index in [`CASES`].
    pub case: usize,
    /// Splats at the start.
    pub splats: usize,
    /// MMSE, equation (4).
    pub mmse: Span,
    /// PSNR, dB.
    pub psnr: Span,
}

const fn quality(case: usize, thousands: usize, mmse: [f64; 2], psnr: [f64; 2]) -> Quality {
    Quality {
        case,
        splats: thousands * 1000,
        mmse: Span { worst: mmse[0], best: mmse[1] },
        psnr: Span { worst: psnr[0], best: psnr[1] },
    }
}

/// Table 2.
pub const TABLE_2: [Quality; 13] = [
    quality(0, 100, [0.00336, 0.00242], [24.92, 26.16]),
    quality(0, 250, [0.00276, 0.00235], [25.58, 26.29]),
    quality(0, 500, [0.00273, 0.00213], [25.65, 26.71]),
    quality(0, 1000, [0.00241, 0.00192], [26.17, 27.18]),
    quality(1, 250, [0.00066, 0.00059], [31.80, 32.27]),
    quality(1, 500, [0.00066, 0.00056], [31.81, 32.53]),
    quality(2, 100, [0.008410, 0.004617], [20.75, 23.36]),
    quality(2, 250, [0.007950, 0.004173], [21.00, 23.80]),
    quality(2, 500, [0.007106, 0.003935], [21.48, 24.05]),
    quality(2, 1000, [0.005787, 0.003633], [22.38, 24.40]),
    quality(3, 250, [0.001172, 0.000766], [29.31, 31.16]),
    quality(3, 500, [0.001043, 0.00068], [29.82, 31.67]),
    quality(3, 1000, [0.000836, 0.000614], [30.78, 32.12]),
];

/// A row of Table 3.
pub struct Downsampled {
    /// Index in [`CASES`].
    pub case: usize,
    /// Downsampling factor along each axis.
    pub factor: usize,
    /// MMSE, equation (4).
    pub mmse: f64,
    /// PSNR, dB.
    pub psnr: f64,
}

/// Table 3.
pub const TABLE_3: [Downsampled; 6] = [
    Downsampled { case: 0, factor: 2, mmse: 0.001680, psnr: 27.75 },
    Downsampled { case: 0, factor: 4, mmse: 0.047450, psnr: 13.24 },
    Downsampled { case: 2, factor: 2, mmse: 0.000925, psnr: 30.34 },
    Downsampled { case: 2, factor: 4, mmse: 0.002945, psnr: 25.31 },
    Downsampled { case: 3, factor: 2, mmse: 0.000150, psnr: 38.25 },
    Downsampled { case: 3, factor: 4, mmse: 0.000557, psnr: 32.54 },
];

/// A column pair of Table 4, the ablation of the loss; λ_leak is 0.1 in all.
pub struct Loss {
    /// λ_mask.
    pub mask: f32,
    /// λ_ct.
    pub ct: f32,
    /// PSNR, dB.
    pub psnr: Span,
}

/// Table 4.
pub const TABLE_4: [Loss; 3] = [
    Loss { mask: 1.0, ct: 1.0, psnr: Span { worst: 29.82, best: 31.67 } },
    Loss { mask: 0.0, ct: 1.0, psnr: Span { worst: 21.26, best: 31.77 } },
    Loss { mask: 1.0, ct: 0.0, psnr: Span { worst: 28.56, best: 31.64 } },
];

/// Index of the case and number of splats of the row of Table 2 that Table 4 is about (Case 6, 500k).
pub const TABLE_4_ROW: (usize, usize) = (3, 500_000);

/// A row of Table 6.
pub struct Training {
    /// Index in [`CASES`].
    pub case: usize,
    /// Splats that an iteration updates.
    pub subset: usize,
    /// Splats at the start.
    pub start: usize,
    /// Splats at the end.
    pub end: usize,
    /// Time of 1000 iterations, minutes.
    pub minutes: f64,
    /// PSNR, dB; the text does not say of which iteration.
    pub psnr: f64,
    /// Device memory, GB.
    pub gigabytes: f64,
}

const fn training(
    case: usize,
    subset_thousands: usize,
    [start, end]: [usize; 2],
    minutes: f64,
    psnr: f64,
    gigabytes: f64,
) -> Training {
    Training {
        case,
        subset: subset_thousands * 1000,
        start: start * 1000,
        end: end * 1000,
        minutes,
        psnr,
        gigabytes,
    }
}

/// Table 6.
pub const TABLE_6: [Training; 13] = [
    training(0, 2, [100, 100], 23.0, 24.77, 2.16),
    training(0, 4, [250, 250], 39.0, 25.61, 3.27),
    training(0, 8, [200, 375], 77.0, 25.62, 5.37),
    training(0, 8, [500, 518], 77.0, 25.65, 5.46),
    training(0, 8, [1000, 1036], 76.0, 26.17, 5.66),
    training(1, 8, [250, 250], 85.0, 31.86, 5.42),
    training(1, 8, [500, 500], 95.0, 31.81, 5.50),
    training(2, 4, [250, 250], 54.0, 21.00, 5.02),
    training(2, 4, [500, 500], 55.0, 21.48, 5.11),
    training(2, 4, [1000, 1000], 57.0, 22.38, 5.19),
    training(3, 4, [250, 250], 67.0, 29.31, 6.27),
    training(3, 4, [500, 500], 67.0, 29.82, 6.36),
    training(3, 4, [1000, 1000], 92.0, 30.78, 6.55),
];

/// Returns the row of Table 6 for a number of splats, or the nearest of the same case by ratio of the
/// numbers.
pub fn training_of(case: usize, splats: usize) -> &'static Training {
    let distance = |row: &&Training| (row.start as f64 / splats as f64).ln().abs();
    TABLE_6
        .iter()
        .filter(|row| row.case == case)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("Table 6 has every case")
}

/// Returns the row of Table 2 for a number of splats.
pub fn quality_of(case: usize, splats: usize) -> Option<&'static Quality> {
    TABLE_2.iter().find(|row| row.case == case && row.splats == splats)
}

/// Returns all pairs (case, splats at the start) of Tables 2 and 6, in the order of the cases and of the
/// numbers.
pub fn rows() -> Vec<(usize, usize)> {
    let mut rows: Vec<_> = TABLE_2.iter().map(|row| (row.case, row.splats)).collect();
    rows.extend(TABLE_6.iter().map(|row| (row.case, row.start)));
    rows.sort_unstable();
    rows.dedup();
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shows a typing error in either column of a table.
    #[test]
    fn mmse_and_psnr_of_the_paper_agree() {
        let off = |mmse: f64, psnr: f64| (-10.0 * mmse.log10() - psnr).abs();
        // Two digits of an error leave up to 0.07 dB.
        let agree = |mmse: f64, psnr: f64| assert!(off(mmse, psnr) < 0.07, "{mmse} is not {psnr} dB");
        for (i, row) in TABLE_2.iter().enumerate() {
            agree(row.mmse.best, row.psnr.best);
            if i > 0 {
                agree(row.mmse.worst, row.psnr.worst);
            }
        }
        TABLE_3.iter().for_each(|row| agree(row.mmse, row.psnr));
        // The paper contradicts itself in its first row, and the copy does, too.
        let first = &TABLE_2[0];
        assert!((off(first.mmse.worst, first.psnr.worst) - 0.18).abs() < 0.01);
    }

    #[test]
    fn rows_of_both_tables_appear_once() {
        let rows = rows();
        assert_eq!(rows.len(), 14, "13 of Table 2, and 200k of Case 1 in Table 6");
        assert_eq!(rows[1], (0, 200_000));
        assert_eq!((training_of(0, 200_000).subset, training_of(0, 200_000).end), (8000, 375_000));
        assert_eq!(training_of(2, 100_000).start, 250_000, "Table 6 lacks 100k of Case 4");
        assert_eq!(quality_of(TABLE_4_ROW.0, TABLE_4_ROW.1).map(|r| r.psnr), Some(TABLE_4[0].psnr));
        assert!(quality_of(0, 200_000).is_none());
    }
}
