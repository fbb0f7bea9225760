//! Outputs that are asked for, and their memory.

use js_sys::{Float32Array, Uint8Array, Uint16Array};
use vrtm::{
    Carried, Carrier, Fetch, FetchKind, ImageLayout, ImageViewMut, PixelFormat, Result, Scalar, StridedMut,
};
use wasm_bindgen::JsValue;

use crate::arrays::zeros;
use crate::objects::{Fields, list, object};

/// Outputs of carried points, with the numbers per point.
const OF_POINTS: [(&str, usize); 5] =
    [("positions", 3), ("rotations", 4), ("matrices", 9), ("stretch", 2), ("uvs", 2)];

/// One output of a solve.
pub enum Output<'a> {
    Image { tile: usize, kind: FetchKind, layout: ImageLayout, texels: Vec<u8> },
    Points { carrier: &'a Carrier, arrays: Vec<(&'static str, usize, Vec<u8>)> },
}

impl<'a> Output<'a> {
    /// Reads an element of `fetches`.
    pub fn read(mut fields: Fields, find: impl FnOnce(f64) -> Result<&'a Carrier>) -> Result<Output<'a>> {
        let Some(carrier) = fields.take("carrier") else { return Output::image(fields) };
        let number = Fields::new(fields.name("carrier."), &carrier)?.number("number")?;
        let carrier = find(number.unwrap_or(f64::NAN))?;
        let names = fields.take("outputs").map(|names| list(&fields.name("outputs"), &names)).transpose()?;
        let names = names.unwrap_or_else(|| vec!["positions".into(), "rotations".into()]);
        let mut arrays = Vec::new();
        for name in names.iter().map(|name| name.as_string().unwrap_or_default()) {
            let Some(&(name, numbers)) = OF_POINTS.iter().find(|(known, _)| *known == name) else {
                let known = OF_POINTS.map(|(known, _)| known).join(", ");
                return Err(fields.error("outputs", &format!("'{name}' is not one of {known}")));
            };
            arrays.push((name, numbers, zeros(carrier.info().points * 4 * numbers as u64)?));
        }
        if ["rotations", "matrices"].iter().all(|name| arrays.iter().any(|(given, ..)| given == name)) {
            return Err(fields.error("outputs", "rotations and matrices are both given"));
        }
        fields.end()?;
        Ok(Output::Points { carrier, arrays })
    }

    fn image(mut fields: Fields) -> Result<Output<'a>> {
        let uv_set = fields.natural("uvSet")?;
        let of_set = uv_set.unwrap_or(0);
        let kinds = [
            ("uv", FetchKind::Redirection),
            ("delta", FetchKind::RedirectionDelta),
            ("udim", FetchKind::RedirectionUdim),
            ("warp", FetchKind::Warp),
            ("jacobian", FetchKind::Jacobian),
            ("filterScale", FetchKind::FilterScale),
            ("uvSet", FetchKind::UvSet(of_set)),
            ("uvSetDelta", FetchKind::UvSetDelta(of_set)),
        ];
        let mut kind = None;
        fields.choice("kind", &kinds.map(|(name, kind)| (name, Some(kind))), &mut kind)?;
        let kind = kind.ok_or_else(|| fields.error("kind", "it is missing"))?;
        if matches!(kind, FetchKind::UvSet(_) | FetchKind::UvSetDelta(_)) != uv_set.is_some() {
            return Err(
                fields.error("uvSet", "it goes with the kinds uvSet and uvSetDelta, and they with it")
            );
        }
        let mut number = |field| fields.natural(field)?.ok_or_else(|| fields.error(field, "it is missing"));
        let [tile, width, height] = [number("tile")?, number("width")?, number("height")?];
        let format = if fields.flag("half")?.unwrap_or(false) { PixelFormat::F16 } else { PixelFormat::F32 };
        fields.end()?;
        let layout = ImageLayout::packed(width, height, format).with_channels(kind.channels());
        let of_row = u64::from(kind.channels()) * format.size() as u64 * u64::from(width);
        let texels = zeros(of_row.saturating_mul(height.into()))?;
        Ok(Output::Image { tile: tile as usize, kind, layout, texels })
    }

    pub fn fetch(&mut self) -> Result<Fetch<'_>> {
        match self {
            Output::Image { tile, kind, layout, texels } => Ok(Fetch::Image {
                tile: *tile,
                kind: *kind,
                image: ImageViewMut::new("image", texels, *layout)?,
            }),
            Output::Points { carrier, arrays } => {
                let mut carried = Carried::default();
                for (name, numbers, bytes) in arrays {
                    let count = bytes.len() / (4 * *numbers);
                    let to = match *name {
                        "positions" => &mut carried.positions,
                        "stretch" => &mut carried.stretch,
                        "uvs" => &mut carried.uvs,
                        _ => &mut carried.rotations,
                    };
                    *to = Some(StridedMut::new(name, bytes, Scalar::F32, *numbers, count, 0)?);
                }
                Ok(Fetch::Carried { carrier, carried })
            }
        }
    }

    /// A typed array, or an object of them.
    pub fn into_js(self) -> JsValue {
        let buffer = |bytes: &[u8]| Uint8Array::from(bytes).buffer();
        match self {
            Output::Image { texels, layout, .. } if layout.format == PixelFormat::F16 => {
                Uint16Array::new(&buffer(&texels)).into()
            }
            Output::Image { texels, .. } => Float32Array::new(&buffer(&texels)).into(),
            Output::Points { arrays, .. } => {
                let floats = |bytes: &[u8]| JsValue::from(Float32Array::new(&buffer(bytes)));
                let fields: Vec<_> = arrays.iter().map(|(name, _, bytes)| (*name, floats(bytes))).collect();
                object(&fields).into()
            }
        }
    }
}
