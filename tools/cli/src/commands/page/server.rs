//! Connections: each has a thread and a time, and there are only so many at once.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::http::{self, Answer, Hosts};
use super::tls::{self, Tls};

/// Most connections at a time; a browser has six.
const MOST_CONNECTIONS: usize = 32;
/// Time in which the head of a request must be there.
const HEAD_TIME: Duration = Duration::from_secs(10);
/// Time that one write may take.
const WRITE_TIME: Duration = Duration::from_secs(30);
/// Time to wait after connections cannot be taken, as without file descriptors.
const PAUSE: Duration = Duration::from_millis(200);

/// A page that is served.
pub struct Server {
    listener: TcpListener,
    page: Arc<[u8]>,
    tls: Option<Tls>,
}

impl Server {
    /// Takes the port of an address.
    ///
    /// # Errors
    /// Returns the error of the operating system.
    pub fn bind(address: SocketAddr, page: String, tls: Option<Tls>) -> io::Result<Self> {
        Ok(Server { listener: TcpListener::bind(address)?, page: page.into_bytes().into(), tls })
    }

    /// Returns the address with the port that was taken.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Answers requests until the program ends.
    pub fn run(&self) -> ! {
        let open = Arc::new(AtomicUsize::new(0));
        loop {
            let Ok((connection, _)) = self.listener.accept() else {
                std::thread::sleep(PAUSE);
                continue;
            };
            let place = Place::take(&open);
            let (page, tls) = (Arc::clone(&self.page), self.tls.clone());
            // Without a thread the connection is closed, and a browser tries again.
            let _ = std::thread::Builder::new().name("connection".into()).spawn(move || {
                // Who has gone needs no answer.
                let _ = talk(&connection, &page, tls.as_ref(), place.is_free);
                drop(place);
            });
        }
    }
}

/// Place of a connection among those that are open.
struct Place {
    open: Arc<AtomicUsize>,
    /// True if there are not too many.
    is_free: bool,
}

impl Place {
    fn take(open: &Arc<AtomicUsize>) -> Self {
        let before = open.fetch_add(1, Ordering::Relaxed);
        Place { open: Arc::clone(open), is_free: before < MOST_CONNECTIONS }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.open.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Answers the one request of a connection, and closes it.
fn talk(connection: &TcpStream, page: &[u8], tls: Option<&Tls>, is_free: bool) -> io::Result<()> {
    connection.set_write_timeout(Some(WRITE_TIME))?;
    connection.set_read_timeout(Some(if is_free { HEAD_TIME } else { PAUSE }))?;
    match tls {
        Some(encrypted) => {
            let Some(mut stream) = encrypted.stream(connection.try_clone()?) else { return Ok(()) };
            answer(&mut stream, page, Hosts::Any, is_free)?;
            tls::end(&mut stream)?;
        }
        None => answer(&mut &*connection, page, Hosts::Loopback, is_free)?,
    }
    connection.shutdown(Shutdown::Write)?;
    // A connection that is closed with bytes unread loses what was sent last.
    connection.set_read_timeout(Some(PAUSE))?;
    let _ = io::copy(&mut connection.take(http::MOST_HEAD as u64), &mut io::sink());
    Ok(())
}

/// Reads a request and answers it.
fn answer(stream: &mut (impl Read + Write), page: &[u8], hosts: Hosts, is_free: bool) -> io::Result<()> {
    let said = if is_free { request(stream, hosts)? } else { Answer::Refusal(http::TOO_MANY) };
    stream.write_all(http::head(said, page.len()).as_bytes())?;
    if said == (Answer::Page { head_only: false }) {
        stream.write_all(page)?;
    }
    stream.flush()
}

/// Reads the head of a request, and returns what is said to it.
fn request(stream: &mut impl Read, hosts: Hosts) -> io::Result<Answer> {
    let begin = Instant::now();
    let (mut head, mut part) = (Vec::new(), [0; 1024]);
    loop {
        let count = match stream.read(&mut part) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => count,
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                return Ok(Answer::Refusal(http::TOO_SLOW));
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        head.extend_from_slice(&part[..count]);
        if let Some(end) = head.windows(4).position(|end| end == b"\r\n\r\n") {
            return Ok(http::answer(&head[..end], hosts));
        }
        if head.len() > http::MOST_HEAD {
            return Ok(Answer::Refusal(http::TOO_LONG));
        }
        if begin.elapsed() > HEAD_TIME {
            return Ok(Answer::Refusal(http::TOO_SLOW));
        }
    }
}
