//! URIs in a file: data, or paths beside it.

/// Data in a URI itself; `None` if it is elsewhere.
pub fn data(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let (head, body) = uri.strip_prefix("data:")?.split_once(',')?;
    Some(if head.ends_with(";base64") { base64(body) } else { percent(body) })
}

/// The path of a URI, relative to the file that holds it.
pub fn path(uri: &str) -> Result<String, String> {
    if uri.contains("://") || uri.starts_with("data:") {
        let start: String = uri.chars().take(60).collect();
        return Err(format!("'{start}' is no path of a file beside it"));
    }
    String::from_utf8(percent(uri)?).map_err(|_| format!("'{uri}' is not UTF-8"))
}

/// Bytes of a text in which %20 is a space.
fn percent(text: &str) -> Result<Vec<u8>, String> {
    let mut parts = text.split('%');
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let code = part.get(..2).and_then(|code| u8::from_str_radix(code, 16).ok());
        bytes.push(code.ok_or_else(|| format!("'{text}' has a % without two digits"))?);
        bytes.extend(&part.as_bytes()[2..]);
    }
    Ok(bytes)
}

/// Bytes of a text in base 64 (RFC 4648, section 4).
fn base64(text: &str) -> Result<Vec<u8>, String> {
    let digits = text.trim_end_matches('=').bytes();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut held, mut bits) = (0u32, 0);
    for digit in digits {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return Err(format!("its data are not in base 64: they have a '{}'", char::from(digit))),
        };
        held = held << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
            held &= (1 << bits) - 1;
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_are_read_and_paths_are_decoded() {
        let text =
            |uri: &str| data(uri).map(|data| data.map(|bytes| String::from_utf8(bytes).expect("text")));
        for (code, plain) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob")] {
            assert_eq!(text(&format!("data:image/png;base64,{code}")), Some(Ok(plain.into())));
        }
        assert_eq!(text("data:,a%20b"), Some(Ok("a b".into())));
        assert_eq!(data("skin.png"), None);
        assert!(data("data:;base64,a*b=").expect("data").expect_err("no digit").contains("'*'"));
        assert_eq!(path("my%20skin.png").as_deref(), Ok("my skin.png"));
        assert!(path("https://example.org/a.png").is_err() && path("50%").is_err() && path("%C3").is_err());
    }
}
