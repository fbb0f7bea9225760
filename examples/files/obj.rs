//! Reads Wavefront OBJ: polygons stay polygons, and vertices, UVs and faces keep their order in the file. `vrtm bake` reads by
//! the same rules (docs/bake.md); tests/bake/obj.json has cases for both.
//!
//! Readers at hand keep positions in f32, sort faces by group, or merge vertices.

use std::path::Path;

use crate::failure::{Failure, Result, read};
use crate::mesh::{Mesh, NO_UV, Positions};

/// Reads a mesh with UVs.
pub fn load_mesh(path: &Path) -> Result<Mesh> {
    let Obj { positions, uvs, face_counts, indices, uv_indices } = load(path)?;
    if face_counts.is_empty() {
        return Err(Failure::file(path, "no faces"));
    }
    if uv_indices.iter().all(|&uv| uv == NO_UV) {
        return Err(Failure::file(path, "no faces with UVs (vt)"));
    }
    Ok(Mesh { rest: Positions::F64(positions), uvs, face_counts, indices, uv_indices })
}

/// Reads the vertices of a pose. If the file has faces, they must be those of the rest mesh: other faces mean that the
/// vertices are in a different order.
pub fn load_positions(path: &Path, rest: &Mesh) -> Result<Positions> {
    let Obj { positions, face_counts, indices, .. } = load(path)?;
    let count = face_counts.len();
    // A wrong number of vertices is reported first, elsewhere.
    if count == 0 || positions.len() != rest.rest.len() {
        return Ok(Positions::F64(positions));
    }
    let pose = Mesh { face_counts, indices, ..Mesh::default() };
    for (number, (face, range)) in (1..).zip(pose.faces().zip(rest.faces())) {
        let (face, expected) = (&pose.indices[face], &rest.indices[range]);
        if !is_rotated(face, expected) {
            let list = |face: &[u32]| face.iter().map(|v| format!(" {}", v + 1)).collect::<String>();
            let reason = format!(
                "face {number} has the vertices{}, but that of the rest mesh has{}: the vertices must be in the same order",
                list(face),
                list(expected)
            );
            return Err(Failure::file(path, reason));
        }
    }
    if count != rest.face_counts.len() {
        let reason = format!("{count} faces, but the rest mesh has {}", rest.face_counts.len());
        return Err(Failure::file(path, reason));
    }
    Ok(Positions::F64(positions))
}

/// True if two faces have the same corners in the same cyclic order.
fn is_rotated(face: &[u32], expected: &[u32]) -> bool {
    let n = face.len();
    n == expected.len() && (0..n).any(|first| (0..n).all(|k| face[(first + k) % n] == expected[k]))
}

fn load(path: &Path) -> Result<Obj> {
    let obj = Obj::parse(&read(path)?).map_err(|reason| Failure::file(path, reason))?;
    if obj.positions.is_empty() {
        return Err(Failure::file(path, "no vertices (v); is it an OBJ file?"));
    }
    Ok(obj)
}

/// The arrays of a file. Indices count from 0; a face that has a corner without UV has [`NO_UV`] at all of them.
#[derive(Debug, Default)]
struct Obj {
    positions: Vec<[f64; 3]>,
    uvs: Vec<[f32; 2]>,
    face_counts: Vec<u32>,
    indices: Vec<u32>,
    uv_indices: Vec<u32>,
}

impl Obj {
    fn parse(bytes: &[u8]) -> std::result::Result<Obj, String> {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
            return Err("this is UTF-16: save it as UTF-8".into());
        }
        if bytes[..bytes.len().min(1024)].contains(&0) {
            return Err("this is no text, or UTF-16: save it as UTF-8".into());
        }
        // Names may be in another encoding; what is read is ASCII.
        let text = String::from_utf8_lossy(bytes);
        let mut obj = Obj::default();
        let (mut start, mut statement) = (1usize, String::new());
        for (number, line) in (1..).zip(lines(&text)) {
            let code = without_comment(line);
            if statement.is_empty() {
                start = number;
            }
            match code.strip_suffix('\\') {
                // A comment ends with its line: it may end with the path of a folder.
                Some(part) if code.len() == line.len() => {
                    statement += part;
                    statement += " ";
                    continue;
                }
                _ => statement += code,
            }
            obj.read(&statement).map_err(|reason| format!("line {start}: {reason}"))?;
            statement.clear();
        }
        obj.read(&statement).map_err(|reason| format!("line {start}: {reason}"))?;
        obj.check()?;
        Ok(obj)
    }

    /// Reads a statement.
    fn read(&mut self, statement: &str) -> std::result::Result<(), String> {
        let mut words = statement.split_ascii_whitespace();
        let word = words.next();
        let words: Vec<&str> = match word {
            Some("v" | "vt" | "f") => words.collect(),
            _ => return Ok(()),
        };
        match word {
            // A weight or a colour may follow, or both.
            Some("v") => self.positions.push(numbers(&words, &[3, 4, 6, 7])?),
            Some("vt") => {
                let [u, v]: [f64; 2] = match words.len() {
                    1 => [numbers::<1>(&words, &[1])?[0], 0.0],
                    _ => numbers(&words, &[2, 3])?,
                };
                self.uvs.push([u as f32, v as f32]);
            }
            _ => self.face(&words)?,
        }
        Ok(())
    }

    fn face(&mut self, words: &[&str]) -> std::result::Result<(), String> {
        if words.len() < 3 {
            return Err(format!("face {} has {} corners", self.face_counts.len() + 1, words.len()));
        }
        let first = self.uv_indices.len();
        for word in words {
            let (vertex, uv) = corner(word).ok_or_else(|| format!("'{word}' is not the corner of a face"))?;
            let place = |index: i32, count: usize| match index {
                1.. => Ok(index as u32 - 1),
                _ => (count as u32)
                    .checked_add_signed(index)
                    .ok_or_else(|| format!("'{word}' names what stands before the file's first")),
            };
            self.indices.push(place(vertex, self.positions.len())?);
            self.uv_indices.push(uv.map_or(Ok(NO_UV), |uv| place(uv, self.uvs.len()))?);
        }
        if self.uv_indices[first..].contains(&NO_UV) {
            self.uv_indices[first..].fill(NO_UV);
        }
        self.face_counts.push(words.len() as u32);
        Ok(())
    }

    /// Faces may name what stands behind them in the file, but not what the file does not have.
    fn check(&self) -> std::result::Result<(), String> {
        let mut corners = self.indices.iter().zip(&self.uv_indices);
        for (face, &count) in (1..).zip(&self.face_counts) {
            for (&vertex, &uv) in corners.by_ref().take(count as usize) {
                for (index, count, name) in [(vertex, self.positions.len(), "v"), (uv, self.uvs.len(), "vt")]
                {
                    if index as usize >= count && index != NO_UV {
                        return Err(format!(
                            "face {face} names the {name} {}, but there are {count}",
                            index + 1
                        ));
                    }
                }
            }
        }
        Ok(())
    }
}

/// Lines that end as on any system: with LF, CR LF or CR.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'))
}

/// The part of a line before its comment, which begins with a word: in `1.#QNAN`, the number of some programs that is none,
/// nothing is a comment.
fn without_comment(line: &str) -> &str {
    let begins = |&(at, _): &(usize, &str)| at == 0 || line.as_bytes()[at - 1].is_ascii_whitespace();
    line.match_indices('#').find(begins).map_or(line, |(at, _)| &line[..at])
}

/// The first numbers of a statement that may have as many words as `counts` says.
fn numbers<const N: usize>(words: &[&str], counts: &[usize]) -> std::result::Result<[f64; N], String> {
    let all: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    let all = all.filter(|all| counts.contains(&all.len()));
    all.and_then(|all| all.first_chunk().copied()).ok_or_else(|| {
        format!("'{}' is not {N} numbers", words.join(" ").chars().take(60).collect::<String>())
    })
}

/// The indices of `v`, `v/vt`, `v//vn` or `v/vt/vn`, of which the last may be left out after its slash.
fn corner(word: &str) -> Option<(i32, Option<i32>)> {
    let index = |text: &str| text.parse().ok().filter(|&index: &i32| index != 0);
    let mut parts = word.split('/');
    let vertex = index(parts.next()?)?;
    let mut further = [None; 2];
    for place in &mut further {
        *place = parts
            .next()
            .filter(|text| !text.is_empty())
            .map(|text| index(text).ok_or(()))
            .transpose()
            .ok()?;
    }
    parts.next().is_none().then_some((vertex, further[0]))
}
