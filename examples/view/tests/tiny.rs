//! Tiny glTF files for tests.

use serde_json::{Value, json};

/// A file with one buffer.
pub struct Tiny {
    pub json: Value,
    pub bytes: Vec<u8>,
}

impl Tiny {
    pub fn new(json: Value) -> Tiny {
        let mut tiny = Tiny { json, bytes: Vec::new() };
        tiny.json["asset"] = json!({ "version": "2.0" });
        tiny
    }

    /// Adds bytes; returns the number of their view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    /// Adds floats; returns the number of their accessor.
    pub fn floats(&mut self, of: &str, values: &[f32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor((of, 5126), values.len(), &bytes)
    }

    /// Adds integers of 16 bits; returns the number of their accessor.
    pub fn shorts(&mut self, of: &str, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.accessor((of, 5123), values.len(), &bytes)
    }

    fn accessor(&mut self, (of, component): (&str, u32), values: usize, bytes: &[u8]) -> usize {
        let each = ["SCALAR", "", "VEC2", "VEC3", "VEC4"].iter().position(|name| *name == of);
        let each = each.map_or(16, |place| place.max(1));
        let view = self.view(bytes);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": values / each, "type": of });
        self.push("accessors", accessor)
    }

    /// Adds an element to a list; returns its number.
    pub fn push(&mut self, list: &str, element: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().expect("a list");
        list.push(element);
        list.len() - 1
    }

    /// The file as text, with its buffer at a URI.
    pub fn gltf(&self, uri: &str) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        json.to_string().into_bytes()
    }

    /// The file in binary.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let chunk =
            |kind: &[u8; 4], bytes: &[u8]| [&(bytes.len() as u32).to_le_bytes(), &kind[..], bytes].concat();
        let chunks = [chunk(b"JSON", &text), chunk(b"BIN\0", &self.bytes)].concat();
        let length = 12 + chunks.len() as u32;
        [&b"glTF"[..], &2u32.to_le_bytes(), &length.to_le_bytes(), &chunks].concat()
    }

    /// A strip of skin from y = 0 to y = 2 over two bones, cut by a seam of its UVs at x = 0. Bone 1 bends it by a
    /// quarter turn around z in a second, while the morph target "bulge" lifts its end by 1 in z. Above all stands a
    /// node that makes y of z, doubles sizes and shifts by 10 in x.
    pub fn strip() -> Tiny {
        let mut tiny = Tiny::new(json!({
            "scene": 0,
            "scenes": [{ "nodes": [0, 3] }],
            "nodes": [
                { "children": [1], "rotation": [-0.5f32.sqrt(), 0.0, 0.0, 0.5f32.sqrt()], "scale": [2, 2, 2],
                  "translation": [10, 0, 0] },
                { "children": [2] },
                { "translation": [0, 1, 0] },
                { "mesh": 0, "skin": 0, "name": "strip", "translation": [100, 0, 0] },
            ],
        }));
        let columns = [(-1.0, 0.0), (0.0, 0.4), (0.0, 0.6), (1.0, 1.0)];
        let corners = || (0..3u16).flat_map(|row| columns.map(|(x, u)| (f32::from(row), x, u)));
        let points: Vec<f32> = corners().flat_map(|(y, x, _)| [x, y, 0.0]).collect();
        let uvs: Vec<f32> = corners().flat_map(|(y, _, u)| [u, 1.0 - 0.5 * y]).collect();
        let bulge: Vec<f32> =
            corners().flat_map(|(y, ..)| [0.0, 0.0, f32::from(u8::from(y == 2.0))]).collect();
        let joints: Vec<u16> = corners().flat_map(|_| [0, 1, 0, 0]).collect();
        let weights: Vec<f32> = corners().flat_map(|(y, ..)| [1.0 - 0.5 * y, 0.5 * y, 0.0, 0.0]).collect();
        let quad = |first: u16| [first, first + 1, first + 5, first, first + 5, first + 4];
        let indices: Vec<u16> = [0, 2, 4, 6].into_iter().flat_map(quad).collect();
        let attributes = json!({
            "POSITION": tiny.floats("VEC3", &points), "TEXCOORD_0": tiny.floats("VEC2", &uvs),
            "JOINTS_0": tiny.shorts("VEC4", &joints), "WEIGHTS_0": tiny.floats("VEC4", &weights),
        });
        let indices = tiny.shorts("SCALAR", &indices);
        let targets = json!([{ "POSITION": tiny.floats("VEC3", &bulge) }]);
        let part = json!({ "attributes": attributes, "indices": indices, "targets": targets });
        tiny.push("meshes", json!({ "primitives": [part], "extras": { "targetNames": ["bulge"] } }));
        let mut binds = [0.0; 32];
        (0..8).for_each(|k| binds[k * 5 - k / 4 * 4] = 1.0);
        binds[16 + 13] = -1.0;
        let binds = tiny.floats("MAT4", &binds);
        tiny.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": binds }));
        for (name, seconds) in [("short", 0.5), ("bend", 1.0)] {
            let times = tiny.floats("SCALAR", &[0.0, seconds]);
            let turn = tiny.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.5f32.sqrt(), 0.5f32.sqrt()]);
            let lift = tiny.floats("SCALAR", &[0.0, 1.0]);
            let target = |node: usize, path: &str| json!({ "node": node, "path": path });
            let channel = |sampler: usize, target: Value| json!({ "sampler": sampler, "target": target });
            tiny.push(
                "animations",
                json!({
                    "name": name,
                    "samplers": [{ "input": times, "output": turn }, { "input": times, "output": lift }],
                    "channels": [channel(0, target(2, "rotation")), channel(1, target(3, "weights"))],
                }),
            );
        }
        tiny
    }

    /// Gives the first mesh a material with this colour texture, a PNG.
    pub fn texture(&mut self, png: &[u8]) {
        let view = self.view(png);
        self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        self.push("textures", json!({ "source": 0 }));
        self.push("materials", json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }));
        self.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    }
}
