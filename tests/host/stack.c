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
    vrtm_device_desc desc = vrtm_device_desc_init();
    scene made;
    vrtm_fetch fetches[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_image_out image = vrtm_image_out_init(), nodes = vrtm_image_out_init();
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = threads;
    const char *wrong = scene_make(&made, &s, &desc, 256);
    if (wrong != NULL) {
        return wrong;
    }
    TRY(vrtm_tile_set_mask(made.tile, &rigidity))
    TRY(vrtm_tile_set_mask(made.tile, NULL))
    image.data = map;
    image.width = 300;
    image.height = 200;
    nodes.data = warp;
    nodes.width = nodes.height = MAP + 1;
    fetches[0].tile = fetches[1].tile = made.tile;
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
            TRY(vrtm_asset_redirect(made.asset, &positions, &options, fetches, 2))
            TRY(vrtm_asset_fetch_corner_uvs(made.asset, 0, corners, CORNERS))
        }
    }
    vrtm_tile_report report = vrtm_tile_report_init();
    TRY(vrtm_tile_get_report(made.tile, &report))
    return scene_end(&made);
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
    static float expected[sizeof map / sizeof *map];
    sheet_make(&s);
    threads = 2;
    went_well("all calls on the main thread", all_calls());
    memcpy(expected, map, sizeof map);
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
        check_that(memcmp(expected, map, sizeof map) == 0, "the same bits", "other bits");
        pthread_attr_destroy(&attributes);
    }
    return finish();
}
