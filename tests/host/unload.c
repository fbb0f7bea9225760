/*
 * The library is loaded, used and unloaded several times, as a host does with a plug-in. Its path is the program's argument.
 *
 * The first round solves on the CPU from the main thread, the next two on a thread that ends before the unload: nothing of
 * the library stays in memory. The last round uses a GPU, if there is one, from the main thread: what a GPU's driver and
 * wgpu keep for a thread that lives on may keep the library, but the thread must not be harmed.
 */

#define _GNU_SOURCE
#include "check.h"

#include <dlfcn.h>
#include <pthread.h>

#define FUNCTIONS(X)           \
    X(vrtm_version)            \
    X(vrtm_last_error)         \
    X(vrtm_adapter_count)      \
    X(vrtm_device_create)      \
    X(vrtm_device_destroy)     \
    X(vrtm_asset_create)       \
    X(vrtm_asset_tile)         \
    X(vrtm_asset_destroy)      \
    X(vrtm_tile_set_rigidity)  \
    X(vrtm_asset_redirect)

#define MEMBER(name) __typeof__(&name) name;

static struct {
    FUNCTIONS(MEMBER)
} api;

static sheet s;
static float map[2 * MAP * MAP];
static vrtm_device stale;

/* Any pointer: no GPU is to be touched. */
static int cpu_alone;

/* Returns null, or a message that says what failed. With an argument it leaves GPUs alone. */
static void *use(void *without_gpu)
{
    static double pose[VERTICES][4];
    sheet_desc d;
    vrtm_device device;
    vrtm_asset asset;
    vrtm_fetch fetch = vrtm_fetch_init();
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_image_out image = vrtm_image_out_init();
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    options.quality = VRTM_QUALITY_DRAFT;
    sheet_describe(&s, &d);
    sheet_pose(&s, 4, pose);
    image.data = map;
    image.width = image.height = MAP;
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
    if (api.vrtm_device_create(without_gpu != NULL ? &gpu : NULL, &device) != VRTM_OK ||
        api.vrtm_asset_create(device, &d.mesh, &asset) != VRTM_OK ||
        api.vrtm_asset_tile(asset, 0, &fetch.tile) != VRTM_OK ||
        api.vrtm_tile_set_rigidity(fetch.tile, &rigidity) != VRTM_OK ||
        api.vrtm_asset_redirect(asset, &positions, &options, &fetch, 1) != VRTM_OK ||
        api.vrtm_asset_destroy(asset) != VRTM_OK || api.vrtm_device_destroy(device) != VRTM_OK) {
        static char message[600];
        snprintf(message, sizeof message, "%s", api.vrtm_last_error());
        return message;
    }
    stale = device;
    return NULL;
}

/* Whether a part of the library is in the process's memory, as far as the system tells. */
static int is_mapped(const char *path)
{
    const char *name = strrchr(path, '/');
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[4200];
    int found = 0;
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL) {
        found |= strstr(line, name != NULL ? name : path) != NULL;
    }
    if (maps != NULL) {
        fclose(maps);
    }
    return found;
}

int main(int count, char **arguments)
{
    static float first[2 * MAP * MAP];
    sheet_make(&s);
    /* Where the environment asks for a GPU, there is no round without one. */
    for (int round = getenv("VRTM_DEVICE") != NULL ? 1 : 0; round < 4; ++round) {
        const int on_a_thread = round == 1 || round == 2;
        void *library = count > 1 ? dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL) : NULL;
        if (!check_that(library != NULL, "load", count > 1 ? dlerror() : "the library's path is missing")) {
            return finish();
        }
#define LOOK_UP(name) *(void **)&api.name = dlsym(library, #name);
        FUNCTIONS(LOOK_UP)
        check_that(api.vrtm_version() == VRTM_VERSION, "version", "");
        const char *wrong = NULL;
        if (on_a_thread) {
            pthread_t thread;
            void *result = (void *)"no thread";
            if (pthread_create(&thread, NULL, use, NULL) == 0) {
                pthread_join(thread, &result);
            }
            wrong = result;
        } else {
            wrong = use(round == 0 ? &cpu_alone : NULL);
        }
        check_that(wrong == NULL, on_a_thread ? "solve on a thread" : "solve on the main thread",
                   wrong != NULL ? wrong : "");
        check_that(dlclose(library) == 0, "unload", "");
        if (round < 3) {
            check_that(dlopen(arguments[1], RTLD_NOW | RTLD_NOLOAD) == NULL, "it is gone from memory", "still there");
            check_that(!is_mapped(arguments[1]), "nothing of it is mapped", "still mapped");
        }
        /* The first round is the CPU's, which has other bits than a GPU. */
        if (round == 1) {
            memcpy(first, map, sizeof first);
        } else if (round > 1) {
            check_that(memcmp(first, map, sizeof first) == 0, "the same bits as before", "");
        }
    }
    return finish();
}
