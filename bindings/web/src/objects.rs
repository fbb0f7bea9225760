//! Objects of JavaScript: what hosts give, field by field, and what they get.

use js_sys::{Object, Reflect};
use vrtm::{Carrier, Error, LogEntry, LogLevel, Result, Strain, TileReport, WorstFeature};
use wasm_bindgen::JsValue;

use crate::arrays::Array;

/// The fields of an object that were not read yet: who reads all that it knows sees what was misspelt.
pub struct Fields<'a> {
    /// The words before a field's name in errors: `mesh.`.
    prefix: String,
    object: &'a JsValue,
    left: Vec<String>,
}

impl<'a> Fields<'a> {
    /// `undefined` is an object without fields.
    pub fn new(prefix: impl Into<String>, object: &'a JsValue) -> Result<Fields<'a>> {
        let prefix = prefix.into();
        if object.is_undefined() || object.is_null() {
            return Ok(Fields { prefix, object, left: Vec::new() });
        }
        if !object.is_object() {
            return Err(Error::argument(format!("{}: an object is expected", prefix.trim_end_matches('.'))));
        }
        let keys = Object::keys(&Object::from(object.clone()));
        Ok(Fields { prefix, object, left: keys.iter().filter_map(|key| key.as_string()).collect() })
    }

    pub fn take(&mut self, field: &str) -> Option<JsValue> {
        self.left.retain(|left| left != field);
        if !self.object.is_object() {
            return None;
        }
        let value = Reflect::get(self.object, &field.into()).ok()?;
        (!value.is_undefined() && !value.is_null()).then_some(value)
    }

    pub fn name(&self, field: &str) -> String {
        self.prefix.clone() + field
    }

    pub fn error(&self, field: &str, what: &str) -> Error {
        Error::argument(format!("{}: {what}", self.name(field)))
    }

    pub fn array(&mut self, field: &str) -> Result<Array> {
        self.array_if(field)?.ok_or_else(|| self.error(field, "it is missing"))
    }

    pub fn array_if(&mut self, field: &str) -> Result<Option<Array>> {
        self.take(field).map(|value| Array::new(self.name(field), &value)).transpose()
    }

    pub fn u32s_if(&mut self, field: &str) -> Result<Option<Vec<u32>>> {
        self.array_if(field)?.as_ref().map(Array::u32s).transpose()
    }

    pub fn number(&mut self, field: &str) -> Result<Option<f64>> {
        let Some(value) = self.take(field) else { return Ok(None) };
        value.as_f64().map(Some).ok_or_else(|| self.error(field, "a number is expected"))
    }

    pub fn natural(&mut self, field: &str) -> Result<Option<u32>> {
        self.number(field)?.map(|number| natural(&self.name(field), number)).transpose()
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

/// The elements of an array.
pub fn list(name: &str, value: &JsValue) -> Result<Vec<JsValue>> {
    if !js_sys::Array::is_array(value) {
        return Err(Error::argument(format!("{name}: an array is expected")));
    }
    Ok(js_sys::Array::from(value).to_vec())
}

/// A whole number, which `as` would make of -1 and 0.5 as well.
pub fn natural(name: &str, number: f64) -> Result<u32> {
    let whole = number as u32;
    let wrong = || Error::argument(format!("{name}: {number} is not a whole number of at least 0"));
    if f64::from(whole) == number { Ok(whole) } else { Err(wrong()) }
}

/// `smoothness_floor` in the spelling of JavaScript: `smoothnessFloor`.
pub fn camel(name: &str) -> String {
    let mut words = name.split('_');
    let first = words.next().unwrap_or_default().to_owned();
    words.fold(first, |all, word| all + &word[..1].to_uppercase() + &word[1..])
}

pub fn object(fields: &[(&str, JsValue)]) -> Object {
    let object = Object::new();
    for (name, value) in fields {
        // A plain object takes any field.
        let _ = Reflect::set(&object, &(*name).into(), value);
    }
    object
}

/// An object with these numbers of a struct, in the spelling of JavaScript, and with other values.
macro_rules! object_of {
    ($of:expr, $($number:ident),* $(; $($name:literal: $value:expr),*)?) => {
        object(&[
            $((&*camel(stringify!($number)), JsValue::from($of.$number as f64)),)*
            $($(($name, JsValue::from($value)),)*)?
        ])
    };
}

pub fn pair<T: Copy + Into<JsValue>>([a, b]: [T; 2]) -> JsValue {
    js_sys::Array::of2(&a.into(), &b.into()).into()
}

pub fn log_entry(entry: &LogEntry) -> Object {
    let values = entry.values.iter().map(|&value| JsValue::from(value)).collect::<js_sys::Array>();
    object_of!(entry, uv_set, layer;
        "level": if entry.level == LogLevel::Warning { "warning" } else { "info" },
        "code": format!("{:?}", entry.code), "message": entry.message,
        "udim": entry.udim.map_or(JsValue::NULL, JsValue::from), "values": values)
}

pub fn carrier(carrier: &Carrier) -> Object {
    let info = carrier.info();
    let states: Vec<u8> = carrier.states().iter().map(|&state| state as u8).collect();
    object_of!(info, points, outside, folded, too_far, features, rim, bytes;
        "states": js_sys::Uint8Array::from(states.as_slice()), "milliseconds": info.ms)
}

pub fn report(report: &TileReport) -> Object {
    let strain = |strain: &Strain| object_of!(strain, rms, median, p95, p99, max);
    let worst =
        |of: &WorstFeature| object_of!(of, area, before, after; "uv": pair(of.uv), "atBorder": of.at_border);
    let of_mesh = report.strain.map_or(JsValue::NULL, |of_mesh| {
        let all = of_mesh.worst().iter().map(worst).collect::<js_sys::Array>();
        object_of!(of_mesh, features, features_worse, features_strained_before, features_strained_after;
            "before": strain(&of_mesh.before), "after": strain(&of_mesh.after), "worst": all)
        .into()
    });
    object_of!(report, udim, energy_before, energy, min_jacobian, folds, max_displacement, charts,
        charts_fallback, nodes_active;
        "grid": pair(report.grid), "truncated": report.truncated, "milliseconds": report.times.total,
        "strain": of_mesh)
}
