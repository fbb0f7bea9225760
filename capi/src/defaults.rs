//! Defaults of structs, for languages that cannot call the header's inline functions.

use std::ffi::{CStr, c_char, c_void};
use std::ptr;

use super::adapter::vrtm_adapter_info;
use super::allocator::vrtm_allocator;
use super::asset::vrtm_asset_info;
use super::carrier::{vrtm_carrier_desc, vrtm_carrier_info};
use super::desc::{self, LARGEST, Sized32};
use super::device::{vrtm_device_desc, vrtm_device_info};
use super::executor::vrtm_executor;
use super::external::vrtm_external_image;
use super::fetch::vrtm_fetch;
use super::guard::guard;
use super::job::vrtm_job_progress;
use super::map::{vrtm_map_desc, vrtm_map_info};
use super::mesh::vrtm_mesh_desc;
use super::prepare::vrtm_tile_estimate;
use super::refine::{vrtm_refinement_desc, vrtm_refinement_info, vrtm_refinement_pattern};
use super::report::{vrtm_asset_report, vrtm_tile_report};
use super::solve::vrtm_solve_options;
use super::status::{Failure, Outcome, vrtm_status};
use super::tile::{vrtm_tile_info, vrtm_tile_settings};
use super::types::{vrtm_array, vrtm_array_out, vrtm_carried, vrtm_image, vrtm_image_out};

/// Writes a struct's defaults, as its _init() function does, for languages that cannot call C's inline functions.
/// `name` is the struct's name, such as "vrtm_solve_options"; `size` is the size of the caller's struct in bytes, which
/// becomes its struct_size. Fields that this library does not know become zero.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for a name of no struct with a struct_size, or a size that it never had.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_defaults(name: *const c_char, value: *mut c_void, size: usize) -> vrtm_status {
    guard("vrtm_defaults", || {
        ensure!(!name.is_null(), "name is null");
        // SAFETY: the host vouches for a string.
        let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap_or_default();
        // SAFETY: the host vouches for `size` bytes during the call.
        let to = |size| unsafe { desc::slice_mut(value.cast::<u8>(), size, "value") };
        macro_rules! one_of {
            (set: $($set:ident)*, zero: $($zero:ident)*) => {
                match name {
                    $(stringify!($set) => write(<$set>::default(), size, to),)*
                    $(stringify!($zero) => write(<$zero>::zeroed(), size, to),)*
                    _ => Err(Failure::argument(format!("name: there is no struct {name:?} with a struct_size"))),
                }
            };
        }
        one_of!(
            set: vrtm_mesh_desc vrtm_tile_settings vrtm_solve_options vrtm_refinement_desc vrtm_device_desc,
            zero: vrtm_allocator vrtm_executor vrtm_device_info vrtm_adapter_info vrtm_array vrtm_image vrtm_image_out
                vrtm_asset_info vrtm_tile_info vrtm_tile_estimate vrtm_fetch vrtm_external_image vrtm_map_desc
                vrtm_map_info vrtm_job_progress vrtm_tile_report vrtm_asset_report vrtm_refinement_info
                vrtm_refinement_pattern vrtm_carrier_desc vrtm_carrier_info vrtm_array_out vrtm_carried
        )
    })
}

/// Writes the fields that fit into `size` bytes, and zero after them.
fn write<'a, T: Sized32>(
    value: T,
    size: usize,
    to: impl FnOnce(usize) -> Outcome<&'a mut [u8]>,
) -> Outcome<()> {
    ensure!(
        (T::FIRST..=LARGEST).contains(&size),
        "size is {size}, but {} has {} bytes",
        T::NAME,
        size_of::<T>()
    );
    let to = to(size)?;
    to.fill(0);
    let known = size.min(size_of::<T>());
    // SAFETY: both have `known` bytes; padding between fields is copied as it is.
    unsafe { ptr::copy_nonoverlapping(ptr::from_ref(&value).cast::<u8>(), to.as_mut_ptr(), known) };
    to[..4].copy_from_slice(&(size as u32).to_ne_bytes());
    Ok(())
}
