//! A headless browser, driven by its DevTools protocol.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

/// Names under which a browser may be installed.
const NAMES: [&str; 5] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"];
/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_mins(1);

/// A page in a browser of its own.
pub struct Page {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    sent: u64,
    events: VecDeque<Value>,
    _profile: TempDir,
}

/// The browser's path, if one is installed.
fn installed() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    NAMES.iter().flat_map(|name| folders.iter().map(move |f| f.join(name))).find(|p| p.is_file())
}

/// A new page, or a line that says why the test is skipped; written past the test harness, which would keep it to itself.
pub fn page_or_skip(test: &str) -> Option<Page> {
    let Some(program) = installed() else {
        let line = format!("report::{test}: skipped, no browser is installed (looked for {})\n", NAMES.join(", "));
        std::io::stderr().write_all(line.as_bytes()).expect("stderr");
        return None;
    };
    Some(Page::open(&program))
}

impl Page {
    fn open(program: &Path) -> Self {
        let profile = tempfile::tempdir().expect("a folder");
        let mut command = Command::new(program);
        command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]);
        command.args(["--no-first-run", "--disable-extensions", "--remote-debugging-port=0"]);
        command.arg(format!("--user-data-dir={}", profile.path().display())).arg("about:blank");
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the browser starts");
        let mut lines = BufReader::new(child.stderr.take().expect("a pipe")).lines();
        let url = lines.find_map(|line| line.ok()?.split_once("DevTools listening on ").map(|(_, url)| url.to_owned()));
        let url = url.expect("the browser says where it listens");
        // The rest of what it says is of no interest, but must not fill the pipe.
        std::thread::spawn(move || lines.for_each(drop));
        let address = url.split('/').nth(2).expect("host and port");
        let stream = TcpStream::connect(address).expect("connects");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time");
        let (socket, _) = tungstenite::client(&url, stream).expect("a web socket");
        let mut page =
            Self { child, socket, session: String::new(), sent: 0, events: VecDeque::new(), _profile: profile };
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

impl Drop for Page {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
