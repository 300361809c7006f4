//! Header extensions. One is used: the Caret label table, which names the values of a label map.

use std::collections::BTreeMap;

use quick_xml::Reader;
use quick_xml::events::Event;

use base::{Error, Kind, Result};

/// Returns the label names from the extensions in `bytes`, which follow the header up to the voxels. The map
/// is empty if no extension holds a label table.
pub(super) fn labels(bytes: &[u8], big_endian: bool) -> Result<BTreeMap<i32, String>> {
    let mut labels = BTreeMap::new();
    let mut rest = bytes;
    // Fewer bytes than an extension's own header are padding.
    while let Some((raw, _)) = rest.split_first_chunk::<4>().filter(|_| rest.len() >= 8) {
        let size = if big_endian { i32::from_be_bytes(*raw) } else { i32::from_le_bytes(*raw) };
        let Some(data) = usize::try_from(size).ok().and_then(|n| rest.get(8..n)) else {
            let message = format!("a header extension claims {size} bytes where {} are left", rest.len());
            return Err(Error::new(Kind::BadData, "VGS-NII-013", message)
                .help("accept the file without its extensions with --lenient"));
        };
        // The code varies between writers (TotalSegmentator stores 0), so the content decides.
        if data.windows(11).any(|w| w == b"<LabelTable") {
            labels.append(&mut label_table(data)?);
        }
        rest = &rest[size as usize..];
    }
    Ok(labels)
}

/// Parses elements such as `<Label Key="5" ...>liver</Label>`; names are text or CDATA.
fn label_table(xml: &[u8]) -> Result<BTreeMap<i32, String>> {
    let broken = |e: &dyn std::fmt::Display| {
        Error::new(
            Kind::BadData,
            "VGS-NII-014",
            format!("the label table of a header extension is broken: {e}"),
        )
        .help("accept the file without its label names with --lenient")
    };
    let end = xml.iter().rposition(|&b| b != 0).map_or(0, |i| i + 1);
    let mut reader = Reader::from_reader(&xml[..end]);
    let (mut labels, mut open) = (BTreeMap::new(), None::<(i32, String)>);
    loop {
        match reader.read_event().map_err(|e| broken(&e))? {
            Event::Start(e) if e.name().as_ref() == "Label" => {
                // The reader's own search would compare each name with all before it.
                let mut attributes = e.attributes();
                let key = attributes.with_checks(false).flatten().find(|a| a.key.as_ref() == "Key");
                let key = key.and_then(|key| key.value.trim().parse().ok());
                open = Some((key.ok_or_else(|| broken(&"a label without a numeric key"))?, String::new()));
            }
            Event::Text(e) => {
                if let Some((_, name)) = &mut open {
                    name.push_str(&e);
                }
            }
            Event::CData(e) => {
                if let Some((_, name)) = &mut open {
                    name.push_str(&e);
                }
            }
            Event::GeneralRef(e) => {
                if let Some((_, name)) = &mut open {
                    let named = match &*e {
                        "amp" => Some('&'),
                        "lt" => Some('<'),
                        "gt" => Some('>'),
                        "quot" => Some('"'),
                        "apos" => Some('\''),
                        _ => e.resolve_char_ref().map_err(|e| broken(&e))?,
                    };
                    name.extend(named);
                }
            }
            Event::End(e) if e.name().as_ref() == "Label" => {
                if let Some((key, name)) = open.take() {
                    labels.insert(key, name.trim().to_owned());
                }
            }
            Event::Eof => return Ok(labels),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extension(code: i32, text: &str) -> Vec<u8> {
        let size = (8 + text.len()).next_multiple_of(16);
        let mut bytes = [(size as i32).to_le_bytes(), code.to_le_bytes()].concat();
        bytes.extend_from_slice(text.as_bytes());
        bytes.resize(size, 0);
        bytes
    }

    #[test]
    fn names_come_from_a_label_table() {
        let xml = "<?xml version=\"1.0\"?><CaretExtension><VolumeInformation Index=\"0\"><LabelTable>\
                   <Label Key=\"1\" Red=\"0\"><![CDATA[spleen]]></Label><Label Key='7'>a &amp; b&#33;</Label>\
                   </LabelTable></VolumeInformation></CaretExtension>";
        let bytes = [extension(4, "a comment"), extension(0, xml)].concat();
        let expected = BTreeMap::from([(1, "spleen".to_owned()), (7, "a & b!".to_owned())]);
        assert_eq!(labels(&bytes, false).unwrap(), expected);
    }

    #[test]
    fn sizes_are_checked() {
        for size in [0_i32, 7, -16, i32::MAX, i32::MIN, 40] {
            let mut bytes = extension(0, "text");
            bytes[..4].copy_from_slice(&size.to_le_bytes());
            assert_eq!(labels(&bytes, false).unwrap_err().code, "VGS-NII-013", "{size}");
        }
        assert!(labels(&[], false).unwrap().is_empty());
        assert!(labels(&[1, 2, 3], false).unwrap().is_empty());
    }

    #[test]
    fn broken_tables_are_refused() {
        for xml in
            ["<LabelTable><Label>x</Label>", "<LabelTable><Label Key=\"a\">x</Label>", "<LabelTable></x>"]
        {
            assert_eq!(labels(&extension(0, xml), false).unwrap_err().code, "VGS-NII-014", "{xml}");
        }
    }
}
