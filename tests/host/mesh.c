/* Meshes as hosts have them: offsets, faces without UVs, slits, vertices that are doubled. layers.c has UV sets. */

#include "check.h"

static vrtm_device device;
static sheet s;
static sheet_desc d;

/* Makes an asset, reads its data, and ends it. */
static vrtm_asset_info data_of(const char *name)
{
    vrtm_asset_info data = vrtm_asset_info_init();
    vrtm_asset asset;
    if (succeeds(name, vrtm_asset_create(device, &d.mesh, &asset))) {
        succeeds("its data", vrtm_asset_get_info(asset, &data));
        succeeds("its end", vrtm_asset_destroy(asset));
    }
    return data;
}

static void offsets(void)
{
    static uint32_t offsets[FACES + 3];
    for (int k = 0; k <= FACES; ++k) {
        offsets[k] = (uint32_t)(4 * k);
    }
    sheet_describe(&s, &d);
    d.mesh.face_counts = NULL;
    d.mesh.face_offsets = offsets;
    d.mesh.face_offset_count = FACES + 1;
    vrtm_asset_info data = data_of("offsets");
    check_that(data.faces == FACES && data.charts == 1 && data.uv_sets == 1, "are counts", "");
    check_that(data.border_edges == 4 * SIDE && data.welded_edges == 0 && data.edges_apart == 0, "one border", "");
    /* The last quad becomes two lines. */
    offsets[FACES] = CORNERS - 2;
    offsets[FACES + 1] = CORNERS;
    d.mesh.face_offset_count = FACES + 2;
    data = data_of("lines");
    check_that(data.faces == FACES + 1 && data.faces_skipped == 2 && data.triangles == 2 * FACES - 2, "are skipped", "");
}

static void without_uvs(void)
{
    static uint32_t indices[CORNERS], chosen[FACES / 2];
    memcpy(indices, s.indices, sizeof indices);
    for (int c = 0; c < 4 * SIDE; ++c) {
        indices[c] = UINT32_MAX;
    }
    sheet_describe(&s, &d);
    d.mesh.uv_indices = indices;
    vrtm_asset_info data = data_of("faces without UVs");
    check_that(data.faces_untextured == SIDE && data.triangles == 2 * (FACES - SIDE), "are left out", "");
    for (uint32_t f = 0; f < FACES / 2; ++f) {
        chosen[f] = FACES - 1 - f;
    }
    d.mesh.textured_faces = chosen;
    d.mesh.textured_face_count = FACES / 2;
    data = data_of("the upper half");
    check_that(data.faces_untextured == FACES / 2 && data.triangles == FACES, "carries the texture", "");
}

/* All calls for an asset without tiles, whose faces have no texture, on a device with a memory budget. */
static void without_tiles(void)
{
    static uint32_t indices[CORNERS], layers[FACES];
    static float uvs[2 * CORNERS], ones[VERTICES];
    vrtm_device_desc desc = vrtm_device_desc_init();
    vrtm_asset_report report = vrtm_asset_report_init();
    vrtm_solve_options options = vrtm_solve_options_init();
    const vrtm_array positions = sheet_positions(s.points);
    vrtm_array rigidity = vrtm_array_init();
    const vrtm_refinement_desc fine = vrtm_refinement_desc_init();
    vrtm_device limited;
    vrtm_asset asset;
    vrtm_tile tile;
    vrtm_job job;
    vrtm_refinement refinement;
    memset(indices, 0xff, sizeof indices);
    for (int v = 0; v < VERTICES; ++v) {
        ones[v] = 1;
    }
    rigidity.data = ones;
    rigidity.count = VERTICES;
    desc.memory_budget = 1000000000;
    options.measure = 1;
    options.replace = 1;
    options.scale = VRTM_SCALE_FOLLOW;
    options.time_budget_ms = 1000;
    sheet_describe(&s, &d);
    d.mesh.uv_indices = indices;
    succeeds("a device with a budget", vrtm_device_create(&desc, &limited));
    succeeds("a mesh without texture", vrtm_asset_create(limited, &d.mesh, &asset));
    succeeds("rigidity", vrtm_asset_set_vertex_rigidity(asset, &rigidity));
    fails("it has no tile", vrtm_asset_get_tile(asset, 0, &tile), VRTM_ERROR_INVALID_ARGUMENT, "index");
    succeeds("is solved", vrtm_asset_solve(asset, &positions, NULL));
    succeeds("is submitted", vrtm_asset_submit(asset, &positions, &options, &job));
    succeeds("is done", vrtm_job_wait(job, VRTM_FOREVER));
    succeeds("the job's end", vrtm_job_destroy(job));
    succeeds("its report", vrtm_asset_get_report(asset, &report));
    check_that(report.tiles == 0 && report.scale == 1 && report.scale_spread == 0, "tells of nothing", "");
    succeeds("its UVs", vrtm_asset_fetch_corner_uvs(asset, 0, uvs, CORNERS));
    succeeds("its layers", vrtm_asset_fetch_face_layers(asset, 0, layers, FACES));
    succeeds("a refinement", vrtm_refinement_create(asset, &fine, &refinement));
    succeeds("is extended", vrtm_refinement_extend(refinement));
    succeeds("its end", vrtm_refinement_destroy(refinement));
    succeeds("its end", vrtm_asset_destroy(asset));
    succeeds("the device's end", vrtm_device_destroy(limited));
}

static int torn_lines;

static void count_torn(void *user, const vrtm_log_entry *entry)
{
    *(int *)user += entry->code == VRTM_LOG_CODE_WELDS_TORN && entry->udim == 1001 && entry->values[0] == SIDE;
}

/* Every face has vertices of its own, an ulp from the others'. The pose lifts the upper half of the sheet away. */
static void doubled(void)
{
    static float points[CORNERS][3], uvs[CORNERS][2];
    static uint32_t corners[CORNERS];
    vrtm_device logging;
    vrtm_asset asset;
    vrtm_tile tile;
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.log = count_torn;
    desc.log_user = &torn_lines;
    succeeds("a device with a log", vrtm_device_create(&desc, &logging));
    for (int c = 0; c < CORNERS; ++c) {
        for (int k = 0; k < 3; ++k) {
            points[c][k] = nextafterf((float)s.points[s.indices[c]][k] + 1, (float)(c % 3));
        }
        for (int k = 0; k < 2; ++k) {
            uvs[c][k] = nextafterf(s.uvs[s.indices[c]][k], (float)(c % 2));
        }
        corners[c] = (uint32_t)c;
    }
    vrtm_array positions = vrtm_array_init(), pairs = vrtm_array_init();
    positions.data = points;
    pairs.data = uvs;
    positions.count = pairs.count = CORNERS;
    sheet_describe(&s, &d);
    d.mesh.positions = &positions;
    d.mesh.uvs = &pairs;
    d.mesh.indices = d.mesh.uv_indices = corners;
    vrtm_asset_info data = data_of("doubled vertices");
    check_that(data.charts == FACES && data.edges_apart == 2 * SIDE * (SIDE - 1), "are apart, which is told", "");
    d.mesh.weld = VRTM_WELD_POSITION;
    data = data_of("welded by position");
    check_that(data.charts == 1 && data.edges_apart == 0 && data.welded_edges == 2 * SIDE * (SIDE - 1), "are one", "");
    if (!succeeds("once more", vrtm_asset_create(logging, &d.mesh, &asset))) {
        return;
    }
    const vrtm_image rigidity = sheet_rigidity(&s);
    succeeds("find_tile", find_udim(asset, 1001, &tile));
    succeeds("rigidity", vrtm_tile_set_rigidity(tile, &rigidity));
    vrtm_tile_report report = vrtm_tile_report_init();
    for (int c = 0; c < CORNERS; ++c) {
        points[c][0] *= 1.2f;
    }
    succeeds("a stretched pose", vrtm_asset_solve(asset, &positions, NULL));
    succeeds("its report", vrtm_tile_get_report(tile, &report));
    check_that(report.welds_torn == 0 && report.charts == 1 && torn_lines == 0, "nothing is torn", "");
    for (int c = CORNERS / 2; c < CORNERS; ++c) {
        points[c][2] += 1;
    }
    succeeds("a torn pose", vrtm_asset_solve(asset, &positions, NULL));
    succeeds("its report", vrtm_tile_get_report(tile, &report));
    check_that(report.welds_torn == SIDE && report.charts == 2 && torn_lines == 1, "is torn in the middle", "");
    succeeds("the same again", vrtm_asset_solve(asset, &positions, NULL));
    check_that(torn_lines == 1, "is warned of once", "");
    succeeds("its end", vrtm_asset_destroy(asset));
    succeeds("the device's end", vrtm_device_destroy(logging));
}

int main(void)
{
    sheet_make(&s);
    succeeds("device_create", vrtm_device_create(NULL, &device));
    offsets();
    without_uvs();
    without_tiles();
    doubled();
    succeeds("device_destroy", vrtm_device_destroy(device));
    return finish();
}
