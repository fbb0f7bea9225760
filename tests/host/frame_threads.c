/*
 * How many threads a frame starts: this program's pthread_create takes the place of the system's for the library as well,
 * and counts. docs/hosts.md has the numbers.
 */

#define _GNU_SOURCE

#include "check.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>

enum { THREADS = 4 };

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
    static double points[VERTICES][4];
    static float map[2 * MAP * MAP], uvs[CORNERS][2];
    vrtm_device_desc how = vrtm_device_desc_init();
    scene made;
    vrtm_array positions = sheet_positions(points);
    vrtm_job job;

    sheet_make(&s);
    how.backend = VRTM_BACKEND_CPU;
    how.threads = THREADS;
    went_well("a scene", scene_make(&made, &s, &how, 64));
    sheet_pose(&s, 1, points);

    started(0, "none by then");
    succeeds("the first frame", vrtm_asset_solve(made.asset, &positions, NULL));
    started(THREADS - 1, "the calling thread works, too");
    succeeds("its map", fetch_map(made.tile, map));
    started(THREADS - 1, "as for a solve");
    succeeds("its UVs", vrtm_asset_fetch_corner_uvs(made.asset, 0, &uvs[0][0], CORNERS));
    started(THREADS - 1, "as for a solve");
    sheet_pose(&s, 2, points);
    succeeds("a further frame", vrtm_asset_solve(made.asset, &positions, NULL));
    started(THREADS - 1, "as for the first");
    succeeds("the same pose again", vrtm_asset_solve(made.asset, &positions, NULL));
    started(0, "none where there is nothing to do");
    sheet_pose(&s, 3, points);
    succeeds("a job", vrtm_asset_submit(made.asset, &positions, NULL, &job));
    succeeds("that is done", vrtm_job_wait(job, VRTM_FOREVER));
    started(THREADS, "one more, for the job");
    succeeds("the job's end", vrtm_job_destroy(job));
    went_well("the scene's end", scene_end(&made));
    return finish();
}
