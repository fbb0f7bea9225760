mod map;
mod resample;
mod texels;

use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::map::Map;
use vrtm_core::image::*;

fn map_of(width: usize, height: usize, f: impl Fn(usize, usize) -> f32) -> Map {
    let values: Vec<f32> = (0..width * height).map(|i| f(i % width, i / width)).collect();
    Map::from_values(width, height, &values)
}

#[test]
fn layouts_are_checked() {
    let bytes = [0u8; 64];
    let packed = ImageLayout::packed(4, 4, PixelFormat::F32);
    assert!(ImageView::new("map", &bytes, packed).is_ok());
    let short = ImageLayout { row_stride: Some(15), ..packed };
    let message = ImageView::new("map", &bytes, short).unwrap_err().message;
    assert!(message.contains("map: row_stride"), "{message}");
    let message = |layout| ImageView::new("map", &bytes, layout).unwrap_err().message;
    // If a stride makes the image exceed memory, the stride is blamed, not the size.
    let far = ImageLayout { row_stride: Some(usize::MAX / 2), ..packed };
    assert!(
        message(far).starts_with("map: row_stride is 9223372036854775807 bytes: 4 rows"),
        "{}",
        message(far)
    );
    for row_stride in [None, Some(usize::MAX)] {
        let far = ImageLayout { pixel_stride: Some(usize::MAX / 2), row_stride, ..packed };
        assert!(message(far).starts_with("map: pixel_stride is "), "{}", message(far));
    }
    let large = ImageLayout::packed(u32::MAX, u32::MAX, PixelFormat::F32);
    assert_eq!(message(large), "map: 4294967295x4294967295 texels are too large");
    let empty = ImageLayout { width: 0, ..packed };
    assert!(ImageView::new("map", &bytes, empty).unwrap_err().message.contains("zero"));
    assert!(ImageView::new("map", &bytes[..63], packed).is_err());
}
