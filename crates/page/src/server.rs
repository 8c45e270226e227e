use crate::{PageError, Result, Site};
use std::io::{Error, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// How soon a new connection or the wish to stop is noticed.
const PATIENCE: Duration = Duration::from_millis(20);
/// How long a browser may take to ask, and to take what it asked for.
const SLOWEST: Duration = Duration::from_secs(10);
/// Most connections at a time; more wait.
const MOST_CONNECTIONS: usize = 64;
/// Longest request, bytes.
const LONGEST_REQUEST: u64 = 16 << 10;

/// A [`Site`] on this machine, for this machine alone: it listens on 127.0.0.1 and hands out what the site lists.
///
/// One request a connection, each in a thread of its own: a browser opens connections ahead of time, and none of them may
/// keep another waiting.
pub struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
}

struct Shared {
    site: Site,
    port: u16,
    open: AtomicUsize,
}

impl Server {
    /// Listens on a port; 0 takes any that is free.
    ///
    /// # Errors
    /// Somebody else listens there, or nobody may.
    pub fn new(site: Site, port: u16) -> Result<Self> {
        let refuse = |e: Error| PageError::Port { port, reason: e.to_string() };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refuse)?;
        listener.set_nonblocking(true).map_err(refuse)?;
        let port = listener.local_addr().map_err(refuse)?.port();
        Ok(Self { listener, shared: Arc::new(Shared { site, port, open: AtomicUsize::new(0) }) })
    }

    /// What to open in a browser.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.shared.port)
    }

    /// Answers until `should_stop` says so.
    ///
    /// # Errors
    /// The system takes the port away.
    pub fn run(&self, should_stop: impl Fn() -> bool) -> Result<()> {
        while !should_stop() {
            if self.shared.open.load(Ordering::Relaxed) >= MOST_CONNECTIONS {
                std::thread::sleep(PATIENCE);
                continue;
            }
            match self.listener.accept() {
                Ok((stream, _)) => {
                    let shared = Arc::clone(&self.shared);
                    shared.open.fetch_add(1, Ordering::Relaxed);
                    std::thread::spawn(move || {
                        // Who leaves before the answer is there does not want it.
                        let _ = shared.answer(stream);
                        shared.open.fetch_sub(1, Ordering::Relaxed);
                    });
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => std::thread::sleep(PATIENCE),
                // A browser that is gone again, or a signal.
                Err(e) if matches!(e.kind(), ErrorKind::ConnectionAborted | ErrorKind::Interrupted) => {}
                Err(e) => return Err(PageError::Serving { reason: e.to_string() }),
            }
        }
        Ok(())
    }
}

impl Shared {
    fn answer(&self, mut stream: TcpStream) -> std::io::Result<()> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(SLOWEST))?;
        stream.set_write_timeout(Some(SLOWEST))?;
        let Some(request) = read_request(&mut stream)? else { return Ok(()) };
        let refusal = match (request.method.as_str(), self.is_meant(&request), self.site.at(&request.address)) {
            ("GET", true, Some(file)) => {
                write_head(&mut stream, "200 OK", file.media_type(), file.bytes.len())?;
                return stream.write_all(&file.bytes);
            }
            ("GET", true, None) => ("404 Not Found", "there is no such file\n"),
            ("GET", false, _) => ("421 Misdirected Request", "ask for 127.0.0.1\n"),
            _ => ("405 Method Not Allowed", "files can be fetched, nothing else\n"),
        };
        write_head(&mut stream, refusal.0, "text/plain; charset=utf-8", refusal.1.len())?;
        stream.write_all(refusal.1.as_bytes())
    }

    /// Whether the browser asks for this machine by its own name: another's page that has its name point here does not.
    fn is_meant(&self, request: &Request) -> bool {
        ["127.0.0.1", "localhost"].iter().any(|name| request.host == format!("{name}:{}", self.port))
    }
}

/// What matters of a request.
struct Request {
    method: String,
    address: String,
    host: String,
}

/// Reads a request's head; `None` where there is none.
fn read_request(stream: &mut TcpStream) -> std::io::Result<Option<Request>> {
    let mut head = Vec::new();
    let mut part = [0; 2048];
    let mut source = stream.take(LONGEST_REQUEST);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        match source.read(&mut part)? {
            0 => return Ok(None),
            n => head.extend_from_slice(&part[..n]),
        }
    }
    let text = String::from_utf8_lossy(&head);
    let mut lines = text.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(address)) = (words.next(), words.next()) else { return Ok(None) };
    let headers = lines.filter_map(|line| line.split_once(':'));
    let host = headers.into_iter().find(|(name, _)| name.eq_ignore_ascii_case("host")).map(|(_, host)| host.trim());
    let host = host.unwrap_or_default().to_ascii_lowercase();
    Ok(Some(Request { method: method.into(), address: address.into(), host }))
}

fn write_head(stream: &mut TcpStream, status: &str, media_type: &str, length: usize) -> std::io::Result<()> {
    // The two policies give the page clocks of a hundredth of a millisecond, for its frame times.
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {media_type}\r\nContent-Length: {length}\r\nConnection: close\r\n\
         Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nCross-Origin-Opener-Policy: same-origin\r\n\
         Cross-Origin-Embedder-Policy: require-corp\r\n\r\n"
    );
    stream.write_all(head.as_bytes())
}
