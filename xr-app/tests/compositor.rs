//! What a real compositor makes of the pictures: Monado under Xvfb shows a session on a virtual screen, and
//! the screen is compared with what the offscreen renderer gives for the same eyes, and with where the balls
//! of the scene must be.
//!
//! The remote driver sends head and views. The display keeps the fields of its device, whatever views are
//! sent, and Monado resamples each picture from the field that the program submitted with it to that of the
//! display. So a program that submits something other than what it rendered is found out: a wrong field, eye,
//! pose, colour or a mirrored picture. Those errors are planted in the pictures of the screen, too, and have
//! to be found.

use std::io::Write as _;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::support::monado::{Sent, degrees, report, said, tools, validation};
use crate::support::screen::shot;
use crate::support::{device, silent};
use engine::gpu::Gpu;
use engine::image::{self, Image, WriteOptions};
use engine::render::{Fov, Look, Renderer, Scene, Settings, SplatKind, mode, quality_levels};
use engine::splat::{self, Activations as _, Splat, SplatSet};
use engine::transfer::{self, ColourPoint, Material, OpacityPoint, TransferFunction};
use glam::{DQuat, DVec3};
use xr_app::headset::{Eye, Pose};
use xr_app::placement::Placement;

/// Longest wait for the screen to show what it must: some 5 s are needed, more where other programs run.
const PATIENCE: Duration = Duration::from_secs(150);
/// Pixels of an eye on the screen of tools/xvfb.
const EYE: [usize; 2] = [640, 720];
/// Standard deviation of a ball, mm: 6 pixels of the display.
const BALL_MM: f32 = 10.0;
/// Intensities of the first and the last ball.
const RANGE: [f64; 2] = [400.0, 1600.0];
/// Least PSNR over the pixels that anything covers, dB; 49.8 to 51.2 were found. The program's views are
/// wider than the display, so that Monado magnifies a picture by 1.4, bilinearly: that and 8 bits take what
/// is left. A picture that is a pixel off has 30.
const LEAST_PSNR: f64 = 44.0;
/// Greatest distance of a ball's middle from where it must be, pixels; 0.23 was found. The near side of a
/// ball is larger than its far side and hides some of it, so that even an exact picture is off by 0.2.
const MOST_SHIFT: f64 = 0.4;
/// The balls, mm: no two in a line, none where the mirror image of another is, at several depths.
const BALLS: [[f32; 3]; 9] = [
    [-150.0, 0.0, 130.0],
    [-20.0, 60.0, 150.0],
    [140.0, -60.0, 110.0],
    [-100.0, -70.0, 0.0],
    [20.0, 0.0, 10.0],
    [160.0, 40.0, -20.0],
    [-140.0, 70.0, -130.0],
    [0.0, -40.0, -120.0],
    [90.0, 20.0, -150.0],
];

fn balls() -> SplatSet {
    let ball = |(i, mean): (usize, [f32; 3])| {
        let part = i as f64 / (BALLS.len() - 1) as f64;
        let intensity = (RANGE[0] + part * (RANGE[1] - RANGE[0])) as f32;
        let mut ball = Splat { mean, intensity, rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        ball.set_opacity(0.95);
        ball.set_scale([BALL_MM; 3]);
        ball
    };
    SplatSet { splats: BALLS.into_iter().enumerate().map(ball).collect(), ..SplatSet::default() }
}

/// Colours of their own for the balls, through which one sees, and no shading, so that their light is
/// brightest in the middle.
fn colours() -> TransferFunction {
    let colour = |intensity, colour| ColourPoint { intensity, colour: DVec3::from_array(colour) };
    let colours = vec![
        colour(RANGE[0], [1.0, 0.3, 0.1]),
        colour(1000.0, [0.3, 0.9, 0.2]),
        colour(RANGE[1], [0.2, 0.4, 1.0]),
    ];
    let opacities = vec![OpacityPoint { intensity: 0.0, opacity: 0.03 }];
    TransferFunction::new("balls", colours, opacities, Material { shade: false, ..Material::default() })
        .expect("a transfer function")
}

/// Returns what the display of Monado's remote headset shows to each eye, whatever views are sent: 85 degrees
/// of a picture of 65 mm by 70 mm.
fn display() -> Fov {
    let across = 42.5f64.to_radians().tan();
    let up = across * 0.070 / 0.065;
    Fov { left: -across, right: across, up, down: -up }
}

/// Returns a head, and views that are wider than the display, asymmetric, and turned outwards.
fn sent(head: Pose, outwards: f64) -> Sent {
    let eye = |side: f64| {
        let (outer, inner) = (-56.0, 48.0);
        let [left, right] = if side < 0.0 { [outer, inner] } else { [-inner, -outer] };
        let pose = Pose {
            position: DVec3::X * (side * 0.032),
            orientation: DQuat::from_rotation_y(-side * outwards.to_radians()),
        };
        Eye { pose, fov: degrees([left, right, 51.0, -53.0]) }
    };
    Sent { head, views: [eye(-1.0), eye(1.0)], hands: [None; 2] }
}

/// Where the remote driver's head is before anything is sent, so that it does not matter which frame is the
/// first.
const START: Pose = Pose { position: DVec3::new(0.0, 1.6, 0.0), orientation: DQuat::IDENTITY };

/// Returns the eyes in the room, seeing what the display shows.
fn eyes(sent: &Sent) -> [Eye; 2] {
    sent.views.map(|view| Eye {
        pose: Pose {
            position: sent.head.place(view.pose.position),
            orientation: sent.head.orientation * view.pose.orientation,
        },
        fov: display(),
    })
}

/// Returns what the renderer gives for eyes, of a patient who was put before [`START`].
fn rendered(gpu: &Gpu, scene: &Scene, eyes: &[Eye; 2]) -> [Image; 2] {
    let [low, high] = scene.bounds();
    let placement = Placement::before(&START, (low + high) * 0.5, (high - low).length() * 0.5);
    let settings = Settings { views: 2, ..Settings::new(EYE.map(|n| n as u32)) };
    let level = &quality_levels(SplatKind::Field)[0];
    let mut renderer =
        Renderer::new(gpu, mode(level.mode).expect("a mode"), scene, &settings).expect("a renderer");
    let cameras = eyes.map(|eye| placement.camera(&eye));
    renderer.render_at(scene, &cameras, &level.quality).expect("a picture");
    [0, 1].map(|eye| {
        let pixels = renderer.target.read_colour(eye).expect("a picture");
        Image { size: EYE, pixels }.over([0.0; 3])
    })
}

/// Returns where an eye sees the balls, pixels: by hand, without the renderer's cameras.
fn places(eye: &Eye) -> Vec<[f64; 2]> {
    let [low, high] = [f32::min, f32::max].map(|pick| {
        BALLS.into_iter().reduce(|a, b| [0, 1, 2].map(|axis| pick(a[axis], b[axis]))).expect("balls")
    });
    let place = |ball: &[f32; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(ball[axis] - 0.5 * (low[axis] + high[axis])) * 1e-3);
        // In real size, 0.6 m ahead; the patient's right is at the viewer's left, anterior towards the
        // viewer, superior up.
        let room = START.position + DVec3::new(-x, z, y - 0.6);
        let seen = eye.pose.orientation.inverse() * (room - eye.pose.position);
        let Fov { left, right, up, down } = eye.fov;
        let part = [(seen.x / -seen.z - left) / (right - left), (up - seen.y / -seen.z) / (up - down)];
        [part[0] * EYE[0] as f64, part[1] * EYE[1] as f64]
    };
    BALLS.iter().map(place).collect()
}

fn light(pixel: [f32; 4]) -> f64 {
    pixel[..3].iter().map(|&c| f64::from(c)).sum()
}

/// Returns the middle of the light around a place, pixels, if there is any.
fn middle(picture: &Image, around: [f64; 2]) -> Option<[f64; 2]> {
    let reach = 20.0;
    let range = |axis: usize| {
        let [from, to] =
            [around[axis] - reach, around[axis] + reach].map(|at| at.clamp(0.0, EYE[axis] as f64));
        from as usize..to as usize
    };
    let mut sum = [0.0; 3];
    for y in range(1) {
        for x in range(0) {
            let light = light(picture.at(x, y));
            sum = [sum[0] + light, sum[1] + light * (x as f64 + 0.5), sum[2] + light * (y as f64 + 0.5)];
        }
    }
    (sum[0] > 1.0).then(|| [sum[1] / sum[0], sum[2] / sum[0]])
}

/// How far what the screen shows to an eye is from what it must show.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// dB, over the pixels that are not black in one of the pictures.
    psnr: f64,
    /// The greatest of a ball, pixels.
    shift: f64,
}

impl Off {
    fn of(found: &Image, expected: &Image, eye: &Eye) -> Self {
        let (mut squares, mut count) = (0.0, 0);
        for (f, e) in found.pixels.iter().zip(&expected.pixels) {
            if light(*f).max(light(*e)) > 0.03 {
                squares += (0..3).map(|c| f64::from(f[c] - e[c]).powi(2)).sum::<f64>();
                count += 3;
            }
        }
        let shifts = places(eye).into_iter().map(|place| match middle(found, place) {
            Some(found) => (found[0] - place[0]).hypot(found[1] - place[1]),
            None => f64::INFINITY,
        });
        Off { psnr: -10.0 * (squares / f64::from(count)).log10(), shift: shifts.fold(0.0, f64::max) }
    }

    fn agrees(&self) -> bool {
        self.psnr >= LEAST_PSNR && self.shift <= MOST_SHIFT
    }
}

/// What the screen must show.
struct Wanted {
    eyes: [Eye; 2],
    pictures: [Image; 2],
}

impl Wanted {
    fn off(&self, found: &[Image; 2]) -> [Off; 2] {
        [0, 1].map(|eye| Off::of(&found[eye], &self.pictures[eye], &self.eyes[eye]))
    }
}

/// Returns the halves of the screen.
fn halves(screen: &Image) -> [Image; 2] {
    assert_eq!(screen.size, [2 * EYE[0], EYE[1]], "the screen of tools/xvfb");
    [0, 1].map(|eye| {
        let pixels = screen.pixels.chunks(screen.size[0]).flat_map(|row| &row[eye * EYE[0]..][..EYE[0]]);
        Image { size: EYE, pixels: pixels.copied().collect() }
    })
}

/// The pictures, made others by where a pixel comes from and what becomes of its colour.
fn changed(
    eyes: &[Image; 2],
    from: impl Fn(usize, usize) -> [usize; 2],
    colour: impl Fn([f32; 3]) -> [f32; 3],
) -> [Image; 2] {
    [0, 1].map(|eye| {
        let pixel = |i: usize| {
            let [x, y] = from(i % EYE[0], i / EYE[0]);
            let [r, g, b, a] = eyes[eye].at(x, y);
            let [r, g, b] = colour([r, g, b]);
            [r, g, b, a]
        };
        Image { size: EYE, pixels: (0..EYE[0] * EYE[1]).map(pixel).collect() }
    })
}

fn encoded(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn decoded(display: f32) -> f32 {
    if display <= 0.040_45 { display / 12.92 } else { ((display + 0.055) / 1.055).powf(2.4) }
}

/// A session on a screen of its own, as long as there is a file.
struct Session {
    folder: tempfile::TempDir,
    child: Option<Child>,
    remote: Option<TcpStream>,
}

impl Session {
    fn start(tools: &Path) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        splat::write(&folder.path().join("scene.ply"), &balls(), false).expect("a file");
        transfer::save(&colours(), folder.path().join("balls.vp.json"), false).expect("a file");
        std::fs::write(folder.path().join("show"), "").expect("a file");
        let script = format!(
            "echo $VGS_SCREEN > screen; echo $MONADO_PORT > port
             {run} {program} scene.ply --tf balls.vp.json --level 0 --card=never --validation --report report.json & app=$!
             while [ -e show ] && kill -0 $app 2>/dev/null; do sleep 0.1; done
             kill $app; wait $app",
            run = tools.join("run").display(),
            program = env!("CARGO_BIN_EXE_vgs-xr")
        );
        let child = Command::new(tools.join("xvfb"))
            .arg(tools.join("monado"))
            .args(["bash", "-c", &script])
            .current_dir(folder.path())
            .envs([("MONADO_MODE", "xcb"), ("MONADO_HEAD", "remote")])
            .envs(validation(folder.path()))
            .env("MONADO_LOG", folder.path().join("monado.log"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("tools");
        Session { folder, child: Some(child), remote: None }
    }

    /// Returns what a file of the session names.
    fn named(&self, file: &str) -> Option<String> {
        let text = std::fs::read_to_string(self.folder.path().join(file)).ok()?;
        text.ends_with('\n').then(|| text.trim().to_owned())
    }

    fn send(&mut self, sent: &Sent) {
        if self.remote.is_none() {
            let port = self.named("port").and_then(|port| port.parse::<u16>().ok());
            self.remote = port.and_then(|port| TcpStream::connect(("127.0.0.1", port)).ok());
        }
        if let Some(remote) = &mut self.remote {
            // Where the service has gone, the session has ended, and that is found out.
            let _ = remote.write_all(&sent.packet());
        }
    }

    /// Sends this until the screen shows what is wanted, and gives both eyes' part of it.
    fn wait(&mut self, what: &str, sent: &Sent, wanted: &Wanted) -> [Image; 2] {
        let start = Instant::now();
        loop {
            self.send(sent);
            let screen = self.named("screen").and_then(|file| shot(Path::new(&file)));
            let found = screen.as_ref().map(halves);
            let off = found.as_ref().map(|found| wanted.off(found));
            if let (Some(found), Some(off)) = (&found, off)
                && off.iter().all(Off::agrees)
            {
                println!("{what}: {off:.2?} after {:.1} s", start.elapsed().as_secs_f64());
                return found.clone();
            }
            let ended = self.child.as_mut().is_none_or(|child| child.try_wait().expect("a child").is_some());
            if ended || start.elapsed() > PATIENCE {
                let found = found.unwrap_or_else(|| [0, 1].map(|_| Image::new(EYE, [0.0; 4])));
                let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
                keep(folder, &format!("{what}-expected"), &wanted.pictures);
                keep(folder, &format!("{what}-found"), &found);
                let output = self.end();
                panic!("{what}: {off:.2?}; {} has the pictures\n{}", folder.display(), said(&output));
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Ends the program, and with it compositor and screen.
    fn end(&mut self) -> Output {
        let _ = std::fs::remove_file(self.folder.path().join("show"));
        self.child.take().expect("it has not ended").wait_with_output().expect("a child")
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if self.child.is_some() {
            self.end();
        }
    }
}

/// Writes the pictures of both eyes side by side.
fn keep(folder: &Path, name: &str, eyes: &[Image; 2]) {
    let rows = eyes[0].pixels.chunks(EYE[0]).zip(eyes[1].pixels.chunks(EYE[0]));
    let both = Image {
        size: [2 * EYE[0], EYE[1]],
        pixels: rows.flat_map(|(left, right)| left.iter().chain(right)).copied().collect(),
    };
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    image::write(folder.join(format!("{name}.png")), &both, None, &options).expect("a picture");
}

/// Errors as they are made, planted in what a screen showed: each has to be told from what it must show.
fn planted_errors_are_found(what: &str, found: &[Image; 2], wanted: &Wanted, earlier: &[Image; 2]) {
    let [width, height] = EYE;
    let moved = |from: &dyn Fn(usize, usize) -> [usize; 2]| changed(found, from, |colour| colour);
    let coloured = |colour: &dyn Fn([f32; 3]) -> [f32; 3]| changed(found, |x, y| [x, y], colour);
    // A field that is half a degree wider on each side than it is said to be.
    let wider = |n: usize, of: usize| {
        let middle = of as f64 * 0.5;
        let part = 43f64.to_radians().tan() / 42.5f64.to_radians().tan();
        ((n as f64 + 0.5 - middle) * part + middle).clamp(0.0, of as f64 - 1.0) as usize
    };
    let planted = [
        ("swapped eyes", [1, 0].map(|eye| found[eye].clone())),
        ("the left eye's picture for both", [0, 0].map(|eye| found[eye].clone())),
        ("mirrored from left to right", moved(&|x, y| [width - 1 - x, y])),
        ("upside down", moved(&|x, y| [x, height - 1 - y])),
        ("sRGB encoded twice", coloured(&|c| c.map(encoded))),
        ("sRGB not encoded", coloured(&|c| c.map(decoded))),
        ("red for blue", coloured(&|[r, g, b]| [b, g, r])),
        ("a wrong field", moved(&|x, y| [wider(x, width), wider(y, height)])),
        ("a pixel to the side", moved(&|x, y| [(x + 1).min(width - 1), y])),
        ("the head as it was", earlier.clone()),
    ];
    for (error, pictures) in planted {
        let off = wanted.off(&pictures);
        println!("{what}, {error}: {off:.2?}");
        assert!(!off.iter().all(Off::agrees), "{what}: {error} is not found: {off:.2?}");
    }
}

#[test]
fn the_screen_shows_what_the_renderer_gives() {
    let Some(tools) = tools(&["window", "xr"]) else { return };
    let gpu = device();
    let scene = Scene::new(&gpu, Some(&balls()), None, &Look::new(colours())).expect("a scene");
    let ahead = sent(START, 0.0);
    let turn = DQuat::from_rotation_y(0.16) * DQuat::from_rotation_x(-0.08) * DQuat::from_rotation_z(0.1);
    let aside = sent(Pose { position: DVec3::new(0.04, 1.57, 0.05), orientation: turn }, 2.5);
    let [ahead, aside] = [ahead, aside].map(|sent| {
        let eyes = eyes(&sent);
        (sent, Wanted { pictures: rendered(&gpu, &scene, &eyes), eyes })
    });
    silent(&gpu);
    let black = [0, 1].map(|_| Image::new(EYE, [0.0, 0.0, 0.0, 1.0]));
    let mut session = Session::start(&tools);
    // The patient is put before the head when that is first seen, and stays there when it turns.
    let first = session.wait("ahead", &ahead.0, &ahead.1);
    let second = session.wait("aside", &aside.0, &aside.1);
    let output = session.end();
    report(session.folder.path(), &output);
    planted_errors_are_found("ahead", &first, &ahead.1, &black);
    planted_errors_are_found("aside", &second, &aside.1, &first);
}
