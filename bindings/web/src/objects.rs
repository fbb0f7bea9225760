//! Objects of JavaScript: what hosts give, field by field, and what they get.

use js_sys::{Object, Reflect};
use vrtm::{Error, Result, Strain, TileInfo, TileReport, WorstFeature};
use wasm_bindgen::JsValue;

use crate::arrays::Array;

/// The fields of an object that were not read yet: who reads all that it knows sees what was misspelt.
pub struct Fields<'a> {
    name: &'static str,
    object: &'a JsValue,
    left: Vec<String>,
}

impl<'a> Fields<'a> {
    /// `undefined` is an object without fields.
    pub fn new(name: &'static str, object: &'a JsValue) -> Result<Fields<'a>> {
        if object.is_undefined() || object.is_null() {
            return Ok(Fields { name, object, left: Vec::new() });
        }
        if !object.is_object() {
            return Err(Error::argument(format!("{name}: an object is expected")));
        }
        let keys = Object::keys(&Object::from(object.clone()));
        Ok(Fields { name, object, left: keys.iter().filter_map(|key| key.as_string()).collect() })
    }

    fn take(&mut self, field: &str) -> Option<JsValue> {
        self.left.retain(|left| left != field);
        if !self.object.is_object() {
            return None;
        }
        let value = Reflect::get(self.object, &field.into()).ok()?;
        (!value.is_undefined() && !value.is_null()).then_some(value)
    }

    fn error(&self, field: &str, what: &str) -> Error {
        Error::argument(format!("{}.{field}: {what}", self.name))
    }

    pub fn array(&mut self, field: &str) -> Result<Array> {
        self.array_if(field)?.ok_or_else(|| self.error(field, "it is missing"))
    }

    pub fn array_if(&mut self, field: &str) -> Result<Option<Array>> {
        self.take(field).map(|value| Array::new(&format!("{}.{field}", self.name), &value)).transpose()
    }

    pub fn number(&mut self, field: &str) -> Result<Option<f64>> {
        let Some(value) = self.take(field) else { return Ok(None) };
        value.as_f64().map(Some).ok_or_else(|| self.error(field, "a number is expected"))
    }

    pub fn flag(&mut self, field: &str) -> Result<Option<bool>> {
        let Some(value) = self.take(field) else { return Ok(None) };
        value.as_bool().map(Some).ok_or_else(|| self.error(field, "true or false is expected"))
    }

    pub fn choice<T: Copy>(&mut self, field: &str, choices: &[(&str, T)], out: &mut T) -> Result<()> {
        let Some(value) = self.take(field) else { return Ok(()) };
        let given = value.as_string().unwrap_or_default();
        let Some(&(_, chosen)) = choices.iter().find(|(name, _)| *name == given) else {
            let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
            return Err(self.error(field, &format!("'{given}' is not one of {}", names.join(", "))));
        };
        *out = chosen;
        Ok(())
    }

    /// Fails if a field was not read.
    pub fn end(&self) -> Result<()> {
        self.left.first().map_or(Ok(()), |field| Err(self.error(field, "there is no such field")))
    }
}

/// `smoothness_floor` in the spelling of JavaScript: `smoothnessFloor`.
pub fn camel(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |all, word| all + &word[..1].to_uppercase() + &word[1..])
}

fn object(fields: &[(&str, JsValue)]) -> Object {
    let object = Object::new();
    for (name, value) in fields {
        // A plain object takes any field.
        let _ = Reflect::set(&object, &(*name).into(), value);
    }
    object
}

pub fn tile(info: &TileInfo) -> Object {
    let grid = js_sys::Array::of2(&info.grid[0].into(), &info.grid[1].into());
    object(&[
        ("udim", info.udim.into()),
        ("uvSet", info.uv_set.into()),
        ("layer", info.layer.into()),
        ("charts", info.charts.into()),
        ("grid", grid.into()),
    ])
}

pub fn report(report: &TileReport) -> Object {
    let strain = |strain: &Strain| -> JsValue {
        object(&[
            ("rms", strain.rms.into()),
            ("median", strain.median.into()),
            ("p95", strain.p95.into()),
            ("p99", strain.p99.into()),
            ("max", strain.max.into()),
        ])
        .into()
    };
    let worst = |worst: &WorstFeature| {
        object(&[
            ("uv", js_sys::Array::of2(&worst.uv[0].into(), &worst.uv[1].into()).into()),
            ("area", worst.area.into()),
            ("before", worst.before.into()),
            ("after", worst.after.into()),
            ("atBorder", worst.at_border.into()),
        ])
    };
    let of_mesh = report.strain.map_or(JsValue::NULL, |of_mesh| {
        object(&[
            ("before", strain(&of_mesh.before)),
            ("after", strain(&of_mesh.after)),
            ("features", of_mesh.features.into()),
            ("featuresWorse", of_mesh.features_worse.into()),
            ("featuresStrainedBefore", of_mesh.features_strained_before.into()),
            ("featuresStrainedAfter", of_mesh.features_strained_after.into()),
            ("worst", of_mesh.worst().iter().map(worst).collect::<js_sys::Array>().into()),
        ])
        .into()
    });
    object(&[
        ("udim", report.udim.into()),
        ("grid", js_sys::Array::of2(&report.grid[0].into(), &report.grid[1].into()).into()),
        ("energyBefore", report.energy_before.into()),
        ("energy", report.energy.into()),
        ("minJacobian", report.min_jacobian.into()),
        ("folds", (report.folds as f64).into()),
        ("maxDisplacement", report.max_displacement.into()),
        ("charts", report.charts.into()),
        ("chartsFallback", report.charts_fallback.into()),
        ("nodesActive", (report.nodes_active as f64).into()),
        ("truncated", report.truncated.into()),
        ("milliseconds", report.times.total.into()),
        ("strain", of_mesh),
    ])
}
