//! `cargo xtask viewer-smoke`: tests the viewer with synthetic input on a virtual screen.
//!
//! It builds the viewer, opens a scene of a block on a table, cuts the block in two with the mouse, undoes the cut,
//! pulls the body and checks the screen after each: the image is not blank, the panel is visible, one piece has become
//! two. Needs Xvfb and an adapter that can show windows there, such as Mesa's lavapipe; the normal checks only compile
//! the viewer.

mod screen;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use clap::Args;
use incise_render::Image;

use screen::{Button, Running, Screen};

/// Options of `cargo xtask viewer-smoke`.
#[derive(Debug, Args)]
pub(crate) struct SmokeArguments {
    /// Folder of the screenshots.
    #[arg(long, default_value = "target/viewer-smoke")]
    out: PathBuf,
    /// Viewer program; without it, the viewer is built in release.
    #[arg(long)]
    viewer: Option<PathBuf>,
    /// Compute device of the viewer: cpu, gpu or auto.
    #[arg(long, default_value = "cpu")]
    backend: String,
}

/// Size of the screen in pixels; the window is as large.
const SIZE: [u16; 2] = [1280, 800];
/// Left edge of the panel in pixels.
const PANEL: u32 = 960;
/// Key symbol of the help key.
const F1: u32 = 0xffbe;
/// Smallest fraction of the image that counts as a piece.
const PART: f64 = 0.01;

/// A block on a table: a stroke through it separates it.
const SCENE: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
ground = { height = 0.0, friction = 0.6 }

[solver]
time_step = 0.01
substeps = 10

[[body]]
shape = { kind = "beam", tets = 2000 }
scale = 0.3
position = [0.0, 0.0, 0.06]
young_modulus = 2e4
damping = 0.01
"#;

pub(crate) fn smoke(arguments: &SmokeArguments) -> anyhow::Result<()> {
    std::fs::create_dir_all(&arguments.out)?;
    let viewer = match &arguments.viewer {
        Some(viewer) => viewer.clone(),
        None => build()?,
    };
    let scene = arguments.out.join("block.toml");
    std::fs::write(&scene, SCENE)?;
    let screen = Screen::start(SIZE)?;
    let scene = scene.to_string_lossy();
    let mut running = start(&viewer, &[&*scene], &arguments.backend, &screen)?;
    let result = use_it(&screen, &arguments.out);
    // The output of a crashed viewer is more useful than its exit status.
    if let Ok(Some(status)) = running.0.try_wait() {
        bail!("the viewer ended with {status}: {result:?}");
    }
    result?;
    drop(running);
    progress("the built-in liver is cut");
    portrait(&viewer, &arguments.backend, &screen, &arguments.out)?;
    progress(&format!("screenshots are in {}", arguments.out.display()));
    Ok(())
}

/// Builds the viewer and returns its path.
fn build() -> anyhow::Result<PathBuf> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let output = Command::new(cargo)
        .args(["build", "--release", "-p", "incise-viewer"])
        .args(["--message-format", "json-render-diagnostics"])
        .stderr(Stdio::inherit())
        .output()?;
    ensure!(output.status.success(), "the viewer does not build");
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let messages = lines
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok());
    messages
        .filter_map(|message: serde_json::Value| message["executable"].as_str().map(PathBuf::from))
        .next_back()
        .context("cargo names no executable")
}

fn start(
    viewer: &Path,
    arguments: &[&str],
    backend: &str,
    screen: &Screen,
) -> anyhow::Result<Running> {
    let child = Command::new(viewer)
        .args(arguments)
        .args(["--backend", backend])
        .env("DISPLAY", &screen.display)
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .spawn()
        .with_context(|| format!("{} cannot be started", viewer.display()))?;
    Ok(Running(child))
}

/// The built-in liver in the middle of its cut, after a fixed number of frames, for the README.
fn portrait(viewer: &Path, backend: &str, screen: &Screen, out: &Path) -> anyhow::Result<()> {
    const FRAMES: usize = 38;
    let _viewer = start(viewer, &["--paused"], backend, screen)?;
    screen.window("built-in liver", Duration::from_secs(60))?;
    until("the liver is shown", || {
        Ok(colors_of(&body(&screen.picture()?)) > 200)
    })?;
    for _ in 0..FRAMES {
        screen.key('.')?;
        sleep(Duration::from_millis(60));
    }
    // The last frames may still be in a queue.
    sleep(Duration::from_secs(2));
    screen.picture()?.write_png(out.join("8-liver.png"))?;
    Ok(())
}

/// Simulates a user session.
fn use_it(screen: &Screen, out: &Path) -> anyhow::Result<()> {
    screen.window("block.toml", Duration::from_secs(60))?;
    let look = |name: &str| -> anyhow::Result<Image> {
        let picture = screen.picture()?;
        picture.write_png(out.join(name))?;
        Ok(picture)
    };
    let step = |what: &str| progress(what);

    step("the picture is not blank, the panel is there");
    until("the body is shown", || {
        Ok(colors_of(&body(&screen.picture()?)) > 200)
    })?;
    let with_panel = look("1-start.png")?;
    screen.key('p')?;
    let is_gone = || Ok(differ(&panel(&screen.picture()?), &panel(&with_panel)) > 0.5);
    until("the panel goes", is_gone)?;
    screen.key('p')?;
    let is_back = || Ok(differ(&panel(&screen.picture()?), &panel(&with_panel)) < 0.3);
    until("the panel comes back", is_back)?;
    ensure!(
        colors_of(&panel(&screen.picture()?)) > 30,
        "the panel is blank"
    );

    step("colored by piece, the body has one color");
    screen.key('4')?;
    until("one piece", || Ok(hues(&body(&screen.picture()?)) == 1))?;
    look("2-one-piece.png")?;

    step("a stroke through it leaves two");
    let (x, bottom) = (i16::try_from(PANEL / 2)?, i16::try_from(SIZE[1])? - 60);
    screen.drag(Button::Left, [x, 60], [x + 20, bottom], 40)?;
    until("two pieces", || Ok(hues(&body(&screen.picture()?)) == 2))?;
    look("3-two-pieces.png")?;

    step("after Undo it has one again");
    screen.key('u')?;
    until("one piece again", || {
        Ok(hues(&body(&screen.picture()?)) == 1)
    })?;

    step("the grab pulls it, and the view orbits");
    screen.key('g')?;
    let before = look("4-taken-back.png")?;
    let middle = [x, i16::try_from(SIZE[1] / 2)?];
    screen.hold(Button::Left, middle, [x + 120, middle[1] - 160], 30)?;
    let moved = || Ok(differ(&body(&screen.picture()?), &body(&before)) > 0.02);
    until("the body follows the pointer", moved)?;
    look("5-pulled.png")?;
    screen.release(Button::Left)?;
    screen.drag(Button::Right, middle, [x + 200, middle[1] + 40], 10)?;
    screen.key('w')?;
    screen.key('1')?;
    sleep(Duration::from_millis(500));

    step("the keys are listed");
    let before = look("6-turned-wireframe.png")?;
    screen.press(F1)?;
    until("the keys are there", || {
        Ok(differ(&screen.picture()?, &before) > 0.1)
    })?;
    look("7-keys.png")?;
    Ok(())
}

#[expect(clippy::print_stdout, reason = "progress of a script")]
fn progress(what: &str) {
    println!("{what}");
}

/// Waits until a condition holds; a software renderer may take a second per frame.
fn until(what: &str, is_so: impl Fn() -> anyhow::Result<bool>) -> anyhow::Result<()> {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(30) {
        if is_so()? {
            return Ok(());
        }
        sleep(Duration::from_millis(100));
    }
    bail!("waited 30 s for: {what}")
}

/// A column of the screen.
fn columns(picture: &Image, from: u32, to: u32) -> Image {
    let row = 4 * picture.width as usize;
    let (left, right) = (4 * from as usize, 4 * to as usize);
    let rows = picture.rgba.chunks_exact(row);
    Image {
        width: to - from,
        height: picture.height,
        rgba: rows
            .flat_map(|row| row[left..right].iter().copied())
            .collect(),
    }
}

fn body(picture: &Image) -> Image {
    columns(picture, 0, PANEL - 10)
}

fn panel(picture: &Image) -> Image {
    columns(picture, PANEL, picture.width)
}

fn pixels(picture: &Image) -> impl Iterator<Item = [u8; 3]> + '_ {
    picture
        .rgba
        .chunks_exact(4)
        .map(|rgba| [rgba[0], rgba[1], rgba[2]])
}

/// Number of distinct colors.
fn colors_of(picture: &Image) -> usize {
    let mut colors: Vec<[u8; 3]> = pixels(picture).collect();
    colors.sort_unstable();
    colors.dedup();
    colors.len()
}

/// Fraction of visibly different pixels.
fn differ(a: &Image, b: &Image) -> f64 {
    let far = |(a, b): &([u8; 3], [u8; 3])| (0..3).any(|k| a[k].abs_diff(b[k]) > 12);
    let count = pixels(a).zip(pixels(b)).filter(far).count();
    count as f64 / f64::from(a.width * a.height)
}

/// Number of hues of saturated colors: the colors of pieces have distinct hues, which shading does not change.
fn hues(picture: &Image) -> usize {
    const BINS: usize = 36;
    let mut count = [0_usize; BINS];
    for [red, green, blue] in pixels(picture) {
        let [r, g, b] = [red, green, blue].map(f64::from);
        let (high, low) = (r.max(g).max(b), r.min(g).min(b));
        if high - low < 0.3 * high || high < 40.0 {
            continue;
        }
        let sixth = if high == r {
            ((g - b) / (high - low)).rem_euclid(6.0)
        } else if high == g {
            (b - r) / (high - low) + 2.0
        } else {
            (r - g) / (high - low) + 4.0
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a sixth of a circle is from 0 to below 6"
        )]
        let bin = (sixth / 6.0 * BINS as f64) as usize;
        count[bin.min(BINS - 1)] += 1;
    }
    let enough = PART * f64::from(picture.width * picture.height);
    // Neighboring bins are one hue.
    let strong: Vec<bool> = (0..BINS).map(|bin| count[bin] as f64 > enough).collect();
    (0..BINS)
        .filter(|&bin| strong[bin] && !strong[(bin + BINS - 1) % BINS])
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(colors: &[[u8; 3]]) -> Image {
        let row = colors
            .iter()
            .flat_map(|&[r, g, b]| [r, g, b, 255].repeat(20));
        Image {
            width: 20 * u32::try_from(colors.len()).unwrap(),
            height: 10,
            rgba: row.collect::<Vec<u8>>().repeat(10),
        }
    }

    #[test]
    fn hues_are_counted_whatever_the_light() {
        let gray = [200, 200, 205];
        let (blue, dark_blue) = ([40, 90, 200], [20, 45, 100]);
        let orange = [220, 130, 30];
        assert_eq!(hues(&stripes(&[gray, gray])), 0);
        assert_eq!(hues(&stripes(&[gray, blue, dark_blue])), 1);
        assert_eq!(hues(&stripes(&[gray, blue, orange, dark_blue])), 2);
    }

    #[test]
    fn columns_are_cut_out() {
        let picture = stripes(&[[1, 2, 3], [9, 9, 9]]);
        assert_eq!(columns(&picture, 20, 40).rgba, stripes(&[[9, 9, 9]]).rgba);
        assert_eq!(differ(&picture, &picture), 0.0);
        assert_eq!(colors_of(&picture), 2);
    }
}
