/*
 * Preparing a tile as a host sees it: what it takes, prepared tiles as bytes, strokes, and outputs in parts.
 */

#include "check.h"

static sheet s;
static double pose[VERTICES][4];
static const vrtm_status bad = VRTM_ERROR_INVALID_ARGUMENT;
static float whole[2 * MAP * MAP], bands[2 * MAP * MAP];

static scene make(vrtm_device device)
{
    scene m = {device, {0}, {0}};
    went_well("an asset is made", scene_on_device(&m, &s, 0));
    return m;
}

/* Solves, and fetches the redirection to `map`. */
static void solve(scene m, float *map)
{
    vrtm_array positions = sheet_positions(pose);
    succeeds("it is solved", vrtm_asset_solve(m.asset, &positions, NULL));
    succeeds("the map is fetched", fetch_map(m.tile, map));
}

static void estimate(scene m)
{
    vrtm_tile_estimate needs = vrtm_tile_estimate_init();
    vrtm_tile_info info = vrtm_tile_info_init();
    succeeds("a tile is estimated", vrtm_tile_get_estimate(m.tile, &needs));
    succeeds("a tile is described", vrtm_tile_get_info(m.tile, &info));
    const int moves = needs.movable_nodes == info.movable_nodes && needs.movable_nodes > 0;
    check_that(moves, "the nodes are those that move", "");
    check_that(needs.prepared_bytes > 0 && needs.preparing_bytes >= needs.prepared_bytes &&
                   needs.solving_bytes > needs.prepared_bytes,
               "bytes grow from preparing to solving", "");
    check_that(info.fixed >= 0 && info.fixed < 0.5f, "most rigid texels move", "");
    fails("an estimate needs a struct", vrtm_tile_get_estimate(m.tile, NULL), bad, "estimate is null");
    vrtm_tile zero = {0};
    fails("an estimate needs a tile", vrtm_tile_get_estimate(zero, &needs), VRTM_ERROR_INVALID_HANDLE, "tile");
}

static void saved(scene from, scene to)
{
    size_t size = 0, again = 0;
    succeeds("a tile has a size", vrtm_tile_save(from.tile, NULL, 0, &size));
    unsigned char *data = malloc(size);
    fails("a tile is not saved to less memory", vrtm_tile_save(from.tile, data, size - 1, &again), bad, "capacity");
    check_that(size > 0 && again == 0, "nothing is written", "");
    fails("the size is needed", vrtm_tile_save(from.tile, data, size, NULL), bad, "size is null");
    succeeds("a tile is saved", vrtm_tile_save(from.tile, data, size, &again));
    check_that(again == size, "in as many bytes", "");
    succeeds("a tile is loaded", vrtm_tile_load(to.tile, data, size));
    solve(from, whole);
    solve(to, bands);
    check_that(memcmp(whole, bands, sizeof whole) == 0, "both have the same result", "");
    data[size / 2] ^= 1;
    fails("damaged bytes are refused", vrtm_tile_load(to.tile, data, size), bad, "damaged");
    fails("a few bytes are refused", vrtm_tile_load(to.tile, data, 10), bad, "data");
    fails("null is refused", vrtm_tile_load(to.tile, NULL, size), bad, "data is null");
    solve(to, bands);
    check_that(memcmp(whole, bands, sizeof whole) == 0, "the result is as before", "");
    free(data);
}

static void no_strokes(scene m)
{
    const vrtm_image rigidity = sheet_rigidity(&s);
    fails("a stroke must lie in the map", vrtm_tile_update_rigidity(m.tile, &rigidity, MAP - 1, 0, 2, 1), bad, "2x1");
    fails("null is no stroke", vrtm_tile_update_rigidity(m.tile, NULL, 0, 0, 1, 1), bad, "rigidity is null");
}

static void parts(scene m)
{
    solve(m, whole);
    for (vrtm_origin origin = VRTM_ORIGIN_TOP; origin <= VRTM_ORIGIN_BOTTOM; ++origin) {
        vrtm_image_out image = sheet_map(whole);
        image.origin = origin;
        succeeds("a whole map", fetch_image(m.tile, VRTM_FETCH_REDIRECTION_DELTA, &image));
        int good = 1;
        for (int y = 0; y < MAP; y += 11) {
            for (int x = 0; x < MAP; x += 50) {
                image.width = (uint32_t)(MAP - x < 50 ? MAP - x : 50);
                image.height = (uint32_t)(MAP - y < 11 ? MAP - y : 11);
                image.row_stride = 8 * MAP;
                image.data = bands + 2 * (y * MAP + x);
                good &= fetch_rectangle(m.tile, VRTM_FETCH_REDIRECTION_DELTA, &image, (uint32_t)x, (uint32_t)y,
                                             MAP, MAP) == VRTM_OK;
            }
        }
        check_that(good && memcmp(whole, bands, sizeof whole) == 0, "parts make up the whole", vrtm_last_error());
    }
    vrtm_image_out image = vrtm_image_out_init();
    image.width = image.height = 8;
    image.data = bands;
    fails("a part lies in the whole", fetch_rectangle(m.tile, VRTM_FETCH_WARP, &image, MAP - 7, 0, MAP, MAP), bad,
          "image");
}

int main(void)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = VRTM_BACKEND_CPU;
    sheet_make(&s);
    sheet_pose(&s, 3, pose);
    succeeds("a device is made", vrtm_device_create(&desc, &device));
    scene a = make(device), b = make(device);
    estimate(a);
    saved(a, b);
    parts(a);
    no_strokes(b);
    succeeds("an asset is destroyed", vrtm_asset_destroy(a.asset));
    succeeds("the other one is destroyed", vrtm_asset_destroy(b.asset));
    succeeds("the device is destroyed", vrtm_device_destroy(device));
    return finish();
}
