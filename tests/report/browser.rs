//! A headless browser, driven by its DevTools protocol.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

/// Names under which a browser may be installed.
const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];
/// Longest wait for an answer; computers that build something else meanwhile are slow.
const PATIENCE: Duration = Duration::from_mins(3);
/// Longest wait for a browser to say that it is there.
const START: Duration = Duration::from_mins(1);

/// A page in a browser of its own. There is one at a time: several would slow each other down.
pub struct Page {
    _process: Process,
    socket: WebSocket<TcpStream>,
    session: String,
    sent: u64,
    events: VecDeque<Value>,
    _profile: TempDir,
    _turn: MutexGuard<'static, ()>,
}

/// A process that ends with its owner, however that ends.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The first thing that `find` sees in a line, in time; else the last line. The rest is read too, so that the pipe does not fill.
fn first_in(output: impl Read + Send + 'static, find: fn(&str) -> Option<String>) -> Result<String, String> {
    let (send, found) = mpsc::channel();
    std::thread::spawn(move || {
        let mut last = "it says nothing".to_owned();
        for line in BufReader::new(output).split(b'\n').map_while(Result::ok) {
            let line = String::from_utf8_lossy(&line).trim().to_owned();
            if let Some(sought) = find(&line) {
                // Nobody may wait any more.
                let _ = send.send(Ok(sought));
            }
            if !line.is_empty() {
                last = line;
            }
        }
        let _ = send.send(Err(last));
    });
    found.recv_timeout(START).unwrap_or_else(|_| Err(format!("nothing is heard of it within {} s", START.as_secs())))
}

/// Whether a program says of itself that it is Chromium or Chrome; a stub that asks for one to be installed does not.
fn is_browser(program: &Path) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let Ok(child) = command.spawn() else { return false };
    let mut process = Process(child);
    let output = process.0.stdout.take().expect("a pipe");
    let is_named = first_in(output, |line| line.contains("Chrom").then(|| line.to_owned())).is_ok();
    is_named && ended_well(&mut process)
}

fn ended_well(process: &mut Process) -> bool {
    let start = Instant::now();
    while start.elapsed() < START {
        match process.0.try_wait() {
            Ok(Some(status)) => return status.success(),
            Ok(None) => std::thread::sleep(Duration::from_millis(10)),
            Err(_) => return false,
        }
    }
    false
}

/// The browser's path, if one is installed.
fn installed() -> Option<&'static Path> {
    static FOUND: OnceLock<Option<PathBuf>> = OnceLock::new();
    let find = || {
        let path = std::env::var_os("PATH")?;
        let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
        let named = NAMES.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
        named.filter(|p| p.is_file()).find(|p| is_browser(p))
    };
    FOUND.get_or_init(find).as_deref()
}

/// Starts a browser; where it listens, or what it said instead.
fn start(program: &Path, profile: &Path) -> Result<(Process, String), String> {
    let mut command = Command::new(program);
    command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]);
    command.args(["--no-first-run", "--disable-extensions", "--remote-debugging-port=0"]);
    command.arg(format!("--user-data-dir={}", profile.display())).arg("about:blank");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut process = Process(command.spawn().map_err(|e| e.to_string())?);
    let output = process.0.stderr.take().expect("a pipe");
    let url = first_in(output, |line| line.split_once("DevTools listening on ").map(|(_, url)| url.to_owned()))?;
    Ok((process, url))
}

/// A new page, or a line that says why the test is skipped; written past the test harness, which would keep it to itself.
pub fn page_or_skip(test: &str) -> Option<Page> {
    static TURN: Mutex<()> = Mutex::new(());
    /// A browser that was there once must not fail to start later.
    static STARTED: AtomicBool = AtomicBool::new(false);
    // A test that failed has ended its browser as well.
    let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let profile = tempfile::tempdir().expect("a folder");
    let started = match installed() {
        Some(program) => {
            start(program, profile.path()).map_err(|said| format!("{} does not start: {said}", program.display()))
        }
        None => Err(format!("no browser is installed (looked for {})", NAMES.join(", "))),
    };
    match started {
        Ok((process, url)) => {
            STARTED.store(true, Ordering::Relaxed);
            Some(Page::open(process, &url, profile, turn))
        }
        Err(reason) => {
            assert!(!STARTED.load(Ordering::Relaxed), "{reason}, though one ran before");
            let line = format!("report::{test}: skipped, {reason}\n");
            std::io::stderr().write_all(line.as_bytes()).expect("stderr");
            None
        }
    }
}

impl Page {
    fn open(process: Process, url: &str, profile: TempDir, turn: MutexGuard<'static, ()>) -> Self {
        let address = url.split('/').nth(2).expect("host and port");
        let stream = TcpStream::connect(address).expect("connects");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time");
        let (socket, _) = tungstenite::client(url, stream).expect("a web socket");
        let mut page = Self {
            _process: process,
            socket,
            session: String::new(),
            sent: 0,
            events: VecDeque::new(),
            _profile: profile,
            _turn: turn,
        };
        let target = page.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        page.session = page.call("Target.attachToTarget", attach)["sessionId"].as_str().expect("a session").into();
        for domain in ["Page", "Runtime", "Log", "Network", "DOM"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page
    }

    /// Calls a method of the protocol; what happened meanwhile is kept.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.try_call(method, params).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// The same, where an error is an answer.
    pub fn try_call(&mut self, method: &str, params: Value) -> Result<Value, Value> {
        self.sent += 1;
        let id = self.sent;
        let mut message = json!({ "id": id, "method": method, "params": params });
        if !self.session.is_empty() {
            message["sessionId"] = self.session.clone().into();
        }
        self.socket.send(Message::text(message.to_string())).expect("sends");
        loop {
            let answer = self.next_message();
            if answer["id"] == id {
                let failed = !answer["error"].is_null();
                return if failed { Err(answer["error"].clone()) } else { Ok(answer["result"].clone()) };
            }
            self.events.push_back(answer);
        }
    }

    fn next_message(&mut self) -> Value {
        loop {
            if let Message::Text(text) = self.socket.read().expect("an answer in time") {
                return serde_json::from_str(&text).expect("JSON");
            }
        }
    }

    /// Sets the window's size, CSS pixels, and the colour scheme.
    pub fn window(&mut self, width: u32, height: u32, scheme: &str) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", size);
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Loads a file and waits until it is there.
    pub fn load(&mut self, path: &Path) {
        self.events.clear();
        self.call("Page.navigate", json!({ "url": format!("file://{}", path.display()) }));
        let start = Instant::now();
        while !self.events.iter().any(|e| e["method"] == "Page.loadEventFired") {
            assert!(start.elapsed() < PATIENCE, "{} does not load", path.display());
            let event = self.next_message();
            self.events.push_back(event);
        }
    }

    /// What an expression evaluates to; a promise is awaited.
    pub fn eval(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait_for(&mut self, expression: &str) {
        let start = Instant::now();
        while self.eval(expression) != true {
            assert!(start.elapsed() < PATIENCE, "{expression} does not come true");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Events of this method so far, their parameters.
    pub fn events(&self, method: &str) -> Vec<&Value> {
        self.events.iter().filter(|e| e["method"] == method).map(|e| &e["params"]).collect()
    }

    /// Moves the pointer to a place in the window, CSS pixels.
    pub fn point_at(&mut self, x: f64, y: f64) {
        self.call("Input.dispatchMouseEvent", json!({ "type": "mouseMoved", "x": x, "y": y }));
    }

    /// Presses a key.
    pub fn press(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.call("Input.dispatchKeyEvent", json!({ "type": kind, "key": key, "code": key }));
        }
    }
}

#[cfg(unix)]
#[test]
fn programs_that_are_no_browsers_are_told_from_browsers() {
    let path = std::env::var_os("PATH").expect("a path");
    let program =
        |name: &str| std::env::split_paths(&path).map(|f| f.join(name)).find(|p| p.is_file()).expect("is there");
    assert!(!is_browser(&program("false")), "it fails");
    assert!(!is_browser(&program("true")), "it has another name");
    assert!(!is_browser(Path::new("/dev/null/chrome")), "it is not there");
    let profile = tempfile::tempdir().expect("a folder");
    let said = start(&program("true"), profile.path()).err().expect("it does not listen");
    assert_eq!(said, "it says nothing");
    let said = start(&program("ls"), profile.path()).err().expect("it does not listen");
    assert!(said.len() > 10 && said != "it says nothing", "what it complains of: {said}");
}
