/* Lets the n-th allocation of each step fail, n = 1, 2, 3 and so on, until the step succeeds. */

#ifndef ALLOCATE_ROUNDS_H
#define ALLOCATE_ROUNDS_H

#include "allocate_steps.h"

#include <stdatomic.h>

/* A hash of some bytes, on top of another. */
static uint64_t hash_bytes(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t at = 0; at < size; at += 8) {
        uint64_t word = 0;
        memcpy(&word, bytes + at, size - at < 8 ? size - at : 8);
        hash = (hash ^ word) * 0x9E3779B97F4A7C15u;
        hash ^= hash >> 29;
    }
    return hash;
}

/* A hash of all that calls have written. */
static uint64_t written(const work *w)
{
    uint64_t hash = 1469598103934665603u;
    hash = hash_bytes(hash, w->out, sizeof w->out);
    hash = hash_bytes(hash, w->out_half, sizeof w->out_half);
    hash = hash_bytes(hash, w->corners, sizeof w->corners);
    hash = hash_bytes(hash, w->carried, sizeof w->carried);
    hash = hash_bytes(hash, w->turned, sizeof w->turned);
    hash = hash_bytes(hash, w->saved, w->saved_size);
    return hash_bytes(hash, &w->saved_size, sizeof w->saved_size);
}

/* A hash of the last result, as a host can read it; 1 before the first one. */
static uint64_t last_result(const work *w)
{
    static float map[OUT * 2], corners[QUAD_CORNERS][2];
    static const vrtm_fetch_kind kinds[] = {VRTM_FETCH_REDIRECTION, VRTM_FETCH_WARP};
    uint64_t hash = 1469598103934665603u;
    if (w->asset.id == 0) {
        return 1;
    }
    for (int tile = 0; tile < MAX_TILES; ++tile) {
        vrtm_tile_report report = vrtm_tile_report_init();
        vrtm_status status = vrtm_tile_get_report(w->tiles[tile], &report);
        if (status != VRTM_OK) {
            return status == VRTM_ERROR_NOT_SOLVED || w->tiles[tile].id == 0 ? 1 : 2;
        }
        hash = hash_bytes(hash, &report.energy_before, sizeof report.energy_before);
        hash = hash_bytes(hash, &report.energy, sizeof report.energy);
        hash = hash_bytes(hash, &report.min_jacobian, sizeof report.min_jacobian);
        hash = hash_bytes(hash, &report.charts_active, sizeof report.charts_active);
        hash = hash_bytes(hash, &report.welds_torn, sizeof report.welds_torn);
        hash = hash_bytes(hash, &report.measured, sizeof report.measured);
        hash = hash_bytes(hash, &report.before, sizeof report.before);
        hash = hash_bytes(hash, &report.after, sizeof report.after);
        for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; ++k) {
            vrtm_image_out image = image_of(map, VRTM_PIXEL_F32);
            if (fetch_image(w->tiles[tile], kinds[k], &image) != VRTM_OK) {
                return 2;
            }
            hash = hash_bytes(hash, map, sizeof map);
        }
    }
    for (uint32_t set = 0; set < 2; ++set) {
        if (vrtm_asset_fetch_corner_uvs(w->asset, set, corners[0], QUAD_CORNERS) != VRTM_OK) {
            return 2;
        }
        hash = hash_bytes(hash, corners, sizeof corners);
    }
    return hash;
}

/* What the device has on its account. */
static uint64_t booked(const work *w)
{
    vrtm_device_info data = vrtm_device_info_init();
    return w->device.id != 0 && vrtm_device_get_info(w->device, &data) == VRTM_OK ? data.bytes_held : 0;
}

/* Which allocation of those to come fails, counted from 1; 0 = none. `and_later` lets all later ones fail as well. */
static atomic_long fails_at, allocations;
static atomic_int and_later;

/* Counts an allocation; tells whether it has to fail. */
static int is_to_fail(void)
{
    const long n = atomic_fetch_add(&allocations, 1) + 1, at = atomic_load(&fails_at);
    return at > 0 && (n == at || (n > at && atomic_load(&and_later)));
}

static void arm(long n)
{
    atomic_store(&allocations, 0);
    atomic_store(&fails_at, n);
}

/* Runs a step. */
static vrtm_status (*run_step)(int, work *) = run_plain;

/* What is wrong after a step that has failed, or null: nothing may have changed since before it. */
static const char *harm(vrtm_status status, const work *w, uint64_t result_before, uint64_t written_before)
{
    if (status != VRTM_ERROR_OUT_OF_MEMORY || strstr(vrtm_last_error(), "out of memory: ") == NULL) {
        return vrtm_last_error();
    }
    if (written(w) != written_before) {
        return "an output was written";
    }
    return last_result(w) != result_before ? "the last result has changed" : NULL;
}

/* What a run without failures has after each step. */
static struct {
    uint64_t result, written, booked;
    long allocations;
} expected[STEPS];

static void reference(int backend, const vrtm_allocator *allocator)
{
    static work w;
    work_begin(&w, backend, allocator);
    for (int k = 0; k < STEPS; ++k) {
        arm(0);
        if (!check_that(run_step(k, &w) == VRTM_OK, steps[k].name, vrtm_last_error())) {
            break;
        }
        expected[k].allocations = atomic_load(&allocations);

        expected[k].result = last_result(&w);
        expected[k].written = written(&w);
        expected[k].booked = booked(&w);
    }
    check_that(expected[STEPS - 1].result > 2, "a run without failures has a result", "");
    work_end(&w);
}

/* The rounds. With `most`, a step has about so many of them at most, evenly spaced. Returns the number of failures. */
static long rounds(int backend, const vrtm_allocator *allocator, int persistent, long most)
{
    static work w;
    char line[200];
    long all = 0;
    work_begin(&w, backend, allocator);
    atomic_store(&and_later, persistent);
    for (int k = 0; k < STEPS; ++k) {
        const uint64_t result_before = last_result(&w), written_before = written(&w);
        const long stride = most > 0 && expected[k].allocations > most ? expected[k].allocations / most : 1;
        const char *wrong = NULL;
        long failed = 0, counted = 0;
        for (long n = 1; wrong == NULL; n += stride) {
            vrtm_status status;
            arm(n);
            status = run_step(k, &w);
            counted = atomic_load(&allocations);
            arm(0);
            if (status == VRTM_OK) {
                break;
            }
            failed += 1;
            wrong = n > 100000 ? "it never succeeds" : harm(status, &w, result_before, written_before);
        }
        if (wrong == NULL && last_result(&w) != expected[k].result) {
            wrong = "the result has other bits";
        } else if (wrong == NULL && written(&w) != expected[k].written) {
            wrong = "other outputs";
        } else if (wrong == NULL && booked(&w) != expected[k].booked) {
            wrong = "other bytes are booked";
        }
        snprintf(line, sizeof line, "%s: %ld failures in %ld allocations%s", steps[k].name, failed, counted, persistent ? ", each with all later ones" : "");
        if (!check_that(wrong == NULL, line, wrong == NULL ? "" : wrong)) {
            printf("     the last message: %s\n", vrtm_last_error());
            break;
        }
        all += failed;
    }
    work_end(&w);
    return all;
}

#endif
