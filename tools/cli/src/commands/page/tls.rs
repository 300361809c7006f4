//! Certificates, so that a page can be served to other machines.

use std::io::{self, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;

use engine::{Error, Kind, Result};
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};

use crate::shared::texts::text_of;

/// Encrypted stream.
pub type TlsStream = StreamOwned<ServerConnection, TcpStream>;

/// What encrypts the connections.
#[derive(Clone)]
pub struct Tls(Arc<ServerConfig>);

impl Tls {
    /// Reads a certificate and its key.
    ///
    /// # Errors
    /// [`Kind::BadData`] if a file holds none or if they do not belong together, and the errors of reading them.
    pub fn read(certificates: &Path, key: &Path) -> Result<Self> {
        let text =
            |path: &Path| text_of(path).map_err(|error| Error::io(path, "reading a certificate", &error));
        let (chain, secret) = (text(certificates)?, text(key)?);
        let help =
            "give PEM files: the certificate of this machine with those that sign it, and its private key";
        let chain: Vec<_> = CertificateDer::pem_slice_iter(chain.as_bytes())
            .collect::<std::result::Result<_, _>>()
            .unwrap_or_default();
        if chain.is_empty() {
            return Err(Error::new(Kind::BadData, "VGS-PAGE-006", "no certificate")
                .file(certificates)
                .help(help));
        }
        let secret = PrivateKeyDer::from_pem_slice(secret.as_bytes())
            .map_err(|_| Error::new(Kind::BadData, "VGS-PAGE-007", "no private key").file(key).help(help))?;
        let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()
            .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, secret));
        let config = config.map_err(|error| {
            let message = format!("a certificate that cannot be used with this key: {error}");
            Error::new(Kind::BadData, "VGS-PAGE-008", message).file(certificates).help(help)
        })?;
        Ok(Tls(Arc::new(config)))
    }

    /// Returns the encrypted stream of a connection; `None` if it cannot be encrypted.
    pub fn stream(&self, connection: TcpStream) -> Option<TlsStream> {
        let server = ServerConnection::new(Arc::clone(&self.0)).ok()?;
        Some(StreamOwned::new(server, connection))
    }
}

/// Says on an encrypted stream that nothing more comes.
pub fn end(stream: &mut TlsStream) -> io::Result<()> {
    stream.conn.send_close_notify();
    stream.flush()
}
