/*
 * Preparing a tile as a host sees it: what it takes, prepared tiles as bytes, strokes, and outputs in parts.
 */

#include "check.h"

static sheet s;
static double pose[VERTICES][4];
static float whole[2 * MAP * MAP], bands[2 * MAP * MAP];

typedef struct {
    vrtm_asset asset;
    vrtm_tile tile;
} model;

static model make(vrtm_device device, const vrtm_image *rigidity)
{
    sheet_desc d;
    model m;
    sheet_describe(&s, &d);
    check_that(vrtm_asset_create(device, &d.mesh, &m.asset) == VRTM_OK, "an asset is made", vrtm_last_error());
    check_that(find_udim(m.asset, 1001, &m.tile) == VRTM_OK, "it has a tile", vrtm_last_error());
    check_that(vrtm_tile_set_rigidity(m.tile, rigidity) == VRTM_OK, "the tile has rigidity", vrtm_last_error());
    return m;
}

/* Solves, and fetches the redirection to `map`. */
static void solve(model m, float *map)
{
    vrtm_array positions = sheet_positions(pose);
    vrtm_image_out image = vrtm_image_out_init();
    image.data = map;
    image.width = image.height = MAP;
    check_that(vrtm_asset_solve(m.asset, &positions, NULL) == VRTM_OK, "it is solved", vrtm_last_error());
    check_that(fetch_image(m.tile, VRTM_FETCH_REDIRECTION, &image) == VRTM_OK, "the map is fetched", vrtm_last_error());
}

static void estimate(model m)
{
    vrtm_tile_estimate needs = vrtm_tile_estimate_init();
    vrtm_tile_info info = vrtm_tile_info_init();
    check_that(vrtm_tile_get_estimate(m.tile, &needs) == VRTM_OK, "a tile is estimated", vrtm_last_error());
    check_that(vrtm_tile_get_info(m.tile, &info) == VRTM_OK, "a tile is described", vrtm_last_error());
    check_that(needs.movable_nodes == info.movable_nodes && needs.movable_nodes > 0, "the nodes are those that move", vrtm_last_error());
    check_that(needs.prepared_bytes > 0 && needs.preparing_bytes >= needs.prepared_bytes &&
              needs.solving_bytes > needs.prepared_bytes, "bytes grow from preparing to solving", vrtm_last_error());
    check_that(info.fixed >= 0 && info.fixed < 0.5f, "most rigid texels move", vrtm_last_error());
    check_that(vrtm_tile_get_estimate(m.tile, NULL) == VRTM_ERROR_INVALID_ARGUMENT, "an estimate needs a struct", vrtm_last_error());
    vrtm_tile zero = {0};
    check_that(vrtm_tile_get_estimate(zero, &needs) == VRTM_ERROR_INVALID_HANDLE, "an estimate needs a tile", vrtm_last_error());
}

static void saved(model from, model to)
{
    size_t size = 0, again = 0;
    check_that(vrtm_tile_save(from.tile, NULL, 0, &size) == VRTM_OK && size > 0, "a tile has a size", vrtm_last_error());
    unsigned char *data = malloc(size);
    check_that(vrtm_tile_save(from.tile, data, size - 1, &again) == VRTM_ERROR_INVALID_ARGUMENT && again == 0, "a tile is not saved to less memory", vrtm_last_error());
    check_that(strstr(vrtm_last_error(), "capacity") != NULL, "the message names the capacity", vrtm_last_error());
    check_that(vrtm_tile_save(from.tile, data, size, NULL) == VRTM_ERROR_INVALID_ARGUMENT, "the size is needed", vrtm_last_error());
    check_that(vrtm_tile_save(from.tile, data, size, &again) == VRTM_OK && again == size, "a tile is saved", vrtm_last_error());
    check_that(vrtm_tile_load(to.tile, data, size) == VRTM_OK, "a tile is loaded", vrtm_last_error());
    solve(from, whole);
    solve(to, bands);
    check_that(memcmp(whole, bands, sizeof whole) == 0, "both have the same result", vrtm_last_error());
    data[size / 2] ^= 1;
    check_that(vrtm_tile_load(to.tile, data, size) == VRTM_ERROR_INVALID_ARGUMENT, "damaged bytes are refused", vrtm_last_error());
    check_that(strstr(vrtm_last_error(), "damaged") != NULL, "the message says so", vrtm_last_error());
    check_that(vrtm_tile_load(to.tile, data, 10) == VRTM_ERROR_INVALID_ARGUMENT, "a few bytes are refused", vrtm_last_error());
    check_that(vrtm_tile_load(to.tile, NULL, size) == VRTM_ERROR_INVALID_ARGUMENT, "null is refused", vrtm_last_error());
    solve(to, bands);
    check_that(memcmp(whole, bands, sizeof whole) == 0, "the result is as before", vrtm_last_error());
    free(data);
}

static void stroke(vrtm_device device, model m, vrtm_image rigidity)
{
    static unsigned char texels[MAP * MAP];
    rigidity.data = texels;
    rigidity.format = VRTM_PIXEL_U8;
    rigidity.pixel_stride = rigidity.row_stride = 0;
    for (int k = 0; k < MAP * MAP; ++k) {
        texels[k] = k / 7 % 3 == 0 && k / (5 * MAP) % 2 == 0 ? 255 : 0;
    }
    check_that(vrtm_tile_set_rigidity(m.tile, &rigidity) == VRTM_OK, "a map is set", vrtm_last_error());
    solve(m, whole);
    for (int y = 20; y < 26; ++y) {
        memset(texels + y * MAP + 30, 255, 9);
    }
    check_that(vrtm_tile_update_rigidity(m.tile, &rigidity, 30, 20, 9, 6) == VRTM_OK, "a stroke is taken", vrtm_last_error());
    solve(m, bands);
    check_that(memcmp(whole, bands, sizeof whole) != 0, "it changes the result", vrtm_last_error());
    model fresh = make(device, &rigidity);
    solve(fresh, whole);
    check_that(memcmp(whole, bands, sizeof whole) == 0, "to that of the whole map", vrtm_last_error());
    check_that(vrtm_asset_destroy(fresh.asset) == VRTM_OK, "an asset is destroyed", vrtm_last_error());
    check_that(vrtm_tile_update_rigidity(m.tile, &rigidity, MAP - 1, 0, 2, 1) == VRTM_ERROR_INVALID_ARGUMENT, "a stroke must lie in the map", vrtm_last_error());
    check_that(vrtm_tile_update_rigidity(m.tile, NULL, 0, 0, 1, 1) == VRTM_ERROR_INVALID_ARGUMENT, "null is no stroke", vrtm_last_error());
}

static void parts(model m)
{
    solve(m, whole);
    for (vrtm_origin origin = VRTM_ORIGIN_TOP; origin <= VRTM_ORIGIN_BOTTOM; ++origin) {
        vrtm_image_out image = vrtm_image_out_init();
        image.origin = origin;
        image.width = image.height = MAP;
        image.data = whole;
        check_that(fetch_image(m.tile, VRTM_FETCH_REDIRECTION_DELTA, &image) == VRTM_OK, "a whole map", vrtm_last_error());
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
    check_that(fetch_rectangle(m.tile, VRTM_FETCH_WARP, &image, MAP - 7, 0, MAP, MAP) == VRTM_ERROR_INVALID_ARGUMENT, "a part lies in the whole", vrtm_last_error());
}

int main(void)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device device;
    desc.backend = VRTM_BACKEND_CPU;
    sheet_make(&s);
    sheet_pose(&s, 3, pose);
    check_that(vrtm_device_create(&desc, &device) == VRTM_OK, "a device is made", vrtm_last_error());
    vrtm_image rigidity = sheet_rigidity(&s);
    model a = make(device, &rigidity), b = make(device, &rigidity);
    estimate(a);
    saved(a, b);
    parts(a);
    stroke(device, b, rigidity);
    check_that(vrtm_asset_destroy(a.asset) == VRTM_OK && vrtm_asset_destroy(b.asset) == VRTM_OK, "assets are destroyed", vrtm_last_error());
    check_that(vrtm_device_destroy(device) == VRTM_OK, "the device is destroyed", vrtm_last_error());
    return finish();
}
