/*
 * Every call of the library on a thread with the stack that the header asks for, 48 KiB, on the CPU: of two threads and of
 * one, so that the caller works itself.
 */

#define _GNU_SOURCE
#include "check.h"

#include <pthread.h>

enum { STACK = 48 * 1024 };

static sheet s;
static double pose[VERTICES][4];
static float map[2 * 300 * 200], warp[2 * (MAP + 1) * (MAP + 1)], corners[2 * CORNERS];
static uint32_t threads;

/* Returns null, or the name of the call that failed. */
static const char *all_calls(void)
{
    sheet_desc d;
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tile;
    vrtm_fetch fetches[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_image_out image = vrtm_image_out_init(), nodes = vrtm_image_out_init();
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = threads;
    sheet_describe(&s, &d);
    TRY(vrtm_device_create(&desc, &device))
    TRY(vrtm_asset_create(device, &d.mesh, &asset))
    TRY(find_udim(asset, 1001, &tile))
    TRY(vrtm_tile_set_rigidity(tile, &rigidity))
    TRY(vrtm_tile_set_mask(tile, &rigidity))
    TRY(vrtm_tile_set_mask(tile, NULL))
    settings.grid_width = settings.grid_height = 256;
    TRY(vrtm_tile_set_settings(tile, &settings))
    image.data = map;
    image.width = 300;
    image.height = 200;
    nodes.data = warp;
    nodes.width = nodes.height = MAP + 1;
    fetches[0].tile = fetches[1].tile = tile;
    fetches[0].image = &image;
    fetches[1].image = &nodes;
    fetches[1].kind = VRTM_FETCH_WARP;
    options.measure = 1;
    options.max_corrections = 7;
    for (int solver = 0; solver < 2; ++solver) {
        options.solver = solver == 0 ? VRTM_SOLVER_DESCENT : VRTM_SOLVER_PBD;
        for (options.warm = 0; options.warm < 2; ++options.warm) {
            options.temporal_weight = 0.1f;
            sheet_pose(&s, 3 + (int)options.warm, pose);
            TRY(vrtm_asset_redirect(asset, &positions, &options, fetches, 2))
            TRY(vrtm_asset_fetch_corner_uvs(asset, 0, corners, CORNERS))
        }
    }
    vrtm_tile_report report = vrtm_tile_report_init();
    TRY(vrtm_tile_get_report(tile, &report))
    TRY(vrtm_asset_destroy(asset))
    TRY(vrtm_device_destroy(device))
    return NULL;
}

static void *run(void *result)
{
    static char message[600];
    const char *wrong = all_calls();
    if (wrong != NULL) {
        snprintf(message, sizeof message, "%s", wrong);
        *(const char **)result = message;
    }
    return NULL;
}

int main(void)
{
    sheet_make(&s);
    for (threads = 1; threads <= 2; ++threads) {
        const char *wrong = NULL;
        pthread_attr_t attributes;
        pthread_t thread;
        pthread_attr_init(&attributes);
        if (!check_that(pthread_attr_setstacksize(&attributes, STACK) == 0, "a stack of 48 KiB", "refused") ||
            !check_that(pthread_create(&thread, &attributes, run, &wrong) == 0, "a thread with it", "refused")) {
            return finish();
        }
        pthread_join(thread, NULL);
        check_that(wrong == NULL, threads == 1 ? "all calls, alone" : "all calls, with a helper", wrong ? wrong : "");
        pthread_attr_destroy(&attributes);
    }
    return finish();
}
