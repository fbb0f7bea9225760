//! Layers on the GPU: each is what the GPU makes of its charts alone, and near to what the CPU makes of it.

use vrtm::{Asset, Device, DeviceSettings, SolveOptions};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{Model, bits, cpu, gpu, scenes};

fn solved(model: &Model, device: &Device, frame: usize) -> Asset {
    model.solved(device, 64, frame, &SolveOptions::default())
}

#[test]
fn a_layer_has_the_bits_of_its_charts_alone() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    let model = Model::from(scenes::by_name("mug_to_jug").unwrap());
    assert!(model.frames.len() > 1);
    let layered = model.twice();
    let both = solved(&layered, &device, 1);
    let on_cpu = solved(&layered, &cpu(2), 1);
    assert_eq!(both.tile_count(), 2);
    let alone = [1, model.frames.len()].map(|frame| solved(&model, &device, frame));
    let expected: Vec<[u32; 2]> = alone.iter().flat_map(bits).collect();
    assert!(bits(&both) == expected && bits(&alone[0]) != bits(&alone[1]));
    for tile in 0..2 {
        let [on_gpu, on_cpu] = [&both, &on_cpu].map(|asset| asset.displacements(tile).unwrap());
        let far = |(a, b): (&[f32; 2], &[f32; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
        let farthest = on_gpu.iter().zip(&on_cpu).map(far).fold(0.0, f32::max);
        let longest = on_cpu.iter().map(|u| u[0].hypot(u[1])).fold(0.0, f32::max);
        assert!(farthest < 0.05 && longest > 0.5, "{farthest} of {longest} cells");
    }
}
