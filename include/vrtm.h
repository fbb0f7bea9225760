/*
 * vrtm: keeps painted features rigid while the surface under them deforms.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 * Generated from src/ffi: do not edit. `VRTM_UPDATE_HEADER=1 cargo test --test c_api header::` writes it anew.
 *
 * THE PIPELINE
 *
 *   device   vrtm_device_create           once: backend, threads, memory, log
 *   asset    vrtm_asset_create            once per mesh: topology, rest positions, UVs
 *   maps     vrtm_tile_set_rigidity,      per UDIM tile, and again when the artist paints
 *            vrtm_tile_set_mask
 *            vrtm_tile_update_rigidity  after a stroke of a brush
 *   prepare  vrtm_tile_estimate, vrtm_tile_save, vrtm_tile_load   if memory or the first frame's time matter
 *   frame    vrtm_asset_redirect          every frame: new positions in, redirection maps out
 *            or vrtm_asset_solve, then vrtm_tile_fetch and vrtm_asset_fetch_corner_uvs
 *   job      vrtm_asset_submit, then vrtm_job_wait    the same beside the host's own work, which can be cancelled
 *   facts    vrtm_tile_report, vrtm_asset_report
 *   refine   vrtm_refinement_create, then vrtm_refinement_fetch_corner_uvs every frame, for hosts that know UV sets
 *            only
 *
 * A redirection map has two channels: for a surface point's UV it holds the UV at which to sample the texture. So the
 * shader does, with v pointing up and texture coordinates within the tile (VRTM_FETCH_ has other forms):
 *
 *   vec2 uv2 = texture(redirection, uv).rg;
 *   vec4 colour = texture(albedo, uv2);
 *
 * EXAMPLE (f32 positions of a triangle mesh with one UV per vertex; error handling left out)
 *
 *   vrtm_device device;
 *   vrtm_device_create(NULL, &device);
 *   vrtm_array points = vrtm_array_init(), uvs = vrtm_array_init();
 *   points.data = rest_xyz;  points.count = vertex_count;
 *   uvs.data = uv_pairs;     uvs.count = vertex_count;
 *   vrtm_mesh_desc mesh = vrtm_mesh_desc_init();
 *   mesh.positions = &points;
 *   mesh.indices = indices;  mesh.index_count = index_count;
 *   mesh.uvs = &uvs;         mesh.uv_indices = indices;  mesh.uv_index_count = index_count;
 *   vrtm_asset asset;
 *   vrtm_asset_create(device, &mesh, &asset);
 *   vrtm_tile tile;
 *   vrtm_asset_find_tile(asset, 1001, &tile);
 *   vrtm_image rigidity = vrtm_image_init();
 *   rigidity.data = bytes;   rigidity.format = VRTM_PIXEL_U8;  rigidity.width = 512;  rigidity.height = 512;
 *   vrtm_tile_set_rigidity(tile, &rigidity);
 *   vrtm_image_out out = vrtm_image_out_init();
 *   out.data = map;          out.width = 512;  out.height = 512;
 *   vrtm_fetch fetch = vrtm_fetch_init();
 *   fetch.tile = tile;       fetch.image = &out;
 *   for (each frame) {
 *       points.data = posed_xyz;
 *       vrtm_asset_redirect(asset, &points, NULL, &fetch, 1);
 *   }
 *   vrtm_asset_destroy(asset);
 *   vrtm_device_destroy(device);
 *
 * RULES FOR ALL FUNCTIONS
 *
 * Status. Every function but vrtm_version, vrtm_status_string and vrtm_last_error returns VRTM_OK (0) or an error.
 * After an error, vrtm_last_error() on the same thread says which argument, and which element of it, was wrong.
 * Outputs are written only on VRTM_OK, and an asset's last good result stays readable after a call that failed.
 * Besides the errors that a function lists, any may give VRTM_ERROR_INTERNAL: a defect of the library, which left the
 * asset as it was; and any that computes something VRTM_ERROR_OUT_OF_MEMORY.
 *
 * Handles are numbers, to be copied freely. A zero, destroyed or foreign handle is an error and never does harm; a
 * number once given out is never given out again. Objects may be destroyed in any order.
 *
 * Structs that start with struct_size may grow at their end in later versions. Get them from their _init() function,
 * which sets struct_size and the defaults. The library accepts structs of older headers (fields that those do not have
 * count as zero, which is the default of every field that is added) and of newer ones, as long as the fields that it
 * does not know are zero; otherwise it gives VRTM_ERROR_UNSUPPORTED. Structs that the library fills keep the caller's
 * struct_size.
 *
 * Memory. Inputs are read during the call and copied where needed: the caller may free or change them as soon as it
 * returns. Outputs go to memory of the caller. Nothing is allocated on one side and freed on the other. Pointers must
 * be null or valid for the size that goes with them, structs and number arrays aligned as in C; the data of
 * vrtm_array, vrtm_image and vrtm_image_out need no alignment. Strides are in bytes.
 *
 * Memory that is short. A call for which there is too little memory gives VRTM_ERROR_OUT_OF_MEMORY, with the number of
 * bytes that could not be had: nothing was written, maps and the last result are as they were, and the same call may
 * be made again. Prepared grids and a solver's memory may be gone then, and are made anew when they are needed. The
 * process goes on: for all memory whose size follows from input that holds without exception. What the code for GPUs
 * takes in small pieces comes out of a reserve of 256 KiB when the system has nothing left; a driver may do otherwise.
 * Where the memory comes from is the host's to say (vrtm_allocator).
 *
 * Floating point. Functions work in the processor's default mode (rounding to nearest, no flushing to zero, no traps),
 * the host's log function included, and restore the mode of the calling thread (on x86-64 and ARM64).
 *
 * Threads. Any function may be called from any thread. Different assets work at the same time. Calls on one asset do
 * not wait for each other. Results (maps, corner UVs, reports), what describes a device, an asset or a job, and tiles
 * can be asked for at any time, also while the next result is computed: what is read is the last good one. A call that
 * solves or changes anything gives VRTM_ERROR_BUSY while another call, or a job, is using the asset, and so do
 * vrtm_tile_info (which may have to prepare the tile), vrtm_tile_get_settings and vrtm_tile_estimate while such a call
 * runs. A solve uses threads of its own, which end before it returns, or the host's (vrtm_executor). No lock is held
 * while a function of the host runs.
 *
 * Stack. On the CPU a thread with a stack of 48 KiB may call any function. A GPU's driver sets no bound that is known:
 * call on threads with the system's usual stack there, megabytes.
 *
 * Process. Nothing is printed, no signal handler, locale or other state of the process is changed, and none of it
 * changes a result. Threads of the library leave signals to the host's threads, but for those of faults and SIGPROF.
 * After a fork while no call runs and no job is alive, both processes may use all devices and assets on the CPU; a
 * child of a fork during a call may only exec or _exit, as POSIX has it. GPUs are not for the child. The library may be
 * unloaded when no call is running, and loaded again. Nothing of it
 * stays in memory then, unless a thread that lives on has looked for GPUs or used one (VRTM_BACKEND_AUTO looks, too).
 *
 * VERSIONS
 *
 * A program that was compiled against this header runs with this library and any later one of the same major version,
 * without being compiled anew. The major version is in the name by which the program loads the library: libvrtm.so.0,
 * libvrtm.0.dylib (a DLL has the same name in all versions: vrtm_version() tells). This holds from 0.1 on, also before
 * 1.0.
 *
 *   patch   0.1.x   declares nothing new. Results keep their bits, but where the changelog names a defect.
 *   minor   0.x     adds functions, types, constants and, at the end of structs that start with struct_size, fields;
 *                   zero in a new field means what the library did before there was one. Nothing is removed, renamed,
 *                   renumbered or gets another type. Results may differ in their bits, defaults may improve, what was
 *                   an error may be allowed, messages may have other words, and tiles that were saved by an earlier
 *                   version may be refused by vrtm_tile_load: prepare and save them again.
 *                   What stands under "Experimental" may change, be renamed or go.
 *   major   x       may change anything, and has another name to be loaded by, so that both can be installed. 1.0 will
 *                   be the next; what it leaves out is marked as obsolete in a minor version before it.
 *
 * The other way round, a program that uses what only a later library has does not start with an older one, or gets
 * VRTM_ERROR_UNSUPPORTED for a field that the older one does not have. Names with vrtm_ and VRTM_ are the library's.
 */

#ifndef VRTM_H
#define VRTM_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if !defined(VRTM_API)
#if defined(_WIN32)
#define VRTM_API __declspec(dllimport)
#else
#define VRTM_API
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ==== What a first program needs ==== */

/* ---- Version and status ---- */

// Major version of this header: functions and structs of another major version do not fit.
#define VRTM_VERSION_MAJOR 0

// Minor version of this header: a higher one adds functions and fields.
#define VRTM_VERSION_MINOR 1

// Patch version of this header.
#define VRTM_VERSION_PATCH 0

// Version of this header as one number, to compare with vrtm_version().
#define VRTM_VERSION (((VRTM_VERSION_MAJOR * 1000000) + (VRTM_VERSION_MINOR * 1000)) + VRTM_VERSION_PATCH)

// Result of a call: VRTM_OK or one of the VRTM_ERROR_ values. The values are never renumbered; later versions
// may add some, so treat any value but VRTM_OK as a failure.
typedef int32_t vrtm_status;

// The call did all of what it says.
#define VRTM_OK 0

// An argument is null, out of its range, of a wrong size, or holds a NaN or an infinity.
#define VRTM_ERROR_INVALID_ARGUMENT 1

// A handle is zero, destroyed, of another kind, or was never given out.
#define VRTM_ERROR_INVALID_HANDLE 2

// The backend, format or combination is not available in this build or on this machine.
#define VRTM_ERROR_UNSUPPORTED 3

// The memory, or the device's memory budget, does not suffice.
#define VRTM_ERROR_OUT_OF_MEMORY 4

// There is no result to read: solve first.
#define VRTM_ERROR_NOT_SOLVED 5

// Another call is using the asset; try again when it has returned.
#define VRTM_ERROR_BUSY 6

// The GPU went away: a driver reset, a crash, a removed adapter. From then on every call that uses the device or its
// assets gives this, but for those that describe or destroy them. Destroy them, and make a new device and new assets.
#define VRTM_ERROR_DEVICE_LOST 7

// A defect of the library; please report the message. The asset keeps its last good result.
#define VRTM_ERROR_INTERNAL 8

// The call or the job was cancelled; the asset keeps its last good result.
#define VRTM_ERROR_CANCELLED 9

// The job was not done in time; wait again.
#define VRTM_ERROR_TIMEOUT 10

// The version of the library that is loaded, as one number: major * 1000000 + minor * 1000 + patch. Compare it with
// VRTM_VERSION, the version of the header. Never fails.
VRTM_API
uint32_t vrtm_version(void);

// The name of a status, such as "VRTM_ERROR_BUSY"; "unknown status" for any other value. The string is static and
// not to be freed. Never fails. It is valid until the library is unloaded.
VRTM_API
const char *vrtm_status_string(vrtm_status status);

// What went wrong in the last call of this thread that failed: one UTF-8 line of at most 511 bytes with the
// function and the argument, as in "vrtm_asset_create: desc.indices is null"; "" if none has failed. A call that
// succeeds leaves it alone. The string belongs to the library and to the calling thread, and is valid until that
// thread's next failing call or its end. Never fails.
VRTM_API
const char *vrtm_last_error(void);

/* ---- Handles ---- */

// A device: where assets are solved. Made by vrtm_device_create, ended by vrtm_device_destroy. Zero is no device.
typedef struct vrtm_device {
    // Opaque.
    uint64_t id;
} vrtm_device;

// An asset: one mesh with its tiles, their maps, settings and results. Made by vrtm_asset_create, ended by
// vrtm_asset_destroy. Zero is no asset.
typedef struct vrtm_asset {
    // Opaque.
    uint64_t id;
} vrtm_asset;

// A tile: one UDIM unit square of an asset. It belongs to the asset and ends with it; there is nothing to destroy.
// Handles of the same tile are equal. Zero is no tile.
typedef struct vrtm_tile {
    // Opaque.
    uint64_t id;
} vrtm_tile;

// A job: one solve that runs beside the host's own work. Made by vrtm_asset_submit, ended by vrtm_job_destroy. Zero is
// no job.
typedef struct vrtm_job {
    // Opaque.
    uint64_t id;
} vrtm_job;

// A refinement: an asset's mesh with its triangles split, for hosts that know UV sets only. Made by
// vrtm_refinement_create, ended by vrtm_refinement_destroy. Zero is no refinement.
typedef struct vrtm_refinement {
    // Opaque.
    uint64_t id;
} vrtm_refinement;

/* ---- Arrays and images ---- */

// The number format of an array's components.
typedef int32_t vrtm_scalar;

// 32-bit float; the default.
#define VRTM_SCALAR_F32 0

// 64-bit float.
#define VRTM_SCALAR_F64 1

// The number format of an image's channels.
typedef int32_t vrtm_pixel_format;

// 32-bit float; the default.
#define VRTM_PIXEL_F32 0

// 16-bit float (IEEE half).
#define VRTM_PIXEL_F16 1

// 16-bit integer, 0..65535 for 0..1. Inputs only.
#define VRTM_PIXEL_U16 2

// 8-bit integer, 0..255 for 0..1. Inputs only.
#define VRTM_PIXEL_U8 3

// Which end of a tile the first row of an image is.
typedef int32_t vrtm_origin;

// The first row is at v = 1, as in image files; the default.
#define VRTM_ORIGIN_TOP 0

// The first row is at v = 0, as in OpenGL textures.
#define VRTM_ORIGIN_BOTTOM 1

// A host's array of vectors or numbers, such as vertex positions. Start from vrtm_array_init(). How many components
// an element has follows from the use: 3 for positions (a fourth, as in Maya's double4, is skipped by the stride), 2
// for UV pairs, 1 for single values. The data need not be aligned. It is read during the call only.
typedef struct vrtm_array {
    // sizeof(vrtm_array); set by vrtm_array_init().
    uint32_t struct_size;
    // VRTM_SCALAR_F32 (0, the default) or VRTM_SCALAR_F64.
    vrtm_scalar format;
    // The first component of the first element.
    const void *data;
    // Number of elements (not of components or bytes).
    size_t count;
    // Bytes from one element to the next; 0 = tightly packed. At least the size of an element.
    size_t stride;
} vrtm_array;

// An input image with one channel: a rigidity map or a warp mask. It covers its tile whole; texel (x, y) from the
// corner (0, 0) has its centre at u = (x + 0.5) / width, v = (y + 0.5) / height. Start from vrtm_image_init(). To
// use one channel of several, point `data` at it and set `pixel_stride`. The data is copied before the call returns.
typedef struct vrtm_image {
    // sizeof(vrtm_image); set by vrtm_image_init().
    uint32_t struct_size;
    // One of VRTM_PIXEL_: F32 (0, the default), F16, U16, U8.
    vrtm_pixel_format format;
    // Texels in u, at least 1.
    uint32_t width;
    // Texels in v, at least 1.
    uint32_t height;
    // VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    vrtm_origin origin;
    // The first texel of the first row. Need not be aligned.
    const void *data;
    // Bytes from one texel to the next; 0 = tightly packed.
    size_t pixel_stride;
    // Bytes from one row to the next; 0 = tightly packed.
    size_t row_stride;
} vrtm_image;

// An output image in the caller's memory. Start from vrtm_image_out_init(). Any size will do; the first `channels`
// channels of each texel are written, and the bytes that a stride skips are left as they are.
typedef struct vrtm_image_out {
    // sizeof(vrtm_image_out); set by vrtm_image_out_init().
    uint32_t struct_size;
    // VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16.
    vrtm_pixel_format format;
    // Texels in u, at least 1.
    uint32_t width;
    // Texels in v, at least 1.
    uint32_t height;
    // VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    vrtm_origin origin;
    // Channels to write per texel; 0 (the default) = as many as the kind of output has: two for UVs. 3 adds one that is
    // 0, and 4, for a redirection, one that is 1 where a chart covers the texel's centre and 0 elsewhere.
    uint32_t channels;
    // 1 = a redirection is one-to-one also when a renderer interpolates between its texels: values around folds of the
    // interpolated map are moved for that, by less than a texel in most maps, and by several where a warp is crumpled
    // or numbers have 16 bits (vrtm_tile_inspect_map tells the error). In f32 no map is known that is left with folds.
    // Numbers of 16 bits may be too coarse for the map's size: the values are then those without one_to_one, the log
    // warns, and vrtm_tile_inspect_map with the same settings counts the `folds`; the call succeeds. The call takes 9
    // bytes per texel and up to 11 MB more. It takes little longer than without for most maps, and up to two hundred
    // times as long for crumpled ones. A part of an image cannot have it (vrtm_tile_fetch_part). 0 (the default) =
    // every value is that of the redirection at the texel's centre. Ignored for other kinds.
    uint32_t one_to_one;
    // Where the first texel of the first row goes. Need not be aligned.
    void *data;
    // Bytes from one texel to the next; 0 = tightly packed (for two channels 8 for f32, 4 for f16).
    size_t pixel_stride;
    // Bytes from one row to the next; 0 = tightly packed.
    size_t row_stride;
} vrtm_image_out;

/* ---- Device ---- */

struct vrtm_executor;
struct vrtm_allocator;

// Where assets are solved.
typedef int32_t vrtm_backend;

// A hardware GPU if there is one, discrete before integrated, and the CPU otherwise, also if the GPU cannot be opened;
// the default. A software driver counts as no GPU. vrtm_device_info says what was chosen and why.
#define VRTM_BACKEND_AUTO 0

// The CPU.
#define VRTM_BACKEND_CPU 1

// The GPU that vrtm_device_desc.adapter names, also if it is a software driver; never falls back to the CPU.
#define VRTM_BACKEND_GPU 2

// How vrtm_device_desc names a GPU.
typedef int32_t vrtm_adapter_by;

// By its number, vrtm_device_desc.adapter; the default.
#define VRTM_ADAPTER_BY_NUMBER 0

// By its UUID, 16 bytes: VkPhysicalDeviceIDProperties::deviceUUID of the host's own VkPhysicalDevice.
#define VRTM_ADAPTER_BY_UUID 1

// By its LUID, 8 bytes: the host's DXGI_ADAPTER_DESC1::AdapterLuid, ID3D12Device::GetAdapterLuid(), or, on Windows,
// VkPhysicalDeviceIDProperties::deviceLUID. A GPU that is listed through Vulkan and through Direct3D 12 is taken
// through the one that comes first.
#define VRTM_ADAPTER_BY_LUID 2

// By its registry ID, 8 bytes: the number MTLDevice.registryID.
#define VRTM_ADAPTER_BY_REGISTRY_ID 3

// How important a log line is.
typedef int32_t vrtm_log_level;

// Something to show to the artist: clipped faces, overlapping charts.
#define VRTM_LOG_WARNING 1

// The chosen backend and device, and the reason.
#define VRTM_LOG_INFO 2

// A host's log function. It is called on the thread that called into vrtm, during that call (on one of a host's
// threads, if the device has an executor, and on a job's thread); several threads may be in it at once. `message` is
// one UTF-8 line without a line break, valid during the call. It may call vrtm functions; those that use the asset of
// the call it was called from give VRTM_ERROR_BUSY, and so does waiting for the job. It must return normally: no
// exception, no longjmp.
typedef void (*vrtm_log_fn)(void *user, vrtm_log_level level, const char *message);

// Settings of a new device. Start from vrtm_device_desc_init(); that alone is: choose the backend, all cores, no
// memory budget, no log.
typedef struct vrtm_device_desc {
    // sizeof(vrtm_device_desc); set by vrtm_device_desc_init().
    uint32_t struct_size;
    // One of VRTM_BACKEND_: AUTO (0, the default), CPU, GPU. The environment variable VRTM_DEVICE (auto, cpu, gpu, or
    // gpu:UUID with the UUID of an adapter) overrides it, for support.
    vrtm_backend backend;
    // One of VRTM_ADAPTER_BY_: NUMBER (0, the default), UUID, LUID, REGISTRY_ID. With the latter three `adapter_id`
    // takes the place of `adapter`, so that vrtm computes on the GPU that the host draws with. If `backend` is GPU
    // there must be such an adapter; AUTO takes it if it is a hardware GPU that can be used, and the CPU otherwise.
    vrtm_adapter_by adapter_by;
    // Which GPU, 0 <= adapter < vrtm_adapter_count, if `backend` is GPU and `adapter_by` is NUMBER; ignored otherwise.
    uint32_t adapter;
    // The identity of the adapter, in memory order; bytes that it does not have are zero.
    uint8_t adapter_id[16];
    // CPU threads that one solve uses, at most 1024; 0 = one per core. The result is the same bit for bit. The
    // environment variable VRTM_THREADS overrides it.
    uint32_t threads;
    // Most bytes that all assets of the device may hold together; 0 = no limit. A call that would exceed it gives
    // VRTM_ERROR_OUT_OF_MEMORY.
    uint64_t memory_budget;
    // Where messages go; null (the default) = nowhere. The function and `log_user` must stay valid until the device
    // and all of its assets are destroyed.
    vrtm_log_fn log;
    // Passed to `log` as it is.
    void *log_user;
    // The host's threads, copied; null (the default) = solves and fetches have threads of the library's own, which end
    // with the call.
    const struct vrtm_executor *executor;
    // The host's allocator; null (the default) = the system's. The struct is copied.
    const struct vrtm_allocator *allocator;
} vrtm_device_desc;

// Makes a device. `desc` may be null, which means all defaults. `*device` is the caller's to destroy.
//
// Looking for GPUs and opening one loads drivers, which takes tens of milliseconds, the first time more; an open GPU
// holds threads of its driver until the device and all of its assets are destroyed. So make one device and keep it.
// The library prints nothing, but a driver may: Mesa's writes a line to stderr where XDG_RUNTIME_DIR is not set.
//
// The environment variable VRTM_GPU_LIMITS=webgpu opens GPUs with WebGPU's default limits (bindings of 128 MiB,
// buffers of 256 MiB) and without optional features, for support.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for an unknown backend, an adapter out of range or an identity that no adapter
// has (VRTM_BACKEND_GPU; the message lists those that there are), more than 1024 threads, an allocator without a
// function, or an environment variable VRTM_DEVICE, VRTM_THREADS or VRTM_GPU_LIMITS that cannot be read;
// VRTM_ERROR_UNSUPPORTED for VRTM_BACKEND_GPU if there is no GPU or it cannot be opened, and for an allocator if the
// library was built without the feature for it; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_device_create(const vrtm_device_desc *desc,
                               vrtm_device *device);

// Ends a device's handle. Assets that were made on it keep what they need and go on working until they are
// destroyed themselves, in any order; so does the log function.
//
// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
VRTM_API vrtm_status vrtm_device_destroy(vrtm_device device);

/* ---- Asset ---- */

// By what two corners of different faces are recognised as one, so that charts go on over the edges between them.
typedef int32_t vrtm_weld;

// The same vertex, and UVs within the tolerance; the default. The host's vertices say what hangs together: what is cut
// in the modelling program is cut here, lips that are closed at rest included, and no pose changes that.
#define VRTM_WELD_INDEX 0

// Also different vertices whose rest positions lie within the tolerance (vrtm_mesh_desc.weld_position_tolerance):
// for meshes out of games, where vertices are doubled along hard edges and seams. A pose tears an edge between
// such vertices where those at either of its ends lie farther apart, along x, y or z, than ten times the
// tolerance, its rounding included, plus 8 e times the largest magnitude of their six coordinates in the pose; e
// is 2^-23 for f32 positions and 2^-52 for f64. Charts end there in this pose, the result is that of the mesh cut
// there, and the log warns.
#define VRTM_WELD_POSITION 1

// The same vertex, and exactly the same UV.
#define VRTM_WELD_OFF 2

// A further UV set of a mesh. Zero it before use. A plain value that never grows.
typedef struct vrtm_uv_set {
    // UVs as pairs (2 components). Give these, or both `u` and `v`.
    const vrtm_array *uvs;
    // u of each UV (1 component), where u and v are arrays of their own.
    const vrtm_array *u;
    // v of each UV (1 component), as many as `u`.
    const vrtm_array *v;
    // UV of each corner, as in vrtm_mesh_desc; null = one UV per corner, in the order of the corners.
    const uint32_t *uv_indices;
    // The length of `uv_indices`: the mesh's `index_count`. Ignored when that is null.
    size_t uv_index_count;
} vrtm_uv_set;

// A mesh at rest. Start from vrtm_mesh_desc_init(), which sets the tolerances. All arrays are copied before the call
// returns.
//
// A face's corners stand one after the other: corner k of the mesh has the vertex indices[k] and the UV
// uv_indices[k] (or UV k, without uv_indices). Polygons of any size will do; they are triangulated. UVs are
// face-varying, v points up, and a face belongs to the UDIM tile 1001 + floor(u) + 10 floor(v) of its UV centroid.
typedef struct vrtm_mesh_desc {
    // sizeof(vrtm_mesh_desc); set by vrtm_mesh_desc_init().
    uint32_t struct_size;
    // Rest positions, 3 components, any unit of length. Required.
    const vrtm_array *positions;
    // Corners of each face; null = all faces are triangles, unless `face_offsets` is given. Faces with fewer than 3
    // corners (points, lines) are skipped and counted; their corners keep their places in the order.
    const uint32_t *face_counts;
    // Number of faces: the length of `face_counts`. Ignored when that is null.
    size_t face_count;
    // In place of `face_counts`: the first corner of each face, and at the end `index_count`. Null = absent.
    const uint32_t *face_offsets;
    // The length of `face_offsets`: the number of faces plus 1. Ignored when that is null.
    size_t face_offset_count;
    // Vertex of each corner, less than positions->count. Required.
    const uint32_t *indices;
    // Number of corners: the length of `indices`.
    size_t index_count;
    // UVs as pairs (2 components). Give these, or both `u` and `v`.
    const vrtm_array *uvs;
    // u of each UV (1 component), where u and v are arrays of their own.
    const vrtm_array *u;
    // v of each UV (1 component), as many as `u`.
    const vrtm_array *v;
    // UV of each corner; null = one UV per corner, in the order of the corners. A face all of whose corners have
    // UINT32_MAX has no texture: it belongs to no tile, and its corners keep their places in the order.
    const uint32_t *uv_indices;
    // The length of `uv_indices`: `index_count`. Ignored when that is null.
    size_t uv_index_count;
    // Further UV sets, from set 1 on; the UVs above are set 0. Null = none. Each set has tiles of its own.
    const vrtm_uv_set *uv_sets;
    // The length of `uv_sets`. Ignored when that is null.
    size_t uv_set_count;
    // The faces that carry the texture, each less than the number of faces, in any order; null = all. The others
    // are as if they had no UVs.
    const uint32_t *textured_faces;
    // The length of `textured_faces`. Ignored when that is null.
    size_t textured_face_count;
    // Edges at which charts end in all UV sets: 2 vertices each. Null = none. A pair that is no edge of a face does
    // nothing, is counted, and the log warns.
    const uint32_t *seams;
    // The number of these edges: half the length of `seams`. Ignored when that is null.
    size_t seam_count;
    // One of VRTM_WELD_: INDEX (0, the default), POSITION, OFF.
    vrtm_weld weld;
    // The tolerance of VRTM_WELD_POSITION, the largest distance of vertices that it welds: this fraction (0..1) of the
    // longest side of the bounding box at rest; default 1e-5. Unless it is 0, a rounding is added, 2^-23 (for f64
    // positions 2^-52) times the largest magnitude of a coordinate at rest. A vertex has at most a quarter of its
    // shortest edge; one with an edge shorter than half of the tolerance is welded to vertices at equal positions
    // alone.
    double weld_position_tolerance;
    // Largest difference of welded UVs, in u and in v, 0..1; default 1/2048, half a texel of a map of 1024. Corners of
    // small triangles have less: a quarter of the least height in UV of the triangles at the vertex.
    double weld_uv_tolerance;
} vrtm_mesh_desc;

// Makes an asset from a mesh. `*asset` is the caller's to destroy; it may outlive `device`.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the array and the index, for null, an
// index out of range, a value that is not finite, counts that do not add up, a face with UVs at some corners only, a
// setting out of range or an empty mesh; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_asset_create(vrtm_device device,
                              const vrtm_mesh_desc *desc,
                              vrtm_asset *asset);

// Ends an asset and all of its tile handles. If another thread is in a call on the asset, or a job is, a solve is
// cancelled, any other call runs to its end, and the memory is freed then; this does not wait for it. With a device's
// last asset, free pages of the process's heap go back to the system (on Linux with glibc, by malloc_trim).
//
// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
VRTM_API
vrtm_status vrtm_asset_destroy(vrtm_asset asset);

// The tile with a UDIM number (1001 + U + 10 V), of UV set 0.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if the mesh has no triangle there or `tile` is
// null. Never busy.
VRTM_API
vrtm_status vrtm_asset_find_tile(vrtm_asset asset,
                                 uint32_t udim,
                                 vrtm_tile *tile);

// Sets a tile's rigidity: 0 is infinitely elastic, 1 as rigid as possible; values outside are clamped. Any size; it is
// resampled to the grid. Null takes the map away: a tile without rigidity does not move at all. The last result stays
// readable until the next solve. May be called between frames; only what depends on it is rebuilt.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field or the texel, for null data, a
// zero size, a short stride or a value that is not finite; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_tile_set_rigidity(vrtm_tile tile,
                                   const vrtm_image *rigidity);

/* ---- Frame ---- */

// How much work a solve does on each level of its grid.
typedef int32_t vrtm_quality;

// One correction on each level, and more on the finest where a chart is crowded; the default.
#define VRTM_QUALITY_NORMAL 0

// The same, but relaxation alone on the finest level: a preview.
#define VRTM_QUALITY_DRAFT 1

// More sweeps, and corrections until little is left to gain.
#define VRTM_QUALITY_HIGH 2

// How a solve finds its warp.
typedef int32_t vrtm_solver;

// Gauss-Newton corrections and relaxation, which never folds; the default.
#define VRTM_SOLVER_DESCENT 0

// The solver of the paper that the library follows: position-based dynamics on a hierarchy of grids. For comparison:
// its result is returned as it is, and may fold (the report's `folds`) or be worse than the mesh's own UVs. Where it
// folds, a texel has several places to look at and gets one of them. Nodes may leave their charts, and the tile:
// by 0.08 of its side in the worst pose tried. Redirections stay within the tile.
#define VRTM_SOLVER_PBD 1

// Settings of VRTM_SOLVER_PBD; vrtm_solve_options_init() sets the defaults. A plain value that never grows.
typedef struct vrtm_pbd_settings {
    // Iterations on each level of the grid, 1..1024; default 16. Each projects all constraints once; every fourth is
    // followed by a regularisation.
    uint32_t iterations;
    // Fraction (0..1) of its velocity that a node loses from one regularisation to the next; default 0.
    float damping;
    // Fraction (0..1) of its turn that a segment takes back after its projection; default 0.
    float orientation_preservation;
    // How much (0..1) as-rigid-as-possible material is smoothed; default 0.8.
    float smoothing;
    // Factor (0..1) on the corrections of each level over those of the next finer one; default 0.7.
    float coarse_correction;
} vrtm_pbd_settings;

// A host's function that is told how far a solve is: 0..1, by prediction, never falling. If it returns anything but 0,
// the solve is cancelled. It may call vrtm functions: results of the asset can be read, and what would change the asset
// gives VRTM_ERROR_BUSY. On a device with an executor, what it asks for is computed on its own thread alone, so that it
// never waits for threads that wait for it. It must return normally: no exception, no longjmp.
typedef uint32_t (*vrtm_progress_fn)(void *user, float progress);

// Options of one solve. Start from vrtm_solve_options_init(), which sets the defaults.
typedef struct vrtm_solve_options {
    // sizeof(vrtm_solve_options); set by vrtm_solve_options_init().
    uint32_t struct_size;
    // VRTM_QUALITY_NORMAL (0, the default), DRAFT or HIGH: of VRTM_SOLVER_DESCENT, as are the two limits below.
    vrtm_quality quality;
    // Most corrections per level, in place of the quality's own, 0..64; 0 = the quality's own.
    uint32_t max_corrections;
    // A chart is done when a correction gains less than this fraction of its energy (to which 6 % of the energy of the
    // original UVs is added), or when a level's first correction gained what its quadratic model predicted, to a
    // quarter of that fraction; 0 <= tolerance < 1; 0 = the quality's own.
    float tolerance;
    // The milliseconds that the call may take, its fetches, measuring and what follows a change of maps or settings
    // left out; 0 = no limit. The result is that of the best level of the grid that there is time for, brought up to
    // the finest one and certified: never worse than the identity, and the identity itself if there is no time for any
    // (the report is then `truncated`, with energies of 0). What work takes is predicted from the last solves: the call
    // returns within 1.2 times the budget and 5 ms, unless the machine is suddenly busier than before. On a GPU that
    // holds as far as the driver's own delays allow. With a limit the result depends on the speed of the machine.
    float time_budget_ms;
    // 0 (the default): start from the identity, so that a frame's result depends on its inputs alone. 1: start from
    // the last result, for interactive use: faster on small changes, but it depends on the order of the frames.
    uint32_t warm;
    // With `warm`, of VRTM_SOLVER_DESCENT: how strongly the warp is held to the last result, 0..1e6, in the unit
    // of the tile settings' smoothness; 0 = not at all. 0.03 to 0.3 is a useful range: at 0.1, what jumps from
    // frame to frame falls to between three quarters and a fifth, and the warp of a steady motion is one to two
    // frames late. Without `warm` it has no effect.
    float temporal_weight;
    // CPU threads of this solve, at most 1024; 0 = the device's. The result is the same bit for bit.
    uint32_t threads;
    // 1: also measure the strain on the mesh, for vrtm_tile_report. Slow.
    uint32_t measure;
    // 1: the results of the tiles that are solved are dropped before they are solved, which saves their memory: 8 bytes
    // per node of the blocks in use. They cannot be read then until the solve is done, nor if it fails. 0 (the
    // default): they can be read all the time.
    uint32_t release_last;
    // VRTM_SOLVER_DESCENT (0, the default) or PBD.
    vrtm_solver solver;
    // Settings of VRTM_SOLVER_PBD.
    vrtm_pbd_settings pbd;
    // The tiles to solve, in any order; null = all. The others keep their results.
    const vrtm_tile *tiles;
    // The length of `tiles`. Ignored when that is null.
    size_t tile_count;
    // The vertices that have moved since the last solve, in any order; null = any may have. Tiles that none of them
    // touches keep their results, unless they have none, or their maps, settings or these options have changed since.
    const uint32_t *dirty_vertices;
    // The length of `dirty_vertices`. Ignored when that is null.
    size_t dirty_vertex_count;
    // Called about 500 times per second while the tiles are solved, on the thread that does the work: the calling one,
    // unless the device has an executor, or the job's. Null = nobody is told.
    vrtm_progress_fn progress;
    // Passed to `progress` as it is. Both must stay valid until the call returns, or the job is destroyed.
    void *progress_user;
} vrtm_solve_options;

// Content of a fetched image: two channels (u, v) per texel, if not said otherwise.
typedef int32_t vrtm_fetch_kind;

// The redirection map, the default: for a surface point's UV, the UV at which to sample the texture. Absolute within
// the tile (0..1, v up), at texel centres: where nothing moves, texel (x, y) from the corner (0, 0) holds
// ((x + 0.5) / width, (y + 0.5) / height). Take f32: from 1024 texels on, f16 cannot tell neighbours apart.
#define VRTM_FETCH_REDIRECTION 0

// The same less the texel centre itself: what to add to a UV; 0 where nothing moves. Good in f16 too.
#define VRTM_FETCH_REDIRECTION_DELTA 1

// The warp, the inverse of the redirection: for a UV of the texture, the UV of the surface point that shows it,
// absolute within the tile (nodes of VRTM_SOLVER_PBD may lie a little outside of it). The first and last texels of
// a row or column lie on the tile's border; with the grid's size plus one in both directions the texels are the
// grid's nodes. Between the nodes the warp is affine on two triangles per cell, split by the diagonal from the
// cell's corner of least u and v to that of greatest: all outputs of a result agree on that, so that at any size
// the warp of a redirected UV is that UV. Take f32.
#define VRTM_FETCH_WARP 2

// The redirection plus the offset of the tile (U, V) among the UDIM tiles: UVs as those of the mesh, to be looked up in
// all tiles of a texture. Take f32.
#define VRTM_FETCH_REDIRECTION_UDIM 3

// Derivatives of the redirection (u', v') by the UV at texel centres, four channels: du'/du, du'/dv, dv'/du, dv'/dv; 1,
// 0, 0, 1 where nothing moves. What turns with a feature, as a tangent-space normal does, turns with it. Good in f16.
#define VRTM_FETCH_JACOBIAN 4

// One channel: the largest singular value of that. A lookup's footprint is at most so many times wider in the texture
// than on the surface: for renderers that filter by a width which they take from the mesh's own UVs. Good in f16.
#define VRTM_FETCH_FILTER_SCALE 5

// One output of vrtm_asset_redirect. Start from vrtm_fetch_init().
typedef struct vrtm_fetch {
    // sizeof(vrtm_fetch); set by vrtm_fetch_init(). The same in all elements of an array.
    uint32_t struct_size;
    // One of VRTM_FETCH_: REDIRECTION (0, the default), REDIRECTION_DELTA, WARP, REDIRECTION_UDIM, JACOBIAN,
    // FILTER_SCALE.
    vrtm_fetch_kind kind;
    // A tile of the asset. Required.
    vrtm_tile tile;
    // Where to write. Required.
    const vrtm_image_out *image;
} vrtm_fetch;

// Solves every tile for a pose and writes `count` outputs, in one call: what a host's compute() needs for a frame. As
// vrtm_asset_solve followed by a vrtm_tile_fetch for each of `fetches`, except that all arguments are checked before
// any work, and nothing else can use the asset in between. `fetches` may be null if `count` is 0. No two images may
// write the same byte, but they may lie between each other's texels, as two pairs of channels of one image do. None may
// overlap the memory that the positions span.
//
// Errors: those of vrtm_asset_solve and vrtm_tile_fetch; VRTM_ERROR_INVALID_ARGUMENT for a tile of another asset and
// for images that overlap. On an error no image is written, unless a GPU fails while the images are written.
VRTM_API
vrtm_status vrtm_asset_redirect(vrtm_asset asset,
                                const vrtm_array *positions,
                                const vrtm_solve_options *options,
                                const vrtm_fetch *fetches,
                                size_t count);

// Solves every tile for a pose; returns when that is done. `positions` are the deformed positions of all vertices (3
// components, as many and in the same order as at rest). `options` may be null: all defaults. On any error the last
// good result stays readable.
//
// The result is the same bit for bit for any number of threads, on any machine and in any floating-point mode, unless
// options->warm or options->time_budget_ms is set. Charts whose inputs have not changed keep their result at no
// cost, unless this solve or the last one is warm.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field or the vertex, for null, a wrong
// count, a short stride, a position that is not finite or an option out of range; VRTM_ERROR_CANCELLED;
// VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_asset_solve(vrtm_asset asset,
                             const vrtm_array *positions,
                             const vrtm_solve_options *options);

// Writes one output of the last solve into the caller's memory. Any size; the result does not depend on other fetches.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_UNSUPPORTED for an
// integer format; VRTM_ERROR_INVALID_ARGUMENT, naming the field, for null, a zero size, a short stride, channels that
// the kind does not have or an unknown value; VRTM_ERROR_OUT_OF_MEMORY. On any error the image is not written. Never
// busy.
VRTM_API
vrtm_status vrtm_tile_fetch(vrtm_tile tile,
                            vrtm_fetch_kind kind,
                            const vrtm_image_out *image);

// Writes the redirected UV of every face corner of the mesh in UV set 0: `count` pairs (u, v), in corner order, with
// the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. For hosts that set UVs
// instead of reading a map. `count` is the number of corners, vrtm_asset_data.corners; `uvs` has room for 2 * count
// floats.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT if `uvs`
// is null or `count` is not the number of corners. On any error nothing is written. Never busy. In tiles that have not
// been solved yet, the UVs are the mesh's own.
VRTM_API
vrtm_status vrtm_asset_fetch_corner_uvs(vrtm_asset asset,
                                        float *uvs,
                                        size_t count);

/* ==== Advanced ==== */

/* ---- Device ---- */

// Description of a device. Start from vrtm_device_data_init().
typedef struct vrtm_device_data {
    // sizeof(vrtm_device_data); set by vrtm_device_data_init().
    uint32_t struct_size;
    // The backend in use: VRTM_BACKEND_CPU or VRTM_BACKEND_GPU.
    vrtm_backend backend;
    // The processor's or adapter's name, UTF-8.
    char name[128];
    // Why this backend was chosen, in a sentence, UTF-8; if the GPU went away, it starts with how.
    char reason[256];
    // CPU threads per solve.
    uint32_t threads;
    // Bytes that all assets of the device hold now.
    uint64_t bytes_held;
} vrtm_device_data;

// A GPU that a device can be made on. Start from vrtm_adapter_data_init().
typedef struct vrtm_adapter_data {
    // sizeof(vrtm_adapter_data); set by vrtm_adapter_data_init().
    uint32_t struct_size;
    // 1 for an adapter that is emulated on the CPU (or does not say that it is hardware): VRTM_BACKEND_AUTO never
    // takes it. 0 otherwise.
    uint32_t software;
    // The adapter's name, UTF-8.
    char name[128];
    // The driver's name and version, UTF-8.
    char driver[128];
    // The graphics interface it is driven through: "Vulkan", "Direct3D 12" or "Metal".
    char api[16];
    // PCI vendor; 0 where the interface does not tell.
    uint32_t vendor;
    // PCI device of that vendor; 0 where the interface does not tell.
    uint32_t device;
    // Place on the PCI bus, domain:bus:device.function, hexadecimal; empty where the interface does not tell.
    char pci_bus[32];
    // 1 if `uuid` and `driver_uuid` are known: through Vulkan. 0 otherwise.
    uint32_t has_uuid;
    // VkPhysicalDeviceIDProperties::deviceUUID: the same for this GPU in all programs.
    uint8_t uuid[16];
    // VkPhysicalDeviceIDProperties::driverUUID: a host's memory can be imported (vrtm_tile_fetch_external) where
    // both UUIDs are those of its own device.
    uint8_t driver_uuid[16];
    // 1 if `luid` is known: on Windows. 0 otherwise.
    uint32_t has_luid;
    // The LUID of Direct3D and DXGI, in memory order.
    uint8_t luid[8];
    // The number MTLDevice.registryID, in memory order; all bytes are 0 if the GPU is not driven through Metal.
    uint8_t registry_id[8];
} vrtm_adapter_data;

// Describes a device: its backend, why it was chosen, and how much memory its assets hold. Works after a lost GPU,
// too.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size.
VRTM_API
vrtm_status vrtm_device_info(vrtm_device device,
                             vrtm_device_data *info);

// Number of GPUs that a device can be made on: those that run compute shaders with at least WebGPU's default limits,
// through Vulkan, Direct3D 12 or Metal. Hardware stands before software, discrete before integrated; the order stays
// while the machine and its drivers do. 0 without a GPU or a driver. Each call loads the drivers, which takes tens of
// milliseconds.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT if `count` is null.
VRTM_API
vrtm_status vrtm_adapter_count(uint32_t *count);

// Describes adapter `index`, 0 <= index < vrtm_adapter_count. It takes as long as vrtm_adapter_count.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for an index out of range, or if `info` is null or has a wrong struct_size.
VRTM_API
vrtm_status vrtm_adapter_info(uint32_t index,
                              vrtm_adapter_data *info);

/* ---- Threads of the host ---- */

// One of the library's tasks, which a host runs by calling it with the `data` that it got along with it.
typedef void (*vrtm_task_fn)(void *data, size_t index);

// A host's parallel loop, such as TBB's parallel_for: it calls `task(data, index)` for each index from 0 to `count` -
// 1, once, on any threads and in any order, side by side or one after the other, and returns when all of these calls
// have returned. It may be called by several threads at once. The first task to begin does the work of the call, and
// the others help it: so it is well for the calling thread to run tasks, too, and no harm if no other does. It must
// return normally: no exception, no longjmp.
typedef void (*vrtm_parallel_for_fn)(void *user, size_t count, vrtm_task_fn task, void *data);

// A host's task queue: it calls `task(data, 0)` once, on any thread, at any time, now or later. It must return
// normally.
typedef void (*vrtm_spawn_fn)(void *user, vrtm_task_fn task, void *data);

// A host's threads, on which all work is done in place of the library's own threads, with the same bits. Start from
// vrtm_executor_init(). The functions and `user` must stay valid until the device, all of its assets and all of their
// jobs are destroyed.
typedef struct vrtm_executor {
    // sizeof(vrtm_executor); set by vrtm_executor_init().
    uint32_t struct_size;
    // Runs the parallel loops of solves and fetches; `count` is the number of threads that the device or the solve asks
    // for. Required.
    vrtm_parallel_for_fn parallel_for;
    // Runs jobs; null = each job has a thread of the library's own.
    vrtm_spawn_fn spawn;
    // Passed to both as it is.
    void *user;
} vrtm_executor;

/* ---- Asset ---- */

// Description of a mesh. Start from vrtm_asset_data_init().
typedef struct vrtm_asset_data {
    // sizeof(vrtm_asset_data); set by vrtm_asset_data_init().
    uint32_t struct_size;
    // UV sets, 1 or more.
    uint32_t uv_sets;
    // Tiles with at least one triangle.
    uint32_t tiles;
    // Charts, over all tiles.
    uint32_t charts;
    // Vertices: the length of every array of positions.
    uint64_t vertices;
    // Faces as given.
    uint64_t faces;
    // Corners as given: the length of an array of corner UVs.
    uint64_t corners;
    // Triangles kept, over all tiles.
    uint64_t triangles;
    // Faces without texture: without UVs, or not among the textured faces. This and the counts of UVs above are over
    // all UV sets.
    uint64_t faces_untextured;
    // Faces skipped because they have fewer than 3 corners.
    uint64_t faces_skipped;
    // Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    uint64_t faces_outside;
    // Faces some of whose UVs lie outside of their tile; the map is clipped to the tile.
    uint64_t clipped_faces;
    // Triangles dropped because their UVs have no area.
    uint64_t degenerate_triangles;
    // Sides of triangles at which a chart ends.
    uint64_t border_edges;
    // Edges inside charts whose two sides have different vertices: welded by position.
    uint64_t welded_edges;
    // Edges whose two sides have the same positions and UVs, up to the tolerances, and are not connected: charts end
    // there. They are cuts; or the mesh wants VRTM_WELD_POSITION; or the noise of its UVs is large against its
    // triangles.
    uint64_t edges_apart;
    // Seams that are no edge of a face.
    uint64_t seams_unused;
} vrtm_asset_data;

// Describes the mesh. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size.
VRTM_API
vrtm_status vrtm_asset_info(vrtm_asset asset,
                            vrtm_asset_data *info);

// Number of tiles that hold at least one triangle. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `count` is null.
VRTM_API vrtm_status vrtm_asset_tile_count(vrtm_asset asset, uint32_t *count);

// The tile at `index`, 0 <= index < vrtm_asset_tile_count, first those of UV set 0 in the order
// of their UDIM numbers, then those of set 1, and so on. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT for an index out of range or if `tile` is null.
VRTM_API
vrtm_status vrtm_asset_tile(vrtm_asset asset,
                            uint32_t index,
                            vrtm_tile *tile);

// The tile with a UDIM number, of a UV set: 0 <= uv_set < vrtm_asset_data.uv_sets.
//
// Errors: those of vrtm_asset_find_tile.
VRTM_API
vrtm_status vrtm_asset_find_tile_of_set(vrtm_asset asset,
                                        uint32_t uv_set,
                                        uint32_t udim,
                                        vrtm_tile *tile);

/* ---- Tile ---- */

// Facts of a tile that need no solve. Start from vrtm_tile_data_init().
typedef struct vrtm_tile_data {
    // sizeof(vrtm_tile_data); set by vrtm_tile_data_init().
    uint32_t struct_size;
    // UDIM number: 1001 + U + 10 V.
    uint32_t udim;
    // The UV set that it belongs to.
    uint32_t uv_set;
    // Charts in the tile: connected pieces of UV triangles.
    uint32_t charts;
    // Triangles in the tile.
    uint64_t triangles;
    // Sides of triangles at which a chart ends.
    uint64_t border_edges;
    // Edges inside charts whose two sides have different vertices: welded by position.
    uint64_t welded_edges;
    // Edges whose two sides lie together and are not connected: see vrtm_asset_data.
    uint64_t edges_apart;
    // Cells of the grid in u. A grid of w x h cells has (w + 1) x (h + 1) nodes.
    uint32_t grid_width;
    // Cells of the grid in v.
    uint32_t grid_height;
    // Nodes of the grid that may move.
    uint64_t movable_nodes;
    // Fraction (0..1) of the covered nodes that more than one layer of triangles covers.
    float overlap;
    // Fraction (0..1) of the rigid texels that do not move: of the nodes under a triangle with a rigidity of at least
    // 0.5, those that a border, an overlap or the mask fixes. Near 1, a map can have no effect.
    float frozen;
} vrtm_tile_data;

// Who owns texels that faces of different charts, or two layers of one chart, share.
typedef int32_t vrtm_overlap;

// They do not move, so that nothing gets worse; the default.
#define VRTM_OVERLAP_FIXED 0

// The chart with the first face owns them: for mirrored halves that deform alike.
#define VRTM_OVERLAP_FIRST_FACE 1

// A tile's settings. Start from vrtm_tile_settings_init(), which sets the defaults.
typedef struct vrtm_tile_settings {
    // sizeof(vrtm_tile_settings); set by vrtm_tile_settings_init().
    uint32_t struct_size;
    // Cells of the grid in u: the resolution of the solve. 0 = the rigidity map's width, or 1024 without a
    // map. Rounded up to a multiple of 16, at most 16384.
    uint32_t grid_width;
    // Cells of the grid in v, likewise.
    uint32_t grid_height;
    // VRTM_OVERLAP_FIXED (0, the default) or VRTM_OVERLAP_FIRST_FACE.
    vrtm_overlap overlap;
    // Smoothness of elastic material against the stiffness 1 of rigid material, 0 to 1e6; default 0.02. A lower one
    // lets rigid features keep their shape better and makes material of little rigidity more rigid.
    float smoothness;
    // Smoothness of all material, 1e-6 to 1e6; default 0.0005.
    float smoothness_floor;
    // Weight that keeps rigid features from turning, 0 (the default) to 1e6.
    float orientation;
    // Addition to `orientation` where rigid features are dense, times that density (the mean rigidity, 0..1, over
    // a tent of half of the tile), 0 (the default) to 1e6. Sparse features then turn to keep their shape, dense ones
    // stay in order. For VRTM_SOLVER_PBD it is added to the fraction that a segment turns back.
    float orientation_density;
    // Weight of the penalty on cells that lose their area, 0 to 1e6; default 0.3.
    float room;
    // Fraction of a cell's area, 0 to 1, under which that penalty starts; default 0.4.
    float room_threshold;
} vrtm_tile_settings;

// UDIM number (1001 + U + 10 V) and UV set of a tile. `uv_set` may be null. Unlike vrtm_tile_info it prepares
// nothing. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `udim` is null.
VRTM_API vrtm_status vrtm_tile_udim(vrtm_tile tile, uint32_t *udim, uint32_t *uv_set);

// Describes a tile. The first call, and the first after a change of map or settings, builds the tile's
// grid, which takes time.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size;
// VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_tile_info(vrtm_tile tile,
                           vrtm_tile_data *info);

// Takes a part of a tile's rigidity map anew, after a stroke of a brush for instance: `width` x `height` texels from
// the column `x` and the row `y`, as they lie in memory. `rigidity` describes the whole map, with the size and the
// format of the one that was set; its other texels are not read. A small part takes a small fraction of the time that
// setting the map takes, unless a chart gets its first rigidity or loses its last, or orientation_density is in use:
// then the tile is prepared anew.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if there is no map of this size and format, if the
// part is empty or not inside of it, and as vrtm_tile_set_rigidity; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_tile_update_rigidity(vrtm_tile tile,
                                      const vrtm_image *rigidity,
                                      uint32_t x,
                                      uint32_t y,
                                      uint32_t width,
                                      uint32_t height);

// Sets a tile's warp mask: what lies under a texel of less than 0.5 does not move. Null: all may move, the default.
// Otherwise as vrtm_tile_set_rigidity.
//
// Errors: those of vrtm_tile_set_rigidity.
VRTM_API
vrtm_status vrtm_tile_set_mask(vrtm_tile tile,
                               const vrtm_image *mask);

// Sets the rigidity of all tiles from one value per vertex (1 component, as many as vertices, 0..1), linear over each
// triangle. Null takes it away. A tile's grid then has the size in its settings, or 1024 x 1024.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT for null data, a wrong count, a short stride or a
// value that is not finite; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_asset_set_vertex_rigidity(vrtm_asset asset,
                                           const vrtm_array *rigidity);

// Sets the warp mask of all tiles from one value per vertex (1 component, as many as vertices), linear over each
// triangle: what is under 0.5 does not move. Null: all may move, the default.
//
// Errors: those of vrtm_asset_set_vertex_rigidity.
VRTM_API
vrtm_status vrtm_asset_set_vertex_mask(vrtm_asset asset,
                                       const vrtm_array *mask);

// Sets a tile's settings. Null: all defaults.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field; VRTM_ERROR_BUSY.
VRTM_API vrtm_status vrtm_tile_set_settings(vrtm_tile tile, const vrtm_tile_settings *settings);

// A tile's settings: what was set, or the defaults. What comes out can be passed to vrtm_tile_set_settings as it is.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `settings` is null or has a wrong struct_size;
// VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_get_settings(vrtm_tile tile,
                                   vrtm_tile_settings *settings);

// Freezes a tile (1) or lets it go (0): solves leave a frozen tile alone, so that it keeps its result, or stays without
// one.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `frozen` is neither 0 nor 1; VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_freeze(vrtm_tile tile,
                             uint32_t frozen);

// What a tile takes, before any of it is taken. Start from vrtm_tile_needs_init().
typedef struct vrtm_tile_needs {
    // sizeof(vrtm_tile_needs); set by vrtm_tile_needs_init().
    uint32_t struct_size;
    // Nodes of the grid that may move: time and memory follow their number.
    uint64_t movable_nodes;
    // Bytes held once the tile is prepared: maps and grid.
    uint64_t prepared_bytes;
    // Bytes at the peak of preparing it.
    uint64_t preparing_bytes;
    // Bytes at the peak of a solve with VRTM_SOLVER_DESCENT. With a GPU this counts its memory and the host's.
    uint64_t solving_bytes;
} vrtm_tile_needs;

// Estimates, to about a tenth, what preparing and solving a tile would take with its present maps and settings. This
// takes a small part of the time and memory of preparing the tile, and keeps nothing. A device's memory_budget is
// checked in the same way before a tile is prepared.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `needs` is null or has a wrong struct_size;
// VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_tile_estimate(vrtm_tile tile,
                               vrtm_tile_needs *needs);

// Writes a prepared tile to the host's memory, for vrtm_tile_load on another machine or in a later session. Prepares
// the tile if need be. `size` gets the number of bytes that it takes: call once with `data` null and `capacity` 0 to
// learn it, then with as much memory. The bytes hold what follows from mesh, maps and settings, not these themselves.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `size` is null, or if `data` is neither null nor
// large enough; VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY. On any error nothing is written.
VRTM_API
vrtm_status vrtm_tile_save(vrtm_tile tile,
                           void *data,
                           size_t capacity,
                           size_t *size);

// Takes a tile that was prepared elsewhere, so that it need not be prepared here. Mesh, maps and settings have to be
// those that it was saved with; they are compared, and set before this call. `size` is the number of bytes. They may
// come from anywhere: what is not a saved tile, or was damaged, is refused. The checksum is no signature: bytes that
// somebody has changed, and the checksum with them, may be taken, and at worst lead to another warp, which is certified
// as any other. They never lead to a crash.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT for null, for bytes that are damaged or of another
// version of the format, or that were saved with another mesh, map or setting; VRTM_ERROR_BUSY;
// VRTM_ERROR_OUT_OF_MEMORY. On any error the tile is as before.
VRTM_API
vrtm_status vrtm_tile_load(vrtm_tile tile,
                           const void *data,
                           size_t size);

/* ---- Results ---- */

// Writes a part of one output of the last solve, for images that are too large to be held at once: of an image of
// `width` x `height` texels, those from the column `x` and the row `y` that `image` has room for. Rows are counted in
// the order of image->origin. On the CPU the parts are, bit by bit, those of the whole image. A redirection that is
// one_to_one depends on the whole map, and cannot be had in parts: fetch it whole.
//
// Errors: those of vrtm_tile_fetch; VRTM_ERROR_INVALID_ARGUMENT if the part is not inside of the whole;
// VRTM_ERROR_UNSUPPORTED for a redirection with image->one_to_one, unless the part is the whole.
VRTM_API
vrtm_status vrtm_tile_fetch_part(vrtm_tile tile,
                                 vrtm_fetch_kind kind,
                                 const vrtm_image_out *image,
                                 uint32_t x,
                                 uint32_t y,
                                 uint32_t width,
                                 uint32_t height);

// The same of a UV set: 0 <= uv_set < vrtm_asset_data.uv_sets.
//
// Errors: those of vrtm_asset_fetch_corner_uvs; VRTM_ERROR_INVALID_ARGUMENT if there is no such set.
VRTM_API
vrtm_status vrtm_asset_fetch_corner_uvs_of_set(vrtm_asset asset,
                                               uint32_t uv_set,
                                               float *uvs,
                                               size_t count);

// A redirection map that may be fetched. Start from vrtm_map_desc_init().
typedef struct vrtm_map_desc {
    // sizeof(vrtm_map_desc); set by vrtm_map_desc_init().
    uint32_t struct_size;
    // VRTM_FETCH_REDIRECTION (0, the default), REDIRECTION_DELTA or REDIRECTION_UDIM.
    vrtm_fetch_kind kind;
    // VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16.
    vrtm_pixel_format format;
    // Texels in u, 1 to 16384.
    uint32_t width;
    // Texels in v, 1 to 16384.
    uint32_t height;
    // As vrtm_image_out.one_to_one.
    uint32_t one_to_one;
} vrtm_map_desc;

// What a redirection map gives when it is read with bilinear interpolation. Errors are lengths in UV: times the size of
// a texture they are texels of it. Start from vrtm_map_data_init().
typedef struct vrtm_map_data {
    // sizeof(vrtm_map_data); set by vrtm_map_data_init().
    uint32_t struct_size;
    // Quads of four neighbouring texel centres on which the interpolated map is not one-to-one, in the numbers that a
    // fetch writes: 0 certifies that it is everywhere between the centres of the tile's outermost texels. More than 0
    // for a map with one_to_one: its numbers are too coarse for its size, and nothing was moved.
    uint64_t folds;
    // Smallest Jacobian of the interpolated map at a corner of a quad (1 where nothing moves).
    double min_jacobian;
    // Root of the mean square error over the tile's charts, against the redirection itself.
    double error_rms;
    // 99th percentile of the error over the charts, rounded up by at most one percent.
    double error_p99;
    // Largest error in the charts.
    double error_max;
    // A size at which the map has no folds: this one, or else the first of twice and four times it, a half, a quarter
    // and so on of it; 0 if there is none. Larger maps often have more folds; one_to_one leaves none at any size if
    // the numbers are fine enough: f32, or f16 of the delta unless what moves far is squeezed.
    uint32_t sufficient_width;
    // The same in v.
    uint32_t sufficient_height;
} vrtm_map_data;

// Looks at the map that a vrtm_tile_fetch of this kind, size and format would write of the last result. A warp without
// folds has an inverse without folds, but a map holds that at texel centres only, and what a renderer interpolates
// between them may fold where the warp squeezes. This tells whether it does, how far it is from the redirection, and
// which size suffices. It takes about as long as fetching the map and one of twice its or the grid's size, and more if
// it has to look for another size. A map with one_to_one is counted as it is written. Others are computed on the CPU:
// where a GPU writes them, single quads that all but fold may count otherwise.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_UNSUPPORTED for an
// integer format; VRTM_ERROR_INVALID_ARGUMENT, naming the field, for null, a kind that is no redirection, or a size
// out of range; VRTM_ERROR_OUT_OF_MEMORY. On any error nothing is written. Never busy.
VRTM_API
vrtm_status vrtm_tile_inspect_map(vrtm_tile tile,
                                  const vrtm_map_desc *desc,
                                  vrtm_map_data *data);

/* ---- Solve ---- */

// Cancels the solve of an asset that is under way, be it another thread's call or a job: it gives VRTM_ERROR_CANCELLED
// soon after, and the last good result stays. One that has its result already is not cancelled any more. Without a
// solve it does nothing. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE.
VRTM_API
vrtm_status vrtm_asset_cancel(vrtm_asset asset);

/* ---- Jobs ---- */

// For vrtm_job_wait: as long as it takes.
#define VRTM_FOREVER UINT32_MAX

// What a job is doing.
typedef int32_t vrtm_job_state;

// It has not begun, or is under way.
#define VRTM_JOB_RUNNING 0

// It is over: vrtm_job_data.status says how it ended.
#define VRTM_JOB_DONE 1

// How far a job is. Start from vrtm_job_data_init().
typedef struct vrtm_job_data {
    // sizeof(vrtm_job_data); set by vrtm_job_data_init().
    uint32_t struct_size;
    // VRTM_JOB_RUNNING (0) or VRTM_JOB_DONE.
    vrtm_job_state state;
    // How it ended: VRTM_OK or an error; VRTM_OK while it is running.
    vrtm_status status;
    // The fraction (0..1) that is done, by prediction. It never falls.
    float progress;
    // Milliseconds since it was submitted, until it was done.
    float ms;
} vrtm_job_data;

// Begins to solve an asset for a pose, and returns at once: the host may go on drawing. Positions and options are
// copied; otherwise all is as with vrtm_asset_solve. `*job` is the caller's to destroy.
//
// Until the job is done, it has the asset for itself: calls that solve or change it give VRTM_ERROR_BUSY, and results
// and reports are those of the last solve. A job keeps what it needs alive: destroying the asset cancels it, destroying
// the device does nothing to it. It runs on a thread of its own, which ends with the job, or in the host's queue, if
// the device has an executor with `spawn`.
//
// Errors: those of vrtm_asset_solve, but for what only comes up while solving, which vrtm_job_wait tells of;
// VRTM_ERROR_INVALID_ARGUMENT if `job` is null; VRTM_ERROR_OUT_OF_MEMORY, also if no thread can be started.
VRTM_API
vrtm_status vrtm_asset_submit(vrtm_asset asset,
                              const vrtm_array *positions,
                              const vrtm_solve_options *options,
                              vrtm_job *job);

// Waits until a job is done, for at most so many milliseconds; 0 only looks, VRTM_FOREVER waits as long as it takes.
// Any number of threads may wait, and each may wait again afterwards.
//
// A job that no thread has begun by then is done by the first thread that waits for it as long as it takes.
//
// Returns what vrtm_asset_solve would have returned, with its message: VRTM_OK once the result can be read;
// VRTM_ERROR_CANCELLED after a cancel; VRTM_ERROR_TIMEOUT if the job is not done yet. Errors:
// VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_BUSY on a thread that does the job's work, as in its own progress function.
VRTM_API
vrtm_status vrtm_job_wait(vrtm_job job,
                          uint32_t timeout_ms);

// How far a job is. Never waits.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `data` is null or has a wrong struct_size.
VRTM_API
vrtm_status vrtm_job_progress(vrtm_job job,
                              vrtm_job_data *data);

// Cancels a job: it ends soon after with VRTM_ERROR_CANCELLED, and the asset keeps its last good result. One that has
// its result already ends as it would have. Never waits.
//
// Errors: VRTM_ERROR_INVALID_HANDLE.
VRTM_API
vrtm_status vrtm_job_cancel(vrtm_job job);

// Ends a job's handle. A job that is not done is cancelled, and this waits for its end, and for that of its thread:
// after it nothing of the job is left. Destroy all jobs before the library is unloaded.
//
// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before; VRTM_ERROR_BUSY on a thread that does the job's
// work, as in its own progress function.
VRTM_API
vrtm_status vrtm_job_destroy(vrtm_job job);

/* ---- Reports ---- */

// One distribution of strain: deformed length over rest length, minus 1, of segments that are fixed in the texture. A
// plain value that never grows.
typedef struct vrtm_strain {
    // Root of the mean square.
    float rms;
    // Median of the magnitudes.
    float median;
    // 95th percentile of the magnitudes.
    float p95;
    // 99th percentile of the magnitudes.
    float p99;
    // Largest magnitude.
    float max;
    // RMS over segments within 10 cells of a chart's border, which cannot move.
    float border_rms;
    // RMS over the other segments.
    float interior_rms;
} vrtm_strain;

// A tile's last solve. Start from vrtm_tile_report_data_init().
typedef struct vrtm_tile_report_data {
    // sizeof(vrtm_tile_report_data); set by vrtm_tile_report_data_init().
    uint32_t struct_size;
    // UDIM number: 1001 + U + 10 V.
    uint32_t udim;
    // Cells of the grid in u.
    uint32_t grid_width;
    // Cells of the grid in v.
    uint32_t grid_height;
    // Energy of the identity, summed over the charts that were solved or reused; 0, as that of the result, where a time
    // budget left no time to compute it.
    double energy_before;
    // Energy of the result.
    double energy;
    // Smallest corner Jacobian of the result (1 at rest), found in double precision (on a GPU in single precision,
    // less a bound of the rounding: never more than the true one): greater than 0 certifies that the warp is
    // one-to-one and onto.
    double min_jacobian;
    // Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    uint64_t folds;
    // Length of the longest displacement, in cells.
    float max_displacement;
    // 1 if the time budget ended the solve early.
    uint32_t truncated;
    // 1 if the asset's last solve left the tile alone: it was frozen, not asked for, or touched by no dirty vertex. The
    // other fields are then of the tile's own last solve.
    uint32_t kept;
    // Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    uint32_t welds_torn;
    // Charts in the tile.
    uint32_t charts;
    // Charts solved in this call.
    uint32_t charts_active;
    // Charts that kept their last result because none of their inputs changed.
    uint32_t charts_reused;
    // Charts that are the identity: nothing rigid, nothing movable, or deformed without any strain.
    uint32_t charts_identity;
    // Charts that fell back to the identity because nothing better was found.
    uint32_t charts_fallback;
    // Levels of the grid.
    uint32_t levels;
    // Blocks of 16 x 16 nodes that were visited on the finest level.
    uint64_t blocks_active;
    // Blocks of the whole tile.
    uint64_t blocks;
    // Movable nodes of the solved charts on the finest level.
    uint64_t nodes_active;
    // Relaxation sweeps, or iterations of VRTM_SOLVER_PBD, over all levels.
    uint32_t sweeps;
    // Corrections, over all levels.
    uint32_t corrections;
    // Node updates by these, over all levels.
    uint64_t node_updates;
    // Bytes held for this tile: maps, state, result.
    uint64_t bytes;
    // Milliseconds: positions to triangles and their metrics. The stages' times are taken on the device; on a GPU
    // without timestamps they are 0, and only the total is told.
    float ms_surface;
    // Milliseconds: maps to grids; 0 unless a map or a setting changed.
    float ms_maps;
    // Milliseconds: pose metrics to all levels.
    float ms_pyramid;
    // Milliseconds: displacements to the next finer level.
    float ms_prolong;
    // Milliseconds: relaxation, node by node.
    float ms_relax;
    // Milliseconds: Gauss-Newton corrections.
    float ms_correct;
    // Milliseconds: iterations of VRTM_SOLVER_PBD.
    float ms_pbd;
    // Milliseconds: the certificate.
    float ms_certify;
    // Milliseconds: the latest inversion; not part of the total.
    float ms_invert;
    // Milliseconds: the whole solve of this tile, less measuring.
    float ms_total;
    // 1 if the solve was asked to measure: the fields below are set, and 0 otherwise. They speak of the segments
    // between neighbouring nodes whose rigidity is over 0.5 at both ends: `strain_fixed` and `edges_fixed` of those
    // that a border, an overlap or the mask fixes at both ends, and all others of the rest.
    uint32_t measured;
    // Strain with the mesh's own UVs.
    vrtm_strain before;
    // Strain with the warp.
    vrtm_strain after;
    // Fraction (0..1) of the segments whose strain rose by more than 0.25.
    float harm;
    // Fraction of the segments whose strain fell by more than 0.10.
    float help;
    // RMS strain of the segments that are fixed at both ends: the same with the warp and without. The RMS strain of all
    // rigid segments is the root of (edges * rms^2 + edges_fixed * strain_fixed^2) / (edges + edges_fixed), with
    // before.rms or after.rms.
    float strain_fixed;
    // Segments that are not fixed at both ends.
    uint64_t edges;
    // Segments that are fixed at both ends.
    uint64_t edges_fixed;
} vrtm_tile_report_data;

// An asset's last solve, over all tiles. Start from vrtm_asset_report_data_init().
typedef struct vrtm_asset_report_data {
    // sizeof(vrtm_asset_report_data); set by vrtm_asset_report_data_init().
    uint32_t struct_size;
    // Tiles in the asset.
    uint32_t tiles;
    // Tiles with at least one chart solved in the last call.
    uint32_t tiles_active;
    // Tiles that the last call left alone: frozen, not asked for, or touched by no dirty vertex. Their charts count as
    // reused.
    uint32_t tiles_kept;
    // Charts solved.
    uint32_t charts_active;
    // Charts that kept their last result because none of their inputs changed.
    uint32_t charts_reused;
    // Charts that are the identity.
    uint32_t charts_identity;
    // Movable nodes of the solved charts.
    uint64_t nodes_active;
    // Smallest corner Jacobian over all tiles: greater than 0 certifies that no warp folds.
    double min_jacobian;
    // Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    uint64_t folds;
    // Bytes held for the asset.
    uint64_t bytes;
    // Milliseconds of the last solve by the clock, less measuring.
    float ms_total;
    // 1 if the time budget ended a tile's solve early.
    uint32_t truncated;
    // The median, over some thousand edges of the last pose, of their length as a multiple of that at rest. Over 3 or
    // under 1/3, which the log warns of, the pose is most likely in other units, or its vertices in another order.
    float median_stretch;
    // The share of these edges, 0..1, that are more than 3 times as long as at rest. Over 0.05, which the log warns
    // of, the pose's vertices are most likely in another order than the mesh's.
    float stretched_share;
} vrtm_asset_report_data;

// Reports on a tile's last solve.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT if
// `report` is null or has a wrong struct_size. Never busy.
VRTM_API
vrtm_status vrtm_tile_report(vrtm_tile tile,
                             vrtm_tile_report_data *report);

// Reports on an asset's last solve, over all tiles.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT if
// `report` is null or has a wrong struct_size. Never busy.
VRTM_API
vrtm_status vrtm_asset_report(vrtm_asset asset,
                              vrtm_asset_report_data *report);

/* ==== Experimental: may change in a minor version ==== */

/* ---- Memory of the host ---- */

// A host's function that allocates: `size` bytes (at least 4096) at a multiple of `alignment` (a power of two, at
// least 16), or null if there is no memory. The bytes need not be zero.
typedef void *(*vrtm_alloc_fn)(void *user, size_t size, size_t alignment);

// A host's function that takes memory back, with the size and the alignment that it was asked for with. Never called
// with null.
typedef void (*vrtm_free_fn)(void *user, void *pointer, size_t size, size_t alignment);

// A host's allocator, for all memory of a device whose size follows from input: meshes, maps, grids, results, a
// solve's arrays. Blocks of at least 4 KiB come from it; smaller ones (messages, lists of a few tiles) come from the
// system, as does what a GPU's driver takes. Start from vrtm_allocator_init().
//
// Both functions are called on any thread that works in a call, also by several at once. They must return normally
// (no exception, no longjmp) and must not call vrtm. They and `user` must stay valid until the device and all of its
// assets are destroyed; by then everything has been freed.
//
// If `alloc` returns null, the call fails with VRTM_ERROR_OUT_OF_MEMORY: nothing was written, the asset is as it was,
// and the call may be made again. Memory that the code for GPUs takes on its own comes from the system where `alloc`
// returns null.
typedef struct vrtm_allocator {
    // sizeof(vrtm_allocator); set by vrtm_allocator_init().
    uint32_t struct_size;
    // Allocates.
    vrtm_alloc_fn alloc;
    // Frees.
    vrtm_free_fn free;
    // Passed to both as it is.
    void *user;
} vrtm_allocator;

/* ---- Images in memory of the host's GPU ---- */

// What kind of handle a host has exported its memory as.
typedef int32_t vrtm_external_kind;

// A file descriptor from vkGetMemoryFdKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT: on Linux.
#define VRTM_EXTERNAL_OPAQUE_FD 1

// An NT handle from vkGetMemoryWin32HandleKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_WIN32_BIT: on Windows.
// Written and compiled, but never run by the authors of this version.
#define VRTM_EXTERNAL_OPAQUE_WIN32 2

// An output image in memory of the host's own Vulkan device: rows of texels, two 32-bit floats each, as a buffer holds
// them that is drawn from or copied to an image (VK_FORMAT_R32G32_SFLOAT). Start from vrtm_external_image_init().
//
// The host allocates the memory with VkExportMemoryAllocateInfo, without VkMemoryDedicatedAllocateInfo, on a device
// whose deviceUUID and driverUUID are those of the adapter (vrtm_adapter_data), which is what Vulkan demands of both
// sides.
typedef struct vrtm_external_image {
    // sizeof(vrtm_external_image); set by vrtm_external_image_init().
    uint32_t struct_size;
    // One of VRTM_EXTERNAL_. Required.
    vrtm_external_kind handle_kind;
    // The file descriptor, or the handle's bits. It stays the caller's: the library imports a duplicate of a
    // descriptor, so that the same one can be handed over again for the next frame, and the caller closes its own.
    uint64_t handle;
    // VkMemoryAllocateInfo::allocationSize of the memory. Required.
    uint64_t memory_size;
    // VkMemoryAllocateInfo::memoryTypeIndex of the memory.
    uint32_t memory_type;
    // VRTM_PIXEL_F32 (0, the default).
    vrtm_pixel_format format;
    // Texels in u, at least 1.
    uint32_t width;
    // Texels in v, at least 1.
    uint32_t height;
    // VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    vrtm_origin origin;
    // Bytes from the memory's begin to the first texel of the first row, a multiple of 8.
    uint64_t offset;
    // Bytes from one row to the next, a multiple of 8; 0 = tightly packed. Bytes between rows are not written.
    uint64_t row_stride;
} vrtm_external_image;

// Writes a redirection of the last solve into memory of the host's own Vulkan device, which must be the same GPU
// (vrtm_device_desc.adapter_by), without a way through the CPU. The texels are, bit by bit, those of vrtm_tile_fetch.
//
// Kinds: REDIRECTION, REDIRECTION_DELTA and REDIRECTION_UDIM. The others are computed on the CPU and not offered
// here, nor are f16, a third or fourth channel, one_to_one, parts of an image, images in VkImage, memory that is
// dedicated to a resource, D3D12 resources, and semaphores: take vrtm_tile_fetch.
//
// Synchronisation: nothing on the host's device may use the texels while the call lasts. It returns when the GPU has
// written them, so that the host needs no semaphore; work that the host submits afterwards reads them, once it has
// acquired its buffer from VK_QUEUE_FAMILY_EXTERNAL as Vulkan has it (as vrtm releases it to that family), if its
// sharing mode is exclusive. Where bytes of the buffer are to keep their content, the host releases it to that
// family beforehand.
//
// Errors: those of vrtm_tile_fetch; VRTM_ERROR_UNSUPPORTED if the asset's device is the CPU, for other kinds and
// formats, and for handles that this GPU, its driver or this system does not import; VRTM_ERROR_INVALID_ARGUMENT,
// naming the field, for an unknown value, a zero size, an offset or stride that is short or no multiple of 8, memory
// that is too small, a handle that is no memory, or a memory type that holds no buffers. Nothing is written then.
// After VRTM_ERROR_DEVICE_LOST the texels are undefined. Never busy.
VRTM_API
vrtm_status vrtm_tile_fetch_external(vrtm_tile tile,
                                     vrtm_fetch_kind kind,
                                     const vrtm_external_image *image);

/* ---- Refinements ---- */

// How a mesh is refined. Start from vrtm_refinement_desc_init(), which sets the defaults.
typedef struct vrtm_refinement_desc {
    // sizeof(vrtm_refinement_desc); set by vrtm_refinement_desc_init().
    uint32_t struct_size;
    // The UV set: 0 <= uv_set < vrtm_asset_data.uv_sets.
    uint32_t uv_set;
    // Largest error of linear interpolation on a triangle, in UV of a tile, over 0 and at most 1; default 1/2048,
    // half a texel of a texture of 1024. Half of it takes up to three times as many triangles.
    double tolerance;
    // Most triangles of the refined mesh, where a polygon of n corners counts as n - 2; 0 = a million more than
    // the mesh has. Where there is no room for all, the largest errors are split first.
    uint64_t max_triangles;
} vrtm_refinement_desc;

// Sizes of a refinement, and what it came to. Start from vrtm_refinement_data_init().
typedef struct vrtm_refinement_data {
    // sizeof(vrtm_refinement_data); set by vrtm_refinement_data_init().
    uint32_t struct_size;
    // The UV set.
    uint32_t uv_set;
    // Vertices: those of the mesh, then the new ones.
    uint64_t vertices;
    // Faces: triangles, and those polygons of the mesh that need no split.
    uint64_t faces;
    // Corners of all faces: the length of its array of corner UVs.
    uint64_t corners;
    // Triangles, a polygon of n corners counting as n - 2.
    uint64_t triangles;
    // Bytes that it holds, beside the mesh and the results.
    uint64_t bytes;
    // The tolerance, in UV of a tile.
    double tolerance;
    // Largest error, in UV of a tile, that was left in the result that it was last made or extended for.
    double error;
    // 1 if that is within the tolerance; 0 if there was no room for more triangles.
    uint32_t reached;
    // Milliseconds that making it took, or extending it the last time.
    float ms;
} vrtm_refinement_data;

// Where the pattern of a refinement is written: the caller's arrays, of which null ones are left out. From it a
// host interpolates positions and all else that its vertices and corners have. Start from
// vrtm_refinement_pattern_init().
//
// Sources come in threes, with weights that add up to 1. What needs fewer than three has weight 0 for the rest,
// which repeat the first.
typedef struct vrtm_refinement_pattern {
    // sizeof(vrtm_refinement_pattern); set by vrtm_refinement_pattern_init().
    uint32_t struct_size;
    // vrtm_refinement_data.vertices: the room in the arrays by vertex.
    size_t vertex_count;
    // vrtm_refinement_data.faces: the room in the arrays by face.
    size_t face_count;
    // vrtm_refinement_data.corners: the room in the arrays by corner.
    size_t corner_count;
    // Three per vertex: vertices of the mesh. The mesh's own vertices come first, in their order, each with itself
    // as its source.
    uint32_t *vertex_sources;
    // Three per vertex: what each of them weighs.
    float *vertex_weights;
    // One per face: the face of the mesh that it lies in. They come in the order of the mesh's faces.
    uint32_t *face_sources;
    // One per face: its number of corners. 3 for a part of a face; a face that was left alone keeps its own.
    uint32_t *face_corners;
    // One per corner: its vertex.
    uint32_t *corner_vertices;
    // Three per corner: corners of the mesh, of the triangle of the face that it lies in.
    uint32_t *corner_sources;
    // Three per corner: what each of them weighs.
    float *corner_weights;
    // Two per corner: its original UV in the set, with the tile's offset. It is what its sources' UVs make.
    float *corner_uvs;
} vrtm_refinement_pattern;

// Refines the mesh of an asset for its last result, for hosts that know UV sets only. Corner UVs of the mesh
// itself recover less than the map where the mesh is coarser than what is painted on it: between corners a
// renderer interpolates linearly. Here triangles are split until that is nowhere farther from the redirection than
// the tolerance.
//
// Edges are split at their middle, for all faces that have them, also across seams and borders of charts: no
// cracks open, and no angle gets much smaller than half of the least one. A face that needs no split stays as it
// is, a quadrilateral only if it keeps the tolerance whichever way a renderer cuts it. Where nothing moves,
// nothing is split. The pattern depends on the result and on `desc` alone. `desc` may be null: the defaults.
//
// `*refinement` is the caller's to destroy. It keeps what it needs alive, the mesh and the last result among it,
// and may be used when the asset is destroyed. Never busy: it reads the last good result, also during a solve.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT for
// a UV set or a tolerance out of range, or if `refinement` is null; VRTM_ERROR_OUT_OF_MEMORY.
VRTM_API
vrtm_status vrtm_refinement_create(vrtm_asset asset,
                                   const vrtm_refinement_desc *desc,
                                   vrtm_refinement *refinement);

// Refines further, for the asset's last result. What was split stays split: a refinement that was extended for each
// frame of a shot has one topology for all of them. Vertices keep their numbers, and new ones follow; faces and corners
// are numbered anew. vrtm_refinement_info tells the new sizes. Where all frames are to keep the tolerance, go round
// them until the number of triangles stays: a split for one may push another slightly over it.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_BUSY while another call extends the same refinement;
// VRTM_ERROR_OUT_OF_MEMORY. On any error the refinement is as it was.
VRTM_API
vrtm_status vrtm_refinement_extend(vrtm_refinement refinement);

// Sizes of a refinement, and what it came to. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `data` is null or has a wrong struct_size.
VRTM_API
vrtm_status vrtm_refinement_info(vrtm_refinement refinement,
                                 vrtm_refinement_data *data);

// Writes the pattern into the caller's arrays. It changes only when the refinement is extended. Never busy.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field, if `pattern` is null, a count
// is not that of vrtm_refinement_info, or two arrays overlap. On any error nothing is written.
VRTM_API
vrtm_status vrtm_refinement_fetch_pattern(vrtm_refinement refinement,
                                          const vrtm_refinement_pattern *pattern);

// Writes the redirected UV of every corner of the refined mesh in the asset's last result: `count` pairs (u, v),
// with the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. Every frame: solve,
// then this. At corners of the mesh they are those of vrtm_asset_fetch_corner_uvs_of_set, bit by bit. `count` is
// the number of corners, vrtm_refinement_data.corners; `uvs` has room for 2 * count floats. Never busy.
//
// A pose that the refinement was not made or extended for may err by more than the tolerance.
//
// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `uvs` is null or `count` is not the number of
// corners; VRTM_ERROR_OUT_OF_MEMORY. On any error nothing is written.
VRTM_API
vrtm_status vrtm_refinement_fetch_corner_uvs(vrtm_refinement refinement,
                                             float *uvs,
                                             size_t count);

// Ends a refinement's handle. Calls that are using it run to their end, and the memory is freed then.
//
// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
VRTM_API vrtm_status vrtm_refinement_destroy(vrtm_refinement refinement);

/* ---- Initialisers: struct_size set, the defaults that are not zero, and all else zero ---- */

#define VRTM_DEFINE_INIT_WITH_(type, defaults) \
    static inline type type##_init(void)       \
    {                                          \
        type value;                            \
        memset(&value, 0, sizeof value);       \
        value.struct_size = sizeof value;      \
        defaults                               \
        return value;                          \
    }
#define VRTM_DEFINE_INIT_(type) VRTM_DEFINE_INIT_WITH_(type, ;)

// vrtm_mesh_desc vrtm_mesh_desc_init(void), and so on.
VRTM_DEFINE_INIT_WITH_(vrtm_mesh_desc,
    value.weld_position_tolerance = 1e-5;
    value.weld_uv_tolerance = 1.0 / 2048;)
VRTM_DEFINE_INIT_WITH_(vrtm_tile_settings,
    value.smoothness = 0.02f;
    value.smoothness_floor = 0.0005f;
    value.room = 0.3f;
    value.room_threshold = 0.4f;)
VRTM_DEFINE_INIT_WITH_(vrtm_solve_options,
    value.pbd.iterations = 16;
    value.pbd.smoothing = 0.8f;
    value.pbd.coarse_correction = 0.7f;)
VRTM_DEFINE_INIT_WITH_(vrtm_refinement_desc,
    value.tolerance = 1.0 / 2048;)
VRTM_DEFINE_INIT_(vrtm_allocator)
VRTM_DEFINE_INIT_(vrtm_executor)
VRTM_DEFINE_INIT_(vrtm_device_desc)
VRTM_DEFINE_INIT_(vrtm_device_data)
VRTM_DEFINE_INIT_(vrtm_adapter_data)
VRTM_DEFINE_INIT_(vrtm_array)
VRTM_DEFINE_INIT_(vrtm_image)
VRTM_DEFINE_INIT_(vrtm_image_out)
VRTM_DEFINE_INIT_(vrtm_asset_data)
VRTM_DEFINE_INIT_(vrtm_tile_data)
VRTM_DEFINE_INIT_(vrtm_tile_needs)
VRTM_DEFINE_INIT_(vrtm_fetch)
VRTM_DEFINE_INIT_(vrtm_external_image)
VRTM_DEFINE_INIT_(vrtm_map_desc)
VRTM_DEFINE_INIT_(vrtm_map_data)
VRTM_DEFINE_INIT_(vrtm_job_data)
VRTM_DEFINE_INIT_(vrtm_tile_report_data)
VRTM_DEFINE_INIT_(vrtm_asset_report_data)
VRTM_DEFINE_INIT_(vrtm_refinement_data)
VRTM_DEFINE_INIT_(vrtm_refinement_pattern)

#undef VRTM_DEFINE_INIT_
#undef VRTM_DEFINE_INIT_WITH_

#ifdef __cplusplus
} // extern "C"
#endif

#endif // VRTM_H
