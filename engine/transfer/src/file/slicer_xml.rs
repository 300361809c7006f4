//! Slicer's `presets.xml` and scenes (MRML): elements `VolumeProperty` with lists of numbers in their
//! attributes.

use std::collections::BTreeMap;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use super::super::{Material, TransferFunction};
use super::entry::{Entry, broken};
use super::list;
use base::error::Result;

type Attributes = BTreeMap<String, String>;

pub fn sniff(text: &str) -> bool {
    text.trim_start().starts_with('<')
}

pub fn read(text: &str) -> Result<Vec<Entry>> {
    let mut reader = Reader::from_str(text);
    let mut entries = Vec::new();
    loop {
        let line = |reader: &Reader<&[u8]>| {
            let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX).min(text.len());
            text.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() + 1
        };
        let event = reader.read_event();
        match event.map_err(|e| broken(format!("line {}: not well-formed XML: {e}", line(&reader))))? {
            Event::Start(e) | Event::Empty(e) if e.local_name().as_ref() == "VolumeProperty" => {
                let attributes =
                    attributes(&e).map_err(|e| broken(format!("line {}: {}", line(&reader), e.message)))?;
                entries.push(entry(&attributes));
            }
            Event::Eof => return Ok(entries),
            _ => {}
        }
    }
}

fn attributes(element: &BytesStart) -> Result<Attributes> {
    let mut found = Attributes::new();
    // The reader's own check of names compares each with all before it.
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| broken(e.to_string()))?;
        let name = attribute.key.local_name().as_ref().to_owned();
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|e| broken(format!("attribute {name}: {e}")))?;
        if found.insert(name.clone(), value.into_owned()).is_some() {
            return Err(broken(format!("attribute {name} is there twice")));
        }
    }
    Ok(found)
}

fn entry(attributes: &Attributes) -> Entry {
    let name = attributes.get("name").cloned().unwrap_or_default();
    let function = function(&name, attributes).map_err(|mut e| {
        e.message = format!("VolumeProperty {name:?}: {}", e.message);
        e
    });
    Entry { name, function }
}

fn function(name: &str, attributes: &Attributes) -> Result<TransferFunction> {
    let needed =
        |key: &str| attributes.get(key).ok_or_else(|| broken(format!("there is no attribute {key}")));
    let opacities = list::opacities("scalarOpacity", needed("scalarOpacity")?)?;
    let colours = list::colours("colorTransfer", needed("colorTransfer")?)?;
    let coefficient = |key: &str, default: f64| match attributes.get(key) {
        None => Ok(default),
        Some(text) => text.trim().parse().map_err(|_| broken(format!("{key} is {text:?}"))),
    };
    let default = Material::default();
    let material = Material {
        shade: coefficient("shade", 0.0)? != 0.0,
        ambient: coefficient("ambient", default.ambient)?,
        diffuse: coefficient("diffuse", default.diffuse)?,
        specular: coefficient("specular", default.specular)?,
        power: coefficient("specularPower", default.power)?,
        occlusion: default.occlusion,
    };
    let gradient = match attributes.get("gradientOpacity") {
        Some(text) if !matches!(text.trim(), "" | "0") => list::opacities("gradientOpacity", text)?,
        _ => Vec::new(),
    };
    TransferFunction::new(name, colours, opacities, material)?.with_gradient_opacity(gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attribute_is_there_once_and_very_many_of_them_are_no_trouble() {
        let list = "scalarOpacity=\"4 0 0 100 1\" colorTransfer=\"8 0 0 0 0 100 1 1 1\"";
        let entries = read(&format!("<VolumeProperty name=\"a\" {list}/>")).expect("XML");
        assert!(entries.len() == 1 && entries[0].function.is_ok());
        let error =
            read(&format!("<VolumeProperty name=\"a\" name=\"b\" {list}/>")).err().expect("two names");
        assert!(error.message.contains("name is there twice"), "{error}");
        // 0.9 MB: with each name compared with all before it, this took a quarter of a minute.
        let many: String = (0..60_000).map(|i| format!(" a{i}=\"{i}\"")).collect();
        let entries = read(&format!("<VolumeProperty name=\"a\" {list}{many}/>")).expect("XML");
        assert!(entries.len() == 1 && entries[0].function.is_ok());
    }
}
