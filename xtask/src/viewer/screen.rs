//! [`Screen`]: a virtual X server with synthetic input.
//!
//! Xvfb keeps the image in memory; pointer and key events use its XTEST extension.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use incise_render::Image;
use x11rb::CURRENT_TIME;
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConnectionExt, ImageFormat, InputFocus,
    KEY_PRESS_EVENT, KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT, MapState, Window,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

/// A child process that is killed when dropped.
#[derive(Debug)]
pub(super) struct Running(pub(super) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A button of a mouse.
#[derive(Clone, Copy, Debug)]
pub(super) enum Button {
    Left = 1,
    Right = 3,
}

/// An X server and a connection to it.
pub(super) struct Screen {
    /// Name of the display, for the variable `DISPLAY`.
    pub(super) display: String,
    connection: RustConnection,
    root: Window,
    size: [u16; 2],
    _server: Running,
}

impl Screen {
    /// Starts a server with a screen of some size in pixels.
    pub(super) fn start(size: [u16; 2]) -> anyhow::Result<Self> {
        let [width, height] = size;
        let mut server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-nolisten",
                "tcp",
                "-noreset",
                "-screen",
                "0",
            ])
            .arg(format!("{width}x{height}x24"))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .context("Xvfb cannot be started: is it installed (package `xvfb`)?")?;
        let output = server.stdout.take().context("Xvfb has no output")?;
        let server = Running(server);
        let mut number = String::new();
        BufReader::new(output).read_line(&mut number)?;
        let number = number.trim();
        if number.is_empty() {
            bail!("Xvfb found no free display");
        }
        let display = format!(":{number}");
        let (connection, screen) = x11rb::connect(Some(&display))?;
        let root = connection.setup().roots[screen].root;
        Ok(Self {
            display,
            connection,
            root,
            size,
            _server: server,
        })
    }

    /// Waits until a window with a part of a title is shown, gives it the keyboard and returns it.
    pub(super) fn window(&self, title: &str, patience: Duration) -> anyhow::Result<Window> {
        let start = Instant::now();
        while start.elapsed() < patience {
            for window in self.connection.query_tree(self.root)?.reply()?.children {
                let name = self.connection.get_property(
                    false,
                    window,
                    x11rb::protocol::xproto::AtomEnum::WM_NAME,
                    x11rb::protocol::xproto::AtomEnum::ANY,
                    0,
                    1024,
                )?;
                let name = String::from_utf8_lossy(&name.reply()?.value).into_owned();
                let shown = self.connection.get_window_attributes(window)?.reply()?;
                if name.contains(title) && shown.map_state == MapState::VIEWABLE {
                    self.connection.set_input_focus(
                        InputFocus::POINTER_ROOT,
                        window,
                        CURRENT_TIME,
                    )?;
                    self.connection.flush()?;
                    return Ok(window);
                }
            }
            sleep(Duration::from_millis(50));
        }
        Err(anyhow!(
            "no window with `{title}` in its title after {patience:?}"
        ))
    }

    fn send(&self, kind: u8, detail: u8, at: [i16; 2]) -> anyhow::Result<()> {
        let [x, y] = at;
        self.connection
            .xtest_fake_input(kind, detail, CURRENT_TIME, self.root, x, y, 0)?
            .check()?;
        Ok(())
    }

    /// Moves the pointer.
    pub(super) fn point(&self, at: [i16; 2]) -> anyhow::Result<()> {
        self.send(MOTION_NOTIFY_EVENT, 0, at)
    }

    /// Drags from one point to another in several steps.
    pub(super) fn drag(
        &self,
        button: Button,
        from: [i16; 2],
        to: [i16; 2],
        steps: i16,
    ) -> anyhow::Result<()> {
        self.hold(button, from, to, steps)?;
        self.release(button)
    }

    /// Releases a button.
    pub(super) fn release(&self, button: Button) -> anyhow::Result<()> {
        self.send(BUTTON_RELEASE_EVENT, button as u8, [0, 0])
    }

    /// Drags from one point to another in several steps and keeps the button pressed.
    pub(super) fn hold(
        &self,
        button: Button,
        from: [i16; 2],
        to: [i16; 2],
        steps: i16,
    ) -> anyhow::Result<()> {
        self.point(from)?;
        self.send(BUTTON_PRESS_EVENT, button as u8, [0, 0])?;
        for step in 1..=steps {
            sleep(Duration::from_millis(25));
            let part = |k: usize| from[k] + (to[k] - from[k]) * step / steps;
            self.point([part(0), part(1)])?;
        }
        Ok(())
    }

    /// Presses and releases a key that carries a character.
    pub(super) fn key(&self, character: char) -> anyhow::Result<()> {
        // Characters of Latin 1 are their own symbols.
        self.press(u32::from(character.to_ascii_lowercase()))
    }

    /// Presses and releases the key of a symbol.
    pub(super) fn press(&self, symbol: u32) -> anyhow::Result<()> {
        let setup = self.connection.setup();
        let (first, last) = (setup.min_keycode, setup.max_keycode);
        let map = self
            .connection
            .get_keyboard_mapping(first, last - first + 1)?;
        let map = map.reply()?;
        let per_key = usize::from(map.keysyms_per_keycode);
        let place = map
            .keysyms
            .chunks(per_key)
            .position(|syms| syms.first() == Some(&symbol));
        let place = place.with_context(|| format!("no key carries the symbol {symbol:#x}"))?;
        let code = first + u8::try_from(place)?;
        self.send(KEY_PRESS_EVENT, code, [0, 0])?;
        sleep(Duration::from_millis(40));
        self.send(KEY_RELEASE_EVENT, code, [0, 0])?;
        sleep(Duration::from_millis(40));
        Ok(())
    }

    /// Image of the screen.
    pub(super) fn picture(&self) -> anyhow::Result<Image> {
        let [width, height] = self.size;
        let image = self.connection.get_image(
            ImageFormat::Z_PIXMAP,
            self.root,
            0,
            0,
            width,
            height,
            u32::MAX,
        )?;
        let data = image.reply()?.data;
        // 32 bits a pixel: blue, green, red, nothing.
        let rgba = data
            .chunks_exact(4)
            .flat_map(|bgrx| [bgrx[2], bgrx[1], bgrx[0], 255]);
        Ok(Image {
            width: u32::from(width),
            height: u32::from(height),
            rgba: rgba.collect(),
        })
    }
}
