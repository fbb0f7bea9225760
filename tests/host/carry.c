/*
 * Carriers through the C API: points with rows of their own stride, what they keep alive, and wrong arguments.
 */

#include "check.h"

static sheet s;
static double pose[VERTICES][4];

/* A point of a host's: everything that is carried, interleaved. */
typedef struct point {
    double position[3];
    float rotation[4];
    float stretch[2];
    float uv[2];
    float own;
} point;

enum { POINTS = 25 };

static point points[POINTS];
static float uvs[POINTS][2];

static vrtm_array_out rows(void *first, vrtm_scalar format)
{
    vrtm_array_out out = vrtm_array_out_init();
    out.data = first;
    out.format = format;
    out.count = POINTS;
    out.stride = sizeof(point);
    return out;
}

/* All arrays of the points. */
typedef struct request {
    vrtm_array_out positions, rotations, stretch, uvs;
    vrtm_carried carried;
} request;

static void ask(request *r)
{
    r->positions = rows(points[0].position, VRTM_SCALAR_F64);
    r->rotations = rows(points[0].rotation, VRTM_SCALAR_F32);
    r->stretch = rows(points[0].stretch, VRTM_SCALAR_F32);
    r->uvs = rows(points[0].uv, VRTM_SCALAR_F32);
    r->carried = vrtm_carried_init();
    r->carried.positions = &r->positions;
    r->carried.rotations = &r->rotations;
    r->carried.stretch = &r->stretch;
    r->carried.uvs = &r->uvs;
}

static void wrong_arguments(vrtm_asset asset, vrtm_carrier carrier)
{
    vrtm_carrier made = {7}, none = {0};
    vrtm_carrier_desc desc = vrtm_carrier_desc_init();
    vrtm_carrier_info data = vrtm_carrier_info_init();
    vrtm_point_state states[POINTS];
    vrtm_array at = vrtm_array_init(), matrix = vrtm_array_init();
    static const float zeros[POINTS][9];
    request r;
    at.data = uvs, at.count = POINTS;
    fails("no desc", vrtm_carrier_create(asset, NULL, &made), BAD, "desc is null");
    fails("no place", vrtm_carrier_create(asset, &desc, NULL), BAD, "carrier is null");
    fails("no UVs", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.uvs is null");
    desc.uvs = &at, desc.bind = 3;
    fails("no such way", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.bind is 3");
    desc.bind = VRTM_BIND_CORNERS;
    fails("no weights", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.weights is null");
    desc.bind = VRTM_BIND_NEAREST;
    fails("no positions", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.positions is null");
    desc.bind = VRTM_BIND_UV, desc.fit = 9;
    fails("no such fit", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.fit is 9");
    desc.fit = 0, desc.skirt = NAN;
    fails("no skirt", vrtm_carrier_create(asset, &desc, &made), BAD, "skirt");
    desc.skirt = 0, desc.uv_set = 1;
    fails("no such UV set", vrtm_carrier_create(asset, &desc, &made), BAD, "uv_set: 1");
    desc.uv_set = 0, desc.frames = &at, desc.matrices = &at;
    fails("two frames", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.frames");
    desc.frames = NULL, matrix.data = zeros, matrix.count = POINTS, desc.matrices = &matrix;
    fails("no rotation", vrtm_carrier_create(asset, &desc, &made), BAD, "matrices[0] is zero");
    desc.matrices = NULL, at.stride = 4;
    fails("a short stride", vrtm_carrier_create(asset, &desc, &made), BAD, "desc.uvs.stride");
    check_that(made.id == 7, "nothing is written", "");
    made.id = asset.id;
    fails("zero", vrtm_carrier_get_info(none, &data), GONE, "carrier: the handle is zero");
    fails("another kind", vrtm_carrier_fetch(made, &r.carried), GONE, "is no living carrier");
    fails("end it", vrtm_carrier_destroy(made), GONE, "carrier");
    fails("no data", vrtm_carrier_get_info(carrier, NULL), BAD, "info is null");
    fails("no states", vrtm_carrier_fetch_states(carrier, NULL, POINTS), BAD, "states is null");
    fails("too few", vrtm_carrier_fetch_states(carrier, states, 3), BAD, "count is 3");
    fails("nothing to write to", vrtm_carrier_fetch(carrier, NULL), BAD, "carried is null");
    ask(&r), r.positions.count = 3;
    fails("too short", vrtm_carrier_fetch(carrier, &r.carried), BAD, "carried.positions.count is 3");
    ask(&r), r.stretch.data = points[0].rotation + 2;
    fails("they overlap", vrtm_carrier_fetch(carrier, &r.carried), BAD, "carried.rotations and carried.stretch");
    ask(&r), r.carried.matrices = &r.rotations;
    fails("two rotations", vrtm_carrier_fetch(carrier, &r.carried), BAD, "carried.matrices");
    ask(&r), r.uvs.format = 5;
    fails("no such format", vrtm_carrier_fetch(carrier, &r.carried), BAD, "carried.uvs.format is 5");
    ask(&r), r.uvs.data = NULL;
    fails("no memory", vrtm_carrier_fetch(carrier, &r.carried), BAD, "carried.uvs.data is null");
}

/* An empty scatter is a carrier, too, and what `bind` does not name is ignored. */
static void empty(vrtm_asset asset)
{
    vrtm_carrier_desc desc = vrtm_carrier_desc_init();
    vrtm_array none = vrtm_array_init();
    vrtm_array_out nowhere = vrtm_array_out_init();
    vrtm_carried carried = vrtm_carried_init();
    vrtm_carrier made;
    desc.uvs = desc.weights = desc.positions = desc.heights = desc.frames = &none;
    carried.positions = carried.rotations = carried.stretch = carried.uvs = &nowhere;
    for (desc.bind = 0; desc.bind < 3; ++desc.bind) {
        succeeds("no points", vrtm_carrier_create(asset, &desc, &made));
        succeeds("no states", vrtm_carrier_fetch_states(made, NULL, 0));
        succeeds("nothing to write", vrtm_carrier_fetch(made, &carried));
        succeeds("it goes", vrtm_carrier_destroy(made));
    }
}

/* Carried points and an image as outputs of one solve. */
static void with_the_solve(vrtm_asset asset, vrtm_asset other, vrtm_tile tile, vrtm_carrier carrier,
                           const vrtm_array *posed)
{
    static float map[8][8][2], same[8][8][2];
    static point expected[POINTS];
    request r;
    vrtm_image_out image = vrtm_image_out_init();
    vrtm_fetch all[2] = {vrtm_fetch_init(), vrtm_fetch_init()};
    vrtm_fetch *const points_of = &all[1];
    ask(&r);
    image.width = 8, image.height = 8, image.data = map;
    all[0].tile = tile, all[0].image = &image;
    points_of->kind = VRTM_FETCH_CARRIED, points_of->carrier = carrier, points_of->carried = &r.carried;
    memset(points, 7, sizeof points);
    fails("before any solve", vrtm_asset_fetch(all, 2), VRTM_ERROR_NOT_SOLVED, "");
    fails("of another asset", vrtm_asset_redirect(other, posed, NULL, points_of, 1), BAD,
          "fetches[0].carrier belongs to another asset");
    points_of->tile = tile;
    fails("a tile's, too", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[1]: fields of images");
    points_of->tile.id = 0, points_of->x = 1;
    fails("a part", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[1]: fields of images");
    points_of->x = 0, points_of->carried = NULL;
    fails("nowhere", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[1].carried is null");
    points_of->carried = &r.carried, all[0].carrier = carrier;
    fails("an image's", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[0].carrier and carried");
    all[0].carrier.id = 0, image.data = points;
    fails("they overlap", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[0].image and fetches[1]");
    image.data = map, r.positions.data = pose, r.positions.stride = 0;
    fails("over the pose", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD,
          "fetches[1].carried.positions and positions overlap");
    ask(&r), r.uvs.count = 3;
    fails("too short", vrtm_asset_redirect(asset, posed, NULL, all, 2), BAD, "fetches[1].carried.uvs.count is 3");
    ask(&r);
    check_that(points[3].own != 0 && map[4][4][0] == 0, "nothing is written", "");
    fails("nothing is solved", vrtm_asset_fetch(all, 2), VRTM_ERROR_NOT_SOLVED, "");
    succeeds("a solve with both", vrtm_asset_redirect(asset, posed, NULL, all, 2));
    memcpy(expected, points, sizeof points);
    memset(points, 7, sizeof points);
    succeeds("points alone", vrtm_carrier_fetch(carrier, &r.carried));
    check_that(memcmp(expected, points, sizeof points) == 0, "are the same", "");
    memset(points, 7, sizeof points);
    image.data = same;
    succeeds("both again", vrtm_asset_fetch(all, 2));
    check_that(memcmp(expected, points, sizeof points) == 0 && memcmp(map, same, sizeof map) == 0, "too", "");
}

int main(void)
{
    scene made;
    vrtm_asset other;
    vrtm_carrier carrier;
    sheet_desc d;
    request r;
    vrtm_point_state states[POINTS];
    vrtm_carrier_info data = vrtm_carrier_info_init();
    vrtm_carrier_desc desc = vrtm_carrier_desc_init();
    vrtm_array at = vrtm_array_init(), posed = vrtm_array_init();
    sheet_make(&s);
    sheet_pose(&s, 3, pose);
    sheet_describe(&s, &d);
    went_well("a scene", scene_make(&made, &s, NULL, 0));
    const vrtm_asset asset = made.asset;
    for (int k = 0; k < POINTS; ++k) {
        uvs[k][0] = 0.3F + 0.1F * (float)(k % 5);
        uvs[k][1] = 0.3F + 0.1F * (float)(k / 5);
        points[k].own = 7;
    }
    at.data = uvs, at.count = POINTS;
    desc.uvs = &at, desc.weights = &posed;
    succeeds("a carrier, without weights,", vrtm_carrier_create(asset, &desc, &carrier));
    succeeds("states", vrtm_carrier_fetch_states(carrier, states, POINTS));
    check_that(states[0] == VRTM_POINT_BOUND && states[24] == VRTM_POINT_BOUND, "are bound", "");
    wrong_arguments(asset, carrier);
    ask(&r);
    fails("no solve yet", vrtm_carrier_fetch(carrier, &r.carried), VRTM_ERROR_NOT_SOLVED, "");
    posed.data = pose, posed.format = VRTM_SCALAR_F64, posed.count = VERTICES, posed.stride = sizeof pose[0];
    succeeds("another asset", vrtm_asset_create(made.device, &d.mesh, &other));
    with_the_solve(asset, other, made.tile, carrier, &posed);
    succeeds("which goes", vrtm_asset_destroy(other));
    for (int k = 0; k < POINTS; ++k) {
        points[k].own = 7;
    }
    posed.data = s.points, posed.stride = sizeof s.points[0];
    succeeds("rest", vrtm_asset_solve(asset, &posed, NULL));
    succeeds("fetch", vrtm_carrier_fetch(carrier, &r.carried));
    empty(asset);
    int good = 1;
    for (int k = 0; k < POINTS; ++k) {
        const point *p = &points[k];
        good = good && fabsf(p->rotation[3]) > 0.999999F && fabsf(p->stretch[0] - 1) < 1e-5F && p->own == 7 &&
               p->uv[0] == uvs[k][0] && p->uv[1] == uvs[k][1];
    }
    check_that(good, "nothing turns, stretches or moves at rest", "");
    const point before = points[12];
    posed.data = pose;
    succeeds("a pose", vrtm_asset_solve(asset, &posed, NULL));
    succeeds("the asset goes", vrtm_asset_destroy(asset));
    succeeds("fetch again", vrtm_carrier_fetch(carrier, &r.carried));
    vrtm_fetch alone = vrtm_fetch_init();
    alone.kind = VRTM_FETCH_CARRIED, alone.carrier = carrier, alone.carried = &r.carried;
    succeeds("and again", vrtm_asset_fetch(&alone, 1));
    check_that(memcmp(before.position, points[12].position, sizeof before.position) != 0, "it has moved", "");
    succeeds("info", vrtm_carrier_get_info(carrier, &data));
    check_that(data.points == POINTS && data.outside == 0 && data.bytes > 0, "of all points", "");
    succeeds("the carrier goes", vrtm_carrier_destroy(carrier));
    fails("twice", vrtm_carrier_destroy(carrier), GONE, "is no living carrier");
    succeeds("the device goes", vrtm_device_destroy(made.device));
    return finish();
}
