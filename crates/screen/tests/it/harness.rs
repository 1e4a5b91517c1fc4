//! A display of its own for each test, and windows on it.

use std::io::Read as _;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use spf_media::Rgb;
use spf_screen::{Display, Eye, Hidden, Shown};
use x11rb::connection::Connection as _;
use x11rb::protocol::xproto::{ConnectionExt as _, CreateGCAux, CreateWindowAux, ImageFormat, PropMode, WindowClass};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use crate::server::Server;
pub(crate) use crate::server::{PATIENCE, Program, wait, wait_or_say};

/// A display, and the programs on it.
pub(crate) struct Screen(Server);

/// The class of the windows, in another case.
pub(crate) const CLASS: &str = "SPF test";

impl Screen {
    /// `None` if a program is missing, which with `CI=true` is a failure.
    pub(crate) fn start(size: &str) -> Option<Self> {
        if let Some(missing) = Server::missing(&[]) {
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{missing} is missing");
            eprintln!("NOT CHECKED: {missing} is missing");
            return None;
        }
        Some(Self(Server::start(size)))
    }

    /// Another server's display.
    pub(crate) fn of(name: &str) -> Self {
        Self(Server::of(name))
    }

    pub(crate) fn command(&self, program: &str, args: &[&str]) -> Command {
        self.0.command(program, args)
    }

    /// Runs a program; what it printed if it succeeded.
    pub(crate) fn run(&self, program: &str, args: &[&str]) -> Option<String> {
        let output = self.command(program, args).output().unwrap();
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }

    pub(crate) fn display(&self) -> Display {
        Display::open(Some(&self.0.name)).unwrap()
    }
}

/// A window with a picture. Its background is the picture, so that the server redraws it.
pub(crate) struct Shop {
    connection: RustConnection,
    pub(crate) window: u32,
}

impl Shop {
    pub(crate) fn open(screen: &Screen, title: &str, at: (i16, i16), image: &Rgb) -> Self {
        let shop = Self::map(screen, title, image);
        shop.place(screen, at);
        shop
    }

    /// Where the window manager wants it.
    pub(crate) fn map(screen: &Screen, title: &str, image: &Rgb) -> Self {
        let (connection, number) = RustConnection::connect(Some(&screen.0.name)).unwrap();
        let root = connection.setup().roots[number].clone();
        let (width, height) = (image.width() as u16, image.height() as u16);
        let (window, pixmap, context) =
            (connection.generate_id().unwrap(), connection.generate_id().unwrap(), connection.generate_id().unwrap());
        connection.create_pixmap(root.root_depth, pixmap, root.root, width, height).unwrap();
        connection.create_gc(context, pixmap, &CreateGCAux::new()).unwrap();
        let bytes: Vec<u8> = image.data().chunks_exact(3).flat_map(|pixel| [pixel[2], pixel[1], pixel[0], 0]).collect();
        // Requests are limited to 256 kB.
        for (number, rows) in bytes.chunks(usize::from(width) * 4 * 40).enumerate() {
            let count = (rows.len() / (usize::from(width) * 4)) as u16;
            let top = 40 * number as i16;
            connection.put_image(ImageFormat::Z_PIXMAP, pixmap, context, width, count, 0, top, 0, root.root_depth, rows).unwrap();
        }
        let looks = CreateWindowAux::new().background_pixmap(pixmap);
        let kind = WindowClass::INPUT_OUTPUT;
        connection.create_window(root.root_depth, window, root.root, 0, 0, width, height, 0, kind, 0, &looks).unwrap();
        let (name, text) = (x11rb::protocol::xproto::AtomEnum::WM_NAME, x11rb::protocol::xproto::AtomEnum::STRING);
        connection.change_property8(PropMode::REPLACE, window, name, text, title.as_bytes()).unwrap();
        let class = format!("instance\0{CLASS}\0");
        let (name, text) = (x11rb::protocol::xproto::AtomEnum::WM_CLASS, x11rb::protocol::xproto::AtomEnum::STRING);
        connection.change_property8(PropMode::REPLACE, window, name, text, class.as_bytes()).unwrap();
        connection.map_window(window).unwrap();
        connection.flush().unwrap();
        let shop = Self { connection, window };
        wait("the window", || screen.display().windows().unwrap().iter().any(|it| it.id == window && it.shown));
        shop
    }

    /// Moves it, and waits until it is there; the window manager sets its frame there.
    pub(crate) fn place(&self, screen: &Screen, (x, y): (i16, i16)) {
        screen.run("xdotool", &["windowmove", &self.window.to_string(), &x.to_string(), &y.to_string()]).unwrap();
        // The frame is at most a few dozen pixels thick.
        let is_near = |at: i32, wanted: i16| (0..50).contains(&(at - i32::from(wanted)));
        wait("the window's place", || {
            let windows = screen.display().windows().unwrap();
            windows.iter().any(|it| it.id == self.window && is_near(it.area.x, x) && is_near(it.area.y, y))
        });
    }

    pub(crate) fn close(self) {
        self.connection.destroy_window(self.window).unwrap();
        self.connection.flush().unwrap();
    }
}

/// Looks until what is seen is as expected.
pub(crate) fn look(eye: &mut Eye, what: &str, mut expected: impl FnMut(&Result<Shown, Hidden>) -> bool) -> Result<Shown, Hidden> {
    let mut seen = eye.look().unwrap();
    let begun = Instant::now();
    while !expected(&seen) {
        assert!(begun.elapsed() < PATIENCE, "{what}: {:?}", seen.map(|shown| shown.area));
        std::thread::sleep(Duration::from_millis(20));
        seen = eye.look().unwrap();
    }
    seen
}

/// A picture without repetitions.
pub(crate) fn pattern(width: u32, height: u32, seed: u32) -> Rgb {
    let mut image = Rgb::new(width, height);
    for y in 0..height {
        for x in 0..width {
            image.set_pixel(x, y, [(x * 7 + seed) as u8, (y * 3) as u8, (x * y + seed) as u8]);
        }
    }
    image
}

/// What a program has printed so far, read in a thread of its own.
pub(crate) fn printed(child: &mut Child) -> std::sync::Arc<std::sync::Mutex<String>> {
    let mut output = child.stdout.take().unwrap();
    let text = std::sync::Arc::<std::sync::Mutex<String>>::default();
    let written = text.clone();
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = output.read(&mut bytes) {
            written.lock().unwrap().push_str(&String::from_utf8_lossy(&bytes[..count]));
        }
    });
    text
}
