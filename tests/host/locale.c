/* A locale whose numbers have a decimal comma, which the program's argument names: messages and results do not change. */

#include "check.h"

#include <locale.h>

static sheet s;
static double pose[VERTICES][4];

static char messages[6][512];

/* Solves a frame, and collects messages that hold numbers. */
static void run(float *map, char (*said)[512])
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device_info info = vrtm_device_info_init();
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_image rigidity = sheet_rigidity(&s);
    vrtm_image_out image = vrtm_image_out_init();
    vrtm_array positions = sheet_positions(pose);
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tile;
    sheet_desc d;
    sheet_describe(&s, &d);
    desc.backend = VRTM_BACKEND_CPU;
    succeeds("a device", vrtm_device_create(&desc, &device));
    succeeds("its description", vrtm_device_get_info(device, &info));
    succeeds("an asset", vrtm_asset_create(device, &d.mesh, &asset));
    succeeds("its tile", find_udim(asset, 1001, &tile));
    succeeds("its rigidity", vrtm_tile_set_rigidity(tile, &rigidity));
    settings.smoothness = -1.5f;
    fails("a setting that is wrong", vrtm_tile_set_settings(tile, &settings), VRTM_ERROR_INVALID_ARGUMENT, "-1.5");
    snprintf(said[0], 512, "%s", vrtm_last_error());
    options.tolerance = 1234.25f;
    fails("an option that is wrong", vrtm_asset_solve(asset, &positions, &options), VRTM_ERROR_INVALID_ARGUMENT, "1234.25");
    snprintf(said[1], 512, "%s", vrtm_last_error());
    snprintf(said[2], 512, "%s", info.reason);
    options.tolerance = 0;
    options.measure = 1;
    image.data = map;
    image.width = image.height = MAP;
    succeeds("a solve", vrtm_asset_solve(asset, &positions, &options));
    succeeds("a fetch", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    succeeds("its end", vrtm_asset_destroy(asset));
    succeeds("the device's end", vrtm_device_destroy(device));
}

int main(int count, char **arguments)
{
    static float expected[2 * MAP * MAP], map[2 * MAP * MAP];
    char number[32];
    sheet_make(&s);
    sheet_pose(&s, 5, pose);
    run(expected, messages);
    check_that(count == 2 && setlocale(LC_ALL, arguments[1]) != NULL, "a locale", "it is not installed");
    snprintf(number, sizeof number, "%.1f", 0.5);
    check_that(strcmp(number, "0,5") == 0, "with a decimal comma", number);
    run(map, messages + 3);
    check_that(memcmp(expected, map, sizeof map) == 0, "the result has the same bits", "");
    for (int k = 0; k < 3; ++k) {
        check_that(strcmp(messages[k], messages[3 + k]) == 0, "a message has the same words", messages[3 + k]);
    }
    return finish();
}
