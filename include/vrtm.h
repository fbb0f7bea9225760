/*
 * vrtm: keeps painted features rigid while the surface under them deforms.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 * Generated from capi/src: do not edit. `VRTM_UPDATE_HEADER=1 cargo test --test c_api header::` writes it again.
 *
 * THE PIPELINE
 *
 *   device   vrtm_device_create           once: backend, threads, memory, log
 *   asset    vrtm_asset_create            once per mesh: topology, rest positions, UVs
 *   maps     vrtm_tile_set_rigidity,      per UDIM tile, and again when the artist paints
 *            vrtm_tile_set_mask
 *            vrtm_tile_update_rigidity    after a stroke of a brush
 *   prepare  vrtm_tile_get_estimate,      if memory or the first frame's time matter
 *            vrtm_tile_save, vrtm_tile_load
 *   frame    vrtm_asset_redirect          every frame: new positions in, redirection maps out
 *            or vrtm_asset_solve, then vrtm_asset_fetch and vrtm_asset_fetch_corner_uvs
 *   job      vrtm_asset_submit, then vrtm_job_wait    solves in the background; can be cancelled
 *   facts    vrtm_tile_get_report, vrtm_asset_get_report, vrtm_tile_get_info, vrtm_asset_get_info
 *   refine   vrtm_refinement_create, then vrtm_refinement_fetch_corner_uvs every frame, for hosts that support
 *            only UV sets
 *   carry    vrtm_carrier_create, then vrtm_carrier_fetch every frame, for what is geometry on the surface
 *
 * A redirection map has two channels: for a surface point's UV it holds the UV at which to sample the texture. A shader
 * uses it as follows, with v pointing up and texture coordinates within the tile (see VRTM_FETCH_ for other forms):
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
 *   vrtm_asset_find_tile(asset, &(vrtm_tile_key){.udim = 1001}, &tile);
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
 * RULES FOR ALL FUNCTIONS (docs/hosts.md, "Rules of the C API", has them in detail)
 *
 * Status. Every function but vrtm_version, vrtm_status_string and vrtm_last_error returns VRTM_OK (0) or an error.
 * vrtm_last_error() on the same thread then says which argument, and which element of it, was wrong. Outputs are
 * written only on VRTM_OK, and an asset's last good result stays readable after a failed call. Besides its listed
 * errors, any function may give VRTM_ERROR_INVALID_ARGUMENT and VRTM_ERROR_INVALID_HANDLE for the reasons that stand
 * there, and VRTM_ERROR_INTERNAL, a defect of the library that leaves the asset unchanged; and any function that
 * computes may give VRTM_ERROR_OUT_OF_MEMORY, after which the call may be repeated.
 *
 * Names. vrtm_X_get_Y fills a vrtm_X_Y with facts about an X; vrtm_X_fetch_Y writes results into the caller's arrays
 * or images.
 *
 * Handles are numbers and may be copied freely. A zero, destroyed or foreign handle gives an error and does no harm; a
 * handle's number is never reused. Objects may be destroyed in any order.
 *
 * Structs that start with struct_size may grow at their end in later versions. Get them from their _init() function,
 * or vrtm_defaults(). The library accepts structs of older headers (missing fields count as zero, which is the default
 * of every added field), and of newer headers if the fields that it does not know are zero; otherwise it gives
 * VRTM_ERROR_UNSUPPORTED. Structs that the library fills keep the caller's struct_size.
 *
 * Memory. Inputs are read during the call and copied where needed; outputs are written to the caller's memory. Neither
 * side frees memory that the other allocated. Pointers must be null or valid for the size that goes with them, structs
 * and number arrays aligned as in C; the data of arrays and images need no alignment. Strides are in bytes.
 *
 * Threads. Any function may be called from any thread. Different assets can be used at the same time. Calls on one
 * asset do not wait for each other: results, descriptions and tile handles can be read at any time, during a solve the
 * last good ones, and a call that solves or changes anything, or may have to prepare a tile, gives VRTM_ERROR_BUSY
 * while another call or a job uses the asset. No lock is held while a function of the host runs. Functions of the host
 * must return normally: no exception, no longjmp.
 *
 * Process. The library prints nothing and changes no signal handler, locale or floating-point mode. On the CPU, a
 * thread with a stack of 48 KiB may call any function.
 *
 * VERSIONS
 *
 * A program that was compiled against this header runs with this library and any later one of the same major version,
 * without being recompiled, from 0.1 on. The major version is in the file name by which the program loads the library:
 * libvrtm.so.0, libvrtm.0.dylib (a DLL has the same name in all versions: vrtm_version() tells). A patch version
 * declares nothing new, and results keep their bits, except for defects that the changelog names. A minor version adds
 * functions, types, constants and fields at the end of sized structs, where zero means the earlier behaviour; results
 * may differ in their bits. Everything under "Experimental" may change, be renamed or be removed. Names that start with
 * vrtm_ or VRTM_ are reserved for the library.
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

// The call succeeded.
#define VRTM_OK 0

// An argument is null but not optional, out of its range, no value of its type, of a wrong size, count or stride, or
// holds a NaN or an infinity.
#define VRTM_ERROR_INVALID_ARGUMENT 1

// A handle is zero, destroyed, of another kind, or was never given out.
#define VRTM_ERROR_INVALID_HANDLE 2

// The backend, format or combination is not available in this build or on this machine.
#define VRTM_ERROR_UNSUPPORTED 3

// Out of memory, or over the device's memory budget.
#define VRTM_ERROR_OUT_OF_MEMORY 4

// The asset, or the tile, has no result yet: solve first.
#define VRTM_ERROR_NOT_SOLVED 5

// Another call is using the asset; try again when it has returned.
#define VRTM_ERROR_BUSY 6

// The GPU was lost: a driver reset, a crash, a removed adapter. From then on every call that uses the device or its
// assets gives this status, except calls that describe or destroy them. Destroy them, and make a new device and new
// assets.
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

// The name of a status, such as "VRTM_ERROR_BUSY"; "unknown status" for any other value. The string is static: do not
// free it. It is valid until the library is unloaded. Never fails.
VRTM_API
const char *vrtm_status_string(vrtm_status status);

// Message of this thread's last failed call: one UTF-8 line of at most 511 bytes with the function and the argument,
// as in "vrtm_asset_create: desc.indices is null"; "" if no call has failed. A successful call does not change it. The
// string belongs to the library and to the calling thread, and is valid until that thread's next failing call or its
// end. Never fails.
VRTM_API
const char *vrtm_last_error(void);

/* ---- Handles ---- */

// A device: where assets are solved. Zero = no device.
typedef struct vrtm_device {
    // Opaque.
    uint64_t id;
} vrtm_device;

// An asset: one mesh with its tiles, their maps, settings and results. Zero = no asset.
typedef struct vrtm_asset {
    // Opaque.
    uint64_t id;
} vrtm_asset;

// A tile: one UDIM unit square of an asset, or one layer of it (vrtm_mesh_desc.max_layers). It belongs to the asset
// and is destroyed with it. Handles of the same tile are equal. Zero = no tile.
typedef struct vrtm_tile {
    // Opaque.
    uint64_t id;
} vrtm_tile;

// A job: one solve that runs beside the host's own work, made by vrtm_asset_submit. Zero = no job.
typedef struct vrtm_job {
    // Opaque.
    uint64_t id;
} vrtm_job;

// A refinement: an asset's mesh with its triangles split, for hosts that support only UV sets. Zero = no refinement.
typedef struct vrtm_refinement {
    // Opaque.
    uint64_t id;
} vrtm_refinement;

// A carrier: points bound to an asset's rest surface, which its solves move along. Zero = no carrier.
typedef struct vrtm_carrier {
    // Opaque.
    uint64_t id;
} vrtm_carrier;

/* ---- Arrays and images ---- */

// The number format of an array's components.
typedef int32_t vrtm_scalar;

// 32-bit float. The default.
#define VRTM_SCALAR_F32 0

// 64-bit float.
#define VRTM_SCALAR_F64 1

// The number format of an image's channels.
typedef int32_t vrtm_pixel_format;

// 32-bit float. The default.
#define VRTM_PIXEL_F32 0

// 16-bit float (IEEE half).
#define VRTM_PIXEL_F16 1

// 16-bit integer, 0..65535 for 0..1. Inputs only.
#define VRTM_PIXEL_U16 2

// 8-bit integer, 0..255 for 0..1. Inputs only.
#define VRTM_PIXEL_U8 3

// Side of the tile at which the first row of an image lies.
typedef int32_t vrtm_origin;

// The first row is at v = 1, as in image files. The default.
#define VRTM_ORIGIN_TOP 0

// The first row is at v = 0, as in OpenGL textures.
#define VRTM_ORIGIN_BOTTOM 1

// A host's array of vectors or numbers, such as vertex positions. Start from vrtm_array_init(). The function or field
// that takes the array determines the number of components per element: 3 for positions (a fourth, as in Maya's
// double4, is skipped by the stride), 2 for UV pairs, 1 for single values. The data need not be aligned. It is read
// during the call only.
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

// An input image with one channel: a rigidity map or a warp mask. It covers the whole tile; texel (x, y) from the
// corner (0, 0) has its centre at u = (x + 0.5) / width, v = (y + 0.5) / height. Start from vrtm_image_init(). To use
// one channel of several, point `data` at it and set `pixel_stride`. The data is copied before the call returns.
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

// An output image in the caller's memory: width * height * channels values, if packed. Any size is allowed; the first
// `channels` channels of each texel are written. Bytes that a stride skips stay. Start from vrtm_image_out_init().
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
    // Channels to write per texel; 0 (the default) = as many as the kind of output has: 1 for FILTER_SCALE, 4 for
    // JACOBIAN, 2 for all others. With 3, the third channel of UVs is 0; with 4, for all but a warp, the fourth is 1
    // where a chart covers the texel's centre and 0 elsewhere.
    uint32_t channels;
    // Address of the first texel of the first row: width * height * channels values, if packed. Need not be aligned.
    void *data;
    // Bytes from one texel to the next; 0 = tightly packed (for two channels 8 for f32, 4 for f16).
    size_t pixel_stride;
    // Bytes from one row to the next; 0 = tightly packed.
    size_t row_stride;
} vrtm_image_out;

// An array of vectors in the caller's memory. Start from vrtm_array_out_init(). It need not be aligned; bytes that
// the stride skips are left unchanged.
typedef struct vrtm_array_out {
    // sizeof(vrtm_array_out); set by vrtm_array_out_init().
    uint32_t struct_size;
    // VRTM_SCALAR_F32 (0, the default) or VRTM_SCALAR_F64.
    vrtm_scalar format;
    // Address of the first component of the first element: count * components numbers, if packed.
    void *data;
    // Number of elements: vrtm_carrier_info.points.
    size_t count;
    // Bytes from one element to the next; 0 = tightly packed. At least the size of an element.
    size_t stride;
} vrtm_array_out;

// Destinations of carried points, vrtm_carrier_info.points elements in each array; null arrays are skipped. Elements
// of different arrays may be interleaved. Start from vrtm_carried_init().
typedef struct vrtm_carried {
    // sizeof(vrtm_carried); set by vrtm_carried_init().
    uint32_t struct_size;
    // Positions in the pose, 3 components.
    const vrtm_array_out *positions;
    // Rotations of the frames at rest: quaternions x, y, z, w, 4 components.
    const vrtm_array_out *rotations;
    // Instead of `rotations`: matrices row by row, 9 components.
    const vrtm_array_out *matrices;
    // The stretch of the surface under what is painted that is left, as two factors, the larger first: 2 components.
    const vrtm_array_out *stretch;
    // UV of the surface point under each point, W(p) for a point painted at p (as VRTM_FETCH_WARP), with the tile's
    // offset added: 2 components.
    const vrtm_array_out *uvs;
} vrtm_carried;

/* ---- Device ---- */

struct vrtm_executor;
struct vrtm_allocator;

// Backend on which assets are solved.
typedef int32_t vrtm_backend;

// A hardware GPU, discrete before integrated; the CPU if no such GPU was found or it cannot be opened. A software
// driver does not count as a GPU. vrtm_device_get_info says what was chosen and why. The default.
#define VRTM_BACKEND_AUTO 0

// The CPU.
#define VRTM_BACKEND_CPU 1

// The GPU that vrtm_device_desc selects, even a software driver; never falls back to the CPU.
#define VRTM_BACKEND_GPU 2

// Kind of name by which vrtm_device_desc selects a GPU.
typedef int32_t vrtm_adapter_by;

// By its number, vrtm_device_desc.adapter; the default.
#define VRTM_ADAPTER_BY_NUMBER 0

// By its UUID, 16 bytes: VkPhysicalDeviceIDProperties::deviceUUID of the host's own VkPhysicalDevice.
#define VRTM_ADAPTER_BY_UUID 1

// By its LUID, 8 bytes: the host's DXGI_ADAPTER_DESC1::AdapterLuid, ID3D12Device::GetAdapterLuid(), or, on Windows,
// VkPhysicalDeviceIDProperties::deviceLUID. A GPU that is listed both for Vulkan and for Direct3D 12 is used through
// the first of the two.
#define VRTM_ADAPTER_BY_LUID 2

// By its registry ID, 8 bytes: the number MTLDevice.registryID.
#define VRTM_ADAPTER_BY_REGISTRY_ID 3

// Importance of a log line.
typedef int32_t vrtm_log_level;

// Something to show to the artist: clipped faces, overlapping charts.
#define VRTM_LOG_LEVEL_WARNING 1

// Facts, such as the chosen device and the reason.
#define VRTM_LOG_LEVEL_INFO 2

// Kind of a log line. Each has the same level and the same values in every line.
typedef int32_t vrtm_log_code;

// A new device, and the reason for its choice. Values: CPU threads.
#define VRTM_LOG_CODE_DEVICE 1

// A new mesh. Values: vertices, faces, faces that are skipped, faces without texture, triangles, tiles.
#define VRTM_LOG_CODE_MESH 2

// A tile of a new mesh. Values: triangles, charts, border edges, edges welded by position, edges apart.
#define VRTM_LOG_CODE_TILE 3

// Faces that reach out of their tile are clipped to it. Values: their number.
#define VRTM_LOG_CODE_FACES_CLIPPED 4

// Faces that lie in no UDIM tile are left out. Values: their number.
#define VRTM_LOG_CODE_FACES_OUTSIDE 5

// Triangles without UV area are left out. Values: their number.
#define VRTM_LOG_CODE_TRIANGLES_DEGENERATE 6

// Edges lie together in space and nearly in UV, and are not connected, so that charts end there. Values: their number.
#define VRTM_LOG_CODE_EDGES_APART 7

// Seams that are no edge of a face do nothing. Values: their number.
#define VRTM_LOG_CODE_SEAMS_UNUSED 8

// All rest positions are one point, so that nothing can move.
#define VRTM_LOG_CODE_REST_IS_POINT 9

// A rigidity, of a tile or of the vertices, has values in another range than 0..1. Values: the largest.
#define VRTM_LOG_CODE_RIGIDITY_RANGE 10

// A mask, of a tile or of the vertices, has values in another range than 0..1. Values: the largest.
#define VRTM_LOG_CODE_MASK_RANGE 11

// A grid that was set has too few cells for its rigid features. Values: cells in u and in v, cells per side that would
// resolve them.
#define VRTM_LOG_CODE_GRID_TOO_COARSE 12

// A grid that was set has far more cells than its rigid features need. Values: as for the one that is too coarse.
#define VRTM_LOG_CODE_GRID_TOO_FINE 13

// Charts of a tile overlap, and what they share does not move in one map. Values: the share of the textured area.
#define VRTM_LOG_CODE_OVERLAP 14

// Nodes are fixed at gaps in the UVs that welding closes. Values: their number.
#define VRTM_LOG_CODE_NODES_AT_GAPS 15

// A new grid. Values: nodes that may move, cells in u and in v, and of the rigid texels the shares that are fixed and
// overlapped, both 0 if nothing is rigid.
#define VRTM_LOG_CODE_GRID 16

// A tile has rigid texels, but nothing that may move.
#define VRTM_LOG_CODE_NOTHING_MOVES 17

// No tile has a rigidity, so that nothing moves.
#define VRTM_LOG_CODE_NO_RIGIDITY 18

// A pose is only scaled, with VRTM_SCALE_KEEP, or its edges are much longer or shorter than at rest, as if it were in
// other units. Values: the median of their lengths, as multiples of those at rest. Told once for scaled poses that
// follow one another.
#define VRTM_LOG_CODE_POSE_SCALE 19

// Many edges of a pose are much longer than at rest, as if its vertices were in another order. Values: the share of
// edges over 3 times as long.
#define VRTM_LOG_CODE_POSE_ORDER 20

// The pose tears welded edges of a tile. Values: torn edges, welded edges.
#define VRTM_LOG_CODE_WELDS_TORN 21

// The pose tears no welded edges of a tile any more. Values: 0, welded edges.
#define VRTM_LOG_CODE_WELDS_WHOLE 22

// A line of the log, which the library fills. It lives during the call of the log function.
typedef struct vrtm_log_entry {
    // sizeof(vrtm_log_entry) of the library.
    uint32_t struct_size;
    // One of VRTM_LOG_LEVEL_.
    vrtm_log_level level;
    // One of VRTM_LOG_CODE_, or one of a later version. Programs decide by it and by `values`: the words of a message
    // may change.
    vrtm_log_code code;
    // UDIM number of the tile that the line is about; 0 = about no single tile.
    uint32_t udim;
    // UV set of that tile.
    uint32_t uv_set;
    // Layer of that tile.
    uint32_t layer;
    // Numbers of the message, as the code's comment lists them; the others are 0.
    double values[6];
    // One line for people, UTF-8, without a line break.
    const char *message;
} vrtm_log_entry;

// A host's log function. It is called during a call into vrtm, on the thread that does the call's work, also by
// several threads at once. It may call vrtm functions; calls that use the asset of the current call give
// VRTM_ERROR_BUSY, as does waiting for the current job.
typedef void (*vrtm_log_fn)(void *user, const vrtm_log_entry *entry);

// Settings of a new device. Start from vrtm_device_desc_init(), whose defaults are: automatic backend, all cores, no
// memory budget, no log.
typedef struct vrtm_device_desc {
    // sizeof(vrtm_device_desc); set by vrtm_device_desc_init().
    uint32_t struct_size;
    // One of VRTM_BACKEND_: AUTO (0, the default), CPU, GPU. The environment variable VRTM_DEVICE (auto, cpu, gpu, or
    // gpu:UUID with the UUID of an adapter) overrides it, for support.
    vrtm_backend backend;
    // One of VRTM_ADAPTER_BY_: NUMBER (0, the default), UUID, LUID, REGISTRY_ID. With the last three, `adapter_id` is
    // used instead of `adapter`, so that vrtm can compute on the GPU that the host draws with. With `backend` GPU, the
    // adapter must exist; AUTO uses it if it is a usable hardware GPU, and the CPU otherwise.
    vrtm_adapter_by adapter_by;
    // Number of the GPU, 0 <= adapter < vrtm_adapter_count, if `backend` is GPU and `adapter_by` is NUMBER;
    // ignored otherwise.
    uint32_t adapter;
    // The identity of the adapter, in memory order; unused bytes are zero.
    uint8_t adapter_id[16];
    // CPU threads that one solve uses, at most 1024; 0 = one per core. The result is the same bit for bit. The
    // environment variable VRTM_THREADS overrides it.
    uint32_t threads;
    // Maximum bytes that the prepared tiles of all assets of the device may hold together, with their maps and
    // solvers, and with carriers and the poses that they follow; 0 = no limit. A call that would exceed it gives
    // VRTM_ERROR_OUT_OF_MEMORY. A carrier is also refused if there is no room for what its first fetch will hold.
    uint64_t memory_budget;
    // Receives log messages; null (the default) = no log. The function and `log_user` must stay valid until the device
    // and all of its assets are destroyed.
    vrtm_log_fn log;
    // Passed to `log` unchanged.
    void *log_user;
    // The host's threads; null (the default) = the library starts threads for each solve or fetch, which end with the
    // call. The struct is copied.
    const struct vrtm_executor *executor;
    // The host's allocator; null (the default) = the system's. The struct is copied.
    const struct vrtm_allocator *allocator;
} vrtm_device_desc;

// Makes a device. `desc` may be null, which means all defaults. The caller destroys `*device`. Make one device and
// keep it: looking for GPUs and opening one loads drivers, which takes tens of milliseconds, and an open GPU keeps
// threads of its driver alive. For support, the environment variable VRTM_GPU_LIMITS=webgpu opens GPUs with WebGPU's
// default limits and without optional features.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for an identity that no adapter has (VRTM_BACKEND_GPU; the message lists the
// available ones), an allocator without a function, or an environment variable that cannot be read;
// VRTM_ERROR_UNSUPPORTED for VRTM_BACKEND_GPU if no GPU was found or it cannot be opened, and for an allocator if the
// library was built without the feature for it.
VRTM_API
vrtm_status vrtm_device_create(const vrtm_device_desc *desc,
                               vrtm_device *device);

// Destroys a device's handle. Assets that were made on it, and the log function, remain in use until the assets are
// destroyed, in any order.
VRTM_API
vrtm_status vrtm_device_destroy(vrtm_device device);

/* ---- Asset ---- */

// Rule by which corners of different faces are one corner, so that a chart continues across the edge between
// them.
typedef int32_t vrtm_weld;

// The same vertex, and UVs within the tolerance; the default. The host's vertices define connectivity: a cut in the
// modelling program is a cut here, even between lips that are closed at rest, and in every pose.
#define VRTM_WELD_INDEX 0

// As VRTM_WELD_INDEX, and also different vertices whose rest positions lie within the tolerance
// (vrtm_mesh_desc.weld_position_tolerance): for game meshes, whose vertices are duplicated along hard edges and seams.
// A pose tears a welded edge if the two vertices at either of its ends lie farther apart, along x, y or z, than ten
// times the tolerance (with its rounding) plus 8 e times the largest magnitude of their six posed coordinates; e is
// 2^-23 for f32 positions and 2^-52 for f64. In such a pose charts end at the edge, as if the mesh were cut there, and
// the log warns.
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
// The corners of a face are consecutive: corner k of the mesh has the vertex indices[k] and the UV uv_indices[k] (or
// UV k, without uv_indices). Polygons may have any number of corners; they are triangulated. UVs are face-varying, v
// points up, and a face belongs to the UDIM tile 1001 + floor(u) + 10 floor(v) of its UV centroid.
typedef struct vrtm_mesh_desc {
    // sizeof(vrtm_mesh_desc); set by vrtm_mesh_desc_init().
    uint32_t struct_size;
    // Rest positions, 3 components, any unit of length. Required.
    const vrtm_array *positions;
    // Corners of each face; null = all faces are triangles, unless `face_offsets` is given. Faces with fewer than 3
    // corners (points, lines) are skipped and counted; their corners still count in the order.
    const uint32_t *face_counts;
    // Number of faces: the length of `face_counts`. Ignored when that is null.
    size_t face_count;
    // Instead of `face_counts`: the first corner of each face, followed by `index_count`. Null = absent.
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
    // UV of each corner; null = one UV per corner, in the order of the corners. A face whose corners all have
    // UINT32_MAX is untextured: it belongs to no tile, but its corners still count in the order.
    const uint32_t *uv_indices;
    // The length of `uv_indices`: `index_count`. Ignored when that is null.
    size_t uv_index_count;
    // Further UV sets, starting with set 1; the UVs above are set 0. Null = none. Each set has its own tiles.
    const vrtm_uv_set *uv_sets;
    // The length of `uv_sets`. Ignored when that is null.
    size_t uv_set_count;
    // The faces that carry the texture, each less than the number of faces, in any order; null = all. The other faces
    // are treated as if they had no UVs.
    const uint32_t *textured_faces;
    // The length of `textured_faces`. Ignored when that is null.
    size_t textured_face_count;
    // Edges at which charts end in all UV sets: 2 vertices each. Null = none. A pair that is not an edge of any face
    // has no effect; it is counted, and the log warns.
    const uint32_t *seams;
    // The number of these edges: half the length of `seams`. Ignored when that is null.
    size_t seam_count;
    // One of VRTM_WELD_: INDEX (0, the default), POSITION, OFF.
    vrtm_weld weld;
    // Largest distance of vertices that VRTM_WELD_POSITION welds, as a fraction (0..1) of the longest side of the
    // bounding box at rest; default 1e-5. Unless it is 0, an allowance for rounding is added. A vertex is welded over
    // at most a quarter of its shortest edge, and one with an edge shorter than half of the tolerance only to vertices
    // at the same position.
    double weld_position_tolerance;
    // Largest difference of welded UVs, in u and in v, 0..1; default 1/2048, half a texel of a map of 1024, and at
    // most a quarter of the smallest UV height of the triangles at the vertex. Welded corners have the mean of their
    // UVs. Beside a slit in the UVs that this closes nothing moves (vrtm_tile_info.gap_nodes).
    double weld_uv_tolerance;
    // The largest number of layers of a tile, for meshes whose charts lie over one another: mirrored halves, stacked
    // islands. 0 (the default) or 1: texels that several charts share do not move (see VRTM_OVERLAP_). From 2 on,
    // charts that lie over others, deeper than by 1/4096, get layers of their own, each a tile with its own
    // redirection map: vrtm_asset_fetch_face_layers says which map each face reads. Corner UVs and refinements know
    // the layers. Charts for which the layers do not suffice stay in the last one; a chart that lies over itself does
    // not move there.
    uint64_t max_layers;
} vrtm_mesh_desc;

// Makes an asset from a mesh. The caller destroys `*asset`; it may outlive `device`.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for an empty mesh, and for a face with UVs at some corners only.
VRTM_API vrtm_status vrtm_asset_create(vrtm_device device, const vrtm_mesh_desc *desc, vrtm_asset *asset);

// Destroys an asset and all of its tile handles. If another thread or a job is using the asset, a solve is cancelled,
// any other call runs to its end, and the memory is freed afterwards; this function does not wait. With a device's
// last asset, free pages of the process's heap go back to the system (on Linux with glibc, by malloc_trim).
VRTM_API
vrtm_status vrtm_asset_destroy(vrtm_asset asset);

// Names a tile. A plain value that never grows.
typedef struct vrtm_tile_key {
    // UDIM number: 1001 + U + 10 V.
    uint32_t udim;
    // UV set: 0 <= uv_set < vrtm_asset_info.uv_sets.
    uint32_t uv_set;
    // Layer within the UDIM number: 0 <= layer < layers.
    uint32_t layer;
    // Layers of the UDIM number: 1, or up to vrtm_mesh_desc.max_layers. vrtm_asset_find_tile ignores it.
    uint32_t layers;
} vrtm_tile_key;

// The tile of an asset with a key: one of UV set 0 without layers needs only `key->udim`, all else zero. Never busy.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT if there is no such tile.
VRTM_API
vrtm_status vrtm_asset_find_tile(vrtm_asset asset,
                                 const vrtm_tile_key *key,
                                 vrtm_tile *tile);

// Sets a tile's rigidity, for all of its layers: 0 is infinitely elastic, 1 as rigid as possible; values outside are
// clamped. The map may have any size; it is resampled to the grid. Null removes the map. A tile without one has the
// rigidity of the vertices (vrtm_asset_set_vertex_rigidity), and without that, too, does not move at all. The last
// result stays readable until the next solve. Only what depends on the rigidity is computed again, and charts whose
// rigidity stays the same keep their results; the tile is prepared from the start where a chart gains its first
// rigidity or loses its last, or where the grid gets another size.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_set_rigidity(vrtm_tile tile,
                                   const vrtm_image *rigidity);

/* ---- Frame ---- */

// Amount of work of a solve on each level of its grid.
typedef int32_t vrtm_quality;

// One correction on each level; on the finest, up to four for crowded charts, while they gain 0.3 % of the chart's
// energy. The default.
#define VRTM_QUALITY_NORMAL 0

// A preview: one correction on each level up to the one before the finest, so that the warp has half as many cells
// along each axis. With vrtm_solve_options.warm, relaxation of the last result on the finest level.
#define VRTM_QUALITY_DRAFT 1

// The size that rigid features have in a pose.
typedef int32_t vrtm_scale;

// Features keep their size at rest, in the units of the positions: for a body that inflates or swells. The default.
#define VRTM_SCALE_KEEP 0

// Features grow and shrink with the pose as a whole: rest lengths are multiplied by the pose's median stretch
// (vrtm_asset_report.scale). For a character under a scale control, and for poses in other units.
#define VRTM_SCALE_FOLLOW 1

// Method by which a solve finds its warp.
typedef int32_t vrtm_solver;

// Gauss-Newton corrections and relaxation, which never folds. The default.
#define VRTM_SOLVER_DESCENT 0

// The solver of the paper that the library follows: position-based dynamics on a hierarchy of grids (its section 4).
// For comparison: its result is returned unchecked, and may fold (vrtm_tile_report.folds) or be worse than the mesh's
// own UVs. Where it folds, a texel has several possible lookups and gets one of them. Nodes may leave their charts,
// and even the tile, by 0.08 of its side in the worst pose tested. Redirections stay within the tile.
#define VRTM_SOLVER_PBD 1

// Settings of VRTM_SOLVER_PBD, with the paper's names. A plain value that never grows.
typedef struct vrtm_pbd_settings {
    // Iterations on each level of the grid. Each projects all constraints once; every fourth is followed by a
    // regularisation. 1 to 1024; default 16.
    uint32_t iterations;
    // Fraction of its velocity that a node loses from one regularisation to the next. Without forces the time step
    // cancels out, so it is not a setting. 0 to 1; default 0.
    float damping;
    // Fraction of its turn that a segment takes back after its projection. 0 to 1; default 0.
    float orientation_preservation;
    // Smoothing of as-rigid-as-possible material (eq. 4). 0 to 1; default 0.8.
    float smoothing;
    // Factor on the corrections of each level over those of the next finer one. 0 to 1; default 0.7.
    float coarse_correction;
} vrtm_pbd_settings;

// A host's function that receives a solve's predicted progress, 0..1, which never decreases. If it returns a nonzero
// value, the solve is cancelled; one that succeeds reports 1 at its end, when it can no longer be cancelled. The
// function may call vrtm: results of the asset can be read, and calls that would change the asset give
// VRTM_ERROR_BUSY.
typedef uint32_t (*vrtm_progress_fn)(void *user, float progress);

// Options of one solve. Start from vrtm_solve_options_init(), which sets the defaults.
typedef struct vrtm_solve_options {
    // sizeof(vrtm_solve_options); set by vrtm_solve_options_init().
    uint32_t struct_size;
    // Amount of work of a solve. VRTM_SOLVER_PBD ignores this, `max_corrections` and `tolerance`, unchecked.
    // VRTM_QUALITY_NORMAL (0, the default) or VRTM_QUALITY_DRAFT.
    vrtm_quality quality;
    // Maximum corrections on the finest level, 1..64, in place of the quality's limit; 0 = the quality's own. With
    // more than four, a sweep more follows each, and a chart continues until one gains less than 0.01 %, or
    // `tolerance`: seven lower the energy by 0.3 % in the mean, for up to twice the time, and make some crowded charts
    // rougher over the pose.
    uint32_t max_corrections;
    // A chart is done when a correction gains less than this fraction of its energy (to which 6 % of the energy of the
    // original UVs is added), or when a level's first correction gains what its quadratic model predicts to a quarter
    // of that fraction; over 0 and under 1. 0 = the quality's own.
    float tolerance;
    // The time after which the call begins no further level of a grid; 0 = no limit. The work that is under way is
    // finished: one level's first step, at most half of a whole solve, then interpolation, the certificate and the
    // seams. The coarsest levels, up to 4,096 nodes each, are always solved. The result comes from the finest level
    // that was reached, certified, and is never worse than the identity; its report is `truncated`. A tile whose turn
    // comes after the end, or for which the time gave nothing better than the identity, keeps its last result (`kept`
    // and `truncated`) and is among the first in the next call. With a limit the result depends on the speed of the
    // machine. In milliseconds.
    float time_budget_ms;
    // 0 (the default): start from the identity, so that a frame's result depends on its inputs alone. 1: start from
    // the last result, for interactive use: faster on small changes, but it depends on the order of the frames.
    uint32_t warm;
    // With `warm` and VRTM_SOLVER_DESCENT: how strongly the warp is pulled towards the last result, in the unit of the
    // tile settings' smoothness; 0 = not at all. 0.03 to 0.3 is a useful range: 0.1 reduces jumps between frames to
    // between three quarters and a fifth, and delays the warp of a steady motion by one to two frames. Without `warm`
    // it has no effect. 0 to 1e6; default 0.
    float temporal_weight;
    // CPU threads of this solve, at most 1024; 0 = the device's. The result is the same bit for bit.
    uint32_t threads;
    // 1: also measure the strain on the mesh (in f64) and count painted features, for the tiles' reports. Slow.
    uint32_t measure;
    // Memory to release: a sum of VRTM_RELEASE_ flags; 0 (the default) = none, so that results can be read at any
    // time.
    uint32_t release;
    // Method by which the warp is found. VRTM_SOLVER_DESCENT (0, the default) or VRTM_SOLVER_PBD.
    vrtm_solver solver;
    // Settings of VRTM_SOLVER_PBD.
    vrtm_pbd_settings pbd;
    // The tiles to solve, in any order and also twice; null = all, an empty list = none. The others keep their
    // results.
    const vrtm_tile *tiles;
    // The length of `tiles`. Ignored when that is null.
    size_t tile_count;
    // The vertices that have moved since the last solve, in any order; null = any vertex may have moved. Tiles that
    // none of these vertices touches keep their results, unless they have no result yet, or their maps, settings or
    // these options have changed.
    const uint32_t *dirty_vertices;
    // The length of `dirty_vertices`. Ignored when that is null.
    size_t dirty_vertex_count;
    // Called about 500 times per second while the tiles are solved, on the thread that does the work: the calling
    // thread or the job's, or one of the executor's if the device has one. Null = no progress function.
    vrtm_progress_fn progress;
    // Passed to `progress` unchanged. Both must stay valid until the call returns, or the job is destroyed.
    void *progress_user;
    // 1, for vrtm_asset_submit only: the newest pose wins. A job or a solve that is using the asset is cancelled, the
    // call waits for its end, some milliseconds, and the new job takes its place, instead of VRTM_ERROR_BUSY. Calls of
    // several threads take their turns. 0 (the default) = the asset is busy, as it always is for a call from within
    // another one, such as from a progress function.
    uint32_t replace;
    // The size that features have in the pose. VRTM_SCALE_KEEP (0, the default) or VRTM_SCALE_FOLLOW.
    vrtm_scale scale;
} vrtm_solve_options;

// Content of a fetched image: two channels (u, v) per texel, 2 * width * height values, unless stated otherwise.
typedef int32_t vrtm_fetch_kind;

// The redirection map, the default: for a surface point's UV, the UV at which to sample the texture. Absolute within
// the tile (0..1, v up), at texel centres: where nothing moves, texel (x, y) from the corner (0, 0) holds ((x + 0.5) /
// width, (y + 0.5) / height). Use f32: from 1024 texels on, f16 cannot distinguish neighbouring texels.
#define VRTM_FETCH_REDIRECTION 0

// The redirection minus the texel's own centre: the offset to add to a UV; 0 where nothing moves. f16 is sufficient.
#define VRTM_FETCH_REDIRECTION_DELTA 1

// The warp, the inverse of the redirection: for a UV of the texture, the UV of the surface point that shows it,
// absolute within the tile (nodes of VRTM_SOLVER_PBD may lie a little outside of it). The outermost texels lie on the
// tile's border; with the grid's size plus one in both directions the texels are the grid's nodes. Between the nodes
// the warp is affine on two triangles per cell, split from the corner of least u and v to the corner of greatest. Use
// f32.
#define VRTM_FETCH_WARP 2

// The redirection plus the offset (U, V) of the UDIM tile: UVs in the mesh's own range, for lookups in a texture of
// several tiles. Use f32.
#define VRTM_FETCH_REDIRECTION_UDIM 3

// Four channels, 4 * width * height values: derivatives of the redirection (u', v') by the UV at texel centres,
// du'/du, du'/dv, dv'/du, dv'/dv; 1, 0, 0, 1 where nothing moves. Use them to rotate texture values that turn with a
// feature, such as tangent-space normals. f16 is sufficient.
#define VRTM_FETCH_JACOBIAN 4

// One channel, width * height values: the largest singular value of the Jacobian. The footprint of a lookup is at
// most this factor wider in the texture than on the surface: for renderers that derive their filter width from the
// mesh's own UVs. f16 is sufficient.
#define VRTM_FETCH_FILTER_SCALE 5

// UVs of another UV set, vrtm_fetch.uv_set, for meshes whose textures use another set than the warp is solved in:
// where the redirection leads to a point of the surface, the UV of that point in the other set, whatever its range.
// The map is looked up by the UVs of the tile's own set. 0 beside charts, but for a margin of two texels. Where the
// other set has a border inside a chart, look the map up without interpolation, or use the delta. Use f32. With 4
// channels, the fourth is 1 where a chart covers the texel's centre.
#define VRTM_FETCH_UV_SET 6

// As VRTM_FETCH_UV_SET, minus the UV in that set of the texel's own point of the surface: the offset to add to the UV
// that the textures use; 0 where nothing moves. f16 is sufficient. Works with textures that repeat.
#define VRTM_FETCH_UV_SET_DELTA 7

// No image: the points of `carrier` in the pose, written to `carried` as by vrtm_carrier_fetch.
#define VRTM_FETCH_CARRIED 8

// One output of a solve. Start from vrtm_fetch_init().
typedef struct vrtm_fetch {
    // sizeof(vrtm_fetch); set by vrtm_fetch_init(). All elements of an array must have the same value.
    uint32_t struct_size;
    // One of VRTM_FETCH_: REDIRECTION (0, the default), REDIRECTION_DELTA, WARP, REDIRECTION_UDIM, JACOBIAN,
    // FILTER_SCALE, UV_SET, UV_SET_DELTA, CARRIED. With CARRIED, all fields but `carrier` and `carried` are 0.
    vrtm_fetch_kind kind;
    // A tile of the asset. Required.
    vrtm_tile tile;
    // The destination, of as many channels as `kind` has. Required.
    const vrtm_image_out *image;
    // For VRTM_FETCH_UV_SET and VRTM_FETCH_UV_SET_DELTA: the UV set that the values are UVs of, 0 <= uv_set <
    // vrtm_asset_info.uv_sets. 0 (the default) for all other kinds.
    uint32_t uv_set;
    // Texels in u of the whole image, if `image` is a rectangle of a larger one, such as a band of one that does not
    // fit into memory. On the CPU, rectangles equal those of the whole image bit for bit. 0 (the default) = `image` is
    // the whole, as it must be for VRTM_FETCH_UV_SET and VRTM_FETCH_UV_SET_DELTA.
    uint32_t whole_width;
    // Texels in v of the whole image; 0 exactly if `whole_width` is.
    uint32_t whole_height;
    // First column of the rectangle in the whole image.
    uint32_t x;
    // First row of the rectangle in the whole image, counted in the order of image->origin.
    uint32_t y;
    // Must be 0.
    uint32_t reserved;
    // For VRTM_FETCH_CARRIED: a carrier of the asset.
    vrtm_carrier carrier;
    // For VRTM_FETCH_CARRIED: the destinations of its points.
    const vrtm_carried *carried;
} vrtm_fetch;

// Solves every tile for a pose and writes `count` outputs, in one call: all that a host's compute() needs for a frame.
// Equivalent to vrtm_asset_solve followed by vrtm_asset_fetch, except that all arguments are checked before any work,
// and nothing else can use the asset in between. `fetches` may be null if `count` is 0. No two outputs may write the
// same byte, but they may be interleaved, such as two pairs of channels of one image. No output may overlap the memory
// that the positions span.
//
// Errors: those of vrtm_asset_solve and vrtm_asset_fetch; VRTM_ERROR_INVALID_ARGUMENT for a tile or carrier of another
// asset.
VRTM_API
vrtm_status vrtm_asset_redirect(vrtm_asset asset,
                                const vrtm_array *positions,
                                const vrtm_solve_options *options,
                                const vrtm_fetch *fetches,
                                size_t count);

// Solves every tile for a pose; returns when all are done. `positions` are the deformed positions of all vertices (3
// components, as many and in the same order as at rest). `options` may be null: all defaults. On any error the last
// good result stays readable.
//
// The result is the same bit for bit for any number of threads, on any machine and in any floating-point mode, unless
// options->warm or options->time_budget_ms is set. Charts whose inputs have not changed keep their result at no
// cost, unless this solve or the last one is warm.
//
// Errors: VRTM_ERROR_CANCELLED; VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_asset_solve(vrtm_asset asset,
                             const vrtm_array *positions,
                             const vrtm_solve_options *options);

// Writes `count` outputs of an asset's last solve into the caller's memory. All are of one and the same solve, even if
// another one ends meanwhile. Any size is allowed; an output does not depend on other fetches. All tiles and carriers
// belong to one asset. No two outputs may write the same byte, but they may be interleaved, such as two pairs of
// channels of one image. `fetches` may be null if `count` is 0.
//
// Errors: VRTM_ERROR_NOT_SOLVED before a tile's first solve; VRTM_ERROR_UNSUPPORTED for an integer format, or a
// rectangle of UVs of another set; VRTM_ERROR_INVALID_ARGUMENT for channels that the kind does not have, a rectangle
// that is not inside the whole image, or outputs that overlap; those of vrtm_carrier_fetch. If a GPU fails while the
// outputs are written, some may be. Never busy.
VRTM_API
vrtm_status vrtm_asset_fetch(const vrtm_fetch *fetches,
                             size_t count);

// Writes the redirected UV of every face corner of the mesh in a UV set: `count` pairs (u, v), in corner order, with
// the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. For hosts that set UVs
// instead of reading a map. `count` is the number of corners, vrtm_asset_info.corners; `uvs` has room for 2 * count
// floats.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy. In tiles that have not been solved yet, the UVs
// are the mesh's own.
VRTM_API
vrtm_status vrtm_asset_fetch_corner_uvs(vrtm_asset asset,
                                        uint32_t uv_set,
                                        float *uvs,
                                        size_t count);

/* ==== Advanced ==== */

/* ---- Device ---- */

// Description of a device. Start from vrtm_device_info_init().
typedef struct vrtm_device_info {
    // sizeof(vrtm_device_info); set by vrtm_device_info_init().
    uint32_t struct_size;
    // The backend in use: VRTM_BACKEND_CPU or VRTM_BACKEND_GPU.
    vrtm_backend backend;
    // The processor's or adapter's name, UTF-8.
    char name[128];
    // Reason for the choice of this backend, a sentence, UTF-8. If the GPU was lost, the cause comes first.
    char reason[256];
    // CPU threads per solve.
    uint32_t threads;
    // Bytes that the prepared tiles of all assets of the device hold now, with their maps and solvers.
    uint64_t bytes_held;
} vrtm_device_info;

// Describes a device: its backend, why it was chosen, and how much memory its assets hold. Works even after the GPU
// was lost.
VRTM_API
vrtm_status vrtm_device_get_info(vrtm_device device,
                                 vrtm_device_info *info);

// A GPU that a device can be made on. Start from vrtm_adapter_info_init().
typedef struct vrtm_adapter_info {
    // sizeof(vrtm_adapter_info); set by vrtm_adapter_info_init().
    uint32_t struct_size;
    // 1 for an adapter that is emulated on the CPU (or does not identify as hardware): VRTM_BACKEND_AUTO never chooses
    // it. 0 otherwise.
    uint32_t software;
    // The adapter's name, UTF-8.
    char name[128];
    // The driver's name and version, UTF-8.
    char driver[128];
    // The graphics interface it is driven through: "Vulkan", "Direct3D 12" or "Metal".
    char api[16];
    // PCI vendor ID; 0 if the interface does not report it.
    uint32_t vendor;
    // PCI device ID of the vendor; 0 if the interface does not report it.
    uint32_t device;
    // Place on the PCI bus, domain:bus:device.function, hexadecimal; empty if the interface does not report it.
    char pci_bus[32];
    // 1 if `uuid` and `driver_uuid` are known: through Vulkan. 0 otherwise.
    uint32_t has_uuid;
    // VkPhysicalDeviceIDProperties::deviceUUID: the same for this GPU in all programs.
    uint8_t uuid[16];
    // VkPhysicalDeviceIDProperties::driverUUID: a host's memory can be imported (vrtm_tile_fetch_external) if both
    // UUIDs equal those of its own device.
    uint8_t driver_uuid[16];
    // 1 if `luid` is known: on Windows. 0 otherwise.
    uint32_t has_luid;
    // The LUID of Direct3D and DXGI, in memory order.
    uint8_t luid[8];
    // The number MTLDevice.registryID, in memory order; all bytes are 0 if the GPU is not driven through Metal.
    uint8_t registry_id[8];
} vrtm_adapter_info;

// Number of GPUs that a device can be made on: those that run compute shaders with at least WebGPU's default limits,
// through Vulkan, Direct3D 12 or Metal. Hardware is listed before software, discrete before integrated; the order is
// stable as long as the machine and its drivers do not change. 0 without a GPU or a driver. Each call loads the
// drivers, which takes tens of milliseconds.
VRTM_API
vrtm_status vrtm_adapter_count(uint32_t *count);

// Describes adapter `index`, 0 <= index < vrtm_adapter_count. Takes as long as vrtm_adapter_count.
VRTM_API vrtm_status vrtm_adapter_get_info(uint32_t index, vrtm_adapter_info *info);

/* ---- Threads of the host ---- */

// One of the library's tasks: the host runs it by calling it with the `data` that came with it.
typedef void (*vrtm_task_fn)(void *data, size_t index);

// A host's parallel loop, such as TBB's parallel_for: it calls `task(data, index)` for each index from 0 to `count` -
// 1, exactly once, on any threads and in any order, and returns when all of these calls have returned. Several threads
// may call it at once. The first task to begin does the work of the call, and the others help it, so the calling
// thread should run tasks too.
typedef void (*vrtm_parallel_for_fn)(void *user, size_t count, vrtm_task_fn task, void *data);

// A host's task queue: it calls `task(data, 0)` once, on any thread, immediately or later. It must return normally.
typedef void (*vrtm_spawn_fn)(void *user, vrtm_task_fn task, void *data);

// A host's threads, which do all work instead of the library's own threads, with the same results bit for bit. Start
// from vrtm_executor_init(). The functions and `user` must stay valid until the device, all of its assets and all of
// their jobs are destroyed.
typedef struct vrtm_executor {
    // sizeof(vrtm_executor); set by vrtm_executor_init().
    uint32_t struct_size;
    // Runs the parallel loops of solves and fetches; `count` is the number of threads that the device or the solve
    // asks for. Required.
    vrtm_parallel_for_fn parallel_for;
    // Runs jobs; null = the library starts a thread for each job.
    vrtm_spawn_fn spawn;
    // Passed unchanged to both functions.
    void *user;
} vrtm_executor;

/* ---- Asset ---- */

// Description of a mesh. Start from vrtm_asset_info_init().
typedef struct vrtm_asset_info {
    // sizeof(vrtm_asset_info); set by vrtm_asset_info_init().
    uint32_t struct_size;
    // UV sets, 1 or more. All counts that concern UVs are sums over the sets.
    uint32_t uv_sets;
    // Tiles with at least one triangle; each layer of a tile counts.
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
    // Untextured faces: without UVs, or not among the textured faces.
    uint64_t faces_untextured;
    // Faces skipped because they have fewer than 3 corners.
    uint64_t faces_skipped;
    // Faces left out because their UV centroid lies in no UDIM tile (u < 0, u >= 10 or v < 0).
    uint64_t faces_outside;
    // Faces with UVs outside their tile; the map is clipped to the tile.
    uint64_t clipped_faces;
    // Triangles dropped because their UVs have no area.
    uint64_t degenerate_triangles;
    // Sides of triangles at which a chart ends.
    uint64_t border_edges;
    // Edges inside charts whose two sides have different vertices: welded by position.
    uint64_t welded_edges;
    // Edges whose two sides have the same positions and nearly the same UVs, but are not connected: charts end there.
    // Nearly means within four times the tolerance of UVs, and a quarter of the triangles' least height. Either they
    // are deliberate cuts, or the mesh needs VRTM_WELD_POSITION, or its UVs are noisy compared with the size of its
    // triangles.
    uint64_t edges_apart;
    // Seams that are not an edge of any face.
    uint64_t seams_unused;
} vrtm_asset_info;

// Describes the mesh. Never busy.
VRTM_API vrtm_status vrtm_asset_get_info(vrtm_asset asset, vrtm_asset_info *info);

// The tile at `index`, 0 <= index < vrtm_asset_info.tiles, first those of UV set 0 in the order of their UDIM numbers,
// then those of set 1, and so on; the layers of a UDIM number follow one another. Never busy.
VRTM_API
vrtm_status vrtm_asset_get_tile(vrtm_asset asset,
                                uint32_t index,
                                vrtm_tile *tile);

/* ---- Tile ---- */

// Facts about a tile that need no solve. Start from vrtm_tile_info_init().
typedef struct vrtm_tile_info {
    // sizeof(vrtm_tile_info); set by vrtm_tile_info_init().
    uint32_t struct_size;
    // UDIM number: 1001 + U + 10 V.
    uint32_t udim;
    // The UV set that the tile belongs to.
    uint32_t uv_set;
    // The tile's layer within its UDIM number: 0 unless vrtm_mesh_desc.max_layers is over 1.
    uint32_t layer;
    // Layers of its UDIM number: 1 or more.
    uint32_t layers;
    // Charts in the tile: connected pieces of UV triangles.
    uint32_t charts;
    // Triangles in the tile.
    uint64_t triangles;
    // Sides of triangles at which a chart ends.
    uint64_t border_edges;
    // Edges inside charts whose two sides have different vertices: welded by position.
    uint64_t welded_edges;
    // Edges whose two sides nearly coincide but are not connected: see vrtm_asset_info.edges_apart.
    uint64_t edges_apart;
    // Cells of the grid in u. A grid of w x h cells has (w + 1) x (h + 1) nodes.
    uint32_t grid_width;
    // Cells of the grid in v.
    uint32_t grid_height;
    // Nodes of the grid that may move.
    uint64_t movable_nodes;
    // Fraction (0..1) of the covered nodes that more than one layer of triangles covers.
    float overlap;
    // Fraction (0..1) of the rigid nodes that cannot move: of the covered nodes with a rigidity of at least 0.5, those
    // that a border, an overlap or the mask fixes. Near 1, the rigidity map can have almost no effect.
    float fixed;
    // Rigid nodes: covered nodes with a rigidity of at least 0.5.
    uint64_t rigid_nodes;
    // Number of these under more than one triangle, as in charts of one layer that lie over one another.
    uint64_t rigid_overlapped;
    // Nodes inside charts that cannot move because of a gap in the UVs that welding closes, such as a slit narrower
    // than vrtm_mesh_desc.weld_uv_tolerance. Noise of the UVs makes none.
    uint64_t gap_nodes;
} vrtm_tile_info;

// Rule for texels that several charts of a tile share, or that a chart shares with itself. With
// vrtm_mesh_desc.max_layers over 1, charts share texels only where these layers do not suffice.
typedef int32_t vrtm_overlap;

// Shared texels do not move, so that nothing gets worse. The default.
#define VRTM_OVERLAP_FIXED 0

// The chart with the first face moves them: for mirrored halves that deform alike.
#define VRTM_OVERLAP_FIRST_FACE 1

// Treatment of seams, where the surface continues beyond a chart's border elsewhere in the UV plane.
typedef int32_t vrtm_seams;

// Nothing moves at a border, and any texture will do. The default.
#define VRTM_SEAMS_SHUT 0

// Each chart is solved together with the surface beyond its seams, laid out in its own plane up to
// vrtm_tile_settings.seam_reach. Redirections near a seam then lead over the border of the chart: the texture must
// show that surface there, as vrtm_tile_fetch_dilation with at least the same reach writes it. Open borders, and
// charts that overlap in a layer, stay as with VRTM_SEAMS_SHUT. Tiles that are solved in one call are brought together
// at their seams.
#define VRTM_SEAMS_CONTINUE 1

// As VRTM_SEAMS_SHUT, but a rigid feature that touches a border of its chart (with VRTM_OPEN_BORDERS_SLIDE: a seam)
// keeps its place as a whole, and its elastic surroundings give way. A feature is a connected region of nodes with a
// rigidity of at least 0.5. Any texture will do.
#define VRTM_SEAMS_KEEP 2

// Treatment of open borders, beyond which the surface ends: along an edge that only one face with texture has.
typedef int32_t vrtm_open_borders;

// Nothing moves at an open border. The surface may continue in another mesh, as a head's neck does. The default.
#define VRTM_OPEN_BORDERS_FIXED 0

// Texture slides along open borders, as if the surface were mirrored there, so that a feature at a border keeps its
// shape; any texture will do. Corners of more than 50 degrees stay in place, and so do ends of a chart's seam with
// itself. Unwelded edges count as open borders, and so do edges between faces of different sizes and edges beside
// faces without texture.
#define VRTM_OPEN_BORDERS_SLIDE 1

// A tile's settings. All have a working default; a change rebuilds only what depends on it. Start from
// vrtm_tile_settings_init(), which sets the defaults.
typedef struct vrtm_tile_settings {
    // sizeof(vrtm_tile_settings); set by vrtm_tile_settings_init().
    uint32_t struct_size;
    // Cells of the grid in u: the resolution of the solve. 0 = as many as resolve the rigid features, 20 across the
    // narrowest (method §1): 64 to 4096, and no finer than the rigidity map and 256, or than an equal share of the
    // device's memory budget and a GPU's buffers allow. Other numbers are rounded up to a multiple of 16, at most
    // 16384.
    uint32_t grid_width;
    // Cells of the grid in v: the resolution of the solve.
    uint32_t grid_height;
    // Who owns overlapped texels. VRTM_OVERLAP_FIXED (0, the default) or VRTM_OVERLAP_FIRST_FACE.
    vrtm_overlap overlap;
    // Smoothness of elastic material against the stiffness 1 of rigid material. Lower values keep the shape of rigid
    // features better, and make material of low rigidity more rigid. 0 to 1e6; default 0.02.
    float smoothness;
    // Smoothness of all material, which keeps every node's problem well-posed. 1e-6 to 1e6; default 0.0005.
    float smoothness_floor;
    // Weight that keeps rigid features from turning (the paper's section 4.2). 0 to 1e6; default 0.
    float orientation;
    // Addition to `orientation` where rigid features are dense, times that density (the mean rigidity, 0..1, over a
    // tent of half of the tile; the heuristic of the paper's figure 5). Sparse features then turn to keep their shape,
    // and dense ones keep their orientation. VRTM_SOLVER_PBD adds it to the fraction of its turn that a segment takes
    // back. 0 to 1e6; default 0.
    float orientation_density;
    // Weight of the penalty on cells that lose their area. 0 to 1e6; default 0.3.
    float room;
    // Fraction of a cell's area under which that penalty starts: a threshold of its corner Jacobians. 0 to 1; default
    // 0.4.
    float room_threshold;
    // Treatment of seams. VRTM_SEAMS_CONTINUE goes only with an `orientation_density` of 0. VRTM_SEAMS_SHUT (0, the
    // default), VRTM_SEAMS_CONTINUE or VRTM_SEAMS_KEEP.
    vrtm_seams seams;
    // Reach of charts beyond their seams with VRTM_SEAMS_CONTINUE, and beyond their open borders with
    // VRTM_OPEN_BORDERS_SLIDE, in UV: about the size of a large rigid feature. Over 0, at most 0.5. Default 0.03125.
    float seam_reach;
    // Treatment of open borders. VRTM_OPEN_BORDERS_SLIDE goes only with an `orientation_density` of 0.
    // VRTM_OPEN_BORDERS_FIXED (0, the default) or VRTM_OPEN_BORDERS_SLIDE.
    vrtm_open_borders open_borders;
    // Stiffness, 0..16, that a painted feature gains where it would come out worse than without the warp. At 0 all
    // features give way alike, and in a crowd some come out worse. For VRTM_SOLVER_DESCENT. 0 to 16; default 7.
    float harm;
} vrtm_tile_settings;

// Size of a grid. A plain value that never grows.
typedef struct vrtm_tile_grid {
    // Cells in u.
    uint32_t width;
    // Cells in v.
    uint32_t height;
} vrtm_tile_grid;

// Gets the key of a tile. Layers share their maps and settings: what is set for one of them holds for all. Never busy.
VRTM_API
vrtm_status vrtm_tile_get_key(vrtm_tile tile,
                              vrtm_tile_key *key);

// Gets the grid that a tile has with its present rigidity and settings: where vrtm_tile_settings.grid_width or
// grid_height is 0, the cells that resolve the rigid features. Unlike vrtm_tile_get_info, it does not prepare the
// tile: it takes some milliseconds after a change of the rigidity.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_get_grid(vrtm_tile tile,
                               vrtm_tile_grid *grid);

// Describes a tile. The first call, and the first after a change of map or settings, builds the tile's
// grid, which takes time.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API vrtm_status vrtm_tile_get_info(vrtm_tile tile, vrtm_tile_info *info);

// Updates a part of a tile's rigidity map, for instance after a brush stroke: `width` x `height` texels from the
// column `x` and the row `y`, in memory order. `rigidity` describes the whole map, with the size and the format of the
// one that was set; its other texels are not read. Updating a small part takes a small fraction of the time of setting
// the map, unless the tile has to be prepared from the start (vrtm_tile_set_rigidity).
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT if the tile has no map of this size and format; VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_update_rigidity(vrtm_tile tile,
                                      const vrtm_image *rigidity,
                                      uint32_t x,
                                      uint32_t y,
                                      uint32_t width,
                                      uint32_t height);

// Sets a tile's warp mask: points under a texel below 0.5 do not move. Null removes it. A tile without one has the
// mask of the vertices (vrtm_asset_set_vertex_mask), and without that, too, all may move: the default. In other
// respects as vrtm_tile_set_rigidity.
VRTM_API
vrtm_status vrtm_tile_set_mask(vrtm_tile tile,
                               const vrtm_image *mask);

// Sets the rigidity of the vertices (1 component, as many as vertices, 0..1), linear over each triangle. A tile with
// a map (vrtm_tile_set_rigidity) has that of its map, in whatever order the two are set. Null removes the values and
// leaves the maps. Without a map, the grid is chosen in the same way, up to 1024 x 1024 cells.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_asset_set_vertex_rigidity(vrtm_asset asset,
                                           const vrtm_array *rigidity);

// Sets the warp mask of the vertices (1 component, as many as vertices), linear over each triangle: points below 0.5
// do not move. A tile with a mask (vrtm_tile_set_mask) has its own, in whatever order the two are set. Null removes
// the values and leaves the tiles' masks.
//
// Errors: those of vrtm_asset_set_vertex_rigidity.
VRTM_API
vrtm_status vrtm_asset_set_vertex_mask(vrtm_asset asset,
                                       const vrtm_array *mask);

// Sets a tile's settings, for all of its layers. Null: all defaults.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API vrtm_status vrtm_tile_set_settings(vrtm_tile tile, const vrtm_tile_settings *settings);

// Gets a tile's settings, as set or the defaults. The struct can be passed to vrtm_tile_set_settings unchanged.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_get_settings(vrtm_tile tile,
                                   vrtm_tile_settings *settings);

// Freezes a tile (1) or unfreezes it (0): solves skip a frozen tile, so that it keeps its result, if it has one.
//
// Errors: VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_freeze(vrtm_tile tile,
                             uint32_t frozen);

// The predicted cost of preparing and solving a tile. Start from vrtm_tile_estimate_init().
typedef struct vrtm_tile_estimate {
    // sizeof(vrtm_tile_estimate); set by vrtm_tile_estimate_init().
    uint32_t struct_size;
    // Nodes of the grid that may move: time and memory grow with their number.
    uint64_t movable_nodes;
    // Bytes held once the tile is prepared: maps and grid.
    uint64_t prepared_bytes;
    // Bytes at the peak of preparing it.
    uint64_t preparing_bytes;
    // Bytes at the peak of a solve with VRTM_SOLVER_DESCENT. With a GPU this counts its memory and the host's.
    uint64_t solving_bytes;
} vrtm_tile_estimate;

// Estimates, to about a tenth, what preparing and solving a tile would take with its present maps and settings (on a
// grid of less than 1024 x 1024 cells, `prepared_bytes` may be a third too low). Takes a small fraction of the time
// and memory of preparing the tile, and keeps nothing but the charts' extensions with VRTM_SEAMS_CONTINUE or
// VRTM_OPEN_BORDERS_SLIDE. The same estimate is checked against a device's memory_budget before a tile is prepared.
//
// Errors: VRTM_ERROR_BUSY; VRTM_ERROR_UNSUPPORTED if the GPU's buffers are too small for the grid, with the largest
// size that fits, as in all calls that prepare a tile.
VRTM_API
vrtm_status vrtm_tile_get_estimate(vrtm_tile tile,
                                   vrtm_tile_estimate *estimate);

// Writes a prepared tile to the host's memory, for vrtm_tile_load on another machine or in a later session. Prepares
// the tile if necessary. `size` gets the number of bytes: call once with `data` null and `capacity` 0 to learn it,
// then with a buffer of that size. The bytes hold what is derived from mesh, maps and settings, not the mesh, maps and
// settings themselves.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT if `data` is neither null nor large enough; VRTM_ERROR_BUSY.
VRTM_API
vrtm_status vrtm_tile_save(vrtm_tile tile,
                           void *data,
                           size_t capacity,
                           size_t *size);

// Loads a tile that was prepared elsewhere, so that it need not be prepared here. Before this call, set the mesh, maps
// and settings that the tile was saved with; they are compared. `size` is the number of bytes. The bytes need not be
// trusted: anything but an intact saved tile is refused. The checksum is no signature: bytes that were forged together
// with it may give a different warp, which is certified like any other.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for bytes that are damaged, in another version of the format, or saved with
// another mesh, map or setting; VRTM_ERROR_BUSY. On any error the tile is as before.
VRTM_API
vrtm_status vrtm_tile_load(vrtm_tile tile,
                           const void *data,
                           size_t size);

/* ---- Results ---- */

// Writes the layer of every face in a UV set: which of the tiles with the face's UDIM number has its redirection (see
// vrtm_mesh_desc.max_layers); 0 for faces in no tile. `count` is the number of faces, vrtm_asset_info.faces. All
// corners of a face are in its layer. It depends on the mesh alone: no solve is needed, and once per mesh is enough.
// Make it an attribute of faces, by which a shader picks the layer's map. Never busy.
VRTM_API
vrtm_status vrtm_asset_fetch_face_layers(vrtm_asset asset,
                                         uint32_t uv_set,
                                         uint32_t *layers,
                                         size_t count);

// Accuracy of a redirection map that is read with bilinear interpolation. Errors are lengths in UV; multiplied by a
// texture's size they are in its texels. Start from vrtm_map_info_init().
typedef struct vrtm_map_info {
    // sizeof(vrtm_map_info); set by vrtm_map_info_init().
    uint32_t struct_size;
    // Quads of four neighbouring texel centres on which the interpolated map, in the numbers that a fetch writes, is
    // not one-to-one: 0 certifies that the map is one-to-one everywhere between the centres of the tile's outermost
    // texels.
    uint64_t folds;
    // Smallest Jacobian of the interpolated map at a corner of a quad (1 where nothing moves): greater than 0 if there
    // are no folds.
    double min_jacobian;
    // Root mean square error over the tile's charts, relative to the exact redirection.
    double error_rms;
    // 99th percentile of the error over the charts, rounded up by at most one percent.
    double error_p99;
    // Largest error in the charts.
    double error_max;
    // Width at which the map has no folds: the given size, or the first that works of two and four times that size,
    // then a half, a quarter and so on; 0 if no size was found. Larger maps often have more folds.
    uint32_t sufficient_width;
    // Height at which the map has no folds; see `sufficient_width`.
    uint32_t sufficient_height;
} vrtm_map_info;

// The kind, format and size of a redirection map to inspect. Start from vrtm_map_desc_init().
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
} vrtm_map_desc;

// Inspects the map that a vrtm_asset_fetch of this kind, size and format would write for the last result. A map
// samples the redirection at texel centres only, and a renderer's interpolation may fold where the warp squeezes.
// This function reports whether it folds, how far it is from the exact redirection, and which size suffices. It takes
// about as long as fetching the map and a second map of twice its size or the grid's. The map is computed on the CPU:
// if a GPU writes it, single quads that almost fold may be counted differently.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_UNSUPPORTED for an integer format;
// VRTM_ERROR_INVALID_ARGUMENT for a kind that is not a redirection. Never busy.
VRTM_API
vrtm_status vrtm_tile_inspect_map(vrtm_tile tile,
                                  const vrtm_map_desc *desc,
                                  vrtm_map_info *info);

/* ---- Solve ---- */

// For vrtm_solve_options.release: the last results of the solved tiles, before solving, 8 bytes per node of the blocks
// in use; they cannot be read until the solve succeeds.
#define VRTM_RELEASE_RESULTS 1

// For vrtm_solve_options.release: the memory of each tile's solver once the tile is solved, about 110 bytes per node,
// so that tiles which are solved one after the other need that of one; the next solve takes longer, as a first one
// does.
#define VRTM_RELEASE_SOLVERS 2

// Cancels the solve of an asset that is in progress, whether another thread's call or a job: it soon gives
// VRTM_ERROR_CANCELLED, and the last good result stays. A solve that already has its result is not cancelled. Does
// nothing if no solve is in progress. Never busy.
VRTM_API
vrtm_status vrtm_asset_cancel(vrtm_asset asset);

/* ---- Jobs ---- */

// For vrtm_job_wait: wait as long as it takes.
#define VRTM_FOREVER UINT32_MAX

// State of a job.
typedef int32_t vrtm_job_state;

// It has not begun, or is under way.
#define VRTM_JOB_RUNNING 0

// It has ended: vrtm_job_progress.status says how.
#define VRTM_JOB_DONE 1

// The state and progress of a job. Start from vrtm_job_progress_init().
typedef struct vrtm_job_progress {
    // sizeof(vrtm_job_progress); set by vrtm_job_progress_init().
    uint32_t struct_size;
    // VRTM_JOB_RUNNING (0) or VRTM_JOB_DONE.
    vrtm_job_state state;
    // Its result: VRTM_OK or an error; VRTM_OK while it is running.
    vrtm_status status;
    // Predicted fraction (0..1) of the work that is done; it never decreases.
    float progress;
    // Milliseconds from submission until now, or until the job ended.
    float ms;
} vrtm_job_progress;

// Begins to solve an asset for a pose, and returns at once, so that the host can keep drawing. Positions and options
// are copied; everything else is as in vrtm_asset_solve. The caller destroys `*job`. A viewport that only wants its
// newest pose sets options->replace.
//
// Until the job is done, it has exclusive use of the asset: calls that solve or change the asset give VRTM_ERROR_BUSY,
// and results and reports are those of the last solve. A job keeps what it needs alive: destroying the asset cancels
// it, destroying the device does not affect it. It runs in the host's queue if the device has an executor with
// `spawn`, and otherwise on a thread of its own, which ends with the job.
//
// Errors: those of vrtm_asset_solve, except those that occur while solving, which vrtm_job_wait returns;
// VRTM_ERROR_OUT_OF_MEMORY also if no thread can be started.
VRTM_API
vrtm_status vrtm_asset_submit(vrtm_asset asset,
                              const vrtm_array *positions,
                              const vrtm_solve_options *options,
                              vrtm_job *job);

// Waits until a job is done, for at most `timeout_ms` milliseconds; 0 returns at once, VRTM_FOREVER waits as long as
// it takes. Any number of threads may wait, and each may wait again afterwards.
//
// If no thread has begun the job yet, the first thread that waits with VRTM_FOREVER does its work.
//
// Returns what vrtm_asset_solve would have returned, with its message: VRTM_OK once the result can be read;
// VRTM_ERROR_CANCELLED after a cancel; VRTM_ERROR_TIMEOUT if the job is not done yet; VRTM_ERROR_BUSY on a thread that
// does the job's work, as in its own progress function.
VRTM_API
vrtm_status vrtm_job_wait(vrtm_job job,
                          uint32_t timeout_ms);

// Gets the state and progress of a job. Never waits.
VRTM_API vrtm_status vrtm_job_get_progress(vrtm_job job, vrtm_job_progress *progress);

// Cancels a job: it ends soon after with VRTM_ERROR_CANCELLED, and the asset keeps its last good result. A job that
// already has its result ends normally. Never waits.
VRTM_API
vrtm_status vrtm_job_cancel(vrtm_job job);

// Destroys a job. A job that is not done is cancelled. The call waits until the job and its thread have ended. Destroy
// all jobs before the library is unloaded.
//
// Errors: VRTM_ERROR_BUSY on a thread that does the job's work, as in its own progress function.
VRTM_API
vrtm_status vrtm_job_destroy(vrtm_job job);

/* ---- Reports ---- */

// Statistics of strain: deformed length over rest length, minus 1, of segments that are fixed in the texture. A plain
// value that never grows.
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

// A painted feature that is worse than without the warp: its error rose by more than 0.02. A plain value that never
// grows.
typedef struct vrtm_worst_feature {
    // Centre in u, among all tiles: the mean over its nodes.
    float u;
    // Centre in v, among all tiles: the mean over its nodes.
    float v;
    // Area in UV units: that of the tile is 1.
    float area;
    // RMS strain of its segments with the mesh's own UVs.
    float before;
    // RMS strain of its segments with the warp.
    float after;
    // 1 if a chart's border, a seam or an open one, touches it.
    uint32_t at_border;
} vrtm_worst_feature;

// A tile's last solve. Start from vrtm_tile_report_init().
typedef struct vrtm_tile_report {
    // sizeof(vrtm_tile_report); set by vrtm_tile_report_init().
    uint32_t struct_size;
    // UDIM number: 1001 + U + 10 V.
    uint32_t udim;
    // Cells of the grid in u.
    uint32_t grid_width;
    // Cells of the grid in v.
    uint32_t grid_height;
    // Energy of the identity, summed over the charts that were solved or reused, on the finest level that was worked
    // on: level 1 for a draft, a coarser one if time was up there.
    double energy_before;
    // Energy of the result, on the same level.
    double energy;
    // Smallest corner Jacobian of the result (1 at rest), computed in double precision (on a GPU in single precision
    // minus a bound of the rounding error, so never too large): greater than 0 certifies that the warp is one-to-one
    // and onto.
    double min_jacobian;
    // Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    uint64_t folds;
    // Length of the longest displacement, in cells.
    float max_displacement;
    // 1 if the time budget ended the solve early, or left no time for the tile.
    uint32_t truncated;
    // 1 if the asset's last solve left the tile as it was: it was frozen, not requested, or touched by no dirty
    // vertex, or the time budget left no time for it (then it is `truncated`, too). The other fields then describe the
    // tile's own last solve.
    uint32_t kept;
    // Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    uint32_t welds_torn;
    // Charts in the tile.
    uint32_t charts;
    // Charts solved in this call.
    uint32_t charts_active;
    // Charts that kept their last result because none of their inputs changed.
    uint32_t charts_reused;
    // Charts whose warp is the identity: nothing rigid, nothing movable, no extent at rest, or deformed without
    // strain.
    uint32_t charts_identity;
    // Charts that fell back to the identity because nothing better was found.
    uint32_t charts_fallback;
    // With VRTM_SEAMS_CONTINUE: charts that do not fully agree with their neighbours at seams, because a cell would be
    // crushed.
    uint32_t charts_apart;
    // Levels of the grid that the solver works on.
    uint32_t levels;
    // Blocks of 16 x 16 nodes that were visited on the finest level.
    uint64_t blocks_active;
    // All blocks of the tile.
    uint64_t blocks;
    // Movable nodes of the solved charts on the finest level.
    uint64_t nodes_active;
    // Relaxation sweeps of the schedule, or iterations of VRTM_SOLVER_PBD, over all levels (without those after a
    // partial step that was rejected).
    uint32_t sweeps;
    // Gauss-Newton corrections of the schedule, over all levels; charts that gain too little skip the last ones.
    uint32_t corrections;
    // Node updates by relaxation sweeps or iterations, over all levels. On a GPU this assumes that the whole schedule
    // ran, and that each level has a quarter of the next finer one's nodes.
    uint64_t node_updates;
    // Bytes held for this tile: maps, state, result.
    uint64_t bytes;
    // Milliseconds: positions to triangles and their metrics. The times of stages are measured on the device; on a GPU
    // without timestamps they are 0, and only the total is known.
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
    // Milliseconds: bringing charts together at seams.
    float ms_blend;
    // Milliseconds: the whole solve of this tile, without measuring strain.
    float ms_total;
    // Milliseconds: the latest inversion of the warp; not part of the total.
    float ms_invert;
    // With VRTM_SEAMS_CONTINUE or VRTM_OPEN_BORDERS_SLIDE: texels in charts whose redirection was limited in the
    // latest image, or part of one, since it would have led over the border of the chart into texture of another
    // chart.
    uint64_t texels_limited;
    // By how much at most, in texels of that image.
    float max_limit;
    // 1 if the solve measured strain; otherwise this and the fields below are 0. They describe segments between
    // neighbouring nodes whose rigidity is over half of the tile's largest at both ends: `strain_fixed` and
    // `segments_fixed` cover the segments that a border, an overlap or the mask fixes at both ends. A feature is a
    // connected set of such nodes of one chart with at least 12 segments, of both kinds; its error is the RMS strain
    // of these. All other fields cover the segments that are not fixed.
    uint32_t measured;
    // Strain with the mesh's own UVs.
    vrtm_strain before;
    // Strain with the warp.
    vrtm_strain after;
    // Fraction (0..1) of the segments whose strain rose by more than 0.25.
    float harm;
    // Fraction of the segments whose strain fell by more than 0.10.
    float help;
    // RMS strain of the segments that are fixed at both ends; the warp does not change it. The mean square over all
    // rigid segments is that of both kinds, weighted by `segments` and `segments_fixed`.
    float strain_fixed;
    // Segments that are not fixed at both ends.
    uint64_t segments;
    // Segments that are fixed at both ends.
    uint64_t segments_fixed;
    // Painted features.
    uint32_t features;
    // Painted features that are worse than without the warp: their error rose by more than 0.02.
    uint32_t features_worse;
    // Painted features whose error is over 0.05 with the mesh's own UVs.
    uint32_t features_strained_before;
    // Painted features whose error is over 0.05 with the warp.
    uint32_t features_strained_after;
} vrtm_tile_report;

// An asset's last solve, over all tiles. Start from vrtm_asset_report_init().
typedef struct vrtm_asset_report {
    // sizeof(vrtm_asset_report); set by vrtm_asset_report_init().
    uint32_t struct_size;
    // Tiles in the asset.
    uint32_t tiles;
    // Tiles with at least one chart solved in the last call.
    uint32_t tiles_active;
    // Tiles with a result that the last call left as it was: frozen, not requested, touched by no dirty vertex, or
    // without time. Their charts count as reused.
    uint32_t tiles_kept;
    // Charts solved.
    uint32_t charts_active;
    // Charts that kept their last result because none of their inputs changed.
    uint32_t charts_reused;
    // Charts whose warp is the identity.
    uint32_t charts_identity;
    // Movable nodes of the solved charts.
    uint64_t nodes_active;
    // Smallest corner Jacobian over all tiles: greater than 0 certifies that no warp folds.
    double min_jacobian;
    // Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    uint64_t folds;
    // Bytes held for the asset.
    uint64_t bytes;
    // Wall-clock milliseconds of the last solve, without measuring strain.
    float ms_total;
    // 1 if the time budget ended a tile's solve early, or left no time for it.
    uint32_t truncated;
    // Median ratio of posed length to rest length, over a few thousand edges, which VRTM_SCALE_FOLLOW multiplies the
    // rest lengths by. Without that, the log warns if it is over 3 or under 1/3: the pose probably has other units, or
    // its vertices are in another order.
    float scale;
    // Share (0..1) of these edges that are more than 3 times as long as at rest (with VRTM_SCALE_FOLLOW: times
    // `scale`). If it is over 0.05, the log warns: the pose's vertices are probably in another order than the mesh's.
    float stretched_share;
    // Spread of these ratios: 95 % of them are within this fraction of `scale` from it. Under 0.001 all edges share
    // one factor, and the pose is the mesh at another size, moved or bent.
    float scale_spread;
    // 0.
    uint32_t reserved;
} vrtm_asset_report;

// Reports on a tile's last solve.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
VRTM_API vrtm_status vrtm_tile_get_report(vrtm_tile tile, vrtm_tile_report *report);

// Writes the painted features of a tile that are worse than without vrtm in its last solve, those whose error rose
// most first, to `features`, which has room for `capacity` of them. `count` gets their number: at most 16, and 0 if
// the solve did not measure. With `features` null and `capacity` 0 nothing else is written.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
VRTM_API
vrtm_status vrtm_tile_get_worst_features(vrtm_tile tile,
                                         vrtm_worst_feature *features,
                                         size_t capacity,
                                         uint32_t *count);

// Reports on an asset's last solve, over all tiles.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
VRTM_API vrtm_status vrtm_asset_get_report(vrtm_asset asset, vrtm_asset_report *report);

/* ---- Defaults for other languages ---- */

// Writes a struct's defaults, as its _init() function does, for languages that cannot call C's inline functions.
// `name` is the struct's name, such as "vrtm_solve_options"; `size` is the size of the caller's struct in bytes, which
// becomes its struct_size. Fields that this library does not know become zero.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for a name of no struct with a struct_size, or a size that it never had.
VRTM_API
vrtm_status vrtm_defaults(const char *name,
                          void *value,
                          size_t size);

/* ==== Experimental: may change in a minor version ==== */

/* ---- Memory of the host ---- */

// A host's function that allocates: `size` bytes (at least 4096) at a multiple of `alignment` (a power of two, at
// least 16), or null if there is no memory. The bytes need not be zero.
typedef void *(*vrtm_alloc_fn)(void *user, size_t size, size_t alignment);

// A host's function that frees memory, given the size and alignment of its allocation. Never called with null.
typedef void (*vrtm_free_fn)(void *user, void *pointer, size_t size, size_t alignment);

// A host's allocator, for all memory of a device that is sized by user input. Blocks of at least 4 KiB come from it;
// smaller ones come from the system, as does the memory of a GPU's driver. Start from vrtm_allocator_init().
//
// Both functions are called on any thread that works in a call, also by several at once, and must not call vrtm. They
// and `user` must stay valid until the device and all of its assets are destroyed; by then everything has been freed.
// If `alloc` returns null, the call fails with VRTM_ERROR_OUT_OF_MEMORY.
typedef struct vrtm_allocator {
    // sizeof(vrtm_allocator); set by vrtm_allocator_init().
    uint32_t struct_size;
    // Allocates.
    vrtm_alloc_fn alloc;
    // Frees.
    vrtm_free_fn free;
    // Passed unchanged to both functions.
    void *user;
} vrtm_allocator;

/* ---- Images in memory of the host's GPU ---- */

// The kind of handle that a host has exported its memory as.
typedef int32_t vrtm_external_kind;

// A file descriptor from vkGetMemoryFdKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT: on Linux.
#define VRTM_EXTERNAL_OPAQUE_FD 1

// An NT handle from vkGetMemoryWin32HandleKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_WIN32_BIT: on Windows.
// Compiled, but never run by the authors of this version.
#define VRTM_EXTERNAL_OPAQUE_WIN32 2

// An output image in memory of the host's own Vulkan device: rows of texels of two floats each, laid out as in a
// buffer that shaders read or that is copied to an image (VK_FORMAT_R32G32_SFLOAT, with f16 VK_FORMAT_R16G16_SFLOAT).
// Start from vrtm_external_image_init().
//
// The host allocates the memory with VkExportMemoryAllocateInfo, without VkMemoryDedicatedAllocateInfo, on a device
// whose deviceUUID and driverUUID equal those of the adapter (vrtm_adapter_info), as Vulkan requires.
typedef struct vrtm_external_image {
    // sizeof(vrtm_external_image); set by vrtm_external_image_init().
    uint32_t struct_size;
    // One of VRTM_EXTERNAL_. Required.
    vrtm_external_kind handle_kind;
    // The file descriptor, or the handle's bits. The caller keeps ownership: the library imports a duplicate of a
    // descriptor, so that the same descriptor can be passed again for the next frame, and the caller closes it.
    uint64_t handle;
    // VkMemoryAllocateInfo::allocationSize of the memory. Required.
    uint64_t memory_size;
    // VkMemoryAllocateInfo::memoryTypeIndex of the memory.
    uint32_t memory_type;
    // VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16, which is for the delta and takes half of the bytes.
    vrtm_pixel_format format;
    // Texels in u, at least 1.
    uint32_t width;
    // Texels in v, at least 1.
    uint32_t height;
    // VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    vrtm_origin origin;
    // Bytes from the start of the memory to the first texel of the first row, a multiple of a texel's: 8, with f16 4.
    uint64_t offset;
    // Bytes from one row to the next, a multiple of a texel's; 0 = tightly packed. Bytes between rows are not written.
    uint64_t row_stride;
} vrtm_external_image;

// Writes a redirection of the last solve into memory of the host's own Vulkan device, which must be the same GPU
// (vrtm_device_desc.adapter_by), without copying through the CPU. The texels equal those of vrtm_asset_fetch bit for
// bit. Kinds: REDIRECTION, REDIRECTION_DELTA and REDIRECTION_UDIM, of two channels.
//
// Nothing on the host's device may use the texels during the call. The call returns when the GPU has written them, so
// that the host needs no semaphore. docs/hosts.md says how a buffer with exclusive sharing is handed over.
//
// Errors: those of vrtm_asset_fetch; VRTM_ERROR_UNSUPPORTED if the asset's device is the CPU, for other kinds and
// formats, and for handles that this GPU, its driver or this system does not import; VRTM_ERROR_INVALID_ARGUMENT for
// an offset or stride that is no multiple of a texel, memory that is too small, a handle that does not refer to
// memory, or a memory type that cannot hold buffers. After VRTM_ERROR_DEVICE_LOST the texels are undefined.
VRTM_API
vrtm_status vrtm_tile_fetch_external(vrtm_tile tile,
                                     vrtm_fetch_kind kind,
                                     const vrtm_external_image *image);

/* ---- Dilation of textures ---- */

// Writes what a texture must hold around a tile's charts, so that a lookup beside a seam shows what the surface shows
// there: for each texel whose centre lies beside the charts, up to about `reach` from a seam, the UV of the texel to
// copy from, in the mesh's own range as with VRTM_FETCH_REDIRECTION_UDIM; for all other texels their own centre.
// `reach` is a length in UV, over 0 and at most 0.5. Two to four channels: u, v, 0, and 1 in charts and where a UV was
// found, 0 elsewhere. Use f32. It depends on the rest positions and the UVs alone: no solve is needed, and once per
// mesh and size is enough. Triangles that would come out mirrored, or with less than a quarter or more than four times
// the chart's area at its border, are left out.
//
// Errors: VRTM_ERROR_UNSUPPORTED for an integer format. Never busy.
VRTM_API
vrtm_status vrtm_tile_fetch_dilation(vrtm_tile tile,
                                     double reach,
                                     const vrtm_image_out *image);

/* ---- Refinements ---- */

// Settings of a refinement. Start from vrtm_refinement_desc_init(), which sets the defaults.
typedef struct vrtm_refinement_desc {
    // sizeof(vrtm_refinement_desc); set by vrtm_refinement_desc_init().
    uint32_t struct_size;
    // The UV set, less than vrtm_asset_info.uv_sets.
    uint32_t uv_set;
    // Largest error of linear interpolation on a triangle, in UV of a tile, over 0 and at most 1; default 1/2048, half
    // a texel of a texture of 1024. Halving it needs up to three times as many triangles.
    double tolerance;
    // Maximum number of triangles of the refined mesh, where a polygon of n corners counts as n - 2; 0 = a million
    // more than the mesh has. If the limit is reached, the largest errors are split first.
    uint64_t max_triangles;
} vrtm_refinement_desc;

// Sizes and accuracy of a refinement. Start from vrtm_refinement_info_init().
typedef struct vrtm_refinement_info {
    // sizeof(vrtm_refinement_info); set by vrtm_refinement_info_init().
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
    // Bytes held by the refinement, excluding the mesh and the results.
    uint64_t bytes;
    // The tolerance, in UV of a tile.
    double tolerance;
    // Largest remaining error, in UV of a tile, for the result that the refinement was created or last extended for.
    double error;
    // 1 if `error` is within the tolerance; otherwise there were too many triangles.
    uint32_t reached;
    // Milliseconds that the creation or the last extension took.
    float ms;
} vrtm_refinement_info;

// Destinations of the pattern of a refinement: the caller's arrays; null arrays are skipped. From the pattern
// a host interpolates positions and all other values per vertex or corner. Start from
// vrtm_refinement_pattern_init().
//
// Each vertex and corner has three sources, with weights that add up to 1. If fewer are needed, the others repeat the
// first source with weight 0.
typedef struct vrtm_refinement_pattern {
    // sizeof(vrtm_refinement_pattern); set by vrtm_refinement_pattern_init().
    uint32_t struct_size;
    // vrtm_refinement_info.vertices: the room in the arrays by vertex.
    size_t vertex_count;
    // vrtm_refinement_info.faces: the room in the arrays by face.
    size_t face_count;
    // vrtm_refinement_info.corners: the room in the arrays by corner.
    size_t corner_count;
    // Three per vertex: vertices of the mesh. The mesh's own vertices come first, in their original order, each its
    // own source.
    uint32_t *vertex_sources;
    // Three per vertex: the weights of `vertex_sources`.
    float *vertex_weights;
    // One per face: the face of the mesh that contains it. Faces are sorted by the mesh's faces.
    uint32_t *face_sources;
    // One per face: its number of corners. 3 for a part of a face; an unsplit face keeps its number of corners.
    uint32_t *face_corners;
    // One per corner: the index of its vertex.
    uint32_t *corner_vertices;
    // Three per corner: corners of the mesh that form the triangle containing it.
    uint32_t *corner_sources;
    // Three per corner: the weights of `corner_sources`.
    float *corner_weights;
    // Two per corner: its original UV in the set, with the tile's offset: the weighted sum of its sources' UVs.
    float *corner_uvs;
} vrtm_refinement_pattern;

// Refines the mesh of an asset for its last result, for hosts that support only UV sets. Where the mesh is coarser
// than the painted detail, its own corner UVs recover less than the map, since a renderer interpolates linearly
// between corners. Here triangles are split until the interpolated UV is nowhere farther from the redirection than the
// tolerance.
//
// Edges are split at their midpoints, in all faces that share them, also across seams and chart borders: no cracks
// open, and no angle gets much smaller than half of the mesh's smallest one. A face that needs no split stays
// unchanged; a quadrilateral stays whole only if it keeps the tolerance along either diagonal. Where nothing moves,
// nothing is split. The pattern depends only on the result and on `desc`. `desc` may be null: the defaults.
//
// The caller destroys `*refinement`. It keeps the data that it needs alive, including the mesh and the last result,
// and may be used after the asset is destroyed. Never busy: it reads the last good result, even during a solve.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve.
VRTM_API
vrtm_status vrtm_refinement_create(vrtm_asset asset,
                                   const vrtm_refinement_desc *desc,
                                   vrtm_refinement *refinement);

// Refines further, for the asset's last result. Existing splits stay: a refinement that was extended for each frame
// of a shot has one topology for all frames. Vertices keep their numbers, and new ones are appended; faces and
// corners are renumbered. vrtm_refinement_get_info gives the new sizes. To keep the tolerance in all frames, repeat
// the pass over the frames until the number of triangles no longer changes: a split for one frame may push another
// slightly over the tolerance.
//
// Errors: VRTM_ERROR_BUSY while another call extends the same refinement. On any error the refinement is as it was.
VRTM_API
vrtm_status vrtm_refinement_extend(vrtm_refinement refinement);

// Gets the sizes and the accuracy of a refinement. Never busy.
VRTM_API vrtm_status vrtm_refinement_get_info(vrtm_refinement refinement, vrtm_refinement_info *info);

// Writes the pattern into the caller's arrays. It changes only when the refinement is extended. Never busy.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT if two arrays overlap.
VRTM_API
vrtm_status vrtm_refinement_fetch_pattern(vrtm_refinement refinement,
                                          const vrtm_refinement_pattern *pattern);

// Writes the redirected UV of every corner of the refined mesh in the asset's last result: `count` pairs (u, v), with
// the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. Call it after each frame's
// solve. At corners of the mesh the UVs equal those of vrtm_asset_fetch_corner_uvs bit for bit. `count` is the
// number of corners, vrtm_refinement_info.corners; `uvs` has room for 2 * count floats. Never busy.
//
// For a pose that the refinement was not created or extended for, the error may exceed the tolerance.
VRTM_API
vrtm_status vrtm_refinement_fetch_corner_uvs(vrtm_refinement refinement,
                                             float *uvs,
                                             size_t count);

// Destroys a refinement. Calls that are using it run to their end; the memory is freed afterwards.
VRTM_API vrtm_status vrtm_refinement_destroy(vrtm_refinement refinement);

/* ---- Carriers ---- */

// Kind of place by which the points of a carrier are given.
typedef int32_t vrtm_bind;

// `uvs`, among all tiles of the UV set, and `layers`; the default. A point less than 1.5e-5 beside a chart is put on
// its border.
#define VRTM_BIND_UV 0

// `corners`, three of one face for each point, and `weights`. For a triangle these are its three corners and
// barycentric coordinates; for a polygon any three, such as those of the host's own triangle.
#define VRTM_BIND_CORNERS 1

// `positions`: the nearest point of the surface at rest. What is left of the distance is kept in the point's frame,
// so that a detail mesh keeps its form.
#define VRTM_BIND_NEAREST 2

// Motion of points.
typedef int32_t vrtm_fit;

// Points of rigid features as one body each, all others with the surface under the warp. The default.
#define VRTM_FIT_FEATURE 0

// All points with the surface under the warp.
#define VRTM_FIT_SURFACE 1

// All points with the surface alone, as if nothing were redirected.
#define VRTM_FIT_NONE 2

// Binding of a point.
typedef int32_t vrtm_point_state;

// It stands on a chart. The default.
#define VRTM_POINT_BOUND 0

// No chart is there.
#define VRTM_POINT_OUTSIDE 1

// The UVs of the triangle there are turned over within their chart.
#define VRTM_POINT_FOLDED 2

// The surface is farther than the largest distance.
#define VRTM_POINT_FAR 3

// The points of a carrier. Start from vrtm_carrier_desc_init(). All arrays have an element for each point, and are
// copied before the call returns; those that `bind` does not name are ignored.
typedef struct vrtm_carrier_desc {
    // sizeof(vrtm_carrier_desc); set by vrtm_carrier_desc_init().
    uint32_t struct_size;
    // The UV set whose tiles carry the points: 0 <= uv_set < vrtm_asset_info.uv_sets.
    uint32_t uv_set;
    // One of VRTM_BIND_: UV (0, the default), CORNERS, NEAREST.
    vrtm_bind bind;
    // One of VRTM_FIT_: FEATURE (0, the default), SURFACE, NONE.
    vrtm_fit fit;
    // VRTM_BIND_UV: UVs, 2 components, with the tile's offset added, as in the mesh's own. `uvs->count`,
    // `weights->count` or `positions->count` is the number of points, which may be 0.
    const vrtm_array *uvs;
    // VRTM_BIND_UV: the layer of each point (vrtm_mesh_desc.max_layers); null = the first layer that has a chart
    // there.
    const uint32_t *layers;
    // VRTM_BIND_CORNERS: three corners of one face for each point, as corners of the mesh are counted.
    const uint32_t *corners;
    // VRTM_BIND_CORNERS: the weights of these corners, 3 components, of which only the ratio matters.
    const vrtm_array *weights;
    // VRTM_BIND_NEAREST: positions at rest, 3 components.
    const vrtm_array *positions;
    // VRTM_BIND_NEAREST: the largest distance from the surface, in the unit of the positions; 0 = any.
    double farthest;
    // The height of each point above the surface, in the unit of the positions, along the normal, which is
    // interpolated between vertices; 1 component; null = 0. Seen from its side, the corners of faces run
    // counter-clockwise.
    const vrtm_array *heights;
    // The frame of each point at rest, from which its rotations begin: quaternions x, y, z, w, 4 components, not all
    // of them 0; null = the axes of the mesh.
    const vrtm_array *frames;
    // Instead of `frames`: matrices row by row, 9 components, of which the rotation counts, not the scale. The axes
    // must not lie in a plane. A mirrored matrix stays mirrored in vrtm_carried.matrices; in vrtm_carried.rotations
    // it is rotated with its third axis turned over. Null = absent.
    const vrtm_array *matrices;
    // For hosts that know their pieces: the number of the piece that a point belongs to, which moves as one rigid
    // body; UINT32_MAX = none. Null = no pieces. A piece whose points lie on a line, as far as positions of f32 tell,
    // is none.
    const uint32_t *pieces;
    // The height up to which a point of a rigid body is blended from the surface (at height 0) to that body; 0 (the
    // default) = not at all.
    double skirt;
} vrtm_carrier_desc;

// Sizes of a carrier, and what its points are bound to. Start from vrtm_carrier_info_init().
typedef struct vrtm_carrier_info {
    // sizeof(vrtm_carrier_info); set by vrtm_carrier_info_init().
    uint32_t struct_size;
    // Milliseconds that the last fetch took.
    float ms;
    // Number of points.
    uint64_t points;
    // Points outside of all charts. They move with the surface nearest to them, without a warp.
    uint64_t outside;
    // Points on triangles whose UVs are turned over within their chart; they move with the surface as well.
    uint64_t folded;
    // Points farther from the surface than the largest distance; they move with the surface as well.
    uint64_t too_far;
    // Features that points moved with in the last fetch.
    uint64_t features;
    // The largest distance by which the rim of one of these features left the surface in the last fetch, lifted off or
    // cut in.
    double rim;
    // Bytes held by the carrier, excluding the mesh and the results.
    uint64_t bytes;
} vrtm_carrier_info;

// Binds points to the rest surface of an asset, for what is geometry on it and not painted: studs, scales, spikes,
// hair roots, decals. Curves and detail meshes are points, whose connectivity the host keeps.
//
// A carrier follows the solves that come after it was created. A point painted at UV p is where the texture at p is
// shown: at f(W(p)), exactly on the triangle there, f being the surface in the pose and W the warp. Its rotation is
// that of the tangents of f o W from rest to the pose, and its height is kept along the normal. With
// VRTM_FIT_FEATURE, points where the rigidity is over 0.75 move with their feature, a connected region with a
// rigidity over 0.5, as one rigid body, beyond seams as well; between 0.5 and 0.75 they are blended to the surface.
// Points that cannot be bound are counted in vrtm_carrier_info, and move with the surface alone.
//
// The caller destroys `*carrier`. It keeps the data that it needs alive, including the mesh and the last result, and
// may be used after the asset is destroyed. Never busy.
//
// Errors: VRTM_ERROR_INVALID_ARGUMENT for corners that are not of one face.
VRTM_API
vrtm_status vrtm_carrier_create(vrtm_asset asset,
                                const vrtm_carrier_desc *desc,
                                vrtm_carrier *carrier);

// Gets the sizes of a carrier, the points that could not be bound, and what the last fetch found. Never busy.
VRTM_API vrtm_status vrtm_carrier_get_info(vrtm_carrier carrier, vrtm_carrier_info *info);

// Carries the points into the pose of the asset's last solve, and writes what `carried` asks for. The result depends
// on that solve and on the carrier alone. Never busy: it reads the last good result, even during a solve.
//
// Errors: VRTM_ERROR_NOT_SOLVED before the first solve after vrtm_carrier_create, unless the asset had another carrier
// in its last one: poses from before are not kept; VRTM_ERROR_INVALID_ARGUMENT if elements overlap.
VRTM_API
vrtm_status vrtm_carrier_fetch(vrtm_carrier carrier,
                               const vrtm_carried *carried);

// Writes the state of each point, one of VRTM_POINT_, to `count` elements: vrtm_carrier_info.points. Never busy.
VRTM_API
vrtm_status vrtm_carrier_fetch_states(vrtm_carrier carrier,
                                      vrtm_point_state *states,
                                      size_t count);

// Destroys a carrier. Calls that are using it run to their end; the memory is freed afterwards.
VRTM_API vrtm_status vrtm_carrier_destroy(vrtm_carrier carrier);

/* ---- Initialisers: set struct_size and nonzero defaults; all else is zero ---- */

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
    value.room_threshold = 0.4f;
    value.seam_reach = 0.03125f;
    value.harm = 7.0f;)
VRTM_DEFINE_INIT_WITH_(vrtm_solve_options,
    value.pbd.iterations = 16;
    value.pbd.smoothing = 0.8f;
    value.pbd.coarse_correction = 0.7f;)
VRTM_DEFINE_INIT_WITH_(vrtm_refinement_desc,
    value.tolerance = 1.0 / 2048;)
VRTM_DEFINE_INIT_(vrtm_allocator)
VRTM_DEFINE_INIT_(vrtm_executor)
VRTM_DEFINE_INIT_(vrtm_device_desc)
VRTM_DEFINE_INIT_(vrtm_log_entry)
VRTM_DEFINE_INIT_(vrtm_device_info)
VRTM_DEFINE_INIT_(vrtm_adapter_info)
VRTM_DEFINE_INIT_(vrtm_array)
VRTM_DEFINE_INIT_(vrtm_image)
VRTM_DEFINE_INIT_(vrtm_image_out)
VRTM_DEFINE_INIT_(vrtm_asset_info)
VRTM_DEFINE_INIT_(vrtm_tile_info)
VRTM_DEFINE_INIT_(vrtm_tile_estimate)
VRTM_DEFINE_INIT_(vrtm_fetch)
VRTM_DEFINE_INIT_(vrtm_external_image)
VRTM_DEFINE_INIT_(vrtm_map_desc)
VRTM_DEFINE_INIT_(vrtm_map_info)
VRTM_DEFINE_INIT_(vrtm_job_progress)
VRTM_DEFINE_INIT_(vrtm_tile_report)
VRTM_DEFINE_INIT_(vrtm_asset_report)
VRTM_DEFINE_INIT_(vrtm_refinement_info)
VRTM_DEFINE_INIT_(vrtm_refinement_pattern)
VRTM_DEFINE_INIT_(vrtm_carrier_desc)
VRTM_DEFINE_INIT_(vrtm_carrier_info)
VRTM_DEFINE_INIT_(vrtm_array_out)
VRTM_DEFINE_INIT_(vrtm_carried)

#undef VRTM_DEFINE_INIT_
#undef VRTM_DEFINE_INIT_WITH_

#ifdef __cplusplus
} // extern "C"
#endif

#endif // VRTM_H
