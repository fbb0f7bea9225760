/* Shared by the C and C++ hosts: printing a line per case, a small mesh, a pose, and maps. */

#ifndef CHECK_H
#define CHECK_H

#include "vrtm.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures;

static inline int check_that(int good, const char *name, const char *detail)
{
    if (good) {
        printf("ok   %s\n", name);
    } else {
        printf("FAIL %s (%s)\n", name, detail);
        failures += 1;
    }
    fflush(stdout);
    return good;
}

/* Expects that the call succeeds. */
static inline int succeeds(const char *name, vrtm_status status)
{
    return check_that(status == VRTM_OK, name, status == VRTM_OK ? "" : vrtm_last_error());
}

/* Statuses for a wrong argument, and for a handle of nothing. */
#define BAD VRTM_ERROR_INVALID_ARGUMENT
#define GONE VRTM_ERROR_INVALID_HANDLE

/* Expects that the call fails with this status, and that the message contains `text`. */
static inline int fails(const char *name, vrtm_status status, vrtm_status wanted, const char *text)
{
    char detail[700];
    snprintf(detail, sizeof detail, "%s: %s", vrtm_status_string(status), vrtm_last_error());
    return check_that(status == wanted && strstr(vrtm_last_error(), text) != NULL, name, detail);
}

/* The tile with this UDIM number in UV set 0. */
static inline vrtm_status find_udim(vrtm_asset asset, uint32_t udim, vrtm_tile *tile)
{
    const vrtm_tile_key key = {udim, 0, 0, 0};
    return vrtm_asset_find_tile(asset, &key, tile);
}

/* One image of a tile: of a whole of `width` x `height` texels the rectangle that begins at (x, y). */
static inline vrtm_status fetch_rectangle(vrtm_tile tile, vrtm_fetch_kind kind, const vrtm_image_out *image, uint32_t x,
                                          uint32_t y, uint32_t width, uint32_t height)
{
    vrtm_fetch fetch = vrtm_fetch_init();
    fetch.tile = tile;
    fetch.kind = kind;
    fetch.image = image;
    fetch.x = x;
    fetch.y = y;
    fetch.whole_width = width;
    fetch.whole_height = height;
    return vrtm_asset_fetch(&fetch, 1);
}

/* One whole image of a tile. */
static inline vrtm_status fetch_image(vrtm_tile tile, vrtm_fetch_kind kind, const vrtm_image_out *image)
{
    return fetch_rectangle(tile, kind, image, 0, 0, 0, 0);
}

static inline int finish(void)
{
    printf("%d failed\n", failures);
    return failures == 0 ? 0 : 1;
}

/* A square sheet of SIDE x SIDE quads in one chart, with one UV per vertex. */
enum {
    SIDE = 12,
    VERTICES = (SIDE + 1) * (SIDE + 1),
    FACES = SIDE * SIDE,
    CORNERS = 4 * FACES,
    MAP = 64
};

typedef struct sheet {
    double points[VERTICES][4]; /* as Maya hands them over: the fourth coordinate is 1 */
    float uvs[VERTICES][2];
    uint32_t counts[FACES];
    uint32_t indices[CORNERS];
    uint8_t rigidity[MAP][MAP]; /* a few discs, first row on top */
} sheet;

static inline void sheet_make(sheet *s)
{
    for (int j = 0; j <= SIDE; ++j) {
        for (int i = 0; i <= SIDE; ++i) {
            const int k = j * (SIDE + 1) + i;
            const double u = i / (double)SIDE, v = j / (double)SIDE;
            s->points[k][0] = 10 * u;
            s->points[k][1] = 10 * v;
            s->points[k][2] = 0;
            s->points[k][3] = 1;
            s->uvs[k][0] = (float)(0.05 + 0.9 * u);
            s->uvs[k][1] = (float)(0.05 + 0.9 * v);
        }
    }
    for (int j = 0; j < SIDE; ++j) {
        for (int i = 0; i < SIDE; ++i) {
            const uint32_t a = (uint32_t)(j * (SIDE + 1) + i), face = (uint32_t)(j * SIDE + i);
            s->counts[face] = 4;
            s->indices[4 * face] = a;
            s->indices[4 * face + 1] = a + 1;
            s->indices[4 * face + 2] = a + SIDE + 2;
            s->indices[4 * face + 3] = a + SIDE + 1;
        }
    }
    for (int y = 0; y < MAP; ++y) {
        for (int x = 0; x < MAP; ++x) {
            const double dx = fmod(x + 0.5, 16) - 8, dy = fmod(y + 0.5, 16) - 8;
            s->rigidity[y][x] = dx * dx + dy * dy < 25 ? 255 : 0;
        }
    }
}

/* Frame 0 is the rest pose; others push a bulge through the sheet that moves with the frame. */
static inline void sheet_pose(const sheet *s, int frame, double (*points)[4])
{
    for (int k = 0; k < VERTICES; ++k) {
        const double dx = s->points[k][0] - 3 - 0.4 * frame, dy = s->points[k][1] - 5;
        const double lift = frame == 0 ? 0 : exp(-(dx * dx + dy * dy) / 4);
        points[k][0] = s->points[k][0] * (1 + 0.02 * frame);
        points[k][1] = s->points[k][1];
        points[k][2] = 2.5 * lift;
        points[k][3] = 1;
    }
}

static inline vrtm_array sheet_positions(const void *points)
{
    vrtm_array a = vrtm_array_init();
    a.format = VRTM_SCALAR_F64;
    a.data = points;
    a.count = VERTICES;
    a.stride = 4 * sizeof(double);
    return a;
}

/* The descriptor points to the sheet's arrays, which the caller must keep. */
typedef struct sheet_desc {
    vrtm_array positions, uvs;
    vrtm_mesh_desc mesh;
} sheet_desc;

static inline void sheet_describe(const sheet *s, sheet_desc *d)
{
    d->positions = sheet_positions(s->points);
    d->uvs = vrtm_array_init();
    d->uvs.data = s->uvs;
    d->uvs.count = VERTICES;
    d->mesh = vrtm_mesh_desc_init();
    d->mesh.positions = &d->positions;
    d->mesh.face_counts = s->counts;
    d->mesh.face_count = FACES;
    d->mesh.indices = s->indices;
    d->mesh.index_count = CORNERS;
    d->mesh.uvs = &d->uvs;
    d->mesh.uv_indices = s->indices;
    d->mesh.uv_index_count = CORNERS;
}

static inline vrtm_image sheet_rigidity(const sheet *s)
{
    vrtm_image image = vrtm_image_init();
    image.format = VRTM_PIXEL_U8;
    image.data = s->rigidity;
    image.width = MAP;
    image.height = MAP;
    return image;
}

/* In a function that returns null, or what went wrong: threads and children do not print. */
#define TRY(call)                 \
    if ((call) != VRTM_OK) {      \
        return vrtm_last_error(); \
    }

/* A device with an asset of the sheet, and its tile, which has the sheet's rigidity. */
typedef struct scene {
    vrtm_device device;
    vrtm_asset asset;
    vrtm_tile tile;
} scene;

/* On the scene's own device. The grid has so many cells per side, or with 0 as many as the library takes. */
static inline const char *scene_on_device(scene *made, const sheet *s, uint32_t grid)
{
    sheet_desc d;
    const vrtm_image rigidity = sheet_rigidity(s);
    vrtm_tile_settings settings = vrtm_tile_settings_init();
    settings.grid_width = settings.grid_height = grid;
    sheet_describe(s, &d);
    TRY(vrtm_asset_create(made->device, &d.mesh, &made->asset))
    TRY(find_udim(made->asset, 1001, &made->tile))
    TRY(vrtm_tile_set_settings(made->tile, &settings))
    TRY(vrtm_tile_set_rigidity(made->tile, &rigidity))
    return NULL;
}

static inline const char *scene_make(scene *made, const sheet *s, const vrtm_device_desc *desc, uint32_t grid)
{
    TRY(vrtm_device_create(desc, &made->device))
    return scene_on_device(made, s, grid);
}

static inline const char *scene_end(const scene *made)
{
    TRY(vrtm_asset_destroy(made->asset))
    TRY(vrtm_device_destroy(made->device))
    return NULL;
}

/* Expects that such a function returned null. */
static inline int went_well(const char *name, const char *wrong)
{
    return check_that(wrong == NULL, name, wrong != NULL ? wrong : "");
}

/* An image of MAP x MAP texels of two floats. */
static inline vrtm_image_out sheet_map(float *texels)
{
    vrtm_image_out image = vrtm_image_out_init();
    image.data = texels;
    image.width = image.height = MAP;
    return image;
}

/* The redirection. */
static inline vrtm_status fetch_map(vrtm_tile tile, float *texels)
{
    const vrtm_image_out image = sheet_map(texels);
    return fetch_image(tile, VRTM_FETCH_REDIRECTION, &image);
}

#endif
