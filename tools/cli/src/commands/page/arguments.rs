//! Flags of `vgs page`.

use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

/// Tells what a page holds, or serves it to browsers and headsets
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub struct PageArguments {
    /// The page, as `vgs convert` and the window write it
    #[arg(value_name = "PAGE.html")]
    pub page: PathBuf,
    /// Serves this page, and nothing else, until Ctrl-C
    #[arg(long, help_heading = "Serving")]
    pub serve: bool,
    /// Port; 0 for one that is free
    #[arg(long, value_name = "N", default_value_t = 8787, requires = "serve", help_heading = "Serving")]
    pub port: u16,
    /// Address of this machine at which it is served; others than the loopback need a certificate
    #[arg(
        long,
        value_name = "ADDRESS",
        default_value = "127.0.0.1",
        requires = "serve",
        help_heading = "Serving"
    )]
    pub address: IpAddr,
    /// Certificate of this machine with those that sign it (PEM), for https
    #[arg(long, value_name = "PEM", requires_all = ["serve", "key"], help_heading = "Serving")]
    pub cert: Option<PathBuf>,
    /// Its private key (PEM)
    #[arg(long, value_name = "PEM", requires = "cert", help_heading = "Serving")]
    pub key: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  vgs page scene.html                                          what it holds, and which names it tells
  vgs page scene.html --serve                                  http://127.0.0.1:8787/, for this machine
  vgs page scene.html --serve --address 0.0.0.0 --cert house.pem --key house.key      https, for the house

A page needs no server: a browser opens the file. A headset's browser shows it in the headset only from https or from
http://localhost. Over a cable: adb reverse tcp:8787 tcp:8787, then http://localhost:8787/ in the headset.";
