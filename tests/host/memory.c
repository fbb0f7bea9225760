/*
 * Memory goes back: after the last asset of a device is destroyed, the process holds at most 10 MiB more than before the
 * first. As the system counts it.
 */

#include "platform.h"

#include "check.h"

enum { GRID = 2048 };

static sheet s;
static double pose[VERTICES][4];

/* MiB that the process holds. */
static double resident(void)
{
    return (double)platform_memory() / 1024;
}

/* Makes an asset, solves it at several sizes, reads everything, and destroys it. Returns what it held, in MiB. */
static double use(vrtm_device device, uint32_t grid)
{
    scene made = {device, {0}, {0}};
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_image_out image = vrtm_image_out_init();
    vrtm_array positions = sheet_positions(pose);
    double held;
    went_well("an asset is made", scene_on_device(&made, &s, grid));
    image.width = image.height = 512;
    image.data = malloc(512 * 512 * 8);
    for (int frame = 1; frame < 3; ++frame) {
        sheet_pose(&s, frame, pose);
        options.quality = frame == 1 ? VRTM_QUALITY_NORMAL : VRTM_QUALITY_DRAFT;
        succeeds("it is solved", vrtm_asset_solve(made.asset, &positions, &options));
        succeeds("and fetched", fetch_image(made.tile, VRTM_FETCH_REDIRECTION, &image));
        succeeds("and fetched again", fetch_image(made.tile, VRTM_FETCH_WARP, &image));
    }
    free((void *)image.data);
    held = resident();
    succeeds("it is destroyed", vrtm_asset_destroy(made.asset));
    return held;
}

/* An argument says how many rounds, 2 without one. */
int main(int count, char **arguments)
{
    const long rounds = count > 1 ? atol(arguments[1]) : 2;
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    char detail[100];
    desc.backend = VRTM_BACKEND_CPU;
    sheet_make(&s);
    succeeds("a device is made", vrtm_device_create(&desc, &device));
    const double before = resident();
    for (long round = 0; round < rounds; ++round) {
        const uint32_t sizes[3] = {256, GRID, 512};
        for (int k = 0; k < 3; ++k) {
            const double held = use(device, sizes[k]) - before, left = resident() - before;
            snprintf(detail, sizeof detail, "%.1f MiB are left of %.1f", left, held);
            check_that(left <= 10, "memory goes back", detail);
            check_that(sizes[k] < GRID || before == 0 || held > 100, "which was much", detail);
        }
    }
    succeeds("the device is destroyed", vrtm_device_destroy(device));
    return finish();
}
