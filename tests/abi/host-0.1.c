/*
 * A program of the first version: compiled against vrtm-0.1.h, it calls each of that header's functions, and runs with
 * any later library of the same major version. THIS FILE IS NEVER CHANGED.
 */

#include "vrtm-0.1.h"

#include <math.h>
#include <stdio.h>

enum { SIDE = 8, VERTICES = (SIDE + 1) * (SIDE + 1), FACES = SIDE * SIDE, CORNERS = 4 * FACES, MAP = 32 };

static int failures, lines;
static float points[VERTICES][3], pose[VERTICES][3], uvs[VERTICES][2], values[VERTICES], corners[2 * CORNERS];
static uint32_t counts[FACES], indices[CORNERS];
static uint8_t texels[MAP][MAP];
static float map[2 * MAP * MAP], again[2 * MAP * MAP], warp[2 * (MAP + 1) * (MAP + 1)];
static unsigned char bytes[1 << 20];

static void check(int good, const char *name)
{
    printf("%s %s (%s)\n", good ? "ok  " : "FAIL", name, good ? "" : vrtm_last_error());
    failures += !good;
}

#define CALL(call) check((call) == VRTM_OK, #call)
#define REFUSED(call, status) check((call) == (status), #call)

static void log_line(void *user, vrtm_log_level level, const char *message)
{
    *(int *)user += message[0] != 0 && (level == VRTM_LOG_INFO || level == VRTM_LOG_WARNING);
}

static void make(void)
{
    for (int k = 0; k < VERTICES; ++k) {
        const float u = (float)(k % (SIDE + 1)) / SIDE, v = (float)(k / (SIDE + 1)) / SIDE;
        uvs[k][0] = 0.1f + 0.8f * u;
        uvs[k][1] = 0.1f + 0.8f * v;
        points[k][0] = 10 * u;
        points[k][1] = 10 * v;
        pose[k][0] = points[k][0];
        pose[k][1] = points[k][1];
        pose[k][2] = 3 * expf(-(points[k][0] - 4) * (points[k][0] - 4) - (points[k][1] - 5) * (points[k][1] - 5));
        values[k] = k % 7 == 0 ? 1.0f : 0.0f;
    }
    for (uint32_t face = 0; face < FACES; ++face) {
        const uint32_t a = face / SIDE * (SIDE + 1) + face % SIDE;
        counts[face] = 4;
        indices[4 * face] = a;
        indices[4 * face + 1] = a + 1;
        indices[4 * face + 2] = a + SIDE + 2;
        indices[4 * face + 3] = a + SIDE + 1;
    }
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            texels[y][x] = x / 4 % 2 && y / 4 % 2 ? 255 : 0;
        }
    }
}

static void devices(vrtm_device *device)
{
    uint32_t count = 99;
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_device_info info = vrtm_device_info_init();
    desc.backend = VRTM_BACKEND_CPU;
    desc.threads = 2;
    desc.log = log_line;
    desc.log_user = &lines;
    CALL(vrtm_device_create(&desc, device));
    check(lines > 0, "the log function was called");
    CALL(vrtm_device_get_info(*device, &info));
    check(info.struct_size == sizeof info && info.backend == VRTM_BACKEND_CPU && info.threads == 2 && info.reason[0],
          "the device is described");
    CALL(vrtm_adapter_count(&count));
    check(count != 99, "adapters are counted");
    for (uint32_t i = 0; i < count; ++i) {
        vrtm_adapter_info adapter = vrtm_adapter_info_init();
        CALL(vrtm_adapter_get_info(i, &adapter));
    }
    vrtm_adapter_info none = vrtm_adapter_info_init();
    REFUSED(vrtm_adapter_get_info(count, &none), VRTM_ERROR_INVALID_ARGUMENT);
}

static void assets(vrtm_device device, vrtm_asset *asset, vrtm_tile *tile)
{
    vrtm_tile found;
    vrtm_tile_key key = {1001, 0, 0, 0};
    vrtm_array positions = vrtm_array_init(), pairs = vrtm_array_init();
    vrtm_mesh_desc mesh = vrtm_mesh_desc_init();
    vrtm_asset_info info = vrtm_asset_info_init();
    vrtm_uv_set set = {0};
    positions.data = points;
    positions.count = VERTICES;
    pairs.data = uvs;
    pairs.count = VERTICES;
    mesh.positions = &positions;
    mesh.face_counts = counts;
    mesh.face_count = FACES;
    mesh.indices = mesh.uv_indices = set.uv_indices = indices;
    mesh.index_count = mesh.uv_index_count = set.uv_index_count = CORNERS;
    mesh.uvs = set.uvs = &pairs;
    mesh.uv_sets = &set;
    mesh.uv_set_count = 1;
    CALL(vrtm_asset_create(device, &mesh, asset));
    CALL(vrtm_asset_get_info(*asset, &info));
    check(info.vertices == VERTICES && info.faces == FACES && info.corners == CORNERS && info.charts == 2,
          "the mesh is described");
    check(info.tiles == 2, "a tile for each set of UVs");
    CALL(vrtm_asset_find_tile(*asset, &key, tile));
    CALL(vrtm_asset_get_tile(*asset, 0, &found));
    check(found.id == tile->id, "both give the same tile");
    key.uv_set = 1;
    CALL(vrtm_asset_find_tile(*asset, &key, &found));
    check(found.id != tile->id, "the other set has another tile");
    memset(&key, 0, sizeof key);
    CALL(vrtm_tile_get_key(found, &key));
    check(key.udim == 1001 && key.uv_set == 1 && key.layer == 0 && key.layers == 1, "a tile has a key");
    uint32_t layers[FACES] = {9};
    CALL(vrtm_asset_fetch_face_layers(*asset, 0, layers, FACES));
    check(layers[0] == 0, "and a face a layer");
}

static void tiles(vrtm_asset asset, vrtm_tile tile)
{
    size_t size = 0;
    vrtm_image rigidity = vrtm_image_init();
    vrtm_tile_info info = vrtm_tile_info_init();
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    vrtm_tile_estimate needs = vrtm_tile_estimate_init();
    vrtm_tile_grid grid = {0, 0};
    vrtm_array numbers = vrtm_array_init();
    rigidity.data = texels;
    rigidity.format = VRTM_PIXEL_U8;
    rigidity.width = rigidity.height = MAP;
    numbers.data = values;
    numbers.count = VERTICES;
    CALL(vrtm_asset_set_vertex_rigidity(asset, &numbers));
    CALL(vrtm_asset_set_vertex_mask(asset, &numbers));
    CALL(vrtm_asset_set_vertex_mask(asset, NULL));
    CALL(vrtm_tile_freeze(tile, 1));
    CALL(vrtm_tile_freeze(tile, 0));
    CALL(vrtm_tile_set_rigidity(tile, &rigidity));
    CALL(vrtm_tile_update_rigidity(tile, &rigidity, 4, 4, 8, 8));
    CALL(vrtm_tile_set_mask(tile, &rigidity));
    CALL(vrtm_tile_set_mask(tile, NULL));
    CALL(vrtm_tile_get_settings(tile, &settings));
    check(settings.smoothness == vrtm_tile_settings_init().smoothness, "settings are the defaults at first");
    settings.room = 0;
    CALL(vrtm_tile_set_settings(tile, &settings));
    CALL(vrtm_tile_set_settings(tile, NULL));
    settings = vrtm_tile_settings_init();
    settings.grid_width = settings.grid_height = MAP;
    CALL(vrtm_tile_set_settings(tile, &settings));
    CALL(vrtm_tile_get_grid(tile, &grid));
    check(grid.width == MAP && grid.height == MAP, "the grid is as asked for");
    CALL(vrtm_tile_get_info(tile, &info));
    check(info.udim == 1001 && info.grid_width == MAP && info.movable_nodes > 0, "the tile is described");
    CALL(vrtm_tile_get_estimate(tile, &needs));
    check(needs.movable_nodes == info.movable_nodes && needs.solving_bytes > 0, "the tile is estimated");
    CALL(vrtm_tile_save(tile, bytes, sizeof bytes, &size));
    CALL(vrtm_tile_load(tile, bytes, size));
}

static void solves(vrtm_asset asset, vrtm_tile tile)
{
    vrtm_array positions = vrtm_array_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    vrtm_image_out image = vrtm_image_out_init(), nodes = vrtm_image_out_init();
    vrtm_fetch fetches[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    vrtm_tile_report report = vrtm_tile_report_init();
    vrtm_asset_report whole = vrtm_asset_report_init();
    REFUSED(vrtm_tile_get_report(tile, &report), VRTM_ERROR_NOT_SOLVED);
    positions.data = pose;
    positions.count = VERTICES;
    options.max_corrections = 7;
    options.measure = 1;
    CALL(vrtm_asset_solve(asset, &positions, &options));
    image.data = map;
    image.width = image.height = MAP;
    fetches[0].tile = fetches[1].tile = tile;
    fetches[0].image = &image;
    fetches[1].image = &nodes;
    CALL(vrtm_asset_fetch(fetches, 1));
    check(map[0] > 0 && map[0] < 1 && map[1] > 0 && map[1] < 1, "the map holds UVs");
    image.data = again;
    fetches[0].whole_width = fetches[0].whole_height = MAP;
    CALL(vrtm_asset_fetch(fetches, 1));
    check(memcmp(map, again, sizeof map) == 0, "a rectangle that is all gives the same");
    fetches[0].whole_width = fetches[0].whole_height = 0;
    memset(again, 0, sizeof again);
    nodes.data = warp;
    nodes.width = nodes.height = MAP + 1;
    fetches[1].kind = VRTM_FETCH_WARP;
    CALL(vrtm_asset_redirect(asset, &positions, &options, fetches, 2));
    check(memcmp(map, again, sizeof map) == 0, "redirect gives the same bits");
    CALL(vrtm_asset_fetch_corner_uvs(asset, 0, corners, CORNERS));
    check(fabsf(corners[0] - 0.1f) < 1e-3f && fabsf(corners[1] - 0.1f) < 1e-3f, "corners have UVs");
    CALL(vrtm_asset_fetch_corner_uvs(asset, 1, corners, CORNERS));
    CALL(vrtm_tile_get_report(tile, &report));
    check(report.struct_size == sizeof report && report.udim == 1001 && report.folds == 0 && report.min_jacobian > 0 &&
              report.energy < report.energy_before && report.measured == 1,
          "the report certifies the result");
    CALL(vrtm_asset_get_report(asset, &whole));
    check(whole.struct_size == sizeof whole && whole.tiles == 2 && whole.bytes > 0, "so does the asset's");
}

static void jobs(vrtm_asset asset, vrtm_tile tile)
{
    vrtm_job job = {0};
    vrtm_job_progress state = vrtm_job_progress_init();
    vrtm_map_desc desc = vrtm_map_desc_init();
    vrtm_map_info data = vrtm_map_info_init();
    vrtm_array positions = vrtm_array_init();
    positions.data = pose;
    positions.count = VERTICES;
    CALL(vrtm_asset_submit(asset, &positions, NULL, &job));
    CALL(vrtm_job_wait(job, VRTM_FOREVER));
    CALL(vrtm_job_get_progress(job, &state));
    check(state.state == VRTM_JOB_DONE && state.status == VRTM_OK && state.progress == 1, "the job is done");
    CALL(vrtm_job_cancel(job));
    CALL(vrtm_job_destroy(job));
    CALL(vrtm_asset_cancel(asset));
    desc.width = desc.height = MAP;
    CALL(vrtm_tile_inspect_map(tile, &desc, &data));
    check(data.folds == 0 && data.min_jacobian > 0, "the map is certified");
}

int main(void)
{
    vrtm_device device = {0};
    vrtm_asset asset = {0};
    vrtm_tile tile = {0};
    check(vrtm_version() / 1000000 == VRTM_VERSION_MAJOR && vrtm_version() >= VRTM_VERSION,
          "the library is as new as the header");
    check(vrtm_last_error()[0] == 0, "no error at first");
    vrtm_tile_settings settings = {0}, same = vrtm_tile_settings_init();
    CALL(vrtm_defaults("vrtm_tile_settings", &settings, sizeof settings));
    check(memcmp(&settings, &same, sizeof same) == 0, "defaults are those of the header");
    check(strcmp(vrtm_status_string(VRTM_ERROR_BUSY), "VRTM_ERROR_BUSY") == 0, "a status has a name");
    make();
    devices(&device);
    assets(device, &asset, &tile);
    tiles(asset, tile);
    solves(asset, tile);
    jobs(asset, tile);
    CALL(vrtm_asset_destroy(asset));
    REFUSED(vrtm_asset_destroy(asset), VRTM_ERROR_INVALID_HANDLE);
    check(strstr(vrtm_last_error(), "vrtm_asset_destroy: ") == vrtm_last_error(), "the message names the function");
    CALL(vrtm_device_destroy(device));
    printf("%d failed\n", failures);
    return failures != 0;
}
