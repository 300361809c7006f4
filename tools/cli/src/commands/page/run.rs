//! Runs `vgs page`.

use std::fmt::Write as _;
use std::io;
use std::net::{IpAddr, SocketAddr};

use engine::{Error, Kind, Result};
use page::Page;

use super::arguments::PageArguments;
use super::server::Server;
use super::tls::Tls;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::terminal::clean;

/// Runs the command.
pub fn run(arguments: &PageArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let (page, html) = Page::read(&arguments.page)?;
    page.check().map_err(|error| error.file(&arguments.page))?;
    if !arguments.serve {
        tell(arguments, console, &page, &html)?;
        return Ok(0);
    }
    let tls = match (&arguments.cert, &arguments.key) {
        (Some(certificate), Some(key)) => Some(Tls::read(certificate, key)?),
        _ => None,
    };
    if tls.is_none() && !arguments.address.is_loopback() {
        let message = format!(
            "{} without a certificate: other machines could read the data on its way",
            arguments.address
        );
        return Err(Error::new(Kind::Usage, "VGS-PAGE-009", message)
            .help(
                "give --cert and --key, which a headset's browser wants as well before it shows a page in the headset; or \
                 leave --address out, and use a cable: adb reverse tcp:PORT tcp:PORT",
            )
            .into());
    }
    let secure = tls.is_some();
    let place = SocketAddr::new(arguments.address, arguments.port);
    let server = Server::bind(place, html, tls).map_err(|error| cannot_listen(place, &error))?;
    let place = server.address().map_err(|error| cannot_listen(place, &error))?;
    let address = address(place, secure);
    if console.json {
        console.json_data(&serde_json::json!({ "address": address, "port": place.port() }))?;
    } else {
        console.data(&format!("{address}\n"))?;
        if place.ip().is_unspecified() {
            console
                .say("on other machines put the name that the certificate has in the place of the address");
        } else if !secure {
            let port = place.port();
            console.say(&format!(
                "for a headset on a cable: adb reverse tcp:{port} tcp:{port}, then http://localhost:{port}/ in its browser"
            ));
        }
        console.say("Ctrl-C ends it");
    }
    server.run()
}

/// Returns the address as a browser takes it.
fn address(place: SocketAddr, secure: bool) -> String {
    let host = match place.ip() {
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => format!("[{ip}]"),
    };
    format!("{}://{host}:{}/", if secure { "https" } else { "http" }, place.port())
}

fn cannot_listen(place: SocketAddr, error: &io::Error) -> Error {
    let help = match error.kind() {
        io::ErrorKind::AddrInUse => {
            "another program has the port: choose another --port, or 0 for one that is free"
        }
        io::ErrorKind::PermissionDenied => "choose a --port above 1023",
        _ => "choose an --address of this machine",
    };
    Error::new(Kind::Io, "VGS-PAGE-010", format!("no page can be served at {place}: {error}")).help(help)
}

/// Says what a page holds.
fn tell(arguments: &PageArguments, console: &Console, page: &Page, html: &str) -> Result<()> {
    let (scene, sizes) = (&page.scene, page.sizes(html));
    if console.json {
        return console.json_data(&serde_json::json!({
            "page": arguments.page, "program": scene.program, "title": scene.title, "unit": scene.unit,
            "bytes": sizes.page, "data_bytes": sizes.data, "parts": scene.parts,
            "objects": scene.objects.iter().map(|object| {
                serde_json::json!({ "number": object.number, "name": object.name, "visible": object.visible })
            }).collect::<Vec<_>>(),
            "transfer_function": scene.function.name, "clip_planes": scene.clip.len(),
        }));
    }
    let mut out = format!("title               {}\n", scene.title);
    let rows = [
        ("written by", scene.program.clone()),
        ("size", format!("{}, of it {} of data", bytes(sizes.page), bytes(sizes.data))),
        ("transfer function", scene.function.name.clone()),
        ("clip planes", scene.clip.len().to_string()),
    ];
    for (name, value) in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{name:<20}{value}");
    }
    for object in &scene.objects {
        let hidden = if object.visible { "" } else { ", hidden" };
        let _ = writeln!(out, "{:<20}{}{hidden}", format!("object {}", object.number), object.name);
    }
    console.data(&clean(&out))
}
