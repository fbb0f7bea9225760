//! Nothing that is somebody's work is written over: not the files that a bake reads, and no others that vrtm did not
//! write.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Files, REST, bake, borrow, floats, names, succeed, text};

/// All that lies below a folder: what files hold, and `None` for folders.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Option<Vec<u8>>> {
    let mut all = BTreeMap::new();
    for name in names(folder) {
        let path = folder.join(name);
        if path.is_dir() {
            all.extend(contents(&path));
        }
        let file = path.is_file().then(|| fs::read(&path).unwrap());
        all.insert(path, file);
    }
    all
}

/// Expects exit code 2, one line with these words, and that nothing below the test's folder has changed.
fn refuse(files: &Files, arguments: &[String], words: &[&str]) {
    let before = contents(&files.folder);
    let output = bake(&borrow(arguments));
    let line = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(line.lines().count(), 1, "one line: {line}");
    words.iter().for_each(|word| assert!(line.contains(word), "'{word}' in: {line}"));
    assert!(contents(&files.folder) == before, "{line}");
}

/// The same, without --overwrite and with it.
fn refuse_always(files: &Files, arguments: &[String], words: &[&str]) {
    refuse(files, arguments, words);
    let mut more = arguments.to_vec();
    more.push("--overwrite".into());
    refuse(files, &more, words);
}

/// Arguments for a quick bake to `out` without a sheet; the mesh has one tile.
fn arguments(files: &Files, out: &str, more: &[&str]) -> Vec<String> {
    files.write("rest.obj", one_tile(REST).as_bytes());
    files.write("pose.obj", one_tile(REST).as_bytes());
    let (rest, out) = (files.path("rest.obj"), files.path(out));
    let mut list = vec!["--out", &out, "--size", "16", "--no-sheet", "--no-film", "--device", "cpu"];
    if !more.contains(&"--rest") && !more.contains(&"--asset") {
        list.extend(["--rest", &rest]);
    }
    list.iter().chain(more).map(|word| word.to_string()).collect()
}

fn one_tile(obj: &str) -> String {
    obj.replace("f 2/5 3/6 6/7 5/8\n", "")
}

/// The names of what `arguments` writes.
const WRITTEN: [&str; 3] = ["redirect.0001.1001.exr", "report.json", "warp.0001.1001.exr"];

#[test]
fn no_file_that_is_read_is_ever_written_over() {
    let files = Files::new("read");
    let [rigid, pose] = ["r.1001.png", "pose.obj"].map(|name| files.path(name));
    let maps = files.folder.join("maps");
    fs::create_dir(&maps).unwrap();
    let at = |name: &str| files.path(&format!("maps/{name}"));
    let [exr, report, _] = WRITTEN.map(at);
    let with = |option: &str, file: &str, more: &[&str]| {
        refuse_always(&files, &arguments(&files, "maps", more), &[option, file, "input"]);
        fs::remove_file(at(file)).unwrap();
    };
    // Files are told by what they hold, not by their names' ends.
    fs::copy(&rigid, &exr).unwrap();
    let pattern = at("redirect.0001.<UDIM>.exr");
    with("--rigidity", WRITTEN[0], &["--pose", &pose, "--rigidity", &pattern]);
    fs::write(&report, one_tile(REST)).unwrap();
    with("--rest", WRITTEN[1], &["--rest", &report, "--pose", &pose, "--rigidity", &rigid]);
    fs::write(&report, one_tile(REST)).unwrap();
    // A frame that is not baked.
    with("--pose", WRITTEN[1], &["--pose", &pose, &report, "--frames", "1", "--rigidity", &rigid]);
    // An asset's own folder, and the map of a tile that its mesh does not have.
    for (tile, file) in [("1001", WRITTEN[0]), ("1005", WRITTEN[2])] {
        fs::write(at("rest.obj"), one_tile(REST)).unwrap();
        fs::write(at("frames.f32"), floats(&[0.5; 18])).unwrap();
        fs::write(at("asset.json"), format!("{{ \"rigidity\": {{ \"{tile}\": \"{file}\" }} }}")).unwrap();
        fs::copy(&rigid, at(file)).unwrap();
        with("--asset", file, &["--asset", text(&maps)]);
    }
}

#[test]
fn an_input_is_known_by_any_of_its_names() {
    let files = Files::new("aliases");
    let pose = files.path("pose.obj");
    fs::create_dir_all(files.folder.join("maps")).unwrap();
    let map = files.path("maps/redirect.0001.1001.exr");
    fs::copy(files.path("r.1001.png"), &map).unwrap();
    let check = |out: &str, rigidity: &str| {
        let more = ["--pose", &pose, "--rigidity", &files.path(rigidity)];
        refuse_always(
            &files,
            &arguments(&files, out, &more),
            &["--rigidity", "redirect.0001.1001.exr", "input"],
        );
    };
    check("maps/../maps", "maps/redirect.0001.1001.exr");
    // A folder that is not there before the bake.
    check("new/../maps", "maps/redirect.0001.1001.exr");
    // Where capitals do not tell files apart, these are one.
    fs::create_dir_all(files.folder.join("capitals")).unwrap();
    fs::copy(&map, files.path("capitals/Redirect.0001.1001.EXR")).unwrap();
    let more = ["--pose", &pose, "--rigidity", &files.path("capitals/Redirect.0001.1001.EXR")];
    refuse_always(&files, &arguments(&files, "capitals", &more), &["redirect.0001.1001.exr", "--rigidity"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        symlink("maps", files.folder.join("link")).unwrap();
        check("link", "maps/redirect.0001.1001.exr");
        check("maps", "link/redirect.0001.1001.exr");
        for folder in ["soft", "hard"] {
            fs::create_dir_all(files.folder.join(folder)).unwrap();
        }
        symlink(&map, files.path("soft/redirect.0001.1001.exr")).unwrap();
        check("soft", "maps/redirect.0001.1001.exr");
        check("maps", "soft/redirect.0001.1001.exr");
        fs::hard_link(&map, files.path("hard/redirect.0001.1001.exr")).unwrap();
        check("hard", "maps/redirect.0001.1001.exr");
    }
}

/// Arguments for a bake that works, with a sheet, and its folder.
fn working(name: &str) -> (Files, Vec<String>, PathBuf) {
    let files = Files::new(name);
    let (pose, rigid) = (files.path("pose.obj"), files.path("r.<UDIM>.png"));
    let mut list = arguments(&files, "out", &["--pose", &pose, "--rigidity", &rigid]);
    list.retain(|word| word != "--no-sheet");
    let out = files.folder.join("out");
    (files, list, out)
}

#[test]
fn files_of_others_are_replaced_only_if_that_is_asked_for() {
    let (files, list, out) = working("of_others");
    fs::create_dir(&out).unwrap();
    let mut replacing = list.clone();
    replacing.push("--overwrite".into());
    let picture = files.folder.join("r.1001.png");
    for (name, content) in [
        (WRITTEN[0], fs::read(&picture).unwrap()),
        (WRITTEN[0], b"notes".to_vec()),
        ("sheet.0001.png", fs::read(&picture).unwrap()),
        ("report.json", b"{ \"program\": { \"name\": \"another\" } }".to_vec()),
        ("report.json", b"[\"vrtm bake\"]".to_vec()),
    ] {
        fs::write(out.join(name), &content).unwrap();
        refuse(&files, &list, &[name, "--overwrite"]);
        succeed(&borrow(&replacing));
        assert!(fs::read(out.join(name)).unwrap() != content, "{name}");
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
    }
}

#[test]
fn own_files_are_replaced_even_if_they_are_damaged() {
    let (_, list, out) = working("own");
    succeed(&borrow(&list));
    // Sheets and reports tell times.
    let times = ["report.json", "sheet.0001.png"].map(|name| out.join(name));
    let maps =
        || contents(&out).into_iter().filter(|(path, _)| !times.contains(path)).collect::<BTreeMap<_, _>>();
    let whole = maps();
    // Cut after the header, and empty.
    for share in [3, 0] {
        for path in whole.keys().chain(&times[1..]) {
            let bytes = fs::read(path).unwrap();
            fs::write(path, &bytes[..bytes.len() * share / 4]).unwrap();
        }
        succeed(&borrow(&list));
        assert!(maps() == whole, "{share}");
        image::open(&times[1]).expect("a sheet");
    }
}

#[test]
#[cfg(unix)]
fn only_regular_files_are_replaced() {
    use std::os::unix::fs::symlink;
    let (files, mut list, out) = working("regular");
    succeed(&borrow(&list));
    let path = out.join(WRITTEN[0]);
    let bytes = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    refuse_always(&files, &list, &[WRITTEN[0], "not a regular file"]);
    fs::remove_dir(&path).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    refuse_always(&files, &list, &[WRITTEN[0], "not a regular file"]);
    fs::remove_file(&path).unwrap();
    // Its file may be on a drive that is not there today.
    symlink("nowhere.exr", &path).unwrap();
    refuse_always(&files, &list, &[WRITTEN[0], "not a regular file"]);
    fs::remove_file(&path).unwrap();
    // Of a link to a file of vrtm's, the link is replaced.
    let other = files.folder.join("other.exr");
    fs::write(&other, &bytes).unwrap();
    symlink(&other, &path).unwrap();
    list.extend(["--map-size".into(), "8".into()]);
    succeed(&borrow(&list));
    assert!(path.symlink_metadata().unwrap().is_file() && fs::read(&path).unwrap() != bytes);
    assert!(fs::read(&other).unwrap() == bytes);
}

#[test]
fn a_file_in_the_place_of_the_folder_is_told_before_the_first_solve() {
    let (files, list, _) = working("no_folder");
    files.write("out", b"notes");
    refuse_always(&files, &list, &["out: is not a folder"]);
}

/// Names of files that are being written may be taken: by a program that was killed, or one on another machine.
#[test]
#[cfg(unix)]
fn temporary_files_of_others_are_left_alone() {
    let (files, list, out) = working("temporary");
    fs::create_dir(&out).unwrap();
    let before = fs::read(files.path("r.1001.png")).unwrap();
    let program = crate::common::command();
    let output = std::process::Command::new("sh")
        .args(["-c", "ln -s ../r.1001.png out/.report.json.$$.part && exec \"$0\" \"$@\""])
        .arg(program.get_program())
        .args(&list)
        .current_dir(&files.folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(fs::read(files.path("r.1001.png")).unwrap() == before);
    assert!(out.join("report.json").symlink_metadata().unwrap().is_file());
}
