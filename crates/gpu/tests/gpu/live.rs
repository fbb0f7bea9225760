//! The example `render --live`: frames that are solved, inverted and drawn with the maps in memory of the GPU alone
//! have the pictures of frames whose maps pass through the CPU.

use vrtm_render::camera::View;
use vrtm_render::live::{self, Live, Transport};
use vrtm_render::maps::Solved;
use vrtm_render::model::Model;
use vrtm_render::texture::{self, Levels};

/// A scene twice, one above the other, each in a tile of its own; the second one's pose is half of the first one's.
fn two_tiles(name: &str) -> Model {
    let mut model = Model::scene(name).unwrap();
    let (vertices, uvs) = (model.rest.len() as u32, model.mesh.uvs.len() as u32);
    let width = model.rest.iter().map(|p| p[1]).fold(0.0f32, |a, y| a.max(y.abs()));
    let above = |p: &[f32; 3]| [p[0], p[1] + 2.5 * width, p[2]];
    let half: Vec<_> = model.frames[0]
        .iter()
        .zip(&model.rest)
        .map(|(p, r)| [0, 1, 2].map(|k| 0.5 * (p[k] + r[k])))
        .collect();
    model.frames.truncate(1);
    model.frames[0].extend(half.iter().map(above));
    model.rest.extend(model.rest.clone().iter().map(above));
    model.mesh.uvs.extend(model.mesh.uvs.clone().iter().map(|uv| [uv[0] + 1.0, uv[1]]));
    model.mesh.face_counts.extend(model.mesh.face_counts.clone());
    model.mesh.indices.extend(model.mesh.indices.clone().iter().map(|i| i + vertices));
    model.mesh.uv_indices.extend(model.mesh.uv_indices.clone().iter().map(|i| i + uvs));
    let mut tile = model.tiles[0].clone();
    tile.udim = 1002;
    model.tiles.push(tile);
    model
}

#[test]
fn pictures_are_the_same_without_the_cpu() {
    let Some(gpu) = super::open() else { return };
    let model = two_tiles("bulge");
    // Rows of 32 texels are shorter than those that a copy to a texture takes.
    for side in [256, 32] {
        let mut solved = Solved::open(&model, &live::settings(&gpu)).unwrap();
        solved.set_grid(64).unwrap();
        assert_eq!(solved.udims, [1001, 1002]);
        let colours: Vec<Levels> = model.tiles.iter().map(|tile| texture::colours(Some(tile), 256)).collect();
        let view = View::of(&model.rest);
        let mut live = Live::new(&gpu, &model, solved, &colours, &view, [160, 240], side).unwrap();
        let shared = live.shared().unwrap();
        let mut pictures = Vec::new();
        for (n, transport) in [(0, &shared), (7, &shared), (7, &Transport::Host), (0, &Transport::Host)] {
            let times = live.frame(&live::pose(&model, n), transport).unwrap();
            assert!(times.solve > 0.0 && times.map > 0.0 && times.draw > 0.0);
            pictures.push(live.picture().unwrap());
        }
        assert!(pictures[1] == pictures[2] && pictures[0] == pictures[3], "{side}");
        // Each tile's half of the picture shows its own map.
        for (half, name) in [(0..160 * 120 * 4, "1002"), (160 * 120 * 4..160 * 240 * 4, "1001")] {
            let pairs = pictures[0][half.clone()].iter().zip(&pictures[1][half]);
            let apart = pairs.filter(|(a, b)| a != b).count();
            assert!(apart > 1000, "{name} at {side}: {apart}");
        }
    }
}

#[test]
fn poses_go_to_and_fro() {
    let model = Model::scene("bulge").unwrap();
    let last = model.frames.last().unwrap();
    assert_eq!(live::pose(&model, 7), *last);
    assert_eq!(live::pose(&model, 6), live::pose(&model, 8));
    assert_eq!(live::pose(&model, 0), live::pose(&model, 14));
    assert_ne!(live::pose(&model, 0), model.rest);
}
