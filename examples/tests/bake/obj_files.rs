//! OBJ files, read by the rules that the command `vrtm bake` has, too: its tests read the same table of cases.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use vrtm_examples::failure::{Failure, Result};
use vrtm_examples::islands::islands;
use vrtm_examples::mesh::{Mesh, NO_UV, Triangle};
use vrtm_examples::obj::load_mesh;

use crate::common::folder;

fn cases(kind: &str) -> Vec<(String, Value)> {
    let table: Value = serde_json::from_str(include_str!("obj.json")).expect("JSON");
    let cases = table[kind].as_object().expect("cases");
    cases.iter().map(|(name, case)| (name.clone(), case.clone())).collect()
}

/// A file whose bytes are the letters of a text.
fn load(path: &PathBuf, text: &Value) -> Result<Mesh> {
    let text = text.as_str().expect("text");
    let bytes: Vec<u8> = text.chars().map(|c| u8::try_from(c).expect("a byte")).collect();
    fs::write(path, bytes).expect("a file");
    load_mesh(path)
}

#[test]
fn all_ways_of_writing_mean_the_same() {
    let path = folder("obj_same").join("a.obj");
    for (name, text) in cases("same") {
        let mesh = load(&path, &text).unwrap_or_else(|Failure(line)| panic!("{name}: {line}"));
        let rest: Vec<[f64; 3]> = mesh.rest.iter().collect();
        assert_eq!(rest, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]], "{name}");
        assert_eq!(mesh.uvs, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], "{name}");
        assert_eq!((mesh.face_counts, mesh.indices), (vec![3], vec![0, 1, 2]), "{name}");
        assert_eq!(mesh.uv_indices, [0, 1, 2], "{name}");
    }
}

#[test]
fn what_is_wrong_is_named() {
    let path = folder("obj_refused").join("a.obj");
    for (name, case) in cases("refused") {
        let Err(Failure(line)) = load(&path, &case[0]) else { panic!("{name}: is read") };
        let reason = case[1].as_str().expect("text");
        assert!(line.contains("a.obj: ") && line.contains(reason), "{name}: '{reason}' in: {line}");
    }
}

#[test]
fn faces_without_uvs_keep_their_places() {
    let path = folder("obj_bare").join("a.obj");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1 2 3\nf 1/1 2// 3/3\nf 1//1 2/ 3\nf 3/3 1/1 2/2\n";
    let mesh = load(&path, &text.into()).expect("a mesh");
    assert_eq!(mesh.indices, [0, 1, 2, 0, 1, 2, 0, 1, 2, 2, 0, 1]);
    assert_eq!(mesh.uv_indices, [[NO_UV; 9].as_slice(), &[2, 0, 1]].concat());
}

#[test]
fn numbers_are_read_in_f64() {
    let path = folder("obj_f64").join("a.obj");
    let far = "v 500000.0000001 4649776.22482 0.1\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n";
    let mesh = load(&path, &far.into()).expect("a mesh");
    assert_eq!(mesh.rest.iter().next(), Some([500000.0000001, 4649776.22482, 0.1]));
}

#[test]
fn triangles_that_share_uvs_are_one_island() {
    let triangle = |corners| Triangle { vertices: [0, 1, 2], uvs: [[0.0; 2]; 3], corners, udim: 1001 };
    let all = [[0, 1, 2], [9, 8, 7], [2, 3, 4], [4, 5, 6], [7, 10, 11]].map(triangle);
    assert_eq!(islands(&all), [0, 1, 0, 0, 1]);
}
