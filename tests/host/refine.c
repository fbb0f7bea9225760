/*
 * Refinements through the C API, as a host that knows UV sets only uses them: the pattern once, corner UVs every frame;
 * what it keeps alive, and wrong arguments.
 */

#include "check.h"

static sheet s;
static double pose[VERTICES][4];

/* The arrays of a pattern, and the corner UVs. */
typedef struct refined {
    vrtm_refinement_info data;
    vrtm_refinement_pattern pattern;
    float *uvs;
} refined;

static void *room(size_t count, size_t size)
{
    void *memory = malloc(count * size);
    if (memory == NULL) {
        exit(1);
    }
    return memset(memory, 0x7f, count * size);
}

static void release(refined *r)
{
    free(r->pattern.vertex_sources);
    free(r->pattern.vertex_weights);
    free(r->pattern.face_sources);
    free(r->pattern.face_corners);
    free(r->pattern.corner_vertices);
    free(r->pattern.corner_sources);
    free(r->pattern.corner_weights);
    free(r->pattern.corner_uvs);
    free(r->uvs);
}

/* Reads all of a refinement. */
static refined read_all(vrtm_refinement refinement)
{
    refined r;
    memset(&r, 0, sizeof r);
    r.data = vrtm_refinement_info_init();
    succeeds("info", vrtm_refinement_get_info(refinement, &r.data));
    vrtm_refinement_pattern *p = &r.pattern;
    *p = vrtm_refinement_pattern_init();
    p->vertex_count = (size_t)r.data.vertices;
    p->face_count = (size_t)r.data.faces;
    p->corner_count = (size_t)r.data.corners;
    p->vertex_sources = room(3 * p->vertex_count, sizeof(uint32_t));
    p->vertex_weights = room(3 * p->vertex_count, sizeof(float));
    p->face_sources = room(p->face_count, sizeof(uint32_t));
    p->face_corners = room(p->face_count, sizeof(uint32_t));
    p->corner_vertices = room(p->corner_count, sizeof(uint32_t));
    p->corner_sources = room(3 * p->corner_count, sizeof(uint32_t));
    p->corner_weights = room(3 * p->corner_count, sizeof(float));
    p->corner_uvs = room(2 * p->corner_count, sizeof(float));
    r.uvs = room(2 * p->corner_count, sizeof(float));
    succeeds("the pattern", vrtm_refinement_fetch_pattern(refinement, p));
    succeeds("corner UVs", vrtm_refinement_fetch_corner_uvs(refinement, r.uvs, p->corner_count));
    return r;
}

/* All numbers are in range, and what the pattern makes of the mesh's UVs and positions is what it says. */
static void check_pattern(const refined *r)
{
    const vrtm_refinement_pattern *p = &r->pattern;
    size_t corners = 0, triangles = 0, moved = 0;
    double worst = 0;
    int good = 1;
    for (size_t f = 0; f < p->face_count; ++f) {
        corners += p->face_corners[f];
        triangles += p->face_corners[f] - 2;
        good = good && p->face_sources[f] < FACES && (p->face_corners[f] == 3 || p->face_corners[f] == 4);
    }
    check_that(good && corners == p->corner_count && triangles == r->data.triangles, "faces", "");
    for (size_t v = 0; v < p->vertex_count; ++v) {
        float sum = 0;
        for (int k = 0; k < 3; ++k) {
            good = good && p->vertex_sources[3 * v + k] < VERTICES;
            sum += p->vertex_weights[3 * v + k];
        }
        good = good && sum == 1 && (v >= VERTICES || (p->vertex_sources[3 * v] == v && p->vertex_weights[3 * v] == 1));
    }
    check_that(good, "vertices", "");
    for (size_t c = 0; c < p->corner_count; ++c) {
        const uint32_t vertex = p->corner_vertices[c];
        for (int axis = 0; axis < 2; ++axis) {
            double by_corners = 0, by_vertices = 0;
            for (int k = 0; k < 3; ++k) {
                by_corners += p->corner_weights[3 * c + k] * s.uvs[s.indices[p->corner_sources[3 * c + k]]][axis];
                by_vertices += p->vertex_weights[3 * vertex + k] * s.uvs[p->vertex_sources[3 * vertex + k]][axis];
            }
            worst = fmax(worst, fabs(by_corners - p->corner_uvs[2 * c + axis]));
            worst = fmax(worst, fabs(by_vertices - p->corner_uvs[2 * c + axis]));
        }
        moved += r->uvs[2 * c] != p->corner_uvs[2 * c] || r->uvs[2 * c + 1] != p->corner_uvs[2 * c + 1];
    }
    /* The sheet has one UV per vertex. */
    check_that(worst < 1e-6 && moved > 0, "corners", "");
}

static void wrong_arguments(vrtm_asset asset, vrtm_refinement refinement)
{
    vrtm_refinement none, made = {7};
    vrtm_refinement_desc desc = vrtm_refinement_desc_init();
    vrtm_refinement_info data = vrtm_refinement_info_init();
    vrtm_refinement_pattern pattern = vrtm_refinement_pattern_init();
    float pair[2];
    none.id = 0;
    fails("no place", vrtm_refinement_create(asset, NULL, NULL), BAD, "refinement is null");
    desc.uv_set = 1;
    fails("no such UV set", vrtm_refinement_create(asset, &desc, &made), BAD, "uv_set: 1");
    desc.uv_set = 0, desc.tolerance = -1;
    fails("a wrong tolerance", vrtm_refinement_create(asset, &desc, &made), BAD, "tolerance: -1");
    desc.tolerance = NAN;
    fails("no tolerance", vrtm_refinement_create(asset, &desc, &made), BAD, "tolerance: NaN");
    desc.struct_size = 3;
    fails("no struct", vrtm_refinement_create(asset, &desc, &made), BAD, "desc.struct_size");
    check_that(made.id == 7, "nothing is written", "");
    made.id = asset.id;
    fails("zero", vrtm_refinement_get_info(none, &data), GONE, "refinement: the handle is zero");
    fails("another kind", vrtm_refinement_get_info(made, &data), GONE, "is no living refinement");
    fails("extend it", vrtm_refinement_extend(made), GONE, "is no living refinement");
    fails("its UVs", vrtm_refinement_fetch_corner_uvs(made, pair, 1), GONE, "refinement");
    fails("its pattern", vrtm_refinement_fetch_pattern(made, &pattern), GONE, "refinement");
    fails("end it", vrtm_refinement_destroy(made), GONE, "refinement");
    fails("no data", vrtm_refinement_get_info(refinement, NULL), BAD, "info is null");
    fails("no pattern", vrtm_refinement_fetch_pattern(refinement, NULL), BAD, "pattern is null");
    fails("no room", vrtm_refinement_fetch_corner_uvs(refinement, pair, 1), BAD, "count is 1");
    succeeds("sizes", vrtm_refinement_get_info(refinement, &data));
    fails("no array", vrtm_refinement_fetch_corner_uvs(refinement, NULL, (size_t)data.corners), BAD, "uvs is null");
    fails("no counts", vrtm_refinement_fetch_pattern(refinement, &pattern), BAD, "vertex_count is 0");
    pattern.vertex_count = (size_t)data.vertices;
    pattern.face_count = (size_t)data.faces + 1;
    pattern.corner_count = (size_t)data.corners;
    fails("a face more", vrtm_refinement_fetch_pattern(refinement, &pattern), BAD, "face_count");
    pattern.face_count = (size_t)data.faces;
    succeeds("nothing wanted", vrtm_refinement_fetch_pattern(refinement, &pattern));
    uint32_t *faces = room(2 * pattern.face_count, sizeof *faces);
    pattern.face_sources = faces;
    pattern.face_corners = faces + pattern.face_count;
    succeeds("two arrays side by side", vrtm_refinement_fetch_pattern(refinement, &pattern));
    pattern.face_corners -= 1;
    faces[0] = 12345;
    fails("that overlap", vrtm_refinement_fetch_pattern(refinement, &pattern), BAD,
          "pattern.face_sources and pattern.face_corners overlap");
    check_that(faces[0] == 12345, "are not written", "");
    free(faces);
}

int main(void)
{
    scene made;
    vrtm_refinement refinement = {0};
    sheet_make(&s);
    const vrtm_array points = sheet_positions(pose);
    went_well("a scene", scene_make(&made, &s, NULL, 0));
    const vrtm_asset asset = made.asset;
    fails("too early", vrtm_refinement_create(asset, NULL, &refinement), VRTM_ERROR_NOT_SOLVED, "solve first");
    vrtm_refinement_desc desc = vrtm_refinement_desc_init();
    desc.max_triangles = 2 * FACES + 100;

    /* Once: a topology for two frames. */
    sheet_pose(&s, 3, pose);
    succeeds("a frame", vrtm_asset_solve(asset, &points, NULL));
    succeeds("little room", vrtm_refinement_create(asset, &desc, &refinement));
    vrtm_refinement_info data = vrtm_refinement_info_init();
    succeeds("its sizes", vrtm_refinement_get_info(refinement, &data));
    check_that(data.triangles <= desc.max_triangles && data.reached == 0 && data.error > data.tolerance,
               "is used, and it says what is left", "");
    succeeds("its end", vrtm_refinement_destroy(refinement));
    fails("once", vrtm_refinement_destroy(refinement), GONE, "is no living refinement");
    succeeds("a refinement", vrtm_refinement_create(asset, NULL, &refinement));
    succeeds("its sizes", vrtm_refinement_get_info(refinement, &data));
    check_that(data.reached == 1 && data.error > 0 && data.error <= data.tolerance && data.tolerance == 1.0 / 2048 &&
                   data.faces > FACES && data.bytes > 0,
               "keeps its tolerance", "");
    sheet_pose(&s, 6, pose);
    succeeds("another frame", vrtm_asset_solve(asset, &points, NULL));
    succeeds("extend", vrtm_refinement_extend(refinement));
    refined both = read_all(refinement);
    check_that(both.data.vertices > data.vertices && both.data.reached == 1, "splits more", "");
    check_pattern(&both);

    /* Every frame: solve, and fetch. */
    sheet_pose(&s, 3, pose);
    succeeds("back", vrtm_asset_solve(asset, &points, NULL));
    float *uvs = room(2 * both.pattern.corner_count, sizeof *uvs);
    succeeds("UVs of this frame", vrtm_refinement_fetch_corner_uvs(refinement, uvs, both.pattern.corner_count));
    check_that(memcmp(uvs, both.uvs, 2 * both.pattern.corner_count * sizeof *uvs) != 0, "are others", "");
    wrong_arguments(asset, refinement);

    /* It goes on without the asset and the device. */
    went_well("the scene's end", scene_end(&made));
    succeeds("once more", vrtm_refinement_fetch_corner_uvs(refinement, both.uvs, both.pattern.corner_count));
    check_that(memcmp(both.uvs, uvs, 2 * both.pattern.corner_count * sizeof *uvs) == 0, "has the last result", "");
    succeeds("extend it", vrtm_refinement_extend(refinement));
    succeeds("its end", vrtm_refinement_destroy(refinement));
    fails("is one", vrtm_refinement_extend(refinement), GONE, "is no living refinement");
    release(&both);
    free(uvs);
    return finish();
}
