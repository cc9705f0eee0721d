//! [`Server`]: serves the files of a folder on this machine, and takes a report of a page.
//!
//! It understands what a browser needs to load a page: GET of a file, and POST to `/report`. A request is answered by a
//! thread of its own and its connection is closed.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::{Component, Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Largest number of bytes of a report.
const LARGEST_REPORT: u64 = 1 << 16;

/// A server of a folder.
pub(crate) struct Server {
    address: SocketAddr,
    reports: Receiver<String>,
    thread: JoinHandle<()>,
}

impl Server {
    /// Starts to serve a folder; port 0 takes a free one.
    pub(crate) fn start(folder: PathBuf, port: u16) -> std::io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let (sender, reports) = channel();
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (folder, sender) = (folder.clone(), sender.clone());
                // The browser may have closed the connection.
                std::thread::spawn(move || answer(stream, &folder, &sender).ok());
            }
        });
        Ok(Self {
            address,
            reports,
            thread,
        })
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Waits for a report.
    pub(crate) fn report(&mut self, time: Duration) -> Result<String, RecvTimeoutError> {
        self.reports.recv_timeout(time)
    }

    /// Serves until the process ends.
    pub(crate) fn wait(self) {
        // It ends only with the process.
        let _ = self.thread.join();
    }
}

fn answer(stream: TcpStream, folder: &Path, sender: &Sender<String>) -> std::io::Result<()> {
    let mut reader = BufReader::new(&stream);
    let mut request = String::new();
    reader.read_line(&mut request)?;
    let mut length = 0;
    loop {
        let mut line = String::new();
        reader.read_line(&mut line)?;
        if line.trim().is_empty() {
            break;
        }
        if let Some((name, value)) = line.split_once(':')
            && name.eq_ignore_ascii_case("content-length")
        {
            length = value.trim().parse().unwrap_or(0);
        }
    }
    let mut words = request.split_whitespace();
    let (method, target) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    if (method, target) == ("POST", "/report") {
        let mut report = String::new();
        let body = reader.by_ref().take(length.min(LARGEST_REPORT));
        { body }.read_to_string(&mut report)?;
        // The owner may have ended the wait.
        let _ = sender.send(report);
        return respond(&stream, "204 No Content", "text/plain", &[]);
    }
    match file(folder, target).and_then(|path| Some((kind(&path), std::fs::read(path).ok()?))) {
        Some((kind, contents)) if method == "GET" => respond(&stream, "200 OK", kind, &contents),
        _ => respond(&stream, "404 Not Found", "text/plain", b"not found"),
    }
}

/// The file of a target, inside the folder.
fn file(folder: &Path, target: &str) -> Option<PathBuf> {
    let path = target.split('?').next()?.strip_prefix('/')?;
    let path = Path::new(if path.is_empty() { "index.html" } else { path });
    let inside = path
        .components()
        .all(|part| matches!(part, Component::Normal(_)));
    inside.then(|| folder.join(path))
}

/// The media type of a file; a browser runs WebAssembly only under its own.
fn kind(path: &Path) -> &'static str {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html") => "text/html",
        Some("js") => "text/javascript",
        Some("wasm") => "application/wasm",
        _ => "application/octet-stream",
    }
}

fn respond(mut stream: &TcpStream, status: &str, kind: &str, body: &[u8]) -> std::io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(server: &Server, request: &str) -> String {
        let mut stream = TcpStream::connect(server.address()).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn files_of_the_folder_and_no_others_are_served() {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("page");
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(folder.path().join("secret.txt"), "secret").unwrap();
        std::fs::write(inside.join("index.html"), "hello").unwrap();
        let server = Server::start(inside, 0).unwrap();
        let answer = ask(&server, "GET /?a=b HTTP/1.1\r\n\r\n");
        assert!(
            answer.contains("200 OK") && answer.ends_with("hello"),
            "{answer}"
        );
        for target in ["/../secret.txt", "/missing", "//etc/passwd"] {
            let answer = ask(&server, &format!("GET {target} HTTP/1.1\r\n\r\n"));
            assert!(answer.contains("404"), "{target}: {answer}");
        }
    }

    #[test]
    fn a_report_arrives() {
        let folder = tempfile::tempdir().unwrap();
        let mut server = Server::start(folder.path().to_owned(), 0).unwrap();
        let answer = ask(
            &server,
            "POST /report HTTP/1.1\r\nContent-Length: 2\r\n\r\n{}",
        );
        assert!(answer.contains("204"), "{answer}");
        assert_eq!(server.report(Duration::from_secs(5)).unwrap(), "{}");
    }
}
