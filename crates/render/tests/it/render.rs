//! The renderer on a small yard: geometry checked against calculated numbers, channels against one another, and the
//! same bits on any number of threads.

use std::hash::Hasher as _;

use fnv::FnvHasher;
use glam::{Vec2, Vec3};
use spf_core::camera::Camera;
use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_media::file;
use spf_render::{Channels, Quality, RenderedImage, Renderer};
use spf_scene::geometry::{Pattern, Role, SceneGeometry};
use spf_scene::texture::Texture;

use crate::yard;

fn pose(east: f64, north: f64, up: f64, heading_deg: f64) -> Pose {
    let attitude = Attitude { heading: heading_deg.to_radians(), ..Attitude::default() };
    Pose { position: EnuPosition { east, north, up }, attitude }
}

fn level() -> Camera {
    Camera { tilt: 0.0, ..Camera::quad() }
}

/// FNV-1a over all channels, floats by their bits.
fn digest(image: &RenderedImage) -> u64 {
    let mut hasher = FnvHasher::default();
    image.rgb.iter().for_each(|bytes| hasher.write(bytes));
    for words in [&image.ids, &image.opening_ids] {
        words.iter().flatten().for_each(|w| hasher.write(&w.to_le_bytes()));
    }
    for floats in [&image.depth, &image.opening_depth] {
        floats.iter().flatten().for_each(|f| hasher.write(&f.to_le_bytes()));
    }
    hasher.finish()
}

#[test]
fn a_wall_is_where_it_stands_and_as_far() {
    let mut scene = yard::empty();
    // A wall 20 m north of the lens, 4 m wide, 2 m high, its middle at the height of the lens.
    scene.add_box(Vec3::new(-2.0, 20.0, 1.0), Vec3::new(2.0, 21.0, 3.0), 1, 9, Role::Solid);
    let image = Renderer::new(&scene.geometry).render(&level(), &pose(0.0, 0.0, 2.0, 0.0), Channels::TRUTH);
    let (ids, depth) = (image.ids.unwrap(), image.depth.unwrap());
    // fx = 480: the edges stand at 480 ± 2/20·480 = 432 and 528, fy = 480.3: 360 ± 24.
    for (x, y, inside) in
        [(432, 360, true), (431, 360, false), (527, 360, true), (528, 360, false), (480, 337, true), (480, 335, false)]
    {
        let i = y * 960 + x;
        assert_eq!(ids[i] == 9, inside, "({x}, {y})");
        if inside {
            assert!((depth[i] - 20.0).abs() < 1e-3, "{}", depth[i]);
        }
    }
    assert_eq!(ids.iter().filter(|&&id| id == 9).count(), 96 * 48);
}

#[test]
fn an_image_hangs_upright_and_repeats() {
    let mut scene = yard::empty();
    // Red over green, left over right: red, white / green, black. Facing south, 8 m square, two repetitions across, one up.
    let rgb = [[200, 10, 10], [230, 230, 230], [10, 160, 10], [5, 5, 5]].concat();
    scene.geometry.textures.push(Texture::from_srgb(2, 2, &rgb).unwrap());
    let image = Pattern::Image { texture: 0, mirror: 0.0 };
    scene.geometry.materials[9].pattern = image;
    scene.geometry.materials[9].colour = Vec3::ONE;
    let corners = [(-4.0, 0.0), (4.0, 0.0), (4.0, 8.0), (-4.0, 8.0)].map(|(x, z)| Vec3::new(x, 10.0, z));
    scene.add_quad(corners, 9, 2);
    let wall = scene.geometry.parts.last_mut().unwrap();
    for (vertex, uv) in wall.vertices.iter_mut().zip([(0.0, 1.0), (2.0, 1.0), (2.0, 0.0), (0.0, 0.0)]) {
        vertex.uv = Vec2::from(uv);
    }
    let seen = Renderer::new(&scene.geometry).render(&level(), &pose(0.0, 0.0, 4.0, 0.0), Channels::RGB).rgb.unwrap();
    // Position of the wall's (x, z) in the image: 480 pixels per metre at 1 m, 10 m away.
    let at = |x: f64, z: f64| {
        let i = ((360.0 - (z - 4.0) * 48.0) as usize * 960 + (480.0 + x * 48.0) as usize) * 3;
        [seen[i], seen[i + 1], seen[i + 2]]
    };
    for left in [-4.0, 0.0] {
        let [red, white, green, black] = [(1.0, 6.0), (3.0, 6.0), (1.0, 2.0), (3.0, 2.0)].map(|(x, z)| at(left + x, z));
        assert!(red[0] > 2 * red[1] && red[0] > 2 * red[2], "{red:?}");
        assert!(green[1] > 2 * green[0] && green[1] > 2 * green[2], "{green:?}");
        assert!(white.iter().all(|&c| c > 120) && black.iter().all(|&c| c < 60), "{white:?} {black:?}");
    }
}

#[test]
fn depth_of_ground_is_exact_out_to_the_horizon() {
    let scene = yard::empty();
    let image = Renderer::new(&scene.geometry).render(&level(), &pose(3.0, -5.0, 10.0, 30.0), Channels::TRUTH);
    let depth = image.depth.unwrap();
    for y in [375_usize, 400, 500, 719] {
        // The ray falls (y + ½ − cy)/fy for each metre along the axis.
        let expected = 10.0 * Camera::quad().fy / (y as f64 + 0.5 - 360.0);
        for x in [0, 17, 480, 959] {
            let found = f64::from(depth[y * 960 + x]);
            assert!((found / expected - 1.0).abs() < 1e-4, "row {y}: {found} and not {expected}");
        }
    }
    assert!(depth[..960 * 360].iter().all(|&d| d == 0.0), "sky has no depth");
}

#[test]
fn the_near_plane_cuts_the_ground_under_the_lens() {
    let scene = yard::empty();
    let attitude = Attitude { pitch: -1.2, ..Attitude::default() };
    let image = Renderer::new(&scene.geometry).render(
        &level(),
        &Pose { position: EnuPosition { up: 1.0, ..EnuPosition::default() }, attitude },
        Channels::TRUTH,
    );
    // Looking almost straight down there is ground at every pixel.
    assert!(image.ids.unwrap().iter().all(|&id| id == 1));
}

#[test]
fn an_opening_hides_nothing_and_is_hidden_by_walls() {
    let mut scene = yard::empty();
    scene.add_box(Vec3::new(-2.0, 30.0, 0.0), Vec3::new(2.0, 31.0, 4.0), 1, 5, Role::Solid);
    scene.add_box(Vec3::new(-1.0, 20.0, 1.0), Vec3::new(1.0, 20.5, 3.0), 1, 6, Role::Opening);
    scene.add_box(Vec3::new(0.0, 10.0, 0.0), Vec3::new(3.0, 10.5, 4.0), 1, 7, Role::Solid);
    let image = Renderer::new(&scene.geometry).render(&level(), &pose(0.0, 0.0, 2.0, 0.0), Channels::TRUTH);
    let at = |x: usize| 360 * 960 + x;
    let (ids, openings) = (image.ids.unwrap(), image.opening_ids.unwrap());
    let (depth, opening_depth) = (image.depth.unwrap(), image.opening_depth.unwrap());
    assert_eq!((ids[at(470)], openings[at(470)]), (5, 6));
    assert!((depth[at(470)] - 30.0).abs() < 1e-3 && (opening_depth[at(470)] - 20.0).abs() < 1e-3);
    assert_eq!((ids[at(490)], openings[at(490)]), (7, 0));
    assert_eq!(opening_depth[at(490)], 0.0);
}

#[test]
fn walls_cast_shadows_away_from_the_sun() {
    let mut scene = yard::empty();
    scene.geometry.light.to_sun = Vec3::new(1.0, 0.0, 1.0).normalize();
    scene.add_box(Vec3::new(-0.5, 10.0, 0.0), Vec3::new(0.5, 30.0, 6.0), 1, 5, Role::Solid);
    let down = Pose {
        position: EnuPosition { east: 0.0, north: 20.0, up: 30.0 },
        attitude: Attitude { pitch: -1.57, ..Attitude::default() },
    };
    let rgb = Renderer::new(&scene.geometry).render(&level(), &down, Channels::RGB).rgb.unwrap();
    let brightness = |x: usize| (0..3).map(|c| u32::from(rgb[(360 * 960 + x) * 3 + c])).sum::<u32>();
    // The wall is 6 m high and the sun stands at 45° in the east: shade reaches 6 m west, 96 pixels at 30 m.
    let (shade, sun) = (brightness(480 - 50), brightness(480 + 50));
    assert!(shade * 3 < sun * 2, "shade {shade}, sun {sun}");
    assert!(brightness(480 - 130) * 3 > sun * 2);
}

#[test]
fn colour_keeps_ids_and_depth_as_they_are() {
    let renderer = Renderer::new(&yard::yard().geometry);
    let eye = pose(0.0, -25.0, 6.0, 0.0);
    let (all, truth) =
        (renderer.render(&Camera::quad(), &eye, Channels::ALL), renderer.render(&Camera::quad(), &eye, Channels::TRUTH));
    assert_eq!((&all.ids, &all.depth, &all.opening_ids), (&truth.ids, &truth.depth, &truth.opening_ids));
    assert!(truth.rgb.is_none() && all.rgb.is_some());
}

#[test]
fn actors_are_rendered_like_the_scene() {
    let (mut whole, mut scene) = (yard::empty(), yard::empty());
    whole.add_box(Vec3::new(-2.0, 20.0, 1.0), Vec3::new(2.0, 21.0, 3.0), 1, 9, Role::Solid);
    scene.add_box(Vec3::new(-2.0, 20.0, 1.0), Vec3::new(2.0, 21.0, 3.0), 1, 9, Role::Solid);
    let actors: Vec<_> = scene.geometry.parts.drain(1..).collect();
    let eye = pose(0.0, 0.0, 2.0, 0.0);
    let mut image = RenderedImage::default();
    Renderer::new(&scene.geometry).render_into(&Camera::quad(), &eye, Channels::TRUTH, &actors, &mut image);
    assert_eq!(image, Renderer::new(&whole.geometry).render(&Camera::quad(), &eye, Channels::TRUTH));
}

#[test]
fn one_thread_and_many_give_the_same_bits() {
    let scene: SceneGeometry = yard::yard().geometry;
    let draw = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let renderer = Renderer::new(&scene);
            let eyes = [pose(0.0, -25.0, 6.0, 0.0), pose(12.0, 3.0, 2.0, 250.0)];
            eyes.map(|eye| digest(&renderer.render(&Camera::from_fov(500, 333, 1.5, 1.2, 0.1), &eye, Channels::ALL)))
        })
    };
    let one = draw(1);
    assert_eq!(one, draw(2));
    assert_eq!(one, draw(5));
    // The same on every machine. An intended change of appearance changes it: then view the images, and update the
    // value here.
    insta::assert_snapshot!(format!("{one:016x?}"), @"[390f77dd613ec855, da943f4b3360290a]");
}

#[test]
fn wide_and_plain_instructions_give_the_same_bits() {
    let scene: SceneGeometry = yard::yard().geometry;
    let (best, plain) = (Renderer::new(&scene), Renderer::new(&scene).with_plain_instructions());
    for quality in [Quality::Full, Quality::Live] {
        for eye in [pose(0.0, -25.0, 6.0, 0.0), pose(12.0, 3.0, 2.0, 250.0), pose(30.0, -12.0, 1.0, 0.0)] {
            let camera = Camera::from_fov(500, 333, 1.5, 1.2, 0.1);
            let draw = |renderer: &Renderer| renderer.render(&camera, &eye, Channels { quality, ..Channels::ALL });
            assert_eq!(draw(&best), draw(&plain));
        }
    }
}

#[test]
fn live_images_show_the_same_things_more_coarsely() {
    let renderer = Renderer::new(&yard::yard().geometry);
    let draw = |quality| renderer.render(&level(), &pose(0.0, -25.0, 6.0, 0.0), Channels { quality, ..Channels::ALL });
    let (full, live) = (draw(Quality::Full), draw(Quality::Live));
    assert_eq!((&full.ids, &full.depth), (&live.ids, &live.depth));
    let (full, live) = (full.rgb.unwrap(), live.rgb.unwrap());
    let off = |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    let off: Vec<u8> = full.chunks_exact(3).zip(live.chunks_exact(3)).map(off).collect();
    let beyond = |least: u8| off.iter().filter(|&&off| off > least).count();
    // Noise is faint; only edges and rims of shadows differ by much.
    assert!(beyond(40) > 1000 && beyond(40) < 960 * 720 / 20, "{}", beyond(40));
    assert!(beyond(0) > 960 * 720 / 10, "{}", beyond(0));
}

#[test]
fn files_contain_what_the_image_contains() {
    let image = Renderer::new(&yard::yard().geometry).render(&Camera::quad(), &pose(0.0, -25.0, 6.0, 0.0), Channels::ALL);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    image.save_rgb(&path("rgb.png")).unwrap();
    image.save_ids(&path("ids.png")).unwrap();
    image.save_depth(&path("depth.png")).unwrap();
    let read = |name: &str| file::decode(&std::fs::read(path(name)).unwrap(), file::Limits::default()).unwrap();
    assert_eq!(Some(read("rgb.png").into_rgb().into_data()), image.rgb);
    assert_eq!(Some(read("ids.png").into_grey16()), image.ids);
    let depth = read("depth.png").into_grey16();
    for (&stored, &metres) in depth.iter().zip(image.depth.as_ref().unwrap()) {
        assert!(metres > 655.0 || (f32::from(stored) / 100.0 - metres).abs() < 0.006);
    }
    assert!(image.save_rgb(&path("no/such/folder.png")).unwrap_err().to_string().starts_with("cannot write"));
}
