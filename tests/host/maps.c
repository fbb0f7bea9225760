/*
 * Outputs as a renderer's plug-in fetches them: all kinds, with further channels, and what the library says
 * about a map before it is fetched.
 */

#include "check.h"

#include <stddef.h>

static sheet s;
static double pose[VERTICES][4];
static float two[2 * MAP * MAP], udim[2 * MAP * MAP], four[4 * MAP * MAP], jacobian[4 * MAP * MAP], scale[MAP * MAP];

static void kinds(vrtm_tile tile)
{
    vrtm_image_out image = sheet_map(two);
    succeeds("the redirection", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    image = sheet_map(udim);
    succeeds("among all tiles", fetch_image(tile, VRTM_FETCH_REDIRECTION_UDIM, &image));
    image = sheet_map(four);
    image.channels = 4;
    succeeds("with coverage", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    image = sheet_map(jacobian);
    succeeds("four derivatives without being asked for them", fetch_image(tile, VRTM_FETCH_JACOBIAN, &image));
    image = sheet_map(scale);
    succeeds("one scale", fetch_image(tile, VRTM_FETCH_FILTER_SCALE, &image));
    int same = 1, moved = 0, covered = 0;
    for (size_t k = 0; k < MAP * MAP; k++) {
        same &= two[2 * k] == udim[2 * k] && two[2 * k + 1] == udim[2 * k + 1]; /* tile 1001 */
        same &= two[2 * k] == four[4 * k] && two[2 * k + 1] == four[4 * k + 1] && four[4 * k + 2] == 0;
        same &= four[4 * k + 3] == 0 || four[4 * k + 3] == 1;
        covered += four[4 * k + 3] == 1;
        const float *j = jacobian + 4 * k;
        /* The largest singular value s is the larger root of s^4 - s^2 |J|^2 + det^2 = 0. */
        double squares = (double)j[0] * j[0] + (double)j[1] * j[1] + (double)j[2] * j[2] + (double)j[3] * j[3];
        double det = (double)j[0] * j[3] - (double)j[1] * j[2], t = (double)scale[k] * scale[k];
        same &= fabs(t * t - t * squares + det * det) < 1e-5 * (1 + t * t) && t * 2 >= squares * (1 - 1e-5) && det > 0;
        moved += fabs(j[0] - 1) > 0.01f;
    }
    check_that(same, "all kinds tell the same", "");
    check_that(moved > 0 && covered > MAP, "and something", "");
}

/* The sheet is one chart, beyond whose border there is nothing. It has not been solved yet. */
static void dilation(vrtm_tile tile)
{
    vrtm_image_out image = sheet_map(four);
    int same = 1, covered = 0;
    image.channels = 4;
    image.origin = VRTM_ORIGIN_BOTTOM;
    succeeds("a dilation", vrtm_tile_fetch_dilation(tile, 1.0 / 16, &image));
    for (size_t k = 0; k < MAP * MAP; k++) {
        const float u = ((float)(k % MAP) + 0.5f) / MAP, v = ((float)(k / MAP) + 0.5f) / MAP;
        same &= fabsf(four[4 * k] - u) < 1e-6f && fabsf(four[4 * k + 1] - v) < 1e-6f && four[4 * k + 2] == 0;
        covered += four[4 * k + 3] == 1;
    }
    check_that(same && covered > MAP && covered < MAP * MAP, "texels keep their own places", "");
    fails("no reach", vrtm_tile_fetch_dilation(tile, 0, &image), VRTM_ERROR_INVALID_ARGUMENT, "reach: 0");
    fails("too far", vrtm_tile_fetch_dilation(tile, 0.75, &image), VRTM_ERROR_INVALID_ARGUMENT, "reach: 0.75");
    image.channels = 1;
    fails("one channel of it", vrtm_tile_fetch_dilation(tile, 0.1, &image), VRTM_ERROR_INVALID_ARGUMENT, "2 to 4");
    fails("nowhere", vrtm_tile_fetch_dilation(tile, 0.1, NULL), VRTM_ERROR_INVALID_ARGUMENT, "image is null");
}

static void refusals(vrtm_tile tile)
{
    vrtm_image_out image = sheet_map(four);
    memset(four, 7, sizeof four);
    static float before[4 * MAP * MAP];
    memcpy(before, four, sizeof four);
    image.channels = 5;
    fails("five channels", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image), VRTM_ERROR_INVALID_ARGUMENT, "image: 5 channels");
    image.channels = 1;
    fails("one channel", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image), VRTM_ERROR_INVALID_ARGUMENT, "2 to 4");
    image.channels = 2;
    fails("half a Jacobian", fetch_image(tile, VRTM_FETCH_JACOBIAN, &image), VRTM_ERROR_INVALID_ARGUMENT, "its kind has 4");
    image.channels = 4;
    fails("a warp has no coverage", fetch_image(tile, VRTM_FETCH_WARP, &image), VRTM_ERROR_INVALID_ARGUMENT, "2 to 3");
    image.pixel_stride = 12;
    fails("four in the place of three", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image), VRTM_ERROR_INVALID_ARGUMENT, "pixel_stride");
    image = sheet_map(four);
    check_that(memcmp(before, four, sizeof four) == 0, "nothing was written", "");
    succeeds("a part of a warp can be had", fetch_rectangle(tile, VRTM_FETCH_WARP, &image, 0, 0, 2 * MAP, MAP));
}

static void inspect(vrtm_tile tile)
{
    vrtm_map_desc desc = vrtm_map_desc_init();
    vrtm_map_info data = vrtm_map_info_init(), half = data;
    desc.width = desc.height = MAP;
    succeeds("a map is looked at", vrtm_tile_inspect_map(tile, &desc, &data));
    check_that(data.folds == 0 && data.min_jacobian > 0 && data.sufficient_width == MAP && data.sufficient_height == MAP,
              "it has no folds", "");
    check_that(data.error_rms > 0 && data.error_rms <= data.error_p99 && data.error_p99 <= data.error_max &&
              data.error_max < 1.0 / MAP, "and is closer than a texel", "");
    desc.width = desc.height = 4 * MAP;
    succeeds("a finer one", vrtm_tile_inspect_map(tile, &desc, &half));
    check_that(half.error_rms < data.error_rms, "is closer", "");
    desc.kind = VRTM_FETCH_WARP;
    fails("no redirection", vrtm_tile_inspect_map(tile, &desc, &half), VRTM_ERROR_INVALID_ARGUMENT, "kind");
    desc.kind = VRTM_FETCH_REDIRECTION;
    desc.format = VRTM_PIXEL_U8;
    fails("an integer format", vrtm_tile_inspect_map(tile, &desc, &half), VRTM_ERROR_UNSUPPORTED, "format");
    desc.format = 9;
    fails("no format", vrtm_tile_inspect_map(tile, &desc, &half), VRTM_ERROR_INVALID_ARGUMENT, "desc.format is 9");
    desc.format = VRTM_PIXEL_F16;
    desc.height = 0;
    fails("no rows", vrtm_tile_inspect_map(tile, &desc, &half), VRTM_ERROR_INVALID_ARGUMENT, "size");
    desc.height = 20000;
    fails("too many rows", vrtm_tile_inspect_map(tile, &desc, &half), VRTM_ERROR_INVALID_ARGUMENT, "16384");
    fails("no desc", vrtm_tile_inspect_map(tile, NULL, &half), VRTM_ERROR_INVALID_ARGUMENT, "desc is null");
    fails("no data", vrtm_tile_inspect_map(tile, &desc, NULL), VRTM_ERROR_INVALID_ARGUMENT, "info is null");
    vrtm_tile zero = {0};
    fails("no tile", vrtm_tile_inspect_map(zero, &desc, &half), VRTM_ERROR_INVALID_HANDLE, "tile");
}

int main(void)
{
    scene made;
    vrtm_map_desc desc = vrtm_map_desc_init();
    vrtm_map_info data = vrtm_map_info_init();
    sheet_make(&s);
    sheet_pose(&s, 3, pose);
    went_well("a scene", scene_make(&made, &s, NULL, 0));
    const vrtm_tile tile = made.tile;
    desc.width = desc.height = MAP;
    fails("nothing to look at", vrtm_tile_inspect_map(tile, &desc, &data), VRTM_ERROR_NOT_SOLVED, "solve");
    dilation(tile);
    vrtm_array positions = sheet_positions(pose);
    succeeds("solved", vrtm_asset_solve(made.asset, &positions, NULL));
    kinds(tile);
    refusals(tile);
    inspect(tile);
    went_well("the scene goes", scene_end(&made));
    return finish();
}
