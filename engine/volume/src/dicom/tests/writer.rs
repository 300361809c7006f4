//! A writer of DICOM files byte by byte, for tests; it shares nothing with the reader.
#![allow(dead_code, reason = "each test that includes this file uses a part of it")]

use glam::DVec3;

/// Explicit VR, little-endian: the plain transfer syntax.
const PLAIN: &str = "1.2.840.10008.1.2.1";

/// Tag, type and value.
type Element = ((u16, u16), [u8; 2], Vec<u8>);

/// A file in the making: elements in the order of their tags.
#[derive(Clone)]
pub struct Dicom {
    pub syntax: &'static str,
    pub class: &'static str,
    elements: Vec<Element>,
}

/// Type and value of an element.
type Value = (&'static [u8; 2], Vec<u8>);

/// Returns 16-bit words as a file has them.
pub fn words(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join("\\")
}

fn element((group, number): (u16, u16), vr: &[u8; 2], value: &[u8]) -> Vec<u8> {
    let mut bytes = words(&[group, number]);
    bytes.extend(vr);
    match vr {
        b"OB" | b"OW" | b"SQ" | b"UN" | b"UT" => {
            bytes.extend([0, 0]);
            bytes.extend((value.len() as u32).to_le_bytes());
        }
        _ => bytes.extend((value.len() as u16).to_le_bytes()),
    }
    bytes.extend(value);
    bytes
}

/// Returns the items of a sequence that was written here.
fn items_of(mut rest: &[u8]) -> Vec<Dicom> {
    let length = |bytes: &[u8]| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize;
    let word = |bytes: &[u8]| u16::from_le_bytes([bytes[0], bytes[1]]);
    let mut items = Vec::new();
    while !rest.is_empty() {
        let (mut body, after) = rest[8..].split_at(length(&rest[4..]));
        let mut item = Dicom::empty("");
        while !body.is_empty() {
            let vr = [body[4], body[5]];
            let (head, size) = match &vr {
                b"OB" | b"OW" | b"SQ" | b"UN" | b"UT" => (12, length(&body[8..])),
                _ => (8, word(&body[6..]).into()),
            };
            item.elements.push(((word(body), word(&body[2..])), vr, body[head..][..size].to_vec()));
            body = &body[head + size..];
        }
        items.push(item);
        rest = after;
    }
    items
}

impl Dicom {
    /// Creates a slice of 4 columns and 3 rows at a position along an oblique grid, with the attributes of a
    /// CT.
    pub fn slice(number: u16, position: DVec3) -> Self {
        let mut file = Dicom { syntax: PLAIN, class: "1.2.840.10008.5.1.4.1.1.2", elements: Vec::new() };
        file.text((0x0008, 0x0018), b"UI", &format!("1.2.3.{number}"));
        file.text((0x0008, 0x0060), b"CS", "CT");
        file.text((0x0008, 0x103e), b"LO", "Abdomen 1.0");
        file.text((0x0020, 0x000e), b"UI", "1.2.3");
        file.text((0x0020, 0x0011), b"IS", "2");
        file.text((0x0020, 0x0032), b"DS", &numbers(&position.to_array()));
        file.text((0x0020, 0x0037), b"DS", "0.8\\0.6\\0\\-0.6\\0.8\\0");
        file.text((0x0028, 0x0004), b"CS", "MONOCHROME2");
        // Rows are 2 mm apart, columns half a millimetre.
        file.text((0x0028, 0x0030), b"DS", "2\\0.5");
        file.text((0x0028, 0x1052), b"DS", "-1024");
        file.text((0x0028, 0x1053), b"DS", "2");
        for (tag, value) in
            [(0x0002, 1), (0x0010, 3), (0x0011, 4), (0x0100, 16), (0x0101, 16), (0x0102, 15), (0x0103, 0)]
        {
            file.put((0x0028, tag), b"US", words(&[value]));
        }
        let pixels: Vec<u16> = (0..12).map(|i| 100 * number + i).collect();
        file.put((0x7fe0, 0x0010), b"OW", words(&pixels));
        file
    }

    /// Sets an element.
    pub fn put(&mut self, tag: (u16, u16), vr: &'static [u8; 2], mut value: Vec<u8>) {
        if value.len() % 2 == 1 {
            value.push(if vr == b"UI" { 0 } else { b' ' });
        }
        self.elements.retain(|(other, ..)| *other != tag);
        self.elements.push((tag, *vr, value));
    }

    /// Sets an element of text.
    pub fn text(&mut self, tag: (u16, u16), vr: &'static [u8; 2], value: &str) {
        self.put(tag, vr, value.as_bytes().to_vec());
    }

    /// Removes an element.
    pub fn remove(&mut self, tag: (u16, u16)) {
        self.elements.retain(|(other, ..)| *other != tag);
    }

    /// Changes an element wherever it stands, within items of sequences as well, or removes it. Returns false if it
    /// stands nowhere.
    pub fn change_all(&mut self, tag: (u16, u16), new: Option<(&'static [u8; 2], &[u8])>) -> bool {
        self.map_all(tag, &|_| new.map(|(vr, value)| (vr, value.to_vec())))
    }

    /// Gives an element what `new` makes of its value, wherever it stands; removes it if that is nothing. Returns false
    /// if it stands nowhere.
    pub fn map_all(&mut self, tag: (u16, u16), new: &dyn Fn(&[u8]) -> Option<Value>) -> bool {
        let mut found = false;
        for (own, vr, value) in std::mem::take(&mut self.elements) {
            if own == tag {
                found = true;
                if let Some((vr, value)) = new(&value) {
                    self.put(tag, vr, value);
                }
            } else if &vr == b"SQ" {
                let mut items = items_of(&value);
                for item in &mut items {
                    found |= item.map_all(tag, new);
                }
                self.elements.push((own, vr, items.iter().flat_map(Dicom::item).collect()));
            } else {
                self.elements.push((own, vr, value));
            }
        }
        found
    }

    /// Returns the items of a sequence as they are without representations.
    pub fn implicit_items(value: &[u8]) -> Vec<u8> {
        fn implicit(file: &Dicom) -> Vec<u8> {
            let mut elements = file.elements.clone();
            elements.sort_by_key(|(tag, ..)| *tag);
            let element = |((group, number), vr, value): &Element| {
                let value = if vr == b"SQ" { Dicom::implicit_items(value) } else { value.clone() };
                [words(&[*group, *number]), (value.len() as u32).to_le_bytes().to_vec(), value].concat()
            };
            elements.iter().flat_map(element).collect()
        }
        let item = |item: &Dicom| {
            let body = implicit(item);
            [words(&[0xfffe, 0xe000]), (body.len() as u32).to_le_bytes().to_vec(), body].concat()
        };
        items_of(value).iter().flat_map(item).collect()
    }

    /// Creates a file without elements, or an item of a sequence.
    pub fn empty(class: &'static str) -> Self {
        Dicom { syntax: PLAIN, class, elements: Vec::new() }
    }

    /// Sets a sequence.
    pub fn sequence(&mut self, tag: (u16, u16), items: &[Dicom]) {
        self.put(tag, b"SQ", items.iter().flat_map(Dicom::item).collect());
    }

    /// Returns the elements as an item of a sequence.
    pub fn item(&self) -> Vec<u8> {
        let body = self.body();
        [words(&[0xfffe, 0xe000]), (body.len() as u32).to_le_bytes().to_vec(), body].concat()
    }

    /// Returns the elements, in the order of their tags, as a data set of its own.
    pub fn body(&self) -> Vec<u8> {
        let mut elements = self.elements.clone();
        elements.sort_by_key(|(tag, ..)| *tag);
        elements.iter().flat_map(|(tag, vr, value)| element(*tag, vr, value)).collect()
    }

    /// Returns the file.
    pub fn bytes(&self) -> Vec<u8> {
        let padded = |text: &str| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(bytes.len().next_multiple_of(2), 0);
            bytes
        };
        let meta = [
            element((2, 1), b"OB", &[0, 1]),
            element((2, 2), b"UI", &padded(self.class)),
            element((2, 3), b"UI", &padded("1.2.3.4")),
            element((2, 0x10), b"UI", &padded(self.syntax)),
            element((2, 0x12), b"UI", &padded("1.2")),
        ]
        .concat();
        let mut all = vec![0; 128];
        all.extend(b"DICM");
        all.extend(element((2, 0), b"UL", &(meta.len() as u32).to_le_bytes()));
        all.extend(meta);
        all.extend(self.body());
        all
    }
}
