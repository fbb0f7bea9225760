use half::f16;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::{ImageView, ImageViewMut, Origin};

#[test]
fn texels_have_their_layout() {
    let mut texels = [[f16::ZERO; 3]; 6];
    let view = ImageViewMut::from_texels("map", &mut texels, [3, 2]).unwrap();
    let layout = &view.layout;
    assert_eq!((layout.format, layout.channels, layout.bytes), (PixelFormat::F16, 3, 36));
    assert_eq!(layout.offset(0, 0), 18);
    assert_eq!(view.with_origin(Origin::Bottom).layout.offset(0, 0), 0);
    let view = ImageView::from_texels("map", &[0u16; 6], [3, 2]).unwrap();
    assert_eq!((view.shape(), view.layout.offset(0, 0)), (([3, 2], PixelFormat::U16), 6));
    assert_eq!(view.with_origin(Origin::Bottom).layout.offset(0, 0), 0);
}

#[test]
fn other_numbers_of_texels_are_refused() {
    let message =
        |count: usize, size| ImageView::from_texels("map", &vec![0.0f32; count], size).unwrap_err().message;
    assert_eq!(message(7, [3, 2]), "map: 7 texels given, 3x2 are 6");
    assert_eq!(message(5, [3, 2]), "map: 5 texels given, 3x2 are 6");
    assert!(message(0, [0, 2]).contains("zero"));
    assert!(ImageViewMut::from_texels("map", &mut [0.0f32; 4], [u32::MAX, u32::MAX]).is_err());
}
