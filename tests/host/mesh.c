/* Meshes as hosts have them: faces without UVs, doubled vertices, halves that lie on the same UVs, and UV sets. */

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

static void without_uvs(void)
{
    static uint32_t indices[CORNERS];
    memcpy(indices, s.indices, sizeof indices);
    for (int c = 0; c < 4 * SIDE; ++c) {
        indices[c] = UINT32_MAX;
    }
    sheet_describe(&s, &d);
    d.mesh.uv_indices = indices;
    vrtm_asset_info data = data_of("faces without UVs");
    check_that(data.faces_untextured == SIDE && data.triangles == 2 * (FACES - SIDE), "are left out", "");
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
    fails("it has no tile", vrtm_asset_get_tile(asset, 0, &tile), BAD, "index");
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

static float mirrored[VERTICES][2];
static vrtm_array halves;
static vrtm_uv_set unique;

/* The halves of the sheet lie on the same UVs in set 0, and on their own in set 1. */
static void describe_halves(void)
{
    for (int k = 0; k < VERTICES; ++k) {
        mirrored[k][0] = 0.05f + 2 * fabsf(s.uvs[k][0] - 0.5f);
        mirrored[k][1] = s.uvs[k][1];
    }
    sheet_describe(&s, &d);
    halves = d.uvs;
    halves.data = mirrored;
    memset(&unique, 0, sizeof unique);
    unique.uvs = &d.uvs;
    unique.uv_indices = s.indices;
    unique.uv_index_count = CORNERS;
    d.mesh.uvs = &halves;
    d.mesh.uv_sets = &unique;
    d.mesh.uv_set_count = 1;
    d.mesh.max_layers = 8;
}

/* Which face has which layer. */
static void layers(vrtm_asset asset)
{
    static uint32_t of_face[FACES];
    vrtm_tile tiles[3], found;
    vrtm_tile_key key;
    vrtm_asset_info facts = vrtm_asset_info_init();
    succeeds("asset_info", vrtm_asset_get_info(asset, &facts));
    check_that(facts.tiles == 3, "two layers and a tile", "");
    for (uint32_t k = 0; k < 3; ++k) {
        succeeds("a tile", vrtm_asset_get_tile(asset, k, &tiles[k]));
    }
    succeeds("its key", vrtm_tile_get_key(tiles[1], &key));
    check_that(key.udim == 1001 && key.uv_set == 0 && key.layer == 1 && key.layers == 2, "is layer 1 of 2", "");
    succeeds("layer 1 by its key", vrtm_asset_find_tile(asset, &key, &found));
    check_that(found.id == tiles[1].id, "is tile 1", "");
    key.layer = 2;
    fails("layer 2", vrtm_asset_find_tile(asset, &key, &found), BAD, "key.layer is 2, but tile 1001 has 2 layers");
    succeeds("that of set 1", vrtm_tile_get_key(tiles[2], &key));
    check_that(key.uv_set == 1 && key.layer == 0 && key.layers == 1, "is layer 0 of 1", "");
    fails("no place for it", vrtm_tile_get_key(tiles[2], NULL), BAD, "key is null");
    succeeds("no layer's number", find_udim(asset, 1001, &found));
    check_that(found.id == tiles[0].id, "is layer 0", "");
    succeeds("face layers", vrtm_asset_fetch_face_layers(asset, 0, of_face, FACES));
    int wrong = 0;
    for (uint32_t f = 0; f < FACES; ++f) {
        /* The left half has the first face. */
        wrong += of_face[f] != (f % SIDE >= SIDE / 2);
    }
    check_that(wrong == 0, "are those of the halves", "");
    succeeds("those of set 1", vrtm_asset_fetch_face_layers(asset, 1, of_face, FACES));
    check_that(of_face[0] == 0 && of_face[FACES - 1] == 0, "are 0", "");
    fails("too few", vrtm_asset_fetch_face_layers(asset, 0, of_face, FACES - 1), BAD, "count");
    fails("no place", vrtm_asset_fetch_face_layers(asset, 0, NULL, FACES), BAD, "layers is null");
    fails("of set 2", vrtm_asset_fetch_face_layers(asset, 2, of_face, FACES), BAD, "uv_set");
    vrtm_tile_info data = vrtm_tile_info_init();
    succeeds("facts of layer 1", vrtm_tile_get_info(tiles[1], &data));
    check_that(data.layer == 1 && data.layers == 2 && data.udim == 1001 && data.overlap == 0, "say so", "");
}

/* Redirections of each layer, and those of set 1 written as UVs of set 0. */
static void maps(vrtm_asset asset)
{
    static float first[MAP * MAP * 2], second[MAP * MAP * 2], other[MAP * MAP * 2], redirect[MAP * MAP * 2];
    static double pose[VERTICES][4];
    vrtm_tile tiles[3];
    for (uint32_t k = 0; k < 3; ++k) {
        succeeds("a tile", vrtm_asset_get_tile(asset, k, &tiles[k]));
    }
    const vrtm_image rigidity = sheet_rigidity(&s);
    /* What is set for layer 1 holds for layer 0. */
    succeeds("rigidity", vrtm_tile_set_rigidity(tiles[1], &rigidity));
    succeeds("rigidity of set 1", vrtm_tile_set_rigidity(tiles[2], &rigidity));
    vrtm_image_out images[3];
    vrtm_fetch fetches[3];
    float *data[3] = {first, second, other};
    for (int k = 0; k < 3; ++k) {
        images[k] = sheet_map(data[k]);
        fetches[k] = vrtm_fetch_init();
        fetches[k].tile = tiles[k];
        fetches[k].image = &images[k];
    }
    /* Both layers, and set 1, as UVs of set 0. */
    fetches[2].kind = VRTM_FETCH_UV_SET;
    sheet_pose(&s, 3, pose);
    const vrtm_array positions = sheet_positions(pose);
    succeeds("redirect", vrtm_asset_redirect(asset, &positions, NULL, fetches, 3));
    vrtm_image_out again = images[2];
    again.data = redirect;
    succeeds("layer 1 again", fetch_image(tiles[1], VRTM_FETCH_REDIRECTION, &again));
    check_that(memcmp(second, redirect, sizeof second) == 0, "is what layer 1 has", "");
    check_that(memcmp(first, second, sizeof first) != 0, "and not what layer 0 has", "");
    succeeds("set 1's own", fetch_image(tiles[2], VRTM_FETCH_REDIRECTION, &again));
    double off = 0, moved = 0;
    for (int y = 4; y < MAP - 4; ++y) {
        for (int x = 4; x < MAP - 4; ++x) {
            const float *uv = redirect + 2 * (y * MAP + x), *found = other + 2 * (y * MAP + x);
            off = fmax(off, fabs(found[0] - (0.05 + 2 * fabs(uv[0] - 0.5))) + fabs(found[1] - uv[1]));
            moved = fmax(moved, fabs(uv[0] - (x + 0.5) / MAP));
        }
    }
    check_that(off < 1e-5 && moved > 1e-3, "and it as UVs of set 0", "");
    static float own[2 * CORNERS], unique_uvs[2 * CORNERS];
    succeeds("corner UVs of set 0", vrtm_asset_fetch_corner_uvs(asset, 0, own, CORNERS));
    succeeds("corner UVs of set 1", vrtm_asset_fetch_corner_uvs(asset, 1, unique_uvs, CORNERS));
    double moved_corners[2] = {0, 0};
    for (int c = 0; c < 2 * CORNERS; ++c) {
        moved_corners[0] = fmax(moved_corners[0], fabs(own[c] - mirrored[s.indices[c / 2]][c % 2]));
        moved_corners[1] = fmax(moved_corners[1], fabs(unique_uvs[c] - s.uvs[s.indices[c / 2]][c % 2]));
    }
    check_that(fmax(moved_corners[0], moved_corners[1]) < 0.2 && fmin(moved_corners[0], moved_corners[1]) > 1e-3,
               "each near its own set, redirected", "");
    fails("corner UVs of set 2", vrtm_asset_fetch_corner_uvs(asset, 2, own, CORNERS), BAD, "uv_set");
    succeeds("nothing", vrtm_asset_fetch(NULL, 0));
    images[1].data = first;
    fails("two in one place", vrtm_asset_fetch(fetches, 3), BAD, "fetches[0].image and fetches[1].image overlap");
    fetches[2].uv_set = 2;
    fails("of set 2", vrtm_asset_fetch(&fetches[2], 1), BAD, "fetches[0].uv_set is 2, but the mesh has 2 UV sets");
    fetches[2].uv_set = 1;
    fetches[2].kind = VRTM_FETCH_REDIRECTION;
    fails("of a kind without a set", vrtm_asset_fetch(&fetches[2], 1), BAD, "fetches[0].uv_set is 1");
    fails("no fetch", vrtm_asset_fetch(NULL, 1), BAD, "fetches is null");
    fetches[0].x = 1;
    fails("a rectangle of nothing", vrtm_asset_fetch(&fetches[0], 1), BAD, "fetches[0].x and y are 1 and 0");
    fetches[0].x = 0;
    fetches[0].reserved = 1;
    fails("a field of a later version", vrtm_asset_fetch(&fetches[0], 1), VRTM_ERROR_UNSUPPORTED, "reserved");
}

static void halves_on_each_other(void)
{
    vrtm_asset asset;
    describe_halves();
    if (succeeds("a mirrored sheet", vrtm_asset_create(device, &d.mesh, &asset))) {
        layers(asset);
        maps(asset);
        succeeds("the asset's end", vrtm_asset_destroy(asset));
    }
}

int main(void)
{
    vrtm_device_desc desc = vrtm_device_desc_init();
    desc.backend = VRTM_BACKEND_CPU;
    sheet_make(&s);
    succeeds("device_create", vrtm_device_create(&desc, &device));
    without_uvs();
    without_tiles();
    doubled();
    halves_on_each_other();
    succeeds("device_destroy", vrtm_device_destroy(device));
    return finish();
}
