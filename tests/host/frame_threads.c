/*
 * How many threads a frame starts: this program's pthread_create takes the place of the system's for the library as well,
 * and counts. docs/hosts.md has the numbers.
 */

#define _GNU_SOURCE

#include "check.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>

enum { THREADS = 4, SIZE = 64 };

static atomic_long threads;

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *data)
{
    int (*system)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    *(void **)&system = dlsym(RTLD_NEXT, "pthread_create");
    atomic_fetch_add(&threads, 1);
    return system(thread, attributes, start, data);
}

/* Expects that so many threads were started since this was called last. */
static void started(long wanted, const char *name)
{
    const long count = atomic_exchange(&threads, 0);
    char detail[100];
    snprintf(detail, sizeof detail, "%ld threads", count);
    check_that(count == wanted, name, detail);
}

int main(void)
{
    static sheet s;
    static sheet_desc desc;
    static double points[VERTICES][4];
    static float map[SIZE * SIZE][2], uvs[CORNERS][2];
    vrtm_device_desc how = vrtm_device_desc_init();
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    vrtm_image_out image = vrtm_image_out_init();
    vrtm_image rigidity;
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tile;
    vrtm_array positions = sheet_positions(points);
    vrtm_job job;

    sheet_make(&s);
    sheet_describe(&s, &desc);
    rigidity = sheet_rigidity(&s);
    how.backend = VRTM_BACKEND_CPU;
    how.threads = THREADS;
    settings.grid_width = settings.grid_height = SIZE;
    image.width = image.height = SIZE;
    image.data = map;
    succeeds("a device", vrtm_device_create(&how, &device));
    succeeds("an asset", vrtm_asset_create(device, &desc.mesh, &asset));
    succeeds("its tile", find_udim(asset, 1001, &tile));
    succeeds("its grid", vrtm_tile_set_settings(tile, &settings));
    succeeds("its map", vrtm_tile_set_rigidity(tile, &rigidity));
    sheet_pose(&s, 1, points);

    started(0, "none by then");
    succeeds("the first frame", vrtm_asset_solve(asset, &positions, NULL));
    started(THREADS - 1, "the calling thread works, too");
    succeeds("its map", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    started(THREADS - 1, "as for a solve");
    succeeds("its UVs", vrtm_asset_fetch_corner_uvs(asset, 0, &uvs[0][0], CORNERS));
    started(THREADS - 1, "as for a solve");
    sheet_pose(&s, 2, points);
    succeeds("a further frame", vrtm_asset_solve(asset, &positions, NULL));
    started(THREADS - 1, "as for the first");
    succeeds("the same pose again", vrtm_asset_solve(asset, &positions, NULL));
    started(0, "none where there is nothing to do");
    sheet_pose(&s, 3, points);
    succeeds("a job", vrtm_asset_submit(asset, &positions, NULL, &job));
    succeeds("that is done", vrtm_job_wait(job, VRTM_FOREVER));
    started(THREADS, "one more, for the job");
    succeeds("the job's end", vrtm_job_destroy(job));
    succeeds("the asset's end", vrtm_asset_destroy(asset));
    succeeds("the device's end", vrtm_device_destroy(device));
    return finish();
}
