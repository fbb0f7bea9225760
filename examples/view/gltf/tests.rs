//! Tiny files with positions in closed form, and files that are damaged.

use std::path::PathBuf;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::*;
use crate::model::Model;

#[path = "../tests/tiny.rs"]
mod tiny;
use tiny::Tiny;

/// A folder for the files of a test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("vrtm-view-gltf-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn open(name: &str, bytes: &[u8], choice: &Choice) -> Result<Model> {
    let path = folder(name).join(if bytes.starts_with(b"glTF") { "tiny.glb" } else { "tiny.gltf" });
    std::fs::write(&path, bytes).expect("written");
    let model = Model::layered(&Files { rest: Some(path), ..Files::default() }, choice, 0);
    std::fs::remove_dir_all(folder(name)).expect("removed");
    model
}

/// Frames per second of the tests.
const SLOW: u16 = 4;

fn slow() -> Choice {
    Choice { rate: SLOW, ..Choice::default() }
}

/// The strip's point at x and y, bent by an angle and lifted by a height at its end.
fn bent([x, y, _]: [f32; 3], angle: f32, height: f32) -> [f32; 3] {
    let (sine, cosine) = angle.sin_cos();
    let turned = [cosine * x - sine * (y - 1.0), 1.0 + sine * x + cosine * (y - 1.0)];
    let share = 0.5 * y;
    let [x, y] = [(1.0 - share) * x + share * turned[0], (1.0 - share) * y + share * turned[1]];
    let z = if share == 1.0 { height } else { 0.0 };
    [10.0 + 2.0 * x, 2.0 * z, -2.0 * y]
}

fn assert_close(found: &[[f32; 3]], expected: &[[f32; 3]], place: &str) {
    assert_eq!(found.len(), expected.len(), "{place}");
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        // Rotations of a file are f32.
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-5), "{place}, vertex {k}: {a:?}, expected {b:?}");
    }
}

/// The strip's points in the order of its first corners.
fn flat(model: &Model) -> Vec<[f32; 3]> {
    // Rest is the strip under its topmost node.
    model.rest.iter().map(|[x, _, z]| [0.5 * (x - 10.0), -0.5 * z, 0.0]).collect()
}

#[test]
fn a_skin_and_a_morph_target_move_the_mesh() {
    let model = open("strip", &Tiny::strip().glb(), &slow()).expect("a model");
    // Of 12 vertices the three pairs at the seam are one each; UVs stay apart, with v upward.
    assert_eq!((model.rest.len(), model.mesh.uvs.len(), model.triangles.len()), (9, 12, 8));
    let flat = flat(&model);
    for triangle in &model.triangles {
        for (vertex, [u, v]) in triangle.vertices.into_iter().zip(triangle.uvs) {
            let [x, y, _] = flat[vertex as usize];
            let start = if triangle.uvs.iter().any(|uv| uv[0] < 0.4) { 0.4 } else { 0.6 };
            assert!(
                (u as f32 - start - 0.4 * x).abs() < 1e-6 && (v as f32 - 0.5 * y).abs() < 1e-6,
                "{u} {v}"
            );
        }
    }
    let mut corners: Vec<_> = flat.iter().map(|p| [p[0].round() as i32, p[1].round() as i32]).collect();
    corners.sort_unstable();
    let expected: Vec<_> = (-1..=1).flat_map(|x| (0..=2).map(move |y| [x, y])).collect();
    assert_eq!(corners, expected);
    let at_rest: Vec<_> = flat.iter().map(|&p| bent(p, 0.0, 0.0)).collect();
    assert_close(&model.rest, &at_rest, "rest");
    // The longest animation: a second at four frames.
    assert_eq!(model.poses.len(), 5);
    for (frame, pose) in model.poses.iter().enumerate() {
        let t = frame as f32 / 4.0;
        let expected: Vec<_> = flat.iter().map(|&p| bent(p, t * std::f32::consts::FRAC_PI_2, t)).collect();
        assert_close(pose, &expected, &format!("frame {frame}"));
    }
    let line = &model.timeline;
    assert_eq!((line.number(line.keys[1]), line.number(line.last)), (0, 4));
    assert_eq!(model.note(2), "pose 1: bend");
}

#[test]
fn an_animation_is_chosen_by_its_name_and_its_ends_hold() {
    let choice = Choice { animation: Some("short".into()), ..slow() };
    let model = open("short", &Tiny::strip().glb(), &choice).expect("a model");
    let flat = flat(&model);
    assert_eq!(model.poses.len(), 3);
    let expected: Vec<_> = flat.iter().map(|&p| bent(p, std::f32::consts::FRAC_PI_2, 1.0)).collect();
    assert_close(&model.poses[2], &expected, "the last frame");
    // A rate that does not meet the last key goes one frame on.
    let model = open("short", &Tiny::strip().glb(), &Choice { rate: 3, ..choice }).expect("a model");
    assert_eq!(model.poses.len(), 3);
    assert_close(&model.poses[2], &expected, "after the end");
    let choice = Choice { animation: Some("jump".into()), ..slow() };
    let failed = open("jump", &Tiny::strip().glb(), &choice).err().expect("no such animation");
    assert!(failed.0.ends_with("no animation \"jump\"; there are: short, bend"), "{}", failed.0);
}

/// Without animations each morph target is a pose, and so are the nodes if they are not at rest.
#[test]
fn without_animations_shapes_are_poses() {
    let mut tiny = Tiny::strip();
    tiny.json["animations"] = json!([]);
    let model = open("shapes", &tiny.glb(), &slow()).expect("a model");
    let flat = flat(&model);
    let bulge: Vec<_> = flat.iter().map(|&p| bent(p, 0.0, 1.0)).collect();
    assert_eq!((model.poses.len(), model.note(1).as_str()), (1, "pose 1: bulge"));
    assert_close(&model.poses[0], &bulge, "bulge");
    tiny.json["nodes"][2]["rotation"] = json!([0.0, 0.0, 0.5f32.sqrt(), 0.5f32.sqrt()]);
    let model = open("shapes", &tiny.glb(), &slow()).expect("a model");
    let posed: Vec<_> = flat.iter().map(|&p| bent(p, std::f32::consts::FRAC_PI_2, 0.0)).collect();
    assert_eq!((model.poses.len(), model.note(1).as_str()), (2, "pose 1: posed"));
    assert_close(&model.poses[0], &posed, "posed");
    assert_close(&model.poses[1], &bulge, "bulge");
}

/// A square in a node that moves, as a triangle strip with repeating UVs.
fn square() -> Tiny {
    let mut tiny = Tiny::new(json!({
        "nodes": [
            { "children": [1], "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1] },
            { "mesh": 0 },
        ],
    }));
    let points = tiny.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let uvs = tiny.floats("VEC2", &[2.0, -1.0, 2.5, -1.0, 2.0, -1.5, 2.5, -1.5]);
    let part = json!({ "attributes": { "POSITION": points, "TEXCOORD_0": uvs }, "mode": 5 });
    tiny.push("meshes", json!({ "name": "square", "primitives": [part] }));
    tiny
}

#[test]
fn nodes_move_meshes_without_a_skin() {
    let mut tiny = square();
    let times = tiny.floats("SCALAR", &[0.0, 1.0]);
    let scale = tiny.floats("VEC3", &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0]);
    // A cubic spline with slopes 0: 3 t^2 - 2 t^3, in key, tangents of 0 around it.
    let mut way = [0.0; 18];
    way[12] = 8.0;
    let way = tiny.floats("VEC3", &way);
    tiny.push(
        "animations",
        json!({
            "samplers": [
                { "input": times, "output": scale, "interpolation": "STEP" },
                { "input": times, "output": way, "interpolation": "CUBICSPLINE" },
            ],
            "channels": [
                { "sampler": 0, "target": { "node": 1, "path": "scale" } },
                { "sampler": 1, "target": { "node": 1, "path": "translation" } },
            ],
        }),
    );
    let model = open("square", &tiny.glb(), &slow()).expect("a model");
    // A quarter turn around z, and 5 to the right.
    let world = |p: [f32; 2]| [5.0 - p[1], p[0], 0.0];
    let flat: Vec<[f32; 2]> = model.rest.iter().map(|p| [p[1], 5.0 - p[0]]).collect();
    assert_eq!((flat.len(), model.triangles.len(), model.poses.len()), (4, 2, 5));
    for (frame, pose) in model.poses.iter().enumerate() {
        let t = frame as f32 / 4.0;
        let (scale, way) = (if frame == 4 { 3.0 } else { 1.0 }, 8.0 * (3.0 * t * t - 2.0 * t * t * t));
        let expected: Vec<_> = flat.iter().map(|&[x, y]| world([scale * x + way, y])).collect();
        assert_close(pose, &expected, &format!("frame {frame}"));
    }
    // UVs that repeat the texture come into its tile: u from 2 and v, downward, from -1.5.
    for triangle in &model.triangles {
        assert_eq!(triangle.udim, 1001);
        for (vertex, [u, v]) in triangle.vertices.into_iter().zip(triangle.uvs) {
            let [x, y] = flat[vertex as usize];
            assert!((u as f32 - 0.5 * x).abs() < 1e-6 && (v as f32 - 0.5 * y).abs() < 1e-6, "{u} {v}");
        }
    }
}

#[test]
fn numbers_may_be_sparse_packed_or_of_bytes() {
    let mut tiny = square();
    // UVs as normalized bytes, at every fourth byte.
    let bytes = [0u8, 0, 9, 9, 255, 0, 9, 9, 0, 255, 9, 9, 255, 255];
    let view = tiny.view(&bytes);
    tiny.json["bufferViews"][view]["byteStride"] = json!(4);
    tiny.json["accessors"][1] = json!({ "bufferView": view, "componentType": 5121, "normalized": true, "count": 4,
                                        "type": "VEC2" });
    // A morph target with one value in four.
    let [place, value] = [tiny.view(&[3]), tiny.view(&[7.0f32, 0.0, 2.0].map(f32::to_le_bytes).concat())];
    let target = tiny.push(
        "accessors",
        json!({
            "componentType": 5126, "count": 4, "type": "VEC3",
            "sparse": { "count": 1, "indices": { "bufferView": place, "componentType": 5121 },
                        "values": { "bufferView": value } },
        }),
    );
    tiny.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": target }]);
    let model = open("sparse", &tiny.glb(), &slow()).expect("a model");
    let last = model.rest.iter().position(|&p| p == [4.0, 1.0, 0.0]).expect("the point at 1, 1");
    let mut expected = model.rest.clone();
    expected[last] = [4.0, 8.0, 2.0];
    assert_close(&model.poses[0], &expected, "the target");
    let uvs: Vec<_> = model.triangles.iter().flat_map(|t| t.uvs).collect();
    assert!(
        uvs.iter().all(|uv| uv.iter().all(|&x| x == 0.0 || x == 1.0)) && uvs.contains(&[1.0, 0.0]),
        "{uvs:?}"
    );
    // A sparse value behind the end.
    tiny.bytes[tiny.json["bufferViews"][place]["byteOffset"].as_u64().expect("there") as usize] = 4;
    assert!(open("sparse", &tiny.glb(), &slow()).err().expect("damaged").0.contains("sparse value"));
}

/// All meshes are one, with a mesh that a bone carries and that has no UVs, and each of the others can be opened alone;
/// each material has a tile, and targets of one name are one pose.
#[test]
fn meshes_are_opened_together_or_alone() {
    let mut tiny = Tiny::strip();
    let mut other = tiny.json["meshes"][0].clone();
    other["primitives"][0]["material"] = json!(1);
    tiny.push("meshes", other);
    tiny.json["materials"] =
        json!([{}, {}, { "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0, 1, 1] } }]);
    tiny.push("nodes", json!({ "mesh": 1, "skin": 0, "name": "lining" }));
    let points = tiny.floats("VEC3", &[0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0]);
    let hat = json!({ "attributes": { "POSITION": points }, "material": 2 });
    tiny.push("meshes", json!({ "primitives": [hat] }));
    tiny.push("nodes", json!({ "mesh": 2, "name": "hat" }));
    tiny.json["nodes"][2]["children"] = json!([5]);
    tiny.json["scenes"][0]["nodes"] = json!([0, 3, 4]);
    let model = open("joined", &tiny.glb(), &slow()).expect("a model");
    let contents = model.contents.as_ref().expect("a glTF file");
    assert_eq!((contents.mesh, contents.meshes.join(" ").as_str()), (0, "all meshes strip lining"));
    // The ends, which targets of two nodes move, stay apart.
    assert_eq!((model.triangles.len(), model.rest.len()), (17, 15));
    assert_eq!(model.pages.iter().map(|page| page.udim).collect::<Vec<_>>(), [1001, 1002, 1003]);
    // Half of the light is 188 in sRGB. White is no colour to draw with.
    let colours: Vec<_> =
        model.pictures.colours.iter().map(|c| c.as_ref().map(|c| c.get_pixel(0, 0).0)).collect();
    assert_eq!(colours, [None, None, Some([188, 0, 255, 255])]);
    // The bone is 1 above the strip's middle, and lies flat at the end.
    let close = |a: [f32; 3], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-5);
    let hat = model.rest.len() - 3..model.rest.len();
    assert!(hat.clone().any(|at| close(model.rest[at], [12.0, 0.0, -4.0])), "{:?}", &model.rest[hat]);
    assert!(hat.clone().any(|at| close(model.poses[4][at], [8.0, 0.0, -4.0])), "{:?}", &model.poses[4][hat]);
    let choice = Choice { mesh: Some("lining".into()), ..slow() };
    let alone = open("joined", &tiny.glb(), &choice).expect("a model");
    assert_eq!((alone.triangles.len(), alone.rest.len(), alone.pages.len()), (8, 9, 1));
    let choice = Choice { mesh: Some("hat".into()), ..slow() };
    let failed = open("joined", &tiny.glb(), &choice).err().expect("no UVs");
    assert!(failed.0.ends_with("no mesh \"hat\"; there are: all meshes, strip, lining"), "{}", failed.0);
    tiny.json["animations"] = json!([]);
    let model = open("joined", &tiny.glb(), &slow()).expect("a model");
    assert_eq!((model.poses.len(), model.note(1).as_str()), (1, "pose 1: bulge"));
    let moved = model.rest.iter().zip(&model.poses[0]).filter(|(a, b)| a != b).count();
    assert_eq!(moved, 6, "the ends of both");
}

/// An image of opaque pixels, unless they have alpha.
fn png<const N: usize>(pixels: &[[u8; N]], width: u32) -> Vec<u8> {
    let kind = if N == 4 { image::ExtendedColorType::Rgba8 } else { image::ExtendedColorType::Rgb8 };
    let size = [width, pixels.len() as u32 / width];
    crate::save::encode(size, kind, pixels.as_flattened()).expect("encoded")
}

#[test]
fn textures_come_with_the_file() {
    let [red, blue] = [[255, 0, 0], [0, 0, 255]];
    let mut tiny = Tiny::strip();
    tiny.texture(&png(&[red, red, blue, blue], 2));
    // A normal map beside the file, of one texel.
    tiny.push("images", json!({ "uri": "a%20bump.png" }));
    tiny.push("textures", json!({ "source": 1 }));
    tiny.json["materials"][0]["normalTexture"] = json!({ "index": 1 });
    let files = folder("textures");
    std::fs::write(files.join("a bump.png"), png(&[[128, 128, 255]], 1)).expect("written");
    let model = open("textures", &tiny.glb(), &slow()).expect("a model");
    let [colour, normal] = [&model.pictures.colours, &model.pictures.normals].map(|all| all[0].clone());
    let (colour, normal) = (colour.expect("a texture"), normal.expect("a normal map"));
    // The first row is the lower one.
    assert_eq!([colour.get_pixel(0, 0).0, colour.get_pixel(1, 1).0], [[0, 0, 255, 255], [255, 0, 0, 255]]);
    assert_eq!((normal.dimensions(), normal.get_pixel(1, 0).0), ((2, 1), [128, 128, 255, 255]));
    assert!(model.notice.is_none() && model.inputs.iter().any(|path| path.ends_with("a bump.png")));
    // A texture that is missing is named, and the mesh opens without it.
    let model = open("textures", &tiny.glb(), &slow()).expect("a model");
    let notice = model.notice.expect("a notice");
    assert!(notice.contains(".glb: image 1: ") && notice.contains("bump.png: No such file"), "{notice}");
    assert!(model.pictures.colours[0].is_some() && model.pictures.normals[0].is_none());
}

#[test]
fn buffers_are_beside_the_file_or_in_it() {
    let tiny = Tiny::strip();
    let encoded = tiny.bytes.iter().map(|byte| format!("%{byte:02x}")).collect::<String>();
    for data in [format!(",{encoded}"), format!(";base64,{}", STANDARD.encode(&tiny.bytes))] {
        let bytes = tiny.gltf(&format!("data:application/octet-stream{data}"));
        assert_eq!(open("data", &bytes, &slow()).expect("a model").poses.len(), 5);
    }
    let failed = open("data", &tiny.gltf("data:;base64,a*b="), &slow()).err().expect("no digit").0;
    assert!(failed.contains("not in base 64"), "{failed}");
    std::fs::write(folder("beside").join("tiny.bin"), &tiny.bytes).expect("written");
    let bytes = tiny.gltf("tiny.bin");
    assert_eq!(open("beside", &bytes, &slow()).expect("a model").inputs.len(), 2);
    let failed = open("beside", &bytes, &slow()).err().expect("the buffer is gone").0;
    assert!(failed.contains(".gltf: buffer 0: ") && failed.contains("tiny.bin: No such file"), "{failed}");
}

#[test]
fn opacity_is_that_of_the_material() {
    let mut tiny = Tiny::strip();
    tiny.texture(&png(&[[255, 0, 0, 100], [255, 0, 0, 150]], 2));
    for (mode, expected) in [("OPAQUE", [255, 255]), ("MASK", [0, 255]), ("BLEND", [100, 150])] {
        tiny.json["materials"][0]["alphaMode"] = json!(mode);
        let model = open("opacity", &tiny.glb(), &slow()).expect("a model");
        let colour = model.pictures.colours[0].clone().expect("a texture");
        assert_eq!([0, 1].map(|x| colour.get_pixel(x, 0).0[3]), expected, "{mode}");
    }
}

/// Each of these changes is an error that says what is wrong.
#[test]
fn damaged_files_are_named() {
    let at = |path: &str, value: Value| (path.to_string(), value);
    for ((path, value), reason) in [
        (at("/asset/version", json!("1.0")), "glTF 1.0: only version 2 is read"),
        (at("/extensionsRequired", json!(["KHR_draco_mesh_compression"])), "KHR_draco_mesh_compression"),
        (at("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(null)), "is no glTF"),
        (at("/meshes/0/primitives/0/attributes", json!({ "POSITION": 0 })), "no triangles with UVs"),
        (at("/meshes/0/primitives/0/mode", json!(1)), "no triangles with UVs"),
        (at("/meshes", json!([])), "mesh 0 is missing"),
        (at("/meshes/0/primitives/0/attributes/POSITION", json!(99)), "accessor 99: is missing"),
        (at("/meshes/0/primitives/0/indices", json!(0)), "accessor 0: is Vec3 in place of Scalar"),
        (at("/accessors/0/count", json!(1e15 as u64)), "its 1000000000000000 elements end"),
        (at("/accessors/0/count", json!(6)), "48 joints and 48 weights for 6 vertices"),
        (at("/accessors/0/componentType", json!(1)), "accessor 0: has an unknown type"),
        (at("/accessors/0/bufferView", json!(77)), "accessor 0: buffer view 77 is missing"),
        (at("/accessors/0/byteOffset", json!(4)), "accessor 0: its 12 elements end behind buffer view 0"),
        (at("/accessors/4/byteOffset", json!(-4)), "is no glTF"),
        (at("/bufferViews/0/byteOffset", json!(u64::MAX)), "buffer view 0 ends behind its buffer"),
        (at("/bufferViews/0/buffer", json!(3)), "buffer 3 is missing"),
        (at("/skins/0/joints", json!([1, 9])), "skin 0: node 9 is missing"),
        (at("/skins/0/joints", json!([1])), "vertex 4: joint 1 of 1"),
        (at("/skins/0/joints", json!([1, 2, 0])), "skin 0: 2 inverse bind matrices for 3 joints"),
        (at("/nodes/3/skin", json!(4)), "skin 4: is missing"),
        (at("/nodes/2/children", json!([0])), "its nodes form a circle"),
        (at("/nodes/2/children", json!([1])), "node 1 has two parents"),
        (at("/nodes/2/children", json!([44])), "node 44 is missing"),
        (at("/animations/1/channels/0/target/node", json!(44)), "animation \"bend\": node 44 is missing"),
        (at("/animations/1/channels/0/target/path", json!("pointer")), "a channel of an unknown kind"),
        (at("/animations/1/channels/0/sampler", json!(4)), "animation \"bend\": sampler 4 is missing"),
        (at("/animations/1/samplers/0/interpolation", json!("CUBICSPLINE")), "2 values for 2 keys"),
        (at("/animations/1/samplers/0/input", json!(4)), "the times of keys do not ascend"),
    ] {
        let mut tiny = Tiny::strip();
        let (list, last) = path.rsplit_once('/').expect("a path");
        let place = tiny.json.pointer_mut(list).expect("a place");
        match last.parse::<usize>() {
            Ok(index) => place[index] = value,
            Err(_) => place[last] = value,
        }
        let failed =
            open("damaged", &tiny.glb(), &slow()).err().unwrap_or_else(|| panic!("{path} is taken")).0;
        assert!(failed.contains("tiny.glb: ") && failed.contains(reason), "{path}: {failed}");
    }
    let bytes = Tiny::strip().gltf("https://example.org/a.bin");
    let failed = open("damaged", &bytes, &slow()).err().expect("no file").0;
    assert!(failed.contains("buffer 0: 'https://example.org/a.bin' is no path"), "{failed}");
    let files = Files { rest: Some("a.glb".into()), pose: vec!["b.obj".into()], ..Files::default() };
    let failed = Model::layered(&files, &slow(), 0).err().expect("poses").0;
    assert_eq!(failed, "--pose: a.glb has its own poses");
}

/// No cut and no changed byte makes it panic.
#[test]
fn broken_bytes_are_errors_or_other_models() {
    let mut tiny = Tiny::strip();
    tiny.texture(&png(&[[255, 0, 0]; 4], 2));
    let whole = tiny.glb();
    for length in (0..whole.len()).step_by(7) {
        assert!(open("cut", &whole[..length], &slow()).is_err(), "{length}");
    }
    let mut random = 1u64;
    for _ in 0..3000 {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mut bytes = whole.clone();
        let place = (random >> 33) as usize % bytes.len();
        bytes[place] = (random >> 25) as u8;
        let _ = open("changed", &bytes, &slow());
    }
}
