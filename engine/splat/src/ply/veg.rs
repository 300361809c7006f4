//! The PLY of Volume Encoding Gaussians (Dyken et al. 2026): splats with a scalar of the volume in place of a colour.
//!
//! An element `gaussians` has `x y z`, `opacity` (a logit), `scale_0..2` (ln σ), `rot_0..3` (w, x, y, z) and `scalar` (a
//! logit of the part of the volume's range, 0 to 1), beside normals and coefficients of light, which are left out. Floats of
//! 16 bits are called `short`; a `uchar` is the row of `codebook_centers` that has the value. The field is V̂ of this
//! program, with the scalar as V. Lengths have no unit: data are often 1 wide, and a picture takes opacities per mm, so one
//! is read as [`MM`].

use std::io::{BufReader, Read, Seek};

use half::f16;
use ply_rs::ply::{ElementDef, PropertyType, ScalarType};

use super::header::{Header, bad, check_count, quoted};
use super::rows::{self, Column};
use crate::mend::{Mended, ordinary_field, zeros};
use crate::{ReadOptions, Splat, SplatSet};
use base::error::Result;
use base::unit::Unit;

/// The name of the layout.
pub(super) const NAME: &str = "veg";

/// What a unit of length is read as, mm.
const MM: f32 = 100.0;

/// Its element of splats.
pub(super) const SPLATS: &str = "gaussians";
const CODEBOOK: &str = "codebook_centers";
/// Rows of the codebook: what a byte counts.
const CODES: usize = 256;

/// What is read of a splat, and the column of the codebook that holds its values.
const PROPERTIES: [(&str, &str); 12] = [
    ("x", ""),
    ("y", ""),
    ("z", ""),
    ("opacity", "opacity"),
    ("rot_0", "rotation_re"),
    ("rot_1", "rotation_im"),
    ("rot_2", "rotation_im"),
    ("rot_3", "rotation_im"),
    ("scale_0", "scaling"),
    ("scale_1", "scaling"),
    ("scale_2", "scaling"),
    ("scalar", "scalar"),
];
const COUNT: usize = PROPERTIES.len();

/// Returns the element of the splats, with its position, of a file of this layout.
pub(super) fn splats(header: &Header) -> Option<(usize, &ElementDef)> {
    let is_one = |(_, element): &(usize, &ElementDef)| element.properties.contains_key("scalar");
    header.element(SPLATS).filter(|found| header.element("vertex").is_none() && is_one(found))
}

/// Reads a file of `bytes` bytes behind its header.
pub(super) fn load(
    source: &mut BufReader<impl Read + Seek>,
    header: &Header,
    (at, element): (usize, &ElementDef),
    bytes: u64,
    options: &ReadOptions,
) -> Result<(SplatSet, Mended)> {
    check_count(element, options.max_splats)?;
    let codebook = header.element(CODEBOOK);
    let last = codebook.map_or(at, |(index, _)| index.max(at));
    header.check_rows(last, bytes, options.strict)?;
    let stored = PROPERTIES.map(|(name, _)| Stored::of(element, name));
    let columns = columns_of(element, PROPERTIES.map(|(name, _)| name))?;
    let mut rows = zeros::<[f32; COUNT]>(element.count)?;
    let mut codes = vec![[0.0; COUNT]; CODES];
    for (index, other) in header.elements.iter().enumerate().take(last + 1) {
        if index == at {
            rows::read(source, header, element, &columns, |i, row: &[f32; COUNT]| rows[i] = *row)?;
        } else if other.name == CODEBOOK && stored.contains(&Stored::Code) {
            if other.count < CODES {
                let message = format!("the codebook has {} rows, {CODES} are needed", other.count);
                return Err(bad("VGS-PLY-034", message));
            }
            let of = PROPERTIES.map(|(name, of)| if of.is_empty() { name } else { of });
            let coded = |k: usize| stored[k] == Stored::Code;
            let column = |slot| Ok(Column { property: position(other, of[slot])?, slot });
            let columns = (0..COUNT).filter(|&k| coded(k)).map(column).collect::<Result<Vec<_>>>()?;
            let kinds = of.map(|name| Stored::of(other, name));
            rows::read(source, header, other, &columns, |i, row: &[f32; COUNT]| {
                if let Some(code) = codes.get_mut(i) {
                    *code = std::array::from_fn(|k| kinds[k].value(row[k]));
                }
            })?;
        } else {
            rows::skip(source, header, other)?;
        }
    }
    if stored.contains(&Stored::Code) && codebook.is_none() {
        return Err(bad("VGS-PLY-034", format!("splats of codes, and no element `{CODEBOOK}`")));
    }
    let splat = |row: &[f32; COUNT]| {
        let v: [f32; COUNT] = std::array::from_fn(|k| match stored[k] {
            Stored::Code => codes[row[k] as usize % CODES][k],
            stored => stored.value(row[k]),
        });
        Splat {
            mean: [v[0] * MM, v[1] * MM, v[2] * MM],
            opacity_logit: v[3],
            rotation: [v[4], v[5], v[6], v[7]],
            log_scale: [v[8], v[9], v[10]].map(|ln| ln + MM.ln()),
            intensity: 1.0 / (1.0 + (-v[11]).exp()),
        }
    };
    let splats = rows.iter().map(splat).collect();
    let mut set = SplatSet { unit: Unit::Arbitrary, splats, ..SplatSet::default() };
    let mut mended = Mended::of(&mut set, |_| None, options.strict)?;
    mended.widen(&mut set.splats);
    set.field = ordinary_field(&set.splats);
    Ok((set, mended))
}

/// How a number is stored.
#[derive(Clone, Copy, PartialEq)]
enum Stored {
    /// As it is.
    Plain,
    /// As a float of 16 bits, which the header calls an integer.
    Half,
    /// As a row of the codebook.
    Code,
}

impl Stored {
    fn of(element: &ElementDef, name: &str) -> Stored {
        match element.properties.get(name).map(|property| &property.data_type) {
            Some(PropertyType::Scalar(ScalarType::Short | ScalarType::UShort)) => Stored::Half,
            Some(PropertyType::Scalar(ScalarType::Char | ScalarType::UChar)) => Stored::Code,
            _ => Stored::Plain,
        }
    }

    /// Returns the number that is read as `value`.
    fn value(self, value: f32) -> f32 {
        match self {
            Stored::Half => f16::from_bits(value as i32 as u16).to_f32(),
            Stored::Plain | Stored::Code => value,
        }
    }
}

fn columns_of(element: &ElementDef, names: [&str; COUNT]) -> Result<Vec<Column>> {
    let column = |(slot, name)| Ok(Column { property: position(element, name)?, slot });
    names.into_iter().enumerate().map(column).collect()
}

/// Returns the position of a property, which must be a number.
fn position(element: &ElementDef, name: &str) -> Result<usize> {
    let found = element
        .properties
        .iter()
        .position(|(own, property)| own == name && matches!(property.data_type, PropertyType::Scalar(_)));
    found.ok_or_else(|| {
        let message = format!("the element `{}` has no number `{name}`", quoted(&element.name));
        bad("VGS-PLY-034", message).help("write the file again with the program that trained it")
    })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::activation::Activations;
    use crate::{describe, read};
    use base::input::Input;

    /// Writes two splats with lengths and codes as these types say: of the places, and of all else.
    fn file(places: &str, others: &str, codebook: Option<&str>) -> Vec<u8> {
        let values: [[f32; COUNT]; 2] = [
            [0.25, 0.5, 1.0, -1.0, 1.0, 0.0, 0.5, -0.25, -3.0, -4.0, -2.0, 0.0],
            [0.75, 0.125, -1.0, 2.0, 0.5, 0.5, 0.5, 0.5, -2.5, -3.5, -4.5, 1.5],
        ];
        let mut header = "ply\nformat binary_little_endian 1.0\nelement gaussians 2\n".to_owned();
        for (k, (name, _)) in PROPERTIES.iter().enumerate() {
            header += &format!("property {} {name}\n", if k < 3 { places } else { others });
            if k == 3 {
                header += "property uchar normal_0\n";
            }
        }
        let mut bytes = Vec::new();
        let put = |bytes: &mut Vec<u8>, kind: &str, value: f32, code: u8| match kind {
            "float" => bytes.extend(value.to_le_bytes()),
            "short" => bytes.extend(f16::from_f32(value).to_le_bytes()),
            _ => bytes.push(code),
        };
        for (i, row) in values.iter().enumerate() {
            for (k, &value) in row.iter().enumerate() {
                put(&mut bytes, if k < 3 { places } else { others }, value, (COUNT * i + k) as u8);
                if k == 3 {
                    bytes.push(7);
                }
            }
        }
        if let Some(kind) = codebook {
            header += "element codebook_centers 256\n";
            let names = ["scaling", "opacity", "scalar", "rotation_im", "rotation_re"];
            header += &names.map(|name| format!("property {kind} {name}\n")).concat();
            for code in 0..256 {
                let value = values.get(code / COUNT).map_or(0.0, |row| row[code % COUNT]);
                names.iter().for_each(|_| put(&mut bytes, kind, value, 0));
            }
        }
        [format!("{header}end_header\n").into_bytes(), bytes].concat()
    }

    fn found(bytes: &[u8]) -> Result<SplatSet> {
        read(
            Input::of(Cursor::new(bytes.to_vec()), "a.ply"),
            &ReadOptions { strict: true, ..ReadOptions::default() },
        )
    }

    #[test]
    fn floats_halves_and_codes_are_the_same_splats() {
        let plain = found(&file("float", "float", None)).expect("splats");
        let second = &plain.splats[1];
        assert_eq!(second.mean, [75.0, 12.5, -100.0]);
        let sigma = second.log_scale.map(f32::exp);
        assert!((sigma[0] - MM * (-2.5f32).exp()).abs() < 1e-4, "{sigma:?} mm");
        assert!((second.opacity() - 0.880_797).abs() < 1e-5 && (second.intensity - 0.817_574_5).abs() < 1e-5);
        assert_eq!(second.rotation, [0.5; 4]);
        assert_eq!((plain.unit, plain.splats.len()), (Unit::Arbitrary, 2));
        for (places, others, codebook) in
            [("short", "short", None), ("float", "uchar", Some("float")), ("short", "uchar", Some("short"))]
        {
            let bytes = file(places, others, codebook);
            assert_eq!(found(&bytes).expect("splats"), plain, "{places}, {others}");
            let summary = describe(Input::of(Cursor::new(bytes), "a.ply"), &ReadOptions::default());
            assert_eq!(summary.expect("a description").layout, NAME);
        }
    }

    #[test]
    fn what_is_wrong_is_refused_by_name() {
        let whole = file("short", "uchar", Some("short"));
        let text = |from: &str, to: &str| {
            let at = whole.windows(from.len()).position(|part| part == from.as_bytes()).expect("there");
            [&whole[..at], to.as_bytes(), &whole[at + from.len()..]].concat()
        };
        // A row less, and its five halves.
        let mut few = text("codebook_centers 256", "codebook_centers 255");
        few.truncate(few.len() - 10);
        for (name, bytes, code) in [
            ("no codebook", file("short", "uchar", None), "VGS-PLY-034"),
            ("few codes", few, "VGS-PLY-034"),
            ("no rotation", text("rot_3", "rot_9"), "VGS-PLY-034"),
            ("no scaling", text("scaling", "scalind"), "VGS-PLY-034"),
            ("too long", [&whole[..], &[0]].concat(), "VGS-PLY-023"),
            ("cut off", whole[..whole.len() - 1].to_vec(), "VGS-PLY-006"),
            ("too many", text("gaussians 2", "gaussians 999999999999"), "VGS-PLY-014"),
        ] {
            let error = found(&bytes).err().unwrap_or_else(|| panic!("{name}: it was read"));
            assert_eq!(error.code, code, "{name}: {error}");
        }
        for at in 0..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 0xff;
            let _ = read(Input::of(Cursor::new(changed), "a.ply"), &ReadOptions::default());
        }
    }
}
