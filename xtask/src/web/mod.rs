//! `cargo xtask web`: the viewer as a web page, and its test in a browser without a window.
//!
//! The page is built for `wasm32-unknown-unknown` and gets its JavaScript from `wasm-bindgen`. `--check` serves it on this
//! machine, opens it in Chromium with WebGPU in software, draws a line across a block with synthetic pointer events and
//! expects two pieces. `--serve` serves it for a person.

mod server;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use clap::Args;
use serde::Deserialize;

use server::Server;

/// Options of `cargo xtask web`.
#[derive(Debug, Args)]
pub(crate) struct WebArguments {
    /// Folder of the page.
    #[arg(long, default_value = "target/web")]
    out: PathBuf,
    /// Test the page in Chromium.
    #[arg(long)]
    check: bool,
    /// Serve the page at this port of this machine until interrupted.
    #[arg(long, value_name = "PORT")]
    serve: Option<u16>,
    /// Use the page that is in the folder already.
    #[arg(long)]
    no_build: bool,
}

/// The target of the page.
const TARGET: &str = "wasm32-unknown-unknown";
/// Names under which Chromium is found.
const BROWSERS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];
/// Longest time of the test.
const TIME: Duration = Duration::from_secs(240);

/// A block on a table: a stroke through it separates it.
const SCENE: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
ground = { height = 0.0, friction = 0.6 }

[solver]
time_step = 0.01
substeps = 10

[[body]]
shape = { kind = "beam", tets = 1000 }
scale = 0.3
position = [0.0, 0.0, 0.06]
young_modulus = 2e4
damping = 0.01
"#;

/// The test, added to the page: waits for the first frames, draws a line, waits for two pieces, and reports.
const SCRIPT: &str = include_str!("check.js");

pub(crate) fn web(arguments: &WebArguments) -> anyhow::Result<()> {
    if !arguments.no_build {
        build(&arguments.out)?;
        progress(&format!("the page is in {}", arguments.out.display()));
    }
    if arguments.check {
        check(&arguments.out)?;
    }
    if let Some(port) = arguments.serve {
        let server = Server::start(arguments.out.clone(), port)?;
        progress(&format!("http://{}", server.address()));
        server.wait();
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "progress of a command")]
fn progress(text: &str) {
    println!("{text}");
}

/// Builds the page.
fn build(out: &Path) -> anyhow::Result<()> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let output = Command::new(cargo)
        .args(["build", "--release", "--locked", "-p", "incise-viewer"])
        .args(["--target", TARGET])
        .args(["--message-format", "json-render-diagnostics"])
        .stderr(Stdio::inherit())
        .output()?;
    ensure!(
        output.status.success(),
        "the page does not build; is the target there? `rustup target add {TARGET}`"
    );
    let program = String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter_map(|message| Some(message["filenames"].as_array()?.clone()))
        .flatten()
        .filter_map(|file| file.as_str().map(PathBuf::from))
        .rfind(|file| file.ends_with("incise-viewer.wasm"))
        .context("cargo names no program")?;
    std::fs::create_dir_all(out)?;
    let bound = Command::new("wasm-bindgen")
        .args(["--target", "web", "--no-typescript", "--out-dir"])
        .args([out, &program])
        .status();
    let version = locked_version("wasm-bindgen")?;
    let install = format!("`cargo install wasm-bindgen-cli --version {version}`");
    match bound {
        Ok(status) => ensure!(
            status.success(),
            "wasm-bindgen failed; {install} installs the version that the page needs"
        ),
        Err(error) => bail!("wasm-bindgen cannot be started ({error}); {install} installs it"),
    }
    let page = workspace().join("crates/viewer/web/index.html");
    std::fs::copy(&page, out.join("index.html")).with_context(|| page.display().to_string())?;
    Ok(())
}

fn workspace() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    folder.parent().unwrap_or(folder).to_owned()
}

/// The version of a package in the lock file.
fn locked_version(package: &str) -> anyhow::Result<String> {
    let lock = std::fs::read_to_string(workspace().join("Cargo.lock"))?;
    let start = format!("name = \"{package}\"\nversion = \"");
    let version = lock
        .split(&start)
        .nth(1)
        .and_then(|rest| rest.split('"').next());
    Ok(version
        .with_context(|| format!("the lock file has no {package}"))?
        .to_owned())
}

/// What the test reports.
#[derive(Debug, Deserialize)]
struct Outcome {
    /// Pieces before and after the cut.
    pieces: [u32; 2],
    /// Tets before and after the cut.
    tets: [u32; 2],
    /// Frames at the end.
    frame: u32,
    /// Error of the page, if there is one.
    error: Option<String>,
}

/// Opens the page in a browser and cuts a block.
fn check(out: &Path) -> anyhow::Result<()> {
    let page = std::fs::read_to_string(out.join("index.html"))?;
    std::fs::write(out.join("block.toml"), SCENE)?;
    let tested = page.replace("</body>", &format!("<script>{SCRIPT}</script>\n</body>"));
    std::fs::write(out.join("check.html"), tested)?;
    let mut server = Server::start(out.to_owned(), 0)?;
    let address = format!("http://{}/check.html?scene=block.toml", server.address());
    let profile = tempfile::tempdir()?;
    let _browser = browse(&address, profile.path())?;
    let report = server
        .report(TIME)
        .context("the page reports nothing; does the browser have WebGPU?")?;
    let outcome: Outcome = serde_json::from_str(&report).with_context(|| report.clone())?;
    if let Some(error) = &outcome.error {
        bail!("the page stopped: {error}");
    }
    ensure!(
        outcome.pieces == [1, 2] && outcome.tets[1] > outcome.tets[0],
        "the cut should make two pieces: {outcome:?}"
    );
    progress(&format!(
        "{} tets in one piece were cut into {} tets in two, frame {}",
        outcome.tets[0], outcome.tets[1], outcome.frame
    ));
    Ok(())
}

/// A browser that ends with its owner.
struct Browser(Child);

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn browse(address: &str, profile: &Path) -> anyhow::Result<Browser> {
    for name in BROWSERS {
        let started = Command::new(name)
            .args(["--headless=new", "--no-sandbox", "--no-first-run"])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
            ])
            .args(["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"])
            .args([
                "--enable-features=Vulkan",
                "--use-vulkan=swiftshader",
                "--use-angle=swiftshader",
            ])
            .arg("--window-size=900,600")
            .arg(format!("--user-data-dir={}", profile.display()))
            .arg(address)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        if let Ok(child) = started {
            return Ok(Browser(child));
        }
    }
    bail!("no Chromium was found ({})", BROWSERS.join(", "))
}
