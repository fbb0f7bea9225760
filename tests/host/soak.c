/*
 * Ten thousand solves, with assets, tiles and devices made and destroyed in between, as in a long session: at its end the
 * process has no more memory, threads and open files than after the first rounds, and no handle was given out twice. As
 * the system counts them. The number of solves may be given as an argument.
 */

#include "platform.h"

#include "check.h"

enum { SOLVES_PER_ASSET = 4, ASSETS_PER_DEVICE = 5, GRID = 32 };

static sheet s;
static double pose[VERTICES][4];
static float map[2 * MAP * MAP], corners[2 * CORNERS];
static unsigned char saved[1 << 20];
static uint64_t last_device, last_asset, last_tile;

/* Handles only grow: none is given out again. */
static int newer(uint64_t id, uint64_t *last)
{
    const int good = id > *last;
    *last = id;
    return good;
}

static const char *use(vrtm_asset asset, vrtm_tile tile, int round, int solves)
{
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    const vrtm_image_out image = sheet_map(map);
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_tile_report report = vrtm_tile_report_init();
    size_t size = 0;
    for (int k = 0; k < solves; ++k) {
        sheet_pose(&s, (round + k) % 7, pose);
        options.quality = (vrtm_quality)((round + k) % 2);
        options.measure = (uint32_t)(k == 1);
        options.warm = (uint32_t)(k == 2);
        options.solver = round % 9 == 8 ? VRTM_SOLVER_PBD : VRTM_SOLVER_DESCENT;
        TRY(vrtm_asset_solve(asset, &positions, &options))
        TRY(fetch_image(tile, (vrtm_fetch_kind)(k % 3), &image))
        TRY(vrtm_asset_fetch_corner_uvs(asset, 0, corners, CORNERS))
        TRY(vrtm_tile_get_report(tile, &report))
        /* Failures must not keep anything either. */
        positions.count -= 1;
        if (vrtm_asset_solve(asset, &positions, &options) != VRTM_ERROR_INVALID_ARGUMENT) {
            return "a solve with too few positions was not refused";
        }
        positions.count += 1;
    }
    TRY(vrtm_tile_update_rigidity(tile, &rigidity, 8, 8, 16, 16))
    TRY(vrtm_tile_save(tile, saved, sizeof saved, &size))
    TRY(vrtm_tile_load(tile, saved, size))
    return NULL;
}

/* One device with some assets; the solves of each. Returns null, or what went wrong. */
static const char *round_of(int round)
{
    scene scenes[ASSETS_PER_DEVICE];
    vrtm_device device;
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = (uint32_t)(1 + round % 3);
    TRY(vrtm_device_create(&desc, &device))
    if (!newer(device.id, &last_device)) {
        return "a device's handle was given out again";
    }
    for (int k = 0; k < ASSETS_PER_DEVICE; ++k) {
        scene *made = &scenes[k];
        made->device = device;
        const char *wrong = scene_on_device(made, &s, GRID);
        if (wrong == NULL && (!newer(made->asset.id, &last_asset) || !newer(made->tile.id, &last_tile))) {
            wrong = "an asset's or a tile's handle was given out again";
        }
        if (wrong == NULL) {
            wrong = use(made->asset, made->tile, round + k, SOLVES_PER_ASSET);
        }
        if (wrong != NULL) {
            return wrong;
        }
    }
    /* In another order than they were made, and half of them after their device. */
    for (int k = 0; k < ASSETS_PER_DEVICE; k += 2) {
        TRY(vrtm_asset_destroy(scenes[k].asset))
    }
    TRY(vrtm_device_destroy(device))
    for (int k = 1; k < ASSETS_PER_DEVICE; k += 2) {
        TRY(vrtm_asset_destroy(scenes[k].asset))
    }
    if (vrtm_asset_destroy(scenes[0].asset) != VRTM_ERROR_INVALID_HANDLE) {
        return "a destroyed asset can be destroyed again";
    }
    return NULL;
}

int main(int count, char **arguments)
{
    const int solves = count > 1 ? atoi(arguments[1]) : 10000;
    const int rounds = solves / (SOLVES_PER_ASSET * ASSETS_PER_DEVICE);
    long before = 0, most = 0;
    const int threads = platform_threads();
    int files = 0;
    char detail[200];
    sheet_make(&s);
    for (int round = 0; round < rounds; ++round) {
        const char *wrong = round_of(round);
        if (wrong != NULL) {
            check_that(0, "a round of a device and its assets", wrong);
            return finish();
        }
        if (round == rounds / 10) {
            /* Until then the allocator takes what it will keep. */
            before = platform_memory();
            files = platform_open_files();
        } else if (round > rounds / 10 && platform_memory() > most) {
            most = platform_memory();
        }
        if ((round + 1) % (rounds / 5) == 0) {
            snprintf(detail, sizeof detail, "%d KiB more than %ld, %d threads, %d files more", (int)(platform_memory() - before),
                     before, platform_threads(), platform_open_files() - files);
            check_that(platform_threads() == threads, "no thread is left", detail);
            check_that(files == 0 || platform_open_files() == files, "no file is open", detail);
            check_that(before == 0 || platform_memory() - before <= 1024, "memory stays flat", detail);
        }
    }
    snprintf(detail, sizeof detail, "%ld KiB at most, after %ld", most, before);
#if defined(_WIN32)
    /* Wine counts no handles. */
    check_that(before > 0, "they were counted", detail);
#else
    check_that(before > 0 && files > 2, "they were counted", detail);
#endif
    check_that(most - before <= 2048, "at all times", detail);
    fprintf(stdout, "ok   %d solves, %ld KiB at first and %ld KiB at most, %d files, handles %llu, %llu, %llu\n",
            rounds * SOLVES_PER_ASSET * ASSETS_PER_DEVICE, before, most, files, (unsigned long long)last_device,
            (unsigned long long)last_asset, (unsigned long long)last_tile);
    return finish();
}
