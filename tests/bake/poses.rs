//! Poses that do not belong to the mesh are refused or warned of, and the rest may come from a pose.

use crate::common::{
    Files, REST, borrow, floats, folder, read_exr, refuse, report, succeed, succeed_with_warnings, text,
};

#[test]
fn a_pose_with_other_faces_is_refused() {
    let files = Files::new("other_faces");
    let check = |pose: &str, reason: &str| {
        files.write("other.obj", pose.as_bytes());
        let (arguments, out) = files.arguments("other.obj", &["--no-sheet"]);
        match reason {
            "" => {
                succeed(&borrow(&arguments));
                std::fs::remove_dir_all(&out).unwrap();
            }
            _ => refuse(&arguments, &out, "other.obj", reason),
        }
    };
    // The vertices 2 and 3 in each other's place: their faces go with them.
    let permuted = REST
        .replace("v 1 0 0\nv 2 0 0", "v 2 0 0\nv 1 0 0")
        .replace("1/1 2/2 5/3", "1/1 3/2 5/3")
        .replace("2/5 3/6", "3/5 2/6");
    check(&permuted, "face 1 has the vertices 1 3 5 4, but that of the rest mesh has 1 2 5 4");
    let second = REST.replace("f 2/5 3/6 6/7 5/8", "f 2/5 6/6 3/7 5/8");
    check(&second, "face 2 has the vertices 2 6 3 5, but that of the rest mesh has 2 3 6 5");
    check(&REST.replace("f 2/5 3/6 6/7 5/8\n", ""), "1 faces, but the rest mesh has 2");
    check(&format!("{REST}f 1/1 2/2 5/3\n"), "3 faces, but the rest mesh has 2");
    // The same faces, from another corner on; without UVs; no faces at all.
    check(&REST.replace("1/1 2/2 5/3 4/4", "5/3 4/4 1/1 2/2"), "");
    check(&REST.replace("f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8", "f 1 2 5 4\nf 2 3 6 5"), "");
    check(&REST[..REST.find("vt").unwrap()], "");
}

#[test]
fn a_pose_in_other_units_is_warned_of() {
    let files = Files::new("units");
    let scaled = |factor: f32| -> Vec<u8> {
        let rest = [[0., 0.], [1., 0.], [2., 0.], [0., 1.], [1., 1.], [2., 1.]];
        floats(&rest.map(|[x, y]: [f32; 2]| [x * factor, y * factor, 0.0]).concat())
    };
    let poses = [scaled(1.0), scaled(100.0), scaled(2.0), scaled(0.01)].concat();
    files.write("scaled.f32", &poses);
    let (arguments, out) = files.arguments("scaled.f32", &["--no-sheet"]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let lines: Vec<&str> = warnings.lines().collect();
    assert_eq!(lines.len(), 2, "{warnings}");
    for (line, frame, factor) in
        [(lines[0], "frame 2", "100.000 times"), (lines[1], "frame 4", "0.010 times")]
    {
        assert!(line.starts_with("bake: warning: "), "{line}");
        assert!(line.contains(frame) && line.contains(factor) && line.contains("scaled.f32"), "{line}");
    }
    let frames = &report(&out)["frames"];
    let stretch: Vec<f64> = (0..4).map(|k| frames[k]["asset"]["median_stretch"].as_f64().unwrap()).collect();
    for (stretch, factor) in stretch.iter().zip([1.0, 100.0, 2.0, 0.01]) {
        assert!((stretch / factor - 1.0).abs() < 1e-5, "{stretch} {factor}");
    }
}

/// A sheet of 20 by 20 squares, as an OBJ, and its vertices.
fn sheet() -> (String, Vec<[f32; 3]>) {
    let points: Vec<[f32; 3]> = (0..441).map(|k| [(k % 21) as f32, (k / 21) as f32, 0.0]).collect();
    let mut obj = String::new();
    for [x, y, z] in &points {
        obj += &format!("v {x} {y} {z}\nvt {} {}\n", x / 20.0, y / 20.0);
    }
    for k in (0..420).filter(|k| k % 21 < 20) {
        let corners = [k + 1, k + 2, k + 23, k + 22].map(|v| format!("{v}/{v}"));
        obj += &format!("f {}\n", corners.join(" "));
    }
    (obj, points)
}

#[test]
fn vertices_in_another_order_are_warned_of() {
    let files = Files::new("order");
    let (obj, points) = sheet();
    files.write("rest.obj", obj.as_bytes());
    // A tenth of the vertices changes places with their mirror images.
    let mut mixed = points.clone();
    (0..22).for_each(|k| mixed.swap(k, 440 - k));
    files.write("mixed.f32", &floats(&[points, mixed].concat().concat()));
    let (arguments, out) = files.arguments("mixed.f32", &["--no-sheet"]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let order: Vec<&str> = warnings.lines().filter(|line| line.contains("order of the rest mesh")).collect();
    assert!(order.len() == 1 && order[0].contains("frame 2") && order[0].contains("mixed.f32"), "{warnings}");
    let asset = &report(&out)["frames"][1]["asset"];
    assert!(asset["median_stretch"].as_f64().unwrap() < 1.5, "{asset}");
    assert!(asset["stretched_share"].as_f64().unwrap() > 0.05, "{asset}");
}

#[test]
fn the_rest_may_come_from_a_pose() {
    let files = Files::new("rest_pose");
    let bent = REST.replace("v 0 0 0", "v 0.2 0 0.3").replace("v 2 1 0", "v 2 1 0.4");
    files.write("bent.obj", bent.as_bytes());
    let texels = |arguments: &[String], frame: u32| {
        let out = folder("rest_pose_out");
        let mut list = arguments.to_vec();
        let at = list.iter().position(|a| a == "--out").unwrap();
        list[at + 1] = text(&out).into();
        succeed(&borrow(&list));
        let bits = |uv: &[f32; 2]| uv.map(f32::to_bits);
        let (_, _, uvs) = read_exr(&out.join(format!("redirect.{frame:04}.1001.exr")));
        uvs.iter().map(bits).collect::<Vec<_>>()
    };
    let pose = files.path("pose.obj");
    // What a rest mesh with these positions gives.
    let (plain, _) = files.arguments("pose.obj", &["--no-sheet"]);
    let before = texels(&plain, 1);
    files.write("rest.obj", bent.as_bytes());
    let expected = texels(&plain, 1);
    assert!(before != expected, "the rest shows");
    files.write("rest.obj", REST.as_bytes());
    let (first, _) = files.arguments("bent.obj", &["--pose", &pose, "--rest-pose", "first", "--no-sheet"]);
    assert!(texels(&first, 2) == expected);
    let (file, _) = files.arguments("pose.obj", &["--rest-pose", &files.path("bent.obj"), "--no-sheet"]);
    assert!(texels(&file, 1) == expected);

    files.write("short.f32", &floats(&[0.0; 15]));
    let (bad, out) = files.arguments("pose.obj", &["--rest-pose", &files.path("short.f32")]);
    refuse(&bad, &out, "short.f32", "60 bytes");
    files.write("nan.f32", &floats(&[f32::NAN; 18]));
    let (bad, out) = files.arguments("pose.obj", &["--rest-pose", &files.path("nan.f32")]);
    refuse(&bad, &out, "nan.f32", "not finite");
}
