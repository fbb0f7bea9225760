/* The library's functions, looked up in a library that the host loads and unloads itself, and one use of them. */

#ifndef LOADED_H
#define LOADED_H

#include "platform.h"

#include "check.h"

#define FUNCTIONS(X)           \
    X(vrtm_version)            \
    X(vrtm_last_error)         \
    X(vrtm_adapter_count)      \
    X(vrtm_device_create)      \
    X(vrtm_device_destroy)     \
    X(vrtm_asset_create)       \
    X(vrtm_asset_get_tile)         \
    X(vrtm_asset_destroy)      \
    X(vrtm_tile_set_rigidity)  \
    X(vrtm_asset_solve)        \
    X(vrtm_asset_redirect)

#define MEMBER(name) __typeof__(&name) name;

static struct {
    FUNCTIONS(MEMBER)
} api;

static sheet s;
static float map[2 * MAP * MAP];
static vrtm_device stale;

/* Loads the library and looks its functions up; null if it cannot be loaded. */
static inline void *load(const char *path)
{
    void *library = platform_load(path);
    if (library != NULL) {
#define LOOK_UP(name)                                        \
    do {                                                     \
        void *const address = platform_symbol(library, #name); \
        memcpy(&api.name, &address, sizeof address);         \
    } while (0);
        FUNCTIONS(LOOK_UP)
    }
    return library;
}

static inline uint32_t cancel(void *calls, float progress)
{
    *(int *)calls += 1;
    return progress >= 0;
}

/* Any pointer: no GPU is to be touched. */
static int cpu_alone;

/* Returns null, or a message that says what failed. With an argument it leaves GPUs alone. */
static inline void *use(void *without_gpu)
{
    static double pose[VERTICES][4];
    sheet_desc d;
    vrtm_device device;
    vrtm_asset asset;
    int calls = 0;
    vrtm_fetch fetch = vrtm_fetch_init();
    vrtm_image rigidity = sheet_rigidity(&s);
    const vrtm_image_out image = sheet_map(map);
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init(), cancelled = options;
    options.quality = VRTM_QUALITY_DRAFT;
    cancelled.progress = cancel;
    cancelled.progress_user = &calls;
    sheet_describe(&s, &d);
    sheet_pose(&s, 4, pose);
    fetch.image = &image;
    if (stale.id != 0 && api.vrtm_device_destroy(stale) != VRTM_ERROR_INVALID_HANDLE) {
        return (void *)"a handle of the unloaded library was accepted";
    }
    /* GPU drivers that were loaded must not keep the library loaded. */
    uint32_t adapters = 0;
    vrtm_device_desc gpu = vrtm_device_desc_init();
    gpu.backend = VRTM_BACKEND_GPU;
    if (without_gpu == NULL && (api.vrtm_adapter_count(&adapters) != VRTM_OK ||
        (adapters > 0 && api.vrtm_device_create(&gpu, &device) == VRTM_OK &&
         api.vrtm_device_destroy(device) != VRTM_OK))) {
        return (void *)"a GPU cannot be counted, or made and destroyed";
    }
    gpu.backend = VRTM_BACKEND_CPU;
    gpu.threads = 2;
    if (api.vrtm_device_create(without_gpu != NULL ? &gpu : NULL, &device) != VRTM_OK ||
        api.vrtm_asset_create(device, &d.mesh, &asset) != VRTM_OK ||
        api.vrtm_asset_get_tile(asset, 0, &fetch.tile) != VRTM_OK ||
        api.vrtm_tile_set_rigidity(fetch.tile, &rigidity) != VRTM_OK ||
        api.vrtm_asset_redirect(asset, &positions, &options, &fetch, 1) != VRTM_OK) {
        static char message[600];
        snprintf(message, sizeof message, "%s", api.vrtm_last_error());
        return message;
    }
    /* A call that ends early unwinds, which has its own record of each thread. */
    sheet_pose(&s, 6, pose);
    const vrtm_status status = api.vrtm_asset_solve(asset, &positions, &cancelled);
    if (calls > 0 && status != VRTM_ERROR_CANCELLED) {
        return (void *)"a call was not cancelled";
    }
    if (api.vrtm_asset_destroy(asset) != VRTM_OK || api.vrtm_device_destroy(device) != VRTM_OK) {
        return (void *)"an asset or a device is not destroyed";
    }
    stale = device;
    return NULL;
}

#endif
