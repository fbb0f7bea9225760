//! A host that has a Vulkan device of its own: vrtm computes on the same GPU, found by its UUID, and writes results
//! into memory that the host reads with its own device.

#![cfg(target_os = "linux")]

use std::ffi::CStr;
use std::os::fd::{FromRawFd, OwnedFd};

use vrtm::{
    AdapterId, Asset, Backend, Device, DeviceSettings, ErrorKind, ExternalHandle, ExternalImage, FetchKind,
    ImageLayout, ImageViewMut, Origin, PixelFormat, Quality, adapters,
};
use vrtm_capi::{
    adapter::*, asset::*, device::*, external::*, fetch::*, handle::*, mesh::*, solve::*, status::*, tile::*,
    types::*,
};

use crate::child::in_a_child;
use crate::vulkan::{self, Host, Shared};
use vrtm_testkit::{self, Model, gpus, options};

/// The first adapter through Vulkan, and a host's device on the same GPU.
fn host() -> Option<(Device, Host)> {
    let uuid = gpus()?.into_iter().find_map(|adapter| adapter.uuid)?;
    let settings = DeviceSettings {
        backend: Backend::Gpu,
        adapter_id: Some(AdapterId::Uuid(uuid)),
        ..DeviceSettings::default()
    };
    let host = Host::open(uuid);
    if host.is_none() {
        let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
        assert!(!required, "VRTM_REQUIRE_GPU is set, but the driver exports no memory");
        println!("skipped: the driver exports no memory");
    }
    Some((Device::new(&settings).unwrap(), host?))
}

/// A solved asset.
fn solved(model: &Model, device: &Device, grid: u32) -> Asset {
    model.solved(device, grid, 1, &options(Quality::Draft))
}

/// An image in shared memory; the file descriptor is closed when the returned owner is dropped.
fn image(shared: &Shared, size: [u32; 2]) -> (ExternalImage, OwnedFd) {
    let fd = shared.descriptor();
    let image = ExternalImage {
        handle: ExternalHandle::OpaqueFd(fd),
        memory_size: shared.memory_size,
        memory_type: shared.memory_type,
        offset: 0,
        width: size[0],
        height: size[1],
        format: PixelFormat::F32,
        row_stride: None,
        origin: Origin::Top,
    };
    // SAFETY: the descriptor is the caller's, and is the owner's from here on.
    (image, unsafe { OwnedFd::from_raw_fd(fd) })
}

fn fetch(asset: &Asset, tile: usize, kind: FetchKind, image: &ExternalImage) -> vrtm::Result<()> {
    // SAFETY: the tests describe the memory as it is, and use it only when the call has returned.
    unsafe { asset.tile(tile).fetch_external(kind, image) }
}

/// The same layout in ordinary memory, by the ordinary fetch; bytes that are not written have the value `rest`.
fn expected(
    asset: &Asset,
    tile: usize,
    kind: FetchKind,
    image: &ExternalImage,
    bytes: u64,
    rest: u8,
) -> Vec<u8> {
    let mut all = vec![rest; bytes as usize];
    let layout = ImageLayout {
        row_stride: image.row_stride.map(|n| n as usize),
        origin: image.origin,
        ..ImageLayout::packed(image.width, image.height, image.format)
    };
    let mut view = ImageViewMut::new("image", &mut all[image.offset as usize..], layout).unwrap();
    asset.tile(tile).fetch(kind, &mut view).unwrap();
    all
}

/// The library's list agrees with Vulkan's own account of each GPU.
#[test]
fn adapters_have_vulkan_s_own_identities() {
    let Some(all) = gpus() else { return };
    let own = vulkan::gpus();
    let mut seen = 0;
    for adapter in all.iter().filter(|adapter| adapter.api == "Vulkan") {
        let same = own.iter().find(|gpu| Some(gpu.uuid) == adapter.uuid);
        let same = same.unwrap_or_else(|| panic!("{adapter:?} has a UUID that Vulkan does not know"));
        assert_eq!(adapter.name, same.name);
        assert_eq!(adapter.driver_uuid, Some(same.driver_uuid), "{adapter:?}");
        assert_eq!(adapter.luid, same.luid, "{adapter:?}");
        assert_eq!([adapter.vendor, adapter.device], [same.vendor, same.device], "{adapter:?}");
        let device = Device::new(&DeviceSettings {
            backend: Backend::Gpu,
            // Is not looked at: the identity takes its place.
            adapter: 99,
            adapter_id: Some(AdapterId::Uuid(same.uuid)),
            ..DeviceSettings::default()
        });
        assert_eq!(device.unwrap().info().name, same.name);
        seen += 1;
    }
    assert!(seen > 0, "{all:?}");
}

/// All redirections of all tiles, in both formats and several layouts, are bit by bit those of the ordinary fetch when
/// the host reads them; no other byte is written.
#[test]
fn the_host_reads_what_the_ordinary_fetch_gives() {
    let Some((device, host)) = host() else { return };
    let mut moved = 0;
    let mut tiles = 0;
    for (model, grid) in vrtm_testkit::analytic().iter().zip([48, 64, 112].into_iter().cycle()) {
        let asset = solved(model, &device, grid);
        for tile in 0..asset.tile_count() {
            tiles += 1;
            let both = [PixelFormat::F32, PixelFormat::F16];
            let sizes = [[64, 64], [37, 101], [200, 3]].into_iter().enumerate();
            for ((n, size), format) in sizes.flat_map(|size| both.map(|format| (size, format))) {
                let texel = 2 * format.size() as u64;
                let row = texel * u64::from(size[0]);
                let (offset, row_stride, origin) = [
                    (0, None, Origin::Top),
                    (808, Some(row + 56), Origin::Bottom),
                    (2 * texel, Some(row + texel), Origin::Top),
                ][n];
                let bytes = offset + row_stride.unwrap_or(row) * u64::from(size[1]);
                let shared = host.share(bytes);
                let (base, _fd) = image(&shared, size);
                let target = ExternalImage { format, offset, row_stride, origin, ..base };
                for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta, FetchKind::RedirectionUdim]
                {
                    shared.fill(0xa5);
                    fetch(&asset, tile, kind, &target).unwrap();
                    let found = shared.read();
                    let expected = expected(&asset, tile, kind, &target, bytes, 0xa5);
                    let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                    assert_eq!(
                        differ, 0,
                        "{} {tile} {kind:?} {format:?} {size:?}: bytes that differ",
                        model.name
                    );
                    if kind == FetchKind::RedirectionDelta && n == 0 && format == PixelFormat::F32 {
                        moved += vrtm_testkit::floats(&found).iter().filter(|d| **d != [0.0; 2]).count();
                    }
                }
            }
        }
    }
    println!("{tiles} tiles, {moved} moved texels in images of 64x64");
    assert!(moved > 1000, "{moved}");
}

/// One export serves many frames: descriptors stay the caller's, and none is left open.
#[test]
fn a_descriptor_is_handed_over_again_and_again() {
    let Some((device, host)) = host() else { return };
    // Alone in a process, so that nothing else opens any.
    if !in_a_child("external::a_descriptor_is_handed_over_again_and_again", &[]) {
        return;
    }
    let model = &vrtm_testkit::analytic()[0];
    let mut asset = model.asset_on(&device, 32);
    let size = [64, 64];
    let shared = host.share(8 * 64 * 64);
    let (target, fd) = image(&shared, size);
    let descriptors = || std::fs::read_dir("/proc/self/fd").unwrap().count();
    let mut open = 0;
    for round in 0..20 {
        asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
        shared.fill(0);
        fetch(&asset, 0, FetchKind::Redirection, &target).unwrap();
        let expected = expected(&asset, 0, FetchKind::Redirection, &target, 8 * 64 * 64, 0);
        assert!(shared.read() == expected, "{round}");
        if round == 4 {
            open = descriptors();
        }
    }
    assert_eq!(descriptors(), open, "descriptors after 5 rounds and after 20");
    // It is still the caller's.
    let again = fd.try_clone().unwrap();
    drop((fd, again));
}

#[test]
fn what_cannot_be_written_is_refused_by_name_and_nothing_is_written() {
    let Some((device, host)) = host() else { return };
    let model = &vrtm_testkit::analytic()[0];
    let size = [64u32, 64];
    let bytes = 8 * 64 * 64;
    let shared = host.share(bytes);
    let (target, _fd) = image(&shared, size);
    let kind = FetchKind::Redirection;
    let unsolved = model.asset_on(&device, 32);
    assert_eq!(fetch(&unsolved, 0, kind, &target).unwrap_err().kind, ErrorKind::NotSolved);
    let asset = solved(model, &device, 32);
    let on_the_cpu = solved(model, &vrtm_testkit::cpu(1), 32);
    shared.fill(0x3c);
    let refused = |asset: &Asset, kind, image: ExternalImage, error: ErrorKind, start: &str| {
        let found = fetch(asset, 0, kind, &image).unwrap_err();
        assert_eq!(found.kind, error, "{found}");
        assert!(found.message.starts_with(start), "{found}");
        assert!(shared.read().iter().all(|&byte| byte == 0x3c), "{start}: something was written");
    };
    let (bad, not) = (ErrorKind::InvalidArgument, ErrorKind::Unsupported);
    refused(&on_the_cpu, kind, target, not, "tile: its device is the CPU");
    for kind in [FetchKind::Warp, FetchKind::Jacobian, FetchKind::FilterScale] {
        refused(&asset, kind, target, not, &format!("kind: {kind:?} "));
    }
    refused(&asset, kind, ExternalImage { format: PixelFormat::U16, ..target }, not, "image.format");
    refused(&asset, kind, ExternalImage { width: 0, ..target }, bad, "image.width");
    refused(&asset, kind, ExternalImage { offset: 4, ..target }, bad, "image.offset");
    refused(&asset, kind, ExternalImage { offset: 8, ..target }, bad, "image.memory_size");
    refused(&asset, kind, ExternalImage { row_stride: Some(511), ..target }, bad, "image.row_stride");
    refused(&asset, kind, ExternalImage { row_stride: Some(516), ..target }, bad, "image.row_stride");
    refused(&asset, kind, ExternalImage { row_stride: Some(520), ..target }, bad, "image.memory_size");
    refused(&asset, kind, ExternalImage { height: 65, ..target }, bad, "image.memory_size");
    refused(&asset, kind, ExternalImage { memory_type: 31, ..target }, bad, "image.memory_type is 31");
    refused(&asset, kind, ExternalImage { memory_type: 32, ..target }, bad, "image.memory_type is 32");
    let handle = |handle| ExternalImage { handle, ..target };
    refused(&asset, kind, handle(ExternalHandle::OpaqueFd(-1)), bad, "image.handle is -1");
    refused(&asset, kind, handle(ExternalHandle::OpaqueFd(i32::MAX)), bad, "image.handle is 2147483647: ");
    refused(&asset, kind, handle(ExternalHandle::OpaqueWin32(8)), not, "image.handle_kind: ");
    // The same image is taken afterwards.
    fetch(&asset, 0, kind, &target).unwrap();
    assert!(shared.read() == expected(&asset, 0, kind, &target, bytes, 0));
}

/// The budget of the device holds while the call lasts, and is free again afterwards.
#[test]
fn a_budget_that_is_too_small_is_out_of_memory() {
    let Some((device, host)) = host() else { return };
    let model = &vrtm_testkit::analytic()[0];
    let held = {
        let _asset = solved(model, &device, 32);
        device.info().bytes_held
    };
    let small = Device::new(&DeviceSettings {
        backend: Backend::Gpu,
        memory_budget: Some(held + 1000),
        adapter_id: adapters().iter().find_map(|adapter| adapter.uuid).map(AdapterId::Uuid),
        ..DeviceSettings::default()
    });
    let small = small.unwrap();
    let asset = solved(model, &small, 32);
    let before = small.info().bytes_held;
    let shared = host.share(8 * 64 * 64);
    let (target, _fd) = image(&shared, [64, 64]);
    shared.fill(1);
    let error = fetch(&asset, 0, FetchKind::Redirection, &target).unwrap_err();
    assert_eq!(error.kind, ErrorKind::OutOfMemory, "{error}");
    assert!(error.message.starts_with("an image of 64x64 texels needs 32768 bytes"), "{error}");
    assert!(shared.read().iter().all(|&byte| byte == 1));
    let (little, _fd) = image(&shared, [8, 8]);
    fetch(&asset, 0, FetchKind::Redirection, &little).unwrap();
    assert_eq!(small.info().bytes_held, before);
}

#[test]
fn after_a_loss_the_call_says_so() {
    let Some((device, host)) = host() else { return };
    let model = &vrtm_testkit::analytic()[0];
    let asset = solved(model, &device, 32);
    let shared = host.share(8 * 64 * 64);
    let (target, _fd) = image(&shared, [64, 64]);
    assert!(device.lose_for_tests());
    let error = fetch(&asset, 0, FetchKind::Redirection, &target).unwrap_err();
    assert_eq!(error.kind, ErrorKind::DeviceLost, "{error}");
}

/// A struct of the C API with its size field set and all else zero.
fn sized<T: Copy>() -> T {
    // SAFETY: plain data, for which all zeros are a valid value; each of these structs starts with its size.
    unsafe {
        let mut value: T = std::mem::zeroed();
        std::ptr::from_mut(&mut value).cast::<u32>().write(size_of::<T>() as u32);
        value
    }
}

/// The way of a host in C: the adapter by its UUID, a mesh, a pose, and the map in the host's memory.
#[test]
fn the_c_functions_do_the_same() {
    let Some((_, host)) = host() else { return };
    let uuid = adapters().into_iter().find_map(|adapter| adapter.uuid).unwrap();
    let said = || {
        // SAFETY: the function returns this thread's zero-terminated line.
        unsafe { CStr::from_ptr(vrtm_last_error()) }.to_str().unwrap().to_owned()
    };
    let done = |status: vrtm_status| assert_eq!(status, VRTM_OK, "{}", said());
    let points: [[f32; 3]; 6] =
        [[0., 0., 0.], [1., 0., 0.], [2., 0., 0.], [0., 1., 0.], [1., 1., 0.], [2., 1., 0.]];
    let pose = points.map(|[x, y, z]| [if x > 0.5 { x + 0.4 } else { x }, y, z]);
    let uvs = points.map(|[x, y, _]| [x / 2.0, y]);
    let array = |data: *const f32, count| vrtm_array { data: data.cast(), count, ..sized() };
    let size = [48u32, 40];
    let bytes = 8 * size[0] as usize * size[1] as usize;
    let shared = host.share(bytes as u64);
    shared.fill(0);
    let (image, _fd) = image(&shared, size);
    let ExternalHandle::OpaqueFd(fd) = image.handle else { unreachable!() };
    // SAFETY: all pointers point to living memory of the stated sizes.
    unsafe {
        let mut device = vrtm_device { id: 0 };
        let mut desc: vrtm_device_desc = sized();
        (desc.backend, desc.adapter, desc.adapter_id) = (VRTM_BACKEND_GPU, 77, uuid);
        desc.adapter_by = VRTM_ADAPTER_BY_NUMBER;
        // An identity that is not said to be one is no number, either.
        assert_eq!(vrtm_device_create(&desc, &mut device), VRTM_ERROR_INVALID_ARGUMENT);
        assert!(
            said().starts_with("vrtm_device_create: desc.adapter_id: bytes from number 0 on"),
            "{}",
            said()
        );
        desc.adapter_by = VRTM_ADAPTER_BY_LUID;
        assert_eq!(vrtm_device_create(&desc, &mut device), VRTM_ERROR_INVALID_ARGUMENT);
        assert!(
            said().starts_with("vrtm_device_create: desc.adapter_id: bytes from number 8 on"),
            "{}",
            said()
        );
        desc.adapter_by = 4;
        assert_eq!(vrtm_device_create(&desc, &mut device), VRTM_ERROR_INVALID_ARGUMENT);
        assert!(said().starts_with("vrtm_device_create: desc.adapter_by is 4"), "{}", said());
        desc.adapter_by = VRTM_ADAPTER_BY_UUID;
        done(vrtm_device_create(&desc, &mut device));
        let mut mesh = vrtm_mesh_desc::default();
        let [rest, posed] = [&points, &pose].map(|points| array(points.as_ptr().cast(), 6));
        let pairs = array(uvs.as_ptr().cast(), 6);
        let (counts, corners) = ([4u32, 4], [0u32, 1, 4, 3, 1, 2, 5, 4]);
        (mesh.positions, mesh.uvs, mesh.uv_indices, mesh.uv_index_count) =
            (&rest, &pairs, corners.as_ptr(), 8);
        (mesh.face_counts, mesh.face_count) = (counts.as_ptr(), 2);
        (mesh.indices, mesh.index_count) = (corners.as_ptr(), 8);
        let (mut asset, mut tile) = (vrtm_asset { id: 0 }, vrtm_tile { id: 0 });
        done(vrtm_asset_create(device, &mesh, &mut asset));
        done(vrtm_asset_get_tile(asset, 0, &mut tile));
        let spots: Vec<u8> = (0..64 * 64).map(|i| if i / 8 % 3 == 1 { 255 } else { 0 }).collect();
        let mut map: vrtm_image = sized();
        (map.data, map.width, map.height, map.format) = (spots.as_ptr().cast(), 64, 64, VRTM_PIXEL_U8);
        done(vrtm_tile_set_rigidity(tile, &map));
        let mut target: vrtm_external_image = sized();
        (target.handle_kind, target.handle) = (VRTM_EXTERNAL_OPAQUE_FD, fd as u64);
        (target.memory_size, target.memory_type) = (image.memory_size, image.memory_type);
        [target.width, target.height] = size;
        let kind = VRTM_FETCH_REDIRECTION;
        assert_eq!(vrtm_tile_fetch_external(tile, kind, &target), VRTM_ERROR_NOT_SOLVED);
        done(vrtm_asset_solve(asset, &posed, std::ptr::null()));
        let refused = |change: &dyn Fn(&mut vrtm_external_image), start: &str| {
            let mut wrong = target;
            change(&mut wrong);
            assert_eq!(vrtm_tile_fetch_external(tile, kind, &wrong), VRTM_ERROR_INVALID_ARGUMENT, "{start}");
            assert!(said().starts_with(&format!("vrtm_tile_fetch_external: {start}")), "{}", said());
        };
        refused(&|image| image.struct_size = 8, "image.struct_size is 8");
        refused(&|image| image.handle_kind = 0, "image.handle_kind is 0");
        refused(&|image| image.handle = u64::MAX, "image.handle is 18446744073709551615");
        refused(&|image| image.format = 9, "image.format is 9");
        refused(&|image| image.origin = 2, "image.origin is 2");
        refused(&|image| image.offset = 4, "image.offset is 4");
        assert_eq!(vrtm_tile_fetch_external(tile, 99, &target), VRTM_ERROR_INVALID_ARGUMENT);
        assert_eq!(vrtm_tile_fetch_external(tile, kind, std::ptr::null()), VRTM_ERROR_INVALID_ARGUMENT);
        assert!(shared.read().iter().all(|&byte| byte == 0));
        done(vrtm_tile_fetch_external(tile, kind, &target));
        let mut ordinary = vec![0u8; bytes];
        let mut out: vrtm_image_out = sized();
        (out.data, out.width, out.height) = (ordinary.as_mut_ptr().cast(), size[0], size[1]);
        done(vrtm_asset_fetch(&vrtm_fetch { kind, tile, image: &out, ..sized() }, 1));
        assert!(ordinary.iter().any(|&byte| byte != 0) && shared.read() == ordinary);
        done(vrtm_asset_destroy(asset));
        assert_eq!(vrtm_tile_fetch_external(tile, kind, &target), VRTM_ERROR_INVALID_HANDLE);
        done(vrtm_device_destroy(device));
    }
}
