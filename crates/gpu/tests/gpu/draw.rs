//! The ways of the example `render` to draw through a redirection map: they agree with each other and with a texture
//! that was warped beforehand, and what they avoid is worse.

use vrtm::{Backend, DeviceSettings};
use vrtm_render::camera::View;
use vrtm_render::difference::difference;
use vrtm_render::draw::{Maps, Renderer};
use vrtm_render::gpu::Gpu;
use vrtm_render::model::Model;
use vrtm_render::stage::{Stage, shot};
use vrtm_render::texture::Levels;
use vrtm_render::{reference, ways};

const SIZE: [u32; 2] = [320, 240];

fn stage(scene: &str, frame: usize) -> Stage {
    let model = Model::scene(scene).unwrap();
    let settings = DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() };
    Stage::new(&model, frame, 1024, &settings).unwrap()
}

/// Draws in one of the ways.
struct Drawn<'a> {
    renderer: Renderer<'a>,
    camera: wgpu::BindGroup,
    maps: Maps,
}

impl<'a> Drawn<'a> {
    fn new(gpu: &'a Gpu, stage: &Stage, view: &View) -> Drawn<'a> {
        let renderer = stage.renderer(gpu, SIZE).unwrap();
        let camera = stage.camera(&renderer, view, SIZE);
        let maps = renderer.maps(&stage.solved, 2048).unwrap();
        Drawn { renderer, camera, maps }
    }

    fn picture(&self, name: &str, material: &wgpu::BindGroup) -> Vec<u8> {
        let way = ways::ALL.iter().find(|way| way.name == name).unwrap();
        let pipelines = self.renderer.pipelines(way);
        self.renderer.picture(&shot(way, &pipelines, &self.camera, material, &self.maps)).unwrap()
    }
}

#[test]
fn redirected_pictures_are_those_of_a_warped_texture() {
    let Some(gpu) = super::open() else { return };
    let stage = stage("mug_to_jug", 5);
    let drawn = Drawn::new(&gpu, &stage, &View::of(&stage.positions));
    let material = drawn.renderer.material(&stage.colours).unwrap();
    let warped = drawn.renderer.material(&stage.warped).unwrap();
    let reference = drawn.picture("original", &warped);
    let covered = reference.chunks_exact(4).filter(|texel| texel[3] == 255).count();
    assert!(covered > 10_000, "the mesh covers {covered} pixels");

    for (a, b) in [
        ("forward", "deferred"),
        ("forward", "forward-by-hand"),
        ("forward", "forward-delta"),
        ("forward-delta", "deferred-delta"),
        ("original", "original-deferred"),
    ] {
        let d = difference(&drawn.picture(a, &material), &drawn.picture(b, &material));
        println!("{a} and {b}: {d:?}");
        // Derivatives and deltas have 11 bits, samplers weigh with 8, and the levels that these choose blend into each
        // other.
        assert!(d.mean < 0.1 && d.p99 <= 2, "{a} and {b}: {d:?}");
    }
    // The sampler's own derivatives may be those of one pixel for each block of two by two.
    let d = difference(&drawn.picture("forward", &material), &drawn.picture("forward-implicit", &material));
    assert!(d.mean < 0.5 && d.p99 <= 8, "forward and forward-implicit: {d:?}");

    let from_reference = |name: &str| difference(&drawn.picture(name, &material), &reference);
    let [original, forward] = ["original", "forward"].map(from_reference);
    println!("from the reference: original {original:?}, forward {forward:?}");
    // What is left is the sampler's: it chooses its levels by the UVs that it gets, which are other ones.
    assert!(forward.mean < 5.0 && forward.p99 < 30, "{forward:?}");
    assert!(original.mean > 4.0 * forward.mean && original.p99 > 80, "{original:?}");
}

/// Seen from its edge, a sheet shows many texels of the map in each pixel, in one direction; a coarser level of the map
/// is coarser in the other one as well, and there it leaves features where they are not.
#[test]
fn a_map_with_mips_is_worse() {
    let Some(gpu) = super::open() else { return };
    let stage = stage("squash", 1);
    let view = View { pitch: 82.0, ..View::of(&stage.positions) };
    let drawn = Drawn::new(&gpu, &stage, &view);
    // Bands along the direction that is seen shortened, without levels of their own: shades tell where they are.
    let bands = |side: usize| -> Levels {
        let shade = |k: usize| {
            let x = (k % side) as f32 / side as f32 * 16.0;
            let grey = (255.0 * (2.0 * (x - x.floor()) - 1.0).abs()) as u8;
            [grey, grey, grey, 255]
        };
        vec![(0..side * side).map(shade).collect()]
    };
    let painted = vec![bands(1024)];
    let mut warped = reference::warped(&stage.solved, 0, &painted[0]).unwrap();
    warped.truncate(1);
    let [painted, warped] = [painted, vec![warped]].map(|levels| drawn.renderer.material(&levels).unwrap());
    let reference = drawn.picture("original", &warped);
    let from_reference = |name: &str| difference(&drawn.picture(name, &painted), &reference);
    let [original, level_0, mips] = ["original", "forward-delta", "forward-mips"].map(from_reference);
    println!("original {original:?}, level 0 {level_0:?}, with mips {mips:?}");
    // 0.12, 1.2 and 19: rounding of the map and of both pictures, and then what is to be seen.
    assert!(level_0.mean < 0.3 && level_0.p99 <= 3, "{level_0:?}");
    assert!(mips.mean > 4.0 * level_0.mean && mips.p99 > 3 * level_0.p99, "{mips:?}, at level 0 {level_0:?}");
    assert!(original.mean > 4.0 * mips.mean, "{original:?}");
}
