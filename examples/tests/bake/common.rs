//! Running the bake program, and looking at what it wrote.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use exr::prelude::read_first_rgba_layer_from_file;

/// Runs the bake program, which cargo builds before it runs tests, in a folder beside that of the test's executable.
pub fn bake(arguments: &[&str]) -> Output {
    let test = std::env::current_exe().expect("a path to this test");
    let profile = test.ancestors().nth(2).expect("target/<profile>/deps/<test>");
    let program = profile.join("examples").join(format!("bake{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: cargo build --example bake", program.display());
    let mut command = Command::new(program);
    for variable in ["VRTM_DEVICE", "VRTM_THREADS", "VRTM_GPU_LIMITS"] {
        command.env_remove(variable);
    }
    command.args(arguments).output().expect("bake runs")
}

/// An empty folder for one test.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

pub fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// Runs a bake that must succeed; returns what it prints, and its warnings but for those of grids that are too coarse
/// for their features: these keep tests short.
pub fn succeed(arguments: &[&str]) -> (String, String) {
    let output = bake(arguments);
    let [printed, said] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
    assert!(output.status.success(), "{arguments:?}: {said}");
    (
        printed,
        said.lines().filter(|line| !line.contains("are too few:")).map(|line| format!("{line}\n")).collect(),
    )
}

/// The folder of one bake of the built-in scene, with its film, and what it printed. Its frame 5 is strained most.
pub fn mug() -> &'static (PathBuf, (String, String)) {
    static MUG: LazyLock<(PathBuf, (String, String))> = LazyLock::new(|| {
        let out = folder("mug");
        let said = succeed(&["--size", "64", "--frames", "5,1,5", "--out", text(&out)]);
        (out, said)
    });
    &MUG
}

/// The size and the UVs of an EXR file, which has 0 in B.
pub fn read_exr(path: &Path) -> (usize, usize, Vec<[f32; 2]>) {
    let new = |size: exr::math::Vec2<usize>, _: &_| (size, vec![[0.0; 2]; size.area()]);
    let set = |(size, texels): &mut (exr::math::Vec2<usize>, Vec<[f32; 2]>),
               at: exr::math::Vec2<usize>,
               rgba: (f32, f32, f32, f32)| {
        assert_eq!(rgba.2, 0.0);
        texels[at.y() * size.x() + at.x()] = [rgba.0, rgba.1];
    };
    let image =
        read_first_rgba_layer_from_file(path, new, set).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let (size, texels) = image.layer_data.channel_data.pixels;
    (size.x(), size.y(), texels)
}

/// Two quads side by side on two tiles, lifted in the pose, with a map each; UVs have indices of their own.
pub struct Files {
    pub folder: PathBuf,
}

pub const REST: &str = "o sheet\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n\
    vt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9\nvt 1.1 0.1\nvt 1.9 0.1\nvt 1.9 0.9\nvt 1.1 0.9\n\
    f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8\n";

impl Files {
    pub fn new(name: &str) -> Files {
        let files = Files { folder: folder(name) };
        files.write("rest.obj", REST.as_bytes());
        files.write("pose.obj", REST.replace("v 0 1 0", "v 0 1.4 0.2").as_bytes());
        files.write("poses.f32", &[0u8; 2 * 6 * 12]);
        let map = image::ImageBuffer::from_fn(32, 32, |x, y| {
            image::Luma([if (10..22).contains(&x) && (10..22).contains(&y) { u16::MAX } else { 0 }])
        });
        map.save(files.folder.join("r.1001.png")).expect("a map");
        // Nothing of the second tile is rigid.
        image::GrayImage::new(32, 32).save(files.folder.join("r.1002.png")).expect("a map");
        files
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.folder.join(name), bytes).expect("a file");
    }

    pub fn path(&self, name: &str) -> String {
        text(&self.folder.join(name)).to_string()
    }

    /// The files as the programs name them.
    pub fn wanted(&self, pose: &str, rigidity: &str) -> vrtm_examples::source::Files {
        vrtm_examples::source::Files {
            rest: Some(self.folder.join("rest.obj")),
            pose: vec![self.folder.join(pose)],
            rigidity: Some(self.path(rigidity)),
            ..Default::default()
        }
    }

    /// Bakes with these poses and without a film.
    pub fn bake(&self, poses: &[&str], more: &[&str]) -> Vec<String> {
        let poses = poses.iter().map(|pose| self.path(pose));
        let start = ["--rest".into(), self.path("rest.obj"), "--rigidity".into(), self.path("r.<UDIM>.png")];
        let end = ["--no-film", "--pose"].map(String::from);
        start.into_iter().chain(more.iter().map(|word| word.to_string())).chain(end).chain(poses).collect()
    }
}
