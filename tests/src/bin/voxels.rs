//! Reads volumes and masks as vgs does and writes their values, for comparison with programs that are not ours
//! (`tests/outsiders`): one process for all files.
//!
//! Each line of the input is a JSON object: `path`, `out` (a file for the values, 32-bit little-endian reals, x fastest),
//! and where needed `series`, `volume_index`, `volume` (the scan that `path` is a mask of: the values are then the
//! weights of the region on its grid) and `labels`. Each line of the output answers one: `size`, `affine` (rows, mm RAS),
//! `oriented`, `labels`, or `code`, `exit`, `message` and `help` of an error, or `panic`; and `warnings`.
#![forbid(unsafe_code)]

use std::io::{BufRead, Write};
use std::panic::catch_unwind;
use std::sync::{Arc, Mutex, PoisonError};

use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Result};
use serde_json::{Map, Value, json};

/// What was logged since it was last taken.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Log {
    fn take(&self) -> Vec<String> {
        let bytes = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect()
    }
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn main() {
    let log = Log::default();
    let writer = log.clone();
    tracing_subscriber::fmt()
        .with_writer(move || writer.clone())
        .without_time()
        .with_target(false)
        .with_level(false)
        .with_ansi(false)
        .init();
    for line in std::io::stdin().lock().lines() {
        let line = line.expect("a line");
        let asked: Map<String, Value> = serde_json::from_str(&line).expect("an object");
        let mut answer = match catch_unwind(|| read(&asked)) {
            Ok(Ok(answer)) => answer,
            Ok(Err(e)) => {
                let Error { kind, code, message, help, .. } = e;
                json!({"code": code, "exit": kind.exit_code(), "message": message, "help": help})
            }
            Err(_) => json!({"panic": true}),
        };
        answer["warnings"] = json!(log.take());
        println!("{answer}");
    }
}

fn read(asked: &Map<String, Value>) -> Result<Value> {
    let text = |key: &str| asked.get(key).and_then(Value::as_str);
    let path = text("path").expect("a path");
    let options = ReadOptions {
        series: text("series").map(str::to_owned),
        volume_index: asked.get("volume_index").and_then(Value::as_u64).map(|n| n as usize),
        ..ReadOptions::default()
    };
    let labels = text("labels").map_or(Ok(LabelChoice::Whole), str::parse)?;
    let (grid, values, names) = match text("volume") {
        None => {
            let mut volume = Volume::read(path, &options)?;
            let (values, names) = (std::mem::take(&mut volume.samples), std::mem::take(&mut volume.labels));
            (volume, values, names)
        }
        Some(scan) => {
            let scan = Volume::read(scan, &ReadOptions::default())?;
            let mask = Volume::read_mask(path, &options, &labels, &scan)?;
            let region = Roi::from_mask(&mask, &labels, &scan)?;
            (scan, region.weight, mask.labels)
        }
    };
    if let Some(out) = text("out") {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(out, bytes).map_err(|e| Error::io(out, "writing", &e))?;
    }
    let map = grid.world_from_voxel;
    let rows: Vec<[f64; 4]> =
        (0..3).map(|i| [map.x_axis[i], map.y_axis[i], map.z_axis[i], map.translation[i]]).collect();
    let names: Map<String, Value> = names.into_iter().map(|(n, name)| (n.to_string(), json!(name))).collect();
    Ok(json!({"size": grid.size, "affine": rows, "oriented": grid.oriented, "labels": names}))
}
