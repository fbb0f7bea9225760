//! The ways of the example `render` to draw through a redirection map: they agree with each other and with a texture that was
//! warped beforehand, and what they avoid is worse.

#[path = "common/gpu.rs"]
mod common;
#[path = "../examples/render/mod.rs"]
mod render;

use render::camera::View;
use render::difference::{Difference, difference};
use render::gpu::Gpu;
use render::model::Model;
use render::stage::{Stage, shot};
use render::ways;
use vrtm::{Backend, DeviceSettings};

#[test]
fn redirected_pictures_are_those_of_a_warped_texture() {
    if !common::has_gpu() {
        return;
    }
    let gpu = Gpu::open(0).unwrap();
    let model = Model::scene("mug_to_jug").unwrap();
    let settings = DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() };
    let stage = Stage::new(&model, 5, 1024, false, &settings).unwrap();
    let size = [320, 240];
    let renderer = stage.renderer(&gpu, size).unwrap();
    let camera = stage.camera(&renderer, &View::of(&stage.positions), size);
    let material = renderer.material(&stage.colours, None).unwrap();
    let warped = renderer.material(stage.warped.as_ref().unwrap(), None).unwrap();
    let maps = renderer.maps(&stage.solved, 2048).unwrap();
    let draw = |name: &str, material: &wgpu::BindGroup| {
        let way = ways::ALL.iter().find(|way| way.name == name).unwrap();
        let pipelines = renderer.pipelines(way, false);
        renderer.picture(&shot(way, &pipelines, &camera, material, &maps)).unwrap()
    };
    let reference = draw("original", &warped);
    let error = |name: &str| difference(&draw(name, &material), &reference);
    let covered = reference.chunks_exact(4).filter(|texel| texel[3] == 255).count();
    assert!(covered > 10_000, "the mesh covers {covered} pixels");

    for (a, b) in [
        ("forward", "deferred"),
        ("forward-delta", "deferred-delta"),
        ("forward", "forward-implicit"),
        ("forward", "forward-by-hand"),
        ("forward", "forward-delta"),
        ("original", "original-deferred"),
    ] {
        let d = difference(&draw(a, &material), &draw(b, &material));
        println!("{a} and {b}: {d:?}");
        assert_rounding(&d, a, b);
    }
    let [original, forward, mips] = ["original", "forward", "forward-mips"].map(error);
    println!("from the reference: original {original:?}, forward {forward:?}, through mips {mips:?}");
}

fn assert_rounding(d: &Difference, a: &str, b: &str) {
    assert!(d.mean < 0.1 && d.p99 <= 2, "{a} and {b}: {d:?}");
}
