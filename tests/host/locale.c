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
    vrtm_array positions = sheet_positions(pose);
    scene made;
    desc.backend = VRTM_BACKEND_CPU;
    went_well("a scene", scene_make(&made, &s, &desc, 0));
    succeeds("its device's description", vrtm_device_get_info(made.device, &info));
    settings.smoothness = -1.5f;
    fails("a setting that is wrong", vrtm_tile_set_settings(made.tile, &settings), BAD, "-1.5");
    snprintf(said[0], 512, "%s", vrtm_last_error());
    options.tolerance = 1234.25f;
    fails("an option that is wrong", vrtm_asset_solve(made.asset, &positions, &options), BAD, "1234.25");
    snprintf(said[1], 512, "%s", vrtm_last_error());
    snprintf(said[2], 512, "%s", info.reason);
    options.tolerance = 0;
    options.measure = 1;
    succeeds("a solve", vrtm_asset_solve(made.asset, &positions, &options));
    succeeds("a fetch", fetch_map(made.tile, map));
    went_well("its end", scene_end(&made));
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
