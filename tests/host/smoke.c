/* Calls everything once, as a host would: device, asset, maps, settings, solve, fetch, reports. */

#include "check.h"

static int log_lines;

static void count_lines(void *user, const vrtm_log_entry *entry)
{
    const int is_device = entry->code == VRTM_LOG_CODE_DEVICE && entry->level == VRTM_LOG_LEVEL_INFO &&
                          entry->udim == 0 && entry->values[0] > 0 && entry->values[1] == 0;
    *(int *)user += entry->struct_size == sizeof *entry && entry->message[0] != 0 && is_device;
}

/* The largest distance of a redirection map from the identity, in texels. */
static double distance_from_identity(const float *map, int size, int bottom_up)
{
    double most = 0;
    for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) {
            const int row = bottom_up ? y : size - 1 - y;
            const double du = map[2 * (y * size + x)] * size - (x + 0.5);
            const double dv = map[2 * (y * size + x) + 1] * size - (row + 0.5);
            most = fmax(most, fmax(fabs(du), fabs(dv)));
        }
    }
    return most;
}

int main(void)
{
    static sheet s;
    static double pose[VERTICES][4];
    static float map[2 * MAP * MAP], again[2 * MAP * MAP], warp[2 * (MAP + 1) * (MAP + 1)], corners[2 * CORNERS];
    static uint16_t delta[2 * MAP * MAP];
    sheet_make(&s);

    check_that(vrtm_version() == VRTM_VERSION, "the library has the header's version", "");
    check_that(strcmp(vrtm_last_error(), "") == 0, "no error at first", vrtm_last_error());
    check_that(strcmp(vrtm_status_string(VRTM_ERROR_BUSY), "VRTM_ERROR_BUSY") == 0, "a status has a name", "");

    vrtm_device_desc device_desc = vrtm_device_desc_init();
    device_desc.log = count_lines;
    device_desc.log_user = &log_lines;
    vrtm_device device;
    succeeds("device_create", vrtm_device_create(&device_desc, &device));
    check_that(log_lines == 1, "the log function was told of the device", "");
    vrtm_device_info device_data = vrtm_device_info_init();
    succeeds("device_info", vrtm_device_get_info(device, &device_data));
    uint32_t count = 99, hardware = 0;
    succeeds("adapter_count", vrtm_adapter_count(&count));
    for (uint32_t i = 0; i < count; ++i) {
        vrtm_adapter_info adapter = vrtm_adapter_info_init();
        succeeds("adapter_info", vrtm_adapter_get_info(i, &adapter));
        check_that(adapter.name[0] != 0 && adapter.driver[0] != 0 && adapter.api[0] != 0, "an adapter", adapter.name);
        hardware += adapter.software == 0;
    }
    const char *asked = getenv("VRTM_DEVICE");
    if (asked == NULL) {
        check_that(device_data.backend == (hardware > 0 ? VRTM_BACKEND_GPU : VRTM_BACKEND_CPU),
                   "auto takes a hardware GPU, or the CPU", device_data.name);
        check_that(strncmp(device_data.reason, "auto: ", 6) == 0, "and says why", device_data.reason);
    } else {
        check_that(device_data.backend == (strcmp(asked, "gpu") == 0 ? VRTM_BACKEND_GPU : VRTM_BACKEND_CPU),
                   "a backend is asked for by variable", device_data.name);
        check_that(strstr(device_data.reason, "was asked for (VRTM_DEVICE)") != NULL, "and why", device_data.reason);
    }
    check_that(device_data.threads > 0, "threads", "");

    sheet_desc d;
    sheet_describe(&s, &d);
    vrtm_asset asset;
    if (!succeeds("asset_create", vrtm_asset_create(device, &d.mesh, &asset))) {
        return finish();
    }
    vrtm_asset_info asset_data = vrtm_asset_info_init();
    succeeds("asset_info", vrtm_asset_get_info(asset, &asset_data));
    check_that(asset_data.vertices == VERTICES && asset_data.faces == FACES && asset_data.corners == CORNERS &&
                   asset_data.triangles == 2 * FACES && asset_data.tiles == 1 && asset_data.charts == 1,
               "asset_info says what was given", "");
    vrtm_tile tile, found;
    succeeds("asset_tile", vrtm_asset_get_tile(asset, 0, &tile));
    succeeds("find_tile", find_udim(asset, 1001, &found));
    check_that(tile.id == found.id, "both find the same tile", "");

    vrtm_image rigidity = sheet_rigidity(&s);
    succeeds("set_rigidity", vrtm_tile_set_rigidity(tile, &rigidity));
    succeeds("set_mask to none", vrtm_tile_set_mask(tile, NULL));
    vrtm_tile_grid cells = {0, 0};
    succeeds("tile_grid", vrtm_tile_get_grid(tile, &cells));
    check_that(cells.width >= 64 && cells.width == cells.height, "the grid follows the features", "");
    vrtm_tile_settings of_grid = vrtm_tile_settings_init();
    of_grid.grid_width = of_grid.grid_height = MAP;
    succeeds("a grid as large as the map", vrtm_tile_set_settings(tile, &of_grid));
    vrtm_tile_info tile_data = vrtm_tile_info_init();
    succeeds("tile_info", vrtm_tile_get_info(tile, &tile_data));
    check_that(tile_data.udim == 1001 && tile_data.grid_width == MAP && tile_data.grid_height == MAP &&
                   tile_data.movable_nodes > 0 && tile_data.charts == 1,
               "tile_info says what was given", "");

    vrtm_tile_settings settings = vrtm_tile_settings_init();
    succeeds("get_settings", vrtm_tile_get_settings(tile, &settings));
    check_that(settings.smoothness > 0.01f && settings.room > 0.2f && settings.struct_size == sizeof settings,
               "get_settings fills the defaults in", "");
    settings.room = 0;
    settings.smoothness = 0.1f;
    succeeds("set_settings", vrtm_tile_set_settings(tile, &settings));
    vrtm_tile_settings back = vrtm_tile_settings_init();
    succeeds("get_settings again", vrtm_tile_get_settings(tile, &back));
    check_that(memcmp(&settings, &back, sizeof back) == 0, "settings come back as they were set", "");
    succeeds("set_settings to the defaults", vrtm_tile_set_settings(tile, NULL));

    sheet_pose(&s, 5, pose);
    vrtm_array positions = sheet_positions(pose);
    vrtm_solve_options options = vrtm_solve_options_init();
    options.measure = 1;
    succeeds("solve", vrtm_asset_solve(asset, &positions, &options));

    vrtm_image_out image = sheet_map(map);
    succeeds("fetch redirection", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    const double moved = distance_from_identity(map, MAP, 0);
    char text[64];
    snprintf(text, sizeof text, "%g texels", moved);
    check_that(moved > 0.1 && moved < 32, "the redirection moves texels", text);
    image.data = again;
    image.origin = VRTM_ORIGIN_BOTTOM;
    succeeds("fetch bottom up", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    int same = 1;
    for (int y = 0; y < MAP; ++y) {
        same &= memcmp(map + 2 * MAP * y, again + 2 * MAP * (MAP - 1 - y), 2 * MAP * sizeof(float)) == 0;
    }
    check_that(same, "the origin turns the rows over", "");
    image.origin = VRTM_ORIGIN_TOP;
    image.data = delta;
    image.format = VRTM_PIXEL_F16;
    succeeds("fetch delta as f16", fetch_image(tile, VRTM_FETCH_REDIRECTION_DELTA, &image));
    image.data = warp;
    image.format = VRTM_PIXEL_F32;
    image.width = image.height = MAP + 1;
    succeeds("fetch warp at the nodes", fetch_image(tile, VRTM_FETCH_WARP, &image));
    check_that(warp[0] == 0 && warp[1] == 1 && warp[2 * MAP] == 1, "the warp keeps the tile's corners", "");

    /* An image with more bytes per texel and longer rows: the bytes that belong to neither channel stay as they are. */
    static uint8_t wide[MAP][16 * MAP + 8];
    memset(wide, 0xAB, sizeof wide);
    image.data = wide;
    image.width = image.height = MAP;
    image.pixel_stride = 16;
    image.row_stride = sizeof wide[0];
    succeeds("fetch with strides", fetch_image(tile, VRTM_FETCH_REDIRECTION, &image));
    int kept = 1;
    same = 1;
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            same &= memcmp(&wide[y][16 * x], map + 2 * (MAP * y + x), 8) == 0;
            kept &= wide[y][16 * x + 8] == 0xAB && wide[y][16 * x + 15] == 0xAB;
        }
        kept &= wide[y][16 * MAP] == 0xAB && wide[y][16 * MAP + 7] == 0xAB;
    }
    check_that(same, "strides give the same texels", "");
    check_that(kept, "skipped bytes are left alone", "");

    succeeds("fetch_corner_uvs", vrtm_asset_fetch_corner_uvs(asset, 0, corners, CORNERS));
    check_that(fabsf(corners[0] - 0.05f) < 1e-4f && fabsf(corners[1] - 0.05f) < 1e-4f,
               "a corner on the border keeps its UV", "");

    vrtm_tile_report report = vrtm_tile_report_init();
    succeeds("tile_report", vrtm_tile_get_report(tile, &report));
    check_that(report.udim == 1001 && report.folds == 0 && report.min_jacobian > 0 && report.charts_active == 1 &&
                   report.energy < report.energy_before,
               "the report certifies the result", "");
    check_that(report.measured == 1 && report.segments > 0 && report.after.rms < report.before.rms,
               "strain was measured and fell", "");
    vrtm_worst_feature worst[16];
    uint32_t no_room = 99;
    count = 99;
    succeeds("worst_features", vrtm_tile_get_worst_features(tile, worst, 16, &count));
    succeeds("their number", vrtm_tile_get_worst_features(tile, NULL, 0, &no_room));
    check_that(report.features > 0 && report.features_worse <= report.features && count == no_room &&
                   count == (report.features_worse < 16 ? report.features_worse : 16) &&
                   report.features_strained_after < report.features_strained_before,
               "painted features are counted, and the worst listed", "");
    report.struct_size = 296;
    report.features = 99;
    succeeds("tile_report of 0.1.0", vrtm_tile_get_report(tile, &report));
    check_that(report.features == 99, "an older host's struct is not written beyond its end", "");
    vrtm_asset_report whole = vrtm_asset_report_init();
    succeeds("asset_report", vrtm_asset_get_report(asset, &whole));
    check_that(whole.tiles == 1 && whole.tiles_active == 1 && whole.bytes > 0, "the asset's report adds up", "");

    /* redirect, the only call that a deformer's compute() needs, gives the same bits. */
    memset(again, 0, sizeof again);
    vrtm_image_out first = sheet_map(again), second = first;
    second.data = warp;
    second.width = second.height = MAP + 1;
    vrtm_fetch fetches[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    fetches[0].tile = fetches[1].tile = tile;
    fetches[0].image = &first;
    fetches[1].image = &second;
    fetches[1].kind = VRTM_FETCH_WARP;
    succeeds("redirect", vrtm_asset_redirect(asset, &positions, NULL, fetches, 2));
    check_that(memcmp(map, again, sizeof map) == 0, "redirect gives the same bits", "");

    /* Two outputs as the four channels of one image: they lie between each other's texels, and share no byte. */
    memset(wide, 0xAB, sizeof wide);
    second = first;
    first.data = wide;
    second.data = &wide[0][8];
    first.pixel_stride = second.pixel_stride = 16;
    first.row_stride = second.row_stride = sizeof wide[0];
    succeeds("two outputs in one image", vrtm_asset_redirect(asset, &positions, NULL, fetches, 2));
    same = kept = 1;
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            float texel[4];
            memcpy(texel, &wide[y][16 * x], sizeof texel);
            same &= memcmp(texel, map + 2 * (MAP * y + x), 8) == 0;
            kept &= texel[2] >= 0 && texel[2] <= 1 && texel[3] >= 0 && texel[3] <= 1;
        }
        kept &= wide[y][16 * MAP] == 0xAB && wide[y][16 * MAP + 7] == 0xAB;
    }
    check_that(same && kept, "each has its channels", "");
    second.data = &wide[0][7];
    fails("channels that overlap", vrtm_asset_redirect(asset, &positions, NULL, fetches, 2),
          BAD, "overlap in memory");
    first = sheet_map(again);

    sheet_pose(&s, 0, pose);
    succeeds("redirect at rest", vrtm_asset_redirect(asset, &positions, NULL, fetches, 1));
    snprintf(text, sizeof text, "%g texels", distance_from_identity(again, MAP, 0));
    check_that(distance_from_identity(again, MAP, 0) < 1e-4, "the rest pose is the identity", text);

    float values[VERTICES];
    for (int k = 0; k < VERTICES; ++k) {
        values[k] = k % 7 == 0 ? 1.0f : 0.0f;
    }
    vrtm_array rigid = vrtm_array_init();
    rigid.data = values;
    rigid.count = VERTICES;
    succeeds("set_vertex_rigidity", vrtm_asset_set_vertex_rigidity(asset, &rigid));
    succeeds("set_vertex_rigidity to none", vrtm_asset_set_vertex_rigidity(asset, NULL));
    succeeds("set_vertex_mask", vrtm_asset_set_vertex_mask(asset, &rigid));
    succeeds("set_vertex_mask to none", vrtm_asset_set_vertex_mask(asset, NULL));

    /* The asset outlives its device. */
    succeeds("device_destroy", vrtm_device_destroy(device));
    succeeds("solve after the device's end", vrtm_asset_solve(asset, &positions, NULL));
    succeeds("asset_destroy", vrtm_asset_destroy(asset));
    return finish();
}
