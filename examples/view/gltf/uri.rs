//! URIs in a file: data, or paths beside it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use percent_encoding::percent_decode_str;

/// Data in a URI itself; `None` if it is elsewhere.
pub fn data(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let (head, body) = uri.strip_prefix("data:")?.split_once(',')?;
    if head.ends_with(";base64") {
        return Some(STANDARD.decode(body).map_err(|error| format!("its data are not in base 64: {error}")));
    }
    Some(Ok(percent_decode_str(body).collect()))
}

/// The path of a URI, relative to the file that holds it.
pub fn path(uri: &str) -> Result<String, String> {
    if uri.contains("://") || uri.starts_with("data:") {
        let start: String = uri.chars().take(60).collect();
        return Err(format!("'{start}' is no path of a file beside it"));
    }
    let path = percent_decode_str(uri).decode_utf8().map_err(|_| format!("'{uri}' is not UTF-8"))?;
    Ok(path.into_owned())
}
